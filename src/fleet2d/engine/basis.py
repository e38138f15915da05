"""The basis of a run: scenario, home and bodies, the base of watchers, components and files."""

from collections.abc import (
    Callable,
    Collection,
    Iterable,
    Iterator,
    Mapping,
    Sequence,
    Set,
    ValuesView,
)
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self, TypeVar

from pydantic import BaseModel

from fleet2d.algorithms.history import SensorRow
from fleet2d.algorithms.observations import SightingTable
from fleet2d.artifacts.store import RunStore
from fleet2d.configuration.components import Component
from fleet2d.configuration.importing import source_files
from fleet2d.entities.behavior import SightEvent, Situation
from fleet2d.entities.body import Bodies
from fleet2d.entities.decisions import DecidingActor
from fleet2d.errors import blame
from fleet2d.floorplan.home import Home
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import Event
from fleet2d.scenario.model import Scenario

if TYPE_CHECKING:
    from fleet2d.expectations.signals import Outputs, Results

T = TypeVar("T")


class ImmutableRows(list[T]):
    """A list of immutable objects: a copy of a run has its own list of the same objects."""

    def __copy__(self) -> Self:
        return self.__class__(self)


class PlannedNote(NamedTuple):
    """A note of a plan at a step: a question or a call, by its text.

    Attributes:
        step: The step.
        row: The row of the body.
        text: The detail of the note.
    """

    step: int
    row: int
    text: str


def notes_of(actor: DecidingActor, kind: str) -> list[PlannedNote]:
    """Return the notes of one kind in a body's plan, each with its step."""
    step_of = actor.clock.step_at_or_after
    notes = actor.plan.notes
    return [PlannedNote(step_of(n.time_us), actor.row, n.detail) for n in notes if n.event == kind]


class Watcher:
    """Base of followers of the bodies from span to span.

    A span is a block of steps without decisions. A watcher that may end a span looks ahead in
    `limit`; all others process many spans at once.

    Attributes:
        next_step: The first step that is not processed yet.
        awaited: Kinds of events that end a span, whatever plans wait for.
        steered: Rows of the bodies whose plans the watcher may replace at any step.
        files: The files that the watcher has read.
        hears_plans: Whether the watcher is told of plans that begin or are replaced.
    """

    hears_plans: ClassVar[bool] = True
    next_step: int = 0
    awaited: Set[str] = frozenset()
    steered: Collection[int] = ()
    files: Sequence[Path] = ()

    @property
    def is_needed(self) -> bool:
        """Whether the run has anything for the watcher to follow."""
        return True

    @property
    def waits(self) -> bool:
        """Whether an event of the watcher may end the present span."""
        return False

    def limit(self, bodies: Bodies, end: int) -> int:
        """Return the step before which the present span ends at the latest, `end` or earlier."""
        return end

    def take(self, bodies: Bodies, end: int) -> Sequence[Event]:
        """Process the steps from `next_step` to `end` - 1; return their events."""
        self.next_step = end
        return ()

    def interruptions(self, events: Sequence[Event]) -> Iterable[tuple[int, SightEvent]]:
        """Return the bodies, by row, whose plans an event of the last step ends, and the event.

        Args:
            events: The result of `take`.
        """
        return ()

    def looks(self, row: int, step: int) -> bool:
        """Return whether a steered body is asked for a decision at a step."""
        return False

    def evasion(self, bodies: Bodies, now: Situation) -> Callable[[], None] | None:
        """Return a function that gives a steered body another plan; None: the body may go on."""
        return None

    def before_plan(self, row: int, actor: DecidingActor, step: int) -> None:
        """React to the replacement of a body's plan at a step."""

    def listen(self, row: int) -> None:
        """React to a change of the events that a body waits for."""

    def begin_plan(self, actor: DecidingActor) -> None:
        """React to the beginning of a body's plan."""

    def settle(self, end: int, observations: SightingTable, readings: Sequence[SensorRow]) -> None:
        """Process observations up to step `end` - 1, in which the home doesn't change.

        Args:
            end: One past the last step.
            observations: The observations of robots.
            readings: The readings of sensors.
        """

    def learn(self, outputs: "Outputs", results: "Results") -> None:
        """Process new outputs of algorithms, and new results of metrics."""


class Cast:
    """Base of what has the bodies of a run: users, then robots.

    Attributes:
        actors: The bodies.
        bodies: Their poses, in the same order.
    """

    actors: list[DecidingActor]
    bodies: Bodies

    @property
    def users(self) -> list[DecidingActor]:
        """The users."""
        return self.actors[: self.bodies.users]

    @property
    def robots(self) -> list[DecidingActor]:
        """The robots."""
        return self.actors[self.bodies.users :]


@dataclass(frozen=True)
class Basis(Cast):
    """The scenario, home and bodies from which the parts of a run are built.

    Attributes:
        scenario: The scenario.
        clock: The steps of the run.
        seed: The seed of all random draws.
        store: The store of its tables.
        home: The home before the first step.
        actors: Users, then robots.
        bodies: Their poses, in the same order.
    """

    scenario: Scenario
    clock: Clock
    seed: int
    store: RunStore
    home: Home
    actors: list[DecidingActor]
    bodies: Bodies

    @property
    def may_change(self) -> bool:
        """Whether the home may change during the run."""
        scenario = self.scenario
        if scenario.objects or any(user.lights for user in scenario.users.values()):
            return True
        if not scenario.script:
            return False
        from fleet2d.interventions.home import HomeIntervention  # only scripts need it

        return any(isinstance(entry.act, HomeIntervention) for entry in scenario.script)


def input_files(scenario: Scenario) -> list[Path]:
    """Return the files that components read, and those of the user's own modules, sorted.

    The files of a component are those of its method `files`, and all paths among its fields.
    """
    files: set[Path] = set()
    for component in components_of(scenario):
        if files_of := getattr(component, "files", None):
            with blame(component.type_name, None):
                files |= set(files_of())
        files |= {value for _, value in component if isinstance(value, Path) and value.is_file()}
        if not type(component).__module__.startswith("fleet2d."):
            files |= set(source_files(type(component)))
    return sorted(files)


def components_of(scenario: Scenario) -> Iterator[Component]:
    """Yield all components of a scenario, including nested ones."""
    robots = scenario.robots.values()
    script = scenario.script
    errors = [robot.perception for robot in robots]
    errors += [camera.perception for robot in robots for camera in robot.eyes.values()]
    errors += [getattr(entry.act, "errs", None) for entry in script]  # faults have errors, too
    entities = (*scenario.users.values(), *robots)
    holders = [scenario, scenario.sight, *entities, *script, *(each for each in errors if each)]
    queue = [component for holder in holders for component in _components_in(holder)]
    while queue:
        component = queue.pop()
        yield component
        queue += _components_in(component)


def _components_in(holder: BaseModel) -> Iterator[Component]:
    """Yield the components among the values of fields, and in their lists and mappings."""
    for _, value in holder:
        values = value.values() if isinstance(value, Mapping) else value
        several = values if isinstance(values, list | tuple | ValuesView) else (values,)
        yield from (item for item in several if isinstance(item, Component))
