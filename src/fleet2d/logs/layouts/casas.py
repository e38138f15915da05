"""CASAS: events of the sensors of a home, with the sensor's room or without, and activities.

Without rooms are Aruba, Milan, Cairo, Kyoto, Tulum and others; activities begin and end there::

    2010-11-04 00:03:50.209589 M003 ON Sleeping begin
    2010-11-04 05:40:43.642664 M003 OFF Sleeping end

With rooms, each line has its activity::

    2011-06-15 01:41:40.205759 Bathroom Bathroom ON Bed_Toilet_Transition
"""

import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from fleet2d.bounds import one_line
from fleet2d.logs.layouts.clock import placed_in_order
from fleet2d.logs.log import (
    ActivityLog,
    LogError,
    Reading,
    log_lines,
    parse_local_time,
    since,
)
from fleet2d.runtime.local_time import Zone

ON = frozenset({"ON", "OPEN", "PRESENT", "START"})
OFF = frozenset({"OFF", "CLOSE", "CLOSED", "ABSENT", "STOP", "END"})
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")
_STAMP = r"(\d{4}-\d\d?-\d\d?)\s+(\d+:\S+)"
_WITH_ROOM = re.compile(rf"{_STAMP}\s+(\S+)\s+(\S+)\s+(\S+)(?:\s+(.*))?")
_WITHOUT_ROOM = re.compile(rf"{_STAMP}\s+(\S+)\s+(\S+)(?:\s+(.*))?")
_MARK = re.compile(r"(.*?)[\s_]*\b(begin|start|end|stop)\b\W*", re.IGNORECASE)


class _SensorLine(NamedTuple):
    """A line: `activity` is what it says of one."""

    day: str
    time: str
    label: str
    value: str
    activity: str


def _is_value(text: str) -> bool:
    return text.upper() in ON | OFF or _NUMBER.fullmatch(text) is not None


def _event(line: str, has_rooms: bool) -> _SensorLine | None:
    match = (_WITH_ROOM if has_rooms else _WITHOUT_ROOM).fullmatch(line)
    if match is None:
        return None
    day, time, label, *_, value, activity = match.groups()
    return _SensorLine(day, time, label, value, (activity or "").strip())


def _has_rooms(line: str) -> bool | None:
    """Return whether an event names the room of its sensor; None: it isn't one."""
    for has_rooms in (False, True):
        event = _event(line, has_rooms)
        if event is not None and _is_value(event.value):
            return has_rooms
    return None


def shows_casas(line: str) -> bool:
    """Return whether a line is an event of a sensor that switches or measures.

    Example:
        >>> shows_casas("2010-11-04 00:03:50.209589 M003 ON Sleeping begin")
        True
    """
    return _has_rooms(line) is not None


def read_casas(path: Path, *, sort: bool = False, zone: Zone | None = None) -> ActivityLog:
    """Read the events of a home; those that switch on become readings of an instant.

    Only sensors that switch on show that somebody is there: a motion sensor switches off by itself,
    seconds after the last motion, when the person may be gone. Where lines have no rooms, the
    sensor is the label.

    Raises:
        LogError: A line is damaged, times run backwards, or nothing switches on.
    """
    readings: list[Reading] = []
    others: Counter[str] = Counter()
    under_way: list[str] = []  # activities, the last one begun last
    has_rooms = None
    first_day = None
    for number, text in log_lines(path):
        has_rooms = _has_rooms(text) if has_rooms is None else has_rooms
        event = _event(text, bool(has_rooms))
        if event is None:
            raise LogError(
                f"{path}, line {number}: expected date, time, sensor (or room and sensor), ON or"
                f" OFF, and activity, got {one_line(text)!r}"
            )
        moment = parse_local_time(f"{event.day} {event.time}", path, number)
        first_day = first_day or moment.date()
        activity = event.activity if has_rooms else _activity(event.activity, under_way)
        if event.value.upper() in ON:
            at = since(first_day, moment)
            readings.append(Reading(at, at, event.label, activity, number))
        elif event.value.upper() not in OFF:
            others[event.value] += 1
    values = one_line(", ".join(sorted(others)[:5]), 200)
    if not readings:
        words = f", got {values}" if others else ""
        raise LogError(f"{path}: no sensor switches on in it; expected ON and OFF{words}")
    readings, notes = placed_in_order(readings, first_day, zone, path, sort=sort)
    if others:
        notes.append(f"{others.total()} lines are neither ON nor OFF and left out: {values}")
    if under_way:
        notes.append(f"activities without an end: {one_line(', '.join(under_way), 200)}")
    assert first_day is not None  # else there is no reading, which is an error
    return ActivityLog(path, "casas", first_day, tuple(readings), tuple(notes))


def _activity(text: str, under_way: list[str]) -> str:
    """Return the activity of a line, and update those that are under way by its mark."""
    match = _MARK.fullmatch(text)
    if match is None:
        return text or (under_way[-1] if under_way else "")
    name = match[1].strip()
    mark = match[2].lower()
    if mark in ("begin", "start"):
        under_way.append(name)
        return name
    if name in under_way:
        under_way.remove(name)
    return name
