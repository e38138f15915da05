"""Algorithms and metrics in a run: their order, their updates, and their outputs."""

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.algorithm import (
    FROZEN,
    WITHHELD,
    Algorithm,
    Outputs,
    Present,
    load_learned,
    save_learned,
    to_columns,
)
from fleet2d.algorithms.history import History, Log
from fleet2d.artifacts.table import KINDS, Column, Kind, TableSpec, time_column
from fleet2d.configuration.problems import check_known
from fleet2d.configuration.units import micros, whole_steps
from fleet2d.engine.basis import Basis
from fleet2d.errors import ComponentError, Fleet2DError, ScenarioError, blame, errors_as
from fleet2d.metrics.metric import Metric
from fleet2d.runtime.events import HOME, Event


@dataclass
class Learner:
    """An algorithm or a metric in a run.

    Attributes:
        name: Its name in the scenario.
        path: Its path in the scenario.
        component: The component with what it has learned.
        origin: The component before the first step.
        every: Steps between two updates; 0 if events update it.
        table: The name of the table of its outputs.
        kinds: The kinds of that table's columns; empty before the first output.
        spec: That table; None before the first output.
        since: First step of the next history.
        back: Number of earlier steps that it may also read.
        is_updated: Whether it has been updated.
        known_from: The first step of which it knows anything; earlier ones were lost.
    """

    name: str
    path: str
    component: Algorithm | Metric
    origin: Algorithm | Metric
    every: int
    table: str
    kinds: dict[str, Kind] = field(default_factory=dict)
    spec: TableSpec | None = None
    since: int = 0
    back: int = 0
    is_updated: bool = False
    known_from: int = 0

    @property
    def oldest(self) -> int:
        """The first step that the learner may still read."""
        return max(0, self.since - self.back)

    @property
    def due(self) -> int | None:
        """The step after the last one of the next history.

        None if events update it.
        """
        return self.since + self.every if self.every else None


