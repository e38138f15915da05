"""A run as interventions see it, at the step at which something is done to it."""

from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path

from fleet2d.clock import Clock
from fleet2d.engine.state import State
from fleet2d.entities.arbitration import Arbiter
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.motion import Pose
from fleet2d.entities.objects.sensor import SensorFault
from fleet2d.events import Event, EventKind
from fleet2d.floorplan.home.change import HomeChange
from fleet2d.floorplan.home.home import Home
from fleet2d.sight.disturbance import Disturbance


class EngineWorld:
    """What interventions see and touch of a state; see `fleet2d.interventions.world`."""

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
        """What was begun and isn't over, in order."""
        return self._state.interventions.lasting

    def undo(self, is_meant: Callable[[object], bool]) -> None:
        """End what is under way and meant."""
        for act in self._state.interventions.undo(is_meant):
            act.end(self)

    def keeps_truth(self, robot: str) -> bool:
        """Tell whether the run keeps what is true beside what a robot perceives."""
        return any(c.owner.name == robot and c.errs for c in self._state.cameras)

    def disturb(self, robot: str, disturbances: Sequence[Disturbance]) -> None:
        """Disturb the cameras of a robot by these alone from the present step on."""
        self._state.settle(self.step)
        row = self.robots[robot].row
        for cameras in self._state.cameras:
            if cameras.row == row:
                cameras.disturb(disturbances)
        eyes = self.robots[robot].entity.eyes
        dark = {name for name in eyes for each in disturbances if each.dark and each.is_of(name)}
        for area in self._state.layers.areas:
            if area.row == row:
                area.darken(dark)

    def stick(self, sensor: str, says: SensorFault | None) -> None:
        """Let a sensor say what it doesn't sense from the present step on; None: as it senses."""
        self._state.settle(self.step)
        self._state.sensors.stuck.pop(sensor, None)
        if says is not None:
            self._state.sensors.stuck[sensor] = says

    def reset(self, algorithm: str, learned: Path | None) -> None:
        """Let an algorithm begin anew with nothing learned, or with what a file holds."""
        self._state.learners.reset(algorithm, learned)

    def replace(self, algorithm: str, output: object) -> None:
        """Let all but metrics read something else of an algorithm; see `Learners.replace`."""
        self._state.learners.replace(algorithm, output)

    def move(self, actor: DecidingActor, pose: Pose, part: int) -> None:
        """Put a body elsewhere, in a part of its space; it decides anew there."""
        actor.state, actor.part = pose, part
        self._state.recorder.move_body(actor.row)
        actor.decide_anew(self.step)

    def drive(self, actor: DecidingActor) -> None:
        """Take the decisions of a body out of the hands of its behaviors."""
        actor.behaviors, actor.arbiter, actor.order = [], Arbiter([]), None
        self._state.driven.add(actor.row)
        actor.decide_anew(self.step)

    def check_change(self, change: HomeChange) -> None:
        """Refuse a change of the home that can't be.

        Raises:
            ScenarioError: There is nothing of that name to change.
        """
        self._state.changes.check_names(change)

    def change(self, change: HomeChange) -> None:
        """Change the home at the present step."""
        self._state.changes.ask(change, self.step, "a script")

    def emit(self, entity: str, event: EventKind, detail: str) -> None:
        """Record that something happened at the present step."""
        self._state.events.emit([Event(self.step, entity, event, detail)])
