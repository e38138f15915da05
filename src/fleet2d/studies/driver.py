"""Running a study: missing variants are run, and each result is stored at once."""

import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fleet2d.configuration.trust import Trust, current_trust, restrict
from fleet2d.errors import ArtifactError, Fleet2DError
from fleet2d.studies.design import (
    Design,
    FileHashes,
    build_design,
    code_version,
    identity,
    input_hash,
    scenario_content,
)
from fleet2d.studies.directory import (
    VARIANTS,
    Counts,
    Meta,
    StudyDirectory,
    statuses,
    write_variants,
)
from fleet2d.studies.executors import Event, Executor, LostTask, TaskSchedule, WorkerTask
from fleet2d.studies.parts import Part, drop_part
from fleet2d.studies.plan import (
    Changed,
    ReconciledPlan,
    ScenarioFile,
    StudyPlan,
    check_setups,
    make_plan,
    reconcile,
    write_catalogue,
)
from fleet2d.studies.records import Journal, VariantRecord, record_of
from fleet2d.studies.simulator import VariantOutcome, describe_error, execute
from fleet2d.studies.specification import Specification, read_specification

PART_BYTES = 64_000_000  # size at which a journal becomes a part
PART_S_REMOTE = 60.0  # the longest time that results for a store are on this machine only
CHANGED = (
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
        trust: The code that workers may run; None: any.
    """

    design: Design
    metrics: tuple[str, ...]
    tables: tuple[str, ...]
    trust: Trust | None = field(default_factory=current_trust)

    def __call__(self, task: WorkerTask) -> bytes:
        """Run a variant; return its record, with the error if it fails."""
        with restrict(self.trust):
            return record_of(task, self._outcome(task)).encode()

    def _outcome(self, task: WorkerTask) -> VariantOutcome:
        try:
            scenario = self.design.scenario(task.index)
            inputs = input_hash(scenario, self._files)
        except Fleet2DError as error:  # a file changed after the study was planned
            return VariantOutcome("failed", error=describe_error(error))
        current, _ = identity(scenario_content(scenario), inputs)
        if current != task.identity:
            return VariantOutcome("failed", error=CHANGED)
        return execute(scenario, self.metrics, self.tables)

    def __post_init__(self) -> None:
        """Start with no hashes."""
        self._files = FileHashes()


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
    """

    specification: Specification
    plan: StudyPlan
    scenarios: ScenarioFile

    @property
    def job(self) -> StudyJob:
        """The job for the workers."""
        keep = self.specification.file.keep
        return StudyJob(self.plan.design, keep.metrics, keep.tables)


def check_study(source: str | Path | Mapping[str, Any] | Specification) -> CheckedStudy:
    """Read a study, and build and check the scenarios of all of its variants.

    Raises:
        InputError: The study is wrong; the message names file and line, or axis and value.
    """
    specification = read_specification(source)
    scenarios = ScenarioFile()
    plan = make_plan(build_design(specification), specification.file.keep.tables, scenarios.add)
    return CheckedStudy(specification, plan, scenarios)


@dataclass
class RunOptions:
    """How a study is run.

    Attributes:
        fail_fast: End with the first variant that fails.
        changed: What to do with results of other code or scenarios: `redo` or `keep`; None: refuse
            to continue.
        observer: Follows the progress.
    """

    fail_fast: bool = False
    changed: Changed | None = None
    observer: Observer = field(default_factory=Observer)


def run_study(
    checked: CheckedStudy, location: str | Path, executor: Executor, options: RunOptions
) -> Counts:
    """Run the variants of a study that have no results yet.

    Raises:
        InputError: The folder can't be used, or holds results that don't belong to the study.
        ArtifactError: Results can't be written; stored results are kept.
        KeyboardInterrupt: Ctrl-C; all workers have ended, and finished variants are stored.
    """
    directory = StudyDirectory(location)
    directory.check_empty()
    if not directory.exists():
        check_setups(checked.plan, executor, options.observer.on_check)
    with directory.locked():
        parts = _intact_parts(directory, options.observer)
        status_of = statuses(directory, parts)
        reconciled = reconcile(checked.plan, directory, status_of, options.changed)
        variants = reconciled.plan.variants
        _write_plan(directory, checked, reconciled.plan)
        tasks = [
            WorkerTask(v.number, v.index, v.identity, v.home_key)
            for v in variants
            if status_of.get(v.number) != "complete"
        ]
        _describe(reconciled, directory, options.observer)
        journal = directory.open_journal(parts)
        keeper = _ResultKeeper(directory, parts, journal)
        counts = Counts(len(variants), len(variants) - len(tasks), 0)
        options.observer.on_start(counts, executor.workers)
        failed = 0
        try:
            with closing(executor.run(checked.job, TaskSchedule(tasks))) as events:
                for event in events:
                    record = _record(event)
                    keeper.add(record)
                    options.observer.on_result(record)
                    failed += not record.is_complete
                    if failed and options.fail_fast:
                        break
        finally:
            keeper.pause()
        keeper.finish()
        write_variants(directory)
    final = statuses(directory, directory.parts())
    return Counts.of([final.get(v.number) for v in variants])


def _record(event: Event) -> VariantRecord:
    if isinstance(event, LostTask):
        return record_of(event.task, VariantOutcome("failed", error=event.reason), event.attempts)
    record = VariantRecord.decode(event.payload)
    return VariantRecord({**record.header, "attempts": event.attempts}, record.body)


class _ResultKeeper:
    """Stores results: each in the journal at once, and many together in parts."""

    def __init__(self, directory: StudyDirectory, parts: list[Part], journal: Journal) -> None:
        self._directory, self._parts, self._journal = directory, parts, journal
        self._commit_time = time.monotonic()
        self._is_open = True

    def add(self, record: VariantRecord) -> None:
        """Store the results of a variant."""
        self._journal.append(record)
        age_s = time.monotonic() - self._commit_time
        is_due = not self._directory.storage.is_local and age_s > PART_S_REMOTE
        if is_due or self._journal.size > PART_BYTES:
            self._commit()
            self._journal = self._directory.open_journal(self._parts)
            self._is_open = True

    def finish(self) -> None:
        """Move all results into parts."""
        journal = self._directory.open_journal(self._parts)
        self._journal, self._is_open = journal, True
        if len(journal):
            self._commit()
            return
        self.pause()
        journal.path.unlink()

    def pause(self) -> None:
        """Close the journal; its results stay there until the study is continued."""
        if self._is_open:
            self._journal.close()
            self._is_open = False

    def _commit(self) -> None:
        self._parts.append(self._directory.commit(self._journal, self._parts))
        self._is_open, self._commit_time = False, time.monotonic()


def _intact_parts(directory: StudyDirectory, observer: Observer) -> list[Part]:
    """Return the undamaged parts; drop the others, so that their variants are run again."""
    intact = []
    for part in directory.parts():
        problem = part.problem(directory.storage, checksums=directory.storage.is_local)
        if problem is None:
            intact.append(part)
            continue
        observer.on_note(f"{problem}: the {part.variants} variants of that part are run again")
        drop_part(directory.storage, part)
    return intact


def _write_plan(directory: StudyDirectory, checked: CheckedStudy, plan: StudyPlan) -> None:
    """Write the description of the study; its `study.json` last, which makes the folder a study."""
    file = checked.specification.file
    source = checked.specification.source
    directory.storage.delete(VARIANTS)  # it may belong to another plan
    write_catalogue(directory, plan, checked.scenarios.content)
    meta = Meta(
        checked.specification.name,
        file.description,
        code_version(),
        checked.plan.design.columns,
        file.populations,
        file.keep.tables,
        tuple(comparison.model_dump(mode="json") for comparison in file.compare),
        source.read_text(encoding="utf-8") if source else "",
    )
    try:
        directory.write_meta(meta)
    except TypeError as error:  # a Python value that JSON can't hold
        raise ArtifactError(f"the study can't be described: {error}") from error


def _describe(reconciled: ReconciledPlan, directory: StudyDirectory, observer: Observer) -> None:
    if 0 < reconciled.new < len(reconciled.plan.variants):
        observer.on_note(f"{reconciled.new} variants are new in {directory.location}")
    if reconciled.set_aside:
        observer.on_note(f"{reconciled.set_aside} results no longer belong to the study: set aside")
