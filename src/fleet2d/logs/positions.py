"""Position fixes of a real-time location system: a table with time, id, x, y and heading."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from fleet2d.kernels import F64, Bool
from fleet2d.logs.log import LogError, PositionLog
from fleet2d.logs.tables import LogTable
from fleet2d.logs.times import LocalTimes, Stamps
from fleet2d.runtime.local_time import Zone


def read_positions(
    path: Path,
    *,
    id: str | None = None,  # noqa: A002 - the name of the column
    columns: Mapping[str, str] | None = None,
    time_zone: Zone | str | None = None,
    sort: bool = False,
    decimal_comma: bool | None = None,
    day_first: bool | None = None,
) -> PositionLog:
    """Read the fixes of one tag.

    Times are text, timestamps, or numbers: of s, ms, us or ns since 1970, which is recognized by
    their size, or of seconds since the beginning of the log if they are below 10⁸. Times with a
    time zone are converted to the local time of `time_zone`. Headings are in radians. The name of a
    column may tell another unit, as in time_ms, x [mm] and heading_deg.

    Args:
        path: The file: .csv, .tsv, .parquet or .jsonl.
        id: The tag to read, if the file holds several.
        columns: Names of its columns that are not in `tables.NAMES`: {"x": "east"}.
        time_zone: The time zone of the home, like "Europe/Berlin"; needed if the log's times have a
            zone or are numbers since 1970.
        sort: Put fixes in order of time instead of refusing times that run backwards.
        decimal_comma: Whether numbers have a comma as decimal mark; None: shown by the file.
        day_first: Whether 03/04/2026 is in April; None: shown by the file.

    Raises:
        LogError: A column or the tag is missing, a value is not a number, or times run backwards.
    """
    table = LogTable.read(path, columns or {}, decimal_comma=decimal_comma, day_first=day_first)
    fixes = RawFixes.of(table, _of_tag(table, id))
    return localize(path, "positions", fixes, time_zone=time_zone, sort=sort)


class RawFixes(NamedTuple):
    """Fixes as a file has them.

    Attributes:
        stamps: Their times.
        x: float64 (n,), NaN where there is none.
        y: float64 (n,), NaN where there is none.
        heading: float64 (n,) [rad], NaN where there is none.
        notes: Anomalies in the file.
        unit_m: The unit of x and y [m]; None: the file doesn't say.
        chosen: Which of them count, bool (n,); None: all.
    """

    stamps: Stamps
    x: F64
    y: F64
    heading: F64
    notes: list[str]
    unit_m: float | None = None
    chosen: Bool | None = None

    @classmethod
    def of(cls, table: LogTable, chosen: Bool | None = None) -> Self:
        """Return the fixes of a table; `chosen` are those that count, bool (n,)."""
        x = table.numbers("x")
        y = table.numbers("y")
        unit = table.unit("x")
        notes = [] if unit is None else [f"positions are in {unit}, as the names of columns say"]
        if chosen is not None and not chosen.all():
            notes.append(f"{np.count_nonzero(~chosen)} fixes of other ids were left out")
        return cls(table.stamps(), x, y, table.headings(), notes, table.unit_m, chosen)

    def local(
        self, path: Path, noun: str, *, time_zone: Zone | str | None, sort: bool
    ) -> LocalTimes:
        """Return the local times of those with a position; see `Stamps.local`."""
        chosen = self.chosen
        is_placed = np.isfinite(self.x) & np.isfinite(self.y)
        if chosen is None:
            chosen = np.ones(len(is_placed), bool)
        without = np.count_nonzero(chosen & ~is_placed)
        if without:
            self.notes.append(f"{without} {noun} without a position were left out")
        usable = chosen & is_placed
        notes = self.notes
        return self.stamps.local(path, noun, usable, notes, time_zone=time_zone, sort=sort)


def localize(
    path: Path, layout: str, fixes: RawFixes, *, time_zone: Zone | str | None, sort: bool
) -> PositionLog:
    """Return fixes as a log in the local time of the home.

    Args:
        path: The file that they are from.
        layout: The layout of the file.
        fixes: The fixes.
        time_zone: The time zone of the home.
        sort: Put fixes in order of time instead of refusing times that run backwards.

    Raises:
        LogError: There is no fix, times run backwards or are out of range, or a time zone is
            missing or unknown.
    """
    _, x, y, heading, notes, unit_m, _ = fixes
    time_us, row, first_day = fixes.local(path, "fixes", time_zone=time_zone, sort=sort)
    last = np.append(np.diff(time_us) > 0, True)
    if not last.all():
        notes.append(f"of {np.count_nonzero(~last)} fixes at equal times the last counts")
        time_us = time_us[last]
        row = row[last]
    xy = np.stack([x, y], 1)[row]
    columns = (first_day, time_us, xy, heading[row], tuple(notes))
    return PositionLog(path, layout, *columns, unit_m=unit_m)


def _of_tag(table: LogTable, tag: str | None) -> Bool | None:
    """Return which rows are of one tag; None: all."""
    if not table.rows.num_rows:
        raise LogError(f"{table.path} holds no position")
    if "id" in table.named:
        return table.rows_of("id", tag)
    if tag is not None:
        raise LogError(f"{table.path} has no column of ids: leave out 'id', or name it by columns")
    return None
