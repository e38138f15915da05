"""Trials of a search: settings that Optuna suggests, run on all training variants, in stages."""

import inspect
from collections import deque
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from fleet2d.configuration.problems import did_you_mean, suggest
from fleet2d.configuration.trust import Trust, current_trust, import_class, restrict
from fleet2d.errors import ComponentError, Fleet2DError, ScenarioError, errors_as
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.scenario.compose import apply_changes, assignment
from fleet2d.scenario.model import Scenario, scenario_of
from fleet2d.studies.axes import Parameter, key_path, rounded
from fleet2d.studies.design import Design
from fleet2d.studies.executors import TaskSchedule, WorkerTask
from fleet2d.studies.simulator import StagedRun, describe_error, flat_numbers
from fleet2d.studies.specification import TuneSettings

if TYPE_CHECKING:
    import optuna


MAX_RUNS = 40  # unfinished runs that a worker holds for the next stage of their trial
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

    def __call__(self, task: WorkerTask) -> tuple[list[float] | None, str | None]:
        """Return the objectives and the error; one of them is None."""
        assert isinstance(task, TrialTask)
        try:
            with restrict(self.trust):
                metrics = self._metrics(task)
            numbers = dict(flat_numbers(metrics))
            missing = [name for name in self.objectives if name not in numbers]
            if missing:
                hint = did_you_mean(missing[0], numbers)
                raise ComponentError(f"the run has no metric {missing[0]!r}{hint}")
            return [numbers[name] for name in self.objectives], None
        except Exception as error:  # noqa: BLE001 - a component may raise anything; it is reported
            return None, describe_error(error)

    def _metrics(self, task: TrialTask) -> Mapping[str, Any]:
        """Return the metrics at the end of a stage; the run of earlier stages is continued."""
        key = task.trial, task.index
        run = self._runs.pop(key, None) or StagedRun(self.scenario(task.index, task.settings))
        metrics = run.until(task.until_s).metrics
        if task.until_s is not None and not run.done:
            self._runs[key] = run
            while len(self._runs) > MAX_RUNS:  # workers don't hear of trials that ended early
                del self._runs[next(iter(self._runs))]
        return metrics


@dataclass
class _RunningTrial:
    """A running trial.

    Attributes:
        trial: The trial of Optuna.
        settings: The values of the searched parameters.
        stage: The index of the current stage.
        objectives: The objectives of each variant that has finished the stage, by index.
        unfinished: The number of variants that haven't finished the stage.
        error: The first error of a variant.
    """

    trial: "optuna.Trial"
    settings: dict[str, Any]
    stage: int = 0
    objectives: dict[int, list[float]] = field(default_factory=dict)
    unfinished: int = 0
    error: str | None = None


