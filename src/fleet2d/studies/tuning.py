"""Tuning: a search for settings on training homes with Optuna, judged on other homes."""

import inspect
import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import TypeAdapter

from fleet2d.configuration.importing import import_class
from fleet2d.configuration.problems import did_you_mean, suggest
from fleet2d.errors import (
    Fleet2DError,
    InputError,
    RunDirectoryError,
    ScenarioError,
    errors_as,
    extra,
)
from fleet2d.scenario.compose import apply_changes, assignment
from fleet2d.scenario.load import scenario_of
from fleet2d.scenario.model import Scenario
from fleet2d.studies.axes import OptionsAxis, Parameter, key_path, rounded
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
from fleet2d.studies.executors import Crew, TaskQueue, WorkerTask, by_home, run_tasks
from fleet2d.studies.plan import StudyPlan
from fleet2d.studies.reader import Study, open_study
from fleet2d.studies.simulator import describe_error, execute, input_files
from fleet2d.studies.specification import (
    PairedComparison,
    Specification,
    TuneSettings,
    read_specification,
)
from fleet2d.studies.storage import Storage

if TYPE_CHECKING:
    import optuna


SEARCH = "search.json"
TRIALS = "trials.log"
HELD_OUT = "held_out"
INPUTS = "input files"
SETTING = "setting"
BEFORE = "base"
TUNED = "tuned"
FAILURE = "failure"  # the attribute of a failed trial that holds the error


@dataclass(frozen=True)
class TrialTask(WorkerTask):
    """One variant with one setting.

    Attributes:
        trial: The number of the trial.
        settings: The values of the searched parameters.
    """

    trial: int = 0
    settings: Mapping[str, Any] = field(default_factory=dict)


@dataclass
class TrialJob:
    """Runs a variant with a setting, and returns its objective.

    Attributes:
        design: The variants.
        search: The searched parameters.
        objective: The name of the metric.
    """

    design: Design
    search: Mapping[str, Parameter]
    objective: str

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

    def __call__(self, task: TrialTask) -> tuple[float, str | None]:
        """Return the objective, NaN if there is none, and the error, if there is one."""
        try:
            scenario = self.scenario(task.index, task.settings)
        except Fleet2DError as error:
            return math.nan, describe_error(error)
        outcome = execute(scenario, ["*"], ())
        if outcome.error is not None:
            return math.nan, outcome.error
        if self.objective not in outcome.metrics:
            hint = did_you_mean(self.objective, outcome.metrics)
            return math.nan, f"the run has no metric {self.objective!r}{hint}"
        return outcome.metrics[self.objective], None


def make_sampler(settings: TuneSettings, finished: int) -> "optuna.samplers.BaseSampler":
    """Return the sampler of the trials after the finished ones.

    Raises:
        ScenarioError: There is no such sampler, or it can't have those arguments.
    """
    from optuna import samplers

    options = {"type": "TPESampler", **settings.sampler}
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
        low = int(parameter.low)
        high = int(parameter.high)
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


TuneObserver = Callable[[int, int, float], None]
"""Receives the number of trials that are over, that of all, and the best value so far, or NaN."""


@dataclass(frozen=True)
class TuneResult:
    """The result of a search.

    Attributes:
        settings: The best settings, as overrides: key path to value.
        value: The objective with them on the training homes.
        trials: The numbers of complete and failed trials.
        held_out: The study on the homes that the search doesn't use.
    """

    settings: dict[str, Any]
    value: float
    trials: dict[str, int]
    held_out: Study


def search_identity(plan: StudyPlan, settings: TuneSettings) -> dict[str, str]:
    """Return the inputs of a search's trials, as hashes or texts, by their names in messages.

    Trials of another search may have seen the homes that are now held out, or have been judged by
    another objective; so they never count for this one.

    Args:
        plan: The variants.
        settings: The `tune` section of the study file.
    """
    scenarios: dict[bool, list[Any]] = {False: [], True: []}
    for index, *scenario in plan.variants.select("index", "template", "seed").iter_rows():
        is_held_out = matches(settings.held_out, plan.design.parameters(index))
        scenarios[is_held_out].append(scenario)
    content = {key: content_hash(value) for key, value in settings.model_dump(mode="json").items()}
    return {
        "the training (homes, base scenario or seeds)": content_hash(sorted(scenarios[False])),
        "the held-out part": content_hash(sorted(scenarios[True])),
        "the searched parameters": content["search"],
        "the objective": content["objective"],
        "the seed of the search": content["seed"],
        "the batch": content["batch"],
        "the sampler": content["sampler"],
        "the version of Fleet2D": code_version(),
        INPUTS: content_hash(sorted(plan.variants["identity"])),
    }


