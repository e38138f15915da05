"""Local time of a home whose clocks change: its offsets from UTC, and moments with an offset.

Steps of a run are uniform; the readings of a clock on the wall are not. A `Zone` maps between both,
in integers. A time that the clock never reads is the first moment after the gap, one that it reads
twice is the first of both.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime, timedelta, tzinfo
from functools import lru_cache
from itertools import pairwise
from typing import Any, Self

import numpy as np

from fleet2d.kernels import I64

EPOCH = datetime(1970, 1, 1)
_EPOCH_DAY = EPOCH.toordinal()
_SECOND_US = 1_000_000
_LARGEST_OFFSET_S = 24 * 3600
# Rules don't change a clock twice within this time.
_STRIDE_S = 6 * 3600
# Schedules look this far beyond the beginning and the end of a run.
_MARGIN = timedelta(days=9)


class Zone(tzinfo):
    """The clock of a home: its offsets from UTC, constant from change to change.

    Attributes:
        label: The name of the time zone.
        standard_us: Its offset without summer time [us].
        changes_us: Moments at which the offset changes [us since 1970 UTC], in order.
        offsets_us: The offset before the first change, and after each [us].
        covers_us: The first and last moment between which changes are known [us since 1970 UTC].

    Example:
        >>> berlin = zone_of("Europe/Berlin", datetime(2026, 10, 24), datetime(2026, 10, 26))
        >>> first = berlin.at(datetime(2026, 10, 25, 2, 30))
        >>> first.isoformat(), (first + timedelta(hours=1)).isoformat()
        ('2026-10-25T02:30:00+02:00', '2026-10-25T02:30:00+01:00')
    """

    def __init__(
        self,
        label: str,
        standard_us: int,
        changes_us: tuple[int, ...],
        offsets_us: tuple[int, ...],
        covers_us: tuple[int, int] = (0, 0),
    ) -> None:
        self.label = label
        self.standard_us = standard_us
        self.changes_us = changes_us
        self.offsets_us = offsets_us
        self.covers_us = covers_us
        # The clock's readings at the end of each part of constant offset, and at the start of the
        # next.
        self._over = [at + offsets_us[i] for i, at in enumerate(changes_us)]
        self._begins = [at + offsets_us[i + 1] for i, at in enumerate(changes_us)]

    @classmethod
    def of_record(cls, record: Mapping[str, Any], covers_us: tuple[int, int] = (0, 0)) -> Self:
        """Return the clock that a record describes.

        Raises:
            KeyError, TypeError, ValueError: The record isn't valid.
        """
        moments = [datetime.fromisoformat(text) for text, _ in record["changes"]]
        changes = tuple(wall_us(moment.astimezone(UTC)) for moment in moments)
        if list(changes) != sorted(set(changes)):
            raise ValueError("the changes are not in order")
        offsets = [record["offset_s"], *(offset for _, offset in record["changes"])]
        if any(abs(offset) >= _LARGEST_OFFSET_S for offset in offsets):
            raise ValueError("an offset is a day or more")
        in_us = tuple(offset * _SECOND_US for offset in offsets)
        return cls(record["name"], record["standard_s"] * _SECOND_US, changes, in_us, covers_us)

    @property
    def record(self) -> dict[str, Any]:
        """The name and offsets as plain data; moments are UTC."""
        moments = [EPOCH + timedelta(microseconds=at) for at in self.changes_us]
        offsets = [offset // _SECOND_US for offset in self.offsets_us]
        changes = zip(moments, offsets[1:], strict=True)
        return {
            "name": self.label,
            "standard_s": self.standard_us // _SECOND_US,
            "offset_s": offsets[0],
            "changes": [[f"{moment.isoformat()}Z", offset] for moment, offset in changes],
        }

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the constructor and its arguments, for pickle and copy."""
        of_clock = self.label, self.standard_us, self.changes_us, self.offsets_us
        return Zone, (*of_clock, self.covers_us)

    def __eq__(self, other: object) -> bool:
        """Return whether the clocks are the same."""
        return isinstance(other, Zone) and self.__reduce__() == other.__reduce__()

    def __hash__(self) -> int:
        return hash(self.__reduce__())

    def __repr__(self) -> str:
        return self.label

    def tzname(self, _: datetime | None) -> str:
        """Return the name of the time zone."""
        return self.label

    def dst(self, _: datetime | None) -> None:
        """Return None: offsets don't tell which part of them is summer time."""

    def utcoffset(self, moment: datetime | None) -> timedelta | None:
        """Return the offset of a reading, the first or (`fold`) the second time."""
        if moment is None:
            return None
        utc_us = self.utc_us(wall_us(moment), moment.fold)
        return timedelta(microseconds=self.offset_us(utc_us))

    def fromutc(self, moment: datetime) -> datetime:
        """Return the local time of a moment whose fields are UTC."""
        return self.moment(wall_us(moment))

    def offset_us(self, utc_us: int) -> int:
        """Return the offset at a moment [us since 1970 UTC]."""
        return self.offsets_us[bisect_right(self.changes_us, utc_us)]

    def utc_us(self, reading_us: int, fold: int = 0) -> int:
        """Return the moment of a reading [us since 1970]: the first, or with `fold` the last."""
        if not fold:
            part = bisect_right(self._over, reading_us)
            utc_us = reading_us - self.offsets_us[part]
            return max(utc_us, self.changes_us[part - 1]) if part else utc_us
        part = bisect_right(self._begins, reading_us)
        utc_us = reading_us - self.offsets_us[part]
        return min(utc_us, self.changes_us[part]) if part < len(self.changes_us) else utc_us

    def moment(self, utc_us: int) -> "LocalTime":
        """Return a moment [us since 1970 UTC] as local time."""
        reading_us = utc_us + self.offset_us(utc_us)
        fold = int(self.utc_us(reading_us) != utc_us)
        return LocalTime.read(EPOCH + timedelta(microseconds=reading_us), self, fold)

    def at(self, reading: datetime) -> "LocalTime":
        """Return the moment of a reading; a time with an offset of its own is exact."""
        if isinstance(reading, LocalTime) and reading.tzinfo is self:
            return reading
        return self.moment(self.utc_of(reading))

    def utc_of(self, time: datetime) -> int:
        """Return a moment [us since 1970 UTC]; a time without offset is a reading of the clock."""
        if isinstance(time, LocalTime):
            return time.utc_us
        if time.tzinfo is not None:
            return wall_us(time.astimezone(UTC))
        return self.utc_us(wall_us(time), fold=time.fold)

    def readings(self, utc_us: I64) -> I64:
        """Return the readings of the clock at moments [us since 1970]."""
        part = np.searchsorted(np.array(self.changes_us, np.int64), utc_us, side="right")
        return utc_us + np.array(self.offsets_us, np.int64)[part]

    def moments(self, readings_us: I64) -> I64:
        """Return the first moments with some readings [us since 1970 UTC]."""
        part = np.searchsorted(np.array(self._over, np.int64), readings_us, side="right")
        earliest = np.array([np.iinfo(np.int64).min, *self.changes_us])
        utc_us = readings_us - np.array(self.offsets_us, np.int64)[part]
        return np.maximum(utc_us, earliest[part])

    def over(self, first_us: int, last_us: int) -> "Zone":
        """Return the clock for a log: this one, or by this machine's rules if it is of other years.

        Args:
            first_us: The beginning of the log [us since 1970].
            last_us: Its end.

        Raises:
            KeyError: The machine has no rules for the time zone.
        """
        begin_us, end_us = self.covers_us
        if begin_us <= last_us and first_us <= end_us:
            return self
        first, last = (EPOCH + timedelta(microseconds=at) for at in (first_us, last_us))
        return zone_of(self.label, first, last)

    def next_change(self, time: "LocalTime") -> "LocalTime | None":
        """Return the next change of the clock after a moment."""
        later = bisect_right(self.changes_us, time.utc_us)
        return self.moment(self.changes_us[later]) if later < len(self.changes_us) else None

    def skips(self, reading: datetime) -> bool:
        """Return whether the clock never reads a time, as it is put forward."""
        return reading.tzinfo is None and wall_us(self.at(reading)) != wall_us(reading)

    def oddity(self, reading: datetime) -> str:
        """Explain a time that the clock reads never or twice; empty for other times."""
        if reading.tzinfo is not None:
            return ""
        first, last = (self.moment(self.utc_us(wall_us(reading), fold)) for fold in (0, 1))
        if self.skips(reading):
            return (
                f"{reading:%Y-%m-%d %H:%M} doesn't exist in {self.label}, as the clock is put"
                f" forward: the next moment is {first.isoformat()}"
            )
        if first != last:
            return (
                f"the clock reads {reading:%Y-%m-%d %H:%M} twice in {self.label}: the first counts,"
                f" {first.isoformat()}; write {last.isoformat()} for the second"
            )
        return ""


