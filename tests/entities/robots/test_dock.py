"""Dock: charge before the battery is empty; the charge follows from what the robot did."""

import pytest
from tests.entities.robots.robots import assert_same_for_every_max_span, events, home_with, names
from tests.scenes import path, run

import fleet2d
from fleet2d.errors import InputError

BATTERY = {"driving": "30 min", "standing": "2 h", "charging": "20 min", "charger": [1.0, 3.0]}
PATROL = {"type": "patrol", "rooms": ["kitchen", "bedroom", "bathroom"], "dwell": "3 min"}
STAY = {"type": "patrol", "waypoints": [[7.0, 1.0]], "dwell": "1 d", "look_around": False}


def charged(behaviors, duration="6 h", **battery):
    return home_with(behaviors, duration, astro={"battery": {**BATTERY, **battery}})


def levels(stored):
    details = [
        detail for _, name, detail in events(stored) if name in ("battery", "docks", "charged")
    ]
    return [float(detail.split(" ")[0]) for detail in details]


def test_it_charges_in_time_and_the_patrol_goes_on():
    stored = assert_same_for_every_max_span(charged(["dock", PATROL]), 61, 1)
    kinds = [name for name in names(stored) if name != "battery"]
    assert ["docks", "charged"] * 2 == kinds[:4]
    assert min(levels(stored)) > 15
    assert max(levels(stored)) == 100


def test_a_robot_that_never_docks_stands_still_when_it_is_empty():
    stored = assert_same_for_every_max_span(charged([STAY], "3 h"), 61)
    assert [100.0, 0.0] == levels(stored)
    step = next(step for step, _, detail in events(stored) if detail == "0.0 %")
    # 6 m at 0.6 m/s, and turns, at four times the rate; then two hours for the rest.
    assert 7100 < step < 7200
    meandering = run(charged(["meander"], "1 h"))
    empty, off = events(meandering)[-2:]
    assert "0.0 %" == empty[2]
    assert 1801 == pytest.approx(empty[0], abs=1)
    assert (empty[0] + 1, "power_off", "empty") == off
    poses = path(meandering, "astro")
    assert 1 == len(set(poses.x[1802:].tolist()))


def test_with_nothing_else_to_do_it_rests_at_the_charger():
    content = charged([{"type": "dock", "rest": True}], "1 h", charge=0.5)
    content["robots"]["astro"]["start"] = [7.0, 1.0]
    stored = run(content)
    poses = path(stored, "astro")
    assert (1.0, 3.0) == pytest.approx((poses.x[-1], poses.y[-1]), abs=0.01)


@pytest.mark.parametrize(
    ("battery", "dock", "words"),
    [
        ({"driving": 0}, {}, "longer than 0"),
        ({"charger": "storage"}, {}, "can't be reached"),
        ({"charger": [5.05, 1.0]}, {}, "wall"),
        ({"charge": 2}, {}, "expected a share from 0 to 1"),
        ({}, {"threshold": 0.9, "until": 0.5}, "'until' must be above 'threshold'"),
        ({"capacity": 3}, {}, "unknown key 'capacity'"),
    ],
)
def test_bad_settings_are_refused(battery, dock, words):
    with pytest.raises(InputError, match=words):
        fleet2d.Simulation(charged([{"type": "dock", **dock}], **battery))


def test_dock_without_a_battery_is_refused():
    with pytest.raises(InputError, match=r"robots\.astro: dock needs a battery"):
        fleet2d.Simulation(home_with(["dock"]))
