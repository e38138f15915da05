"""What the tests of robots' behaviors share."""

from itertools import groupby

import numpy as np
from tests.scenes import digests, path, run, scenario, table
from tests.thorough import some

CAMERA = {"range": [0.2, 4.5], "angle_deg": 108, "lost_after": "5 s"}
SIT = {"days": [{"items": [{"at": "00:00", "place": [7.0, 6.0]}]}]}
OUT = {"type": "schedule", "days": [{"items": [{"at": "00:00", "away": True}]}]}
SHARE = {"share": {"type": "tests.own_components:Share", "period": "5 min"}}


def home_with(behaviors, duration="1 h", ana=None, **sections):
    """The flat with a robot, and Ana, who is in the bathroom all day unless told otherwise."""
    ana = {"type": "schedule", **SIT} if ana is None else ana
    astro = {
        "start": [1.0, 3.0],
        "start_heading_deg": 0,
        "camera": CAMERA,
        "behaviors": behaviors,
        **sections.pop("astro", {}),
    }
    return scenario(duration, users={"ana": ana}, robots={"astro": astro}, **sections)


def events(stored, entity="astro"):
    """The events of a body: step, event, detail."""
    rows = table(stored, "events", entity=entity)
    return list(
        zip(rows["step"].tolist(), rows["event"].tolist(), rows["detail"].tolist(), strict=True)
    )


def names(stored):
    """The events of the robot but those of its camera."""
    return [name for _, name, _ in events(stored) if name not in ("user_seen", "user_lost")]


def rooms(stored, still_s=20):
    """The rooms in which the robot stood still, in order."""
    poses = path(stored, "astro")
    names_of_rooms = []
    for xy, steps in groupby(zip(poses.x.tolist(), poses.y.tolist(), strict=True)):
        if sum(1 for _ in steps) >= still_s:
            room = stored.plan.room_at(*xy)
            names_of_rooms.append("" if room is None else room.name)
    return [room for room, _ in groupby(names_of_rooms)]


def rooms_of(stored, entity="astro"):
    """The room that a body is in at each step."""
    poses = path(stored, entity)
    points = np.stack([poses.x, poses.y], axis=1)
    known = {}
    for xy in map(tuple, np.unique(points, axis=0).tolist()):
        room = stored.plan.room_at(*xy)
        known[xy] = "" if room is None else room.name
    return [known[xy] for xy in map(tuple, points.tolist())]


def assert_same_for_every_max_span(content, *spans):
    """A run is the same however it is cut into spans; returns it."""
    whole = run(content)
    for span in some(spans or (61, 1), 2):
        assert digests(whole) == digests(run(content, max_span=span)), span
    return whole
