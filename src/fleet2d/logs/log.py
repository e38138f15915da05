"""Logs of people in one form for all layouts: readings of rooms, or position fixes."""

import codecs
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime, timedelta, timezone
from io import TextIOWrapper
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self, TypeVar, cast

import numpy as np
from pydantic import Field

from fleet2d.bounds import LOG_BYTES, LOG_DAYS, LOG_ROWS, check_file, one_line
from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import counted
from fleet2d.configuration.units import micros
from fleet2d.errors import InputError, errors_as, os_errors_as
from fleet2d.inputs import open_input
from fleet2d.kernels import F64, I64
from fleet2d.runtime.clock import DAY, DAY_US, Clock, midnight_of
from fleet2d.runtime.local_time import Zone, at_reading, wall_us
from fleet2d.storage.bags import is_bag

# Maximum number of lines that a note lists.
_MAX_NAMED = 20
# Maximum number of characters in a line of a log.
_LONGEST = 10_000
AWAY = "away"
"""The room label for being out of the home."""
_DATE = r"(?:(\d{4})([-./])(\d{1,2})\2(\d{1,2})|(\d{1,2})([-./])(\d{1,2})\6(\d{4}))"
_CLOCK = r"(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,](\d{1,9}))?)?(?:\s?([AP])\.?M\.?)?"
_ZONE = r"(?:\s?(Z|UTC|GMT|[+-]\d{2}(?::?\d{2})?))?"
_TIME = re.compile(rf"{_DATE}(?:,?\s+|T){_CLOCK}{_ZONE}", re.IGNORECASE)
DAY_AND_MONTH = re.compile(r"\s*(\d{1,2})[-/](\d{1,2})[-/]\d{4}")
"""The beginning of a date whose order of day and month a reader can't know."""


def files_of(path: Path) -> tuple[Path, ...]:
    """Return the files of a log: itself, or those in the folder of a bag or of a home's logs."""
    if not path.is_dir():
        return (path,)
    pattern = "*" if is_bag(path) else "*.txt"
    return tuple(sorted(file for file in path.glob(pattern) if file.is_file()))


