"""Tuning: a search for settings on training homes with Optuna, judged on other homes."""

import json
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import TypeAdapter

from fleet2d.bounds import one_line
from fleet2d.errors import InputError, RunDirectoryError, ScenarioError, extra
from fleet2d.studies.axes import OptionsAxis, rounded
from fleet2d.studies.design import (
    Design,
    code_version,
    content_hash,
    file_hash,
    matches,
    scenario_content,
)
from fleet2d.studies.directory import StudyDirectory
from fleet2d.studies.driver import CheckedStudy, check_study, run_study
from fleet2d.studies.executors import Executor, LostTask
from fleet2d.studies.plan import StudyPlan
from fleet2d.studies.reader import Study, open_study
from fleet2d.studies.simulator import input_files
from fleet2d.studies.specification import (
    PairedComparison,
    Specification,
    TuneSettings,
    read_specification,
)
from fleet2d.studies.storage import Storage
from fleet2d.studies.trials import (
    FAILURE,
    TrialJob,
    TrialSchedule,
    TrialTask,
    check_settings,
    make_sampler,
)

if TYPE_CHECKING:
    import optuna


SEARCH, TRIALS, HELD_OUT = "search.json", "trials.log", "held_out"
INPUTS = "input files"
SETTING, BEFORE, TUNED = "setting", "base", "tuned"
MAX_JUDGED_SETTINGS = 5  # settings to judge after a search for several objectives


TuneObserver = Callable[[int, int, list[float] | None], None]
"""Receives the number of trials that are over, that of all, and the best objectives so far."""


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


def search_identity(plan: StudyPlan, settings: TuneSettings, storage: str) -> dict[str, str]:
    """Return what the trials of a search depend on, by its name in messages: as hashes or as text.

    Trials of another search may have seen the homes that are now held out, or have been judged by
    another objective; so they never count for this one.

    Args:
        plan: The variants.
        settings: The `tune` section of the study file.
        storage: Where the trials are stored, without secrets.
    """
    scenarios: dict[bool, list[str]] = {False: [], True: []}
    for variant in plan.variants:
        scenarios[matches(settings.held_out, plan.parameters(variant))].append(variant.scenario)
    content = {key: content_hash(value) for key, value in settings.model_dump(mode="json").items()}
    return {
        "the training (homes, base scenario or seeds)": content_hash(sorted(scenarios[False])),
        "the held-out part": content_hash(sorted(scenarios[True])),
        "the searched parameters": content["search"],
        "the objectives": content["objectives"],
        "prune_at": content["prune_at"],
        "the seed of the search": content["seed"],
        "the batch": content["batch"],
        "the sampler": content["sampler"],
        "the storage": storage,
        "the version of Fleet2D": code_version(),
        INPUTS: content_hash(sorted(variant.identity for variant in plan.variants)),
    }


def tune(
    source: str | Path | Mapping[str, Any] | Specification,
    folder: str | Path,
    executor: Executor,
    observer: TuneObserver | None = None,
    *,
    changed: Literal["redo"] | None = None,
    storage: str | None = None,
) -> TuneResult:
    """Search the parameters that a study's `tune` section names, and judge the best settings.

    A search that was interrupted continues.

    Args:
        source: The study.
        folder: The folder of the search.
        executor: Where trials run.
        observer: Follows the progress.
        changed: `redo` starts over if the folder holds another search, whose trials stay in the
            storage under a name of their own; None: such a folder is refused.
        storage: The URL of a database for the trials, such as sqlite:///trials.db; None: a file in
            the folder.

    Raises:
        InputError: The study has no such section, the section is wrong, the folder holds another
            search, or Optuna is missing.
    """
    specification = read_specification(source)
    settings = specification.file.tune
    if settings is None:
        raise ScenarioError(
            f"{specification.name} has no section `tune`, which names the parameters to search"
        )
    checked = check_study(specification)
    plan = checked.plan
    training = _training(plan, settings)
    job = TrialJob(plan.design, settings.search, tuple(settings.objectives))
    check_settings(job, training[0][0])
    directory = StudyDirectory(folder)
    if directory.storage.folder is None:
        raise InputError(f"{folder} is not a local folder, which a search needs")
    with extra("tune", "this needs Optuna"):
        import optuna
        from optuna.storages import JournalStorage
        from optuna.storages.journal import JournalFileBackend
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    database, storage_name = _open_database(storage) if storage else (None, TRIALS)
    identity = search_identity(plan, settings, storage_name)
    make_sampler(settings, 0)  # its errors come before anything is written
    with directory.locked():
        _check_identity(directory.storage, identity, changed)
        name = f"{specification.name} {content_hash(identity)}"
        with directory.storage.reading(TRIALS):
            path = directory.storage.path(TRIALS)
            trials = database or JournalStorage(JournalFileBackend(path))
            study = _open_trials(trials, name, settings)
        _search(study, job, training, settings, executor, observer)
    best = _best(study, settings)
    held_out = _check_held_out(specification, plan.design, best, settings)
    # After more trials, the best settings may be others.
    run_study(held_out, directory.storage.folder / HELD_OUT, executor, changed="redo")
    states = [trial.state.name.lower() for trial in study.trials]
    return TuneResult(
        {name: _overrides(trial, settings) for name, trial in best.items()},
        {name: list(trial.values) for name, trial in best.items()},
        {state: states.count(state) for state in ("complete", "pruned", "fail")},
        open_study(directory.storage.folder / HELD_OUT),
    )


