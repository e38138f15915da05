"""Fixed times: address people in some hours of the day, whatever they answer."""

import numpy as np
from pydantic import Field

from fleet2d.algorithms.timing.timing import HOURS, TimingPolicy
from fleet2d.configuration.components import register
from fleet2d.kernels import F64


@register("timing_policy", "fixed_times")
class FixedTimes(TimingPolicy):
    """Address people in some hours, in any room.

    Attributes:
        hours: The hours of the day, 0 to 23; left out: all.
    """

    hours: tuple[int, ...] = Field(default=tuple(range(HOURS)))

    def chances(self) -> F64:
        """Return 1 in these hours, else 0."""
        chances = np.zeros((HOURS, self.rooms))
        chances[list(self.hours)] = 1
        return chances
