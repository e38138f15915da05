"""OpenSHS, which SIMADL was made by: a table with a column for each sensor and a row a second.

::

    bathroomCarp,bedroomCarp,bed,fridge,Activity,timestamp
    0,1,1,0,sleep,2016-04-01 08:00:00
"""

import csv
import re
from pathlib import Path

from fleet2d.bounds import one_line
from fleet2d.logs.layouts.clock import placed_in_order
from fleet2d.logs.layouts.intervals import is_leaving
from fleet2d.logs.log import (
    AWAY,
    ActivityLog,
    LogError,
    Reading,
    log_lines,
    parse_local_time,
    since,
)
from fleet2d.runtime.local_time import Zone

HEAD = re.compile(
    r"(?=.*\bactivity\b)(?=.*\btimestamp\b)(?=.*\w(?:Carp|Light|Door)\b).*", re.IGNORECASE
)
"""The first line of a table."""
_STATES = {"0": False, "1": True, "false": False, "true": True}
# Sensors that are on as long as somebody stands, sits or lies there.
_PRESENCE = re.compile(r"carp(et)?$|^bed$|^couch$", re.IGNORECASE)


def read_openshs(path: Path, *, sort: bool = False, zone: Zone | None = None) -> ActivityLog:
    """Read the sensors of a home, and the activity of each moment.

    A carpet, a bed or a couch shows where somebody is as long as it is on; any other sensor when it
    switches. Labels are the names of columns.

    Raises:
        LogError: A row is damaged, or times run backwards.
    """
    rows = csv.reader(text for _, text in log_lines(path))
    head = next(rows, [])
    low = [name.strip().lower() for name in head]
    if "timestamp" not in low or "activity" not in low:
        raise LogError(f"{path}: expected columns for sensors, Activity and timestamp in line 1")
    time_at = low.index("timestamp")
    activity_at = low.index("activity")
    sensors = [k for k in range(len(head)) if k not in (time_at, activity_at) and low[k]]
    readings: list[Reading] = []
    begun: dict[str, int] = {}  # the number of the reading that goes on, by label
    before: list[bool] | None = None
    first_day = None
    for line, row in enumerate(rows, 2):
        if len(row) != len(head) or any(row[k].strip().lower() not in _STATES for k in sensors):
            raise LogError(
                f"{path}, line {line}: expected {len(head)} values, 0 or 1 for sensors, got"
                f" {one_line(','.join(row))!r}"
            )
        moment = parse_local_time(row[time_at], path, line, day_first=False)
        first_day = first_day or moment.date()
        at = since(first_day, moment)
        activity = row[activity_at].strip()
        states = [_STATES[row[k].strip().lower()] for k in sensors]
        moment_of = Reading(at, at, AWAY, activity, line)
        _extend(readings, begun, moment_of, is_on=is_leaving(activity))
        for number, (k, is_on) in enumerate(zip(sensors, states, strict=True)):
            reading = moment_of._replace(room=head[k].strip())
            if _PRESENCE.search(reading.room):
                _extend(readings, begun, reading, is_on=is_on)
            elif before is not None and is_on != before[number]:
                readings.append(reading)
        before = states
    readings, notes = placed_in_order(readings, first_day, zone, path, sort=sort)
    assert first_day is not None  # else there is no reading, which is an error
    return ActivityLog(path, "openshs", first_day, tuple(readings), tuple(notes))


def _extend(readings: list[Reading], begun: dict[str, int], now: Reading, *, is_on: bool) -> None:
    """Let the reading of a label go on to the present, begin, or end."""
    number = begun.get(now.room)
    if not is_on:
        begun.pop(now.room, None)
    elif number is not None and readings[number].activity == now.activity:
        readings[number] = readings[number]._replace(end_us=now.end_us)
    else:
        begun[now.room] = len(readings)
        readings.append(now)
