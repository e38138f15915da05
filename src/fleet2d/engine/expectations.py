"""The events that can happen in a run, and their details: for scripts and expectations."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from fleet2d.algorithms.history import SensorRow
from fleet2d.algorithms.observations import Activities
from fleet2d.artifacts.store import RunStore
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.configuration.units import MICROSECOND
from fleet2d.engine.cameras import Cameras
from fleet2d.engine.change_queue import ChangeQueue
from fleet2d.engine.intervention_queue import InterventionQueue
from fleet2d.engine.learners import Learners
from fleet2d.engine.sensors import Sensors
from fleet2d.engine.trajectories import STEP, TIME
from fleet2d.entities.behavior import Actor
from fleet2d.entities.body import Bodies
from fleet2d.entities.decisions import DecidingActor
from fleet2d.errors import InputError
from fleet2d.expectations.expectation import Expectation, RunSignals
from fleet2d.expectations.signals import Gauge, MeasuredRun, Scene, SignalBlock
from fleet2d.expectations.verdict import (
    Verdict,
    VerdictEvidence,
    check_judged,
    evidence_of,
    is_decided,
    verdict_of,
)
from fleet2d.floorplan.home import Home
from fleet2d.interactions.interaction import REQUEST_EVENTS
from fleet2d.kernels import I64, SightMemory
from fleet2d.metrics.metric import Metric
from fleet2d.runtime.events import KINDS, Event, EventKind
from fleet2d.scenario.model import Scenario

# Events of every person: an order can cause them if no behavior does.
PERSON_EVENTS = frozenset(
    {EventKind.ACTIVITY, EventKind.CAME_HOME, EventKind.LEFT_HOME, EventKind.USES}
)
# Events of every robot: interventions cause them.
ROBOT_EVENTS = frozenset(
    {
        EventKind.ALLOWED, EventKind.BANNED, EventKind.CALLED, EventKind.LOCALIZATION_LOST,
        EventKind.RELOCALIZED, EventKind.WITHDRAWS,
    }
)  # fmt: skip
DOOR_EVENTS = frozenset({EventKind.OPENED, EventKind.SHUT, EventKind.LOCKED, EventKind.UNLOCKED})
HOME_EVENTS = frozenset(
    {EventKind.MOVED, EventKind.ROOM_CHANGED, EventKind.LIGHT_ON, EventKind.LIGHT_OFF}
)
SENSOR_EVENTS = frozenset({EventKind.SENSOR})
# Events whose detail names a user, or a robot.
ABOUT_USERS = (
    EventKind.USER_SEEN, EventKind.USER_LOST, EventKind.FIND_BEGINS, EventKind.FOUND,
    EventKind.GAVE_UP, EventKind.NOT_AT_HOME, EventKind.FOLLOWS, EventKind.LOST,
    EventKind.APPROACHES, EventKind.INTERACTS, EventKind.INTERACTION_OVER,
)  # fmt: skip
# Events whose detail is what a robot wants of whom.
OF_REQUESTS = (
    EventKind.DUE, EventKind.EXPIRED, EventKind.ASKS, EventKind.ACCEPTED, EventKind.DECLINED,
    EventKind.DEFERRED, EventKind.IGNORED, EventKind.MISTAKEN, EventKind.DELIVERED,
)  # fmt: skip
ABOUT_ROBOTS = (EventKind.ROBOT_SEEN, EventKind.ROBOT_LOST)


def possible_events(
    users: Iterable[Actor],
    robots: Iterable[Actor],
    home: Home,
    doors: Sequence[str],
    sensors: Iterable[str],
) -> dict[str, frozenset[str]]:
    """Return the kinds of events that can happen to each entity, by name; "" is the home."""
    users, robots = list(users), list(robots)
    may_block = bool(doors or home.costs_version)
    kinds: dict[str, frozenset[str]] = {"": frozenset(HOME_EVENTS)}
    kinds |= {u.name: _kinds_of(u, PERSON_EVENTS, bool(robots), may_block) for u in users}
    kinds |= {r.name: _kinds_of(r, ROBOT_EVENTS, bool(users), may_block) for r in robots}
    return kinds | dict.fromkeys(doors, DOOR_EVENTS) | dict.fromkeys(sensors, SENSOR_EVENTS)


def _kinds_of(
    actor: Actor, always: Iterable[str], sees_somebody: bool, may_block: bool
) -> frozenset[str]:
    """Return the kinds of events that can happen to a body."""
    kinds = {str(kind) for kind in always}
    if actor.entity.eyes and sees_somebody:
        kinds |= set(actor.entity.sight_events)
    if getattr(actor.entity, "battery", None) is not None:
        kinds.add(EventKind.BATTERY)
    if getattr(actor.entity, "gives_way", None) is not None:
        kinds |= {EventKind.GIVES_WAY, EventKind.GIVES_UP}
    if may_block:
        kinds.add(EventKind.WAY_BLOCKED)
    if actor.requests is not None:
        kinds |= REQUEST_EVENTS
    for behavior in actor.behaviors:
        kinds |= behavior.records
    if _is_own(actor):
        kinds |= KINDS  # it may record any of them
    return frozenset(kinds)


def possible_details(
    users: Iterable[Actor], robots: Iterable[Actor], acts: Iterable[Mapping[str, Any]]
) -> dict[str, list[str]]:
    """Return the details that events can have where all are known: by kind, or kind and entity.

    Args:
        users: The users.
        robots: The robots.
        acts: The interventions that are scheduled or done: `fleet2d.interventions` as data.
    """
    users, robots, acts = list(users), list(robots), list(acts)
    people, names = [user.name for user in users], [robot.name for robot in robots]
    details: dict[str, list[str]] = {}
    if not any(_is_own(robot) for robot in robots):
        details |= dict.fromkeys(ABOUT_USERS, people)
        calls = [f"{do} {name}" for do in ("come", "find") for name in people]
        details[EventKind.CALLED] = ["dock", *calls]
    details |= dict.fromkeys(ABOUT_ROBOTS, names)
    for robot in robots:
        wanted = {} if robot.requests is None else robot.requests.interactions
        for name, interaction in wanted.items() if not _is_own(robot) else ():
            texts = [f"{name} {person}" for person in interaction.people]
            for kind in OF_REQUESTS:
                details[f"{kind} {robot.name}"] = [
                    *details.get(f"{kind} {robot.name}", []), *texts
                ]  # fmt: skip
    for user in users:
        # A log may hold any activities, and so may a class of the user's own.
        if not _is_own(user) and "replay" not in {b.type_name for b in user.behaviors}:
            told = [a["what"] for a in acts if a["do"] == "activity" and a["entity"] == user.name]
            known = [name for behavior in user.behaviors for name in behavior.activities()]
            details[f"{EventKind.ACTIVITY} {user.name}"] = [*known, *told]
    own = [details.get(f"{EventKind.ACTIVITY} {name}") for name in people]
    if all(activities is not None for activities in own):
        details[EventKind.ACTIVITY] = [name for activities in own for name in activities or ()]
    return details


def _is_own(actor: Actor) -> bool:
    """Whether a body has a behavior that isn't Fleet2D's."""
    return any(not type(b).__module__.startswith("fleet2d.") for b in actor.behaviors)


TABLE = "violations"

# The chance of a lens that notices all bodies in view.
CERTAIN = 2**53


class ActiveExpectation(NamedTuple):
    """An expectation and the step from which it holds.

    Attributes:
        expectation: The expectation, about names of the run.
        since: The step.
        text: The expectation as it was written.
        notes: Notes on it for readers.
    """

    expectation: Expectation
    since: int
    text: str
    notes: tuple[str, ...]


class RunExpectations:
    """The expectations of a run, and the gauges that measure their signals.

    Attributes:
        entries: The expectations by name.
    """

    def __init__(
        self,
        scenario: Scenario,
        actors: Sequence[DecidingActor],
        bodies: Bodies,
        changes: ChangeQueue,
        sensors: Sensors,
        cameras: Sequence[Cameras],
        activities: Activities,
        interventions: InterventionQueue,
    ) -> None:
        self.entries: dict[str, ActiveExpectation] = {}
        self._run = MeasuredRun(
            actors,
            bodies,
            changes.home,
            changes.clock,
            changes.names,
            sensors.on,
            {c.owner.name: ExpectedCameras(c, self) for c in cameras},
            activities,
        )
        self.actors, self.bodies, self.clock = actors, bodies, changes.clock
        self._scenario, self._sensors, self._queue = scenario, sensors, interventions
        self._gauges: dict[str, Gauge] = {}
        self._events: list[Event] = []

    @property
    def first(self) -> int:
        """The first step that isn't measured yet."""
        return self._run.first

    def add(self, name: str, expectation: Expectation, since: int, first: int) -> None:
        """Add an expectation.

        Args:
            name: Its name.
            expectation: The expectation.
            since: The step from which on it is judged.
            first: The present step, from which on its signals are measured.

        Raises:
            ScenarioError: It names something unknown or an impossible event, or lasts too long.
            InputError: It has no time, or there is another one of that name.
        """
        expectation, scene = check_judged(expectation), self._scene(since)
        text = str(expectation)
        expectation = expectation.resolved(scene)
        expectation.check(scene)
        if name in self.entries:
            raise InputError(f"{name!r} is expected already: give this another name")
        self._run.first, self._run.sensors_on = first, self._sensors.on
        for signal in expectation.measures():
            if str(signal) not in self._gauges:
                self._gauges[str(signal)] = Gauge(signal, self._run)
        self.entries[name] = ActiveExpectation(expectation, since, text, tuple(scene.notes))

    def _scene(self, since: int) -> Scene:
        """Return the names of the run that expectations from a step on may use."""
        users, robots = self.actors[: self.bodies.users], self.actors[self.bodies.users :]
        home, clock = self._run.home, self.clock
        rooms = [name for room in home.rooms for name in (room.name, room.type)]
        names = {
            "users": [actor.name for actor in users],
            "robots": [actor.name for actor in robots],
            "bodies": [actor.name for actor in self.actors],
            "batteries": [actor.name for actor in self.actors if actor.charge is not None],
            "rooms": rooms,
            "places": [*rooms, *(item.name for item in home.plan.objects)],
            "doors": self._run.doors,
            "sensors": self._sensors.names,
            "algorithms": list(self._scenario.algorithms),
            "metrics": list(self._scenario.metrics),
        }
        return Scene(
            names,
            {name: c.names for name, c in self._run.cameras.items()},
            possible_events(users, robots, home, self._run.doors, self._sensors.names),
            possible_details(users, robots, self._queue.acts),
            home.plan.bounds,
            (clock.steps - since) * clock.step_us * MICROSECOND,
        )

    # Measuring

    def take_events(self, events: Sequence[Event]) -> None:
        """Collect events until `take` measures their steps."""
        self._events += events

    def begin_plan(self, actor: DecidingActor) -> None:
        """Note that a body begins a plan."""
        for gauge in self._gauges.values():
            gauge.signal.begin_plan(actor, gauge)

    def learned(self, step: int, learners: Learners) -> None:
        """Note the outputs of algorithms and the results of metrics before a step."""
        results = {
            learner.name: learner.component.result
            for learner in learners.all
            if isinstance(learner.component, Metric) and learner.since == step
        }
        for gauge in self._gauges.values():
            gauge.signal.learn(learners.fresh, results, gauge)

    def take(self, end: int, observations: I64, readings: Sequence[SensorRow]) -> None:
        """Measure the signals up to step `end` - 1, in which the home doesn't change.

        Args:
            end: One past the last step.
            observations: The observations of robots, int64 (n, OBSERVATION).
            readings: The readings of sensors.
        """
        names, rest = self._sensors.names, [e for e in self._events if e.step >= end]
        events = [event for event in self._events if event.step < end]
        block = SignalBlock(
            self.first,
            end,
            self.bodies,
            self._run.home,
            observations,
            [(row.step, names[row.sensor], row.on) for row in readings],
            sorted(events, key=lambda event: (event.step, event.rank)),
        )
        for gauge in self._gauges.values():
            gauge.take(block)
        self._run.first, self._events = end, rest

    # Judging

    def verdicts(self, *, ended: bool) -> dict[str, Verdict]:
        """Return the present verdicts on what has begun, by name.

        Args:
            ended: Whether the run is over.
        """
        return {
            name: self._verdict(name, entry, ended)
            for name, entry in self.entries.items()
            if self.first > entry.since
        }

    @property
    def are_decided(self) -> bool:
        """Whether nothing can change the verdicts any more, before the end of the run."""
        return all(
            self.first > entry.since
            and is_decided(entry.expectation, self._signals(entry, ended=False))
            for entry in self.entries.values()
        )

    def evidence(self, name: str) -> VerdictEvidence:
        """Return what an expectation is about, with its signals so far."""
        entry = self.entries[name]
        return evidence_of(entry.expectation, self._signals(entry, ended=True))

    def _verdict(self, name: str, entry: ActiveExpectation, ended: bool) -> Verdict:
        verdict = verdict_of(name, entry.expectation, self._signals(entry, ended), entry.text)
        return replace(verdict, notes=entry.notes)

    def _signals(self, entry: ActiveExpectation, ended: bool) -> RunSignals:
        gauges = {str(s): self._gauges[str(s)] for s in entry.expectation.measures()}
        return RunSignals(
            {key: gauge.trace() for key, gauge in gauges.items()},
            {key: gauge.words for key, gauge in gauges.items()},
            entry.since,
            self.first,
            ended,
            self.clock,
        )

    def finish(self, results: Mapping[str, Any], store: RunStore, *, ended: bool) -> dict[str, Any]:
        """Store the table of violations; return the content of all verdicts for the manifest.

        Args:
            results: The results of the metrics over the whole run.
            store: The store for the table of violations.
            ended: Whether the run is complete.
        """
        for gauge in self._gauges.values():
            gauge.signal.finish(results, gauge)
        verdicts = self.verdicts(ended=ended)
        self._store_violations(store, verdicts)
        return {name: verdict.content() for name, verdict in verdicts.items()}

    def _store_violations(self, store: RunStore, verdicts: Mapping[str, Verdict]) -> None:
        """Store a row for each violation, in order of its first step."""
        names = tuple(sorted(verdicts))  # the keys of a manifest are sorted, too
        columns = (
            STEP,
            TIME,
            Column("expectation", "category", categories=names),
            Column("last_step", "int64", description="last step of the violation"),
            Column("worst_step", "int64", description="the first at which it is worst"),
            Column("robustness", "float64", nullable=True, description="missing: infinite"),
        )
        store.add_table(TableSpec(TABLE, columns, "the violations of expectations"))
        rows = sorted(
            (v, names.index(n)) for n, verdict in verdicts.items() for v in verdict.violations
        )
        if not rows:
            return
        first, last, robustness, worst = zip(*(row[0] for row in rows), strict=True)
        step, value = np.array(first, np.int64), np.array(robustness)
        store.append(
            TABLE,
            step=step,
            time=self.clock.times(step),
            expectation=np.array([code for _, code in rows], np.int32),
            last_step=np.array(last, np.int64),
            worst_step=np.array(worst, np.int64),
            robustness=np.where(np.isfinite(value), value, np.nan),
        )


