"""Interventions on algorithms: what they have learned, and what others read of them."""

from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from fleet2d.algorithms.algorithm import FROZEN, WITHHELD, RoomDistribution
from fleet2d.configuration.components import register
from fleet2d.configuration.problems import problem, suggest
from fleet2d.configuration.units import InputPath
from fleet2d.errors import ScenarioError
from fleet2d.interventions.intervention import Intervention, Lasting, World


@register("intervention", "reset")
class Reset(Intervention):
    """Let an algorithm forget what it has learned, or load what another run has learned.

    Its present output remains until its next update.

    Attributes:
        algorithm: The algorithm.
        learned: Learned state to load, a file of the folder learned/ of another run; left out: the
            algorithm starts without any.
    """

    subject: ClassVar[str] = "algorithm"
    algorithm: str
    learned: InputPath | None = None

    def check(self, world: World) -> None:
        """Refuse an unknown algorithm."""
        check_algorithm(world, self.algorithm)

    def begin(self, world: World) -> None:
        """Restart the algorithm."""
        world.reset(self.algorithm, self.learned)


@register("intervention", "replace")
class Replace(Lasting):
    """Let behaviors and other algorithms read another output of an algorithm for a while.

    The algorithm itself continues, and its tables and metrics show its real output.

    Attributes:
        algorithm: The algorithm.
        rooms: Weights of rooms; 0 for those left out.
        values: Numbers and texts by name, for an output that is a mapping.
        frozen: Whether its output at that step remains.
        withheld: Whether there is no output, as before the first one.
    """

    subject: ClassVar[str] = "algorithm"
    algorithm: str
    rooms: dict[str, float] = Field(default={}, min_length=0)
    values: dict[str, float | str] = Field(default={})
    frozen: bool = False
    withheld: bool = False

    @model_validator(mode="after")
    def _is_one_output(self) -> Self:
        if sum(map(bool, (self.rooms, self.values, self.frozen, self.withheld))) != 1:
            raise problem(
                "give exactly one of 'rooms', 'values', 'frozen: true' and 'withheld: true'"
            )
        for room, weight in self.rooms.items():
            if weight < 0:
                raise problem(f"rooms.{room}: weight {weight:g} is negative")
        return self

    def check(self, world: World) -> None:
        """Refuse an unknown algorithm or room."""
        check_algorithm(world, self.algorithm)
        names = [room.name for room in world.home.rooms]
        for room in self.rooms:
            if room not in names:
                raise ScenarioError(f"there is no room {room!r}{suggest(room, names)}")

    def begin(self, world: World) -> None:
        """Replace the output."""
        world.replace(self.algorithm, self._output(world))

    def end(self, world: World) -> None:
        """Return to the latest intervention that is still active, else to the real output."""
        active = (
            act
            for act in reversed(world.lasting)
            if isinstance(act, Replace) and act.algorithm == self.algorithm
        )
        latest = next(active, None)
        world.replace(self.algorithm, None if latest is None else latest._output(world))

    def _output(self, world: World) -> Any:
        if self.rooms:
            return RoomDistribution([self.rooms.get(room.name, 0.0) for room in world.home.rooms])
        return dict(self.values) or (FROZEN if self.frozen else WITHHELD)


def check_algorithm(world: World, name: str) -> None:
    """Refuse an unknown algorithm.

    Raises:
        ScenarioError: There is no such algorithm; the message lists those that there are.
    """
    if name not in world.algorithms:
        raise ScenarioError(f"there is no algorithm {name!r}{suggest(name, world.algorithms)}")
