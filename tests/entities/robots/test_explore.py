"""Explore: all floor that can be seen is seen, frontier by frontier."""

import pytest
from tests.entities.robots.robots import assert_same_for_every_max_span, events, home_with, names
from tests.scenes import path

import fleet2d
from fleet2d.errors import InputError


def test_it_sees_the_whole_flat_and_then_leaves_the_robot_to_others():
    content = home_with(
        ["explore", {"type": "patrol", "rooms": ["kitchen"], "dwell": "1 d"}], "15 min"
    )
    stored = assert_same_for_every_max_span(content, 61)
    rows = [
        (name, float(detail.split(" ")[0]))
        for _, name, detail in events(stored)
        if name.startswith("explore")
    ]
    shares = [share for _, share in rows]
    assert shares == sorted(shares)
    assert ("explored", pytest.approx(98.5, abs=1.5)) == rows[-1]
    assert names(stored).count("explored") == 1
    poses = path(stored, "astro")
    assert "kitchen_1" == stored.plan.room_at(float(poses.x[-1]), float(poses.y[-1])).name


def test_what_can_not_be_seen_is_given_up():
    near_sighted = {"camera": {"range": [1.5, 3.0], "angle_deg": 60}}
    stored = assert_same_for_every_max_span(
        home_with([{"type": "explore", "enough": 1}], "1 h", astro=near_sighted), 61
    )
    assert "explored" == names(stored)[-1]


@pytest.mark.parametrize("furnish", [False, True])
def test_a_real_home_is_explored_in_minutes(furnish):
    content = home_with(["explore"], "10 min")
    content["floorplan"] = {"type": "bundled", "furnish": furnish}
    content["users"] = {}
    content["robots"]["astro"].pop("start")
    stored = fleet2d.run(content)
    assert "explored" == names(stored)[-1]
    assert float(events(stored)[-1][2].split(" ")[0]) > 95
    assert names(stored).count("explores") < 40


def test_behind_a_shut_door_it_goes_on_once_that_is_open():
    agenda = [
        {"at": "07:00", "open": True},
        {"at": "07:01", "open": False},
        {"at": "07:20", "open": True},
    ]
    door = {"type": "door", "doorway": "living_room_1-kitchen_1", "schedule": agenda}
    stay = {"type": "patrol", "waypoints": [[1.0, 3.0]], "dwell": "5 min"}
    content = home_with(["explore", stay], "30 min", objects={"gate": door})
    content["robots"]["astro"]["camera"] = {"range": [0.2, 2.0], "angle_deg": 108}
    stored = assert_same_for_every_max_span(content, 61)
    steps = [step for step, name, _ in events(stored) if name == "explores"]
    assert not [step for step in steps if 600 < step < 1200]
    assert [step for step in steps if step >= 1200]
    assert "explored" == names(stored)[-1]


def test_a_robot_without_a_camera_is_refused():
    with pytest.raises(InputError, match=r"robots\.astro.*no camera"):
        fleet2d.Simulation(home_with(["explore"], astro={"camera": None}))
