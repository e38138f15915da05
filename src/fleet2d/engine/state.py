"""The state of a run: all that changes from step to step, and nothing else."""

from collections.abc import Sequence, Set
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.activities import ROBOT
from fleet2d.algorithms.log import Log
from fleet2d.algorithms.observations import OBSERVATION
from fleet2d.artifacts.store import RunStore
from fleet2d.engine.blocking import Blocking
from fleet2d.engine.bodies import Bodies
from fleet2d.engine.cameras import Cameras
from fleet2d.engine.changes import Changes
from fleet2d.engine.clearance import Clearance
from fleet2d.engine.encounters import Encounters
from fleet2d.engine.interventions import Interventions
from fleet2d.engine.layers import LayerBook
from fleet2d.engine.learners import Learners
from fleet2d.engine.recorder import Recorder
from fleet2d.engine.sensors import Sensors
from fleet2d.engine.watcher import Watcher
from fleet2d.entities.behavior import SightEvent
from fleet2d.entities.decisions import DecidingActor
from fleet2d.events import Event, EventKind, EventStream
from fleet2d.floorplan.home.home import Home
from fleet2d.kernels.look import SIGHTING
from fleet2d.kernels.look import STEP as STEP_COLUMN

if TYPE_CHECKING:
    from fleet2d.engine.expecting import Expecting

# The most steps that watchers take in together: the fewer, the more bodies there are.
MOST_STEPS = 1 << 16
LEAST_STEPS = 1 << 12
MOST_POSES = 1 << 21


