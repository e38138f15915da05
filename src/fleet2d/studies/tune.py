"""Tuning: a search on training homes with Optuna, judged on homes that it has not seen."""

import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from fleet2d.errors import InputError, ScenarioError
from fleet2d.studies.axes import OptionsAxis
from fleet2d.studies.design import matches
from fleet2d.studies.directory import StudyDirectory
from fleet2d.studies.driver import Checked, RunOptions, check_study, run_study
from fleet2d.studies.execution import Executor, Lost
from fleet2d.studies.reader import Study, open_study
from fleet2d.studies.sampling import rounded
from fleet2d.studies.specification import Comparison, Specification, read_specification
from fleet2d.studies.storage import write_error
from fleet2d.studies.trials import (
    FAILURE,
    TrialJob,
    TrialSchedule,
    TrialTask,
    check_settings,
)
from fleet2d.studies.tune_settings import TuneSettings

if TYPE_CHECKING:
    import optuna

TRIALS, HELD_OUT = "trials.log", "held_out"
SETTING, BEFORE, TUNED = "setting", "as it was", "tuned"
MOST_TUNED = 5  # settings of a search for several objectives that are judged


class TuneObserver(Protocol):
    """Is told how a search goes on."""

    def __call__(self, done: int, trials: int, best: list[float] | None) -> None:
        """Take in how many trials are over, and the best objectives so far."""
        ...


@dataclass(frozen=True)
class Tuned:
    """What a search came to.

    Attributes:
        settings: The best settings by name, as overrides: key path to value.
        values: Their objectives on the training homes.
        trials: How many trials are complete, pruned and failed.
        held_out: The study on the homes that the search has not seen.
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
) -> Tuned:
    """Search the parameters that a study's `tune` section names, and judge what is found.

    Called again, it goes on where it stopped.

    Raises:
        InputError: The study has no such section, something in it is wrong, or Optuna is missing.
    """
    specification = read_specification(source)
    settings = specification.file.tune
    if settings is None:
        raise ScenarioError(f"{specification.name} has no section `tune`: it says what to search")
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
        raise InputError(f"{folder} is no local folder: the storage of Optuna wants one")
    with directory.locked():
        study = _open_optuna(directory.storage.folder / TRIALS, specification.name, settings)
        _search(study, job, training, settings, executor, observer)
    best = _best(study, settings)
    judged = _judge(specification, best, settings)
    run_study(judged, directory.storage.folder / HELD_OUT, executor, options or RunOptions())
    states = [trial.state.name.lower() for trial in study.trials]
    return Tuned(
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
    """Run trials until there are as many as wanted."""
    from optuna.trial import TrialState

    over = (TrialState.COMPLETE, TrialState.PRUNED)
    done = len(study.get_trials(deepcopy=False, states=over))
    stages = (*(at.total_seconds() for at in settings.prune_at), None)
    left = settings.trials - done
    if left <= 0:
        return
    schedule = TrialSchedule(study, settings.search, training, stages, left)
    events = executor.run(job, schedule)
    try:
        for event in events:
            task = event.task
            assert isinstance(task, TrialTask)
            if isinstance(event, Lost):
                values, error = None, event.reason
            else:
                values, error = pickle.loads(event.payload)  # noqa: S301 - from our own workers
            if not schedule.finished(task, values, error):
                continue
            if error is not None:
                study._storage.set_trial_system_attr(
                    study.trials[task.trial]._trial_id, FAILURE, error
                )
            schedule.fail(task)
            done += 1
            if observer is not None:
                observer(done, settings.trials, _best_values(study))
    finally:
        events.close()


def _best_values(study: "optuna.Study") -> list[float] | None:
    trials = study.best_trials
    return list(trials[0].values) if trials else None


def _open_optuna(path: Path, name: str, settings: TuneSettings) -> "optuna.Study":
    """Open Optuna's storage; trials that a killed process left are begun anew.

    Raises:
        InputError: Optuna is not installed, or the storage is of another search.
    """
    try:
        import optuna
        from optuna.storages import JournalStorage
        from optuna.storages.journal import JournalFileBackend
    except ImportError:
        raise InputError('this needs Optuna: pip install "fleet2d[tune]"') from None
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
        raise InputError(f"{path} is of a search for other objectives: choose another --out")
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
    """Return the best trials by what they are called in the report.

    Raises:
        InputError: All trials failed.
    """
    best = study.best_trials[:MOST_TUNED]
    if not best:
        reasons = [trial.system_attrs.get(FAILURE) for trial in study.trials]
        reason = next((r for r in reasons if r), "none is complete")
        raise InputError(f"no trial succeeded: {reason}")
    if len(settings.objectives) == 1:
        return {TUNED: best[0]}
    return {f"trial {trial.number}": trial for trial in best}


def _overrides(trial: "optuna.trial.FrozenTrial", settings: TuneSettings) -> dict[str, Any]:
    """Return a trial's settings as they are written in a scenario."""
    found = {}
    for name, value in trial.params.items():
        parameter = settings.search[name]
        own = parameter.choices[value] if parameter.choices else value
        own = rounded(own) if isinstance(own, float) else own
        found[parameter.key] = parameter.written(own)
    return found


def _judge(
    specification: Specification,
    best: "dict[str, optuna.trial.FrozenTrial]",
    settings: TuneSettings,
) -> Checked:
    """Return the study of the best settings on the homes that were held out."""
    ((axis, values),) = settings.held_out.items()
    design = check_study(specification).plan.design
    seen = tuple(
        label for label in design.labels[axis] if not matches({axis: list(values)}, {axis: label})
    )
    options = {BEFORE: dict[str, Any]()}
    options |= {name: _overrides(trial, settings) for name, trial in best.items()}
    file = specification.file
    compare = tuple(
        Comparison(metric=metric, against={SETTING: BEFORE}) for metric in settings.objectives
    )
    exclude = (*file.exclude, {axis: seen}) if seen else file.exclude
    judged = file.model_copy(
        update={
            "name": f"{specification.name}, tuned",
            "axes": {**file.axes, SETTING: OptionsAxis(options=options)},
            "exclude": exclude,
            "compare": compare,
            "tune": None,
        }
    )
    return check_study(
        Specification(judged, specification.places, specification.base, specification.folder)
    )
