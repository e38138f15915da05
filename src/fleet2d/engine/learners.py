"""Algorithms and metrics in a run: their order, when they are due, and what they put out."""

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.algorithm import Algorithm, Present
from fleet2d.algorithms.history import History, Log
from fleet2d.algorithms.learned import load_learned, save_learned
from fleet2d.algorithms.output import FROZEN, WITHHELD, Outputs, to_columns
from fleet2d.artifacts.store import RunStore
from fleet2d.artifacts.table import Column, Kind, TableSpec
from fleet2d.blame import blame
from fleet2d.clock import Clock
from fleet2d.errors import ComponentError, ScenarioError
from fleet2d.events import HOME, Event
from fleet2d.floorplan.home.home import Home
from fleet2d.metrics.metric import Metric
from fleet2d.problems import did_you_mean
from fleet2d.units import micros, whole_steps

KINDS: dict[str, Kind] = {"b": "bool", "i": "int64", "u": "int64", "f": "float64", "O": "category"}


@dataclass
class Learner:
    """An algorithm or a metric in a run.

    Attributes:
        component: The component with what it has learned.
        origin: The component as the scenario has it.
        every: Steps between two updates; 0 if events update it.
        table: The name of the table of what it puts out.
        kinds: The kinds of that table's columns; empty before the first output.
        since: First step of its next history.
        back: How many steps before that it may look back.
        heard: Whether an event that it waits for has happened.
    """

    name: str
    path: str
    component: Algorithm | Metric
    origin: Algorithm | Metric
    every: int
    table: str
    kinds: dict[str, Kind] = field(default_factory=dict)
    since: int = 0
    back: int = 0
    heard: bool = False

    @property
    def oldest(self) -> int:
        """The first step that it may still ask for."""
        return max(0, self.since - self.back)

    @property
    def due(self) -> int | None:
        """The step before which it is updated next: its history ends with the step before.

        None if that isn't known beforehand, as events update it.
        """
        return self.since + self.every if self.every else None


