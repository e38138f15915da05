"""Running a study: missing variants are run, and each result is stored at once."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.configuration.problems import did_you_mean
from fleet2d.errors import ComponentError, Fleet2DError
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
    SCENARIOS,
    VARIANTS,
    Counts,
    Meta,
    MetricFacts,
    StudyDirectory,
)
from fleet2d.studies.executors import Crew, TaskEnd, TaskQueue, WorkerTask, run_tasks
from fleet2d.studies.intervals import LEVEL
from fleet2d.studies.parts import Part
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
from fleet2d.studies.records import (
    RESULT_COLUMNS,
    Journal,
    VariantRecord,
    array_of,
    record_of,
    results_table,
)
from fleet2d.studies.simulator import VariantOutcome, describe_error, execute, is_kept
from fleet2d.studies.specification import AdaptSettings, Specification, read_specification

if TYPE_CHECKING:
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
        places = np.array(sorted(self._places), np.int64)
        return StudyPlan(self._plan.design, self._plan.variants.take(places))

    def __iter__(self) -> Iterator[list[int]]:
        """Yield the places of the variants of each round, after those of the last have results."""
        ((axis, _),) = self._settings.against.items()
        design, index = self._plan.design, self._plan.variants.index
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
            yield new

    def _goes_on(self, looks: int) -> bool:
        """Give up values that are clearly worse; return whether others need more seeds."""
        settings = self._settings
        variants = self._plan.variants
        study = Study(self._directory)
        ((axis, _),) = settings.against.items()
        # Not those of later rounds, which an interrupted or larger study may have.
        numbers = variants.number[self._places].tolist()
        seeds = len(np.unique(variants.index[self._places] % len(self._plan.design.seeds)))
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


PART_BYTES = 32_000_000  # size at which a journal becomes a part
PART_S_REMOTE = 60.0  # the longest time that results for a store are on this machine only
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

    def __call__(self, task: WorkerTask) -> VariantRecord:
        """Run a variant; return its record, with the error if it fails."""
        try:
            scenario = self.scenario(task)
        except Fleet2DError as error:  # a file changed after the study was planned
            outcome = VariantOutcome("failed", error=describe_error(error))
        else:
            outcome = execute(scenario, self.metrics, self.tables)
        return record_of(task, outcome)

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

    def on_result(self, record: VariantRecord) -> None:
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

    def note_missing(self, headers: Iterable[Mapping[str, Any]], observer: Observer) -> None:
        """Note which metrics that the study names are missing in complete variants, by headers."""
        summary = VariantSummary(self)
        summary.add(results_table(headers))
        summary.note_missing(observer)

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
        InputError: The study is wrong; the message names file and line, or axis and value.
    """
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
        parts = directory.intact_parts(observer.on_note)
        status = directory.statuses(parts)
        adapt = checked.specification.file.adapt
        # Of an adaptive study, new variants may be those of rounds that it doesn't need.
        plan = reconcile(
            checked.plan, directory, status > 0, changed, observer.on_note, notes_new=adapt is None
        )
        variants = plan.variants
        _write_plan(directory, checked, plan)
        status = np.append(status, np.zeros(int(variants.number.max()) + 1, np.uint8))
        is_missing = status[variants.number] != COMPLETE
        missing = np.flatnonzero(is_missing)
        keeper = _ResultKeeper(directory, parts)
        counts = Counts(len(variants), len(variants) - len(missing), 0)
        observer.on_start(counts, crew.workers)
        has_failed = False
        is_checked = False
        rounds: Iterable[list[int]] = [missing.tolist()]
        if adapt is not None:
            rounds = AdaptiveRounds(adapt, plan, directory, observer.on_note)
        try:
            for places in rounds:
                queue = TaskQueue(variants.task(place) for place in places if is_missing[place])
                for record in _records(crew, checked.job, queue):
                    keeper.add(record)
                    observer.on_result(record)
                    has_failed |= not record.is_complete
                    if record.is_complete and not is_checked:
                        checked.note_missing([record.header], observer)
                        is_checked = True
                    if has_failed and fail_fast:
                        break
                if has_failed and fail_fast:
                    break
        except BaseException:
            keeper.pause()
            raise
        keeper.finish()
        if isinstance(rounds, AdaptiveRounds) and not (has_failed and fail_fast):
            write_plan(directory, rounds.plan)
        summary = VariantSummary(checked)
        directory.write_variants(summary.add)
    summary.note_missing(observer)
    return summary.counts


