"""Habits: transition probabilities that depend on the hour of the day."""

from typing import NamedTuple

import numpy as np

from fleet2d.kernels import F64
from fleet2d.kernels.presence import StayModel

WEEKEND = 5  # its first day, Monday being 0
FEWEST_BINS = 1440  # with fewer bins of evidence, hours aren't distinguished
MAX_RATIO = 20.0  # largest ratio, and inverse of the smallest, of an hour's share to the mean share
LEAST = 1e-9
MAX_LEAVE = 0.5  # largest probability per bin to leave, unless it was larger before


class Habits(NamedTuple):
    """Time spent in each place, by hour of the week.

    Attributes:
        week: float64 (168, rooms + 2), bins in each room, away, and all, from Monday 00:00.
        total: float64 (rooms + 2,), the same over all hours.
        smoothing: Bins of average evidence that are added to each hour.
    """

    week: F64
    total: F64
    smoothing: float

    def at(self, model: StayModel, weekday: int, hour: int) -> StayModel:
        """Return the transition probabilities at an hour.

        Let c be the share of time in each place at that hour of working days, or of weekends,
        divided by the share over all hours, clipped to 1/20 … 20. The probability T_ij to go from i
        to j becomes T_ij sqrt(c_j / c_i). If T is reversible and has the overall shares p as its
        stationary distribution, the result has those of the hour: the flow p_i c_i T_ij
        sqrt(c_j / c_i) = p_i T_ij sqrt(c_i c_j) is symmetric.

        Args:
            model: The transition probabilities over all hours.
            weekday: Day of the week, 0 is Monday.
            hour: Hour of the day.
        """
        if self.total[-1] < FEWEST_BINS:
            return model
        days = self.week.reshape(7, 24, -1)[:, hour]
        same_days = days[:WEEKEND] if weekday < WEEKEND else days[WEEKEND:]
        at_hour = same_days.sum(axis=0) + self.smoothing / self.total[-1] * self.total
        mean_share, share = self.total[:-1] / self.total[-1], at_hour[:-1] / at_hour[-1]
        ratio = np.maximum(share, LEAST) / np.maximum(mean_share, LEAST)
        pull = np.sqrt(np.clip(ratio, 1 / MAX_RATIO, MAX_RATIO))
        places = len(pull)
        leave = (1 - model.stay)[:, np.newaxis] * model.follow
        leave[:, :places] *= pull / np.repeat(pull, len(model.stay) // places)[:, np.newaxis]
        chance = np.zeros(len(leave))
        for column in leave.T:  # summed in the same order on every machine
            chance += column
        follow = leave / np.maximum(chance, LEAST)[:, np.newaxis]
        most = np.maximum(1 - model.stay, MAX_LEAVE)
        return model._replace(stay=1 - np.minimum(chance, most), follow=follow)
