"""Sums of evidence by day and by hour of the week, of which older days may count less."""

from collections.abc import Sequence
from datetime import datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.evidence import Evidence, Parts
from fleet2d.algorithms.learned import array_of
from fleet2d.algorithms.presence.belief import HOURS

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

HOUR_US = 3_600_000_000
DAY_US = 24 * HOUR_US
EXACT = 1 << 40


class Bins(NamedTuple):
    """Evidence, and when it was.

    Attributes:
        day: int64 (bins,), number of the day as `date.toordinal` counts.
        minute: int64 (bins,), minutes since midnight at which the bin begins.
        bin_steps: Steps of a bin.
        watched: float64 (bins, rooms), as in Evidence.
        seen: int64 (bins, users + 1, rooms), as in Evidence.
        by_patch: The same by patches of rooms, as in Evidence.
    """

    day: I64
    minute: I64
    bin_steps: int
    watched: F64
    seen: I64
    by_patch: Parts | None = None

    @property
    def parts(self) -> Parts:
        """The same by patches of rooms, or by rooms if they aren't told apart."""
        if self.by_patch is not None:
            return self.by_patch
        rooms = self.watched.shape[1]
        whole = np.arange(rooms, dtype=np.int64), np.ones(rooms, np.int64)
        return Parts(*whole, self.watched, self.watched, self.seen)

    def part(self, begin: int, end: int) -> "Bins":
        """Return the bins from `begin` to `end` - 1."""
        here = slice(begin, end)
        return Bins(
            self.day[here],
            self.minute[here],
            self.bin_steps,
            self.watched[here],
            self.seen[here],
            _part(self.by_patch, here),
        )


def in_time(evidence: Evidence, start: datetime, step_us: int) -> Bins:
    """Return evidence with the time of each bin.

    Args:
        evidence: What was watched and seen.
        start: Local time of step 0.
        step_us: Length of a step [us].
    """
    midnight = start.replace(hour=0, minute=0, second=0, microsecond=0)
    since_us = (start - midnight).seconds * 1_000_000 + start.microsecond
    steps = evidence.begin + np.arange(len(evidence.watched), dtype=np.int64) * evidence.bin_steps
    day, rest = np.divmod(since_us + steps * step_us, DAY_US)
    return Bins(
        start.toordinal() + day,
        rest // 60_000_000,
        evidence.bin_steps,
        evidence.watched,
        evidence.seen,
        evidence.parts,
    )


def _part(parts: Parts | None, here: slice) -> Parts | None:
    """Return some bins of the evidence by patches."""
    if parts is None:
        return None
    shown_parts = None if parts.shown_parts is None else parts.shown_parts[here]
    return parts._replace(
        watched=parts.watched[here],
        shown=parts.shown[here],
        seen=parts.seen[here],
        shown_parts=shown_parts,
    )


def joined(parts: Sequence[Bins]) -> Bins:
    """Return bins that follow each other as one."""
    first = parts[0]
    if len(parts) == 1:
        return first
    return Bins(
        np.concatenate([part.day for part in parts]),
        np.concatenate([part.minute for part in parts]),
        first.bin_steps,
        np.concatenate([part.watched for part in parts]),
        np.concatenate([part.seen for part in parts]),
        first.by_patch
        and first.by_patch._replace(
            watched=np.concatenate([part.parts.watched for part in parts]),
            shown=np.concatenate([part.parts.shown for part in parts]),
            seen=np.concatenate([part.parts.seen for part in parts]),
            shown_parts=None,
        ),
    )


