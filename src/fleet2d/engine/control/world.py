"""The run that interventions read and change; see `fleet2d.interventions.world`."""

from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path

from fleet2d.engine.state import State
from fleet2d.entities.body import Pose
from fleet2d.entities.decisions import Arbiter, DecidingActor
from fleet2d.entities.objects.home_object import SensorFault
from fleet2d.floorplan.home.change import HomeChange
from fleet2d.floorplan.home.home import Home
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import Event, EventKind
from fleet2d.sight.camera import Disturbance


class EngineWorld:
    """A run at the step of an intervention; see `fleet2d.interventions.world`."""

    def __init__(self, state: State, step: int) -> None:
        self._state, self.step = state, step

    @property
    def home(self) -> Home:
        """The home, as it is at present."""
        return self._state.home

    @property
    def clock(self) -> Clock:
        """The steps of the run."""
        return self._state.changes.clock

    @cached_property
    def users(self) -> dict[str, DecidingActor]:
        """The people, by name."""
        return {actor.name: actor for actor in self._state.actors[: self._state.bodies.users]}

    @cached_property
    def robots(self) -> dict[str, DecidingActor]:
        """The robots, by name."""
        return {actor.name: actor for actor in self._state.actors[self._state.bodies.users :]}

    @property
    def doors(self) -> Sequence[str]:
        """The names of the doors."""
        return self._state.changes.names

    @property
    def sensors(self) -> Sequence[str]:
        """The names of the sensors."""
        return self._state.sensors.names

    @property
    def algorithms(self) -> Sequence[str]:
        """The names of the algorithms."""
        return self._state.learners.known

    @property
    def lasting(self) -> Sequence[object]:
        """The active interventions with a duration, in the order of their begin."""
        return self._state.interventions.lasting

    def undo(self, applies: Callable[[object], bool]) -> None:
        """End the active interventions to which a condition applies."""
        for act in self._state.interventions.undo(applies):
            act.end(self)

    def keeps_truth(self, robot: str) -> bool:
        """Whether the run stores the truth beside what a robot perceives."""
        return any(c.owner.name == robot and c.errs for c in self._state.cameras)

    def disturb(self, robot: str, disturbances: Sequence[Disturbance]) -> None:
        """Set all disturbances of the cameras of a robot from the present step on."""
        self._state.settle(self.step)
        row = self.robots[robot].row
        for cameras in self._state.cameras:
            if cameras.row == row:
                cameras.disturb(disturbances)
        dark = {
            name
            for name in self.robots[robot].entity.eyes
            if any(disturbance.dark and disturbance.is_of(name) for disturbance in disturbances)
        }
        for area in self._state.layers.areas:
            if area.row == row:
                area.darken(dark)

    def stick(self, sensor: str, says: SensorFault | None) -> None:
        """Set the fault of a sensor from the present step on; None: it works."""
        self._state.settle(self.step)
        self._state.sensors.stuck.pop(sensor, None)
        if says is not None:
            self._state.sensors.stuck[sensor] = says

    def reset(self, algorithm: str, learned: Path | None) -> None:
        """Restart an algorithm with nothing learned, or with what a file holds."""
        self._state.learners.reset(algorithm, learned)

    def replace(self, algorithm: str, output: object) -> None:
        """Let all but metrics read another output of an algorithm; see `Learners.replace`."""
        self._state.learners.replace(algorithm, output)

    def move(self, actor: DecidingActor, pose: Pose) -> None:
        """Put a body at a pose, where it decides anew."""
        self._state.recorder.move_body(actor.row, self.step)
        actor.put(pose, self.step)

    def drive(self, actor: DecidingActor) -> None:
        """Let a body follow only plans from outside from now on, not its behaviors."""
        actor.behaviors, actor.arbiter, actor.order = [], Arbiter([]), None
        self._state.driven.add(actor.row)
        actor.decide_anew(self.step)

    def check_change(self, change: HomeChange) -> None:
        """Refuse an impossible change of the home.

        Raises:
            ScenarioError: It names something unknown.
        """
        self._state.changes.check_names(change)

    def change(self, change: HomeChange) -> None:
        """Change the home at the present step."""
        self._state.changes.ask(change, self.step, "a script")

    def emit(self, entity: str, event: EventKind, detail: str) -> None:
        """Record an event at the present step."""
        self._state.events.emit([Event(self.step, entity, event, detail)])