def _training(plan: StudyPlan, settings: TuneSettings) -> list[tuple[int, str]]:
    """Return the index in the design and the home of each variant that trials run.

    Raises:
        ScenarioError: There is none, or it isn't clear whether one is held out.
    """
    (axis,) = settings.held_out
    labels = [plan.parameters(variant) for variant in plan.variants]
    if any(label[axis] is None for label in labels):
        raise ScenarioError(
            f"tune.held_out: the axis {axis!r} doesn't apply to all variants, some of which would"
            " be neither trained on nor held out: hold out values of another axis"
        )
    training = [
        (variant.index, variant.home_key)
        for variant, label in zip(plan.variants, labels, strict=True)
        if not matches(settings.held_out, label)
    ]
    if not training:
        raise ScenarioError("tune.held_out names all values: the search would have none to run on")
    _check_content(plan, settings)
    return training


def _check_content(plan: StudyPlan, settings: TuneSettings) -> None:
    """Refuse held-out variants that training has under another name, such as a copied home.

    Raises:
        ScenarioError: A held-out variant and one of the training differ by names of files only.
    """
    first_of = dict[str, tuple[bool, int]]()
    first_seed = {variant.template: variant for variant in reversed(plan.variants)}
    for variant in reversed(first_seed.values()):
        scenario = plan.design.scenario(variant.index)
        content = scenario_content(scenario)
        text = json.dumps({**content, "simulation": {**content["simulation"], "seed": None}})
        for path in input_files(scenario):
            text = text.replace(json.dumps(str(path)), json.dumps(file_hash(path)))
        is_held_out = matches(settings.held_out, plan.parameters(variant))
        was_held_out, other = first_of.setdefault(text, (is_held_out, variant.index))
        if is_held_out != was_held_out:
            raise ScenarioError(
                f"tune.held_out: {plan.design.describe(variant.index)} and"
                f" {plan.design.describe(other)} are the same but for the names of files, and only"
                " one of them is held out: hold out both, or leave one out"
            )


def _check_identity(
    storage: Storage, identity: Mapping[str, str], changed: Literal["redo"] | None
) -> None:
    """Refuse a folder with another search, unless it is to be redone; store the identity.

    Raises:
        RunDirectoryError: The folder holds another search.
    """
    changes = []
    if storage.exists(SEARCH):
        with storage.reading(SEARCH):
            stored = TypeAdapter(dict[str, str]).validate_json(storage.read(SEARCH))
        changes = [name for name in identity if identity[name] != stored.get(name)]
        if changes != [INPUTS]:  # it varies with all others
            changes = [name for name in changes if name != INPUTS]
    elif storage.exists(TRIALS):
        changes = ["the version of Fleet2D"]
    if changes and changed is None:
        raise RunDirectoryError(
            f"{storage.location} holds another search, whose trials can't count for this one:"
            f" {' and '.join(changes)} changed. --changed redo starts over and keeps the old trials"
            " in the storage under a name of their own; or choose another --out"
        )
    storage.write(SEARCH, json.dumps(identity, indent=1).encode())


def _search(
    study: "optuna.Study",
    job: TrialJob,
    training: list[tuple[int, str]],
    settings: TuneSettings,
    executor: Executor,
    observer: TuneObserver | None,
) -> None:
    """Run trials up to the number of the settings."""
    trials = study.get_trials(deepcopy=False)
    finished = sum(trial.state.name in ("COMPLETE", "PRUNED") for trial in trials)
    schedule = TrialSchedule(study, settings, training, finished)
    with closing(executor.run(job, schedule)) as events:
        for event in events:
            task = event.task
            assert isinstance(task, TrialTask)
            if isinstance(event, LostTask):
                over = schedule.finish(task, None, event.reason)
            else:
                over = schedule.finish(task, *event.payload)
            finished += over
            if over and observer is not None:
                best = study.best_trials
                observer(finished, settings.trials, list(best[0].values) if best else None)


def _open_database(url: str) -> tuple["optuna.storages.BaseStorage", str]:
    """Return the storage of the trials in a database, and its URL without secrets.

    Raises:
        InputError: The database can't be used.
    """
    from optuna.storages import RDBStorage
    from sqlalchemy.engine import make_url
    from sqlalchemy.exc import SQLAlchemyError

    try:
        return RDBStorage(url), make_url(url).render_as_string(hide_password=True)
    except (SQLAlchemyError, ImportError, ValueError) as error:
        raise InputError(
            f"the storage can't be used ({one_line(error, 200)}): give the URL of a database, such"
            " as sqlite:///trials.db"
        ) from error


def _open_trials(
    storage: "optuna.storages.BaseStorage", name: str, settings: TuneSettings
) -> "optuna.Study":
    """Open the trials of a search; unfinished ones of a killed process are started again."""
    import optuna

    study = optuna.create_study(
        study_name=name, storage=storage, directions=list(settings.objectives.values()),
        load_if_exists=True, pruner=optuna.pruners.MedianPruner(n_startup_trials=5),
    )  # fmt: skip
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
    best = study.best_trials[:MAX_JUDGED_SETTINGS]
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
    design: Design,
    best: "dict[str, optuna.trial.FrozenTrial]",
    settings: TuneSettings,
) -> CheckedStudy:
    """Return the study that compares the best settings on the homes held out of the search."""
    ((axis, values),) = settings.held_out.items()
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