class Learners:
    """All algorithms, in the order of their dependencies, and then all metrics.

    Attributes:
        outputs: The newest output of each algorithm.
        fresh: Those of the last update.
        replaced: What all but metrics read of an algorithm instead; WITHHELD for nothing.
    """

    def __init__(
        self,
        algorithms: Mapping[str, Algorithm],
        metrics: Mapping[str, Metric],
        home: Home,
        clock: Clock,
        seed: int,
        names: tuple[Sequence[str], Sequence[str]],
        store: RunStore | None,
    ) -> None:
        self.home, self.clock, self.seed, self.store = home, clock, seed, store
        self.users, self.robots = tuple(names[0]), tuple(names[1])
        self.outputs: dict[str, Any] = {}
        self.fresh: dict[str, Any] = {}
        self.replaced: dict[str, Any] = {}
        self.all: list[Learner] = []
        self._known = tuple(algorithms)
        _check_reads(metrics, algorithms)
        for name in update_order(algorithms):
            self._add(name, f"algorithms.{name}", algorithms[name])
        for name, metric in metrics.items():
            self._add(name, f"metrics.{name}", metric)
        self._room_names = [room.name for room in home.rooms]
        self._due = self._earliest_due()
        self.awaited = frozenset(event for learner in self.all for event in learner.component.on)

    @property
    def readable(self) -> Mapping[str, Any]:
        """The outputs, for others to read."""
        return Outputs(self._as_read(self.outputs), self._known)

    @property
    def known(self) -> tuple[str, ...]:
        """The names of all algorithms."""
        return self._known

    def _as_read(self, outputs: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return outputs as all but metrics read them."""
        if not self.replaced:
            return outputs
        seen = {**outputs, **self.replaced}
        return {name: output for name, output in seen.items() if not _is(output, WITHHELD)}

    def replace(self, name: str, output: Any) -> None:
        """Let all but metrics read something else of an algorithm from now on.

        Args:
            name: The algorithm.
            output: What they read; FROZEN: its newest output, as it is now; WITHHELD: nothing;
                None: what it puts out, as before.
        """
        self.replaced = {key: value for key, value in self.replaced.items() if key != name}
        if _is(output, FROZEN):
            output = self.outputs.get(name, WITHHELD)
        if output is not None:
            self.replaced[name] = output

    def reset(self, name: str, learned: Path | None) -> None:
        """Let an algorithm begin anew, with what a file holds.

        Raises:
            InputError: The file holds nothing that it can begin with.
        """
        learner = next(each for each in self.all if each.path == f"algorithms.{name}")
        component = learner.origin.model_copy(deep=True)
        assert isinstance(component, Algorithm)
        with blame(learner.path, None):
            component.start(self.home)
            if learned is not None:
                component.recall(load_learned(learned))
        learner.component = component

    def next_due(self) -> int | None:
        """Return the step before which somebody is due; None if there is nobody."""
        return self._due  # asked for at every span

    def _earliest_due(self) -> int | None:
        dues = (learner.due for learner in self.all)
        return min((due for due in dues if due is not None), default=None)

    def earliest_needed(self) -> int:
        """Return the first step that is still part of somebody's next history."""
        return min(learner.oldest for learner in self.all)

    def update(self, end: int, log: Log, happened: Sequence[Event] = ()) -> None:
        """Update everybody whose period ends before step `end`, or who waits for what happened."""
        fresh: dict[str, Any] = {}
        for learner in self.all:
            if learner.due == end or self._hears(learner, happened):
                learner.heard = True
                component = learner.component  # metrics come last, and see all
                reads = component.reads if isinstance(component, Algorithm) else fresh
                seen = {**self.outputs, **{name: fresh[name] for name in reads if name in fresh}}
                if isinstance(component, Algorithm):
                    seen = dict(self._as_read(seen))
                output = self._update(learner, end, log, seen)
                learner.since = end
                if isinstance(learner.component, Algorithm) and output is not None:
                    # A copy: a component may go on with its own arrays.
                    fresh[learner.name] = copy.deepcopy(output)
        self.fresh, self._due = fresh, self._earliest_due()
        self.outputs = {**self.outputs, **fresh}  # a new one: who kept the old sees the old

    def _hears(self, learner: Learner, happened: Sequence[Event]) -> bool:
        """Tell whether one of these events updates an algorithm or a metric."""
        everybody = isinstance(learner.component, Metric)
        return any(
            event.event in learner.component.on
            and (everybody or event.entity == HOME or event.entity in self.robots)
            for event in happened
        )

    def finish(self, end: int, log: Log) -> dict[str, dict[str, Any]]:
        """Give metrics what is left of a period; return the results of all metrics by name."""
        results = {}
        for learner in self.all:
            if isinstance(learner.component, Metric):
                if learner.since < end:
                    self._update(learner, end, log, self.outputs)
                    learner.since = end
                with blame(learner.path, end):
                    results[learner.name] = checked_result(learner.component.result())
        return results

    def unheard(self) -> list[str]:
        """Say who waited for events of which none happened."""
        return [
            f"{learner.path} was never updated: no {' or '.join(learner.component.on)} happened"
            for learner in self.all
            if learner.component.on and not learner.heard
        ]

    def remember(self, directory: Path) -> list[str]:
        """Write what each algorithm has learned to a file of its own; return what can't be kept."""
        notes = []
        for learner in self.all:
            if isinstance(learner.component, Algorithm):
                try:
                    directory.mkdir(exist_ok=True)
                    with blame(learner.path, None):
                        state = learner.component.remember()
                        save_learned(state, directory / f"{learner.name}.npz", learner.path)
                except (ComponentError, OSError) as error:
                    notes.append(f"what {learner.path} has learned is not stored: {error}")
        return notes

    def _add(self, name: str, path: str, component: Algorithm | Metric) -> None:
        step_us = self.clock.step_us
        every = 0 if component.on else whole_steps(component.period, step_us, f"{path}.period")
        origin, component = component, component.model_copy(deep=True)
        with blame(path, None):
            component.start(self.home)
            if isinstance(component, Algorithm) and component.learned is not None:
                component.recall(load_learned(component.learned))
                component.check_learned(self.users, self.clock.start)
        # Metrics and algorithms may share a name; some file systems take A and a for one.
        taken = {*_FIXED, *(learner.table.casefold() for learner in self.all)}
        table = name
        while table.casefold() in taken:
            table = f"{path.partition('.')[0]}_{table}"
        back = -(micros(component.looks_back) // -self.clock.step_us)
        self.all.append(Learner(name, path, component, origin, every, table, back=back))

    def _update(self, learner: Learner, end: int, log: Log, outputs: Mapping[str, Any]) -> Any:
        knows_truth = isinstance(learner.component, Metric)
        visible = frozenset((*self.users, *self.robots) if knows_truth else self.robots)
        step_s = self.clock.step_us / 1e6
        needs = frozenset(learner.component.needs)
        history = History(log, learner.since, end, step_s, visible, learner.oldest, needs)
        state = Present(
            learner.path, end - 1, self.clock.time(end - 1), self.clock.start, self.home,
            self.users, self.robots, Outputs({**outputs}, self._known), self.seed
        )  # fmt: skip
        with blame(learner.path, end - 1):
            output = learner.component.update(history, state)
            if output is not None:
                columns = to_columns(output, self._room_names, learner.path)
                self._store(learner, end - 1, columns)
        return output

    def _store(self, learner: Learner, step: int, columns: dict[str, NDArray[Any]]) -> None:
        if self.store is None:
            return
        kinds = {name: KINDS[values.dtype.kind] for name, values in columns.items()}
        if not len(next(iter(columns.values()))):
            return  # nothing yet, not even the kinds of its columns
        if not learner.kinds:
            learner.kinds = kinds
            added = [Column(name, kind) for name, kind in kinds.items()]
            self.store.add_table(
                TableSpec(learner.table, (Column("step", "step"), Column("time", "time"), *added))
            )
        _check_kinds(learner, kinds)
        steps = np.full(len(next(iter(columns.values()))), step, np.int64)
        self.store.append(learner.table, step=steps, time=self.clock.times(steps), **columns)


def checked_result(result: Any, where: str = "result()") -> Any:
    """Return what sums up a metric: numbers and texts, in mappings and lists of any depth.

    Raises:
        ComponentError: It holds something else, or a number that isn't finite.
    """
    if isinstance(result, Mapping):
        return {str(k): checked_result(value, f"{where}[{k!r}]") for k, value in result.items()}
    if isinstance(result, list | tuple):
        return [checked_result(value, f"{where}[{i}]") for i, value in enumerate(result)]
    if isinstance(result, np.generic):
        result = result.item()
    if isinstance(result, float) and not math.isfinite(result):
        raise ComponentError(f"{where} is {result}: leave out what can't be told")
    if not isinstance(result, bool | int | float | str):
        raise ComponentError(f"{where} is {result!r}; numbers and texts are wanted")
    return result


_FIXED = {"trajectories", "key_frames", "observations", "events", "sensors", "violations"}


def _check_kinds(learner: Learner, kinds: Mapping[str, Kind]) -> None:
    """Refuse columns that don't fit the table that the first output made."""
    if kinds.keys() != learner.kinds.keys():
        raise ComponentError(
            f"{learner.path} put out {', '.join(kinds)}, but {', '.join(learner.kinds)} before: the"
            " names must be the same each time"
        )
    for name, kind in kinds.items():
        if kind != learner.kinds[name] and (kind, learner.kinds[name]) != ("int64", "float64"):
            raise ComponentError(
                f"{learner.path} put out {name!r} as {kind}, but as {learner.kinds[name]} before:"
                " the first output fixes what a column holds (0.0 for fractions, not 0)"
            )


def _check_reads(metrics: Mapping[str, Metric], algorithms: Mapping[str, Algorithm]) -> None:
    """Refuse metrics that measure an algorithm that there isn't."""
    for name, metric in metrics.items():
        for read in metric.reads():
            if read not in algorithms:
                raise ScenarioError(
                    f"metrics.{name} measures {read!r}, which is no algorithm of the scenario"
                    f"{did_you_mean(read, algorithms)} There are: {', '.join(algorithms) or 'none'}"
                )


def update_order(algorithms: Mapping[str, Algorithm]) -> list[str]:
    """Return the algorithms so that each stands behind those it reads; else as in the scenario.

    Raises:
        ScenarioError: One reads something that doesn't exist, or they read each other in a circle.
    """
    for name, algorithm in algorithms.items():
        for read in algorithm.reads:
            if read not in algorithms:
                raise ScenarioError(
                    f"algorithms.{name}.reads names {read!r}, which is no algorithm of the"
                    f" scenario; there are: {', '.join(algorithms)}{did_you_mean(read, algorithms)}"
                )
    sorter = TopologicalSorter({name: algorithm.reads for name, algorithm in algorithms.items()})
    try:
        return list(sorter.static_order())
    except CycleError as error:
        circle = " reads ".join(reversed(error.args[1]))
        raise ScenarioError(f"algorithms read each other in a circle: {circle}") from None


def _is(output: Any, word: str) -> bool:
    """Tell whether an output is a word: no algorithm puts out a bare text."""
    return isinstance(output, str) and output == word
