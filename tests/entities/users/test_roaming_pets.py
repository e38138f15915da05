"""Pet: it naps and roams where it may."""

import numpy as np
import pytest
from tests.scenes import path, run, scenario

from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError

ROOMS = ["kitchen", "living_room"]


def cat(duration="1 d", **fields):
    return scenario(duration, users={"rex": {"type": "pet", "radius": 0.1, **fields}})


def test_it_sleeps_most_of_the_time_and_roams_through_its_rooms():
    stored = run(cat("4 d", rooms=ROOMS, start="kitchen"))
    poses = path(stored, "rex")
    moves = (np.diff(poses.x) != 0) | (np.diff(poses.y) != 0)
    ten_minutes_a_day = 10 / (24 * 60)
    assert ten_minutes_a_day < moves.mean() < 0.4
    names = {stored.plan.rooms[i].type for i in set(poses.room.tolist())}
    assert set(ROOMS) | {"unknown"} == names  # the doorway is nobody's room


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"spots": [5, 2]}, ["spots", "5", "2"]),
        ({"rooms": ["attic"]}, ["attic"]),
    ],
)
def test_a_pet_that_can_not_live_is_refused(fields, words):
    with pytest.raises(InputError) as caught:
        Simulation(cat(**fields))
    for word in ["users.rex", *words]:
        assert word in str(caught.value)
