"""The first person comes home."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.component import register
from fleet2d.engine.interrupts.interrupt import Interrupt, SpanView


@register("interrupt", "home_occupied")
class HomeOccupied(Interrupt):
    """Somebody has come home while nobody was there, as the phones of people may tell a robot."""

    def holds(self, span: SpanView) -> NDArray[np.bool_]:
        """Return at which steps somebody is at home."""
        home: NDArray[np.bool_] = (span.poses.away[: span.users] == 0).any(axis=0)
        return home