def _records(crew: Crew, job: StudyJob, queue: TaskQueue) -> Iterator[VariantRecord]:
    """Yield the record of each task as it ends."""
    with closing(run_tasks(crew, job, queue)) as rounds:
        for ends in rounds:
            yield from map(_record, ends)


class VariantSummary:
    """What is to be said of the variants of a study, of which some rows come after the other."""

    def __init__(self, checked: CheckedStudy) -> None:
        """Start without variants."""
        file = checked.specification.file
        self.counts = Counts(0, 0, 0)
        self._others = {*RESULT_COLUMNS, *checked.plan.design.columns, "simulated_s"}
        named = [each for each in file.named_metrics() if each[0][0] != "tune"]
        place = checked.specification.places.place
        self._places = {name: place(location) for location, name in reversed(named)}
        self._lacking = {name: 0 for _, name in named if name != "*"}
        self._metrics: list[str] = []

    def add(self, variants: "pa.Table") -> "pa.Table":
        """Add some variants; return them."""
        import pyarrow as pa

        from fleet2d.artifacts.arrow import values_of

        statuses = variants.column("status").to_pylist()
        new, old = Counts.of(statuses), self.counts
        self.counts = Counts(
            old.total + new.total, old.complete + new.complete, old.failed + new.failed
        )
        complete = variants.filter(array_of((s == "complete" for s in statuses), pa.bool_()))
        self._metrics = [name for name in complete.column_names if name not in self._others]
        for pattern in self._lacking:
            lacks = np.ones(len(complete), bool)
            for name in self._metrics:
                if is_kept(name, [pattern]):
                    lacks &= values_of(complete[name].is_null())
            self._lacking[pattern] += int(np.count_nonzero(lacks))
        return variants

    def note_missing(self, observer: Observer) -> None:
        """Note which of the metrics that the study names are missing in complete variants."""
        complete = self.counts.complete
        for pattern, lacking in self._lacking.items():
            if lacking:
                hint = did_you_mean(pattern, self._metrics) if lacking == complete else ""
                place = self._places[pattern]
                observer.on_note(
                    f"{place}{': ' * bool(place)}{lacking} of {complete} complete variants have no"
                    f" metric {pattern}{hint}"
                )


def _record(end: TaskEnd) -> VariantRecord:
    if end.loss is not None:
        return record_of(end.task, VariantOutcome("failed", error=end.loss), end.attempts)
    record: VariantRecord = end.payload
    return VariantRecord({**record.header, "attempts": end.attempts}, record.body)


class _ResultKeeper:
    """Stores results: each in the journal at once, and many together in parts."""

    def __init__(self, directory: StudyDirectory, parts: list[Part]) -> None:
        self._directory, self._parts = directory, parts
        self._journal: Journal | None = directory.open_journal(parts)
        self._commit_time = time.monotonic()

    def add(self, record: VariantRecord) -> None:
        """Store the results of a variant."""
        if self._journal is None:
            self._journal = self._directory.open_journal(self._parts)
        self._journal.append(record)
        age_s = time.monotonic() - self._commit_time
        is_due = self._directory.storage.folder is None and age_s > PART_S_REMOTE
        if is_due or self._journal.size > PART_BYTES:
            self._commit(self._journal)

    def finish(self) -> None:
        """Move all results into parts."""
        if self._journal is not None and len(self._journal):
            self._commit(self._journal)
        elif self._journal is not None:
            self._journal.close()
            self._journal.path.unlink()

    def pause(self) -> None:
        """Close the journal; its results stay there until the study is continued."""
        if self._journal is not None:
            self._journal.close()

    def _commit(self, journal: Journal) -> None:
        self._parts.append(self._directory.commit(journal, self._parts))
        self._journal, self._commit_time = None, time.monotonic()


def _write_plan(directory: StudyDirectory, checked: CheckedStudy, plan: StudyPlan) -> None:
    """Write the description of the study; its `study.json` last, which makes the folder a study."""
    file = checked.specification.file
    source = checked.specification.source
    directory.storage.delete(VARIANTS)  # it may belong to another plan
    directory.storage.write(SCENARIOS, checked.scenarios.content())
    write_plan(directory, plan)
    meta = Meta(
        checked.specification.name,
        file.description,
        code_version(),
        checked.plan.design.columns,
        file.populations,
        file.keep.tables,
        tuple(comparison.model_dump() for comparison in file.compare),
        source.read_text(encoding="utf-8") if source else "",
        checked.metrics,
        file.tags,
        file.notes,
    )
    directory.write_meta(meta)
