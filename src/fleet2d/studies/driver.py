"""Running a study: missing variants are run, and each result is stored at once."""

from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet2d.configuration.problems import did_you_mean
from fleet2d.errors import ComponentError, Fleet2DError, extra
from fleet2d.scenario.model import Scenario
from fleet2d.studies.design import (
    Design,
    build_design,
    code_version,
    identity,
    input_hash,
    scenario_content,
    template_hash,
)
from fleet2d.studies.directory import (
    COMPLETE,
    VARIANTS,
    Counts,
    Meta,
    MetricFacts,
    StudyDirectory,
)
from fleet2d.studies.executors import Crew, TaskEnd, TaskQueue, WorkerJob, WorkerTask, run_tasks
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
from fleet2d.studies.specification import SEED, Specification, read_specification
from fleet2d.studies.storage import Storage

if TYPE_CHECKING:
    import polars as pl
    import pyarrow as pa


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
        daily: Numbers to keep of each day.
    """

    design: Design
    metrics: tuple[str, ...]
    tables: tuple[str, ...]
    daily: tuple[str, ...] = ()

    def __call__(self, task: WorkerTask) -> VariantResult:
        """Run a variant; return its results, with the error if it fails."""
        try:
            scenario = self.scenario(task)
        except Fleet2DError as error:  # a file changed after the study was planned
            outcome = VariantOutcome("failed", error=describe_error(error))
        else:
            outcome = execute(scenario, self.metrics, self.tables, self.daily)
        return result_of(task, outcome)

    def scenario(self, task: WorkerTask) -> Scenario:
        """Return the scenario of a variant.

        Raises:
            Fleet2DError: The scenario is wrong, or a file changed since it was planned.
        """
        scenario = self.design.scenario(task.index)
        content = scenario_content(scenario)
        seed = content["simulation"]["seed"]
        if identity(template_hash(content), seed, input_hash(scenario)) != task.identity:
            raise ComponentError(CHANGED_MESSAGE)
        return scenario


class Observer:
    """Base class of observers of a study's progress; it ignores everything."""

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
        metrics: The facts of their metrics, by name.
    """

    specification: Specification
    plan: StudyPlan
    scenarios: ScenarioFile
    metrics: Mapping[str, MetricFacts]

    def note_missing(self, variants: "pl.DataFrame", observer: Observer) -> None:
        """Note which metrics that the study names are missing in complete variants.

        Args:
            variants: The `presence` of all variants.
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
        file = self.specification.file
        daily = file.rollout.metrics if file.rollout else ()
        return StudyJob(self.plan.design, file.keep.metrics, file.keep.tables, daily)


def check_study(
    source: str | Path | Mapping[str, Any] | Specification,
    on_size: Callable[[int], None] = lambda _: None,
    crew: Crew | None = None,
    observer: Observer | None = None,
) -> CheckedStudy:
    """Read a study, and build and check the scenarios of all of its variants.

    Args:
        source: The study file, or the same as a mapping.
        on_size: Receives the number of variants before they are built.
        crew: Where the homes of a population are built; None: in this process.
        observer: Follows the progress.

    Raises:
        InputError: The study is wrong; the message names file and line, or axis and value. Or
            polars is not installed.
    """
    with extra("study", "studies need polars"):
        import polars as pl  # noqa: F401 - whether it is there
    specification = read_specification(source)
    scenarios = ScenarioFile()
    names = KnownNames()

    def on_scenario(template: str, scenario: Scenario) -> None:
        scenarios.add(template, scenario)
        names.add(scenario)

    observer = observer or Observer()
    design = build_design(specification, crew, observer.on_check)
    on_size(len(design))
    plan = make_plan(design, on_scenario)
    names.check(specification)
    for note in design.notes:
        observer.on_note(note)
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
        finished = results[VARIANT]
        variants = reconcile(checked.plan.variants, directory, finished, changed, observer.on_note)
        plan = StudyPlan(checked.plan.design, variants)
        _write_plan(directory, checked, plan)
        complete = results.filter(status=COMPLETE)[VARIANT]
        run = _StudyRun(checked, plan, directory, crew, observer, fail_fast)
        run.run_missing(complete)
        found = write_variants(directory)
    checked.note_missing(found, observer)
    return Counts.of(found)


def presence(variants: "pl.DataFrame") -> "pl.DataFrame":
    """Return the status of variants, and which of their other columns have values."""
    import polars as pl

    return variants.select("status", pl.exclude("status").is_not_null())


def write_variants(directory: StudyDirectory) -> "pl.DataFrame":
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

    def run_missing(self, complete: "pl.Series") -> None:
        """Run the variants that are not complete."""
        import polars as pl

        total = len(self.plan.variants)
        is_complete = pl.col(VARIANT).is_in(complete.implode())
        missing = self.plan.variants.filter(~is_complete)
        self.observer.on_start(Counts(total, total - len(missing), 0), self.crew.workers)
        is_checked = False
        results = stored_results(
            self.directory.storage, self.crew, self.checked.job, self.plan.queue(missing)
        )
        with closing(results) as found:
            for result in found:
                self.observer.on_result(result)
                if result.is_complete and not is_checked:
                    frame = presence(results_frame([result.row]))
                    self.checked.note_missing(frame, self.observer)
                    is_checked = True
                if self.fail_fast and not result.is_complete:
                    return


def stored_results(
    storage: Storage, crew: Crew, job: WorkerJob, queue: TaskQueue
) -> Generator[VariantResult]:
    """Run the tasks of a queue; yield and store their results.

    Args:
        storage: The files of a study.
        crew: Where tasks run.
        job: Returns the `VariantResult` of a task.
        queue: The tasks.
    """
    writer = ResultWriter(storage)
    try:
        with closing(run_tasks(crew, job, queue)) as steps:
            for ends in steps:
                for result in map(result_of_end, ends):
                    writer.add(result)
                    yield result
                writer.flush()
    finally:
        writer.flush(now=True)


def result_of_end(end: TaskEnd) -> VariantResult:
    """Return the result of a task that has ended; a lost one has failed."""
    if end.loss is not None:
        result = result_of(end.task, VariantOutcome("failed", error=end.loss))
    else:
        result = end.payload
    return VariantResult({**result.row, "attempts": end.attempts}, result.tables)


def _features(checked: CheckedStudy) -> tuple[str, ...]:
    """Return the columns of what was drawn for each life of a population, its seed the last."""
    fleet = checked.specification.file.fleet
    columns = [axis.columns[1:] for axis in checked.plan.design.axes if axis.name == fleet]
    return (*columns[0], SEED) if columns else ()


def _write_plan(directory: StudyDirectory, checked: CheckedStudy, plan: StudyPlan) -> None:
    """Write the files that describe a study; the last, `study.json`, makes the folder a study."""
    directory.storage.delete(VARIANTS)  # those stored may belong to another plan
    checked.scenarios.write(directory)
    write_plan(directory, plan)
    directory.write_meta(describe(checked))


def describe(checked: CheckedStudy) -> Meta:
    """Return the description of a study."""
    file = checked.specification.file
    source = checked.specification.source
    return Meta(
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
        notes="\n".join(filter(None, (file.notes, *checked.plan.design.notes))),
        fleet=file.fleet,
        features=_features(checked),
        rollout=file.rollout.model_dump(mode="json") if file.rollout else None,
    )
