"""A day of each behavior in real homes, and all behaviors of robots at once."""

import copy

import numpy as np
import pytest
from tests.entities.robots.robots import (
    SHARE,
    assert_same_for_every_max_span,
    events,
    home_with,
)
from tests.scenes import digests, path, run
from tests.thorough import THOROUGH

import fleet2d
from fleet2d.kernels import strictly_inside

PATROL = {"type": "patrol", "dwell": "5 min"}


# Short, for the patrol charges a little each time that it stops in the charger's room.
BATTERY = {"driving": "1 h", "standing": "3 h", "charging": "2 h", "charger": "any"}


# Which behaviors, and which events they must have brought about in a day.
DAYS = {
    "explore": (["explore", PATROL], {"explored"}),
    "scheduled": (
        [{"type": "scheduled", "visits": [{"at": "09:00", "place": ["kitchen", "any"]}]}, PATROL],
        {"visits"},
    ),
    "hangout": ([{"type": "hangout", "source": "share", "quiet": "22:00-06:00"}], {"relocates"}),
    "find": (
        [{"type": "find", "user": "ana", "every": "1 h", "source": "share"}, PATROL],
        {"found"},
    ),
    "opportunistic": ([{"type": "opportunistic", "cooldown": "10 min"}, PATROL], {"interacts"}),
    "follow": ([{"type": "follow", "longest": "10 min", "cooldown": "1 h"}, PATROL], {"follows"}),
    "dock": (["dock", PATROL], {"docks", "charged"}),
    "all": (
        [
            "dock",
            {
                "type": "scheduled",
                "visits": [{"at": "09:00", "place": "any", "task": "water"}],
                "late": "2 h",  # it may be charging
            },
            {"type": "find", "user": "ana", "every": "3 h", "source": "share"},
            {"type": "opportunistic", "when": "08:00-22:00", "cooldown": "30 min"},
            {"type": "patrol", "when": "weekdays 10:00-11:00"},
            {"type": "hangout", "source": "share", "quiet": "22:00-07:00"},
        ],
        {"visits", "find_begins", "relocates", "docks"},
    ),
}


def home_file(folder, which):
    files = sorted((folder / "houseexpo").glob("*.json"))
    return files[0] if which == "first" else files[len(files) // 2]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "which"),
    [
        (name, which)
        for i, name in enumerate(DAYS)
        for j, which in enumerate(("first", "middle"))
        if THOROUGH or i % 2 == j
    ],
)
def test_a_day_of_a_behavior_in_a_real_home(shared_data, name, which):
    behaviors, expected = DAYS[name]
    ana = fleet2d.load_scenario("bundled:paper").users["ana"].model_dump(mode="json")
    body = {"battery": BATTERY} if "dock" in behaviors else {}
    content = {
        "simulation": {"start": "2026-01-10", "duration": "1 d", "seed": 4},
        "floorplan": {"type": "houseexpo", "path": str(home_file(shared_data, which))},
        "users": {"ana": ana},
        "robots": {"astro": {"behaviors": behaviors, "gives_way": {}, **body}},
        "algorithms": SHARE,
    }
    stored = run(content)
    assert expected <= {event for _, event, _ in events(stored)}
    # The body never leaves the space that it fits in.
    plan, space = stored.plan, fleet2d.Home(stored.plan).space(0.15)
    poses = path(stored, "astro")
    points = np.unique(plan.lattice.to_lattice(np.stack([poses.x, poses.y], axis=1)), axis=0)
    some = points[:: max(1, len(points) // 500)].tolist()
    assert all(strictly_inside(plan.mesh, x, y) for x, y in some)
    inside = [space.part_at(x, y) >= 0 for x, y in some]
    assert np.mean(inside) > 0.8  # ways touch its corners


def product():
    """All behaviors of robots at once, two people and a pet, a door that is shut for a while."""
    agenda = [{"at": "07:20", "open": False}, {"at": "08:05", "open": True}]
    content = home_with(
        [
            {"type": "dock", "threshold": "20 %", "until": "40 %"},
            {"type": "scheduled", "visits": [{"at": "07:45", "place": "kitchen", "task": "sweep"}]},
            {"type": "find", "user": "ben", "every": "25 min", "source": "rtp"},
            {"type": "opportunistic", "users": ["ana"], "cooldown": "20 min", "again": "20 min"},
            {"type": "follow", "user": "rex", "longest": "2 min", "cooldown": "30 min"},
            {"type": "explore", "when": "07:00-09:00"},
            {"type": "patrol", "dwell": "1 min", "when": "07:30-08:30"},
            {"type": "dock", "threshold": "90 %", "when": "09:00-09:30"},
            {"type": "hangout", "source": "ltp", "period": "5 min", "no_stops_in": ["bedroom"]},
        ],
        "3 h",
        {"type": "routine", "persona": "works_from_home"},
        astro={
            "gives_way": {},
            "battery": {
                "driving": "1 h",
                "standing": "4 h",
                "charging": "4 min",
                "charger": [1, 3],
            },
        },
        algorithms={
            "ltp": {"type": "long_term_presence", "period": "30 min"},
            "rtp": {"type": "real_time_presence"},
        },
        objects={
            "gate": {"type": "door", "doorway": "living_room_1-kitchen_1", "schedule": agenda}
        },
        metrics={"time_to_find": {}, "battery": {}, "co_presence": {}},
    )
    content["users"]["ben"] = {"type": "meander", "speed": 0.6}
    content["users"]["rex"] = {"type": "pet", "radius": 0.12, "speed": 0.7}
    return content


@pytest.mark.slow
def test_all_at_once_is_the_same_for_every_max_span_and_for_copies():
    stored = assert_same_for_every_max_span(product(), *((61, 7) if THOROUGH else (7,)))
    expected = {
        "docks", "charged", "visits", "find_begins", "found", "approaches", "interacts", "follows",
        "explores", "explored", "gives_way", "relocates",
    }  # fmt: skip
    assert expected <= {event for _, event, _ in events(stored)}
    simulation = fleet2d.Simulation(product())
    for steps in (1234, 3210, 3000):
        simulation.advance(steps)
        assert digests(stored) == digests(copy.deepcopy(simulation).run()), simulation.step


@pytest.mark.slow
def test_without_its_behaviors_a_robot_leaves_everybody_the_same_life():
    with_it, without = run(product()), product()
    without["robots"]["astro"]["behaviors"] = []
    other, nobody = run(without), run({**without, "robots": {}, "metrics": {}, "algorithms": {}})
    for user in ("ana", "ben", "rex"):
        for column in ("x", "y", "heading", "away", "room"):
            lives = [getattr(path(stored, user), column) for stored in (with_it, other, nobody)]
            assert np.array_equal(lives[0], lives[1]), (user, column)
            assert np.array_equal(lives[0], lives[2]), (user, column)