class LocalTime(datetime):
    """A moment, by the clock of a home: it reads as local time and counts in real time.

    Its date, hour and text are those of the clock, with the offset. Durations added to it and
    differences of two are real time, also when clocks change. A plain `datetime` compared with it
    stands for the first moment with that reading.

    Example:
        >>> berlin = zone_of("Europe/Berlin", datetime(2026, 3, 28), datetime(2026, 3, 30))
        >>> before = berlin.at(datetime(2026, 3, 29, 1, 30))
        >>> (before + timedelta(hours=1)).hour, datetime(2026, 3, 29, 3, 30) - before
        (3, datetime.timedelta(seconds=3600))
    """

    __slots__ = ()

    @classmethod
    def read(cls, reading: datetime, zone: Zone, fold: int) -> Self:
        """Return the first or second moment at which a clock reads a time."""
        time = reading.time()
        of_day = time.hour, time.minute, time.second, time.microsecond
        date = reading.year, reading.month, reading.day
        return cls(*date, *of_day, tzinfo=zone, fold=fold)

    @property
    def zone(self) -> Zone:
        """The clock of the moment."""
        assert isinstance(self.tzinfo, Zone)
        return self.tzinfo

    @property
    def utc_us(self) -> int:
        """Microseconds since 1970 UTC."""
        return self.zone.utc_us(wall_us(self), fold=self.fold)

    @property
    def plain(self) -> datetime:
        """A datetime of the standard library, with the same fields."""
        return datetime.combine(self.date(), self.timetz())

    def __add__(self, duration: timedelta) -> "LocalTime":
        """Return the moment after a duration."""
        if not isinstance(duration, timedelta):
            return NotImplemented
        return self.zone.moment(self.utc_us + duration // timedelta(microseconds=1))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        """Return the time since another moment, or the moment before a duration."""
        if isinstance(other, timedelta):
            return self + -other
        if not isinstance(other, datetime):
            return NotImplemented
        return timedelta(microseconds=self.utc_us - self.zone.utc_of(other))

    def __rsub__(self, other: Any) -> Any:
        """Return the time until another moment."""
        return -(self - other) if isinstance(other, datetime) else NotImplemented

    def __eq__(self, other: object) -> bool:
        """Return whether the moments are the same."""
        return isinstance(other, datetime) and self.utc_us == self.zone.utc_of(other)

    def __ne__(self, other: object) -> bool:
        """Return whether the moments differ."""
        return not self == other

    def __hash__(self) -> int:
        return hash(self.utc_us)

    def __lt__(self, other: datetime) -> bool:  # type: ignore[override]
        return self.utc_us < self.zone.utc_of(other)

    def __le__(self, other: datetime) -> bool:  # type: ignore[override]
        return self.utc_us <= self.zone.utc_of(other)

    def __gt__(self, other: datetime) -> bool:  # type: ignore[override]
        return self.utc_us > self.zone.utc_of(other)

    def __ge__(self, other: datetime) -> bool:  # type: ignore[override]
        return self.utc_us >= self.zone.utc_of(other)

    def replace(self, *args: Any, **fields: Any) -> Any:
        """Return the moment with other fields; with another time zone, a plain datetime."""
        other = self.plain.replace(*args, **fields)
        return other if other.tzinfo is not self.tzinfo else self.zone.at(written(other))

    def astimezone(self, tz: tzinfo | None = None) -> datetime:  # type: ignore[override]
        """Return this time as a standard `datetime` in another time zone."""
        return (EPOCH.replace(tzinfo=UTC) + timedelta(microseconds=self.utc_us)).astimezone(tz)

    def timestamp(self) -> float:
        """Return the seconds since 1970 UTC."""
        return self.utc_us / _SECOND_US


def wall_us(time: datetime) -> int:
    """Return the reading of a clock at a time [us since 1970], without its offset."""
    hours = (time.toordinal() - _EPOCH_DAY) * 24 + time.hour
    return ((hours * 60 + time.minute) * 60 + time.second) * _SECOND_US + time.microsecond


def written(time: datetime) -> datetime:
    """Return the reading of the clock at a time, as a datetime without offset."""
    return datetime.combine(time.date(), time.time())  # both keep `fold`


def at_reading(time: datetime, reading: datetime) -> datetime:
    """Return the moment of a reading on the clock of a time; without a time zone, the reading."""
    return time.zone.at(reading) if isinstance(time, LocalTime) else reading


def next_reading(time: datetime, reading: datetime) -> datetime:
    """Return the next moment of a reading, or the next change of the clock if that is earlier."""
    if not isinstance(time, LocalTime):
        return reading
    due = time + (reading - written(time))
    change = time.zone.next_change(time)
    return due if change is None or due <= change else change


def stamp_us(time: datetime) -> int:
    """Return a time as tables hold it [us since 1970]: as UTC if it has an offset."""
    return time.utc_us if isinstance(time, LocalTime) else wall_us(time)


def readings_of(start: datetime, elapsed_us: I64) -> I64:
    """Return the readings of the clock at moments after a start [us since 1970]."""
    times_us = stamp_us(start) + elapsed_us
    return start.zone.readings(times_us) if isinstance(start, LocalTime) else times_us


def even_parts(start: datetime, first_us: int, end_us: int) -> Iterator[tuple[int, int, int]]:
    """Yield the parts of a time in which the offset is constant; without changes there is one.

    Args:
        start: The start of the run.
        first_us: The beginning of the time [us since the start].
        end_us: The end of the time [us since the start].

    Yields:
        The beginning and the end of the part [us since the start], and what the clock would have
        read at the start with its offset [us since 1970].
    """
    start_us = stamp_us(start)
    zone = start.zone if isinstance(start, LocalTime) else None
    changes = [at - start_us for at in zone.changes_us] if zone else []
    edges = [first_us, *(at for at in changes if first_us < at < end_us), end_us]
    for begin, end in pairwise(edges):
        offset_us = zone.offset_us(start_us + begin) if zone else 0
        yield begin, end, start_us + offset_us


def zone_of(name: str, begin: datetime, end: datetime) -> Zone:
    """Return the clock of a time zone, by the rules that this machine has for it.

    Args:
        name: The name of the time zone, like Europe/Berlin.
        begin: The start of the run; without offset it is local time.
        end: About the end of the run.

    Raises:
        KeyError: There is no such time zone.
    """
    return _zone_of(name, written(begin) - _MARGIN, written(end) + _MARGIN, begin.year)


def span_us(begin: datetime, end: datetime) -> tuple[int, int]:
    """Return the readings of clocks at the beginning and the end of a time [us since 1970]."""
    return wall_us(begin), wall_us(end)


def rules_of(name: str) -> tzinfo:
    """Return this machine's rules for a time zone.

    Raises:
        KeyError: There is no such time zone.
    """
    from zoneinfo import ZoneInfo  # few runs have a time zone

    try:
        return ZoneInfo(name)
    except (ValueError, OSError) as error:  # names like '../x', or of a folder
        raise KeyError(name) from error


@lru_cache(64)
def _zone_of(name: str, begin: datetime, end: datetime, year: int) -> Zone:
    rules = rules_of(name)
    epoch = EPOCH.replace(tzinfo=UTC)

    def offset_s(second: int) -> int:
        local = (epoch + timedelta(seconds=second)).astimezone(rules)
        offset = local.utcoffset()
        assert offset is not None
        return round(offset.total_seconds())

    first, last = (wall_us(time) // _SECOND_US for time in (begin, end))
    seconds = range(first, last + _STRIDE_S, _STRIDE_S)
    changes: list[int] = []
    offsets = [offset_s(first)]
    for before, after in pairwise(seconds):
        new = offset_s(after)
        if new != offsets[-1]:
            inside = range(before, after)
            at = bisect_left(inside, True, key=lambda second: offset_s(second) == new)
            changes.append(before + at)
            offsets.append(new)
    months = (wall_us(datetime(year, month, 1)) // _SECOND_US for month in range(1, 13))
    standard = min(offset_s(month) for month in months)
    return Zone(
        name,
        standard * _SECOND_US,
        tuple(at * _SECOND_US for at in changes),
        tuple(offset * _SECOND_US for offset in offsets),
        span_us(begin, end),
    )
