"""A run as interventions see it, at the step at which something is done to it."""

from collections.abc import Sequence
from functools import cached_property

from fleet2d.clock import Clock
from fleet2d.engine.state import State
from fleet2d.entities.actor import Actor
from fleet2d.entities.arbitration import Arbiter
from fleet2d.entities.motion import Pose
from fleet2d.events import Event, EventKind
from fleet2d.floorplan.home.change import HomeChange
from fleet2d.floorplan.home.home import Home


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
    def users(self) -> dict[str, Actor]:
        """The people, by name."""
        return {actor.name: actor for actor in self._state.actors[: self._state.bodies.users]}

    @cached_property
    def robots(self) -> dict[str, Actor]:
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

    def move(self, actor: Actor, pose: Pose, part: int) -> None:
        """Put a body elsewhere, in a part of its space; it decides anew there."""
        actor.state, actor.part = pose, part
        self._state.recorder.move_body(actor.row)
        actor.decide_anew(self.step)

    def drive(self, actor: Actor) -> None:
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
