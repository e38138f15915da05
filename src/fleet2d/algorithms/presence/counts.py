"""Sums of evidence by day and by hour of the week, in which older days may count less."""

from collections.abc import Sequence
from datetime import datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.evidence import Evidence, Parts, SightingCounts
from fleet2d.algorithms.learned import array_of
from fleet2d.algorithms.presence.belief import HOURS
from fleet2d.kernels import F64, I64
from fleet2d.runtime.clock import midnight_of

HOUR_US = 3_600_000_000
DAY_US = 24 * HOUR_US
EXACT = 1 << 40


class Bins(NamedTuple):
    """Evidence with the time of each bin.

    Attributes:
        day: int64 (bins,), the day, as `date.toordinal` counts.
        minute: int64 (bins,), begin of the bin [minutes since midnight].
        bin_steps: Steps of a bin.
        watched: float64 (bins, rooms), as in Evidence.
        sightings: Where users were perceived, by rooms, as in Evidence.
        by_patch: The same by patches of rooms, as in Evidence.
    """

    day: I64
    minute: I64
    bin_steps: int
    watched: F64
    sightings: SightingCounts
    by_patch: Parts | None = None

    @property
    def seen(self) -> I64:
        """As in Evidence: int64 (bins, users + 1, rooms), made anew."""
        return self.sightings.dense

    @property
    def parts(self) -> Parts:
        """The evidence by patches of rooms, or by rooms if there are no patches."""
        if self.by_patch is not None:
            return self.by_patch
        rooms = self.watched.shape[1]
        room, cells = np.arange(rooms, dtype=np.int64), np.ones(rooms, np.int64)
        return Parts(room, cells, self.watched, self.watched, self.sightings)

    def part(self, begin: int, end: int) -> "Bins":
        """Return the bins from `begin` to `end` - 1."""
        rows = slice(begin, end)
        return Bins(
            self.day[rows],
            self.minute[rows],
            self.bin_steps,
            self.watched[rows],
            self.sightings.between(begin, end),
            _part(self.by_patch, rows),
        )


def in_time(evidence: Evidence, start: datetime, step_us: int) -> Bins:
    """Return evidence with the time of each bin.

    Args:
        evidence: The evidence.
        start: Local time of step 0.
        step_us: Length of a step [us].
    """
    midnight = midnight_of(start)
    start_us = (start - midnight).seconds * 1_000_000 + start.microsecond
    steps = evidence.begin + np.arange(len(evidence.watched), dtype=np.int64) * evidence.bin_steps
    day, time_us = np.divmod(start_us + steps * step_us, DAY_US)
    return Bins(
        start.toordinal() + day,
        time_us // 60_000_000,
        evidence.bin_steps,
        evidence.watched,
        evidence.sightings,
        evidence.parts,
    )


def _part(parts: Parts | None, rows: slice) -> Parts | None:
    """Return the given bins of the evidence by patches."""
    if parts is None:
        return None
    shown_parts = None if parts.shown_parts is None else parts.shown_parts[rows]
    return parts._replace(
        watched=parts.watched[rows],
        shown=parts.shown[rows],
        sightings=parts.sightings.between(*rows.indices(len(parts.watched))[:2]),
        shown_parts=shown_parts,
    )


def joined(parts: Sequence[Bins]) -> Bins:
    """Return consecutive bins as one."""
    first = parts[0]
    if len(parts) == 1:
        return first
    return Bins(
        np.concatenate([part.day for part in parts]),
        np.concatenate([part.minute for part in parts]),
        first.bin_steps,
        np.concatenate([part.watched for part in parts]),
        SightingCounts.joined([part.sightings for part in parts]),
        first.by_patch
        and first.by_patch._replace(
            watched=np.concatenate([part.parts.watched for part in parts]),
            shown=np.concatenate([part.parts.shown for part in parts]),
            sightings=SightingCounts.joined([part.parts.sightings for part in parts]),
            shown_parts=None,
        ),
    )


