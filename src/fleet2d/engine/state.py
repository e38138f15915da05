"""The state of a run, which changes from step to step, and the stream of its events."""

from array import array
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Sequence, Set
from dataclasses import dataclass, field
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeVar, cast

import numpy as np

from fleet2d.algorithms.history import Log, SensorRow
from fleet2d.algorithms.observations import SightingTable
from fleet2d.artifacts.store import RunStore
from fleet2d.engine.basis import Cast, Watcher
from fleet2d.engine.cameras import NOTHING, Cameras
from fleet2d.engine.change_queue import ChangeQueue
from fleet2d.engine.intervention_queue import InterventionQueue
from fleet2d.engine.layers import LayerBook
from fleet2d.engine.learners import Learners
from fleet2d.engine.recorder import Recorder
from fleet2d.engine.sensors import Sensors
from fleet2d.entities.behavior import SightEvent, Situation
from fleet2d.entities.body import Bodies
from fleet2d.entities.decisions import DecidingActor
from fleet2d.errors import InputError
from fleet2d.floorplan.home import Home
from fleet2d.runtime.events import HOME, Event, EventKind, new_event
from fleet2d.scenario.model import Scenario

if TYPE_CHECKING:
    from fleet2d.engine.expectations import RunExpectations
    from fleet2d.engine.yielding import Yielding
    from fleet2d.entities.keep_out import SleepMemory
    from fleet2d.entities.robots.policy import SightingMemory
    from fleet2d.expectations.expectation import Expectation

W = TypeVar("W", bound=Watcher)

# Watchers process at most this many steps together, or fewer with many bodies.
MAX_STEPS = 1 << 16
MIN_STEPS = 1 << 12
MAX_POSES = 1 << 21


class EventSink(Protocol):
    """A receiver of the events of a run: its tables, the history of algorithms, a script."""

    def take_events(self, events: Sequence[Event]) -> None:
        """Receive events, in the order in which they became known, not by step."""


class Listener(NamedTuple):
    """A function that receives the events of a run in order.

    Attributes:
        function: The function.
        kinds: The kinds of events that it receives.
    """

    function: Callable[[Sequence[Event]], None]
    kinds: Set[str]


class RecentEvents(deque[Event]):
    """The newest events of a run."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Encode texts as numbers, since a checkpoint has many events."""
        index: defaultdict[str, int] = defaultdict()
        index.default_factory = index.__len__
        steps, *texts = list(zip(*self, strict=True)) or [()]
        columns = [steps, *(map(index.__getitem__, column) for column in texts)]
        numbers = array("q", chain.from_iterable(columns)).tobytes()
        return RecentEvents, ((), self.maxlen), (numbers, list(index))

    def __setstate__(self, state: tuple[bytes, list[str]]) -> None:
        """Restore the events."""
        numbers, texts = state
        columns = np.frombuffer(numbers, np.int64).reshape(len(Event._fields), -1)
        steps, *codes = columns.tolist()
        words = (map(texts.__getitem__, column) for column in codes)
        self.extend(map(new_event, zip(steps, *words, strict=True)))


