"""Times of logs: text, timestamps and numbers since 1970 as local times, in order."""

from datetime import UTC, date, datetime, timedelta
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple, Self
from zoneinfo import ZoneInfo, available_timezones

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from fleet2d.bounds import LOG_DAYS, one_line
from fleet2d.configuration.problems import did_you_mean
from fleet2d.configuration.units import micros
from fleet2d.errors import errors_as
from fleet2d.kernels import F64, I64, Bool
from fleet2d.logs.log import DAY_AND_MONTH, LogError, parse_time
from fleet2d.runtime.clock import DAY_US
from fleet2d.runtime.local_time import EPOCH, Zone
from fleet2d.storage.bags import LATEST_SIMULATED_NS

# A longer step forward is one of the clock, or a log of two stays [us].
JUMP_US = 7 * DAY_US
# Lines that are earlier by less are in no other hour: two sensors were written down late [us].
JITTER_US = 60_000_000
EARLIEST_US = -2_208_988_800_000_000
LATEST_US = 7_258_118_400_000_000
"""The years 1900 and 2200 [us since 1970]."""

# The largest number of nanoseconds since 1970 that is a time.
MAX_TIMESTAMP_NS = 8e18
QUARTER_HOUR_US = 900_000_000
SINCE_1970_S = 1e8
# Spreadsheets count days since this one; of 2000 to 2099 in such numbers.
SPREADSHEET_EPOCH = datetime(1899, 12, 30)
SPREADSHEET_DAYS = (36526, 73051)
# A log of days lasts so long at most; one of seconds that is as short begins at 0, as a rule.
SPREADSHEET_SPAN = 400
"""Fewer seconds count from the beginning of the log."""


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
        time_zone: Zone | str | None,
        sort: bool,
        are_states: bool = False,
    ) -> "LocalTimes":
        """Return the usable rows of the file in order of their local times.

        Args:
            path: The file.
            noun: What its rows are called in notes, in the plural.
            usable: Whether each row counts, bool (n,).
            notes: Gets a line for each kind of anomaly.
            time_zone: The time zone of the home; by its name, days have 24 hours.
            sort: Put rows in order of time instead of refusing times that run backwards.
            are_states: Whether each row holds until the next. Where a day has 24 hours, those of
                an hour that is repeated then come at its end, instead of being left out.

        Raises:
            LogError: There is no row, times run backwards or are out of range, or a time zone is
                missing or unknown.
        """
        time_us, line, has_date, has_zone = self
        if not len(time_us):
            raise LogError(f"{path} holds no position")
        _check_times(time_us, path, line, has_date=has_date)
        if isinstance(time_zone, Zone) and has_date:
            return self._by_clock(path, noun, usable, notes, time_zone, sort=sort)
        repeated = np.zeros(len(time_us), bool)
        if has_zone:
            if time_zone is None:
                raise LogError(
                    f"{path}: its times are of a time zone; say which local time the home has by"
                    " time_zone, like 'Europe/Berlin' or 'UTC', or by simulation.time_zone"
                )
            time_us, repeated = _in_zone(time_us, str(time_zone), at_end=are_states)
        twice = np.count_nonzero(repeated & usable)
        if twice:
            fate = "count at its end" if are_states else "were left out"
            notes.append(
                f"{twice} {noun} of the hour that the end of summer time"
                f" repeats {fate}: a simulated day has 24 hours"
            )
        if are_states:
            repeated[:] = False
        row = np.flatnonzero(usable & ~repeated)
        if not len(row):
            raise LogError(f"{path} has no row with a position")
        # Also of rows that don't count: parts of one file begin with the same day.
        first_day = int(time_us.min()) // DAY_US
        time_us, row, order_notes = _in_order(time_us[row], row, path, line, sort=sort)
        notes.extend([*order_notes, *_jumps(time_us, line[row])])
        if not has_date:
            return LocalTimes(time_us, row, None)
        since_us = time_us - first_day * DAY_US
        return LocalTimes(since_us, row, date(1970, 1, 1) + timedelta(days=first_day))

    def _by_clock(
        self, path: Path, noun: str, usable: Bool, notes: list[str], zone: Zone, *, sort: bool
    ) -> "LocalTimes":
        """Return the same by the clock of the home, which may be changed: in real time."""
        first_us = int(self.time_us.min())
        last_us = int(self.time_us.max())
        with errors_as(LogError, f"{path}: there are no rules of the time zone", of=KeyError):
            zone = zone.over(first_us, last_us)
        row = np.flatnonzero(usable)
        if not len(row):
            raise LogError(f"{path} has no row with a position")
        utc_us = self.time_us if self.has_zone else zone.moments(self.time_us)
        first_day = int(zone.readings(utc_us).min()) // DAY_US
        if self.has_zone:
            utc_us = utc_us[row]
        else:  # only what counts: other rows may be in another order
            utc_us = moments_in_file(self.time_us[row], zone, noun, notes)
        utc_us, row, order_notes = _in_order(utc_us, row, path, self.line, sort=sort)
        notes.extend([*order_notes, *_jumps(utc_us, self.line[row])])
        since_us = utc_us - zone.utc_us(first_day * DAY_US)
        return LocalTimes(since_us, row, date(1970, 1, 1) + timedelta(days=first_day))


