"""The homes of van Kasteren et al. (2008): sensors and activities in files of their own, by number.

::

    25-Feb-2008 09:33:41  25-Feb-2008 09:33:42  24        (…-ss.txt: a sensor)
    25-Feb-2008 00:22:46  25-Feb-2008 09:34:12  18        (…-as.txt: an activity)
    24,Hall-Bedroom door,Sleep                            (…sensorMap….txt)
    18,go-to-bed                                          (…actionMap….txt)
"""

import re
from collections.abc import Mapping
from datetime import date, datetime
from pathlib import Path

from fleet2d.bounds import one_line
from fleet2d.logs.layouts.clock import by_clock
from fleet2d.logs.layouts.intervals import is_leaving, label_by_activities
from fleet2d.logs.log import (
    AWAY,
    ActivityLog,
    LogError,
    Reading,
    in_order,
    log_lines,
    since,
    wrong_ends,
)
from fleet2d.runtime.clock import DAY_US
from fleet2d.runtime.local_time import Zone

_STAMP = r"(\d{1,2}-[A-Za-z]{3}-\d{4}\s+\d{1,2}:\d{2}:\d{2})"
LINE = re.compile(rf"{_STAMP}\s+{_STAMP}\s+(\d+)")
"""A line of sensors or activities."""
_NAME = re.compile(r"(\d+)\s*,\s*([^,]+?)\s*(?:,.*)?")
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
# Sensors that are on as long as somebody is there; all others tell by switching that somebody is.
_PRESENCE = re.compile(r"\b(mat|matt|pressure|couch|pir)\b", re.IGNORECASE)
# The activity lasts as long as the night.
_GOING_TO_BED, _NIGHT = "go-to-bed", "sleeping"
_KINDS = {"-ss": "sensors", "-as": "activities"}
_MAPS = {"sensors": "sensormap", "activities": "actionmap"}


def read_kasteren(path: Path, *, sort: bool = False, zone: Zone | None = None) -> ActivityLog:
    """Read the sensors and activities of a home, whichever of its files is named, or the folder.

    During an activity, somebody is where it is done. Else a door or a cupboard shows that somebody
    is there when it opens and when it shuts, not in between; a mat in a bed does all the time.
    Labels are the names of activities and sensors.

    Raises:
        LogError: A line is damaged, times run backwards, or a folder holds several homes.
    """
    files = _files(path)
    first_day = min(_first_day(file) for file in files.values())
    sensors: list[Reading] = []
    activities: list[Reading] = []
    notes: list[str] = []
    for kind, file in files.items():
        rows, clock_notes = by_clock(
            _rows(file, first_day, _names(file, kind)), first_day, zone, file
        )
        if kind == "sensors":
            readings = _switches(rows)
            sensors, order_notes = in_order(readings, file, sort=sort)
            order_notes = wrong_ends(rows) + order_notes
            notes += _stuck_notes(file, rows)
        else:
            activities, order_notes = in_order(rows, file, sort=sort)
        notes += [f"{file.name}: {note}" for note in (*clock_notes, *order_notes)]
    labelled = label_by_activities(sensors, activities)
    idle = [reading for reading in labelled if not reading.activity and reading.room != AWAY]
    readings = sorted([*activities, *idle], key=lambda reading: reading.begin_us)
    return ActivityLog(path, "kasteren", first_day, tuple(readings), tuple(notes), tuple(sensors))


def _switches(rows: list[Reading]) -> list[Reading]:
    """Return what sensors show: when they switch, and all the time of those of presence."""
    readings = []
    for row in rows:
        if _PRESENCE.search(row.room) and not _is_stuck(row):
            readings.append(row._replace(end_us=max(row.begin_us, row.end_us), activity=""))
            continue
        switches = dict.fromkeys((row.begin_us, max(row.begin_us, row.end_us)))
        readings += [Reading(time_us, time_us, row.room, "", row.line) for time_us in switches]
    # A line is two instants, which overlap those of other lines.
    return sorted(readings, key=lambda reading: reading.begin_us)


