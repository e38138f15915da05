"""Tuning: a search on training homes with Optuna, judged on other homes."""

import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from fleet2d.errors import InputError, ScenarioError
from fleet2d.extras import extra
from fleet2d.studies.analysis.reader import Study, open_study
from fleet2d.studies.axes.kinds import OptionsAxis
from fleet2d.studies.axes.sampling import rounded
from fleet2d.studies.data.directory import StudyDirectory
from fleet2d.studies.data.storage import write_error
from fleet2d.studies.design.specification import PairedComparison, Specification, read_specification
from fleet2d.studies.design.tune_settings import TuneSettings
from fleet2d.studies.design.variants import matches
from fleet2d.studies.driver import CheckedStudy, RunOptions, check_study, run_study
from fleet2d.studies.execution.executor import Executor, LostTask
from fleet2d.studies.tune.trials import FAILURE, TrialJob, TrialSchedule, TrialTask, check_settings

if TYPE_CHECKING:
    import optuna

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
