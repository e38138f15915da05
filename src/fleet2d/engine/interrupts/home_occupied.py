"""The first person comes home."""

from fleet2d.configuration.components import register
from fleet2d.engine.interrupts.interrupt import Interrupt, SpanView
from fleet2d.kernels import Bool


@register("interrupt", "home_occupied")
class HomeOccupied(Interrupt):
    """Somebody has come home to an empty home, as a robot may learn from everyone's phones."""

    def holds(self, span: SpanView) -> Bool:
        """Return at which steps somebody is at home."""
        home: Bool = (span.poses.away[: span.users] == 0).any(axis=0)
        return home
