"""The base of estimators of long-term presence."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from fleet2d.algorithms.presence.belief import Presence, WeeklyPresence
from fleet2d.algorithms.presence.counts import Bins, DayCounts
from fleet2d.configuration.components import Component
from fleet2d.errors import ComponentError
from fleet2d.kernels import F64
from fleet2d.kernels.presence import resampled

REPLICATES = 200  # of the bootstrap
FEWEST_DAYS = 2  # fewest days that say anything about how much days differ


class Estimator(Component):
    """Base of estimators of presence from evidence; a subclass writes `sums` and `shares`.

    `sums` turns each bin of evidence into numbers that add up over bins, and `shares` turns such
    sums into shares. All variants follow from these two: over all time, by hour of the week, with
    forgetting, and intervals by resampling days.
    """

    kind: ClassVar[str] = "presence_estimator"
    has_interval: ClassVar[bool] = True  # whether its output is `shares` of the sum of all days

    def begin(self, rooms: int, users: int, half_life: float | None = None) -> None:
        """Prepare for a run.

        Args:
            rooms: Number of rooms.
            users: Number of users.
            half_life: Days after which a day counts half; None: all days count equally.
        """
        self.rooms, self.users = rooms, users
        self.counts = DayCounts((users + 1, self.width(rooms)), half_life)

    def width(self, rooms: int) -> int:
        """Return the number of columns of `sums` for each user."""
        raise NotImplementedError

    def sums(self, bins: Bins) -> F64:
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

    def observe(self, bins: Bins) -> None:
        """Add the next bins of evidence."""
        sums = np.asarray(self.sums(bins))
        expected = (len(bins.day), self.users + 1, self.width(self.rooms))
        if sums.shape != expected:
            raise ComponentError(
                f"{type(self).__name__}.sums returned an array of shape {sums.shape}, expected"
                f" {expected}: bins, users + 1, and width({self.rooms})"
                f"{_source_line(type(self))}"
            )
        self.counts.add(bins.day, bins.minute, sums)

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
        if len(days) < FEWEST_DAYS:
            return np.zeros(shape), np.ones(shape)
        sums = resampled(key, days.reshape(len(days), -1), REPLICATES)
        home, away = self.shares(sums.reshape(REPLICATES, *self.counts.shape))
        values = np.sort(np.concatenate([home, away[..., None]], axis=-1), axis=0, kind="stable")
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


def _source_line(cls: type[Estimator]) -> str:
    """Return the file and line of a class's `sums`, for messages."""
    code = cls.sums.__code__
    return f" ({Path(code.co_filename).name}:{code.co_firstlineno}, in sums)"


def normalized(weights: F64) -> F64:
    """Divide weights by their sum over the last axis; uniform where that is zero.

    Example:
        >>> normalized(np.array([[3.0, 1.0], [0.0, 0.0]])).tolist()
        [[0.75, 0.25], [0.5, 0.5]]
    """
    total = weights.sum(axis=-1, keepdims=True)
    return np.where(total > 0, weights / np.where(total > 0, total, 1), 1 / weights.shape[-1])
