"""Position fixes of a real-time location system: CSV or Parquet with time, id, x, y and heading."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any, NamedTuple, Self
from zoneinfo import ZoneInfo, available_timezones

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from fleet2d.bounds import (
    FIXES,
    LOG_BYTES,
    LOG_DAYS,
    TABLE_BYTES,
    check_file,
    one_line,
    unpacked_bytes,
)
from fleet2d.configuration.problems import did_you_mean
from fleet2d.configuration.units import micros
from fleet2d.kernels import F64, I64, Bool
from fleet2d.logs.log import LogError, PositionLog, parse_time
from fleet2d.runtime.clock import DAY_US
from fleet2d.storage.bags import LATEST_SIMULATED_NS

NAMES = {
    "time": ("time", "timestamp", "t", "datetime", "time_s"),
    "id": ("id", "tag", "tag_id", "name", "entity"),
    "x": ("x", "x_m", "pos_x", "position_x"),
    "y": ("y", "y_m", "pos_y", "position_y"),
    "heading": ("heading", "heading_deg", "theta", "yaw"),
}
"""The names that a column may have, if the user gives none."""

# A longer step forward is one of the clock, or a log of two stays [us].
JUMP_US = 7 * DAY_US
EARLIEST_US, LATEST_US = -2_208_988_800_000_000, 7_258_118_400_000_000
"""The years 1900 and 2200 [us since 1970]."""

MAX_TIMESTAMP_NS = 8e18  # of nanoseconds since 1970
QUARTER_HOUR_US = 900_000_000


def read_positions(
    path: Path,
    *,
    id: str | None = None,  # noqa: A002 - the name of the column
    columns: Mapping[str, str] | None = None,
    time_zone: str | None = None,
    sort: bool = False,
) -> PositionLog:
    """Read the fixes of one tag.

    Times are text, timestamps, or numbers: of s, ms, us or ns since 1970, which is recognized by
    their size, or of seconds since the beginning of the log if they are below 10⁸. Times with a
    time zone are converted to the local time of `time_zone`. Headings are in radians, or in degrees
    if the name of their column ends in _deg.

    Args:
        path: The file, .csv or .parquet.
        id: The tag to read, if the file holds several.
        columns: Names of its columns that are not in `NAMES`: {"x": "east"}.
        time_zone: The time zone of the home, like "Europe/Berlin"; needed if the log's times have a
            zone or are numbers since 1970.
        sort: Put fixes in order of time instead of refusing times that run backwards.

    Raises:
        LogError: A column or the tag is missing, a value is not a number, or times run backwards.
    """
    table, notes = _of_tag(LogTable.read(path, columns or {}), id)
    return localize(path, "positions", table.fixes(notes), time_zone=time_zone, sort=sort)


class RawFixes(NamedTuple):
    """Fixes as a file has them.

    Attributes:
        stamps: Their times.
        x: float64 (n,), NaN where there is none.
        y: float64 (n,), NaN where there is none.
        heading: float64 (n,) [rad], NaN where there is none.
        notes: Anomalies in the file.
    """

    stamps: "Stamps"
    x: F64
    y: F64
    heading: F64
    notes: list[str]

    def local(self, path: Path, noun: str, *, time_zone: str | None, sort: bool) -> "LocalTimes":
        """Return the local times of those with a position; see `Stamps.local`."""
        usable, notes = np.isfinite(self.x) & np.isfinite(self.y), self.notes
        return self.stamps.local(path, noun, usable, notes, time_zone=time_zone, sort=sort)


def _in_order(
    time_us: I64, row: I64, path: Path, line: I64, *, sort: bool
) -> tuple[I64, I64, list[str]]:
    """Return times and rows in order of time, and a note if that differs from the file's."""
    back = np.flatnonzero(np.diff(time_us) < 0)
    if not len(back):
        return time_us, row, []
    if not sort:
        raise LogError(
            f"{path}, line {line[row[back[0] + 1]]}: the time runs backwards there ({len(back)}"
            f" such lines, by up to {float(-np.diff(time_us).min()) / 1e6:g} s); check the clock of"
            " the log, or put its lines in order by 'sort: true'"
        )
    order = np.argsort(time_us, kind="stable")
    note = f"{len(back)} lines ran backwards in time and were sorted in"
    return time_us[order], row[order], [note]