class EventStream:
    """The events of a run, passed on to all sinks.

    Sinks receive events as they become known. Listeners receive all events of a stretch of steps in
    order, including readings of sensors, which have a table of their own.

    Attributes:
        sinks: The receivers.
        listeners: The functions of callers.
        awaited: Kinds of events that end a span.
        CAPACITY: Number of the newest events that `since` can return.
    """

    CAPACITY = 1 << 16

    def __init__(self, sinks: Iterable[EventSink] = (), entities: Iterable[str] = ()) -> None:
        """Begin without events.

        Args:
            sinks: The receivers.
            entities: The bodies and objects of the run, in the order of its tables.
        """
        self.sinks = list(sinks)
        self.listeners: list[Listener] = []
        self.awaited: Set[str] = frozenset()
        self._row = {name: row for row, name in enumerate([HOME, *entities])}
        self._unheard: list[Event] = []  # events that listeners haven't received
        self._awaited_steps: list[int] = []  # steps of awaited events since the last span began
        self._recent = RecentEvents(maxlen=self.CAPACITY)
        self._first_step = 0  # all events from this step on are in `_recent`

    def __getstate__(self) -> dict[str, object]:
        """Leave out the functions, which belong to the caller, not to the run."""
        return {**self.__dict__, "listeners": [], "_unheard": []}

    def emit(self, events: Sequence[Event]) -> None:
        """Pass events on to all sinks."""
        if not events:
            return
        self.keep(events)
        for sink in self.sinks:
            sink.take_events(events)

    def next_awaited(self, step: int) -> int | None:
        """Return the first step from `step` on with an awaited event that was emitted already."""
        steps = self._awaited_steps
        self._awaited_steps = []
        return min((s for s in steps if s >= step), default=None)

    def deliver(self, end: int) -> None:
        """Call the listeners with the events of the steps before `end`, in the order of tables."""
        row = self._row
        due = [event for event in self._unheard if event.step < end]
        self._unheard = [event for event in self._unheard if event.step >= end]
        due.sort(key=lambda e: (e.step, row.get(e.entity, len(row)), e.rank))
        for function, kinds in self.listeners:
            if events := [event for event in due if event.event in kinds]:
                function(events)

    def keep(self, events: Sequence[Event]) -> None:
        """Pass events on to listeners only: readings of sensors."""
        excess = len(self._recent) + len(events) - self.CAPACITY
        if excess > 0:
            oldest = islice(chain(self._recent, events), excess)
            self._first_step = max(self._first_step, max(event.step for event in oldest) + 1)
        self._recent.extend(events)
        if self.listeners:
            self._unheard += events
        if self.awaited:
            self._awaited_steps += [e.step for e in events if e.event in self.awaited]

    def since(self, step: int) -> list[Event]:
        """Return the events from a step on, in the order of their steps.

        Raises:
            InputError: Too many events have happened since that step.
        """
        if step < self._first_step:
            raise InputError(
                f"events from step {self._first_step} on are kept, not from step {step}: ask"
                " more often, or read the table 'events'"
            )
        events = [event for event in self._recent if event.step >= step]
        return sorted(events, key=lambda event: (event.step, event.rank))


