"""Logistic: the probability of a yes as a sum of hour and room, used greedily or nearly so."""

import numpy as np
from pydantic import Field

from fleet2d.algorithms.timing.timing import HOURS, Asked, TimingPolicy
from fleet2d.configuration.components import register
from fleet2d.configuration.units import Share
from fleet2d.kernels import F64
from fleet2d.runtime.determinism import logistic


@register("timing_policy", "logistic")
class LogisticTiming(TimingPolicy):
    """Ask where the probability of a yes, by logistic regression, is high enough.

    Without exploration it is greedy: an hour with an unlucky first answer is never tried again, so
    that it never learns better.

    Attributes:
        ask_at: Minimum probability of a yes at which it asks.
        explore: Probability of asking nevertheless.
        rate: Learning rate of the gradient steps.
    """

    ask_at: Share = 0.5
    explore: Share = 0.0
    rate: float = Field(default=0.5, gt=0, le=10)

    def start(self, rooms: int) -> None:
        """Begin with even odds, slightly in favor."""
        super().start(rooms)
        self.base, self.by_hour, self.by_room = 0.5, np.zeros(HOURS), np.zeros(rooms)

    def _logit(self, hour: int, room: int) -> float:
        by_room = float(self.by_room[room]) if room >= 0 else 0.0
        return float(self.base) + float(self.by_hour[hour]) + by_room

    def learn(self, asked: Asked) -> None:
        """Make a step along the gradient of the log likelihood; neighboring hours share half."""
        step = self.rate * (asked.was_accepted - logistic(self._logit(asked.hour, asked.room)))
        self.base += step / 4
        for hour, part in ((-1, 0.5), (0, 1.0), (1, 0.5)):
            self.by_hour[(asked.hour + hour) % HOURS] += part * step
        if asked.room >= 0:
            self.by_room[asked.room] += step

    def chances(self) -> F64:
        """Return 1 where a yes is likely, else the probability of exploring."""
        likely = [
            [logistic(self._logit(hour, room)) >= self.ask_at for room in range(self.rooms)]
            for hour in range(HOURS)
        ]
        return np.where(likely, 1.0, self.explore)
