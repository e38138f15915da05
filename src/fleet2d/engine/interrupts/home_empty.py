"""The last person leaves the home."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.component import register
from fleet2d.engine.interrupts.interrupt import Interrupt, SpanView


@register("interrupt", "home_empty")
class HomeEmpty(Interrupt):
    """The last person has left the home, as the phones of all people may tell a robot."""

    def holds(self, span: SpanView) -> NDArray[np.bool_]:
        """Return at which steps all people are away."""
        away: NDArray[np.bool_] = (span.poses.away[: span.users] != 0).all(axis=0)
        return away
