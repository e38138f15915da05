"""Simulated time: steps of one length from a start; times are integer microseconds since then."""

from dataclasses import dataclass
from datetime import datetime, time, timedelta
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels import I64

if TYPE_CHECKING:
    from fleet2d.runtime.sun import Sun

MICROSECOND = timedelta(microseconds=1)
HOUR_S = 60 * 60
DAY_S = 24 * HOUR_S
DAY_MINUTES = 24 * 60
HOUR_US = HOUR_S * 1_000_000
DAY_US = DAY_S * 1_000_000


@dataclass(frozen=True)
class Clock:
    """The steps of a run: step k is the moment k * step_us after the start.

    Attributes:
        start: Local time of step 0, without time zone: a simulated day always has 24 hours.
        step_us: Length of a step [us].
        steps: Number of steps; the last is steps - 1.
        sun: The sun over the home; None: it doesn't matter.

    Example:
        >>> clock = Clock(datetime(2026, 1, 5), step_us=1_000_000, steps=3600)
        >>> clock.time(90).isoformat()
        '2026-01-05T00:01:30'
        >>> clock.step_at_or_after(1_500_000)
        2
    """

    start: datetime
    step_us: int
    steps: int
    sun: "Sun | None" = None

    def time(self, step: int) -> datetime:
        """Return the local time of a step."""
        return self.start + step * self.step_us * MICROSECOND

    def times(self, steps: I64) -> NDArray[np.datetime64]:
        """Return the local times of steps, datetime64[us]."""
        return self.moments(steps * self.step_us)

    def moments(self, elapsed_us: I64) -> NDArray[np.datetime64]:
        """Return the local times of moments given in microseconds since the start."""
        return np.datetime64(self.start, "us") + elapsed_us.astype("m8[us]")

    def elapsed(self, moment: datetime) -> int:
        """Return the microseconds from the start to a local time; negative before the start."""
        return (moment - self.start) // MICROSECOND

    def step_at_or_after(self, elapsed_us: int) -> int:
        """Return the first step that is not before a moment [us since the start]."""
        return -(-elapsed_us // self.step_us)


def midnight_of(moment: datetime) -> datetime:
    """Return the midnight that begins the day of a moment."""
    return datetime.combine(moment.date(), time())
