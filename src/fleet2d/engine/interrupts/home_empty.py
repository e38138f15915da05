"""The last person leaves the home."""

from fleet2d.configuration.components import register
from fleet2d.engine.interrupts.interrupt import Interrupt, SpanView
from fleet2d.kernels import Bool


@register("interrupt", "home_empty")
class HomeEmpty(Interrupt):
    """The last person has left the home, as a robot may learn from everyone's phones."""

    def holds(self, span: SpanView) -> Bool:
        """Return at which steps all people are away."""
        away: Bool = (span.poses.away[: span.users] != 0).all(axis=0)
        return away
