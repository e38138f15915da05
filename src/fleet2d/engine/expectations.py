"""Expectations of a run: measured during the run, judged at any time and at its end."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from fleet2d.algorithms.history import SensorRow
from fleet2d.algorithms.observations import SightingTable
from fleet2d.artifacts.store import RunStore
from fleet2d.artifacts.table import Column, moment_columns
from fleet2d.configuration.units import MICROSECOND
from fleet2d.engine.basis import Watcher
from fleet2d.engine.intervention_queue import InterventionQueue
from fleet2d.engine.possible_events import possible_details, possible_events
from fleet2d.engine.sensors import Sensors
from fleet2d.entities.decisions import DecidingActor
from fleet2d.errors import InputError
from fleet2d.expectations.expectation import Expectation, RunSignals
from fleet2d.expectations.signals import Gauge, MeasuredRun, Outputs, Results, Scene, SignalBlock
from fleet2d.expectations.verdict import (
    Verdict,
    VerdictEvidence,
    check_judged,
    evidence_of,
    is_decided,
    verdict_of,
)
from fleet2d.metrics.limits import limits_of
from fleet2d.runtime.events import Event
from fleet2d.scenario.model import Scenario

TABLE = "violations"


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


class RunExpectations(Watcher):
    """The expectations of a run, and the gauges that measure their signals.

    Attributes:
        entries: The expectations by name.
    """

    def __init__(
        self,
        scenario: Scenario,
        run: MeasuredRun,
        sensors: Sensors | None,
        queue: InterventionQueue,
    ) -> None:
        self.entries: dict[str, ActiveExpectation] = {}
        self._run = run
        self.actors = run.actors
        self.bodies = run.bodies
        self.clock = run.clock
        self._scenario = scenario
        self._sensors = sensors
        self._queue = queue
        self._sensor_names = [] if sensors is None else sensors.names
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
            ScenarioError: The expectation names something unknown or an impossible event, or lasts
                too long.
            InputError: It has no time, or there is another one of that name.
        """
        expectation = check_judged(expectation)
        scene = self._scene(since)
        text = str(expectation)
        expectation = expectation.resolved(scene)
        expectation.check(scene)
        if name in self.entries:
            raise InputError(f"{name!r} is expected already: give this another name")
        self._run.first = first
        self._run.sensors_on = {} if self._sensors is None else self._sensors.on
        for signal in expectation.measures():
            if str(signal) not in self._gauges:
                self._gauges[str(signal)] = Gauge(signal, self._run)
        self.entries[name] = ActiveExpectation(expectation, since, text, tuple(scene.notes))

    def _scene(self, since: int) -> Scene:
        """Return the names of the run that expectations from a step on may use."""
        users = self.actors[: self.bodies.users]
        robots = self.actors[self.bodies.users :]
        home = self._run.home
        clock = self.clock
        rooms = [name for room in home.rooms for name in room.words]
        names = {
            "users": [actor.name for actor in users],
            "robots": [actor.name for actor in robots],
            "bodies": [actor.name for actor in self.actors],
            "batteries": [actor.name for actor in self.actors if actor.charge is not None],
            "rooms": rooms,
            "places": [*rooms, *(item.name for item in home.plan.objects)],
            "doors": self._run.doors,
            "sensors": self._sensor_names,
            "algorithms": list(self._scenario.algorithms),
            "metrics": list(self._scenario.metrics),
        }
        looked_at = {by: cameras.other_names for by, cameras in self._run.cameras.items()}
        metrics = self._scenario.metrics.items()
        return Scene(
            names,
            looked_at,
            possible_events(users, robots, home, self._run.doors, self._sensor_names),
            possible_details(users, robots, self._queue.acts),
            home.plan.bounds,
            (clock.steps - since) * clock.step_us * MICROSECOND,
            self._scenario.interactions,
            {name: partial(limits_of, metric) for name, metric in metrics},
        )

    def take_events(self, events: Sequence[Event]) -> None:
        """Collect events until `settle` measures their steps."""
        self._events += events

    def begin_plan(self, actor: DecidingActor) -> None:
        """Note that a body begins a plan."""
        for gauge in self._gauges.values():
            gauge.signal.begin_plan(actor, gauge)

    def learn(self, outputs: Outputs, results: Results) -> None:
        """Note the outputs of algorithms and the results of metrics."""
        for gauge in self._gauges.values():
            gauge.signal.learn(outputs, results, gauge)

    def settle(self, end: int, observations: SightingTable, readings: Sequence[SensorRow]) -> None:
        """Measure the signals up to step `end` - 1; see `Watcher.settle`."""
        names = self._sensor_names
        states = [(row.step, names[row.sensor], row.on) for row in readings]
        rest = [event for event in self._events if event.step >= end]
        events = [event for event in self._events if event.step < end]
        events.sort(key=lambda event: (event.step, event.rank))
        home = self._run.home
        bodies = self.bodies
        block = SignalBlock(self.first, end, bodies, home, observations, states, events)
        for gauge in self._gauges.values():
            gauge.take(block)
        self._run.first = end
        self._events = rest

    def verdicts(self, *, ended: bool) -> dict[str, Verdict]:
        """Return the present verdicts on the expectations that have begun, by name.

        Args:
            ended: Whether the run is over.
        """
        verdicts = {}
        for name, entry in self.entries.items():
            if self.first > entry.since:
                signals = self._signals(entry, ended)
                verdict = verdict_of(name, entry.expectation, signals, entry.text)
                verdicts[name] = replace(verdict, notes=entry.notes)
        return verdicts

    @property
    def are_decided(self) -> bool:
        """Whether nothing before the end of the run can change the verdicts any more."""
        return all(
            self.first > entry.since
            and is_decided(entry.expectation, self._signals(entry, ended=False))
            for entry in self.entries.values()
        )

    def evidence(self, name: str) -> VerdictEvidence:
        """Return the subjects of an expectation, with its signals so far."""
        entry = self.entries[name]
        return evidence_of(entry.expectation, self._signals(entry, ended=True))

    def _signals(self, entry: ActiveExpectation, ended: bool) -> RunSignals:
        keys = map(str, entry.expectation.measures())
        gauges = {key: self._gauges[key] for key in keys}
        traces = {key: gauge.trace() for key, gauge in gauges.items()}
        words = {key: gauge.words for key, gauge in gauges.items()}
        return RunSignals(traces, words, entry.since, self.first, ended, self.clock)

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
        rows = sorted(
            (violation, code)
            for code, name in enumerate(names)
            for violation in verdicts[name].violations
        )
        step = np.array([violation.first for violation, _ in rows], np.int64)
        robustness = np.array([violation.robustness for violation, _ in rows])
        last = Column("last_step", "int64", description="last step of the violation")
        worst = Column("worst_step", "int64", description="the first at which it is worst")
        value = Column("robustness", "float64", nullable=True, description="missing: infinite")
        columns = {
            **moment_columns(self.clock, step),
            Column("expectation", "category", categories=names): [code for _, code in rows],
            last: [violation.last for violation, _ in rows],
            worst: [violation.worst for violation, _ in rows],
            value: np.where(np.isfinite(robustness), robustness, np.nan),
        }
        store.add_rows(TABLE, columns, "the violations of expectations")
