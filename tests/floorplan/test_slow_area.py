"""Wet floors and carpets: motions through areas that slow robots down, and stop them at an edge."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.scenes import digests, run, scenario, table

import fleet2d
from fleet2d.errors import InputError
from fleet2d.floorplan.slow_area import SlowArea, slowed

WET = [[2.0, 2.0], [4.0, 2.0], [4.0, 3.9], [2.0, 3.9]]


def straight(y=5, length=1000):
    """A drive along x, a lattice unit in a millisecond."""
    return np.array([[0, 0, y, 0, 0], [1000 * length, length, y, 0, 0]], np.int64)


def region(x0, x1, speed, stop="0 s"):
    """A region across the way, in lattice units."""

    lattice = SimpleNamespace(to_lattice=lambda points: np.asarray(points).astype(np.int64))
    area = [(x0, 0), (x1, 0), (x1, 10), (x0, 10)]
    return SlowArea(area=area, speed=speed, stop=stop).on(lattice)


def test_a_way_through_takes_longer_by_its_length_within_and_the_stop_at_its_edge():
    rows = slowed(straight(), [region(200, 600, 0.5, "3 s")])
    assert [
        [0, 0, 5, 0, 0],
        [200_000, 200, 5, 0, 0],
        [3_200_000, 200, 5, 0, 0],
        [4_000_000, 600, 5, 0, 0],
        [4_400_000, 1000, 5, 0, 0],
    ] == rows.tolist()


def test_where_areas_overlap_the_slowest_counts_and_a_start_within_is_no_entering():
    rows = slowed(straight(), [region(-10, 500, 0.5, "3 s"), region(400, 800, 0.25)])
    assert [0, 800_000, 2_400_000, 2_600_000] == [0, *rows[[1, 3, 4], 0].tolist()]


@given(x0=st.integers(-50, 1050), width=st.integers(1, 900), speed=st.sampled_from([0.1, 0.3, 1.0]))
def test_positions_stay_on_the_leg_and_times_never_fall(x0, width, speed):
    rows = slowed(straight(), [region(x0, x0 + width, speed, "1 s")])
    assert (np.diff(rows[:, 0]) >= 0).all()
    assert (np.diff(rows[:, 1]) >= 0).all()
    within = max(0, min(1000, x0 + width) - max(0, x0))
    stops = 1_000_000 * (0 < x0 < 1000)
    expected = 1000 * (1000 - within + within / speed) + stops
    assert abs(rows[-1, 0] - expected) <= 4


def patrol(**sections):
    """A robot that drives to and fro along the living room's upper wall."""
    ends = [[1.0, 3.0], [4.5, 3.0]]
    drive = sections.pop("drive", "differential")
    robot = {
        "start": ends[0],
        "speed": 0.5,
        "drive": drive,
        "behaviors": [
            {"type": "patrol", "waypoints": ends[::-1], "look_around": False, "dwell": "0 s"}
        ],
    }
    return scenario(
        "10 min", robots={"astro": robot}, artifacts={"trajectories": "every step"}, **sections
    )


def speeds(stored):
    """Return the highest speed within the wet floor and beside it [m/s]."""
    rows = table(stored, "trajectories", entity="astro")
    x, moved = rows["x"][1:], np.abs(np.diff(rows["x"]))
    return moved[(x > 2.5) & (x < 3.5)].max(), moved[(x < 1.9) | (x > 4.1)].max()


@pytest.mark.parametrize("drive", ["differential", "trapezoidal", "holonomic"])
def test_a_wet_floor_of_the_plan_slows_robots_of_every_drive(drive):
    content = patrol(drive=drive)
    content["floorplan"]["slows"] = [{"area": WET, "speed": "40 %"}]
    within, beside = speeds(run(content))
    assert within == pytest.approx(0.4 * beside, rel=0.02)


def test_a_wet_floor_by_script_slows_a_robot_that_is_on_its_way_until_it_is_dry():
    wet = {"at": "07:00:03", "slow": WET, "speed": "20 %", "duration": "3 min"}
    stored = run(patrol(script=[wet]))
    rows = table(stored, "trajectories", entity="astro")
    moved = np.abs(np.diff(rows["x"]))
    is_wet = (rows["x"][1:] > 2.1) & (rows["x"][1:] < 3.9)
    assert moved[10:180][is_wet[10:180]].max() < 0.11
    assert moved[200:][is_wet[200:]].max() > 0.45


def test_people_walk_on_and_runs_without_slow_areas_are_as_ever():
    people = {"ana": {"type": "meander"}}
    dry, wet = scenario(users=people), scenario(users=people)
    wet["floorplan"] = {**wet["floorplan"], "slows": [{"area": WET, "speed": "10 %"}]}
    assert digests(run(dry))["trajectories"] == digests(run(wet))["trajectories"]


def test_slow_areas_are_the_same_for_every_span():
    script = [{"at": "07:01", "slow": WET, "speed": "30 %", "stop": "4 s", "duration": "5 min"}]
    assert digests(run(patrol(script=script))) == digests(
        run(patrol(script=script, simulation={"max_span": 13}))
    )


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"slow": WET}, "it slows nobody down"),
        ({"slow": [[0, 0], [1, 1], [1, 0], [0, 1]], "speed": 0.5}, "the sides cross"),
        ({"slow": WET, "speed": 0.0}, "expected 0.01 or more"),
    ],
)
def test_areas_that_are_none_are_refused(fields, message):
    with pytest.raises(InputError, match=message):
        fleet2d.load_scenario(patrol(script=[{"at": "07:01", **fields}]))


CENTIMETRES = [[200, 200], [400, 200], [400, 390]]


@pytest.mark.parametrize(
    ("sections", "place"),
    [
        ({"script": [{"at": "07:01", "slow": CENTIMETRES, "speed": 0.5}]}, "script.0"),
        ({"slows": [{"area": CENTIMETRES, "speed": 0.5}]}, "floorplan.slows.0"),
    ],
)
def test_a_slow_area_in_which_the_home_has_no_floor_is_refused(sections, place):
    content = patrol(script=sections.get("script", ()))
    content["floorplan"] = {**content["floorplan"], "slows": sections.get("slows", ())}

    with pytest.raises(InputError, match=f"{place}: the area from .* has no part of the floor"):
        fleet2d.Simulation(content)
