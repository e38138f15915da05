"""The CASAS layout: a line per sensor event, with date, time, room, sensor, value and activity.

::

    2011-06-15 01:41:40.205759 Bathroom Bathroom ON Bed_Toilet_Transition

Only what switches on tells that somebody is there: a motion sensor switches off by itself, seconds
after the last motion, when the body may be gone.
"""

import re
from collections import Counter
from pathlib import Path

from fleet2d.logs.log import ActivityLog, LogError, Reading, in_order
from fleet2d.logs.times import parse_time, since

LINE = re.compile(r"(\d{4}-\d\d?-\d\d?)\s+(\d+:\S+)\s+(\S+)\s+(\S+)\s+(\S+)(?:\s+(.*))?")
ON = frozenset({"ON", "OPEN", "PRESENT"})
OFF = frozenset({"OFF", "CLOSE", "CLOSED", "ABSENT"})


def read_casas(path: Path, *, sort: bool = False) -> ActivityLog:
    """Read the events of a home; those that switch on become readings of an instant.

    Raises:
        LogError: A line is damaged, or times run backwards.
    """
    readings: list[Reading] = []
    others: Counter[str] = Counter()
    first_day = None
    with path.open(encoding="utf-8", errors="replace") as lines:
        for number, text in enumerate(lines, 1):
            if not text.strip():
                continue
            match = LINE.fullmatch(text.strip())
            if match is None:
                raise LogError(
                    f"{path}, line {number}: found {text.strip()[:60]!r} where date, time, room,"
                    " sensor, ON or OFF, and activity are wanted"
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
        values = ", ".join(sorted(others)[:5])
        notes.append(f"{others.total()} lines are neither ON nor OFF and left out: {values}")
    return ActivityLog(path, "casas", first_day, tuple(readings), tuple(notes))
