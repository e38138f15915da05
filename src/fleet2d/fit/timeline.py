"""Timelines: the activity and the kind of room of a log in each minute of each day."""

from collections import Counter
from dataclasses import dataclass
from datetime import timedelta
from typing import NamedTuple

import numpy as np

from fleet2d.configuration.units import micros
from fleet2d.floorplan.rooms.vocabulary import room_type
from fleet2d.kernels import I16
from fleet2d.logs.log import AWAY, ActivityLog, LogError
from fleet2d.logs.rooms import DOOR, USUAL
from fleet2d.logs.visits import UNKNOWN, LoggedVisit, VisitRule, visits_of
from fleet2d.runtime.clock import DAY_S

MINUTES = 1440
UNKNOWN_STATE = -1
# Silence up to this counts as staying in the room, in general and in one room.
HOLD = timedelta(hours=3)
STILL = timedelta(hours=12)
OUT = timedelta(minutes=10)  # a longer silence at the front door counts as being out
# An activity in a room with less time and fewer runs than this loses its name.
RARE_MINUTES, RARE_RUNS = 30, 4


class ActivityPlace(NamedTuple):
    """An activity in a kind of room; the activity is "" if it is unnamed in the log, or rare."""

    activity: str
    place: str


@dataclass(frozen=True)
class Timeline:
    """The state in each minute: that of most of its seconds.

    Attributes:
        states: The states.
        minutes: Index of the state in each minute, -1 if unknown, int16 (days, 1440).
        weekdays: Day of the week of each day, 0 = Monday; None if the log has no dates.
    """

    states: tuple[ActivityPlace, ...]
    minutes: I16
    weekdays: tuple[int, ...] | None

    @property
    def places(self) -> tuple[str, ...]:
        """The kinds of rooms, and "away"."""
        return tuple(sorted({state.place for state in self.states}))

    @property
    def rooms(self) -> I16:
        """Index of the place in each minute, -1 if unknown, int16 (days, 1440)."""
        places = self.places
        index = np.array([places.index(s.place) for s in self.states] + [-1], np.int16)
        return index[self.minutes]


def read_timeline(log: ActivityLog) -> Timeline:
    """Return the state, a place and an activity, of each minute of a log.

    Raises:
        LogError: The state is unknown for most of the time.
    """
    pairs, seconds = read_seconds(log)
    minutes = _by_minute(seconds, len(pairs))
    states, minutes = _without_rare(pairs, _one_per_stay(pairs, minutes))
    if np.count_nonzero(minutes >= 0) < minutes.size // 4:
        raise LogError(
            f"{log.path} has no readings for most of its {log.days} days: there is nothing to fit"
        )
    first = log.first_day
    weekdays = tuple((first.weekday() + i) % 7 for i in range(log.days)) if first else None
    return Timeline(states, minutes, weekdays)


def read_seconds(log: ActivityLog) -> tuple[list[ActivityPlace], I16]:
    """Return the states of a log, and for each second the index of its state, -1 if unknown."""
    kinds = {label: (_kind(label),) for label in log.rooms}
    rule = VisitRule(
        step_us=1_000_000,
        begin_us=0,
        steps=log.days * DAY_S,
        gap_us=micros(HOLD),
        still_us=micros(STILL),
        unknown=True,
        door_us=micros(OUT),
    )
    return _by_second(visits_of(log, kinds, rule).visits, rule.steps)


def _kind(label: str) -> str:
    kind = USUAL.get(room_type(label), (room_type(label),))[0]
    return AWAY if label == AWAY else kind


def _by_second(visits: list[LoggedVisit], count: int) -> tuple[list[ActivityPlace], I16]:
    index: dict[ActivityPlace, int] = {}
    seconds = np.full(count, UNKNOWN_STATE, np.int16)
    for number, visit in enumerate(visits):
        if visit.place == UNKNOWN:
            continue
        visit_end = visits[number + 1].first if number + 1 < len(visits) else visit.last + 1
        place = "entryway" if visit.place == DOOR else visit.place
        parts = [(max(step, 0), label) for step, label in visit.activities] or [(visit.first, "")]
        for (step, label), (end, _) in zip(parts, [*parts[1:], (visit_end, "")], strict=True):
            name = room_type(label) if label else ""
            state = ActivityPlace("away" if place == AWAY and not name else name, place)
            seconds[step:end] = index.setdefault(state, len(index))
    return list(index), seconds


def _by_minute(seconds: I16, states: int) -> I16:
    """Return the most frequent state of each minute, the first of equals; unknown counts, too."""
    by_minute = seconds.reshape(-1, 60)
    best = np.full(len(by_minute), UNKNOWN_STATE, np.int16)
    most = (by_minute == UNKNOWN_STATE).sum(axis=1)
    for state in range(states):
        count = (by_minute == state).sum(axis=1)
        best[count > most] = state
        most = np.maximum(most, count)
    return best.reshape(-1, MINUTES)


def is_sleep(state: ActivityPlace) -> bool:
    """Return whether the activity of a state is sleep, by its name."""
    return "sleep" in state.activity and not state.activity.startswith("go_to")


def _one_per_stay(pairs: list[ActivityPlace], minutes: I16) -> I16:
    """Give every stay in a room the activity with the most time; sleep is a separate stay.

    Short activities during a stay, such as washing hands after the toilet, are dropped.
    """
    flat = minutes.ravel().copy()
    kinds: dict[tuple[str, bool], int] = {}
    kind = [kinds.setdefault((s.place, is_sleep(s)), len(kinds)) for s in pairs]
    of_state = np.array([*kind, UNKNOWN_STATE], np.int16)
    for label, begin, length in runs(of_state[flat]):
        if label >= 0:
            stay = flat[begin : begin + length]
            stay[:] = np.argmax(np.bincount(stay, minlength=len(pairs)))
    return flat.reshape(-1, MINUTES)


def _without_rare(
    pairs: list[ActivityPlace], minutes: I16
) -> tuple[tuple[ActivityPlace, ...], I16]:
    """Return the states that occur, without the names of rare activities, and the minutes."""
    flat = minutes.ravel()
    firsts = flat[np.append(True, flat[1:] != flat[:-1])]
    run_counts, minute_counts = Counter(firsts.tolist()), Counter(flat.tolist())
    result: dict[ActivityPlace, int] = {}
    index = np.full(len(pairs) + 1, UNKNOWN_STATE, np.int16)
    for i, state in enumerate(pairs):
        if not minute_counts[i]:
            continue
        is_rare = run_counts[i] < RARE_RUNS and minute_counts[i] < RARE_MINUTES
        renamed = ActivityPlace("", state.place) if is_rare else state
        index[i] = result.setdefault(renamed, len(result))
    return tuple(result), index[minutes]


def runs(labels: I16) -> list[tuple[int, int, int]]:
    """Return the runs of equal labels in a row of minutes: label, first minute, length."""
    begins = np.flatnonzero(np.append(True, labels[1:] != labels[:-1]))
    ends = np.append(begins[1:], len(labels))
    return list(
        zip(labels[begins].tolist(), begins.tolist(), (ends - begins).tolist(), strict=True)
    )
