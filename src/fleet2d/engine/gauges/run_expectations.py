"""Expectations of a run: measured during the run, judged at any time and at its end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fleet2d.artifacts.store import RunStore
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.engine.gauges.block import Block
from fleet2d.engine.gauges.gauges import BatteryGauge, Gauge, ValueGauge
from fleet2d.engine.learners import Learners
from fleet2d.engine.trajectories import STEP, TIME
from fleet2d.entities.behavior import Actor
from fleet2d.expectations.expectation import Expectation, RunSignals
from fleet2d.expectations.signals import Measurement
from fleet2d.expectations.verdict import Verdict, verdict_of
from fleet2d.metrics.metric import Metric
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import Event

TABLE = "violations"


@dataclass(frozen=True)
class ActiveExpectation:
    """An expectation and the step from which it holds."""

    expectation: Expectation
    since: int


class RunExpectations:
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

    def add(
        self,
        name: str,
        expectation: Expectation,
        since: int,
        settled: int,
        gauge_of: Callable[[Measurement], Gauge],
    ) -> None:
        """Add an expectation from a step on.

        Args:
            name: Its name.
            expectation: The expectation.
            since: The step.
            settled: The present step, from which on its signals are measured.
            gauge_of: Makes the gauge of a signal.
        """
        self._end = settled
        for signal in expectation.measures():
            if str(signal) not in self._gauges:
                self._measure(signal, gauge_of(signal))
        self.entries[name] = ActiveExpectation(expectation, since)

    def _measure(self, signal: Measurement, gauge: Gauge) -> None:
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

    def learned(self, step: int, learners: Learners) -> None:
        """Measure the outputs of algorithms and the results of metrics before a step."""
        results = {
            learner.name: learner.component.result
            for learner in learners.all
            if isinstance(learner.component, Metric) and learner.since == step
        }
        for (kind, name), gauges in self._value_gauges.items():
            for gauge in gauges:
                if kind == "OutputSignal" and name in learners.fresh:
                    gauge.note(step, learners.fresh[name])
                elif kind == "MetricSignal" and name in results:
                    gauge.note(step, results[name]())

    def take(self, block: Block) -> None:
        """Measure the signals over a block of steps; its events are those of `take_events`."""
        events = [event for event in self._events if event.step < block.end]
        self._events = [event for event in self._events if event.step >= block.end]
        block.events = sorted(events, key=lambda event: (event.step, event.rank))
        for gauge in self._gauges.values():
            gauge.take(block)
        self._end = block.end

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
