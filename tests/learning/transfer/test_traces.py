"""Minutes of logs and of simulated people: rooms, sensors and activities."""

from datetime import date
from pathlib import Path

import numpy as np
import pytest
from tests.learning.transfer.homes import write_home

from fleet2d.learning.transfer.traces import (
    CLASSES,
    KINDS,
    MinuteTrace,
    class_of,
    copied,
    markov,
    trace_of_log,
    write_log,
)
from fleet2d.logs.layout import read_log


def trace_of(path: Path) -> MinuteTrace:
    return trace_of_log(read_log(path), {}, {})


@pytest.fixture
def trace(tmp_path):
    return trace_of(write_home(tmp_path / "home.txt", 4))


def at(trace: MinuteTrace, clock) -> tuple[str, str, str]:
    """Room, sensor and activity at a time of the first day."""
    minute = int(clock[:2]) * 60 + int(clock[3:])
    codes = trace.rooms[minute], trace.sensors[minute], trace.activities[minute]
    return KINDS[codes[0]], KINDS[codes[1]], CLASSES[codes[2]]


def test_a_minute_has_its_room_the_sensor_that_fired_last_and_a_class_of_activity(trace):
    assert ("kitchen", "kitchen", "food") == at(trace, "07:30")
    assert ("away", "entry", "out") == at(trace, "11:00")
    assert ("living_room", "living_room", "leisure") == at(trace, "14:00")
    assert -1 == trace.sensors[0]
    assert [0, 1, 2, 3] == trace.days.tolist()


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("prep-breakfast", "food"),
        ("use-toilet", "toilet"),
        ("go_to_sleep", "sleep"),
        ("Grooming", "wash"),
        ("Mahjong", "other"),
        ("", "other"),
    ],
)
def test_an_activity_is_of_the_class_that_its_words_say(name, expected):
    assert expected == class_of(name)


def test_a_silent_day_is_unknown(tmp_path):
    trace = trace_of(write_home(tmp_path / "home.txt", 12, silent=range(3, 10)))
    assert [0, 1, 2, 10, 11] == trace.days.tolist()


def test_copies_are_days_of_the_home_and_a_chain_makes_the_changes_it_has_seen(trace):
    days = trace.rooms.reshape(-1, 1440)
    copies = copied(trace, trace.days, 9, seed=1)
    assert all(any((day == one).all() for one in days) for day in copies.rooms.reshape(-1, 1440))

    chain = markov(trace, trace.days, 3, seed=1)

    def changes(rooms: np.ndarray) -> set[tuple[int, int]]:
        return set(zip(rooms[:-1].tolist(), rooms[1:].tolist(), strict=True))

    closing = (int(trace.rooms[-1]), int(trace.rooms[0]))
    assert changes(chain.rooms) <= changes(trace.rooms) | {closing}
    assert 3 * 1440 == len(chain.rooms)
    assert (chain.rooms == markov(trace, trace.days, 3, seed=1).rooms).all()


def test_a_written_log_has_the_rooms_that_it_was_written_from(trace, tmp_path):
    write_log(trace, date(2024, 3, 4), tmp_path / "copy.txt")
    again = trace_of(tmp_path / "copy.txt")
    both = (again.rooms >= 0) & (trace.rooms >= 0)
    assert np.mean(again.rooms[both] == trace.rooms[both]) > 0.99
    assert np.mean(both) > 0.95
