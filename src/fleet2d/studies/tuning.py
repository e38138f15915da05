"""Tuning: a search for settings on training homes with Optuna, judged on other homes."""

import pickle
from collections import deque
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from fleet2d.configuration.trust import Trust, current_trust, restrict
from fleet2d.errors import ComponentError, Fleet2DError, InputError, ScenarioError, extra
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.scenario.compose import apply_changes, assignment
from fleet2d.scenario.model import Scenario, scenario_of
from fleet2d.studies.axes import OptionsAxis, Parameter, key_path, rounded
from fleet2d.studies.design import Design, matches
from fleet2d.studies.directory import StudyDirectory
from fleet2d.studies.driver import CheckedStudy, RunOptions, check_study, run_study
from fleet2d.studies.executors import Executor, LostTask, TaskSchedule, WorkerTask
from fleet2d.studies.reader import Study, open_study
from fleet2d.studies.simulator import StagedRun, describe_error, flat_numbers
from fleet2d.studies.specification import (
    PairedComparison,
    Specification,
    TuneSettings,
    read_specification,
)
from fleet2d.studies.storage import write_error

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


TRIALS, HELD_OUT = "trials.log", "held_out"
SETTING, BEFORE, TUNED = "setting", "as it was", "tuned"
MOST_TUNED = 5  # settings to judge after a search for several objectives


class TuneObserver(Protocol):
    """Follows the progress of a search."""

    def __call__(self, done: int, trials: int, best: list[float] | None) -> None:
        """Receive the number of trials that are over, and the best objectives so far."""
        ...


@dataclass(frozen=True)
class TuneResult:
    """The result of a search.

    Attributes:
        settings: The best settings by name, as overrides: key path to value.
        values: Their objectives on the training homes, by name.
        trials: The numbers of complete, pruned and failed trials.
        held_out: The study on the homes that the search doesn't use.
    """

    settings: dict[str, dict[str, Any]]
    values: dict[str, list[float]]
    trials: dict[str, int]
    held_out: Study


def tune(
    source: str | Path | Mapping[str, Any] | Specification,
    folder: str | Path,
    executor: Executor,
    observer: TuneObserver | None = None,
    options: RunOptions | None = None,
) -> TuneResult:
    """Search the parameters that a study's `tune` section names, and judge the best settings.

    A search that was interrupted continues.

    Raises:
        InputError: The study has no such section, the section is wrong, or Optuna is missing.
    """
    specification = read_specification(source)
    settings = specification.file.tune
    if settings is None:
        raise ScenarioError(
            f"{specification.name} has no section `tune`, which names the parameters to search"
        )
    checked = check_study(specification)
    job = TrialJob(checked.plan.design, settings.search, tuple(settings.objectives))
    training = [
        (variant.index, variant.home_key)
        for variant in checked.plan.variants
        if not matches(settings.held_out, checked.plan.parameters(variant))
    ]
    if not training:
        raise ScenarioError("tune.held_out names all values: the search would have none to run on")
    check_settings(job, training[0][0])
    directory = StudyDirectory(folder)
    if directory.storage.folder is None:
        raise InputError(f"{folder} is not a local folder, which the storage of Optuna needs")
    with directory.locked():
        study = _open_optuna(directory.storage.folder / TRIALS, specification.name, settings)
        _search(study, job, training, settings, executor, observer)
    best = _best(study, settings)
    held_out = _check_held_out(specification, best, settings)
    run_study(held_out, directory.storage.folder / HELD_OUT, executor, options or RunOptions())
    states = [trial.state.name.lower() for trial in study.trials]
    return TuneResult(
        {name: _overrides(trial, settings) for name, trial in best.items()},
        {name: list(trial.values) for name, trial in best.items()},
        {state: states.count(state) for state in ("complete", "pruned", "fail")},
        open_study(directory.storage.folder / HELD_OUT),
    )


