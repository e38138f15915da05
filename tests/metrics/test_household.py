"""What a household makes of its robots, compared with a slow twin that reads the tables."""

from math import dist
from typing import Any

import numpy as np
import pytest
from tests.entities.robots.robots import home_with
from tests.scenes import path, run, table

from fleet2d import Simulation
from fleet2d.engine.access import measured
from fleet2d.metrics.household import TERMS, has_time
from fleet2d.runs.run import Run

PRIVATE = ("bedroom", "bathroom", "guest_room", "child_room", "toilet")
DAY = [
    {"at": "07:00", "place": "living_room", "activity": "read"},
    {"at": "07:40", "place": "kitchen", "activity": "work_at_home"},
    {"at": "08:10", "place": "living_room", "activity": "nap"},
    {"at": "08:40", "place": [7.0, 6.0], "activity": "wash"},
    {"at": "09:00", "away": True},
    {"at": "09:20", "place": "kitchen", "activity": "snack"},
]
HANGOUT = {"type": "hangout", "period": "7 min", "explore": 0.5}
FIND = {"type": "find", "every": "25 min", "deadline": "4 min"}
ASKS = {"type": "interact", "patience": "10 s"}
PILL = {"do": "remind", "to": "ana", "every": "40 min", "within": "30 min", "worth": 4, "tries": 2}


def home(behaviors: list[Any], **sections: Any) -> dict[str, Any]:
    ana = {"type": "schedule", "days": [{"items": DAY}]}
    metrics = {"household": {}, "interactions": {}}
    return home_with(behaviors, "3 h", ana, metrics=metrics, **sections)


def twin(stored: Run) -> dict[str, float]:
    """Count all terms of the robot step by step, from its tables; steps last a second."""
    robot, person = path(stored, "astro"), path(stored, "ana")
    rows = {name: table(stored, "events", entity=name) for name in ("ana", "astro")}
    rooms = stored.plan.rooms
    doing = {
        int(step): str(detail)
        for step, kind, detail in zip(
            *(rows["ana"][c] for c in ("step", "event", "detail")), strict=True
        )
        if kind == "activity"
    }
    terms = dict.fromkeys(TERMS, 0.0)
    activity, still, rest, welcome = "", -1, None, []
    unseen = [0] * len(rooms)
    for k in range(len(robot.step)):
        activity = doing.get(k, activity)
        place = robot.x[k], robot.y[k]
        is_same = k == 0 or place == (robot.x[k - 1], robot.y[k - 1])
        still = still + 1 if is_same else 0
        if still == 60:
            terms["relocations"] += rest is not None and dist(rest, place) > 0.5
            rest = place if rest is None or dist(rest, place) > 0.5 else rest
        at = int(person.room[k])
        sleeps = activity in ("sleep", "nap")
        is_private = at >= 0 and rooms[at].type in PRIVATE
        is_home = not person.away[k]
        may_be_found = is_home and not sleeps and not is_private
        welcome.append(may_be_found)
        if at >= 0 and at == robot.room[k]:
            terms["near_min"] += (may_be_found and has_time(activity) and still >= 60) / 60
            terms["disturbing_min"] += (is_home and not may_be_found) / 60
        for room in range(len(rooms)):
            unseen[room] = 0 if robot.room[k] == room else unseen[room] + 1
        terms["unvisited_h"] += sum(unseen) / len(rooms) / 3600 / 86400
    begun = None
    for step, kind in zip(rows["astro"]["step"], rows["astro"]["event"], strict=True):
        if kind == "find_begins":
            begun = int(step)
        elif begun is not None and kind in ("found", "gave_up", "not_at_home"):
            terms["searching_min"] += (int(step) - begun) / 60
            terms["finds"] += kind == "found" and welcome[step]
            begun = None
    if begun is not None:
        terms["searching_min"] += (len(robot.step) - begun) / 60
    if "interactions" in stored.tables:
        answers = table(stored, "interactions")
        for row in zip(
            *(answers[c] for c in ("outcome", "value", "willingness", "woke")), strict=True
        ):
            outcome, value, willingness, woke = row
            terms["value"] += value * (outcome == "accepted")
            terms["bother"] += (1 - willingness) * (outcome != "")
            terms["woken"] += woke
    return terms


@pytest.mark.parametrize(
    ("behaviors", "interactions", "counted"),
    [
        ([HANGOUT], {}, ["near_min", "disturbing_min", "unvisited_h"]),
        ([FIND, HANGOUT], {}, ["finds", "searching_min", "relocations"]),
        ([ASKS, {"type": "patrol"}], {"pill": PILL}, ["value", "bother", "unvisited_h"]),
    ],
)
def test_terms_are_those_of_the_tables(behaviors, interactions, counted):
    stored = run(home(behaviors, interactions=interactions))
    terms = stored.metrics["household"]["astro"]

    assert twin(stored) == pytest.approx(terms)
    assert all(terms[name] > 0 for name in counted)


def test_terms_are_the_same_however_the_run_is_cut():
    content = home([FIND, HANGOUT])
    whole = run(content).metrics["household"]
    simulation = Simulation(content)
    for step in (1, 2, 59, 61, 1000, 1001, 4321, 9999):
        simulation.run_until(step)
        measured(simulation, "household")

    assert whole == run(content, "metrics.household.period=7 min").metrics["household"]
    simulation.run_until(simulation.clock.steps)
    assert whole == simulation.finish().metrics["household"]


def test_sleepers_and_people_in_bathrooms_are_disturbed_and_never_near():
    for place, activity in (("living_room", "sleep"), ([7.0, 6.0], "read")):
        items = [{"at": "00:00", "place": place, "activity": activity}]
        ana = {"type": "schedule", "days": [{"items": items}], "start": place}
        astro = {"start": place if place == "living_room" else "bathroom", "behaviors": []}
        content = home_with([], "1 h", ana, astro=astro, metrics={"household": {}})
        terms = run(content).metrics["household"]["astro"]

        assert (0, 60) == (terms["near_min"], round(terms["disturbing_min"]))


def test_resting_begins_a_minute_after_the_last_move():
    items = [{"at": "00:00", "place": "living_room", "activity": "read"}]
    ana = {"type": "schedule", "days": [{"items": items}], "start": "living_room"}
    astro = {"start": "living_room", "behaviors": []}
    terms = run(home_with([], "1 h", ana, astro=astro, metrics={"household": {}}))

    assert pytest.approx(59) == terms.metrics["household"]["astro"]["near_min"]


@pytest.mark.parametrize(
    ("activity", "expected"),
    [("tv", True), ("cook", True), ("care", True), ("study", False), ("shower", False)],
)
def test_who_is_busy_has_no_time(activity, expected):
    assert expected == has_time(activity)


def test_two_robots_are_counted_each():
    content = home([HANGOUT])
    content["robots"]["rosie"] = {**content["robots"]["astro"], "start": "kitchen"}

    assert {"astro", "rosie"} == set(run(content).metrics["household"])
    assert np.isfinite(list(run(content).metrics["household"]["rosie"].values())).all()
