"""What is done to algorithms: reset, replace."""

from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from fleet2d.algorithms.output import FROZEN, WITHHELD, RoomDistribution
from fleet2d.component import register
from fleet2d.errors import ScenarioError
from fleet2d.interventions.intervention import Intervention, Lasting
from fleet2d.interventions.world import World
from fleet2d.problems import did_you_mean, problem
from fleet2d.units import InputPath


@register("intervention", "reset")
class Reset(Intervention):
    """Let an algorithm forget what it has learned, or go on from what another run has learned.

    Its newest output stands until it is updated next.
    """

    subject: ClassVar[str] = "algorithm"
    algorithm: str = Field(description="the algorithm")
    learned: InputPath | None = Field(
        default=None, description="a file of the folder learned/ of another run; left out: nothing"
    )

    def check(self, world: World) -> None:
        """Refuse an algorithm that there isn't."""
        check_algorithm(world, self.algorithm)

    def begin(self, world: World) -> None:
        """Begin anew."""
        world.reset(self.algorithm, self.learned)


@register("intervention", "replace")
class Replace(Lasting):
    """Let behaviors and other algorithms read something else of an algorithm for a while.

    The algorithm itself goes on, and its tables and metrics show what it puts out.
    """

    subject: ClassVar[str] = "algorithm"
    algorithm: str = Field(description="the algorithm")
    rooms: dict[str, float] = Field(
        default={}, description="weights of rooms; those left out have none", min_length=0
    )
    values: dict[str, float | str] = Field(
        default={}, description="or numbers and texts by name, as of an output that is a mapping"
    )
    frozen: bool = Field(default=False, description="or its newest output, as it is then")
    withheld: bool = Field(default=False, description="or nothing, as before its first output")

    @model_validator(mode="after")
    def _is_one_output(self) -> Self:
        if sum(map(bool, (self.rooms, self.values, self.frozen, self.withheld))) != 1:
            raise problem("one of 'rooms', 'values', 'frozen: true', 'withheld: true' is wanted")
        if any(weight < 0 for weight in self.rooms.values()):
            raise problem("a weight of a room is 0 or more")
        return self

    def check(self, world: World) -> None:
        """Refuse an algorithm or rooms that there aren't."""
        check_algorithm(world, self.algorithm)
        known = [room.name for room in world.home.rooms]
        for room in self.rooms:
            if room not in known:
                raise ScenarioError(
                    f"there is no room {room!r}{did_you_mean(room, known)}"
                    f" The rooms are: {', '.join(known)}"
                )

    def begin(self, world: World) -> None:
        """Let it be read."""
        world.replace(self.algorithm, self._output(world))

    def end(self, world: World) -> None:
        """Let be read what began before and isn't over, else what it puts out."""
        others = (
            act
            for act in reversed(world.lasting)
            if isinstance(act, Replace) and act.algorithm == self.algorithm
        )
        other = next(others, None)
        world.replace(self.algorithm, None if other is None else other._output(world))

    def _output(self, world: World) -> Any:
        if self.rooms:
            return RoomDistribution([self.rooms.get(room.name, 0.0) for room in world.home.rooms])
        return dict(self.values) or (FROZEN if self.frozen else WITHHELD)


def check_algorithm(world: World, name: str) -> None:
    """Refuse an algorithm that there isn't.

    Raises:
        ScenarioError: Says which there are.
    """
    known = world.algorithms
    if name not in known:
        raise ScenarioError(
            f"there is no algorithm {name!r}{did_you_mean(name, known)}"
            f" There are: {', '.join(known) or 'none'}"
        )