def _search(
    study: "optuna.Study",
    job: TrialJob,
    training: list[tuple[int, str]],
    settings: TuneSettings,
    executor: Executor,
    observer: TuneObserver | None,
) -> None:
    """Run trials up to the number of the settings."""
    from optuna.trial import TrialState

    states = (TrialState.COMPLETE, TrialState.PRUNED)
    finished = len(study.get_trials(deepcopy=False, states=states))
    stages = (*(time.total_seconds() for time in settings.prune_at), None)
    if finished >= settings.trials:
        return
    schedule = TrialSchedule(study, settings.search, training, stages, settings.trials - finished)
    events = executor.run(job, schedule)
    try:
        for event in events:
            task = event.task
            assert isinstance(task, TrialTask)
            if isinstance(event, LostTask):
                objectives, error = None, event.reason
            else:
                objectives, error = pickle.loads(event.payload)  # noqa: S301 - from our own workers
            if not schedule.finish(task, objectives, error):
                continue
            finished += 1
            if observer is not None:
                observer(finished, settings.trials, _best_values(study))
    finally:
        events.close()


def _best_values(study: "optuna.Study") -> list[float] | None:
    trials = study.best_trials
    return list(trials[0].values) if trials else None


def _open_optuna(path: Path, name: str, settings: TuneSettings) -> "optuna.Study":
    """Open Optuna's storage; unfinished trials of a killed process are started again.

    Raises:
        InputError: Optuna is not installed, or the storage belongs to another search.
    """
    with extra("tune", "this needs Optuna"):
        import optuna
        from optuna.storages import JournalStorage
        from optuna.storages.journal import JournalFileBackend
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        storage = JournalStorage(JournalFileBackend(str(path)))
    except OSError as error:
        raise write_error(path.parent, error) from error
    directions = list(settings.objectives.values())
    study = optuna.create_study(
        study_name=name, storage=storage, directions=directions, load_if_exists=True,
        pruner=optuna.pruners.MedianPruner(n_startup_trials=5),
    )  # fmt: skip
    if [direction.name.lower() for direction in study.directions] != directions:
        raise InputError(f"{path} belongs to a search for other objectives: choose another --out")
    finished = len(study.trials)
    if len(directions) == 1:
        study.sampler = optuna.samplers.TPESampler(seed=settings.seed + finished)
    else:
        study.sampler = optuna.samplers.NSGAIISampler(seed=settings.seed + finished)
    for trial in study.get_trials(states=(optuna.trial.TrialState.RUNNING,)):
        study.tell(trial.number, state=optuna.trial.TrialState.FAIL)
        if trial.params:
            study.enqueue_trial(trial.params)
    return study


def _best(study: "optuna.Study", settings: TuneSettings) -> "dict[str, optuna.trial.FrozenTrial]":
    """Return the best trials by their names in the report.

    Raises:
        InputError: All trials failed.
    """
    best = study.best_trials[:MOST_TUNED]
    if not best:
        reasons = (trial.user_attrs.get(FAILURE) for trial in study.trials)
        reason = next(filter(None, reasons), "none is complete")
        raise InputError(f"no trial succeeded: {reason}")
    if len(settings.objectives) == 1:
        return {TUNED: best[0]}
    return {f"trial {trial.number}": trial for trial in best}


def _overrides(trial: "optuna.trial.FrozenTrial", settings: TuneSettings) -> dict[str, Any]:
    """Return the settings of a trial as changes of the scenario: key path to value."""
    overrides = {}
    for name, value in trial.params.items():
        parameter = settings.search[name]
        if parameter.choices:
            value = parameter.choices[value]
        value = rounded(value) if isinstance(value, float) else value
        overrides[parameter.key] = parameter.with_unit(value)
    return overrides


def _check_held_out(
    specification: Specification,
    best: "dict[str, optuna.trial.FrozenTrial]",
    settings: TuneSettings,
) -> CheckedStudy:
    """Return the study that compares the best settings on the homes held out of the search."""
    ((axis, values),) = settings.held_out.items()
    design = check_study(specification).plan.design
    training = tuple(
        label for label in design.labels[axis] if not matches({axis: list(values)}, {axis: label})
    )
    options = {BEFORE: dict[str, Any]()}
    options |= {name: _overrides(trial, settings) for name, trial in best.items()}
    file = specification.file
    compare = tuple(
        PairedComparison(metric=metric, against={SETTING: BEFORE}) for metric in settings.objectives
    )
    exclude = (*file.exclude, {axis: training}) if training else file.exclude
    comparison = file.model_copy(
        update={
            "name": f"{specification.name}, tuned",
            "axes": {**file.axes, SETTING: OptionsAxis(options=options)},
            "exclude": exclude,
            "compare": compare,
            "tune": None,
        }
    )
    return check_study(
        Specification(comparison, specification.places, specification.base, specification.folder)
    )
