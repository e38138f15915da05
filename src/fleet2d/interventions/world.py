"""What interventions act upon: the part of a run that they may see and touch."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol

from fleet2d.clock import Clock
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.motion import Pose
from fleet2d.entities.objects.sensor import SensorFault
from fleet2d.events import EventKind
from fleet2d.floorplan.home.change import HomeChange
from fleet2d.floorplan.home.home import Home
from fleet2d.sight.disturbance import Disturbance


class World(Protocol):
    """A run at the step at which something is done to it."""

    @property
    def step(self) -> int:
        """The present step."""

    @property
    def clock(self) -> Clock:
        """The steps of the run."""

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
        """What was begun and isn't over, in order."""

    def undo(self, is_meant: Callable[[object], bool]) -> None:
        """End what is under way and meant."""

    def keeps_truth(self, robot: str) -> bool:
        """Tell whether the run keeps what is true beside what a robot perceives."""

    def disturb(self, robot: str, disturbances: Sequence[Disturbance]) -> None:
        """Disturb the cameras of a robot by these alone from the present step on."""

    def stick(self, sensor: str, says: SensorFault | None) -> None:
        """Let a sensor say what it doesn't sense from the present step on; None: as it senses."""

    def reset(self, algorithm: str, learned: Path | None) -> None:
        """Let an algorithm begin anew with nothing learned, or with what a file holds."""

    def replace(self, algorithm: str, output: object) -> None:
        """Let all but metrics read something else of an algorithm; see `Learners.replace`."""

    def move(self, actor: DecidingActor, pose: Pose, part: int) -> None:
        """Put a body elsewhere, in a part of its space; it decides anew there."""

    def drive(self, actor: DecidingActor) -> None:
        """Take the decisions of a body out of the hands of its behaviors."""

    def check_change(self, change: HomeChange) -> None:
        """Refuse a change of the home that can't be.

        Raises:
            ScenarioError: There is nothing of that name to change.
        """

    def change(self, change: HomeChange) -> None:
        """Change the home at the present step."""

    def emit(self, entity: str, event: EventKind, detail: str) -> None:
        """Record that something happened at the present step."""