def log_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the number and the stripped text of each line of a log that isn't blank.

    Raises:
        LogError: The file can't be read, is not a text file, or is beyond a bound.
    """
    with os_errors_as(LogError, f"{path} can't be read"):
        check_file(path, LOG_BYTES, LogError)
        most = LOG_ROWS.limit
        with TextIOWrapper(open_input(path, LogError), encoding_of(path), "replace") as lines:
            for number, text in enumerate(iter(lambda: lines.readline(_LONGEST), ""), 1):
                if number > most:
                    LOG_ROWS.check(number, path, LogError, prefix="more than ")
                if len(text) == _LONGEST:
                    raise LogError(
                        f"{path}, line {number}: it is longer than {_LONGEST} characters"
                    )
                if stripped := text.strip():
                    yield number, stripped


def encoding_of(path: Path) -> str:
    """Return the encoding of a text file by its byte order mark, without one UTF-8."""
    with path.open("rb") as file:
        begin = file.read(2)
    return "utf-16" if begin in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig"


class LogError(InputError):
    """A log is unreadable or contradicts itself; the message says where and what to do."""


class LogKeys(Settings):
    """The keys of what reads a log: how its columns, numbers and times are written.

    Attributes:
        columns: The names of its columns, as {x: east}.
        decimal_comma: Whether numbers of a table have a comma as decimal mark; left out: as the
            table shows.
        day_first: Whether 03/04/2026 is in April; left out: as other dates of the table show.
        time_zone: The time zone of the home, if times have one or count from 1970; left out where
            the scenario has `simulation.time_zone`.
        sort: Sort lines whose time runs backwards; else they are refused.
    """

    columns: dict[str, str] = Field(default={})
    decimal_comma: bool | None = None
    day_first: bool | None = None
    time_zone: str | None = None
    sort: bool = False

    def reading(self, clock: Clock) -> dict[str, Any]:
        """Return the keys as arguments of `read_log`, for a run."""
        keys = {name: getattr(self, name) for name in LogKeys.model_fields}
        return {**keys, "time_zone": self.zone_of(clock)}

    def zone_of(self, clock: Clock) -> Zone | str | None:
        """Return the time zone of the home: that of the run, if it has one.

        Raises:
            LogError: It has two.
        """
        zone = clock.zone
        if zone is not None and self.time_zone not in (None, zone.label):
            raise LogError(
                f"time_zone: the home is in {zone.label}, as simulation.time_zone says, and not in"
                f" {self.time_zone}: leave it out here"
            )
        return zone or self.time_zone


class Reading(NamedTuple):
    """A person is in a room, at an instant or for a while.

    Attributes:
        begin_us: Time since the midnight that begins the log's first day [us].
        end_us: The end, likewise; equal to `begin_us` for an instant.
        room: The room's label in the log, or `AWAY`.
        activity: What is done there, "" if the log doesn't say.
        line: Line of the file, from 1.
    """

    begin_us: int
    end_us: int
    room: str
    activity: str
    line: int


@dataclass(frozen=True)
class ActivityLog:
    """The readings of a log of rooms and activities, in the order in which they begin.

    Attributes:
        path: The file, or the folder of files, that it was read from.
        layout: The layout it is written in, such as casas.
        first_day: The date of its first day; None where the log has no dates.
        readings: The readings.
        notes: Anomalies in the log, and how they were resolved.
        sensors: What sensors alone show, in a layout whose activities are written down apart.
    """

    path: Path
    layout: str
    first_day: date | None
    readings: tuple[Reading, ...]
    notes: tuple[str, ...] = ()
    sensors: tuple[Reading, ...] = ()

    @property
    def days(self) -> int:
        """The number of calendar days from its first to its last reading."""
        return max((r.begin_us for r in self.readings), default=-1) // DAY_US + 1

    @property
    def rooms(self) -> Counter[str]:
        """How many readings name each room label."""
        return Counter(reading.room for reading in self.readings)

    @property
    def noun(self) -> str:
        """What its lines are, in the plural."""
        return "readings"

    def moments(self) -> tuple[I64, I64]:
        """Return the beginning and the end of each reading [us since the first midnight]."""
        pairs = [(reading.begin_us, reading.end_us) for reading in self.readings]
        begins, ends = np.array(pairs, np.int64).reshape(-1, 2).T
        return begins, ends

    def moved(self, move: Callable[[I64], I64]) -> Self:
        """Return the log with other times."""
        parts = (_moved(readings, move) for readings in (self.readings, self.sensors))
        return replace(self, readings=next(parts), sensors=next(parts))


def _moved(readings: Sequence[Reading], move: Callable[[I64], I64]) -> tuple[Reading, ...]:
    begins = np.maximum.accumulate(move(np.array([r.begin_us for r in readings], np.int64)))
    ends = move(np.array([r.end_us for r in readings], np.int64))
    times = zip(begins.tolist(), np.maximum(begins, ends).tolist(), strict=True)
    return tuple(
        reading._replace(begin_us=begin, end_us=end)
        for reading, (begin, end) in zip(readings, times, strict=True)
    )


@dataclass(frozen=True)
class PositionLog:
    """The position fixes of one tag, in order of time.

    Attributes:
        path: The file that it was read from.
        layout: "positions".
        first_day: The date of its first day; None where the log has no dates.
        time_us: Time since the midnight that begins the first day, int64 (n,) [us].
        xy: Positions in the log's own frame, float64 (n, 2).
        heading: Headings in the log's own frame, float64 (n,) [rad]; NaN where it has none.
        notes: Anomalies in the log, and how they were resolved.
        unit_m: The unit of the positions [m]; None: the log doesn't say.
    """

    path: Path
    layout: str
    first_day: date | None
    time_us: I64
    xy: F64
    heading: F64
    notes: tuple[str, ...] = ()
    unit_m: float | None = None

    @property
    def days(self) -> int:
        """The number of calendar days from its first to its last fix."""
        return int(self.time_us[-1]) // DAY_US + 1

    @property
    def noun(self) -> str:
        """What its rows are, in the plural."""
        return self.layout if self.layout in ("detections", "readings") else "fixes"

    def moments(self) -> tuple[I64, I64]:
        """Return the time of each fix, as its beginning and its end."""
        return self.time_us, self.time_us

    def moved(self, move: Callable[[I64], I64]) -> Self:
        """Return the log with other times; those since its beginning are no readings of a clock."""
        if self.first_day is None:
            return self
        return replace(self, time_us=np.maximum.accumulate(move(self.time_us)))


Day = int | Literal["date", "weekday"]
"""The day of a log that is the first of the run: a number, its date, or the same weekday."""


Log = TypeVar("Log", bound=ActivityLog | PositionLog)


def in_run(log: Log, day: Day, clock: Clock) -> tuple[Log, int, tuple[str, ...]]:
    """Return a log by the clock of a run, and the moment of it that is step 0 of the run.

    Args:
        log: The log.
        day: The day of the log that is the first of the run.
        clock: The steps of the run.

    Returns:
        The log, the moment [us since the log's first midnight], and a note on what lies outside of
        the run, if anything does.

    Raises:
        LogError: All of the log lies outside of the run, or it has no dates.
    """
    start = clock.start
    number = _number_of(log, day, clock)
    log = by_clock_of_run(log, day, clock)
    begin_us = micros(start - at_reading(start, midnight_of(start) - number * DAY))
    begins, ends = log.moments()
    end_us = begin_us + clock.steps * clock.step_us
    first = int(begins.min())
    last = int(ends.max())
    if last < begin_us or first >= end_us:
        since = f", from {log.first_day}" if log.first_day else ""
        of_log = f"{_moment(clock, first - begin_us)} to {_moment(clock, last - begin_us)}"
        of_run = f"{_moment(clock, 0)} to {_moment(clock, end_us - begin_us)}"
        raise LogError(
            f"the run begins on day {number} of the log, which has the days 0 to"
            f" {log.days - 1}{since}: by the calendar of the run, the log is from {of_log}, the run"
            f" from {of_run}; choose another 'day', or set simulation.start"
        )
    early = np.count_nonzero(ends < begin_us)
    late = np.count_nonzero(begins >= end_us)
    if not early + late:
        return log, begin_us, ()
    outside = f"{early} are before the run and {late} after its end"
    return log, begin_us, (f"of {len(begins)} {log.noun}, {outside}",)


def by_clock_of_run(log: Log, day: Day, clock: Clock) -> Log:
    """Return a log with what its clock read as the clock of a run reads it, on other days.

    A clock may be changed in the nights of the log, of the run, or of neither. Of an hour that the
    log's clock read twice, the second time comes at the end of the first.
    """
    midnight = midnight_of(clock.start) - _number_of(log, day, clock) * DAY
    if clock.zone is None or log.first_day == midnight.date():
        return log
    move = _DayShift(log.first_day, midnight, clock.zone)
    return cast("Log", log.moved(move.moments))  # of a union, the checker forgets which


def _number_of(log: ActivityLog | PositionLog, day: Day, clock: Clock) -> int:
    """Return the number of the day of a log that is the first of a run."""
    if isinstance(day, str):
        if log.first_day is None:
            raise LogError(f"day: {day} needs a log with dates, and this one has none")
        ahead = (clock.start.date() - log.first_day).days
        day = ahead if day == "date" else ahead % 7
    with errors_as(LogError, f"day: {day} is out of range", of=OverflowError):
        midnight_of(clock.start) - day * DAY
    return day


class _DayShift(NamedTuple):
    """The move of a log to other days: times since its first midnight become those of the run.

    Attributes:
        first_day: The date of its first day; None: its times are what a clock reads.
        midnight: The midnight that begins its first day in the run.
        zone: The clock of the home.
    """

    first_day: date | None
    midnight: datetime
    zone: Zone

    def moments(self, time_us: I64) -> I64:
        """Return when the clock of the run first reads what the clock of the log did."""
        read_us = time_us
        if self.first_day is not None and len(time_us):
            first_us = wall_us(datetime.combine(self.first_day, datetime.min.time()))
            zone = self.zone.over(first_us, first_us + int(time_us.max()))
            read_us = zone.readings(time_us + zone.utc_us(first_us)) - first_us
        midnight_us = wall_us(self.midnight)
        return self.zone.moments(read_us + midnight_us) - self.zone.utc_us(midnight_us)


def _moment(clock: Clock, elapsed_us: int) -> str:
    """Return a moment of a run as text; far ones in days from its start."""
    try:
        return str(clock.start + timedelta(microseconds=elapsed_us))
    except OverflowError:
        return f"day {elapsed_us // DAY_US}"


def in_order(readings: list[Reading], path: Path, *, sort: bool) -> tuple[list[Reading], list[str]]:
    """Return readings in the order in which they begin, and notes about anomalies.

    A reading that ends before it begins counts as an instant.

    Raises:
        LogError: There are none, times run backwards and `sort` is off, or one at home lasts
            longer than a day.
    """
    if not readings:
        raise LogError(f"{path} holds no reading: is it the right file?")
    first = min(r.begin_us for r in readings)
    last = max(r.end_us for r in readings)
    LOG_DAYS.check((last - first) // DAY_US + 1, path, LogError)
    early = [b for a, b in pairwise(readings) if b.begin_us < a.begin_us]
    if early and not sort:
        raise LogError(
            f"{path}, line {early[0].line}: the time runs backwards there"
            f" ({counted(len(early), 'such line')}); check the clock of the log, or put its"
            " lines in order of time by 'sort: true' (as an option, --sort)"
        )
    for reading in readings:
        lasts = reading.end_us - reading.begin_us
        if lasts > DAY_US and reading.room != AWAY:
            raise LogError(
                f"{path}, line {reading.line}: it lasts {lasts / 3.6e9:.1f} h; a reading lasts a"
                " day at most: check its end"
            )
    notes = wrong_ends(readings)
    if early:
        readings = sorted(readings, key=lambda reading: reading.begin_us)  # stable
        notes.append(f"{counted(len(early), 'line')} ran backwards in time and were sorted in")
    return [r._replace(end_us=max(r.end_us, r.begin_us)) for r in readings], notes


def wrong_ends(readings: Sequence[Reading]) -> list[str]:
    """Return a note about readings that end before they begin, if there are any."""
    wrong = [str(reading.line) for reading in readings if reading.end_us < reading.begin_us]
    if not wrong:
        return []
    more = f" and {len(wrong) - _MAX_NAMED} more" if len(wrong) > _MAX_NAMED else ""
    lines = f"{', '.join(wrong[:_MAX_NAMED])}{more}"
    return [f"an end before the beginning is ignored, in line {lines}"]


def parse_time(text: str, path: Path, line: int, *, day_first: bool | None = None) -> datetime:
    """Read a time like '2011-06-15 01:03:39.14962', exact to the microsecond.

    Days come before months in dates with dots, as in 15.06.2011.

    Args:
        text: The text, with or without a time zone.
        path: The file that it is from, for messages.
        line: Its line.
        day_first: Whether 03/04/2026 is in April; None: such a date is refused.

    Raises:
        LogError: The text is not a time, or there is no such day or hour.

    Example:
        >>> parse_time("2011-06-15 01:03:39.14962", Path("log"), 1).isoformat()
        '2011-06-15T01:03:39.149620'
        >>> parse_time("15.6.2011 1:03 PM", Path("log"), 1).isoformat()
        '2011-06-15T13:03:00'
    """
    text = text.strip()
    match = _TIME.fullmatch(text)
    if match is None or (match[6] in ("-", "/") and day_first is None):
        raise LogError(
            f"{path}, line {line}: expected a time like '2011-06-15 01:03:39', got"
            f" {one_line(text)!r}"
        )
    if match[1]:
        year = match[1]
        month = match[3]
        day = match[4]
    elif match[6] == "." or day_first:
        day = match[5]
        month = match[7]
        year = match[8]
    else:
        month = match[5]
        day = match[7]
        year = match[8]
    hour = int(match[9])
    half = (match[13] or "").upper()
    micros = int((match[12] or "").ljust(6, "0")[:6])
    try:
        if half and not 1 <= hour <= 12:
            raise ValueError(f"hour {hour} of a clock of 12 hours")
        if half:
            hour = hour % 12 + (12 if half == "P" else 0)
        moment = datetime(
            int(year), int(month), int(day), hour, int(match[10]), int(match[11] or 0), micros
        )
    except ValueError as error:
        raise LogError(f"{path}, line {line}: {one_line(text)!r} is not a time: {error}") from None
    return moment.replace(tzinfo=_zone(match[14]))


def parse_local_time(
    text: str, path: Path, line: int, *, day_first: bool | None = None
) -> datetime:
    """Read a time of a layout that has the times of the home's clock, likewise.

    Raises:
        LogError: as `parse_time`, or the time has an offset.
    """
    moment = parse_time(text, path, line, day_first=day_first)
    if moment.tzinfo is not None:
        raise LogError(
            f"{path}, line {line}: {one_line(text.strip())!r} has an offset, and this layout has"
            " times of the home's clock: write those, without offset"
        )
    return moment


def _zone(text: str | None) -> timezone | None:
    if text is None:
        return None
    digits = re.sub(r"\D", "", text).ljust(4, "0")
    offset = timedelta(hours=int(digits[:2]), minutes=int(digits[2:]))
    return timezone(-offset if text[0] == "-" else offset)


def since(first_day: date, moment: datetime) -> int:
    """Return the microseconds from the midnight that begins a day to a moment."""
    return micros(moment - datetime.combine(first_day, datetime.min.time()))
