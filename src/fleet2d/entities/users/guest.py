"""Guest: a person who is out of the home until a script lets the person come."""

from datetime import datetime

from fleet2d.configuration.components import register
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.plan import Plan


@register("behavior", "guest")
class Guest(Behavior):
    """Stay out of the home; a person who is in it leaves by the way out.

    An intervention `guest` lets the person come.
    """

    def begins_at(self, time: datetime) -> tuple[()]:
        """Return (): the person is away at first."""
        return ()

    def decide(self, now: Situation) -> Plan:
        """Leave, and stay away."""
        return now.plan().leave_home().stay()
