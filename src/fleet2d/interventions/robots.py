"""What is done to robots: call."""

from typing import Self

from pydantic import Field, model_validator

from fleet2d.component import register
from fleet2d.entities.behavior import Command
from fleet2d.entities.place import Place
from fleet2d.errors import ScenarioError
from fleet2d.events import EventKind
from fleet2d.interventions.bodies import check_reach
from fleet2d.interventions.intervention import Intervention, robot
from fleet2d.interventions.world import World
from fleet2d.problems import problem

# The behaviors of Fleet2D that answer.
ANSWERS = {"come": "come", "find": "find", "dock": "dock"}


class OfRobot(Intervention):
    """Base of what is done to a robot."""

    entity: str = Field(description="the robot")

    def check(self, world: World) -> None:
        """Refuse a robot that there isn't."""
        robot(world, self.entity)


@register("intervention", "call")
class Call(OfRobot):
    """Call a robot, as a user or an app does: to a place, to find somebody, or to dock.

    The first of its behaviors that answers takes the call up: at once, or when the behaviors before
    it leave the robot to it. A later call replaces one that still waits. Event: `called`.
    """

    to: Place | None = Field(default=None, description="come there: behavior `come`")
    find: str | None = Field(default=None, description="find this person: behavior `find`")
    dock: bool = Field(default=False, description="go to the charger: behavior `dock`")
    command: str | None = Field(
        default=None, min_length=1, description="a word that a behavior of your own answers to"
    )

    @model_validator(mode="after")
    def _is_one_command(self) -> Self:
        wanted = (self.to is not None, self.find is not None, self.dock, self.command is not None)
        if sum(wanted) != 1:
            raise problem("one of 'to', 'find', 'dock: true' and 'command' is wanted")
        return self

    @property
    def meaning(self) -> Command:
        """What the robot is called to do."""
        if self.to is not None:
            return Command("come", place=self.to)
        if self.find is not None:
            return Command("find", self.find)
        return Command(self.command or "dock")

    def check(self, world: World) -> None:
        """Refuse a call that none of its behaviors answers."""
        actor, command = robot(world, self.entity), self.meaning
        if self.to is not None:
            check_reach(actor, self.to)
        if not any(behavior.takes(command) for behavior in actor.behaviors):
            kind = ANSWERS.get(command.do)
            hint = f": give it one, like behaviors: [{{type: {kind}}}, …]" if kind else ""
            raise ScenarioError(
                f"none of the behaviors of {self.entity} answers the call {command.text!r}{hint}"
            )

    def begin(self, world: World) -> None:
        """Let its behaviors hear of it."""
        command = self.meaning
        world.emit(self.entity, EventKind.CALLED, command.text)
        robot(world, self.entity).hear(command, world.step)
