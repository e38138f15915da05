"""Room sampling: the share of time in each room tends to the one that was asked for."""

from functools import cache

import numpy as np
import pytest
from tests.scenes import path, run, scenario
from tests.thorough import some

from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError

SHARES = {"living_room": 0.45, "bedroom": 0.3, "kitchen": 0.15, "bathroom": 0.05, "away": 0.05}


@cache
def stay(dwell, duration):
    """The share of steps in each room of somebody who stays for so long at a time."""
    return shares(sampled(duration, dwell=dwell))


def sampled(duration, **fields):
    user = {"type": "room_sampling", "shares": SHARES, **fields}
    return run(scenario(duration, users={"ana": user}))


def shares(stored):
    """The share of steps in each room, by kind."""
    rooms = path(stored, "ana").room
    shares_of_time = {room.type: float((rooms == room.index).mean()) for room in stored.plan.rooms}
    return {**shares_of_time, "away": float((rooms < 0).mean())}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dwell", "duration", "error"),
    some([("5 min", "20 d", 0.02), ("30 min", "60 d", 0.03), ("1 min", "5 d", 0.02)], 2),
)
def test_time_in_each_room_tends_to_its_share_ways_included(dwell, duration, error):
    """The standard error of a share is about sqrt(0.25 * 1.3 * dwell / duration), 0.01 at most."""
    realised = stay(dwell, duration)
    for room, share in SHARES.items():
        assert share == pytest.approx(realised[room], abs=error), room


def test_stays_follow_the_law_of_dwell_times():
    stored = sampled(
        "12 d", dwell={"law": "fixed", "mean": "20 min"}, shares={"kitchen": 1, "bedroom": 1}
    )
    poses = path(stored, "ana")
    still = (np.diff(poses.x) == 0) & (np.diff(poses.y) == 0)
    ends = np.flatnonzero(np.diff(np.r_[0, still.astype(int), 0]))
    stays = (ends[1::2] - ends[::2])[1:-1]
    longest = stays[stays > 60]
    assert 1200 == pytest.approx(np.median(longest), abs=30)
    assert np.percentile(longest, 5) > 1000


def test_rooms_of_a_kind_share_its_part():
    content = scenario(
        users={"ana": {"type": "room_sampling", "shares": {"bedroom": 3, "kitchen": 1}}}
    )
    content["floorplan"] = {"type": "bundled"}
    ana = Simulation(content).actors["ana"]
    by_room = ana.behaviors[0].chances.items()
    chances = {ana.home.rooms[room].name: chance for room, chance in by_room}
    bedrooms = [chance for name, chance in chances.items() if name.startswith("bedroom")]
    assert 250_000 == chances["kitchen_1"]
    assert 3 == len(bedrooms)
    assert 750_000 == pytest.approx(sum(bedrooms), abs=3)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"shares": {}}, ["shares"]),
        ({"shares": {"kitchen": -1}}, ["kitchen", "-1"]),
        ({"shares": {"kitchen": 0}}, ["above"]),
        ({"shares": {"kichen": 1}}, ["kichen", "did you mean 'kitchen"]),
        ({"shares": {"storage": 1}}, ["storage", "can't be reached"]),
        ({"shares": {"kitchen": 1}, "dwell": ["1 h", "5 min"]}, ["dwell", "1 h", "5 min"]),
    ],
)
def test_what_makes_no_distribution_is_refused(fields, words):
    with pytest.raises(InputError) as caught:
        Simulation(scenario(users={"ana": {"type": "room_sampling", **fields}}))
    for word in ["users.ana", *words]:
        assert word in str(caught.value)
