"""Days of people by minutes: kinds of rooms, sensors that fired last, and classes of activities."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any, Self

import numpy as np

from fleet2d.kernels import I16, I64
from fleet2d.learning.datasets.reader import Dataset
from fleet2d.learning.datasets.tasks import labels_by_person
from fleet2d.learning.fit.timeline import ActivityPlace, by_minute, kinds_of, read_seconds
from fleet2d.logs.log import AWAY, ActivityLog
from fleet2d.logs.placement import DOOR
from fleet2d.runtime.clock import DAY_MINUTES

KINDS = (AWAY, "bathroom", "bedroom", "kitchen", "living_room", "other", "entry")
"""The kinds of rooms that all homes are compared in; `entry` is that of sensors only."""
SIMILAR = {
    "toilet": "bathroom", "dining_room": "kitchen", "office": "living_room",
    "child_room": "bedroom", "guest_room": "bedroom",
    **dict.fromkeys(("entryway", "hallway", "hall", "corridor", "lobby", DOOR), "entry"),
}  # fmt: skip
ENTRY = KINDS.index("entry")
OTHER = KINDS.index("other")
OUT = KINDS.index(AWAY)
UNKNOWN = -1
CLASSES = ("out", "sleep", "toilet", "wash", "food", "leisure", "other")
# A name belongs to the first class with a word that begins one of the name's words.
WORDS = {
    "food": "dish cook prep breakfast lunch dinner supper snack meal eat drink food",
    "sleep": "sleep nap",
    "toilet": "toilet",
    "wash": "wash shower bath groom hygiene brush teeth dress",
    "leisure": "tv relax read computer work study music rest game hobby phone talk play spare party"
    " homework",
}
# The share of a day that must be known for it to count.
KNOWN_SHARE = 0.5
# The microseconds of a minute.
MICROSECONDS = 60_000_000


@dataclass(frozen=True)
class MinuteTrace:
    """The minutes of a person from a midnight on, each int16 (minutes,), -1 if unknown.

    Attributes:
        rooms: Index of the kind of room; passages count as the room before them.
        sensors: Index of the kind of room whose sensor fired last; no sensor shows absence.
        activities: Index of the class of activity.
        weekday: Day of the week of the first day, 0 = Monday.
        days: The days that are known for most of the time, int64.
    """

    rooms: I16
    sensors: I16
    activities: I16
    weekday: int
    days: I64

    @classmethod
    def of(cls, rooms: I16, sensors: I16, activities: I16, weekday: int) -> Self:
        """Return a trace of whole days."""
        known = (rooms >= 0).reshape(-1, DAY_MINUTES).mean(axis=1) >= KNOWN_SHARE
        return cls(rooms, sensors, activities, weekday, np.flatnonzero(known))

    def joined(self, days: Sequence[int] | I64) -> Self:
        """Return some of its days as a trace of their own, one after the other."""
        rooms, sensors, activities = (
            labels.reshape(-1, DAY_MINUTES)[days].ravel()
            for labels in (self.rooms, self.sensors, self.activities)
        )
        return self.of(rooms, sensors, activities, (self.weekday + int(days[0])) % 7)


def class_of(activity: str) -> str:
    """Return the class of an activity, by the words in its name.

    >>> [class_of(name) for name in ("Spare_Time/TV", "wash_dishes", "bed_toilet_transition")]
    ['leisure', 'food', 'toilet']
    """
    words = re.split(r"[\W_]+", activity.lower())
    for name, stems in WORDS.items():
        if any(word.startswith(tuple(stems.split())) for word in words):
            return name
    return "other"


def code_of(kind: str) -> int:
    """Return the index in KINDS of a kind of room."""
    kind = SIMILAR.get(kind, kind)
    return KINDS.index(kind) if kind in KINDS else OTHER


def trace_of_log(
    log: ActivityLog, rooms: dict[str, str], activities: dict[str, str]
) -> MinuteTrace:
    """Return the minutes of a log.

    Args:
        log: The log.
        rooms: The kind of room of some of its labels.
        activities: The class of some of its activities.

    Raises:
        LogError: The log has no such label.
    """
    states, seconds = read_seconds(log, rooms)
    kinds = [code_of(state.place) for state in states]
    classes = [_class_of_state(state, activities) for state in states]
    kind = np.array([*kinds, UNKNOWN], np.int16)[seconds]
    doing = np.array([*classes, UNKNOWN], np.int16)[seconds]
    minutes = by_minute(_held(kind, ENTRY), len(KINDS)).ravel()
    doing = by_minute(doing, len(CLASSES)).ravel()
    weekday = log.first_day.weekday() if log.first_day else 0
    return MinuteTrace.of(minutes, _fired(log, rooms, len(minutes)), doing, weekday)


def _class_of_state(state: ActivityPlace, activities: dict[str, str]) -> int:
    if state.place == AWAY:
        return CLASSES.index("out")
    if not state.activity:
        return UNKNOWN
    name = activities.get(state.activity) or class_of(state.activity)
    return CLASSES.index(name)


def _held(codes: I16, ignored: int) -> I16:
    """Return codes in which one code, such as that of passages, gives way to the one before it."""
    at = np.where(codes == ignored, 0, np.arange(len(codes)))
    held = codes[np.maximum.accumulate(at)]
    return np.where(held == ignored, UNKNOWN, held).astype(np.int16)


def _fired(log: ActivityLog, rooms: dict[str, str], minutes: int) -> I16:
    """Return for each minute the kind of room whose sensor fired last, -1 before the first one."""
    sensors = replace(log, readings=log.sensors or log.readings)
    known = {label: kind for label, kind in rooms.items() if label in sensors.rooms}
    kinds = kinds_of(sensors, known)
    events = []
    for reading in sensors.readings:
        kind = kinds[reading.room]
        if kind is not None and kind[0] != AWAY:
            events += [(at_us, code_of(kind[0])) for at_us in (reading.begin_us, reading.end_us)]
    events.sort()
    times_us = [at_us for at_us, _ in events]
    codes = np.array([*(code for _, code in events), UNKNOWN], np.int16)
    ends_us = (np.arange(minutes) + 1) * MICROSECONDS
    return codes[np.searchsorted(times_us, ends_us, side="right") - 1]


def traces_of_data(data: Dataset) -> Iterator[MinuteTrace]:
    """Yield the minutes of each simulated person of a data set, whose runs begin at midnight."""
    for labels in labels_by_person(data, "train"):
        codes = np.array([code_of(kind) for kind in labels["kind"]], np.int16)
        count = len(codes) // DAY_MINUTES * DAY_MINUTES
        codes = codes[:count]
        classes = np.array([CLASSES.index(class_of(name or "")) for name in labels["activity"]])
        doing = np.where(codes == OUT, CLASSES.index("out"), classes[:count]).astype(np.int16)
        weekday = labels["time"][0].astype("datetime64[D]").astype(object).weekday()
        yield MinuteTrace.of(_held(codes, ENTRY), _held(codes, OUT), doing, weekday)


def copied(trace: MinuteTrace, days: Any, count: int, seed: int) -> MinuteTrace:
    """Return copies of whole days, drawn with replacement."""
    return trace.joined(np.random.default_rng(seed).choice(days, count))


def markov(trace: MinuteTrace, days: Any, count: int, seed: int) -> MinuteTrace:
    """Return days of the first-order Markov chain of whole minutes of some days."""
    own = trace.joined(days)
    stacked = np.stack([own.rooms, own.sensors, own.activities])
    states, numbers = np.unique(stacked, axis=1, return_inverse=True)
    numbers = numbers.ravel()
    follows = np.zeros((states.shape[1], states.shape[1]))
    np.add.at(follows, (numbers[:-1], numbers[1:]), 1)
    follows[numbers[-1], numbers[0]] += 1  # every state needs a successor
    limits = (follows / follows.sum(axis=1, keepdims=True)).cumsum(axis=1)
    at = int(numbers[0])
    path = np.empty(count * DAY_MINUTES, np.int64)
    draws = np.random.default_rng(seed).random(len(path))
    for k, draw in enumerate(draws.tolist()):
        path[k] = at
        at = min(int(limits[at].searchsorted(draw, "right")), len(limits) - 1)
    rooms, sensors, activities = states[:, path].astype(np.int16)
    return MinuteTrace.of(rooms, sensors, activities, trace.weekday)


def write_log(trace: MinuteTrace, first_day: date, path: Path) -> None:
    """Write the rooms of known kinds of a trace as a log that can be replayed."""
    moment = datetime.combine(first_day, datetime.min.time())
    lines = []
    for minute, code in enumerate(trace.rooms.tolist()):
        if code not in (UNKNOWN, OTHER):
            room = "Away" if code == OUT else KINDS[code]
            at = moment + timedelta(minutes=minute)
            lines.append(f"{at} {room} {room} ON")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def known_midnight(log: ActivityLog) -> date:
    """Return the date of the first day of a log; a Monday if it has none."""
    return log.first_day or date(2026, 1, 5)
