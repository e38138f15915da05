"""The layout of the UCI ADL data sets: intervals of sensors with their place, and of activities.

::

    2011-11-28 10:21:44    2011-11-28 10:23:31    Basin    PIR    Bathroom      (…_Sensors.txt)
    2011-11-28 10:21:24    2011-11-28 10:23:36    Toileting                     (…_ADLs.txt)

The two files of a home are read together, whichever is named: the sensors show in which room a
person is, the activities what is done there and when the home is left. In a file of activities
alone, each activity stands for the room that it is done in.
"""

import re
from bisect import bisect_right
from datetime import date, datetime
from pathlib import Path
from typing import NamedTuple

from fleet2d.bounds import one_line
from fleet2d.logs.log import (
    AWAY,
    ActivityLog,
    LogError,
    Reading,
    in_order,
    log_lines,
    parse_time,
    since,
)

_TIME = r"(\d{4}-\d\d?-\d\d?\s+\d+:\S+)"
LINE = re.compile(rf"{_TIME}\s+{_TIME}\s+(.*)")
HEAD = re.compile(r"(Start time\s+End time.*|[-\s]+)")
FOLDERS = True
LEAVING = frozenset({"leaving", "leave_home", "away", "out"})


class _Row(NamedTuple):
    """A line of a file; `words` are an activity, or a sensor with its type and place."""

    begin: datetime
    end: datetime
    words: str
    line: int


def matches(line: str) -> bool:
    """Return whether a line is an interval, or of the head of a table."""
    return (LINE.fullmatch(line) or HEAD.fullmatch(line)) is not None


def read(path: Path, *, sort: bool = False) -> ActivityLog:
    """Read a home's sensors and activities.

    Raises:
        LogError: A line is damaged, or times run backwards.
    """
    files = {kind: (file, _rows(file)) for kind, file in _pair(path).items()}
    first_day = min(row.begin.date() for _, rows in files.values() for row in rows)
    notes: list[str] = []
    parts: dict[str, list[Reading]] = {"sensors": [], "activities": []}
    for kind, (file, rows) in files.items():
        readings = [_reading(row, first_day) for row in rows]
        parts[kind], order_notes = in_order(readings, file, sort=sort)
        notes += [f"{file.name}: {note}" for note in order_notes]
    readings = parts["activities"]
    if parts["sensors"]:
        readings = _with_activities(parts["sensors"], readings)
    return ActivityLog(path, "uci_adl", first_day, tuple(readings), tuple(notes))


def _pair(path: Path) -> dict[str, Path]:
    """Return the files of a home: of sensors, of activities, or both."""
    if path.is_dir():
        by_kind = {
            "sensors": sorted(path.glob("*_Sensors.txt")),
            "activities": sorted(path.glob("*_ADLs.txt")),
        }
        for kind, files in by_kind.items():
            if len(files) > 1:
                raise LogError(f"{path} holds {len(files)} files of {kind}: name the one to read")
        return {kind: files[0] for kind, files in by_kind.items() if files}
    is_sensors = len(_rows(path)[0].words.split()) >= 3
    parts = ("_Sensors", "_ADLs") if is_sensors else ("_ADLs", "_Sensors")
    twin = path.with_name(path.name.replace(*parts))
    pair = {"sensors" if is_sensors else "activities": path}
    if twin != path and twin.is_file():
        pair["activities" if is_sensors else "sensors"] = twin
    return pair


def _rows(path: Path) -> list[_Row]:
    rows = []
    for number, text in log_lines(path):
        if HEAD.fullmatch(text):
            continue
        match = LINE.fullmatch(text)
        if match is None or not match[3].strip():
            raise LogError(
                f"{path}, line {number}: expected a start time, an end time, and an activity or a"
                f" sensor with its type and place, got {one_line(text)!r}"
            )
        begin, end = (parse_time(" ".join(match[i].split()), path, number) for i in (1, 2))
        rows.append(_Row(begin, end, match[3].strip(), number))
    if not rows:
        raise LogError(f"{path} holds no reading: is it the right file?")
    return rows


def _reading(row: _Row, first_day: date) -> Reading:
    begin, end, text, number = row
    words = text.split()
    label = words[-1]
    activity = label if len(words) == 1 else ""
    room = AWAY if activity.lower() in LEAVING else label
    return Reading(since(first_day, begin), since(first_day, end), room, activity, number)


def _with_activities(sensors: list[Reading], activities: list[Reading]) -> list[Reading]:
    """Label sensor readings with the concurrent activity, and add readings for absences."""
    begins = [activity.begin_us for activity in activities]
    readings = [reading for reading in activities if reading.room == AWAY]
    for sensor in sensors:
        number = bisect_right(begins, sensor.begin_us) - 1
        is_part = number >= 0 and sensor.begin_us <= activities[number].end_us
        readings.append(sensor._replace(activity=activities[number].activity if is_part else ""))
    # Of readings with the same begin, being out comes last, so that it holds.
    return sorted(readings, key=lambda reading: (reading.begin_us, reading.room == AWAY))
