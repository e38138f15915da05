"""The days of a log by minutes and by seconds, and distances between sets of days."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import timedelta
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import micros
from fleet2d.floorplan.rooms.room import room_type
from fleet2d.kernels import F64, I16, Bool
from fleet2d.logs.log import AWAY, ActivityLog, LogError
from fleet2d.logs.placement import (
    DOOR,
    SIMILAR_ROOMS,
    UNKNOWN,
    USUAL_ROOMS,
    VisitRule,
    meanings,
    visits_of,
)
from fleet2d.metrics.ltp_error import total_variation
from fleet2d.runtime.clock import DAY_MINUTES, DAY_S
from fleet2d.runtime.determinism import sum_in_order

UNKNOWN_STATE = -1
KINDS = frozenset({*SIMILAR_ROOMS, DOOR, AWAY})
"""The kinds of rooms that labels are taken for."""
# The longest silences that count as a stay: between rooms, and within one room.
HOLD = timedelta(hours=3)
MAX_STILLNESS = timedelta(hours=12)
MIN_ABSENCE = timedelta(minutes=10)  # a longer silence at the front door counts as being out
# An activity in a room with less time and fewer runs than this loses its name.
RARE_MINUTES = 30
RARE_RUNS = 4
# The longest waking that doesn't end a night [min].
MAX_NIGHT_WAKING = 60
SHORTEST_NIGHT = 120  # min
NOON = DAY_MINUTES // 2
HOURS = 24
MIN_STAYS = 5  # minimum number of stays at a place whose durations are compared


class ActivityPlace(NamedTuple):
    """An activity in a kind of room; the activity is "" if it is unnamed in the log, or rare."""

    activity: str
    place: str


@dataclass(frozen=True)
class Timeline:
    """The states of a log by second and by minute, where the most frequent state counts.

    Attributes:
        states: The states.
        minutes: Index of the state in each minute, -1 if unknown, int16 (days, 1440).
        seconds: Index of the state in each second, -1 if unknown, int16 (days, 86400).
        weekdays: Day of the week of each day, 0 = Monday; None if the log has no dates.
    """

    states: tuple[ActivityPlace, ...]
    minutes: I16
    seconds: I16
    weekdays: tuple[int, ...] | None

    @property
    def places(self) -> tuple[str, ...]:
        """The kinds of rooms, and "away"."""
        return tuple(sorted({state.place for state in self.states}))

    @property
    def rooms(self) -> I16:
        """Index of the place in each minute, -1 if unknown, int16 (days, 1440)."""
        return self.places_of(self.minutes)

    def places_of(self, states: I16) -> I16:
        """Return the indices of the places of some states, -1 where unknown."""
        places = self.places
        numbers = [places.index(state.place) for state in self.states]
        index = np.array([*numbers, UNKNOWN_STATE], np.int16)
        return index[states]


def read_timeline(
    log: ActivityLog,
    rooms: Mapping[str, str] | None = None,
    gap: timedelta = HOLD,
    still: timedelta = MAX_STILLNESS,
) -> Timeline:
    """Return the state, a place and an activity, of each minute of a log.

    Args:
        log: The log.
        rooms: The kind of room of some of its labels, or away, or door; "" leaves them out.
        gap: A longer silence is unknown.
        still: Silence in one room up to this long counts as a stay.

    Raises:
        LogError: The state is unknown for most of the time, or the log has no such label.
    """
    pairs, seconds = read_seconds(log, rooms, gap, still)
    minutes = _one_per_stay(pairs, by_minute(seconds, len(pairs)))
    seconds = _one_per_stay(pairs, seconds.reshape(-1, DAY_S))
    states, index = _without_rare(pairs, minutes, seconds)
    minutes = index[minutes]
    seconds = index[seconds]
    if np.count_nonzero(minutes >= 0) < minutes.size // 4:
        raise LogError(
            f"{log.path} has no readings for most of its {log.days} days: there is nothing to fit"
        )
    first = log.first_day
    weekdays = None
    if first:
        weekdays = tuple((first.weekday() + i) % 7 for i in range(log.days))
    return Timeline(states, minutes, seconds, weekdays)


def read_seconds(
    log: ActivityLog,
    rooms: Mapping[str, str] | None = None,
    gap: timedelta = HOLD,
    still: timedelta = MAX_STILLNESS,
) -> tuple[list[ActivityPlace], I16]:
    """Return the states of a log, and for each second the index of its state, -1 if unknown."""
    kinds = kinds_of(log, rooms or {})
    rule = VisitRule(
        step_us=1_000_000,
        begin_us=0,
        steps=log.days * DAY_S,
        gap_us=micros(gap),
        still_us=micros(still),
        unknown=True,
        door_us=micros(MIN_ABSENCE),
    )
    visits = visits_of(log, kinds, rule).visits
    index: dict[ActivityPlace, int] = {}
    seconds = np.full(rule.steps, UNKNOWN_STATE, np.int16)
    for number, visit in enumerate(visits):
        if visit.place == UNKNOWN:
            continue
        visit_end = visits[number + 1].first if number + 1 < len(visits) else visit.last + 1
        place = "entryway" if visit.place == DOOR else visit.place
        parts = [(max(step, 0), label) for step, label in visit.activities]
        parts = parts or [(visit.first, "")]
        for (step, label), (end, _) in pairwise([*parts, (visit_end, "")]):
            name = room_type(label) if label else ""
            state = ActivityPlace("away" if place == AWAY and not name else name, place)
            seconds[step:end] = index.setdefault(state, len(index))
    return list(index), seconds


def kinds_of(log: ActivityLog, rooms: Mapping[str, str]) -> dict[str, tuple[str, ...] | None]:
    """Return the kind of room of each label of a log; None leaves its readings out.

    Raises:
        LogError: The log has no such label.
    """
    for label in rooms:
        if label not in log.rooms:
            known = suggest(label, sorted(log.rooms), "It has")
            raise LogError(f"--rooms: the log has no label {label!r}{known}")
    kinds: dict[str, tuple[str, ...] | None] = {label: (_kind(label),) for label in log.rooms}
    return kinds | {label: (room,) if room else None for label, room in rooms.items()}


def _kind(label: str) -> str:
    """Return the kind of room that a label usually means, or else the label itself."""
    if label == AWAY:
        return AWAY
    kind = room_type(label)
    whole = USUAL_ROOMS.get(kind, (kind,))[0]
    if whole in KINDS:
        return whole
    return next((first for first, *_ in meanings(label) if first in KINDS), kind)


def by_minute(seconds: I16, states: int) -> I16:
    """Return the most frequent state of each minute, the first of equals; unknown counts, too.

    Args:
        seconds: Index of the state in each second, -1 if unknown, int16 (whole days,).
        states: The number of states.

    Returns:
        int16 (days, 1440).
    """
    of_minute = seconds.reshape(-1, 60)
    best = of_minute[:, 0].copy()
    changes = np.flatnonzero((of_minute != of_minute[:, :1]).any(axis=1))
    varied = of_minute[changes]
    found = np.full(len(varied), UNKNOWN_STATE, np.int16)
    most = (varied == UNKNOWN_STATE).sum(axis=1)
    for state in range(states):
        count = (varied == state).sum(axis=1)
        found[count > most] = state
        most = np.maximum(most, count)
    best[changes] = found
    return best.reshape(-1, DAY_MINUTES)


def is_sleep(state: ActivityPlace) -> bool:
    """Return whether the activity of a state is sleep, by its name."""
    return "sleep" in state.activity and not state.activity.startswith("go_to")


def _one_per_stay(pairs: list[ActivityPlace], labels: I16) -> I16:
    """Give every stay in a room the activity with the most time; sleep is a separate stay.

    Short activities during a stay, such as washing hands after the toilet, are dropped.
    """
    flat = labels.ravel().copy()
    kinds: dict[tuple[str, bool], int] = {}
    kind = [kinds.setdefault((s.place, is_sleep(s)), len(kinds)) for s in pairs]
    of_state = np.array([*kind, UNKNOWN_STATE], np.int16)
    for label, begin, length in runs(of_state[flat]):
        if label >= 0:
            stay = flat[begin : begin + length]
            stay[:] = np.argmax(np.bincount(stay, minlength=len(pairs)))
    return flat.reshape(labels.shape)


def _without_rare(
    pairs: list[ActivityPlace], minutes: I16, seconds: I16
) -> tuple[tuple[ActivityPlace, ...], I16]:
    """Return the states that occur, without the names of rare activities, and their indices.

    Returns:
        The states, and for each of the pairs, and last for unknown, the index of its state.
    """
    flat = minutes.ravel()
    firsts = flat[np.append(True, flat[1:] != flat[:-1])]
    run_counts = Counter(firsts.tolist())
    minute_counts = Counter(flat.tolist())
    occur = set(np.unique(seconds).tolist()) | set(minute_counts)
    result: dict[ActivityPlace, int] = {}
    index = np.full(len(pairs) + 1, UNKNOWN_STATE, np.int16)
    for i, state in enumerate(pairs):
        if i not in occur:
            continue
        is_rare = run_counts[i] < RARE_RUNS and minute_counts[i] < RARE_MINUTES
        renamed = ActivityPlace("", state.place) if is_rare else state
        index[i] = result.setdefault(renamed, len(result))
    return tuple(result), index


def runs(labels: I16) -> list[tuple[int, int, int]]:
    """Return the runs of equal labels in a row: label, first index, length."""
    begins = np.flatnonzero(np.append(True, labels[1:] != labels[:-1]))
    ends = np.append(begins[1:], len(labels))
    columns = labels[begins], begins, ends - begins
    return list(zip(*(column.tolist() for column in columns), strict=True))


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
        up: The stretches out of bed in the following night; all of a night away.
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
    """Return the days whose night before and night after are known, at home or away.

    Days that begin before midnight are left out, as a persona gets up on the date of its day.
    """
    flat = timeline.minutes.ravel()
    asleep = np.isin(flat, list(sleep_states(timeline)))
    nights = _nights(asleep, len(timeline.minutes))
    nights |= _nights_away(timeline, nights)
    days = []
    for number in range(len(timeline.minutes)):
        before = nights.get(number - 1)
        after = nights.get(number)
        if before is None or after is None:
            continue
        _, wake = before
        bed, next_wake = after
        midnight = number * DAY_MINUTES
        if midnight <= wake < bed:
            awake = _runs(flat, wake, bed, midnight)
            night = _runs(flat, bed, next_wake, midnight)
            up = tuple(run for run in night if not asleep[midnight + run.begin])
            times = (wake - midnight, bed - midnight, next_wake - midnight)
            days.append(LivedDay(number, *times, awake, up))
    return days


def _nights(asleep: Bool, days: int) -> dict[int, tuple[int, int]]:
    """Return begin and end [min] of the night after each day: the longest sleep, if several.

    Night -1 is the one before the first day.
    """
    joined: list[list[int]] = []
    for is_sleep, begin, length in runs(asleep.astype(np.int16)):
        if is_sleep and joined and begin - joined[-1][1] <= MAX_NIGHT_WAKING:
            joined[-1][1] = begin + length
        elif is_sleep:
            joined.append([begin, begin + length])
    nights: dict[int, tuple[int, int]] = {}
    for begin, end in joined:
        number = ((begin + end) // 2 - NOON) // DAY_MINUTES
        longest = nights.get(number, (0, SHORTEST_NIGHT - 1))
        if -1 <= number < days and end - begin > longest[1] - longest[0]:
            nights[number] = (begin, end)
    return nights


def _nights_away(
    timeline: Timeline, nights: Mapping[int, tuple[int, int]]
) -> dict[int, tuple[int, int]]:
    """Return begin and end [min] of the nights in which the person is never at home.

    These nights get the median length of nights at home, so that days end as usual.
    """
    if not nights:
        return {}
    hours = [
        (begin - number * DAY_MINUTES, end - number * DAY_MINUTES)
        for number, (begin, end) in nights.items()
    ]
    bed, wake = np.median(hours, axis=0).astype(int).tolist()
    away = [i for i, state in enumerate(timeline.states) if state.place == AWAY]
    is_away = np.isin(timeline.minutes.ravel(), away)
    found = {}
    for number in range(-1, len(timeline.minutes)):
        begin = max(number * DAY_MINUTES + bed, 0)
        end = number * DAY_MINUTES + wake
        if number not in nights and end <= len(is_away) and is_away[begin:end].all():
            found[number] = begin, end
    return found


def _runs(flat: I16, begin: int, end: int, midnight: int) -> tuple[Stretch, ...]:
    return tuple(
        Stretch(state, begin - midnight + first, length)
        for state, first, length in runs(flat[begin:end])
        if state >= 0
    )


class RoutineDistances(NamedTuple):
    """Distances between sets of days, 0 where they are alike.

    Attributes:
        share: Total variation between the shares of time, 0 to 1.
        hours: Total variation hour by hour, averaged over the hours of a day.
        ks: Largest gap between the distribution functions of the durations of stays, 0 to 1.
        stay_min: Wasserstein distance between those durations [min].
        transitions: Total variation between the shares of the changes from one label to another.
    """

    share: float
    hours: float
    ks: float
    stay_min: float
    transitions: float


def distances(real: I16, other: I16, count: int) -> RoutineDistances:
    """Return the distances between days, labels int16 (days, n), -1 where unknown.

    A label is that of a minute (n = 1440) or of a second (n = 86400).

    Durations are compared place by place, weighted by the number of stays in the real days. Stays
    that midnight cuts, or of which an end is unknown, are left out in both.
    """
    stays = zip(dwell_times(real, count), dwell_times(other, count), strict=True)
    pairs = [pair for pair in stays if len(pair[0]) >= MIN_STAYS]
    total = max(sum(len(times) for times, _ in pairs), 1)
    share = total_variation(shares(real, count), shares(other, count))
    hours = total_variation(by_hour(real, count), by_hour(other, count))
    changes = total_variation(transition_shares(real, count), transition_shares(other, count))
    return RoutineDistances(
        share=float(share),
        hours=float(np.mean(hours)),
        ks=sum_in_order(len(a) * ks_distance(a, b) for a, b in pairs) / total,
        stay_min=sum_in_order(len(a) * wasserstein(a, b) for a, b in pairs) / total,
        transitions=float(changes),
    )


def transition_shares(labels: I16, count: int) -> F64:
    """Return the share of each change from one known label to another, float64 (count**2,)."""
    before = labels[:, :-1].ravel()
    after = labels[:, 1:].ravel()
    changes = np.flatnonzero((before != after) & (before >= 0) & (after >= 0))
    pairs = before[changes].astype(np.int64) * count + after[changes]
    return np.bincount(pairs, minlength=count * count) / max(len(pairs), 1)


def shares(labels: I16, count: int) -> F64:
    """Return the share of each label in the known time, float64 (count,)."""
    known = labels[labels >= 0]
    return np.bincount(known, minlength=count) / max(len(known), 1)


def by_hour(labels: I16, count: int) -> F64:
    """Return the shares of the labels in each hour of the day, (24, count)."""
    hours = labels.reshape(len(labels), HOURS, -1)
    return np.stack([shares(hours[:, hour], count) for hour in range(HOURS)])


def dwell_times(labels: I16, count: int) -> list[F64]:
    """Return the durations of the complete stays at each label [min], sorted.

    Args:
        labels: The labels of days, by minutes or by seconds, int16 (days, n).
        count: The number of labels.
    """
    per_minute = labels.shape[1] // DAY_MINUTES
    times: list[list[int]] = [[] for _ in range(count)]
    for day in labels:
        parts = runs(day)
        for before, (label, _, length), after in zip(parts, parts[1:], parts[2:], strict=False):
            if min(before[0], label, after[0]) >= 0:
                times[label].append(length)
    return [np.sort(np.array(lengths, np.float64)) / per_minute for lengths in times]


def ks_distance(a: F64, b: F64) -> float:
    """Return the Kolmogorov-Smirnov distance of two sorted samples; 1 if either is empty.

    >>> ks_distance(np.array([1.0, 2.0]), np.array([1.0, 3.0]))
    0.5
    """
    if not len(a) or not len(b):
        return 1.0
    points = np.concatenate([a, b])
    below_a = np.searchsorted(a, points, side="right") / len(a)
    below_b = np.searchsorted(b, points, side="right") / len(b)
    return float(np.abs(below_a - below_b).max())


def wasserstein(a: F64, b: F64) -> float:
    """Return the Wasserstein distance of two sorted samples; an empty one counts as a single 0.

    >>> wasserstein(np.array([1.0, 2.0]), np.array([2.0, 5.0]))
    2.0
    """
    a = a if len(a) else np.zeros(1)
    b = b if len(b) else np.zeros(1)
    points = np.sort(np.concatenate([a, b]))
    below_a = np.searchsorted(a, points[:-1], side="right") / len(a)
    below_b = np.searchsorted(b, points[:-1], side="right") / len(b)
    return float((np.abs(below_a - below_b) * np.diff(points)).sum())
