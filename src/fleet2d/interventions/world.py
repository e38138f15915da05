"""The interface of a run that interventions read and change."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol

from fleet2d.entities.body import Pose
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.objects.home_object import SensorFault
from fleet2d.floorplan.home import Home, HomeChange
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import EventKind
from fleet2d.sight.camera import Disturbance


class World(Protocol):
    """A run at the step of an intervention."""

    @property
    def step(self) -> int:
        """The present step."""

    @property
    def clock(self) -> Clock:
        """The clock of the run, which converts between times and steps."""

    @property
    def home(self) -> Home:
        """The home, as it is at present."""

    @property
    def users(self) -> Mapping[str, DecidingActor]:
        """The people, by name."""

    @property
    def robots(self) -> Mapping[str, DecidingActor]:
        """The robots, by name."""

    @property
    def doors(self) -> Sequence[str]:
        """The names of the doors."""

    @property
    def sensors(self) -> Sequence[str]:
        """The names of the sensors."""

    @property
    def algorithms(self) -> Sequence[str]:
        """The names of the algorithms."""

    @property
    def lasting(self) -> Sequence[object]:
        """The active interventions with a duration, in the order of their begin."""

    def undo(self, applies: Callable[[object], bool]) -> None:
        """End the active interventions to which a condition applies."""

    def keeps_truth(self, robot: str) -> bool:
        """Whether the run stores the truth beside what a robot perceives."""

    def disturb(self, robot: str, disturbances: Sequence[Disturbance]) -> None:
        """Set all disturbances of the cameras of a robot from the present step on."""

    def stick(self, sensor: str, says: SensorFault | None) -> None:
        """Set the fault of a sensor from the present step on; None: it works."""

    def reset(self, algorithm: str, learned: Path | None) -> None:
        """Restart an algorithm with nothing learned, or with what a file holds."""

    def replace(self, algorithm: str, output: object) -> None:
        """Let all but metrics read another output of an algorithm; see `Learners.replace`."""

    def move(self, actor: DecidingActor, pose: Pose) -> None:
        """Put a body at a pose, where it decides anew."""

    def drive(self, actor: DecidingActor) -> None:
        """Let a body follow only plans from outside from now on, not its behaviors."""

    def check_change(self, change: HomeChange) -> None:
        """Refuse an impossible change of the home.

        Raises:
            ScenarioError: It names something unknown.
        """

    def change(self, change: HomeChange) -> None:
        """Change the home at the present step."""

    def emit(self, entity: str, event: EventKind, detail: str) -> None:
        """Record an event at the present step."""
