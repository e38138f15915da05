"""The CASAS layout: a line per sensor event, with date, time, room, sensor, value and activity.

::

    2011-06-15 01:41:40.205759 Bathroom Bathroom ON Bed_Toilet_Transition

Only sensors that switch on show that somebody is there: a motion sensor switches off by itself,
seconds after the last motion, when the person may be gone.
"""

import re
from collections import Counter
from pathlib import Path

from fleet2d.bounds import one_line
from fleet2d.logs.log import ActivityLog, LogError, Reading, in_order, log_lines, parse_time, since

LINE = re.compile(r"(\d{4}-\d\d?-\d\d?)\s+(\d+:\S+)\s+(\S+)\s+(\S+)\s+(\S+)(?:\s+(.*))?")
ON = frozenset({"ON", "OPEN", "PRESENT"})
OFF = frozenset({"OFF", "CLOSE", "CLOSED", "ABSENT"})
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")
FOLDERS = False


def matches(line: str) -> bool:
    """Return whether a line is an event of a sensor that switches or measures."""
    match = LINE.fullmatch(line)
    if match is None:
        return False
    return match[5].upper() in ON | OFF or NUMBER.fullmatch(match[5]) is not None


def read(path: Path, *, sort: bool = False) -> ActivityLog:
    """Read the events of a home; those that switch on become readings of an instant.

    Raises:
        LogError: A line is damaged, or times run backwards.
    """
    readings: list[Reading] = []
    others: Counter[str] = Counter()
    first_day = None
    for number, text in log_lines(path):
        match = LINE.fullmatch(text)
        if match is None:
            raise LogError(
                f"{path}, line {number}: expected date, time, room, sensor, ON or OFF, and"
                f" activity, got {one_line(text)!r}"
            )
        day, time, room, _, value, activity = match.groups()
        moment = parse_time(f"{day} {time}", path, number)
        first_day = first_day or moment.date()
        if value.upper() in ON:
            at = since(first_day, moment)
            readings.append(Reading(at, at, room, (activity or "").strip(), number))
        elif value.upper() not in OFF:
            others[value] += 1
    readings, notes = in_order(readings, path, sort=sort)
    if others:
        values = one_line(", ".join(sorted(others)[:5]), 200)
        notes.append(f"{others.total()} lines are neither ON nor OFF and left out: {values}")
    return ActivityLog(path, "casas", first_day, tuple(readings), tuple(notes))
