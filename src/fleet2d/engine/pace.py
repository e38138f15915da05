"""Running at a multiple of real time."""

import time


class Pace:
    """Holds a run at `speedup` times real time, by sleeping when it is ahead.

    Example:
        >>> pace = Pace(speedup=1000.0)
        >>> pace.slice_s  # simulated seconds between two looks at the clock
        50.0
    """

    # Wall time between two looks at the clock: short enough to watch, long enough to cost nothing.
    LOOK_S = 0.05

    def __init__(self, speedup: float) -> None:
        self.speedup = speedup
        self.slice_s = speedup * self.LOOK_S
        self._began = time.perf_counter()

    def resume(self, simulated_s: float) -> None:
        """Go on after a pause, as if no time had passed since `simulated_s`."""
        self._began = max(self._began, time.perf_counter() - simulated_s / self.speedup)

    def hold(self, simulated_s: float) -> None:
        """Sleep until `simulated_s` of simulated time are due."""
        ahead = self._began + simulated_s / self.speedup - time.perf_counter()
        if ahead > 0:
            time.sleep(ahead)

    def reached(self, simulated_s: float) -> float:
        """Return the factor reached over the whole run so far."""
        return simulated_s / max(1e-9, time.perf_counter() - self._began)
