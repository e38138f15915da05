"""Come: go where a user or an app calls the robot to, and wait there."""

from datetime import timedelta
from typing import ClassVar

from fleet2d.configuration.components import register
from fleet2d.configuration.units import Duration
from fleet2d.entities.behavior import Actor, Behavior, Command, Situation
from fleet2d.entities.place import stop_at
from fleet2d.entities.plan import Plan


@register("behavior", "come")
class Come(Behavior):
    """Go where the robot is called to, and wait there for a while.

    It only acts on an intervention `call` with a place. In a room it stops at the point farthest
    from the walls. If a shut door is in the way, it waits and tries again. Event: `visits`, with
    the place.

    Attributes:
        stay: How long it waits there.
    """

    records: ClassVar[frozenset[str]] = frozenset({"visits"})
    answers: ClassVar[frozenset[str]] = frozenset({"come"})
    resumes: ClassVar[bool] = True

    stay: Duration = timedelta(minutes=10)

    def start(self, actor: Actor) -> None:
        """Start without a command."""
        self.command: Command | None = None

    def busy(self) -> bool:
        """Return whether it is on its way."""
        return self.command is not None

    def dismiss(self) -> None:
        """Stay away from where it was called to."""
        self.command = None

    def decide(self, now: Situation) -> Plan | None:
        """Go where it is called to, if it is."""
        command = now.take_command("come")
        if command is not None:
            self.command = command
        if self.command is None:
            return None
        goal = stop_at(now.actor, self.command.place)
        plan = now.plan().go_to_point(*goal).note("visits", self.command.text.partition(" ")[2])
        self.command = None
        return plan.stay(self.stay)
