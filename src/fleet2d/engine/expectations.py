"""Expectations of a run: measured during the run, judged at any time and at its end."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.log import SensorRow
from fleet2d.artifacts.store import RunStore
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.clock import Clock
from fleet2d.engine.gauges import Block, Gauge, ValueGauge
from fleet2d.engine.signal_gauges import BatteryGauge, gauge_of
from fleet2d.engine.state import State
from fleet2d.engine.tables import STEP, TIME
from fleet2d.entities.actor import Actor
from fleet2d.errors import InputError
from fleet2d.events import Event
from fleet2d.expectations.expectation import Expectation, RunSignals
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.signals import Measurement
from fleet2d.expectations.verdict import Verdict, check_judged, verdict_of
from fleet2d.metrics.metric import Metric
from fleet2d.scenario.model import Scenario
from fleet2d.units import MICROSECOND

TABLE = "violations"


@dataclass(frozen=True)
class ActiveExpectation:
    """An expectation and the step from which it holds."""

    expectation: Expectation
    since: int


class Expecting:
    """The expectations of a run, and the gauges that measure their signals.

    Attributes:
        entries: The expectations by name.
    """

    def __init__(self, clock: Clock) -> None:
        self.entries: dict[str, ActiveExpectation] = {}
        self._clock = clock
        self._gauges: dict[str, Gauge] = {}
        self._batteries: dict[str, BatteryGauge] = {}
        self._value_gauges: dict[tuple[str, str], list[ValueGauge]] = {}
        self._events: list[Event] = []
        self._end = 0

    def add(self, name: str, expectation: Expectation, since: int, state: State) -> None:
        """Add an expectation from a step on; its signals are measured from the present step on."""
        self._end = state.settled
        for signal in expectation.measures():
            if str(signal) not in self._gauges:
                self._measure(signal, state)
        self.entries[name] = ActiveExpectation(expectation, since)

    def _measure(self, signal: Measurement, state: State) -> None:
        gauge = gauge_of(signal, state, self._clock.step_us)
        self._gauges[str(signal)] = gauge
        if isinstance(gauge, BatteryGauge):
            self._batteries[signal.robot] = gauge  # type: ignore[attr-defined]
        if isinstance(gauge, ValueGauge):
            kind, path = type(signal).__name__, signal.path  # type: ignore[attr-defined]
            self._value_gauges.setdefault((kind, path.split(".")[0]), []).append(gauge)

    # Measuring

    def take_events(self, events: Sequence[Event]) -> None:
        """Collect events until `take` measures their steps."""
        self._events += events

    def begin_plan(self, actor: Actor) -> None:
        """Measure the battery of a body along its new plan."""
        if actor.name in self._batteries:
            self._batteries[actor.name].begin_plan(actor)

    def learned(self, step: int, state: State) -> None:
        """Measure the outputs of algorithms and the results of metrics before a step."""
        learners = state.learners
        for (kind, name), gauges in self._value_gauges.items():
            for gauge in gauges:
                if kind == "OutputSignal" and name in learners.fresh:
                    gauge.note(step, learners.fresh[name])
                elif kind == "MetricSignal":
                    self._note_metric(gauge, name, step, state)

    def _note_metric(self, gauge: ValueGauge, name: str, step: int, state: State) -> None:
        for learner in state.learners.all:
            metric = learner.component
            if learner.name == name and isinstance(metric, Metric) and learner.since == step:
                gauge.note(step, metric.result())

    def take(
        self,
        first: int,
        end: int,
        state: State,
        observations: NDArray[np.int64],
        readings: Sequence[SensorRow],
    ) -> None:
        """Measure the steps from `first` to `end` - 1, in which the home is as it is now."""
        events = [event for event in self._events if event.step < end]
        self._events = [event for event in self._events if event.step >= end]
        events.sort(key=lambda event: (event.step, event.rank))
        names = state.sensors.names
        block = Block(first, end, state.bodies, state.home, observations, readings, events, names)
        for gauge in self._gauges.values():
            gauge.take(block)
        self._end = end

    # Judging

    def verdicts(self, *, ended: bool) -> dict[str, Verdict]:
        """Return the present verdicts, by name.

        Args:
            ended: Whether the run is over.
        """
        verdicts = ((name, self.verdict(name, ended=ended)) for name in self.entries)
        return {name: verdict for name, verdict in verdicts if verdict is not None}

    def verdict(self, name: str, *, ended: bool) -> Verdict | None:
        """Return the verdict on one expectation; None before its first step."""
        entry = self.entries[name]
        if self._end <= entry.since:
            return None
        keys = [str(signal) for signal in entry.expectation.measures()]
        signals = RunSignals(
            {key: self._gauges[key].trace(self._end) for key in keys},
            {key: self._gauges[key].words for key in keys},
            entry.since,
            self._end,
            ended,
            self._clock,
        )
        return verdict_of(name, entry.expectation, signals)

    def finish(self, results: Mapping[str, Any], store: RunStore, *, ended: bool) -> dict[str, Any]:
        """Store the table of violations; return the content of all verdicts for the manifest.

        Args:
            results: The results of the metrics over the whole run.
            store: The store for the table of violations.
            ended: Whether the run is complete.
        """
        for (kind, name), gauges in self._value_gauges.items():
            if kind == "MetricSignal" and name in results:
                for gauge in gauges:
                    gauge.note(self._end - 1, results[name])
        verdicts = self.verdicts(ended=ended)
        store_violations(store, verdicts, self._clock)
        return {name: verdict.content() for name, verdict in verdicts.items()}


def store_violations(store: RunStore, verdicts: Mapping[str, Verdict], clock: Clock) -> None:
    """Store a row for each violation, in order of its first step."""
    names = tuple(sorted(verdicts))  # the keys of a manifest are sorted, too
    store.add_table(
        TableSpec(
            TABLE,
            (
                STEP,
                TIME,
                Column("expectation", "category", categories=names),
                Column("last_step", "int64", description="last step of the violation"),
                Column("worst_step", "int64", description="the first at which it is worst"),
                Column("robustness", "float64", nullable=True, description="missing: infinite"),
            ),
            "the violations of expectations",
        )
    )
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
        time=clock.times(step),
        expectation=np.array([code for _, code in rows], np.int32),
        last_step=np.array(last, np.int64),
        worst_step=np.array(worst, np.int64),
        robustness=np.where(np.isfinite(value), value, np.nan),
    )


def expect(
    state: State,
    scenario: Scenario,
    clock: Clock,
    name: str,
    expectation: Expectation,
    since: int,
) -> None:
    """Add an expectation to a run, from a step on.

    Raises:
        ScenarioError: It names something unknown or an impossible event, or lasts too long.
        InputError: It has no time, or there is another one of that name.
    """
    check_judged(expectation)
    expectation.check(
        scene_of(state, scenario, (clock.steps - since) * clock.step_us * MICROSECOND)
    )
    if state.expecting is None:
        state.expecting = Expecting(clock)
        state.events.sinks.append(state.expecting)
    if name in state.expecting.entries:
        raise InputError(f"{name!r} is expected already: give this another name")
    state.expecting.add(name, expectation, since, state)


def scene_of(state: State, scenario: Scenario, remaining: timedelta) -> Scene:
    """Return the names of a run that expectations may use."""
    users = state.bodies.users
    behaviors = {
        actor.name: [_type_of(behavior) for behavior in actor.behaviors] or ["own"]
        for actor in state.actors
    }
    return Scene(
        users=[actor.name for actor in state.actors[:users]],
        robots=[actor.name for actor in state.actors[users:]],
        rooms=[name for room in state.home.rooms for name in (room.name, room.type)],
        things=[item.name for item in state.home.plan.objects],
        doors=state.changes.names,
        sensors=state.sensors.names,
        algorithms=list(scenario.algorithms),
        metrics=list(scenario.metrics),
        batteries=[actor.name for actor in state.actors if actor.charge is not None],
        cameras={
            c.owner.name: [other.name for other in c.others] for c in [*state.gazes, *state.cameras]
        },
        behaviors=behaviors,
        records=[kind for a in state.actors for b in a.behaviors for kind in b.records],
        remaining=remaining,
    )


def _type_of(behavior: Any) -> str:
    """Return the type of a built-in behavior, "own" of any other."""
    name = str(behavior.type_name)
    return "own" if ":" in name or "." in name else name