def _is_stuck(row: Reading) -> bool:
    return row.end_us - row.begin_us > DAY_US


def _stuck_notes(path: Path, rows: list[Reading]) -> list[str]:
    lines = [str(row.line) for row in rows if _is_stuck(row) and _PRESENCE.search(row.room)]
    if not lines:
        return []
    numbers = one_line(", ".join(lines), 100)
    return [f"{path.name}: on for more than a day, so only their switching counts: line {numbers}"]


def _rows(path: Path, first_day: date, names: Mapping[str, str]) -> list[Reading]:
    """Return the lines of a file; the label of an activity is its name."""
    rows = []
    for number, text in log_lines(path):
        begin, end, key = _row(text, path, number)
        name = names.get(key, key)
        name = _NIGHT if name == _GOING_TO_BED else name
        begin_us = since(first_day, begin)
        end_us = since(first_day, end)
        rows.append(Reading(begin_us, end_us, AWAY if is_leaving(name) else name, name, number))
    return rows


def _row(text: str, path: Path, line: int) -> tuple[datetime, datetime, str]:
    match = LINE.fullmatch(text)
    if match is None:
        raise LogError(
            f"{path}, line {line}: expected a begin, an end and a number, like '25-Feb-2008"
            f" 00:19:32  25-Feb-2008 00:21:24  17', got {one_line(text)!r}"
        )
    return _time(match[1], path, line), _time(match[2], path, line), match[3]


def _time(text: str, path: Path, line: int) -> datetime:
    day, month, rest = text.split("-", 2)
    year, clock = rest.split()
    try:
        hour, minute, second = map(int, clock.split(":"))
        number = _MONTHS.index(month.lower()) + 1
        return datetime(int(year), number, int(day), hour, minute, second)
    except ValueError as error:
        raise LogError(f"{path}, line {line}: {one_line(text)!r} is not a time: {error}") from None


def _first_day(path: Path) -> date:
    """Return the day of the first line of a file."""
    for number, text in log_lines(path):
        return _row(text, path, number)[0].date()
    raise LogError(f"{path} holds no reading: is it the right file?")


def _files(path: Path) -> dict[str, Path]:
    """Return the files of a home by kind: sensors, activities, or both."""
    if path.is_dir():
        return _files_in(path)
    kind = next((k for end, k in _KINDS.items() if path.stem.endswith(end)), "sensors")
    other = "-as" if kind == "sensors" else "-ss"
    twin = path.with_name(f"{path.stem[:-3]}{other}{path.suffix}")
    pair = {kind: path}
    return pair | ({_KINDS[other]: twin} if twin.is_file() and twin != path else {})


def _files_in(folder: Path) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for end, kind in _KINDS.items():
        files = sorted(folder.glob(f"*{end}.txt"))
        if len(files) > 1:
            raise LogError(
                f"{folder} holds {len(files)} files of {kind}: name the one to read, such as"
                f" {files[0].name}"
            )
        if files:
            found[kind] = files[0]
    if not found:
        raise LogError(f"{folder} holds no file like kast_houseA-ss.txt")
    return found


def _names(path: Path, kind: str) -> Mapping[str, str]:
    """Return the names of the numbers of a file: from the map of its home that is beside it."""
    home = re.search(r"house\s*(\w)", path.stem, re.IGNORECASE)
    letter = home[1] if home else ""
    pattern = re.compile(rf"{_MAPS[kind]}(?:{letter}(?![A-Za-z])|$)", re.IGNORECASE)
    maps = [file for file in sorted(path.parent.glob("*.txt")) if pattern.search(file.stem)]
    if not maps:
        return {}
    names: dict[str, str] = {}
    for line, text in log_lines(maps[0]):
        match = _NAME.fullmatch(text)
        if match is None:
            continue
        number, name = match.groups()
        if names.setdefault(number, name) != name:
            raise LogError(f"{maps[0]}, line {line}: {number} is {names[number]!r} already")
    return names
