"""The homes of MIT's House_n (Tapia et al. 2004): blocks of five lines for each activity.

::

    Toileting,4/1/2003,17:30:36,17:46:41
    100,68
    Toilet Flush,Light switch
    17:39:37,17:35:02
    18:10:57,17:46:40

The third line on are sensors that switched on meanwhile, when they did, and when they switched off.
A file `sensors.csv` beside it has the room of each sensor: `100,Bathroom,Toilet Flush`.
"""

import csv
import re
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path

from fleet2d.bounds import one_line
from fleet2d.logs.layouts.clock import placed_in_order
from fleet2d.logs.layouts.intervals import is_leaving
from fleet2d.logs.log import AWAY, ActivityLog, LogError, Reading, log_lines, since
from fleet2d.runtime.local_time import Zone

HEAD = re.compile(
    r"([^,]+),(\d{1,2})/(\d{1,2})/(\d{4}),(\d{1,2}:\d{2}:\d{2}),(\d{1,2}:\d{2}:\d{2})"
)
"""The first line of a block."""
_SENSORS = "sensors.csv"
_LINES = 5


def read_mit(path: Path, *, sort: bool = False, zone: Zone | None = None) -> ActivityLog:
    """Read the activities of a home, and the sensors that switched on during each.

    A switch shows that somebody is there at that instant. Labels are the rooms of `sensors.csv`;
    without that file, the names of sensors. Dates have the month first.

    Raises:
        LogError: A block is damaged, or times run backwards.
    """
    file = next(iter(sorted(path.glob("activities_data*.csv"))), None) if path.is_dir() else path
    if file is None:
        raise LogError(f"{path} holds no file activities_data.csv")
    rooms = _rooms(file.with_name(_SENSORS))
    blocks = list(_blocks(file))
    if not blocks:
        raise LogError(f"{file} holds no reading: is it the right file?")
    first_day = min(begin for _, begin, _, _, _ in blocks).date()
    readings: list[Reading] = []
    for activity, begin, end, switches, line in blocks:
        if is_leaving(activity):
            times = since(first_day, begin), since(first_day, end)
            readings.append(Reading(*times, AWAY, activity, line))
        for number, name, time in switches:
            at_us = since(first_day, time)
            readings.append(Reading(at_us, at_us, rooms.get(number, name), activity, line))
    # Within a block sensors are in no order, and blocks are in that of activities.
    ordered, notes = placed_in_order(sorted(readings), first_day, zone, file, sort=sort)
    return ActivityLog(path, "mit", first_day, tuple(ordered), tuple(notes))


Block = tuple[str, datetime, datetime, list[tuple[str, str, datetime]], int]


def _blocks(path: Path) -> Iterator[Block]:
    """Yield activity, begin, end, the sensors' numbers, names and times, and the line."""
    lines = list(log_lines(path))
    for at in range(0, len(lines), _LINES):
        number, text = lines[at]
        head = HEAD.fullmatch(text)
        rows = [next(csv.reader([row])) for _, row in lines[at + 1 : at + _LINES]]
        if head is None or len(rows) < _LINES - 1 or len({len(row) for row in rows[:3]}) > 1:
            raise LogError(
                f"{path}, line {number}: expected a block of five lines: activity, date, begin and"
                f" end; numbers, names, begins and ends of sensors; got {one_line(text)!r}"
            )
        activity, month, day, year, begin, end = head.groups()
        try:
            midnight = datetime(int(year), int(month), int(day))
            first = midnight + _clock(begin)
            last = midnight + _clock(end)
            times = [midnight + _clock(text) for text in rows[2]]
        except ValueError as error:
            raise LogError(f"{path}, line {number}: no such time: {error}") from None
        last += timedelta(days=last < first)  # past midnight
        # A sensor that was on before the activity belongs to the one before.
        times = [time + timedelta(days=time < first - timedelta(hours=12)) for time in times]
        switches = zip(map(str.strip, rows[0]), map(str.strip, rows[1]), times, strict=True)
        yield activity.strip(), first, last, list(switches), number


def _clock(text: str) -> timedelta:
    hour, minute, second = map(int, text.split(":"))
    if hour > 23 or minute > 59 or second > 59:
        raise ValueError(text)
    return timedelta(hours=hour, minutes=minute, seconds=second)


def _rooms(path: Path) -> dict[str, str]:
    """Return the room of each sensor by its number, if the file is there."""
    if not path.is_file():
        return {}
    rows = csv.reader(text for _, text in log_lines(path))
    return {row[0].strip(): row[1].strip() for row in rows if len(row) >= 2}