class TrialSchedule(TaskSchedule):
    """The tasks of a search, in batches of trials that are suggested and judged together.

    So neither the number of workers nor their speed has an effect on what Optuna suggests. All
    trials of a batch run all variants up to one time of `prune_at` before the next; between them
    Optuna decides which trials continue. The worker that holds the run of a variant continues it;
    another worker takes it only if there is nothing else, and runs it from the start.
    """

    def __init__(
        self,
        study: "optuna.Study",
        settings: TuneSettings,
        variants: Sequence[tuple[int, str]],
        finished: int = 0,
    ) -> None:
        """Create the schedule without a trial.

        Args:
            study: The study of Optuna.
            settings: The `tune` section of the study file.
            variants: The index in the design and the home of each variant that a trial runs.
            finished: The number of trials that are over.
        """
        super().__init__(())
        self._study, self._settings, self._variants = study, settings, variants
        self._stages = (*(time.total_seconds() for time in settings.prune_at), None)
        self._started = finished
        self._running: dict[int, _RunningTrial] = {}
        self._tasks: deque[TrialTask] = deque()
        self._holders: dict[tuple[int, int], Hashable] = {}
        self._task_count = 0

    def __len__(self) -> int:
        """Return the largest number of tasks that workers can take now."""
        return len(self._tasks) or self._next_batch() * len(self._variants)

    def __bool__(self) -> bool:
        """Return whether there are more tasks or trials."""
        return bool(self._tasks) or self._started < self._settings.trials

    def take(self, worker: Hashable) -> WorkerTask | None:
        """Return the next task: of a run that the worker holds, a new run, or any task."""
        if not self._tasks and self._next_batch():
            self._start_batch()
        holders = [self._holders.get((task.trial, task.index)) for task in self._tasks]
        for holder in (worker, None, *holders):
            if holder in holders:
                task = self._tasks[holders.index(holder)]
                self._tasks.remove(task)
                self._holders[task.trial, task.index] = worker
                return task
        return None

    def leave(self, worker: Hashable) -> None:
        """Forget the runs that a worker held: it has ended."""
        self._holders = {key: holder for key, holder in self._holders.items() if holder != worker}

    def put_back(self, task: WorkerTask) -> None:
        """Return a task to the front of the schedule."""
        assert isinstance(task, TrialTask)
        self._tasks.appendleft(task)

    def finish(self, task: TrialTask, objectives: list[float] | None, error: str | None) -> int:
        """Record the result of a task; return the number of trials that are over with it."""
        running = self._running[task.trial]
        running.unfinished -= 1
        running.error = running.error or error
        if objectives is not None:
            running.objectives[task.index] = objectives
        if not running.unfinished and (running.error or self._stages[running.stage] is None):
            return self._end(running)
        if any(each.unfinished for each in self._running.values()):
            return 0
        return sum(self._judge(each) for each in list(self._running.values()))

    def _next_batch(self) -> int:
        """Return the number of trials that can start now; an interrupted batch is filled."""
        if self._running:
            return 0
        batch = self._settings.batch
        return min(batch - self._started % batch, self._settings.trials - self._started)

    def _start_batch(self) -> None:
        # Optuna's samplers have random states, which aren't stored: each batch has its own.
        self._study.sampler = make_sampler(self._settings, self._started)
        for _ in range(self._next_batch()):
            trial = self._study.ask()
            search = self._settings.search
            values = {name: suggested(trial, name, search[name]) for name in search}
            self._running[trial.number] = _RunningTrial(trial, values)
        self._started += len(self._running)
        for running in self._running.values():
            self._start_stage(running)

    def _start_stage(self, running: _RunningTrial) -> None:
        until_s, number = self._stages[running.stage], running.trial.number
        running.objectives, running.unfinished = {}, len(self._variants)
        for index, home in self._variants:
            self._task_count += 1
            self._tasks.append(
                TrialTask(self._task_count, index, "", home, number, running.settings, until_s)
            )

    def _judge(self, running: _RunningTrial) -> int:
        """Start the next stage of a trial unless Optuna ends it; return whether it does."""
        running.trial.report(self._means(running)[0], int(self._stages[running.stage] or 0))
        if running.trial.should_prune():
            return self._end(running, "PRUNED")
        running.stage += 1
        self._start_stage(running)
        return 0

    def _end(self, running: _RunningTrial, state: str = "COMPLETE") -> int:
        """Tell Optuna that a trial is over; return 1."""
        from optuna.trial import TrialState

        if running.error is not None:
            running.trial.set_user_attr(FAILURE, running.error)
            state = "FAIL"
        values = self._means(running) if state == "COMPLETE" else None
        self._study.tell(running.trial, values, TrialState[state])
        del self._running[running.trial.number]
        self._holders = {key: of for key, of in self._holders.items() if key[0] in self._running}
        return 1

    def _means(self, running: _RunningTrial) -> list[float]:
        values = [running.objectives[index] for index, _ in self._variants]
        return [sum_in_order(of_all) / len(of_all) for of_all in zip(*values, strict=True)]


def make_sampler(settings: TuneSettings, finished: int) -> "optuna.samplers.BaseSampler":
    """Return the sampler of the trials after the finished ones.

    Raises:
        ScenarioError: There is no such sampler, or it can't have those arguments.
    """
    from optuna import samplers

    usual = "TPESampler" if len(settings.objectives) == 1 else "NSGAIISampler"
    options = {"type": usual, **settings.sampler}
    name = options.pop("type")
    known = [known for known in samplers.__all__ if known.endswith("Sampler")]
    if ":" not in name and name not in known:
        raise ScenarioError(f"tune.sampler: Optuna has no {name!r}{suggest(name, known)}")
    kind: Any = import_class(name) if ":" in name else getattr(samplers, name)
    wrong = (ImportError, TypeError, ValueError)
    with errors_as(ScenarioError, f"tune.sampler: {name} can't be used", of=wrong):
        if "seed" in inspect.signature(kind).parameters:
            options.setdefault("seed", settings.seed + finished)
        sampler = kind(**options)
        if not isinstance(sampler, samplers.BaseSampler):
            raise TypeError("it is not a sampler of Optuna")
    return sampler


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


def check_settings(job: TrialJob, index: int) -> None:
    """Check a variant with both ends of each parameter's range, and with each of its choices.

    Raises:
        ScenarioError: The scenario can't have such a value.
    """
    for name, parameter in job.search.items():
        for value in parameter.choices or (parameter.at(0.0), parameter.at(1.0)):
            with errors_as(None, f"tune.search.{name}", of=Fleet2DError):
                job.scenario(index, {name: value})
