"""Unknown: a person of a real home whom robots detect, but whose place nobody recorded."""

from typing import ClassVar

from fleet2d.configuration.components import register
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.plan import Plan


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
