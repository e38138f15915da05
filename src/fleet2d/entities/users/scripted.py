"""People whom something else moves: guests of a script, people nobody located, and live bodies."""

from datetime import datetime
from typing import ClassVar

from fleet2d.configuration.components import register
from fleet2d.configuration.units import PeerAddress
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.plan import Plan


@register("behavior", "guest")
class Guest(Behavior):
    """Stay out of the home; leave it through the exit if inside.

    An intervention `guest` lets the person come.
    """

    def begins_at(self, time: datetime) -> tuple[()]:
        """Return (): the person is away at first."""
        return ()

    def decide(self, now: Situation) -> Plan:
        """Leave, and stay away."""
        return now.plan().leave_home().stay()


@register("behavior", "unknown")
class Unknown(Behavior):
    """Be somewhere that nobody recorded, while a real robot's detections are replayed.

    In the simulation the person is away all the time, and nobody sees them; metrics leave out
    what would need their place. Event: `unknown`.
    """

    records: ClassVar[frozenset[str]] = frozenset({"unknown"})

    def decide(self, now: Situation) -> Plan:
        """Be away, without having walked out."""
        return now.plan().jump(now.step * now.actor.clock.step_us, away=1).note("unknown").stay()


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