class DayCounts:
    """Sums of values over bins: for today by hour, and for earlier days, with decaying weights.

    A day that is k days old has the weight 2**(-k / half_life). The order of summation doesn't
    depend on how often the sums are updated.

    Attributes:
        days: The finished days, as ordinals.
        by_day: float64 (days, *shape), the sum of each finished day, unweighted.
        week: float64 (168, *shape), the weighted sum of each hour of the week, without today.
        finished: float64 (*shape), the weighted sum of the finished days.
        today: Ordinal of the present day; 0 before the first.
        hours: float64 (24, *shape), the sums of the hours of today.

    Example:
        >>> counts = DayCounts((2,))
        >>> values = np.array([[1.0, 0], [2, 0], [0, 4]])
        >>> counts.add(np.array([1, 1, 2]), np.array([0, 60, 0]), values)
        >>> counts.total.tolist(), counts.days
        ([3.0, 4.0], [1])
    """

    def __init__(self, shape: tuple[int, ...], half_life: float | None = None) -> None:
        """Begin without days.

        Args:
            shape: Shape of the values of a bin.
            half_life: Days after which a day counts half; None: all days count equally.
        """
        # Rounded so that all math libraries agree.
        self.fade = 1.0 if half_life is None else round(0.5 ** (1 / half_life) * EXACT) / EXACT
        self.shape = shape
        self.days: list[int] = []
        self.by_day = np.zeros((0, *shape))
        self.week = np.zeros((HOURS, *shape))
        self.finished = np.zeros(shape)
        self.today = 0
        self.hours = np.zeros((24, *shape))

    def add(self, day: I64, minute: I64, values: F64) -> None:
        """Add the values of the next bins, in order of time.

        Args:
            day: int64 (bins,), ordinals.
            minute: int64 (bins,), since midnight.
            values: float64 (bins, *shape).
        """
        if not len(day):
            return
        slot = day * 24 + minute // 60
        first = np.concatenate([[0], np.flatnonzero(np.diff(slot)) + 1])
        self.add_hours(slot[first], np.add.reduceat(values, first, axis=0))

    def add_hours(self, hours: I64, sums: F64) -> None:
        """Add sums of hours to the counts; the hours follow those added before, in order of time.

        Args:
            hours: int64 (hours,), as ordinal * 24 + hour of the day.
            sums: float64 (hours, *shape).
        """
        for hour, part in zip(hours.tolist(), sums, strict=True):
            if hour // 24 != self.today:
                self.begin_day(hour // 24)
            self.hours[hour % 24] += part

    def begin_day(self, day: int) -> None:
        """End the present day, if there is one, and reduce the weights of older days."""
        if self.today:
            self._end(self.today, self.hours, day)
        self.today = day
        self.hours = np.zeros((24, *self.shape))

    def put(self, day: int, old: F64, new: F64) -> None:
        """Replace the sums of the hours of a day: float64 (24, *shape) each."""
        change = new - old
        if day == self.today:
            self.hours = self.hours + change
            return
        weight, monday = self.faded(self.today - day), (day - 1) % 7 * 24
        self.by_day[self.days.index(day)] += change.sum(axis=0)
        self.finished = self.finished + weight * change.sum(axis=0)
        self.week[monday : monday + 24] += weight * change

    def _end(self, day: int, hours: F64, next_day: int) -> None:
        self.days.append(day)
        total = hours.sum(axis=0)
        self.by_day = np.concatenate([self.by_day, total[None]])
        monday = (day - 1) % 7 * 24
        self.week[monday : monday + 24] += hours
        weight = self.faded(next_day - day)
        self.finished = (self.finished + total) * weight
        if weight < 1.0:
            self.week *= weight  # in place: of many users it is large

    def faded(self, days: int) -> float:
        """Return the weight of a day after a number of further days, by repeated products."""
        weight = 1.0
        if self.fade < 1.0:
            for _ in range(min(days, 100_000)):
                weight *= self.fade
        return weight

    @property
    def total(self) -> F64:
        """The weighted sum of all days: float64 (*shape)."""
        return self.finished + self.hours.sum(axis=0)

    @property
    def by_hour_of_week(self) -> F64:
        """The weighted sum of each hour of the week from Monday 00:00: float64 (168, *shape)."""
        week = self.week.copy()
        if self.today:
            monday = (self.today - 1) % 7 * 24
            week[monday : monday + 24] += self.hours
        return week

    @property
    def weighted_days(self) -> F64:
        """The sums of the finished days times their weights: float64 (days, *shape)."""
        weights = np.array([self.faded(self.today - day) for day in self.days])
        return self.by_day * weights.reshape(-1, *(1 for _ in self.shape))

    def remember(self) -> dict[str, NDArray[np.generic]]:
        """Return everything as arrays."""
        return {
            "days": np.array([*self.days, self.today], np.int64),
            "by_day": self.by_day,
            "week": self.week,
            "over": self.finished,
            "hours": self.hours,
        }

    def recall(self, learned: dict[str, NDArray[np.generic]], today: int) -> None:
        """Restore what `remember` returned, as if it had ended before a day.

        Args:
            learned: The learned state.
            today: Ordinal of the day that begins. Learned days are moved by whole weeks before it.
        """
        day = 1 << 31
        *days, last = array_of(learned, "days", (-1,), np.int64, most=day).tolist()
        weeks = max(0, -((today - 1 - last) // 7))
        self.days = [day - 7 * weeks for day in days]
        self.by_day = array_of(learned, "by_day", (len(days), *self.shape))
        self.week = array_of(learned, "week", self.week.shape)
        self.finished = array_of(learned, "over", self.shape)
        self.hours = array_of(learned, "hours", self.hours.shape)
        self.today = last - 7 * weeks if last else 0
        if self.today:
            self.begin_day(today)