def capacity_of(actors: int) -> int:
    """Return the maximum number of steps that watchers process together."""
    return max(MIN_STEPS, min(MAX_STEPS, MAX_POSES // max(1, actors)))


@dataclass
class State(Cast):
    """The state of a run at a step.

    Attributes:
        bodies: The poses of bodies, their motion, and their next decisions; users, then robots.
        actors: Behaviors, plans and batteries of the same bodies.
        home: The present home: doors, furniture, rooms, layers.
        changes: The changes of the home.
        watchers: All followers of the bodies that the run needs, in their order.
        steering: The watchers that may replace plans at any step.
        yielding: The watcher by which robots keep clear of others; None if none does.
        user_cameras: The cameras of users.
        cameras: The cameras of robots.
        layers: The layers of the home, such as the seen cells, and the times of storing them.
        learners: Algorithms and metrics, with their learned states and outputs.
        log: The data that learners may read; None if there are no learners.
        recorder: Rows that aren't stored yet.
        store: The tables of the run.
        events: The stream of events to all sinks.
        max_span: The maximum number of steps of a span; None: `capacity`.
        settled: The first step that watchers have not processed yet.
        pending: Events that interrupted the plan of a body, by its row, until it decides.
        interventions: The interventions, done and scheduled.
        driven: Rows of the bodies that are driven from outside.
        requested: Event kinds that end a span because a caller waits for them.
        awaited: Event kinds that end a span: `requested`, and those awaited by interventions and
            listeners.
        expectations: The watcher of the run's expectations; None if there are none.
        notes_emitted: Number of notes of each body's present plan that have happened.
        capacity: The maximum number of steps that watchers process together.
    """

    bodies: Bodies
    actors: list[DecidingActor]
    home: Home
    changes: ChangeQueue
    watchers: list[Watcher]
    user_cameras: list[Cameras]
    cameras: list[Cameras]
    layers: LayerBook
    learners: Learners
    log: Log | None
    recorder: Recorder
    store: RunStore
    events: EventStream
    interventions: InterventionQueue
    max_span: int | None
    settled: int = 0
    pending: dict[int, list[SightEvent]] = field(default_factory=dict)
    driven: set[int] = field(default_factory=set)
    requested: frozenset[str] = frozenset()
    awaited: frozenset[str] = frozenset()
    expectations: "RunExpectations | None" = None
    notes_emitted: list[int] = field(init=False)
    capacity: int = field(init=False)
    yielding: "Yielding | None" = None
    _situation: Situation | None = None  # the newest situation

    def __getstate__(self) -> dict[str, object]:
        """Leave out the situation, which follows from the rest."""
        return {**self.__dict__, "_situation": None}

    def __post_init__(self) -> None:
        """Begin without notes."""
        self.notes_emitted = [0] * len(self.actors)
        self.capacity = capacity_of(len(self.actors))
        self.steering = [watcher for watcher in self.watchers if watcher.steered]
        self.listening = [watcher for watcher in self.watchers if watcher.hears_plans]

    def find(self, kind: type[W]) -> W | None:
        """Return the watcher of a kind; None if the run needs none."""
        return next((watcher for watcher in self.watchers if isinstance(watcher, kind)), None)

    def wait_for(self, kinds: frozenset[str]) -> None:
        """Let spans end at events of some kinds, besides those that components wait for."""
        listened = frozenset[str]().union(*(kinds for _, kinds in self.events.listeners))
        self.requested = kinds
        self.awaited = kinds | self.interventions.kinds | listened
        self.events.awaited = self.awaited
        awaited = self.awaited | self.learners.awaited
        for watcher in self.watchers:
            watcher.awaited = awaited

    def expect(self, scenario: Scenario, name: str, expectation: "Expectation", since: int) -> None:
        """Add an expectation that is judged from a step on; see `RunExpectations.add`."""
        # Expectations import much that other runs don't need.
        from fleet2d.engine.expectations import RunExpectations
        from fleet2d.expectations.signals import MeasuredRun

        if self.expectations is None:
            groups = [*self.user_cameras, *self.cameras]
            cameras = {group.owner.name: group for group in groups}
            sensors = self.find(Sensors)
            run = MeasuredRun(
                self.actors,
                self.bodies,
                self.home,
                self.changes.clock,
                doors=self.changes.names,
                sensors_on={} if sensors is None else sensors.on,
                cameras=cameras,
                activities=self.recorder.activities,
            )
            self.expectations = RunExpectations(scenario, run, sensors, self.interventions)
            self.expectations.next_step = self.settled
            self.watchers.append(self.expectations)
            self.listening.append(self.expectations)
            self.events.sinks.append(self.expectations)
        self.expectations.add(name, expectation, since, self.settled)

    def situation(self, row: int, step: int) -> Situation:
        """Return the situation of a body at a step; the same object while nothing in it changes."""
        actor = self.actors[row]
        events = tuple(self.pending.get(row, ()))
        now = self._situation
        outputs = self.learners.readable_outputs
        is_same = now is not None and now.actor is actor and now.outputs is outputs
        if now is None or not is_same or (now.step, now.events) != (step, events):
            now = self._situation = Situation(actor, step, events, outputs)
        return now

    def end_plan(self, row: int, step: int) -> None:
        """Record the plan of a body up to the step at which it is replaced."""
        self.events.emit(self._due_notes(row, step))
        self.recorder.before_plan(row, step)
        for watcher in self.listening:
            watcher.before_plan(row, self.actors[row], step)

    def begin_plan(self, row: int, step: int) -> None:
        """Record the beginning of a body's new plan."""
        self.notes_emitted[row] = 0
        self.events.emit(self._due_notes(row, step))
        self.recorder.after_plan(row, step)
        for watcher in self.listening:
            watcher.listen(row)
            watcher.begin_plan(self.actors[row])

    def _due_notes(self, row: int, step: int) -> Sequence[Event]:
        """Return the notes of a body's plan up to a step, once, as events."""
        actor = self.actors[row]
        begin = self.notes_emitted[row]
        notes = actor.plan.notes
        step_us = actor.clock.step_us
        now_us = step * step_us
        if begin == len(notes) or notes[begin].time_us > now_us:
            return ()
        end = begin + 1
        while end < len(notes) and notes[end].time_us <= now_us:
            end += 1
        self.notes_emitted[row] = end
        name = actor.name
        due = notes[begin:end]
        return [new_event((-(-time // step_us), name, kind, text)) for time, kind, text in due]

    def next_note(self, step: int, kinds: Set[str]) -> int | None:
        """Return the next step from `step` on at which a plan has an event of these kinds."""
        steps = []
        for actor, begin in zip(self.actors, self.notes_emitted, strict=True):
            for note in islice(actor.plan.notes, begin, None):
                at = actor.clock.step_at_or_after(note.time_us)
                if note.event in kinds and at >= step:
                    steps.append(at)
                    break
        if self.log is not None and (logged := self.log.next_event(step, kinds)) is not None:
            steps.append(logged)
        return min(steps, default=None)

    def take(self, watcher: Watcher, end: int) -> Sequence[Event]:
        """Let a watcher process the steps up to `end` - 1; return its events."""
        if watcher.next_step >= end:
            return ()
        events = watcher.take(self.bodies, end)
        self.events.emit(events)
        return events

    def interrupt(self, watcher: Watcher, events: Sequence[Event]) -> None:
        """Let bodies decide at the present step if an event of a watcher ends their plans."""
        for row, event in watcher.interruptions(events):
            self.pending.setdefault(row, []).append(event)
            self.bodies.ask_at[row] = self.bodies.step

    def settle(self, end: int) -> None:
        """Let all watchers process the steps up to `end` - 1, and record them."""
        first = self.settled
        if first >= end:
            return
        for row in range(len(self.actors)):
            self.events.emit(self._due_notes(row, end - 1))
        for watcher in self.watchers:
            self.take(watcher, end)
        observations = self._observations()
        readings = self._readings()
        self.recorder.take(first, end, observations, readings)
        for watcher in self.watchers:
            watcher.settle(end, observations, readings)
        if self.log is not None:
            self.log.observe(observations)
            self.log.readings += readings
        self.settled = end
        if self.log is None:
            self.bodies.forget(end)

    def _readings(self) -> Sequence[SensorRow]:
        """Return the readings of sensors since the last call, and pass them on as events."""
        sensors = self.find(Sensors)
        if sensors is None:
            return ()
        readings = sensors.collect()
        events = sensors.events_of(readings)
        self.events.keep(events)
        if EventKind.SENSOR in self.awaited:
            self.interventions.take_events(events)
        return readings

    def count_looks(self) -> None:
        """Add the counts of the cameras up to the present step to the log, for metrics."""
        if self.log is not None:
            self.log.count_looks(self.settled, [cameras.counts for cameras in self.cameras])
            self.layers.expose(self.settled, self.log)

    def forget(self, before: int) -> None:
        """Drop the data before a step, which no learner can read any more."""
        if self.log is not None:
            self.log.forget(before)
        self.bodies.forget(min(before, self.settled))

    def renew_memory(self, actor: DecidingActor) -> None:
        """Let a robot forget its sightings, if it has a memory of them."""
        if isinstance(actor.recall, Recall):
            old = actor.recall
            emptied = cast("SightingMemory", old.memory).emptied()
            actor.recall = Recall(self, old.cameras, emptied)
            if old.cameras is not None:
                kept = old.cameras.remembered
                old.cameras.remembered = [emptied if m is old.memory else m for m in kept]

    def _observations(self) -> SightingTable:
        """Return the sightings of all robots, in order of step and robot."""
        blocks = [cameras.collect() for cameras in self.cameras] or [NOTHING]
        for cameras in self.user_cameras:
            cameras.collect()
        seen = SightingTable.joined(blocks)
        if len(blocks) > 1:
            order = np.argsort(seen.step, kind="stable")
            seen = SightingTable(seen.step[order], seen.index[order], seen.distinct)
        return seen


@dataclass(frozen=True)
class InView:
    """The bodies that the cameras of a body have in view at present, for its behaviors."""

    state: State
    cameras: Cameras

    def __call__(self) -> dict[str, tuple[float, float]]:
        """Return the last perceived place of each body [m], by name; "" for somebody unknown."""
        self.state.take(self.cameras, self.state.bodies.step)
        return self.cameras.in_view


@dataclass(frozen=True)
class Recall:
    """The memory of a robot's sightings up to the present step, for its behaviors."""

    state: State
    cameras: Cameras | None
    memory: "SightingMemory | SleepMemory"

    def __call__(self) -> Any:
        """Return the memory."""
        if self.cameras is not None:
            self.state.take(self.cameras, self.state.bodies.step)
        return self.memory
