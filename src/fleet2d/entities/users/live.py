"""Live: a body that is moved by what arrives from outside while the run goes on."""

from fleet2d.configuration.components import register
from fleet2d.configuration.units import PeerAddress
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.plan import Plan


@register("behavior", "live")
class Live(Behavior):
    """Be where a real person or robot is, or go where another program says: see `fleet2d live`.

    What arrives is an intervention: `put` for a pose, `send` for a goal. Until something arrives,
    and when nothing does any more, the body stands.

    Attributes:
        source: The other program whose messages it takes, such as ws://127.0.0.1:8765, which
            `fleet2d live` opens; left out: any of `--with`.
    """

    source: PeerAddress | None = None

    def decide(self, now: Situation) -> Plan:
        """Stand."""
        return now.plan().stay()
