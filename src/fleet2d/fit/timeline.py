"""A log as minutes: which activity is done in which kind of room, in each minute of each day."""

from collections import Counter
from dataclasses import dataclass
from datetime import timedelta
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.floorplan.rooms.vocabulary import room_type
from fleet2d.logs.log import AWAY, ActivityLog, LogError
from fleet2d.logs.rooms import DOOR, USUAL
from fleet2d.logs.visits import UNKNOWN, LoggedVisit, VisitRule, visits_of
from fleet2d.units import micros

MINUTES = 1440
DAY_S = 86_400
NOBODY_KNOWS = -1
# Silence up to this is taken for staying: who is modelled has to be somewhere.
HOLD = timedelta(hours=3)
STILL = timedelta(hours=12)
OUT = timedelta(minutes=10)  # silence at the front door that lasts longer is being out
# A pair of activity and room that is rarer than both becomes part of the room's others.
RARE_MINUTES, RARE_RUNS = 30, 4

I16 = NDArray[np.int16]


class State(NamedTuple):
    """What is done where: `activity` is "" for what the log doesn't name or what is rare."""

    activity: str
    place: str


@dataclass(frozen=True)
class Timeline:
    """What is done in each minute: what holds for most of its seconds.

    Attributes:
        states: What there is.
        minutes: Index of the state, -1 where nobody knows, int16 (days, 1440).
        weekdays: Day of the week of each day, 0 = Monday; None where the log has no dates.
    """

    states: tuple[State, ...]
    minutes: I16
    weekdays: tuple[int, ...] | None

    @property
    def places(self) -> tuple[str, ...]:
        """The kinds of rooms, and "away"."""
        return tuple(sorted({state.place for state in self.states}))

    @property
    def rooms(self) -> I16:
        """Index of the place in each minute, -1 where nobody knows, int16 (days, 1440)."""
        places = self.places
        index = np.array([places.index(s.place) for s in self.states] + [-1], np.int16)
        return index[self.minutes]


def read_timeline(log: ActivityLog) -> Timeline:
    """Return the minutes of a log.

    Raises:
        LogError: It tells nothing for most of the time.
    """
    pairs, seconds = read_seconds(log)
    minutes = _by_minute(seconds, len(pairs))
    states, minutes = _without_rare(pairs, _one_a_stay(pairs, minutes))
    if np.count_nonzero(minutes >= 0) < minutes.size // 4:
        raise LogError(
            f"{log.path} tells nothing for most of its {log.days} days: there is nothing to fit"
        )
    first = log.first_day
    weekdays = tuple((first.weekday() + i) % 7 for i in range(log.days)) if first else None
    return Timeline(states, minutes, weekdays)


def read_seconds(log: ActivityLog) -> tuple[list[State], I16]:
    """Return the states of a log, and the index of that in each second of its days, -1 unknown."""
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


def _by_second(visits: list[LoggedVisit], count: int) -> tuple[list[State], I16]:
    index: dict[State, int] = {}
    seconds = np.full(count, NOBODY_KNOWS, np.int16)
    for number, visit in enumerate(visits):
        if visit.place == UNKNOWN:
            continue
        over = visits[number + 1].first if number + 1 < len(visits) else visit.last + 1
        place = "entryway" if visit.place == DOOR else visit.place
        begun = [(max(step, 0), what) for step, what in visit.activities] or [(visit.first, "")]
        for (step, what), (end, _) in zip(begun, [*begun[1:], (over, "")], strict=True):
            name = room_type(what) if what else ""
            state = State("away" if place == AWAY and not name else name, place)
            seconds[step:end] = index.setdefault(state, len(index))
    return list(index), seconds


def _by_minute(seconds: I16, states: int) -> I16:
    """Return the state that holds longest in each minute, the first of equals; -1 counts, too."""
    by_minute = seconds.reshape(-1, 60)
    best = np.full(len(by_minute), NOBODY_KNOWS, np.int16)
    most = (by_minute == NOBODY_KNOWS).sum(axis=1)
    for state in range(states):
        count = (by_minute == state).sum(axis=1)
        best[count > most] = state
        most = np.maximum(most, count)
    return best.reshape(-1, MINUTES)


def is_sleep(state: State) -> bool:
    """Tell whether a state is named as sleep."""
    return "sleep" in state.activity and not state.activity.startswith("go_to")


def _one_a_stay(pairs: list[State], minutes: I16) -> I16:
    """Let every stay in a room be of the activity that it is most of; sleep is a stay of its own.

    What is done in passing on a stay, washing hands after the toilet, is no stay by itself.
    """
    flat = minutes.ravel().copy()
    kinds: dict[tuple[str, bool], int] = {}
    kind = [kinds.setdefault((s.place, is_sleep(s)), len(kinds)) for s in pairs]
    of_state = np.array([*kind, NOBODY_KNOWS], np.int16)
    for label, begin, length in runs(of_state[flat]):
        if label >= 0:
            stay = flat[begin : begin + length]
            stay[:] = np.argmax(np.bincount(stay, minlength=len(pairs)))
    return flat.reshape(-1, MINUTES)


def _without_rare(pairs: list[State], minutes: I16) -> tuple[tuple[State, ...], I16]:
    flat = minutes.ravel()
    begun = flat[np.append(True, flat[1:] != flat[:-1])]
    runs, lasts = Counter(begun.tolist()), Counter(flat.tolist())
    kept: dict[State, int] = {}
    index = np.full(len(pairs) + 1, NOBODY_KNOWS, np.int16)
    for i, state in enumerate(pairs):
        if not lasts[i]:
            continue
        rare = runs[i] < RARE_RUNS and lasts[i] < RARE_MINUTES
        index[i] = kept.setdefault(State("", state.place) if rare else state, len(kept))
    return tuple(kept), index[minutes]


def runs(labels: I16) -> list[tuple[int, int, int]]:
    """Return the runs of equal labels in a row of minutes: label, first minute, length."""
    begins = np.flatnonzero(np.append(True, labels[1:] != labels[:-1]))
    ends = np.append(begins[1:], len(labels))
    return list(
        zip(labels[begins].tolist(), begins.tolist(), (ends - begins).tolist(), strict=True)
    )
