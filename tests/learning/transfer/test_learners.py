"""Models of rooms and activities: what they see, and outcomes that the training never saw."""

from dataclasses import replace

import numpy as np
import pytest
from tests.learning.transfer.homes import write_home
from tests.learning.transfer.test_traces import trace_of

from fleet2d.learning.transfer.learners import FLOOR, forecast, moments
from fleet2d.learning.transfer.traces import CLASSES, KINDS


@pytest.fixture
def trace(tmp_path):
    return trace_of(write_home(tmp_path / "home.txt", 8))


@pytest.mark.parametrize("task", ["room in 60 min", "activity"])
def test_features_know_nothing_of_later_minutes(trace, task):
    cut = 3 * 1440 + 700
    later = replace(trace, rooms=trace.rooms.copy(), sensors=trace.sensors.copy())
    later.rooms[cut:] = 2
    later.sensors[cut:] = 2
    whole, other = moments(trace, task), moments(later, task)
    count = int(np.count_nonzero(whole.day < 3))
    assert count > 500
    assert (whole.inputs[:count] == other.inputs[:count]).all()


def test_an_outcome_is_the_room_that_many_minutes_later(trace):
    found = moments(trace, "room in 120 min")
    at = next(k for k in range(len(found.day)) if found.inputs[k, 3] == 8.5)  # half past eight
    assert "away" == KINDS[found.outcome[at]]


@pytest.mark.parametrize("task", ["room in 60 min", "activity"])
def test_outcomes_never_seen_are_counted_and_cost_the_floor(trace, task):
    pytest.importorskip("sklearn", reason="needs the extra transfer")
    every = moments(trace, task)
    count = len(CLASSES if task == "activity" else KINDS)
    rare = int(every.outcome[every.day == 6][0])
    known = every.where((every.day < 6) & (every.outcome != rare))
    asked = every.where(every.day >= 6)

    found = forecast(known, asked, "usual", task)

    assert found.metrics["unseen"] == pytest.approx(np.mean(asked.outcome == rare))
    assert np.allclose(found.loss[asked.outcome == rare], -np.log(FLOOR / count))
    assert found.loss[asked.outcome != rare].mean() < 0.7
