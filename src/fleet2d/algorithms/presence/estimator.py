"""Estimators of long-term presence: their base, their counts, and shares of sightings."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fleet2d.algorithms.evidence import Evidence
from fleet2d.algorithms.presence.belief import HOURS, Presence, WeeklyPresence
from fleet2d.configuration.components import Component
from fleet2d.errors import ComponentError
from fleet2d.kernels import F64, I64, resampled

EXACT = 1 << 40
# The number of replicates of the bootstrap.
REPLICATES = 200
MIN_DAYS = 2  # fewest days that say anything about how much days differ
LN_2 = 0.6931471805599453
ROOT_HALF = 0.7071067811865476
TERMS = 11  # of the series: the first left out is below 1e-17 of the sum

SECOND_US = 1_000_000


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
            total = self.hours.sum(axis=0)
            monday = (self.today - 1) % 7 * 24
            weight = self.faded(day - self.today)
            self.days.append(self.today)
            self.by_day = np.concatenate([self.by_day, total[None]])
            self.finished = (self.finished + total) * weight
            self.week[monday : monday + 24] += self.hours
            if weight < 1.0:
                self.week *= weight  # in place: of many users it is large
        self.today = day
        self.hours = np.zeros((24, *self.shape))

    def put(self, day: int, old: F64, new: F64) -> None:
        """Replace the sums of the hours of a day: float64 (24, *shape) each."""
        change = new - old
        if day == self.today:
            self.hours = self.hours + change
            return
        weight = self.faded(self.today - day)
        monday = (day - 1) % 7 * 24
        self.by_day[self.days.index(day)] += change.sum(axis=0)
        self.finished = self.finished + weight * change.sum(axis=0)
        self.week[monday : monday + 24] += weight * change

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
        *days, last = array_of(learned, "days", (-1,), np.int64, max_value=day).tolist()
        weeks = max(0, -((today - 1 - last) // 7))
        self.days = [day - 7 * weeks for day in days]
        self.by_day = array_of(learned, "by_day", (len(days), *self.shape))
        self.week = array_of(learned, "week", self.week.shape)
        self.finished = array_of(learned, "over", self.shape)
        self.hours = array_of(learned, "hours", self.hours.shape)
        self.today = last - 7 * weeks if last else 0
        if self.today:
            self.begin_day(today)


class Estimator(Component):
    """Base of estimators of presence from evidence; a subclass writes `sums` and `shares`.

    `sums` turns each bin of evidence into numbers that add up over bins, and `shares` turns such
    sums into shares. All variants follow from these two: over all time, by hour of the week, with
    forgetting, and intervals by resampling days.
    """

    kind = "presence_estimator"
    has_interval: ClassVar[bool] = True  # whether its output is `shares` of the sum of all days

    def begin(self, rooms: int, users: int, half_life: float | None = None) -> None:
        """Prepare for a run.

        Args:
            rooms: Number of rooms.
            users: Number of users.
            half_life: Days after which a day counts half; None: all days count equally.
        """
        self.rooms = rooms
        self.users = users
        self.counts = DayCounts((users + 1, self.width(rooms)), half_life)

    def width(self, rooms: int) -> int:
        """Return the number of columns of `sums` for each user."""
        raise NotImplementedError

    def sums(self, evidence: Evidence) -> F64:
        """Return numbers for each bin that add up over bins: float64 (bins, users + 1, width).

        The last column is 1: it counts bins.
        """
        raise NotImplementedError

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return shares from sums.

        Args:
            sums: float64 (..., width).

        Returns:
            Shares of rooms given at home, float64 (..., rooms), and of away, float64 (...).
        """
        raise NotImplementedError

    def observe(self, evidence: Evidence) -> None:
        """Add the next bins of evidence."""
        sums = np.asarray(self.sums(evidence))
        expected = (len(evidence), self.users + 1, self.width(self.rooms))
        if sums.shape != expected:
            code = type(self).sums.__code__
            raise ComponentError(
                f"{type(self).__name__}.sums returned an array of shape {sums.shape}, expected"
                f" {expected}: bins, users + 1, and width({self.rooms})"
                f" ({Path(code.co_filename).name}:{code.co_firstlineno}, in sums)"
            )
        self.counts.add(evidence.day, evidence.minute, sums)

    def presence(self, users: Sequence[str], time: datetime) -> Presence:
        """Return the presence from all evidence so far, over all time."""
        return Presence(users, *self.shares(self.counts.total), time)

    def weekly(self, users: Sequence[str], time: datetime, smoothing: float) -> Presence:
        """Return the presence from all evidence so far, by hour of the week.

        Args:
            users: Names of the users.
            time: The local time.
            smoothing: Bins of average evidence that are added to each hour (Laplace smoothing
                towards the shares over all time).
        """
        return WeeklyPresence(users, self.shares(self.smoothed_week(smoothing)), time)

    def smoothed_week(self, smoothing: float) -> F64:
        """Return the sums of each hour of the week plus `smoothing` bins of average evidence."""
        total = self.counts.total
        bins = np.maximum(total[..., -1:], 1)
        return self.counts.by_hour_of_week + smoothing / bins * total

    def interval(self, key: np.uint64, level: float) -> tuple[F64, F64]:
        """Return intervals for the shares, by resampling whole days.

        Minutes of a day depend on each other, days hardly: so days are drawn with replacement, and
        the ends are the quantiles (1 - level) / 2 and (1 + level) / 2 of the resulting shares. With
        fewer than two whole days they are 0 and 1.

        Args:
            key: Key of the stream of random draws.
            level: Probability with which the interval should hold the truth, such as 0.9.

        Returns:
            Lower and upper ends, float64 (users + 1, rooms + 1) each, away last.
        """
        days = self.counts.weighted_days
        shape = (self.users + 1, self.rooms + 1)
        if len(days) < MIN_DAYS:
            return np.zeros(shape), np.ones(shape)
        sums = resampled(key, days.reshape(len(days), -1), REPLICATES)
        home, away = self.shares(sums.reshape(REPLICATES, *self.counts.shape))
        places = np.concatenate([home, away[..., None]], axis=-1)
        values = np.sort(places, axis=0, kind="stable")
        cut = min(int((1 - level) / 2 * REPLICATES), (REPLICATES - 1) // 2)
        return values[cut], values[REPLICATES - 1 - cut]

    def remember(self) -> dict[str, Any]:
        """Return the learned state, as arrays in mappings."""
        return {"counts": self.counts.remember()}

    def recall(self, learned: Mapping[str, Any], today: int) -> None:
        """Restore what `remember` returned; called after `begin`.

        Args:
            learned: The learned state.
            today: Ordinal of the day that begins.

        Raises:
            ComponentError: It was learned with other rooms or users, or by another estimator.
        """
        shape = np.asarray(learned.get("counts", {}).get("over", ())).shape
        if shape != self.counts.shape:
            raise ComponentError(
                f"the learned state has sums of shape {shape}, expected {self.counts.shape} for the"
                f" users and rooms of this run: take one that {self.type_name} learned in this home"
                " with these users, or start without one"
            )
        self.counts.recall(learned["counts"], today)


def ratio(part: F64, whole: F64) -> F64:
    """Return parts of wholes as shares of them; 0 where the whole is zero."""
    is_some = whole > 0
    return np.where(is_some, part / np.where(is_some, whole, 1), 0.0)


def normalized(weights: F64) -> F64:
    """Divide weights by their sum over the last axis; uniform where that is zero.

    Example:
        >>> normalized(np.array([[3.0, 1.0], [0.0, 0.0]])).tolist()
        [[0.75, 0.25], [0.5, 0.5]]
    """
    total = weights.sum(axis=-1, keepdims=True)
    return np.where(total > 0, weights / np.where(total > 0, total, 1), 1 / weights.shape[-1])


def natural_log(values: ArrayLike) -> F64:
    """Return natural logarithms of numbers above 0, by series: to 3 units in the last place.

    Of m 2^e with m from sqrt(1/2) to sqrt(2), it is e ln 2 + 2 artanh((m - 1) / (m + 1)).

    Example:
        >>> natural_log([1.0, 10.0]).round(12).tolist()
        [0.0, 2.302585092994]
    """
    mantissa, exponent = np.frexp(np.asarray(values, np.float64))
    low = mantissa < ROOT_HALF
    m = np.where(low, 2 * mantissa, mantissa)
    e = np.where(low, exponent - 1, exponent)
    s = (m - 1) / (m + 1)
    square = s * s
    series = np.zeros_like(s)
    for k in range(TERMS, -1, -1):
        series = series * square + 1 / (2 * k + 1)
    return e * LN_2 + 2 * s * series


class SightingShare(Estimator):
    """Share of a user's sightings in each room: n_r / sum of n.

    n_r is the number of steps at which the user was perceived in room r. Away is the share of the
    bins with a view of any room in which the user was not perceived at all: sightings alone can't
    distinguish a user who is away from one who wasn't found, so that is far too high.

    It is right when every room is watched equally. It fails under feedback: a robot that goes to
    the rooms where it saw somebody sees somebody there even more often, until one room has all.

    Without any sighting all rooms are equal, and nobody is away until a room was watched.
    """

    def width(self, rooms: int) -> int:
        """Return the number of columns of `sums`: one for each room, and three counts of bins."""
        return rooms + 3

    def sums(self, evidence: Evidence) -> F64:
        """Return sightings per room, then bins: watched, watched without a sighting, and all."""
        seen = evidence.seen.astype(np.float64)
        is_seen = np.any(seen > 0, axis=2)
        has_view = np.any(evidence.watched > 0, axis=1)[:, np.newaxis] | is_seen
        bins = np.stack([has_view, has_view & ~is_seen, np.ones_like(is_seen)], axis=-1)
        return np.concatenate([seen, bins], axis=-1)

    def shares(self, sums: F64) -> tuple[F64, F64]:
        """Return sightings per room by all, and bins without a sighting by bins with a view."""
        return normalized(sums[..., :-3]), ratio(sums[..., -2], sums[..., -3])


def array_of(
    learned: Mapping[str, Any],
    name: str,
    shape: tuple[int, ...],
    kind: type[np.generic] = np.float64,
    max_value: float = 1e300,
) -> NDArray[Any]:
    """Return a copy of an array of a learned state.

    Args:
        learned: The learned state.
        name: Name of the array.
        shape: The shape it must have; -1 for any length above 0.
        kind: Type of the returned array.
        max_value: The largest absolute value allowed.

    Raises:
        ComponentError: It is missing, of another shape, or not of finite numbers.
    """
    array = np.asarray(learned.get(name, ()))
    fits = array.ndim == len(shape) and all(
        size == expected or expected < 0 < size
        for size, expected in zip(array.shape, shape, strict=True)
    )
    if not fits or array.dtype.kind not in "biuf" or not (np.abs(array) <= max_value).all():
        raise ComponentError(
            f"the learned state lacks a numeric array {name!r} of shape {shape}: it is damaged, or"
            " from another home, other users or another estimator"
        )
    return np.array(array, kind)