class LocalTimes(NamedTuple):
    """The usable rows of a file in the local time of the home, in order.

    Attributes:
        time_us: Times since the midnight that begins the first day, int64 (m,) [us]: what a clock
            reads that is never changed, or real time if the scenario has a time zone.
        row: Which row of the file each is, from 0, int64 (m,).
        first_day: The date of the first day; None where the log has no dates.
    """

    time_us: I64
    row: I64
    first_day: date | None


def moments_in_file(readings_us: I64, zone: Zone, noun: str, notes: list[str]) -> I64:
    """Return the moments of readings of a clock, in the order of a file.

    Within an hour that the clock reads twice, the second time begins where readings run backwards,
    by more than a clock that jitters.

    Args:
        readings_us: What the clock read, without offset [us since 1970], int64 (n,).
        zone: The clock.
        noun: What they are called in notes, in the plural.
        notes: Gets a line if the first and the second time can't be told apart.

    Returns:
        Moments [us since 1970 UTC], int64 (n,).
    """
    utc_us = zone.moments(readings_us)
    for change_us, before_us, after_us in zip(
        zone.changes_us, zone.offsets_us, zone.offsets_us[1:], strict=False
    ):
        is_twice = (utc_us >= change_us - (before_us - after_us)) & (utc_us < change_us)
        rows = np.flatnonzero(is_twice)
        back_us = np.maximum.accumulate(readings_us[rows]) - readings_us[rows]
        runs_back = back_us > JITTER_US
        second = rows[np.logical_or.accumulate(runs_back)]
        utc_us[second] += before_us - after_us
        if len(rows) and not len(second):
            hour = EPOCH + timedelta(microseconds=change_us + after_us)
            notes.append(
                f"{len(rows)} {noun} of {hour:%Y-%m-%d %H:%M} on, which the clock reads twice,"
                " count as of the first time: they have no offset, and never run backwards"
            )
    return utc_us


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
            " the log, or put its lines in order by 'sort: true' (as an option, --sort)"
        )
    order = np.argsort(time_us, kind="stable")
    note = f"{len(back)} lines ran backwards in time and were sorted in"
    return time_us[order], row[order], [note]


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
    at = line[int(steps.argmax()) + 1]
    count = np.count_nonzero(steps >= JUMP_US)
    such = f" ({count} such lines)" if count > 1 else ""
    return [f"line {at}: the time jumps forward by {largest / DAY_US:.1f} days there{such}"]


def parse_texts(
    texts: pa.Array, path: Path, line: I64, *, is_utc: bool, day_first: bool | None
) -> Stamps:
    """Return the stamps of dates in text, all of them with a time zone or none.

    Args:
        texts: The texts.
        path: The file that they are from.
        line: The line of each, int64 (n,).
        is_utc: Whether times without a zone are UTC.
        day_first: Whether 03/04/2026 is in April; None: the file has to show it.

    Raises:
        LogError: One is not a time, or the order of day and month is unknown.
    """
    for kind in (pa.timestamp("us"), pa.timestamp("us", "UTC")):
        try:
            values = pc.cast(pc.cast(texts, kind), pa.int64()).to_numpy()
        except pa.ArrowException:
            continue
        return Stamps(values, line, True, is_utc or kind.tz is not None)
    if day_first is None:
        day_first = _shown_order(texts, path, line)
    epoch = datetime(1970, 1, 1)
    moments = []
    for at, text in zip(line.tolist(), texts.to_pylist(), strict=True):
        moments.append(parse_time(text, path, at, day_first=day_first))
    zones = {moment.tzinfo is not None for moment in moments}
    if len(zones) > 1:
        raise LogError(f"{path}: some of its times have a time zone and some have none")
    local = (m.astimezone(UTC).replace(tzinfo=None) if m.tzinfo else m for m in moments)
    time_us = np.array([micros(moment - epoch) for moment in local], np.int64)
    return Stamps(time_us, line, True, is_utc or zones == {True})