@dataclass(frozen=True)
class ExpectedCameras:
    """The cameras of a body as `fleet2d.expectations.signals.MeasuredCameras` describes them."""

    cameras: Cameras
    run: RunExpectations

    @property
    def names(self) -> list[str]:
        """The bodies that they look at, by their numbers."""
        return [other.name for other in self.cameras.others]

    @property
    def index(self) -> int:
        """The number of the owner among the robots, or among the users."""
        return self.cameras.index

    @property
    def in_view(self) -> Mapping[str, object]:
        """The bodies that count as seen at present, by name."""
        return self.cameras.in_view

    def perfect(self) -> "PerfectCameras":
        """Return cameras that notice all bodies in view at each step, from the present one on."""
        cameras, run = self.cameras, self.run
        perfect = PerfectCameras(
            cameras.row, run.actors, run.bodies.users, cameras.method, cameras.radii
        )
        perfect.bodies, perfect.next_step = run.bodies, run.first
        return perfect


class PerfectCameras(Cameras):
    """Cameras that look at every step, and notice all bodies in view at once.

    Attributes:
        bodies: The bodies of the run.
    """

    bodies: Bodies

    def _set_up(self) -> SightMemory:
        memory = super()._set_up()
        lenses = self.lenses
        self.lenses = lenses._replace(
            chance=np.full_like(lenses.chance, CERTAIN),
            period=np.ones_like(lenses.period),
            latency=np.zeros_like(lenses.latency),
            errs=np.zeros_like(lenses.errs),
        )
        self.rule, self.sighting_errors = self.rule._replace(patience=1), None
        return memory

    def look(self, end: int) -> Sequence[Event]:
        """Look in the steps up to `end` - 1; return the events of seeing and losing."""
        events = self.take(self.bodies, end)
        self.collect()
        return events