@dataclass
class State:
    """What a run is at a step.

    Attributes:
        bodies: Where all bodies are, how they go on, and when they decide; users, then robots.
        actors: What their decisions carry: behaviors, plans, batteries; in the order of bodies.
        home: The home as it is at present: doors, furniture, rooms, layers.
        changes: What changes in the home, and when.
        watchers: What follows the bodies, in the order in which it is asked.
        clearance, blocking, encounters, sensors: Those of them by name.
        gazes, cameras: The cameras of users, and those of robots.
        layers: What robots have seen of the home, and when it is stored.
        learners: Algorithms and metrics, what they have learned and put out.
        log: What learners may ask for; None where there are no learners.
        recorder: Rows that aren't stored yet.
        store: The tables of the run.
        events: What happened, for all who take it.
        max_span: The most steps of a span; None for as many as there is room for.
        settled: The step before which all watchers have taken everything in.
        pending: Events that interrupted the plan of a body, by its row, until it decides.
        interventions: What is done to the run from outside, and what was.
        driven: Rows of the bodies that are driven from outside.
        wanted: Kinds of events at which somebody outside wants the span to end.
        awaited: Those, and the kinds that interventions wait for.
        expecting: What is expected of the run; None if nothing is.
        notes_emitted: How many of the notes of each body's present plan have happened.
    """

    bodies: Bodies
    actors: list[DecidingActor]
    home: Home
    changes: Changes
    clearance: Clearance
    blocking: Blocking
    encounters: Encounters
    sensors: Sensors
    gazes: list[Cameras]
    cameras: list[Cameras]
    layers: LayerBook
    learners: Learners
    log: Log | None
    recorder: Recorder
    store: RunStore
    events: EventStream
    interventions: Interventions
    max_span: int | None
    watchers: list[Watcher] = field(init=False)
    settled: int = 0
    pending: dict[int, list[SightEvent]] = field(default_factory=dict)
    driven: set[int] = field(default_factory=set)
    wanted: frozenset[str] = frozenset()
    awaited: frozenset[str] = frozenset()
    expecting: "Expecting | None" = None
    notes_emitted: list[int] = field(init=False)

    def __post_init__(self) -> None:
        """List the watchers."""
        self.watchers = [
            self.clearance,
            self.blocking,
            *self.gazes,
            *self.cameras,
            self.encounters,
            self.sensors,
            *self.layers.areas,
        ]
        self.notes_emitted = [0] * len(self.actors)

    @property
    def capacity(self) -> int:
        """The most steps that watchers take in together."""
        return max(LEAST_STEPS, min(MOST_STEPS, MOST_POSES // max(1, len(self.actors))))

    # Decisions of scripts

    def wait_for(self, kinds: frozenset[str]) -> None:
        """Let spans end at events of these kinds, besides those that others wait for."""
        self.wanted, self.awaited = kinds, kinds | self.interventions.kinds
        awaited = self.awaited | self.learners.awaited
        for cameras in [*self.gazes, *self.cameras]:
            cameras.awaited = awaited
        self.sensors.awaited = EventKind.SENSOR in awaited

    # Decisions

    def take_pending(self, row: int) -> tuple[SightEvent, ...]:
        """Return the events that interrupted the plan of a body, once."""
        return tuple(self.pending.pop(row, ()))

    def end_plan(self, row: int, step: int) -> None:
        """Record what happened on the plan of a body up to the step at which it is replaced."""
        self.emit_notes(row, step)
        self.recorder.before_plan(row, step)
        self.encounters.before_plan(row, self.actors[row], step)

    def begin_plan(self, row: int, step: int) -> None:
        """Record how the new plan of a body begins."""
        self.notes_emitted[row] = 0
        self.emit_notes(row, step)
        self.recorder.after_plan(row, step)
        if self.expecting is not None:
            self.expecting.begin_plan(self.actors[row])

    def emit_notes(self, row: int, step: int) -> None:
        """Emit what the plan of a body notes up to a step."""
        actor = self.actors[row]
        notes, begin = actor.plan.notes, self.notes_emitted[row]
        moment, end = step * actor.clock.step_us, begin
        while end < len(notes) and notes[end].time_us <= moment:
            end += 1
        if end > begin:
            self.notes_emitted[row] = end
            at = actor.clock.step_at_or_after
            self.events.emit(
                [Event(at(n.time_us), actor.name, n.event, n.detail) for n in notes[begin:end]]
            )

    def next_note(self, step: int, kinds: Set[str]) -> int | None:
        """Return the next step from `step` on at which a plan notes an event of these kinds."""
        steps = [
            actor.clock.step_at_or_after(note.time_us)
            for actor, begin in zip(self.actors, self.notes_emitted, strict=True)
            for note in actor.plan.notes[begin:]
            if note.event in kinds
        ]
        known = None if self.log is None else self.log.next_event(step, kinds)
        if known is not None:
            steps.append(known)
        return min((s for s in steps if s >= step), default=None)

    # Watching

    def take(self, watcher: Watcher, end: int) -> Sequence[Event]:
        """Let a watcher take in the steps up to `end` - 1; return what happened."""
        if watcher.taken >= end:
            return ()
        events = watcher.take(self.bodies, end)
        self.events.emit(events)
        return events

    def interrupt(self, watcher: Watcher, events: Sequence[Event]) -> None:
        """Let bodies decide at the present step whose plans an event of a watcher ends."""
        for row, event in watcher.interruptions(events):
            self.pending.setdefault(row, []).append(event)
            self.bodies.ask_at[row] = self.bodies.step

    def settle(self, end: int) -> None:
        """Let all watchers take in the steps up to `end` - 1, and record them."""
        first = self.settled
        if first >= end:
            return
        for row in range(len(self.actors)):
            self.emit_notes(row, end - 1)
        for watcher in self.watchers:
            self.take(watcher, end)
        observations, readings = self._observations(), self.sensors.collect()
        if EventKind.SENSOR in self.awaited:
            self.interventions.take_events(self.sensors.events_of(readings))
        self.recorder.take(first, end, observations, readings)
        if self.expecting is not None:
            self.expecting.take(first, end, self, observations, readings)
        if self.log is not None:
            self.log.observe(observations)
            self.log.readings += readings
        self.settled = end
        if self.log is None:
            self.bodies.forget(end)

    def count_looks(self) -> None:
        """Keep for metrics what the cameras have counted up to the present step."""
        if self.log is not None:
            self.log.count_looks(self.settled, [cameras.counts for cameras in self.cameras])
            self.layers.expose(self.settled, self.log)

    def forget(self, before: int) -> None:
        """Drop what learners may no longer ask for."""
        if self.log is not None:
            self.log.forget(before)
        self.bodies.forget(min(before, self.settled))

    def _observations(self) -> NDArray[np.int64]:
        """Join what all robots perceived, in order of step and robot."""
        blocks = [cameras.collect() for cameras in self.cameras]
        for gaze in self.gazes:
            gaze.collect()
        ends = np.cumsum([0, *map(len, blocks)])
        rows = np.empty((ends[-1], OBSERVATION), np.int64)
        place: Any = slice(None)  # of each sighting among the rows
        if len(blocks) > 1:
            steps = np.concatenate([block[:, STEP_COLUMN] for block in blocks])
            place = np.empty(len(rows), np.int64)
            place[np.argsort(steps, kind="stable")] = np.arange(len(rows))
        for cameras, block, (begin, end) in zip(self.cameras, blocks, pairwise(ends), strict=True):
            here = place[begin:end] if len(blocks) > 1 else place
            rows[here, :SIGHTING], rows[here, ROBOT] = block, cameras.index
        return rows


@dataclass(frozen=True)
class InView:
    """Whom the cameras of a body have in view at present, for its behaviors."""

    state: State
    cameras: Cameras

    def __call__(self) -> dict[str, tuple[float, float]]:
        """Return where each was perceived last [m], by name; somebody unknown is ""."""
        self.state.take(self.cameras, self.state.bodies.step)
        return self.cameras.in_view
