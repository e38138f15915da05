"""Follow: stay behind who is in view, look for who was lost."""

import numpy as np
import pytest
from tests.entities.robots.robots import (
    OUT,
    assert_same_for_every_max_span,
    events,
    home_with,
    names,
)
from tests.scenes import path, run

import fleet2d
from fleet2d.errors import InputError

# She walks from the bathroom to the living room and on to the kitchen, again and again.
WALKS = {
    "type": "tests.own_components:Scripted",
    "start": [7.0, 6.0],
    "speed": 0.5,
    "script": [60.0, [5.6, 4.5], 5.0, [5.6, 3.0], 5.0, [1.0, 3.0], 60.0, [7.0, 1.0], 600.0],
}

# What passes a narrow camera from the front is gone before the robot has turned round.
SEES_WIDE = {
    "start": [5.6, 5.0],
    "speed": 0.8,
    "camera": {"range": [0, 6], "angle_deg": 240, "lost_after": "3 s"},
}


def test_it_stays_near_a_person_who_walks_through_rooms():
    content = home_with([{"type": "follow", "update": "1 s"}], "10 min", WALKS, astro=SEES_WIDE)
    stored = assert_same_for_every_max_span(content)
    assert "follows" == names(stored)[0]
    begun = next(step for step, name, _ in events(stored) if name == "follows")
    astro, ana = path(stored, "astro"), path(stored, "ana")
    gap = np.hypot(astro.x - ana.x, astro.y - ana.y)[begun + 20 :]
    assert np.mean(gap < 2.5) > 0.8
    assert gap[-1] < 2
    assert stored.plan.room_at(float(astro.x[-1]), float(astro.y[-1])).name in (
        "kitchen_1",
        "unknown_1",
    )


def test_who_is_lost_is_looked_for_once_where_she_was_last():
    leaves = {
        "type": "tests.own_components:Scripted",
        "start": [7.0, 6.0],
        "script": [60.0, "leave", 600.0],
    }
    stored = run(home_with(["follow"], "12 min", leaves, astro={"start": [5.0, 6.0]}))
    assert ["follows", "lost"] == names(stored)
    assert len(np.unique(path(stored, "astro").x[-200:])) == 1


def test_it_follows_no_longer_than_told():
    stored = run(
        home_with(
            [{"type": "follow", "longest": "1 min", "cooldown": "1 h"}],
            "10 min",
            astro={"start": [5.0, 6.0]},
        )
    )
    assert ["follows"] == names(stored)


def test_only_whom_it_is_told_to():
    content = home_with([{"type": "follow", "user": "ben"}], "5 min", astro={"start": [5.0, 6.0]})
    content["users"]["ben"] = OUT
    assert [] == names(run(content))


def test_a_robot_without_a_camera_is_refused():
    with pytest.raises(InputError, match=r"robots\.astro.*no camera"):
        fleet2d.Simulation(home_with(["follow"], astro={"camera": None}))


@pytest.mark.parametrize(
    "behavior",
    [
        {"type": "find", "user": "anna", "every": "1 h"},
        {"type": "follow", "user": "anna"},
        {"type": "opportunistic", "users": ["ana", "anna"]},
    ],
    ids=lambda behavior: str(behavior["type"]),
)
def test_a_user_that_there_is_not_is_refused_before_the_run(behavior):
    with pytest.raises(InputError, match=r"behaviors\.1: there is no user 'anna'.*'ana'"):
        fleet2d.load_scenario(
            "bundled:paper", robots={"astro": {"behaviors": ["patrol", behavior]}}
        )
