"""A search as tasks for workers: Optuna suggests settings, workers run them on homes."""

import pickle
from collections import deque
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from fleet2d.errors import ComponentError, Fleet2DError
from fleet2d.scenario.compose import apply_changes, assignment
from fleet2d.scenario.model import Scenario, scenario_of
from fleet2d.studies.axes.choice import key_path
from fleet2d.studies.axes.sampling import Parameter, rounded
from fleet2d.studies.data.record import WorkerTask
from fleet2d.studies.design.variants import Design
from fleet2d.studies.execution.schedule import TaskSchedule
from fleet2d.studies.simulator import StagedRun, describe_error, flat_numbers
from fleet2d.sums import sum_in_order
from fleet2d.trust import Trust, current_trust, restrict

if TYPE_CHECKING:
    import optuna

MOST_RUNS = 40  # unfinished runs that a worker holds for the next stage of their trial
FAILURE = "failure"  # the attribute of a failed trial that holds the error


@dataclass(frozen=True)
class TrialTask(WorkerTask):
    """One variant with one setting, up to a simulated time.

    Attributes:
        trial: The number of the trial.
        settings: The values of the searched parameters.
        until_s: The simulated time at which the stage ends [s]; None: the end of the scenario.
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
        objectives: The names of the metrics.
        trust: The code that workers may run; None: any.
    """

    design: Design
    search: Mapping[str, Parameter]
    objectives: tuple[str, ...]
    trust: Trust | None = field(default_factory=current_trust)
    _runs: dict[tuple[int, int], StagedRun] = field(default_factory=dict, repr=False)

    def scenario(self, index: int, settings: Mapping[str, Any]) -> Scenario:
        """Return the scenario of a variant with a setting.

        Raises:
            ScenarioError: The scenario can't have that setting.
        """
        scenario = self.design.scenario(index)
        changes = [
            assignment(
                key_path(self.search[name].key),
                self.search[name].with_unit(value),
                f"tune.search.{name} = {value}",
            )
            for name, value in settings.items()
        ]
        document = apply_changes(scenario._document, changes)
        return scenario_of(document, scenario.folder)

    def __call__(self, task: WorkerTask) -> bytes:
        """Return (objectives, error), pickled; one of them is None."""
        assert isinstance(task, TrialTask)
        try:
            with restrict(self.trust):
                metrics = self._metrics(task)
            numbers = dict(flat_numbers(metrics))
            missing = [name for name in self.objectives if name not in numbers]
            if missing:
                raise ComponentError(f"the run has no metric {missing[0]!r}")
            return pickle.dumps(([numbers[name] for name in self.objectives], None))
        except Exception as error:  # noqa: BLE001 - a component may raise anything; it is reported
            return pickle.dumps((None, describe_error(error)))

    def _metrics(self, task: TrialTask) -> Mapping[str, Any]:
        """Return the metrics at the end of a stage; the run of earlier stages is continued."""
        key = task.trial, task.index
        run = self._runs.pop(key, None) or StagedRun(self.scenario(task.index, task.settings))
        metrics = run.until(task.until_s).metrics
        if task.until_s is not None and not run.done:
            self._runs[key] = run
            while len(self._runs) > MOST_RUNS:  # workers don't hear of trials that ended early
                del self._runs[next(iter(self._runs))]
        return metrics


@dataclass
class _RunningTrial:
    """A running trial.

    Attributes:
        trial: The trial of Optuna.
        settings: The values of the searched parameters.
        stage: The index of the current stage.
        objectives: The objectives of each variant that has finished the stage.
        unfinished: The number of variants that haven't finished the stage.
        error: The first error of a variant.
    """

    trial: "optuna.Trial"
    settings: dict[str, Any]
    stage: int = 0
    objectives: list[list[float]] = field(default_factory=list)
    unfinished: int = 0
    error: str | None = None