def tune(
    source: str | Path | Mapping[str, Any] | Specification,
    folder: str | Path,
    crew: Crew,
    observer: TuneObserver | None = None,
    *,
    changed: Literal["redo"] | None = None,
) -> TuneResult:
    """Search the parameters that a study's `tune` section names, and judge the best ones.

    A search that was interrupted continues.

    Args:
        source: The study.
        folder: The folder of the search.
        crew: Where trials run.
        observer: Follows the progress.
        changed: `redo` starts over if the folder holds another search, whose trials stay in their
            file under a name of their own; None: such a folder is refused.

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
    job = TrialJob(plan.design, settings.search, settings.metric)
    check_settings(job, training[0][0])
    directory = StudyDirectory(folder)
    if directory.storage.folder is None:
        raise InputError(f"{folder} is not a local folder, which a search needs")
    with extra("tune", "this needs Optuna"):
        import optuna
        from optuna.storages import JournalStorage
        from optuna.storages.journal import JournalFileBackend
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    identity = search_identity(plan, settings)
    make_sampler(settings, 0)  # its errors should come before anything is written
    with directory.locked():
        _check_identity(directory.storage, identity, changed)
        name = f"{specification.name} {content_hash(identity)}"
        with directory.storage.reading(TRIALS):
            path = directory.storage.path(TRIALS)
            trials = JournalStorage(JournalFileBackend(path))
            study = _open_trials(trials, name, settings)
        Search(study, job, training, settings, crew).run(observer)
    best = _best(study)
    overrides = _overrides(best, settings)
    held_out = _check_held_out(specification, plan.design, overrides, settings)
    # More trials may have changed the best settings.
    run_study(held_out, directory.storage.folder / HELD_OUT, crew, changed="redo")
    states = [trial.state.name.lower() for trial in study.trials]
    return TuneResult(
        overrides,
        best.value,
        {state: states.count(state) for state in ("complete", "fail")},
        open_study(directory.storage.folder / HELD_OUT),
    )


def _training(plan: StudyPlan, settings: TuneSettings) -> list[tuple[int, str]]:
    """Return the index in the design and the home of each variant that trials run.

    Raises:
        ScenarioError: There is none, or it isn't clear whether one is held out.
    """
    (axis,) = settings.held_out
    labels = [plan.design.parameters(index) for index in plan.variants["index"]]
    if any(label[axis] is None for label in labels):
        raise ScenarioError(
            f"tune.held_out: the axis {axis!r} doesn't apply to all variants, some of which would"
            " be neither trained on nor held out: hold out values of another axis"
        )
    variants = plan.variants.select("index", "home_key").iter_rows()
    training = [
        variant
        for variant, label in zip(variants, labels, strict=True)
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
    for index in plan.variants["index"].gather_every(len(plan.design.seeds)):
        scenario = plan.design.scenario(index)
        content = scenario_content(scenario)
        text = json.dumps({**content, "simulation": {**content["simulation"], "seed": None}})
        for path in input_files(scenario):
            text = text.replace(json.dumps(str(path)), json.dumps(file_hash(path)))
        is_held_out = matches(settings.held_out, plan.design.parameters(index))
        was_held_out, other = first_of.setdefault(text, (is_held_out, index))
        if is_held_out != was_held_out:
            raise ScenarioError(
                f"tune.held_out: {plan.design.describe(index)} and"
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
        if changes != [INPUTS]:  # their digest differs whenever another one does
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


class Search:
    """A search in batches of trials that are suggested and judged together.

    So neither the number of workers nor their speed has an effect on what Optuna suggests.
    """

    def __init__(
        self,
        study: "optuna.Study",
        job: TrialJob,
        variants: Sequence[tuple[int, str]],
        settings: TuneSettings,
        crew: Crew,
    ) -> None:
        """Prepare a search.

        Args:
            study: The study of Optuna.
            job: Runs a variant with a setting.
            variants: The index in the design and the home of each variant that a trial runs.
            settings: The `tune` section of the study file.
            crew: Where trials run.
        """
        self._study = study
        self._job = job
        self._variants = variants
        self._settings = settings
        self._crew = crew

    def run(self, observer: TuneObserver | None) -> None:
        """Run trials up to the number of the settings; an interrupted batch is completed."""
        total = self._settings.trials
        trials = self._study.get_trials(deepcopy=False)
        finished = sum(trial.state.name == "COMPLETE" for trial in trials)
        while finished < total:
            rest = self._settings.batch - finished % self._settings.batch
            count = min(rest, total - finished)
            # Optuna's samplers have random states, which aren't stored: each batch has its own.
            self._study.sampler = make_sampler(self._settings, finished)
            self._run_batch([self._study.ask() for _ in range(count)])
            finished += count
            if observer is not None:
                best = self._study.best_trials
                observer(finished, total, best[0].value if best else math.nan)

    def _run_batch(self, trials: "list[optuna.Trial]") -> None:
        """Run trials, and report their results to Optuna."""
        keys = itertools.product(trials, self._variants)
        search = self._settings.search.items()
        settings = {}
        for trial in trials:
            settings[trial.number] = {name: suggested(trial, name, each) for name, each in search}
        tasks = [
            TrialTask(place, index, "", home, trial.number, settings[trial.number])
            for place, (trial, (index, home)) in enumerate(keys)
        ]
        by_number = {trial.number: trial for trial in trials}
        values: dict[int, list[float]] = {trial.number: [] for trial in trials}
        with closing(run_tasks(self._crew, self._job, TaskQueue(by_home(tasks)))) as rounds:
            for end in itertools.chain.from_iterable(rounds):
                number = end.task.trial
                trial = by_number.get(number)
                if trial is None:  # another variant has failed
                    continue
                value, error = end.payload or (math.nan, end.loss)
                if error is not None:
                    trial.set_user_attr(FAILURE, error)
                    self._study.tell(trial, state=_state("FAIL"))
                    del by_number[number]
                    continue
                values[number].append(value)
                if len(values[number]) == len(self._variants):
                    # `fsum` is exact, whatever the order of the results.
                    self._study.tell(trial, math.fsum(values[number]) / len(self._variants))


def _state(name: str) -> "optuna.trial.TrialState":
    from optuna.trial import TrialState

    return TrialState[name]


def _open_trials(
    storage: "optuna.storages.BaseStorage", name: str, settings: TuneSettings
) -> "optuna.Study":
    """Open the trials of a search; unfinished ones of a killed process are started again."""
    import optuna

    study = optuna.create_study(
        study_name=name, storage=storage, direction=settings.objective[settings.metric],
        load_if_exists=True,
    )  # fmt: skip
    for trial in study.get_trials(states=(optuna.trial.TrialState.RUNNING,)):
        study.tell(trial.number, state=optuna.trial.TrialState.FAIL)
        if trial.params:
            study.enqueue_trial(trial.params)
    return study


def _best(study: "optuna.Study") -> "optuna.trial.FrozenTrial":
    """Return the best trial.

    Raises:
        InputError: All trials failed.
    """
    best = study.best_trials
    if not best:
        reasons = (trial.user_attrs.get(FAILURE) for trial in study.trials)
        reason = next(filter(None, reasons), "none is complete")
        raise InputError(f"no trial succeeded: {reason}")
    return best[0]


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
    best: Mapping[str, Any],
    settings: TuneSettings,
) -> CheckedStudy:
    """Return the study that compares the best setting with the base on the homes held out."""
    ((axis, values),) = settings.held_out.items()
    training = tuple(
        label for label in design.labels[axis] if not matches({axis: list(values)}, {axis: label})
    )
    options = {BEFORE: dict[str, Any](), TUNED: dict(best)}
    file = specification.file
    compare = (PairedComparison(metric=settings.metric, against={SETTING: BEFORE}),)
    changes = {
        "name": f"{specification.name}, tuned",
        "axes": {**file.axes, SETTING: OptionsAxis(options=options)},
        "exclude": (*file.exclude, {axis: training}) if training else file.exclude,
        "compare": compare,
        "tune": None,
    }
    return check_study(replace(specification, file=file.model_copy(update=changes), source=None))
