"""Guest: a person who stays out of the home until a script lets them in."""

from datetime import datetime

from fleet2d.configuration.components import register
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
