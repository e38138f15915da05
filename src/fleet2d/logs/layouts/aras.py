"""ARAS (Alemdar et al. 2013): a line a second with 20 sensors and the activities of two residents.

::

    0 0 0 0 1 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 12 17        (DAY_1.txt)
"""

import re
from datetime import timedelta
from itertools import groupby
from pathlib import Path

from fleet2d.bounds import one_line
from fleet2d.configuration.units import micros
from fleet2d.logs.layouts.intervals import is_leaving
from fleet2d.logs.log import AWAY, ActivityLog, LogError, Reading, in_order, log_lines
from fleet2d.runtime.clock import DAY_US
from fleet2d.runtime.local_time import Zone

LINE = re.compile(r"(?:[01]\s+){20}\d{1,2}\s+\d{1,2}")
"""A second."""
ACTIVITIES = (
    "Other",
    "Going Out",
    "Preparing Breakfast",
    "Having Breakfast",
    "Preparing Lunch",
    "Having Lunch",
    "Preparing Dinner",
    "Having Dinner",
    "Washing Dishes",
    "Having Snack",
    "Sleeping",
    "Watching TV",
    "Studying",
    "Having Shower",
    "Toileting",
    "Napping",
    "Using Internet",
    "Reading Book",
    "Laundry",
    "Shaving",
    "Brushing Teeth",
    "Talking on the Phone",
    "Listening to Music",
    "Cleaning",
    "Having Conversation",
    "Having Guest",
    "Changing Clothes",
)
"""The activities by number, from 1."""
RESIDENTS = ("1", "2")
_DAY_S = 86_400
_SECOND_US = micros(timedelta(seconds=1))


def read_aras(
    path: Path,
    *,
    id: str | None = None,  # noqa: A002 - the name of the key
    sort: bool = False,
    zone: Zone | None = None,  # noqa: ARG001 - its days have no dates
) -> ActivityLog:
    """Read the activities of a resident: of a day, or of a folder of days in the order of numbers.

    Sensors are those of both residents, so each activity stands for the room that it is done in:
    labels are activities.

    Args:
        path: A file DAY_1.txt, or the folder.
        id: The resident, "1" or "2".
        sort: Without effect: seconds are in order.
        zone: Without effect: days have no dates.

    Raises:
        LogError: A line is damaged, a day is longer than one, or the resident isn't named.
    """
    if id not in RESIDENTS:
        raise LogError(f'{path}: two people live there: choose one by id: "1" or id: "2"')
    files = sorted(path.glob("*.txt"), key=_number) if path.is_dir() else [path]
    readings: list[Reading] = []
    for day, file in enumerate(files):
        readings += _day(file, day, RESIDENTS.index(id))
    readings, notes = in_order(readings, path, sort=sort)
    return ActivityLog(path, "aras", None, tuple(readings), tuple(notes))


def _number(path: Path) -> tuple[int, str]:
    digits = re.search(r"\d+", path.stem)
    return (int(digits[0]) if digits else 0, path.name)


def _day(path: Path, day: int, resident: int) -> list[Reading]:
    codes: list[int] = []
    for number, text in log_lines(path):
        code = int(text.split()[20 + resident]) if LINE.fullmatch(text) else 0
        if not 1 <= code <= len(ACTIVITIES):
            raise LogError(
                f"{path}, line {number}: expected 20 sensors, 0 or 1, and two activities from 1 to"
                f" {len(ACTIVITIES)}, got {one_line(text)!r}"
            )
        codes.append(code)
    if len(codes) > _DAY_S:
        raise LogError(f"{path}: {len(codes)} lines; a day has {_DAY_S} seconds")
    readings = []
    begin = 0
    for code, run in groupby(codes):
        end = begin + len(list(run))
        name = ACTIVITIES[code - 1]
        room = AWAY if is_leaving(name) else name
        midnight_us = day * DAY_US
        begin_us = midnight_us + begin * _SECOND_US
        end_us = midnight_us + end * _SECOND_US
        readings.append(Reading(begin_us, end_us, room, name, begin + 1))
        begin = end
    return readings
