"""Running a study: missing variants are run, and each result is stored at once."""

from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.configuration.problems import did_you_mean
from fleet2d.errors import ComponentError, Fleet2DError, extra
from fleet2d.scenario.model import Scenario
from fleet2d.studies.design import (
    Design,
    build_design,
    code_version,
    content_hash,
    identity,
    input_hash,
    scenario_content,
)
from fleet2d.studies.directory import (
    COMPLETE,
    VARIANTS,
    Counts,
    Meta,
    MetricFacts,
    StudyDirectory,
)
from fleet2d.studies.executors import Crew, TaskEnd, TaskQueue, WorkerTask, run_tasks
from fleet2d.studies.intervals import LEVEL
from fleet2d.studies.plan import (
    Changed,
    KnownNames,
    ScenarioFile,
    StudyPlan,
    check_setups,
    make_plan,
    reconcile,
    write_plan,
)
from fleet2d.studies.reader import Study
from fleet2d.studies.results import (
    RESULT_COLUMNS,
    VARIANT,
    ResultWriter,
    VariantResult,
    drop_damaged,
    read_results,
    result_of,
    results_frame,
)
from fleet2d.studies.simulator import VariantOutcome, describe_error, execute, is_kept
from fleet2d.studies.specification import AdaptSettings, Specification, read_specification

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa


class AdaptiveRounds:
    """The variants of a study in rounds of seeds; between rounds the results so far decide.

    All values of the axis have the same seeds as long as they get any, so pairs stay fair. To give
    up a value, its difference must be significant at 5 % over all rounds together (Bonferroni).
    """

    def __init__(
        self,
        settings: AdaptSettings,
        plan: StudyPlan,
        directory: StudyDirectory,
        on_note: Callable[[str], None],
    ) -> None:
        """Prepare the rounds.

        Args:
            settings: The section `adapt` of the study file.
            plan: All variants.
            directory: The study, for results so far.
            on_note: Receives a remark for each decision.
        """
        self._settings, self._plan = settings, plan
        self._directory, self._on_note = directory, on_note
        self._dropped = set[object]()
        self._places = list[int]()

    @property
    def plan(self) -> StudyPlan:
        """The variants of all rounds so far."""
        return StudyPlan(self._plan.design, self._plan.variants[sorted(self._places)])

    def __iter__(self) -> "Iterator[pl.DataFrame]":
        """Yield the variants of each round, after those of the last have results."""
        ((axis, _),) = self._settings.against.items()
        design = self._plan.design
        index = self._plan.variants["index"].to_numpy()
        seeds = len(design.seeds)
        round_of = index % seeds // self._settings.seeds
        looks = int(round_of.max())
        for number in range(looks + 1):
            if self._places and not self._goes_on(looks):
                return
            places = np.flatnonzero(round_of == number).tolist()
            labels = (design.parameters(int(index[place]))[axis] for place in places)
            found = zip(places, labels, strict=True)
            new = [place for place, label in found if label not in self._dropped]
            self._places += new
            yield self._plan.variants[new]

    def _goes_on(self, looks: int) -> bool:
        """Give up values that are clearly worse; return whether others need more seeds."""
        settings = self._settings
        study = Study(self._directory)
        ((axis, _),) = settings.against.items()
        # Not those of later rounds, which an interrupted or larger study may have.
        so_far = self._plan.variants[self._places]
        numbers = so_far[VARIANT].to_list()
        seeds = (so_far["index"] % len(self._plan.design.seeds)).n_unique()
        table = study.paired(settings.metric, settings.against, variants=numbers).to_dicts()
        open_rows = [row for row in table if row[axis] not in self._dropped]
        sign = -1 if settings.goal == "maximize" else 1
        for row in open_rows if settings.goal else ():
            if sign * row["difference"] > 0 and row["p"] < (1 - LEVEL) / looks:
                self._dropped.add(row[axis])
                self._on_note(f"{axis} = {row[axis]} is clearly worse after {seeds} seeds: dropped")
        left = [row for row in open_rows if row[axis] not in self._dropped]
        # NaN, that of an interval which can't be told, is the largest, and never narrow.
        width = np.max([row["high"] - row["low"] for row in left], initial=0.0)
        if left and (settings.width is None or not width <= settings.width):
            return True
        reason = f"intervals are {width:.3g} wide" if left else "all values are worse"
        self._on_note(f"no more than {seeds} seeds: {reason}")
        return False


CHANGED_MESSAGE = (
    "a file that the variant reads, or Fleet2D itself, changed after the study began: run the study"
    " again"
)