def _shown_order(texts: pa.Array, path: Path, line: I64) -> bool | None:
    """Return whether days come before months in dates like 13/04/2026; None: there are none.

    Raises:
        LogError: Every date could be read either way, or they contradict each other.
    """
    matches = [DAY_AND_MONTH.match(text) for text in texts.to_pylist()]
    pairs = [(int(match[1]), int(match[2])) for match in matches if match]
    orders = {first > 12 for first, second in pairs if max(first, second) > 12}
    if len(orders) == 1 or not pairs:
        return next(iter(orders), None)
    number = next(number for number, match in enumerate(matches) if match)
    why = f"{one_line(texts[number].as_py())!r} may begin with the day or the month"
    if orders:
        why = "some of the dates begin with the day, some with the month"
    raise LogError(
        f"{path}, line {line[number]}: {why}: write dates like 2026-04-03, or say which by"
        " 'day_first: true' or false"
    )


def parse_numbers(
    numbers: NDArray[Any], path: Path, line: I64, unit_s: float | None = None
) -> Stamps:
    """Return the stamps of numbers: since 1970, or the beginning of the log.

    Args:
        numbers: The numbers.
        path: The file that they are from.
        line: The line of each, int64 (n,).
        unit_s: Their unit [s]; None: recognized by their size.

    Raises:
        LogError: One is not a number, or out of range.
    """
    size = np.abs(numbers.astype(np.float64))
    wrong = np.flatnonzero(~(size < MAX_TIMESTAMP_NS))
    if len(wrong):
        raise LogError(f"{path}, line {line[wrong[0]]}: its time is not a number, or out of range")
    largest = float(size.max(initial=0))
    if unit_s is None:
        _check_days(size, path, line)
        unit_s = next((unit for unit in (1e-9, 1e-6, 1e-3) if largest * unit >= SINCE_1970_S), 1.0)
    has_date = largest * unit_s >= SINCE_1970_S
    if unit_s < 1e-6:
        return Stamps((numbers // round(1e-6 / unit_s)).astype(np.int64), line, has_date, has_date)
    time_us = np.round(numbers * round(unit_s * 1e6)).astype(np.int64)
    return Stamps(time_us, line, has_date, has_date)


def _check_days(numbers: F64, path: Path, line: I64) -> None:
    """Refuse numbers that may be days of a spreadsheet as well as seconds.

    Raises:
        LogError: They are fractions in the range of such days, and of less than 400 days.
    """
    if not len(numbers):
        return
    least, end = SPREADSHEET_DAYS
    first = float(numbers.min())
    last = float(numbers.max())
    is_whole = not (numbers % 1).any()
    if least <= first and last < end and last - first < SPREADSHEET_SPAN and not is_whole:
        date = SPREADSHEET_EPOCH + timedelta(minutes=round(first * 1440))
        raise LogError(
            f"{path}, line {line[numbers.argmin()]}: the time {first:.10g} may be days of a"
            f" spreadsheet, {date:%Y-%m-%d %H:%M}: write times as text, or name the column time_s"
            " if these are seconds"
        )


def _in_zone(utc_us: I64, name: str, *, at_end: bool) -> tuple[I64, Bool]:
    """Return the local times of a zone [us], and which of them are in a repeated hour.

    With `at_end` times of a repeated hour are its end.
    """
    try:
        zone = ZoneInfo(name)
    except (KeyError, ValueError, OSError):
        hint = did_you_mean(name, available_timezones())
        raise LogError(f"there is no time zone {name!r}{hint}") from None

    def moment(quarter: int) -> datetime:
        us = timedelta(microseconds=quarter * QUARTER_HOUR_US)
        return (datetime(1970, 1, 1, tzinfo=UTC) + us).astimezone(zone)

    # Clocks change at whole quarters of an hour.
    quarters, inverse = np.unique(utc_us // QUARTER_HOUR_US, return_inverse=True)
    moments = [moment(quarter) for quarter in quarters.tolist()]
    offsets = [micros(m.utcoffset() or timedelta(0)) for m in moments]
    is_repeated = np.array([m.fold for m in moments], bool)[inverse]
    if at_end:
        ends = [
            next(q for q in count(quarter) if not moment(q).fold) for quarter in quarters.tolist()
        ]
        utc_us = np.where(is_repeated, np.array(ends)[inverse] * QUARTER_HOUR_US, utc_us)
    return utc_us + np.array(offsets, np.int64)[inverse], is_repeated