def localize(
    path: Path, layout: str, fixes: RawFixes, *, time_zone: str | None, sort: bool
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
    _, x, y, heading, notes = fixes
    time_us, row, first_day = fixes.local(path, "fixes", time_zone=time_zone, sort=sort)
    last = np.append(np.diff(time_us) > 0, True)
    if not last.all():
        notes.append(f"of {np.count_nonzero(~last)} fixes at equal times the last counts")
        time_us, row = time_us[last], row[last]
    xy = np.stack([x, y], 1)[row]
    return PositionLog(path, layout, first_day, time_us, xy, heading[row], tuple(notes))


class Stamps(NamedTuple):
    """The times in a file.

    Attributes:
        time_us: Times [us since 1970], or since the beginning of the log, int64 (n,).
        line: The number of each line or message in the file, int64 (n,).
        has_date: Whether times count from 1970; else from the beginning of the log.
        has_zone: Whether times are UTC, and become times of the home's zone.
    """

    time_us: I64
    line: I64
    has_date: bool
    has_zone: bool

    @classmethod
    def of_messages(cls, time_ns: I64) -> Self:
        """Return the stamps of the messages of a bag [ns]; a simulated clock has no date."""
        has_date = bool(len(time_ns)) and int(time_ns.max()) >= LATEST_SIMULATED_NS
        begin_ns = 0 if has_date or not len(time_ns) else time_ns.min()
        line = np.arange(1, len(time_ns) + 1)
        return cls((time_ns - begin_ns) // 1000, line, has_date, has_date)

    def local(
        self,
        path: Path,
        noun: str,
        usable: Bool,
        notes: list[str],
        *,
        time_zone: str | None,
        sort: bool,
    ) -> "LocalTimes":
        """Return the usable rows of the file in order of their local times.

        Args:
            path: The file.
            noun: What its rows are called in notes, in the plural.
            usable: Whether each row has a position, bool (n,).
            notes: Gets a line for each kind of anomaly.
            time_zone: The time zone of the home.
            sort: Put rows in order of time instead of refusing times that run backwards.

        Raises:
            LogError: There is no row, times run backwards or are out of range, or a time zone is
                missing or unknown.
        """
        time_us, line, has_date, has_zone = self
        if not len(time_us):
            raise LogError(f"{path} holds no position")
        _check_times(time_us, path, line, has_date=has_date)
        repeated = np.zeros(len(time_us), bool)
        if has_zone:
            if time_zone is None:
                raise LogError(
                    f"{path}: its times are of a time zone; say which local time the home has by"
                    " time_zone, like 'Europe/Berlin' or 'UTC'"
                )
            time_us, repeated = _in_zone(time_us, time_zone)
        if not usable.all():
            notes.append(f"{np.count_nonzero(~usable)} {noun} without a position were left out")
        if repeated.any():
            notes.append(
                f"{np.count_nonzero(repeated)} {noun} of the hour that the end of summer time"
                " repeats were left out: a simulated day has 24 hours"
            )
        row = np.flatnonzero(usable & ~repeated)
        if not len(row):
            raise LogError(f"{path} has no row with a position")
        time_us, row, order_notes = _in_order(time_us[row], row, path, line, sort=sort)
        notes.extend([*order_notes, *_jumps(time_us, line[row])])
        if not has_date:
            return LocalTimes(time_us, row, None)
        first_day = int(time_us[0]) // DAY_US
        since_us = time_us - first_day * DAY_US
        return LocalTimes(since_us, row, date(1970, 1, 1) + timedelta(days=first_day))


class LocalTimes(NamedTuple):
    """The usable rows of a file in the local time of the home, in order.

    Attributes:
        time_us: Local times since the midnight that begins the first day, int64 (m,) [us].
        row: Which row of the file each is, from 0, int64 (m,).
        first_day: The date of the first day; None where the log has no dates.
    """

    time_us: I64
    row: I64
    first_day: date | None


def read_table(path: Path) -> pa.Table:
    """Read a CSV, Parquet or JSON Lines file within its bounds.

    Raises:
        LogError: It can't be read, or is beyond a bound.
    """
    try:
        check_file(path, LOG_BYTES, LogError)
        if path.suffix.lower() in (".parquet", ".pq"):
            with pq.ParquetFile(path) as file:
                FIXES.check(file.metadata.num_rows, path, LogError)
                TABLE_BYTES.check(unpacked_bytes(file), path, LogError, prefix="about ")
                table = file.read()
        elif path.suffix.lower() in (".jsonl", ".ndjson"):
            import pyarrow.json as pajson

            table = pajson.read_json(path)
        else:
            table = pacsv.read_csv(path)
        FIXES.check(table.num_rows, path, LogError)
        _ = table.column_names
    except UnicodeDecodeError:
        raise LogError(f"{path}, line 1: the column names are not text in UTF-8") from None
    except (pa.ArrowException, OSError) as error:
        raise LogError(f"{path} can't be read: {one_line(error, 200)}") from error
    return table


@dataclass(frozen=True)
class LogTable:
    """A table of a log.

    Attributes:
        path: Its file.
        rows: Its rows.
        named: The name of the column of each quantity, such as time or x.
        line: The line of each row in the file, int64 (n,).
    """

    path: Path
    rows: pa.Table
    named: Mapping[str, str]
    line: I64

    @classmethod
    def read(
        cls,
        path: Path,
        columns: Mapping[str, str],
        usual: Mapping[str, Sequence[str]] = NAMES,
        needed: Sequence[str] = ("time", "x", "y"),
    ) -> Self:
        """Read a file.

        Args:
            path: The file.
            columns: The names of columns that the user gives.
            usual: The names that the column of each quantity may have besides.
            needed: The quantities without which it can't be read.

        Raises:
            LogError: It can't be read, a quantity is unknown, or one that is needed has no column.
        """
        rows, named = read_table(path), dict(columns)
        for quantity, name in named.items():
            if quantity not in usual:
                known = ", ".join(usual)
                raise LogError(f"columns: unknown key {quantity!r}; allowed here: {known}")
            if name not in rows.column_names:
                near = did_you_mean(name, rows.column_names)
                raise LogError(f"{path} has no column {name!r}{near}")
        lower = {name.strip().lower(): name for name in reversed(rows.column_names)}
        for quantity, names in usual.items():
            column = next((lower[name] for name in names if name in lower), None)
            if quantity not in named and column is not None:
                named[quantity] = column
            if quantity not in named and quantity in needed:
                raise LogError(
                    f"{path} has no column {quantity!r}; it has: {', '.join(rows.column_names)}."
                    f" Say which it is by columns: {{{quantity}: …}}"
                )
        line = np.arange(rows.num_rows) + (2 if path.suffix.lower() == ".csv" else 1)
        return cls(path, rows, named, line)

    def column(self, quantity: str) -> pa.ChunkedArray:
        """Return the column of a quantity."""
        return self.rows[self.named[quantity]]

    def texts(self, quantity: str) -> pa.ChunkedArray:
        """Return the column of a quantity as texts."""
        return pc.cast(self.column(quantity), pa.string())

    def numbers(self, quantity: str) -> F64:
        """Return a column of numbers, float64 (n,); NaN where it is empty."""
        column = self.column(quantity)
        if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
            for at, text in zip(self.line.tolist(), column.to_pylist(), strict=True):
                try:
                    float(text or "nan")
                except ValueError:
                    raise LogError(
                        f"{self.path}, line {at}: expected a number in column"
                        f" {self.named[quantity]!r}, got {one_line(text)!r}"
                    ) from None
            column = pc.cast(pc.if_else(pc.equal(column, ""), "nan", column), pa.float64())
        try:
            numbers = pc.fill_null(pc.cast(column, pa.float64()), float("nan"))
        except pa.ArrowException:
            raise LogError(
                f"{self.path}: column {self.named[quantity]!r} holds {column.type}, not numbers"
            ) from None
        return numbers.to_numpy().astype(np.float64)

    def headings(self) -> F64:
        """Return the headings [rad], float64 (n,); NaN where there is none."""
        if "heading" not in self.named:
            return np.full(len(self.line), np.nan)
        heading = self.numbers("heading")
        return heading / 180 * np.pi if self.named["heading"].endswith("_deg") else heading

    def stamps(self) -> Stamps:
        """Return the times of the rows; those with a zone are UTC."""
        column, path, line = self.column("time"), self.path, self.line
        if column.null_count:
            is_empty = pc.is_null(column).combine_chunks().to_numpy(zero_copy_only=False)
            raise LogError(f"{path}, line {line[np.flatnonzero(is_empty)[0]]}: it has no time")
        kind: Any = column.type
        if pa.types.is_string(kind) or pa.types.is_large_string(kind):
            values, has_zone = _parse_texts(column.to_pylist(), path, line)
            return Stamps(values, line, True, has_zone)
        if pa.types.is_timestamp(kind):
            values = pc.cast(column, pa.timestamp("us", kind.tz), safe=False)
            time_us = pc.cast(values, pa.int64()).to_numpy()
            return Stamps(time_us, line, True, kind.tz is not None)
        if pa.types.is_integer(kind) or pa.types.is_floating(kind):
            values, has_date = _scale_numbers(column.to_numpy(), path, line)
            return Stamps(values, line, has_date, has_date)
        raise LogError(f"{path}: expected times as text, timestamps or numbers, got {kind}")

    def fixes(self, notes: Sequence[str] = ()) -> RawFixes:
        """Return the fixes of the rows."""
        x, y = self.numbers("x"), self.numbers("y")
        return RawFixes(self.stamps(), x, y, self.headings(), list(notes))

    def where(self, is_kept: Bool) -> Self:
        """Return the table with some of its rows: bool (n,)."""
        return replace(self, rows=self.rows.filter(pa.array(is_kept)), line=self.line[is_kept])

    def of(self, quantity: str, name: str | None) -> Self:
        """Return the rows of one of several names in a column; None: of the only one.

        Raises:
            LogError: There is no such name, or there are several.
        """
        texts = self.texts(quantity)
        known = sorted(str(text) for text in pc.unique(texts).to_pylist())
        listed = ", ".join(known[:10])
        if name is None and len(known) > 1:
            raise LogError(
                f"{self.path} holds {len(known)} {quantity}s: {listed}: select one by {quantity!r}"
            )
        if name is not None and name not in known:
            near = did_you_mean(name, known)
            raise LogError(f"{self.path} has no {quantity} {name!r}{near} There are: {listed}")
        if len(known) <= 1:
            return self
        is_named = pc.fill_null(pc.equal(texts, name), False).combine_chunks()
        return self.where(is_named.to_numpy(zero_copy_only=False))


def _of_tag(table: LogTable, tag: str | None) -> tuple[LogTable, list[str]]:
    """Return the rows of one tag, and notes."""
    if not table.rows.num_rows:
        raise LogError(f"{table.path} holds no position")
    if "id" not in table.named:
        if tag is not None:
            raise LogError(
                f"{table.path} has no column of ids: leave out 'id', or name it by columns"
            )
        return table, []
    of_tag = table.of("id", tag)
    others = len(table.line) - len(of_tag.line)
    return of_tag, [f"{others} fixes of other ids were left out"] if others else []


def _check_times(time_us: I64, path: Path, line: I64, *, has_date: bool) -> None:
    """Refuse times of another century, and logs beyond the bound on days."""
    first, end = (EARLIEST_US, LATEST_US) if has_date else (-LATEST_US, LATEST_US)
    wrong = np.flatnonzero((time_us < first) | (time_us >= end))
    if len(wrong):
        expected = "a time from 1900 to 2199" if has_date else "seconds since the log began"
        raise LogError(
            f"{path}, line {line[wrong[0]]}: the time is out of range ({len(wrong)} such lines):"
            f" expected {expected}"
        )
    days = int(time_us.max() - time_us.min()) // DAY_US + 1
    if (jumps := _jumps(time_us, line)) and days > LOG_DAYS.limit:
        advice = f"set {LOG_DAYS.variable}={days} in the environment"
        raise LogError(
            f"{path}, {jumps[0]}: leave out the lines of the clock that wasn't set, or {advice}"
        )
    LOG_DAYS.check(days, path, LogError)


def _jumps(time_us: I64, line: I64) -> list[str]:
    """Return a text about the largest step forward in time, if it is one of a clock."""
    steps = np.diff(time_us)
    if not len(steps) or (largest := int(steps.max())) < JUMP_US:
        return []
    at, count = line[int(steps.argmax()) + 1], np.count_nonzero(steps >= JUMP_US)
    such = f" ({count} such lines)" if count > 1 else ""
    return [f"line {at}: the time jumps forward by {largest / DAY_US:.1f} days there{such}"]


def _parse_texts(texts: list[str], path: Path, line: I64) -> tuple[I64, bool]:
    """Return times in text [us since 1970], and whether they have a zone (all or none)."""
    epoch = datetime(1970, 1, 1)
    values, zones = [], set()
    for at, text in zip(line.tolist(), texts, strict=True):
        try:
            moment = datetime.fromisoformat(text.strip())
        except ValueError:
            moment = parse_time(text, path, at)
        zones.add(moment.tzinfo is not None)
        if moment.tzinfo is not None:
            moment = moment.astimezone(UTC).replace(tzinfo=None)
        values.append(micros(moment - epoch))
    if len(zones) > 1:
        raise LogError(f"{path}: some of its times have a time zone and some have none")
    return np.array(values, np.int64), zones == {True}


def _scale_numbers(numbers: NDArray[Any], path: Path, line: I64) -> tuple[I64, bool]:
    """Return numeric times [us], and whether they count from 1970."""
    wrong = np.flatnonzero(~(np.abs(numbers.astype(np.float64)) < MAX_TIMESTAMP_NS))
    if len(wrong):
        raise LogError(f"{path}, line {line[wrong[0]]}: its time is not a number, or out of range")
    size = float(np.max(np.abs(numbers.astype(np.float64))))
    if size >= 1e17:
        return (numbers // 1000).astype(np.int64), True
    if size >= 1e14:
        return numbers.astype(np.int64), True
    scale = 1000 if size >= 1e11 else 1_000_000
    return np.round(numbers * scale).astype(np.int64), size >= 1e8


def _in_zone(utc_us: I64, name: str) -> tuple[I64, Bool]:
    """Return the local times of a zone [us], and which of them are in a repeated hour."""
    try:
        zone = ZoneInfo(name)
    except (KeyError, ValueError, OSError):
        hint = did_you_mean(name, available_timezones())
        raise LogError(f"there is no time zone {name!r}{hint}") from None
    # Clocks change at whole quarters of an hour.
    quarters, inverse = np.unique(utc_us // QUARTER_HOUR_US, return_inverse=True)
    epoch = datetime(1970, 1, 1, tzinfo=UTC)
    moments = [
        (epoch + timedelta(microseconds=int(q) * QUARTER_HOUR_US)).astimezone(zone)
        for q in quarters
    ]
    offsets = [micros(m.utcoffset() or timedelta(0)) for m in moments]
    folds = np.array([m.fold for m in moments], bool)
    return utc_us + np.array(offsets, np.int64)[inverse], folds[inverse]