@dataclass
class StudyJob:
    """Runs variants of a design.

    Attributes:
        design: The design.
        metrics: Patterns of the numbers to keep.
        tables: Names of the tables to keep.
    """

    design: Design
    metrics: tuple[str, ...]
    tables: tuple[str, ...]

    def __call__(self, task: WorkerTask) -> VariantResult:
        """Run a variant; return its results, with the error if it fails."""
        try:
            scenario = self.scenario(task)
        except Fleet2DError as error:  # a file changed after the study was planned
            outcome = VariantOutcome("failed", error=describe_error(error))
        else:
            outcome = execute(scenario, self.metrics, self.tables)
        return result_of(task, outcome)

    def scenario(self, task: WorkerTask) -> Scenario:
        """Return the scenario of a variant.

        Raises:
            Fleet2DError: It is wrong, or not as it was planned, since a file changed.
        """
        scenario = self.design.scenario(task.index)
        inputs = input_hash(scenario)
        if identity(content_hash(scenario_content(scenario)), inputs) != task.identity:
            raise ComponentError(CHANGED_MESSAGE)
        return scenario


class Observer:
    """Base class of those that follow the progress of a study; it ignores everything."""

    def on_note(self, text: str) -> None:
        """Receive a remark for the user."""

    def on_check(self, done: int, total: int) -> None:
        """Receive how many set-ups are checked."""

    def on_start(self, counts: Counts, workers: int) -> None:
        """Receive how many variants have results, and how many workers run the others."""

    def on_result(self, result: VariantResult) -> None:
        """Receive the results of a variant."""


@dataclass(frozen=True)
class CheckedStudy:
    """A study whose variants are all built and checked.

    Attributes:
        specification: The study.
        plan: Its variants.
        scenarios: Their scenarios, as the content of a file.
        metrics: What readers should know of their metrics, by name.
    """

    specification: Specification
    plan: StudyPlan
    scenarios: ScenarioFile
    metrics: Mapping[str, MetricFacts]

    def note_missing(self, variants: "pl.DataFrame", observer: Observer) -> None:
        """Note which metrics that the study names are missing in complete variants.

        Args:
            variants: What `presence` returns of them.
            observer: Receives the notes.
        """
        import polars as pl

        complete = variants.filter(status=COMPLETE)
        others = {*RESULT_COLUMNS, *self.plan.design.columns, "simulated_s"}
        metrics = [name for name in complete.columns if name not in others]
        named = [each for each in self.specification.file.named_metrics() if each[0][0] != "tune"]
        place_of = self.specification.places.place
        places = {name: place_of(location) for location, name in reversed(named)}
        for name in dict.fromkeys(name for _, name in named if name != "*"):
            fitting = [metric for metric in metrics if is_kept(metric, [name])]
            has_one = pl.any_horizontal(pl.lit(value=False), *fitting)
            lacking = len(complete.filter(~has_one))
            if lacking:
                hint = did_you_mean(name, metrics) if lacking == len(complete) else ""
                place = f"{places[name]}: " if places[name] else ""
                observer.on_note(
                    f"{place}{lacking} of {len(complete)} complete variants have no metric"
                    f" {name}{hint}"
                )

    @property
    def job(self) -> StudyJob:
        """The job for the workers."""
        keep = self.specification.file.keep
        return StudyJob(self.plan.design, keep.metrics, keep.tables)


def check_study(
    source: str | Path | Mapping[str, Any] | Specification,
    on_size: Callable[[int], None] = lambda _: None,
) -> CheckedStudy:
    """Read a study, and build and check the scenarios of all of its variants.

    Args:
        source: The study file, or the same as a mapping.
        on_size: Receives the number of variants before they are built.

    Raises:
        InputError: The study is wrong; the message names file and line, or axis and value. Or
            polars is not installed.
    """
    with extra("study", "studies need polars"):
        import polars as pl  # noqa: F401 - whether it is there
    specification = read_specification(source)
    scenarios, names = ScenarioFile(), KnownNames()

    def on_scenario(template: str, scenario: Scenario) -> None:
        scenarios.add(template, scenario)
        names.add(scenario)

    design = build_design(specification)
    on_size(len(design))
    plan = make_plan(design, on_scenario)
    names.check(specification)
    return CheckedStudy(specification, plan, scenarios, names.facts)


