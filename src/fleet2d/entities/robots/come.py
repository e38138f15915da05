"""Come: go where a user or an app calls the robot to, and wait there."""

from datetime import timedelta
from typing import ClassVar

import numpy as np

from fleet2d.configuration.components import register
from fleet2d.configuration.units import Duration
from fleet2d.entities.behavior import Actor, Behavior, Command, Situation
from fleet2d.entities.place import avoided_rooms, lies_in, stop_at
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import centres

# How far from a room that it doesn't enter it waits, so that others can pass the door [m].
OFF_DOOR_M = 0.8


@register("behavior", "come")
class Come(Behavior):
    """Go where the robot is called to, and wait there for a while.

    It only acts on an intervention `call` with a place. In a room it stops at the point farthest
    from the walls. If a shut door is in the way, it waits and tries again. Event: `visits`, with
    the place.

    Attributes:
        stay: How long it waits there.
        avoid: Rooms, or kinds of rooms if the home has them, that it doesn't enter: called into one
            of them, it waits outside, near the door.
    """

    records: ClassVar[frozenset[str]] = frozenset({"visits"})
    answers: ClassVar[frozenset[str]] = frozenset({"come"})
    resumes: ClassVar[bool] = True

    stay: Duration = timedelta(minutes=10)
    avoid: tuple[str, ...] = ()

    def start(self, actor: Actor) -> None:
        """Start without a command."""
        self.avoided = avoided_rooms(actor, "come.avoid", self.avoid)
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
        goal = self._outside(now.actor, stop_at(now.actor, self.command.place))
        plan = now.plan().go_to_point(*goal).note("visits", self.command.text.partition(" ")[2])
        self.command = None
        return plan.stay(self.stay)

    def _outside(self, actor: Actor, goal: tuple[int, int]) -> tuple[int, int]:
        """Return a goal, or where the robot waits for it if that is in a room it doesn't enter."""
        if not lies_in(actor, goal, self.avoided):
            return goal
        space = actor.space_without(self.avoided)
        cells = centres(space.cells(None, space.part_near(actor.state.x, actor.state.y)))
        metres = actor.space.distances(goal, cells)
        if not np.isfinite(metres).any():
            return goal  # behind a shut door: there is no way at present
        x, y = cells[np.abs(metres - metres.min() - OFF_DOOR_M).argmin()].tolist()
        return x, y