class TrialSchedule(TaskSchedule):
    """The tasks of a search: a new trial starts when workers have nothing else to do.

    A trial runs all variants up to one time of `prune_at` before the next; between them Optuna
    decides whether the trial continues. The worker that holds the run of a variant continues it;
    another worker takes it only if there is nothing else, and runs it from the start.
    """

    def __init__(
        self,
        study: "optuna.Study",
        search: Mapping[str, Parameter],
        variants: Sequence[tuple[int, str]],
        stages: Sequence[float | None],
        trials: int,
    ) -> None:
        """Create the schedule without a trial.

        Args:
            study: The study of Optuna.
            search: The searched parameters.
            variants: The index in the design and the home of each variant that a trial runs.
            stages: The simulated times of the stages [s]; the last is None.
            trials: The number of trials to start.
        """
        super().__init__(())
        self._study, self._search = study, search
        self._variants, self._stages = variants, stages
        self._new_trials = trials
        self._running: dict[int, _RunningTrial] = {}
        self._tasks: deque[TrialTask] = deque()
        self._holders: dict[tuple[int, int], Hashable] = {}
        self._task_count = 0

    def __len__(self) -> int:
        """Return the largest number of tasks that workers can take now."""
        return len(self._tasks) + self._new_trials * len(self._variants)

    def __bool__(self) -> bool:
        """Return whether there are more tasks or trials."""
        return bool(self._tasks or self._new_trials)

    def take(self, worker: Hashable) -> WorkerTask | None:
        """Return the next task: of a run that the worker holds, a new run or trial, or any task."""
        task = self._waiting_for(worker)
        if task is None and self._new_trials:
            self._new_trials -= 1
            trial = self._study.ask()
            settings = {name: suggested(trial, name, p) for name, p in self._search.items()}
            self._running[trial.number] = running = _RunningTrial(trial, settings)
            self._start_stage(running)
            task = self._waiting_for(worker)
        task = task or (self._tasks[0] if self._tasks else None)
        if task is not None:
            self._tasks.remove(task)
            self._holders[task.trial, task.index] = worker
        return task

    def _waiting_for(self, worker: Hashable) -> TrialTask | None:
        """Return the first task of a run that the worker holds, else of one that nobody holds."""
        holders = [self._holders.get((task.trial, task.index)) for task in self._tasks]
        for holder in (worker, None):
            if holder in holders:
                return self._tasks[holders.index(holder)]
        return None

    def leave(self, worker: Hashable) -> None:
        """Forget the runs that a worker held: it has ended."""
        self._holders = {key: holder for key, holder in self._holders.items() if holder != worker}

    def put_back(self, task: WorkerTask) -> None:
        """Return a task to the front of the schedule."""
        assert isinstance(task, TrialTask)
        self._tasks.appendleft(task)

    def finish(self, task: TrialTask, objectives: list[float] | None, error: str | None) -> bool:
        """Record the result of a task; return whether its trial is over."""
        running = self._running[task.trial]
        running.unfinished -= 1
        running.error = running.error or error
        if objectives is not None:
            running.objectives.append(objectives)
        if running.unfinished:
            return False
        if running.error is not None:
            running.trial.set_user_attr(FAILURE, running.error)
            self._study.tell(running.trial, state=_state("FAIL"))
        elif self._continue(running):
            return False
        del self._running[task.trial]
        for index, _ in self._variants:
            self._holders.pop((task.trial, index), None)
        return True

    def _start_stage(self, running: _RunningTrial) -> None:
        until_s = self._stages[running.stage]
        running.objectives, running.unfinished = [], len(self._variants)
        for index, home in self._variants:
            self._task_count += 1
            self._tasks.append(
                TrialTask(
                    self._task_count,
                    index,
                    "",
                    home,
                    running.trial.number,
                    running.settings,
                    until_s,
                )
            )

    def _continue(self, running: _RunningTrial) -> bool:
        """Report the means of a stage to Optuna; start the next stage, if there is to be one."""
        means = [
            sum_in_order(values) / len(values) for values in zip(*running.objectives, strict=True)
        ]
        until_s = self._stages[running.stage]
        if until_s is None:
            self._study.tell(running.trial, means)
            return False
        running.trial.report(means[0], int(until_s))
        if running.trial.should_prune():
            self._study.tell(running.trial, state=_state("PRUNED"))
            return False
        running.stage += 1
        self._start_stage(running)
        return True


def suggested(trial: "optuna.Trial", name: str, parameter: Parameter) -> Any:
    """Return the value that Optuna suggests for a parameter."""
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
    """Check a variant with both ends of each parameter's range, and with each of its choices.

    Raises:
        ScenarioError: The scenario can't have such a value.
    """
    for name, parameter in job.search.items():
        for value in parameter.choices or (parameter.at(0.0), parameter.at(1.0)):
            try:
                job.scenario(index, {name: value})
            except Fleet2DError as error:
                raise type(error)(f"tune.search.{name}: {error}") from None