class Learners:
    """All algorithms, in the order of their dependencies, and then all metrics.

    Attributes:
        outputs: The latest output of each algorithm, by name.
        fresh: The outputs of the last update.
        known: The names of all algorithms.
        replaced: Outputs that all but metrics read instead, by name; WITHHELD: none.
        readable_outputs: The outputs for behaviors.
    """

    def __init__(self, basis: Basis) -> None:
        self.home = basis.home
        self.clock = basis.clock
        self.seed = basis.seed
        self.store = basis.store if basis.scenario.artifacts.outputs else None
        algorithms = basis.scenario.algorithms
        metrics = basis.scenario.metrics
        self.users = tuple(basis.scenario.users)
        self.robots = tuple(basis.scenario.robots)
        self.outputs: dict[str, Any] = {}
        self.fresh: dict[str, Any] = {}
        self.replaced: dict[str, Any] = {}
        self.all: list[Learner] = []
        self.known = tuple(algorithms)
        for name, metric in metrics.items():
            for algorithm in metric.reads():
                check_known(algorithm, "algorithm", algorithms, where=f"metrics.{name}: ")
        for name in update_order(algorithms):
            self._add(name, f"algorithms.{name}", algorithms[name])
        for name, metric in metrics.items():
            self._add(name, f"metrics.{name}", metric)
        self._room_names = [room.name for room in basis.home.rooms]
        self._due = self._earliest_due()
        self._show_outputs()
        self.awaited = frozenset(event for learner in self.all for event in learner.component.on)

    def results_at(self, step: int) -> dict[str, Callable[[], Any]]:
        """Return functions for the results of the metrics updated at a step, by name."""
        return {
            each.name: each.component.result
            for each in self.all
            if each.since == step and isinstance(each.component, Metric)
        }

    def results(self) -> dict[str, Any]:
        """Return the results of all metrics up to the end of their last period, by name."""
        return {
            each.name: check_result(each.component.result())
            for each in self.all
            if isinstance(each.component, Metric)
        }

    def _show_outputs(self) -> None:
        """Set the outputs that behaviors read, after some have changed."""
        self.readable_outputs = Outputs(self._as_read(self.outputs), self.known)

    def _as_read(self, outputs: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the outputs that all but metrics read."""
        if not self.replaced:
            return outputs
        merged = {**outputs, **self.replaced}
        return {name: output for name, output in merged.items() if not _is_marked(output, WITHHELD)}

    def replace(self, name: str, output: Any) -> None:
        """Let all but metrics read another output of an algorithm from now on.

        Args:
            name: The algorithm.
            output: The output; FROZEN: its present one; WITHHELD: none; None: its real outputs
                again.
        """
        self.replaced.pop(name, None)
        if _is_marked(output, FROZEN):
            output = self.outputs.get(name, WITHHELD)
        if output is not None:
            self.replaced[name] = output
        self._show_outputs()

    def reset(self, name: str, learned: Path | None) -> None:
        """Restart an algorithm with nothing learned, or with the content of a file.

        Raises:
            InputError: The file is damaged.
            ComponentError: The algorithm can't use the content.
        """
        learner = next(learner for learner in self.all if learner.path == f"algorithms.{name}")
        learner.component = self._start(learner.path, learner.origin, learned)

    def reboot(self, step: int, keeps: Callable[[str], bool]) -> None:
        """Let algorithms lose state that doesn't outlast a time in which no robot was on.

        Args:
            step: The step.
            keeps: Tells whether an algorithm, by its name, keeps its learned state.
        """
        self.outputs = dict(self.outputs)  # a new mapping: others may hold the old one
        for learner in self.all:
            old = learner.component
            is_kept = keeps(learner.name)
            if not isinstance(old, Algorithm) or (is_kept and not old.is_real_time):
                continue
            learned = getattr(learner.origin, "learned", None)
            learner.component = self._start(learner.path, learner.origin, learned)
            if is_kept and isinstance(learner.component, Algorithm):
                with blame(learner.path, step):
                    learner.component.recall(old.long_term_state())
            learner.known_from = step
            self.outputs.pop(learner.name, None)
        self._show_outputs()

    def _start(
        self, path: str, origin: Algorithm | Metric, learned: Path | None
    ) -> Algorithm | Metric:
        """Return a started copy of an algorithm or a metric, with the learned state of a file."""
        component = origin.model_copy(deep=True)
        with blame(path, None):
            component.start(self.home)
            if isinstance(component, Algorithm):
                component.check_times(self.clock)
            if isinstance(component, Algorithm) and learned is not None:
                component.recall(load_learned(learned))
                component.check_learned(self.users, self.clock.start)
        return component

    def next_due(self) -> int | None:
        """Return the step before which the next update is due; None if none is."""
        return self._due  # every span asks for it

    def _earliest_due(self) -> int | None:
        dues = (learner.due for learner in self.all)
        return min((due for due in dues if due is not None), default=None)

    def update(self, end: int, log: Log, events: Sequence[Event] = ()) -> None:
        """Update learners whose period ends before step `end`, or that wait for an event."""
        fresh: dict[str, Any] = {}
        for learner in self.all:
            if learner.due == end or self._waits_for(learner, events):
                learner.is_updated = True
                component = learner.component  # metrics come last, and read all outputs
                reads = component.reads if isinstance(component, Algorithm) else fresh
                newer = {name: fresh[name] for name in reads if name in fresh}
                inputs = {**self.outputs, **newer}
                if isinstance(component, Algorithm):
                    inputs = dict(self._as_read(inputs))
                output = self._update(learner, end, log, inputs)
                learner.since = end
                if isinstance(learner.component, Algorithm) and output is not None:
                    fresh[learner.name] = _copy(output)
        self.fresh = fresh
        self._due = self._earliest_due()
        self.outputs = {**self.outputs, **fresh}  # a new mapping: others may hold the old one
        self._show_outputs()

    def _waits_for(self, learner: Learner, events: Sequence[Event]) -> bool:
        """Return whether one of some events updates an algorithm or a metric."""
        is_metric = isinstance(learner.component, Metric)
        return any(
            event.event in learner.component.on
            and (is_metric or event.entity == HOME or event.entity in self.robots)
            for event in events
        )

    def measure(self, name: str, end: int, log: Log) -> dict[str, Any]:
        """Update a metric before the end of its period; return its result up to step `end` - 1."""
        learner = next(each for each in self.all if each.path == f"metrics.{name}")
        if learner.since < end:
            self._update(learner, end, log, self.outputs)
            learner.since = end
            self._due = self._earliest_due()
        result: dict[str, Any] = check_result(learner.component.result())  # type: ignore[union-attr]
        return result

    def finish(self, end: int, log: Log) -> dict[str, dict[str, Any]]:
        """Update metrics with the rest of their period; return the results of all by name."""
        results = {}
        for learner in self.all:
            if isinstance(learner.component, Metric):
                if learner.since < end:
                    self._update(learner, end, log, self.outputs)
                    learner.since = end
                with blame(learner.path, end):
                    results[learner.name] = check_result(learner.component.result())
        return results

    def idle_notes(self) -> list[str]:
        """Return notes on learners that no event has updated."""
        return [
            f"{learner.path} was never updated: no {' or '.join(learner.component.on)} happened"
            for learner in self.all
            if learner.component.on and not learner.is_updated
        ]

    def remember(self, directory: Path) -> list[str]:
        """Write the learned state of each algorithm to its own file; return notes on failures."""
        notes = []
        for learner in self.all:
            if isinstance(learner.component, Algorithm):
                try:
                    directory.mkdir(exist_ok=True)
                    with blame(learner.path, None):
                        state = learner.component.remember()
                        save_learned(state, directory / f"{learner.name}.npz", learner.path)
                except (Fleet2DError, OSError) as error:
                    notes.append(f"what {learner.path} has learned is not stored: {error}")
        return notes

    def _add(self, name: str, path: str, component: Algorithm | Metric) -> None:
        step_us = self.clock.step_us
        with blame(path, None):
            every = 0 if component.on else whole_steps(component.period, step_us, f"{path}.period")
        origin = component
        component = self._start(path, origin, getattr(origin, "learned", None))
        # Metrics and algorithms may share a name; some file systems don't distinguish A and a.
        tables = {*_RUN_TABLES, *(learner.table.casefold() for learner in self.all)}
        table = name
        while table.casefold() in tables:
            table = f"{path.partition('.')[0]}_{table}"
        back = -(micros(component.looks_back) // -self.clock.step_us)
        self.all.append(Learner(name, path, component, origin, every, table, back=back))

    def _update(self, learner: Learner, end: int, log: Log, outputs: Mapping[str, Any]) -> Any:
        is_metric = isinstance(learner.component, Metric)
        visible = frozenset((*self.users, *self.robots) if is_metric else self.robots)
        step_s = self.clock.step_us / 1e6
        needs = frozenset(learner.component.needs)
        history = History(
            log, learner.since, end, step_s, visible, learner.oldest, needs, learner.known_from
        )
        last = end - 1
        state = Present(
            learner.path, last, self.clock.time(last), self.clock.start, self.home,
            self.users, self.robots, Outputs({**outputs}, self.known), self.seed
        )  # fmt: skip
        with blame(learner.path, last):
            output = learner.component.update(history, state)
            if output is not None:
                columns = to_columns(output, self._room_names, learner.path)
                self._store(learner, last, columns)
        return output

    def _store(self, learner: Learner, step: int, columns: dict[str, NDArray[Any]]) -> None:
        if self.store is None:
            return
        kinds = {name: KINDS[values.dtype.kind] for name, values in columns.items()}
        if not len(next(iter(columns.values()))):
            return  # without rows, even the kinds of the columns are unknown
        if learner.spec is None:
            learner.kinds = kinds
            own = (Column(name, kind) for name, kind in kinds.items())
            time = replace(time_column(self.clock.zone), description="")
            columns_of_table = (Column("step", "step"), time, *own)
            learner.spec = TableSpec(learner.table, columns_of_table)
        _check_kinds(learner, kinds)
        self.store.add_table(learner.spec)  # the store of a branch doesn't have the table yet
        self.store.append(learner.table, step=step, time=self.clock.stamp(step), **columns)


def _copy(output: Any) -> Any:
    """Return a copy of an output: a component may continue to change its arrays.

    Arrays of columns hold numbers or texts, so texts are not copied one by one.
    """
    if type(output) is dict and all(isinstance(value, np.ndarray) for value in output.values()):
        return {name: values.copy() for name, values in output.items()}
    return copy.deepcopy(output)


def check_result(result: Any, where: str = "result()") -> Any:
    """Return the result of a metric: numbers and texts, in mappings and lists of any depth.

    Raises:
        ComponentError: The result contains something else, or a number that isn't finite.
    """
    if isinstance(result, Mapping):
        return {str(k): check_result(value, f"{where}[{k!r}]") for k, value in result.items()}
    if isinstance(result, list | tuple):
        return [check_result(value, f"{where}[{i}]") for i, value in enumerate(result)]
    if isinstance(result, np.generic):
        result = result.item()
    if isinstance(result, float) and not math.isfinite(result):
        raise ComponentError(f"{where} is {result}: leave out values that are undefined")
    if not isinstance(result, bool | int | float | str):
        raise ComponentError(f"{where} is {result!r}: return numbers and texts only")
    return result


_RUN_TABLES = {"trajectories", "key_frames", "observations", "events", "sensors", "violations"}


def _check_kinds(learner: Learner, kinds: Mapping[str, Kind]) -> None:
    """Refuse columns that don't fit the table of the first output."""
    if kinds.keys() != learner.kinds.keys():
        raise ComponentError(
            f"{learner.path} returned {', '.join(kinds)}, but {', '.join(learner.kinds)} before:"
            " the names must be the same each time"
        )
    for name, kind in kinds.items():
        if kind != learner.kinds[name] and (kind, learner.kinds[name]) != ("int64", "float64"):
            raise ComponentError(
                f"{learner.path} returned {name!r} as {kind}, but as {learner.kinds[name]} before:"
                " the first output fixes what a column holds (0.0 for fractions, not 0)"
            )


def update_order(algorithms: Mapping[str, Algorithm]) -> list[str]:
    """Return the algorithms in an order in which each follows those that it reads.

    Raises:
        ScenarioError: An algorithm reads an unknown one, or they read each other in a cycle.
    """
    for name, algorithm in algorithms.items():
        for source in algorithm.reads:
            check_known(source, "algorithm", algorithms, where=f"algorithms.{name}.reads: ")
        with errors_as(ComponentError, f"algorithms.{name}", of=ComponentError):
            algorithm.check_sources({source: algorithms[source] for source in algorithm.reads})
    sorter = TopologicalSorter({name: algorithm.reads for name, algorithm in algorithms.items()})
    try:
        return list(sorter.static_order())
    except CycleError as error:
        circle = " reads ".join(reversed(error.args[1]))
        raise ScenarioError(f"algorithms read each other in a cycle: {circle}") from None


def _is_marked(output: Any, mark: str) -> bool:
    """Return whether an output is a mark, FROZEN or WITHHELD; real outputs aren't bare text."""
    return isinstance(output, str) and output == mark
