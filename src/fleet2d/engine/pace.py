"""Running at a multiple of real time."""

import time
from collections.abc import Callable


class Pace:
    """Slows a run down to `speedup` times real time, by sleeping when it is ahead.

    Example:
        >>> pace = Pace(speedup=1000.0)
        >>> pace.slice_s  # simulated seconds between two looks at the clock
        50.0
    """

    # Wall time between two looks at the clock: short for a viewer, long enough to cost nothing [s].
    LOOK_S = 0.05
    # The longest single sleep: Ctrl-C takes effect after it [s].
    NAP_S = 0.1

    def __init__(self, speedup: float) -> None:
        self.speedup = speedup
        self.slice_s = speedup * self.LOOK_S
        self._began = time.perf_counter()

    def steps(self, step_us: int) -> int:
        """Return how many steps may be simulated between two looks at the clock."""
        return max(1, int(self.slice_s * 1e6 / step_us))

    def resume(self, simulated_s: float) -> None:
        """Continue after a pause, as if no time had passed since `simulated_s`."""
        self._began = max(self._began, time.perf_counter() - simulated_s / self.speedup)

    def hold(self, simulated_s: float, stop: Callable[[], bool] = lambda: False) -> None:
        """Sleep until `simulated_s` of simulated time are due, or until `stop` returns True."""
        due = self._began + simulated_s / self.speedup
        while (ahead := due - time.perf_counter()) > 0 and not stop():
            time.sleep(min(ahead, self.NAP_S))

    def speedup_until(self, simulated_s: float) -> float:
        """Return the real speedup of the run so far."""
        return simulated_s / max(1e-9, time.perf_counter() - self._began)
