"""Readings of a home whose clocks change, in real time."""

from datetime import date, datetime
from pathlib import Path

import numpy as np

from fleet2d.errors import errors_as
from fleet2d.logs.log import LogError, Reading, in_order
from fleet2d.logs.times import moments_in_file
from fleet2d.runtime.local_time import Zone, wall_us


def placed_in_order(
    readings: list[Reading], first_day: date | None, zone: Zone | None, path: Path, *, sort: bool
) -> tuple[list[Reading], list[str]]:
    """Return readings by the clock of the home, in the order in which they begin, and notes.

    See `by_clock` and `in_order` for the arguments and for what is raised.
    """
    placed, clock_notes = by_clock(readings, first_day, zone, path)
    ordered, order_notes = in_order(placed, path, sort=sort)
    return ordered, clock_notes + order_notes


def by_clock(
    readings: list[Reading], first_day: date | None, zone: Zone | None, path: Path
) -> tuple[list[Reading], list[str]]:
    """Return readings in real time since their first midnight, and notes.

    Args:
        readings: Readings in local time without offset, in the order of the file.
        first_day: The date of the first.
        zone: The clock of the home; None: its days have 24 hours.
        path: The file.
    """
    if zone is None or first_day is None or not readings:
        return readings, []
    midnight_us = wall_us(datetime.combine(first_day, datetime.min.time()))
    times = np.array([(r.begin_us, r.end_us) for r in readings], np.int64) + midnight_us
    with errors_as(LogError, f"{path}: there are no rules of the time zone", of=KeyError):
        zone = zone.over(int(times.min()), int(times.max()))
    notes: list[str] = []
    begins_us = moments_in_file(times[:, 0], zone, "readings", notes)
    ends_us = begins_us + zone.moments(times[:, 1]) - zone.moments(times[:, 0])
    since_us = zone.utc_us(midnight_us)
    moments = zip((begins_us - since_us).tolist(), (ends_us - since_us).tolist(), strict=True)
    placed = [
        reading._replace(begin_us=begin, end_us=end)
        for reading, (begin, end) in zip(readings, moments, strict=True)
    ]
    return placed, notes
