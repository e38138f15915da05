"""The days in the minutes of a log, from waking to going to bed."""

from typing import NamedTuple

import numpy as np

from fleet2d.fit.timeline import MINUTES, Timeline, is_sleep, runs
from fleet2d.kernels import I16, Bool

# Being up for up to this long in the night doesn't end the night [min].
UP_AT_NIGHT = 60
SHORTEST_NIGHT = 120  # min
NOON = MINUTES // 2


class Stretch(NamedTuple):
    """A time without a change of state: the state, its first minute and number of minutes."""

    state: int
    begin: int
    length: int


class LivedDay(NamedTuple):
    """A day from waking to bed; minutes count from the midnight of its date.

    Attributes:
        number: The number of its date in the log, from 0.
        wake: Its beginning.
        bed: Its end.
        next_wake: The beginning of the next day.
        awake: The known stretches from `wake` to `bed`.
        up: The stretches out of bed in the night after it.
    """

    number: int
    wake: int
    bed: int
    next_wake: int
    awake: tuple[Stretch, ...]
    up: tuple[Stretch, ...]


def sleep_states(timeline: Timeline) -> set[int]:
    """Return the states that are sleep; in a log without activities, being in the bedroom."""
    named = {i for i, state in enumerate(timeline.states) if is_sleep(state)}
    return named or {i for i, s in enumerate(timeline.states) if s.place == "bedroom"}


def find_days(timeline: Timeline) -> list[LivedDay]:
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
        days.append(LivedDay(number, wake, bed, next_wake, awake, up))
    return days


def _nights(asleep: Bool, days: int) -> dict[int, tuple[int, int]]:
    """Return begin and end [min] of the night after each day: the longest sleep, if several.

    Night -1 is the one before the first day.
    """
    sleeps = [[begin, begin + n] for value, begin, n in runs(asleep.astype(np.int16)) if value]
    joined: list[list[int]] = []
    for begin, end in sleeps:
        if joined and begin - joined[-1][1] <= UP_AT_NIGHT:
            joined[-1][1] = end
        else:
            joined.append([begin, end])
    nights: dict[int, tuple[int, int]] = {}
    for begin, end in joined:
        number = ((begin + end) // 2 - NOON) // MINUTES
        longest = nights.get(number, (0, SHORTEST_NIGHT - 1))
        if -1 <= number < days and end - begin > longest[1] - longest[0]:
            nights[number] = (begin, end)
    return nights


def _runs(flat: I16, begin: int, end: int, midnight: int) -> tuple[Stretch, ...]:
    return tuple(
        Stretch(state, begin - midnight + first, length)
        for state, first, length in runs(flat[begin:end])
        if state >= 0
    )
