"""The days of somebody, from waking to going to bed, found in the minutes of a log."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.fit.timeline import MINUTES, Timeline, is_sleep, runs

# Up this long in the night, one hasn't got up [min].
UP_AT_NIGHT = 60
SHORTEST_NIGHT = 120  # min
NOON = MINUTES // 2


class Run(NamedTuple):
    """Something done without a break: its state, first minute and number of minutes."""

    state: int
    begin: int
    length: int


class Day(NamedTuple):
    """A day from waking to bed; minutes count from the midnight of its date.

    Attributes:
        number: Of its date in the log.
        wake: When it begins.
        bed: When it ends.
        next_wake: When the next one begins.
        awake: What is done from `wake` to `bed`, where it is known.
        up: What is done out of bed in the night after it.
    """

    number: int
    wake: int
    bed: int
    next_wake: int
    awake: tuple[Run, ...]
    up: tuple[Run, ...]


def sleep_states(timeline: Timeline) -> set[int]:
    """Return the states that are sleep; in a log without activities, being in the bedroom."""
    named = {i for i, state in enumerate(timeline.states) if is_sleep(state)}
    return named or {i for i, s in enumerate(timeline.states) if s.place == "bedroom"}


def find_days(timeline: Timeline) -> list[Day]:
    """Return the days whose night before and night after are known."""
    flat = timeline.minutes.ravel()
    asleep = np.isin(flat, list(sleep_states(timeline)))
    nights = _nights(asleep, len(timeline.minutes))
    days = []
    for number in range(len(timeline.minutes)):
        before, after = nights.get(number - 1), nights.get(number)
        if before is None or after is None or before[1] >= after[0]:
            continue
        midnight = number * MINUTES
        awake = _runs(flat, before[1], after[0], midnight)
        night = _runs(flat, after[0], after[1], midnight)
        up = tuple(r for r in night if not asleep[midnight + r.begin])
        wake, bed, next_wake = before[1] - midnight, after[0] - midnight, after[1] - midnight
        days.append(Day(number, wake, bed, next_wake, awake, up))
    return days


def _nights(asleep: NDArray[np.bool_], days: int) -> dict[int, tuple[int, int]]:
    """Return the first and the last minute + 1 of the night after each day, -1 before the first."""
    slept = [[begin, begin + n] for value, begin, n in runs(asleep.astype(np.int16)) if value]
    closed: list[list[int]] = []
    for begin, end in slept:
        if closed and begin - closed[-1][1] <= UP_AT_NIGHT:
            closed[-1][1] = end
        else:
            closed.append([begin, end])
    nights: dict[int, tuple[int, int]] = {}
    for begin, end in closed:
        number = ((begin + end) // 2 - NOON) // MINUTES
        known = nights.get(number, (0, SHORTEST_NIGHT - 1))
        if -1 <= number < days and end - begin > known[1] - known[0]:
            nights[number] = (begin, end)
    return nights


def _runs(flat: NDArray[np.int16], begin: int, end: int, midnight: int) -> tuple[Run, ...]:
    return tuple(
        Run(state, begin - midnight + first, length)
        for state, first, length in runs(flat[begin:end])
        if state >= 0
    )
