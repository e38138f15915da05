"""Interventions on algorithms: their learned states, and the outputs that others read."""

from typing import Any

from pydantic import Field

from fleet2d.algorithms.algorithm import FROZEN, WITHHELD, RoomDistribution
from fleet2d.configuration.problems import check_known, problem
from fleet2d.configuration.units import InputPath
from fleet2d.errors import ComponentError, InputError, errors_as
from fleet2d.interventions.intervention import Intervention, Lasting, World


class ResetAlgorithm(Intervention):
    """Let an algorithm forget what it has learned, or load what another run has learned.

    Its present output remains until its next update.

    Attributes:
        algorithm: The algorithm.
        learned: Learned state to load, a file of the folder learned/ of another run; left out: the
            algorithm starts without any.

    Example:
        >>> ResetAlgorithm("ltp").algorithm
        'ltp'
    """

    subject = "algorithm"
    algorithm: str
    learned: InputPath | None = None

    def check(self, world: World) -> None:
        """Refuse an unknown algorithm."""
        check_known(self.algorithm, "algorithm", world.algorithms)

    def begin(self, world: World) -> None:
        """Restart the algorithm.

        Raises:
            InputError: The algorithm can't use the file, for example one from another home.
        """
        with errors_as(InputError, f"learned: {self.learned}", of=ComponentError):
            world.reset(self.algorithm, self.learned)


class ReplaceOutput(Lasting):
    """Let behaviors and other algorithms read another output of an algorithm for a while.

    The algorithm itself continues, and its tables and metrics show its real output.

    Attributes:
        algorithm: The algorithm.
        rooms: Weights of rooms; 0 for those left out.
        values: Numbers and texts by name, for an output that is a mapping.
        frozen: Whether the output at that step remains.
        withheld: Whether there is no output, as before the first one.

    Example:
        >>> ReplaceOutput("ltp", rooms={"kitchen_1": 1}).rooms
        {'kitchen_1': 1.0}
    """

    subject = "algorithm"
    algorithm: str
    rooms: dict[str, float] = Field(default={}, min_length=0)
    values: dict[str, float | str] = Field(default={})
    frozen: bool = False
    withheld: bool = False

    def model_post_init(self, _: object, /) -> None:
        """Require exactly one replacement, without negative weights."""
        if sum(map(bool, (self.rooms, self.values, self.frozen, self.withheld))) != 1:
            raise problem(
                "give exactly one of 'rooms', 'values', 'frozen: true' and 'withheld: true'"
            )
        for room, weight in self.rooms.items():
            if weight < 0:
                raise problem(f"rooms.{room}: weight {weight:g} is negative")

    def check(self, world: World) -> None:
        """Refuse an unknown algorithm or room."""
        check_known(self.algorithm, "algorithm", world.algorithms)
        for room in self.rooms:
            check_known(room, "room", [room.name for room in world.home.rooms])

    def begin(self, world: World) -> None:
        """Apply the latest replacement that is active; if there is none, return to the output."""
        active = self.active(world)
        world.replace(self.algorithm, active[-1]._output(world) if active else None)

    def _output(self, world: World) -> Any:
        if self.rooms:
            return RoomDistribution([self.rooms.get(room.name, 0.0) for room in world.home.rooms])
        return dict(self.values) or (FROZEN if self.frozen else WITHHELD)
