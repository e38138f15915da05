"""A search as tasks for workers: settings are asked of Optuna, run on homes, and told back."""

import pickle
from collections import deque
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from fleet2d.errors import ComponentError, Fleet2DError
from fleet2d.scenario.compose import assignment, changed
from fleet2d.scenario.model import Scenario, scenario_of
from fleet2d.studies.choice import key_path
from fleet2d.studies.design import Design
from fleet2d.studies.engine import Prefix, describe_error, flat_numbers
from fleet2d.studies.record import Task
from fleet2d.studies.sampling import Parameter, rounded
from fleet2d.studies.schedule import Schedule
from fleet2d.trust import Trust, current_trust, under

if TYPE_CHECKING:
    import optuna

MOST_KEPT = 40  # runs under way that a process keeps for the next stage of their trial
FAILURE = "failure"  # what Optuna keeps the reason of a failed trial under


@dataclass(frozen=True)
class TrialTask(Task):
    """One variant with one setting, up to a simulated time.

    Attributes:
        trial: The number of the trial.
        settings: The values of the searched parameters.
        until_s: Simulated time at which it ends [s]; None: that of the scenario.
    """

    trial: int = 0
    settings: Mapping[str, Any] = field(default_factory=dict)
    until_s: float | None = None


@dataclass
class TrialJob:
    """Runs a variant with a setting, and returns its objectives.

    Attributes:
        design: The variants.
        search: The searched parameters.
        objectives: The names of the numbers.
        trust: Whose code may run, in whichever process.
    """

    design: Design
    search: Mapping[str, Parameter]
    objectives: tuple[str, ...]
    trust: Trust | None = field(default_factory=current_trust)
    _kept: dict[tuple[int, int], Prefix] = field(default_factory=dict, repr=False)

    def scenario(self, index: int, settings: Mapping[str, Any]) -> Scenario:
        """Return a variant with a setting.

        Raises:
            ScenarioError: The setting is none that the scenario can have.
        """
        scenario = self.design.scenario(index)
        changes = [
            assignment(
                key_path(self.search[name].key),
                self.search[name].written(value),
                f"tune.search.{name} = {value}",
            )
            for name, value in settings.items()
        ]
        document = changed(scenario._document, changes)
        return scenario_of(document, scenario.folder)

    def __call__(self, task: Task) -> bytes:
        """Return (objectives, error), pickled; one of them is None."""
        assert isinstance(task, TrialTask)
        try:
            with under(self.trust):
                metrics = self._metrics(task)
            numbers = dict(flat_numbers(metrics))
            missing = [name for name in self.objectives if name not in numbers]
            if missing:
                raise ComponentError(f"the run came to no number {missing[0]!r}")
            return pickle.dumps(([numbers[name] for name in self.objectives], None))
        except Exception as error:  # noqa: BLE001 - a component may raise anything; it is reported
            return pickle.dumps((None, describe_error(error)))

    def _metrics(self, task: TrialTask) -> Mapping[str, Any]:
        """Return the metrics as of the end of a stage; go on with what this process keeps of it."""
        key = task.trial, task.index
        prefix = self._kept.pop(key, None)
        if prefix is None:
            prefix = Prefix(self.scenario(task.index, task.settings))
        metrics = prefix.until(task.until_s).metrics
        if task.until_s is not None and not prefix.done:
            self._kept[key] = prefix
            while len(self._kept) > MOST_KEPT:  # of trials given up, which no message tells of
                del self._kept[next(iter(self._kept))]
        return metrics


@dataclass
class _Running:
    """A trial under way: at which of its stages, and what is known of it."""

    trial: "optuna.Trial"
    settings: dict[str, Any]
    stage: int = 0
    found: list[list[float]] = field(default_factory=list)
    error: str | None = None
    left: int = 0