class DayCounts:
    """Sums of values per bin: of today by hour, and of earlier days, which are forgotten.

    A day that is k days old counts 2**(-k / half_life). Nothing is summed in another order when
    updates come more often than days end.

    Attributes:
        days: The days that are over, as ordinals.
        by_day: float64 (days, *shape), the sum of each, unweighted.
        today: Ordinal of the day under way; 0 before the first.
        hours: float64 (24, *shape), the sums of its hours.

    Example:
        >>> counts = DayCounts((2,))
        >>> values = np.array([[1.0, 0], [2, 0], [0, 4]])
        >>> counts.add(np.array([1, 1, 2]), np.array([0, 60, 0]), values)
        >>> counts.total.tolist(), counts.days
        ([3.0, 4.0], [1])
    """

    def __init__(self, shape: tuple[int, ...], half_life: float | None = None) -> None:
        """Begin with nothing.

        Args:
            shape: Of the values of a bin.
            half_life: Days after which a day counts half; None: all count alike.
        """
        # Rounded to where no library of mathematical functions disagrees.
        self.fade = 1.0 if half_life is None else round(0.5 ** (1 / half_life) * EXACT) / EXACT
        self.shape = shape
        self.days: list[int] = []
        self.by_day = np.zeros((0, *shape))
        self.week = np.zeros((HOURS, *shape))
        self.over = np.zeros(shape)
        self.today = 0
        self.hours = np.zeros((24, *shape))

    def add(self, day: I64, minute: I64, values: F64) -> None:
        """Add the values of some bins, which come in order of time.

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
        """Add the sums of some hours, which come in order of time.

        Args:
            hours: int64 (hours,), as ordinal * 24 + hour of the day.
            sums: float64 (hours, *shape).
        """
        for at, part in zip(hours.tolist(), sums, strict=True):
            if at // 24 != self.today:
                self.begin_day(at // 24)
            self.hours[at % 24] += part

    def begin_day(self, day: int) -> None:
        """End the day under way, if there is one, and let older days fade."""
        if self.today:
            self._end(self.today, self.hours, day)
        self.today = day
        self.hours = np.zeros((24, *self.shape))

    def put(self, day: int, old: F64, new: F64) -> None:
        """Put other sums of the hours of a day in place of those it had: (24, *shape) each."""
        change = new - old
        if day == self.today:
            self.hours = self.hours + change
            return
        weight, monday = self.faded(self.today - day), (day - 1) % 7 * 24
        self.by_day[self.days.index(day)] += change.sum(axis=0)
        self.over = self.over + weight * change.sum(axis=0)
        self.week[monday : monday + 24] += weight * change

    def _end(self, day: int, hours: F64, following: int) -> None:
        self.days.append(day)
        total = hours.sum(axis=0)
        self.by_day = np.concatenate([self.by_day, total[None]])
        monday = (day - 1) % 7 * 24
        self.week[monday : monday + 24] += hours
        weight = self.faded(following - day)
        self.over = (self.over + total) * weight
        self.week = self.week * weight

    def faded(self, days: int) -> float:
        """Return what a day counts some days later, by products."""
        weight = 1.0
        if self.fade < 1.0:
            for _ in range(min(days, 100_000)):
                weight *= self.fade
        return weight

    @property
    def total(self) -> F64:
        """The weighted sum of all days: float64 (*shape)."""
        total: F64 = self.over + self.hours.sum(axis=0)
        return total

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
        """The days that are over, each with its weight: float64 (days, *shape)."""
        weights = np.array([self.faded(self.today - day) for day in self.days])
        weighted: F64 = self.by_day * weights.reshape(-1, *(1 for _ in self.shape))
        return weighted

    def remember(self) -> dict[str, NDArray[np.generic]]:
        """Return everything as arrays."""
        return {
            "days": np.array([*self.days, self.today], np.int64),
            "by_day": self.by_day,
            "week": self.week,
            "over": self.over,
            "hours": self.hours,
        }

    def recall(self, learned: dict[str, NDArray[np.generic]], today: int) -> None:
        """Go on from what `remember` returned, as if it had ended before a day.

        Args:
            learned: What was remembered.
            today: Ordinal of the day that begins. Days of another time are moved by whole weeks.
        """
        day = 1 << 31
        *days, last = array_of(learned, "days", (-1,), np.int64, most=day).tolist()
        weeks = max(0, -((today - 1 - last) // 7))
        self.days = [day - 7 * weeks for day in days]
        self.by_day = array_of(learned, "by_day", (len(days), *self.shape))
        self.week = array_of(learned, "week", self.week.shape)
        self.over = array_of(learned, "over", self.shape)
        self.hours = array_of(learned, "hours", self.hours.shape)
        self.today = last - 7 * weeks if last else 0
        if self.today:
            self.begin_day(today)
