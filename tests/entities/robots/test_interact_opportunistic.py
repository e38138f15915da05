"""Opportunistic: approach who comes into view, interact, and go on with what was interrupted."""

import numpy as np
import pytest
from tests.entities.robots.robots import (
    OUT,
    assert_same_for_every_max_span,
    events,
    home_with,
    names,
    rooms,
)
from tests.scenes import path, run

import fleet2d
from fleet2d.errors import InputError

PATROL = {"type": "patrol", "rooms": ["kitchen", "bathroom", "bedroom"], "dwell": "2 min"}


def test_it_approaches_interacts_and_the_patrol_goes_on():
    content = home_with([{"type": "opportunistic", "interaction": "90 s", "again": "1 d"}, PATROL])
    stored = assert_same_for_every_max_span(content)
    assert ["approaches", "interacts", "interaction_over"] == names(stored)
    times = {name: step for step, name, _ in events(stored)}
    assert 90 == times["interaction_over"] - times["interacts"]
    poses = path(stored, "astro")
    gap = np.hypot(poses.x - 7.0, poses.y - 6.0)[times["interacts"] : times["interaction_over"]]
    assert gap.max() < 1.25
    assert gap.min() > 0.9
    # After the bathroom, where it was broken off, comes the bedroom, and not the round's begin.
    visited = rooms(stored)
    after = visited.index("bathroom_1")
    assert ["kitchen_1", "bathroom_1", "bedroom_1", "kitchen_1"] == visited[after - 1 : after + 3]


def test_it_leaves_the_same_person_alone_for_a_while():
    content = home_with([{"type": "opportunistic", "again": "20 min"}, PATROL], "2 h")
    steps = [step for step, name, _ in events(run(content)) if name == "approaches"]
    assert len(steps) >= 3
    assert min(np.diff(steps)) >= 1200


def test_whom_it_does_not_want_and_what_chance_it_misses_change_nothing():
    alone = path(run(home_with([PATROL])), "astro")
    for fields in ({"users": ["ben"]}, {"chance": 0}):
        content = home_with([{"type": "opportunistic", **fields}, PATROL])
        content["users"]["ben"] = OUT
        other = path(run(content), "astro")
        assert np.array_equal(alone.x, other.x)
        assert np.array_equal(alone.heading, other.heading)


def test_a_cooldown_holds_for_everybody():
    first = {"type": "opportunistic", "again": 0, "cooldown": "30 min"}
    stored = assert_same_for_every_max_span(home_with([first, PATROL], "2 h"), 61)
    steps = [step for step, name, _ in events(stored) if name == "approaches"]
    over = [step for step, name, _ in events(stored) if name == "interaction_over"]
    assert len(steps) >= 3
    for ended, begun in zip(over, steps[1:], strict=False):
        assert begun - ended >= 1800


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"chance": 2}, "a share from 0 to 1"),
        ({"distance": 0.1}, "distance"),
        ({"interaction": "-1 s"}, "0 or more"),
    ],
)
def test_bad_settings_are_refused(fields, words):
    with pytest.raises(InputError, match=words):
        fleet2d.Simulation(home_with([{"type": "opportunistic", **fields}]))