def run_study(
    checked: CheckedStudy,
    location: str | Path,
    crew: Crew,
    *,
    fail_fast: bool = False,
    changed: Changed | None = None,
    observer: Observer | None = None,
) -> Counts:
    """Run the variants of a study that have no results yet.

    Args:
        checked: The study.
        location: Its folder or store.
        crew: Where variants run.
        fail_fast: End with the first variant that fails.
        changed: What to do with results of other code or scenarios: `redo` or `keep`; None: refuse
            to continue.
        observer: Follows the progress.

    Raises:
        InputError: The folder can't be used, or holds results that don't belong to the study.
        ArtifactError: Results can't be written; stored results are kept.
        KeyboardInterrupt: Ctrl-C; all workers have ended, and finished variants are stored.
    """
    observer = observer or Observer()
    directory = StudyDirectory(location)
    directory.check_empty()
    if not directory.exists():
        check_setups(checked.plan, crew, observer.on_check)
    with directory.locked():
        for problem in drop_damaged(directory.storage):
            observer.on_note(problem)
        results = read_results(directory.storage, columns=(VARIANT, "status"))
        adapt = checked.specification.file.adapt
        # Of an adaptive study, new variants may be those of rounds that it doesn't need.
        plan = reconcile(
            checked.plan,
            directory,
            results[VARIANT],
            changed,
            observer.on_note,
            notes_new=adapt is None,
        )
        _write_plan(directory, checked, plan)
        complete = results.filter(status=COMPLETE)[VARIANT]
        run = _StudyRun(checked, plan, directory, crew, observer, fail_fast)
        if adapt is None:
            run.run_missing([plan.variants], complete)
        else:
            rounds = AdaptiveRounds(adapt, plan, directory, observer.on_note)
            if run.run_missing(rounds, complete):
                write_plan(directory, rounds.plan)
        variants = _write_variants(directory)
    checked.note_missing(variants, observer)
    return Counts.of(variants)


def presence(variants: "pl.DataFrame") -> "pl.DataFrame":
    """Return the status of variants, and which of their other columns have values."""
    import polars as pl

    return variants.select("status", pl.exclude("status").is_not_null())


def _write_variants(directory: StudyDirectory) -> "pl.DataFrame":
    """Write the data set of the variants; return their `presence`."""
    import polars as pl

    found = []

    def parts() -> "Iterator[pa.Table]":
        for rows in directory.slices():
            found.append(presence(rows))
            yield rows.to_arrow()

    directory.storage.write_table(VARIANTS, parts())
    return pl.concat(found)


@dataclass
class _StudyRun:
    """Runs variants of a study, and stores their results."""

    checked: CheckedStudy
    plan: StudyPlan
    directory: StudyDirectory
    crew: Crew
    observer: Observer
    fail_fast: bool

    def run_missing(self, rounds: "Iterable[pl.DataFrame]", complete: "pl.Series") -> bool:
        """Run the variants of each round that are not complete; return whether all were run."""
        import polars as pl

        total = len(self.plan.variants)
        is_complete = pl.col(VARIANT).is_in(complete.implode())
        done = len(self.plan.variants.filter(is_complete))
        self.observer.on_start(Counts(total, done, 0), self.crew.workers)
        queues = (self.plan.queue(round_.filter(~is_complete)) for round_ in rounds)
        is_checked = False
        with closing(self._results(queues)) as found:
            for result in found:
                self.observer.on_result(result)
                if result.is_complete and not is_checked:
                    frame = presence(results_frame([result.row]))
                    self.checked.note_missing(frame, self.observer)
                    is_checked = True
                if self.fail_fast and not result.is_complete:
                    return False
        return True

    def _results(self, queues: Iterable[TaskQueue]) -> Generator[VariantResult]:
        """Run the tasks of one queue after the other; yield and store their results."""
        writer = ResultWriter(self.directory.storage)
        try:
            for queue in queues:
                with closing(run_tasks(self.crew, self.checked.job, queue)) as steps:
                    for ends in steps:
                        for result in map(_result, ends):
                            writer.add(result)
                            yield result
                        writer.flush()
                writer.flush(now=True)  # the next queue may depend on it
        finally:
            writer.flush(now=True)


def _result(end: TaskEnd) -> VariantResult:
    if end.loss is not None:
        result = result_of(end.task, VariantOutcome("failed", error=end.loss))
    else:
        result = end.payload
    return VariantResult({**result.row, "attempts": end.attempts}, result.tables)


def _write_plan(directory: StudyDirectory, checked: CheckedStudy, plan: StudyPlan) -> None:
    """Write the description of the study; its `study.json` last, which makes the folder a study."""
    file = checked.specification.file
    source = checked.specification.source
    directory.storage.delete(VARIANTS)  # it may belong to another plan
    checked.scenarios.write(directory)
    write_plan(directory, plan)
    meta = Meta(
        name=checked.specification.name,
        description=file.description,
        code=code_version(),
        columns=checked.plan.design.columns,
        populations=file.populations,
        tables=file.keep.tables,
        compare=tuple(comparison.model_dump() for comparison in file.compare),
        source=source.read_text(encoding="utf-8") if source else "",
        metrics=dict(checked.metrics),
        tags=file.tags,
        notes=file.notes,
    )
    directory.write_meta(meta)
