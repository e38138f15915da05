"""All behaviors of robots at once."""

import copy

import pytest
from tests.entities.robots.robots import (
    assert_same_for_every_max_span,
    events,
    home_with,
)
from tests.scenes import digests
from tests.thorough import THOROUGH

import fleet2d


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
