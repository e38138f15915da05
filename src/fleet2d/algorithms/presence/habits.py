"""Habits: how somebody goes on by the hour, as far as time is spent elsewhere then."""

from typing import NamedTuple

import numpy as np

from fleet2d.algorithms.presence.estimator import F64
from fleet2d.kernels.stays import Ways

WEEKEND = 5  # its first day, Monday being 0
FEWEST = 1440  # bins, below which nothing is known of hours
MOST = 20.0  # times as often, or as seldom
LEAST = 1e-9
LEAVE = 0.5  # chance a bin to leave, at most, where it wasn't more already


class Habits(NamedTuple):
    """What was learned of each hour of the week.

    Attributes:
        week: float64 (168, rooms + 2), bins in each room, away, and all, from Monday 00:00.
        total: float64 (rooms + 2,), the same of all time.
        smoothing: Bins of average evidence that each hour is given beforehand.
    """

    week: F64
    total: F64
    smoothing: float

    def at(self, ways: Ways, weekday: int, hour: int) -> Ways:
        """Return how somebody goes on at an hour.

        With c the share of time in each place at that hour of working days, or of weekends, by
        that of all time, from 1/20 to 20, who would go from i to j with chance T_ij goes with
        T_ij sqrt(c_j / c_i). If T alone leads to the shares of all time, reversibly, this leads to
        those of the hour: p_i c_i T_ij sqrt(c_j / c_i) = p_i T_ij sqrt(c_i c_j) is as much there as
        back.

        Args:
            ways: How somebody goes on at any time.
            weekday: 0 is Monday.
            hour: Of the day.
        """
        if self.total[-1] < FEWEST:
            return ways
        days = self.week.reshape(7, 24, -1)[:, hour]
        alike = days[:WEEKEND] if weekday < WEEKEND else days[WEEKEND:]
        then = alike.sum(axis=0) + self.smoothing / self.total[-1] * self.total
        usual, now = self.total[:-1] / self.total[-1], then[:-1] / then[-1]
        ratio = np.maximum(now, LEAST) / np.maximum(usual, LEAST)
        drawn = np.sqrt(np.clip(ratio, 1 / MOST, MOST))
        places = len(drawn)
        leave = (1 - ways.stay)[:, np.newaxis] * ways.follow
        leave[:, :places] *= drawn / np.repeat(drawn, len(ways.stay) // places)[:, np.newaxis]
        chance = np.zeros(len(leave))
        for column in leave.T:  # in one order on every machine
            chance += column
        follow = leave / np.maximum(chance, LEAST)[:, np.newaxis]
        most = np.maximum(1 - ways.stay, LEAVE)
        return ways._replace(stay=1 - np.minimum(chance, most), follow=follow)