class TrialSchedule(Schedule):
    """Tasks of a search: a new trial is asked for when workers have nothing else to do.

    A trial runs all variants up to each time of `prune_at` before it goes on to the next; Optuna
    decides in between whether it is worth going on. A variant goes on with the worker that keeps
    it: another takes it only if nothing else is left, and runs it from the start.
    """

    def __init__(
        self,
        study: "optuna.Study",
        search: Mapping[str, Parameter],
        variants: Sequence[tuple[int, str]],
        stages: Sequence[float | None],
        trials: int,
    ) -> None:
        """Ask nothing yet.

        Args:
            study: Optuna's.
            search: The searched parameters.
            variants: Index in the design and home of each variant that a trial runs.
            stages: Simulated times up to which a trial runs [s]; the last is None.
            trials: How many trials are to begin.
        """
        super().__init__(())
        self._study, self._search = study, search
        self._variants, self._stages = variants, stages
        self._to_begin = trials
        self._running: dict[int, _Running] = {}
        self._waiting: deque[TrialTask] = deque()
        self._keepers: dict[tuple[int, int], Hashable] = {}
        self._numbers = 0

    def __len__(self) -> int:
        """Return how many tasks there may be."""
        return len(self._waiting) + self._to_begin * len(self._variants)

    def __bool__(self) -> bool:
        """Return whether there is anything left to take."""
        return bool(self._waiting or self._to_begin)

    def take(self, worker: Hashable) -> Task | None:
        """Return the next task: one to go on with, to begin with, of a new trial, or any left."""
        task = self._waiting_for(worker)
        if task is None and self._to_begin:
            self._to_begin -= 1
            trial = self._study.ask()
            settings = {name: suggested(trial, name, p) for name, p in self._search.items()}
            self._running[trial.number] = running = _Running(trial, settings)
            self._begin_stage(running)
            task = self._waiting_for(worker)
        task = task or (self._waiting[0] if self._waiting else None)
        if task is not None:
            self._waiting.remove(task)
            self._keepers[task.trial, task.index] = worker
        return task

    def _waiting_for(self, worker: Hashable) -> TrialTask | None:
        """Return the first task that a worker goes on with, else one that nobody has begun with."""
        keepers = [self._keepers.get((task.trial, task.index)) for task in self._waiting]
        for keeper in (worker, None):
            if keeper in keepers:
                return self._waiting[keepers.index(keeper)]
        return None

    def leave(self, worker: Hashable) -> None:
        """Give up what a worker kept: it is gone."""
        self._keepers = {key: keeper for key, keeper in self._keepers.items() if keeper != worker}

    def put_back(self, task: Task) -> None:
        """Let a task be taken again."""
        assert isinstance(task, TrialTask)
        self._waiting.appendleft(task)

    def finished(self, task: TrialTask, values: list[float] | None, error: str | None) -> bool:
        """Take in what came of a task; return whether its trial is over."""
        running = self._running[task.trial]
        running.left -= 1
        running.error = running.error or error
        if values is not None:
            running.found.append(values)
        if running.left:
            return False
        if running.error is None and self._goes_on(running):
            return False
        del self._running[task.trial]
        for index, _ in self._variants:
            self._keepers.pop((task.trial, index), None)
        return True

    def _begin_stage(self, running: _Running) -> None:
        until_s = self._stages[running.stage]
        running.found, running.left = [], len(self._variants)
        for index, home in self._variants:
            self._numbers += 1
            self._waiting.append(
                TrialTask(
                    self._numbers, index, "", home, running.trial.number, running.settings, until_s
                )
            )

    def _goes_on(self, running: _Running) -> bool:
        """Tell Optuna what a stage came to; return whether there is another."""
        means = [sum(values) / len(values) for values in zip(*running.found, strict=True)]
        until_s = self._stages[running.stage]
        if until_s is None:
            self._study.tell(running.trial, means)
            return False
        running.trial.report(means[0], int(until_s))
        if running.trial.should_prune():
            self._study.tell(running.trial, state=_state("PRUNED"))
            return False
        running.stage += 1
        self._begin_stage(running)
        return True

    def fail(self, task: TrialTask) -> None:
        """Tell Optuna that a trial failed."""
        trial = self._study.trials[task.trial]
        if not trial.state.is_finished():
            self._study.tell(task.trial, state=_state("FAIL"))


def suggested(trial: "optuna.Trial", name: str, parameter: Parameter) -> Any:
    """Return the value that Optuna wants tried."""
    if parameter.choices:
        return parameter.choices[trial.suggest_categorical(name, range(len(parameter.choices)))]
    assert parameter.low is not None
    assert parameter.high is not None
    if parameter.integer:
        low, high = int(parameter.low), int(parameter.high)
        return trial.suggest_int(name, low, high, log=parameter.log)
    return rounded(trial.suggest_float(name, parameter.low, parameter.high, log=parameter.log))


def _state(name: str) -> Any:
    from optuna.trial import TrialState

    return TrialState[name]


def check_settings(job: TrialJob, index: int) -> None:
    """Build a variant with the ends of each parameter's range, and with each of its choices.

    Raises:
        ScenarioError: A value is none that the scenario can have.
    """
    for name, parameter in job.search.items():
        for value in parameter.choices or (parameter.at(0.0), parameter.at(1.0)):
            try:
                job.scenario(index, {name: value})
            except Fleet2DError as error:
                raise type(error)(f"tune.search.{name}: {error}") from None
