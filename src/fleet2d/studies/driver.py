"""Running a study: what is missing is run, and each result is kept at once."""

import time
from collections.abc import Generator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from fleet2d.errors import ArtifactError
from fleet2d.studies.catalogue import (
    Changed,
    Reconciled,
    ScenarioFile,
    reconcile,
    write_catalogue,
)
from fleet2d.studies.design import build_design
from fleet2d.studies.directory import VARIANTS, Meta, StudyDirectory
from fleet2d.studies.engine import Outcome
from fleet2d.studies.execution import Event, Executor, Lost
from fleet2d.studies.identity import code_version
from fleet2d.studies.jobs import StudyJob
from fleet2d.studies.journal import Journal
from fleet2d.studies.parts import Part, drop_part
from fleet2d.studies.plan import Plan, check_setups, make_plan
from fleet2d.studies.record import Record, Task, record_of
from fleet2d.studies.results import Counts, statuses, write_variants
from fleet2d.studies.schedule import Schedule
from fleet2d.studies.specification import Specification, read_specification

PART_BYTES = 64_000_000  # of a journal that becomes a part
PART_S_REMOTE = 60.0  # how long results for a store stay on this machine alone


class Observer(Protocol):
    """Is told how a study goes on."""

    def note(self, text: str) -> None:
        """Take in a remark."""
        ...

    def checked(self, done: int, total: int) -> None:
        """Take in how many set-ups are checked."""
        ...

    def began(self, counts: Counts, workers: int) -> None:
        """Take in what there is, and by how many workers the rest is run."""
        ...

    def ended(self, record: Record) -> None:
        """Take in the results of a variant."""
        ...


class SilentObserver:
    """Takes in everything and shows nothing."""

    def note(self, text: str) -> None:
        """Show nothing."""

    def checked(self, done: int, total: int) -> None:
        """Show nothing."""

    def began(self, counts: Counts, workers: int) -> None:
        """Show nothing."""

    def ended(self, record: Record) -> None:
        """Show nothing."""


@dataclass(frozen=True)
class Checked:
    """A study whose variants are all built and checked.

    Attributes:
        specification: The study.
        plan: Its variants.
        scenarios: Their scenarios, as a file.
    """

    specification: Specification
    plan: Plan
    scenarios: ScenarioFile

    @property
    def job(self) -> StudyJob:
        """What workers are given."""
        keep = self.specification.file.keep
        return StudyJob(self.plan.design, keep.metrics, keep.tables)


def check_study(source: str | Path | Mapping[str, Any] | Specification) -> Checked:
    """Read a study, and build and check the scenarios of all of its variants.

    Raises:
        InputError: Something is wrong; the message names file and line, or axis and value.
    """
    specification = read_specification(source)
    scenarios = ScenarioFile()
    plan = make_plan(build_design(specification), specification.file.keep.tables, scenarios.add)
    return Checked(specification, plan, scenarios)


@dataclass
class RunOptions:
    """How a study is run.

    Attributes:
        fail_fast: End with the first variant that fails.
        changed: What to do with results of other code or scenarios: `redo`, `keep`, or refuse.
        observer: Is told how it goes on.
    """

    fail_fast: bool = False
    changed: Changed | None = None
    observer: Observer = field(default_factory=SilentObserver)


def run_study(
    checked: Checked, location: str | Path, executor: Executor, options: RunOptions
) -> Counts:
    """Run what is missing of a study; what was there before is left as it is.

    Raises:
        InputError: The folder can't be used, or holds results that don't belong to the study.
        ArtifactError: Results can't be written; those that are there are kept.
        KeyboardInterrupt: Ctrl-C; all workers are gone, and all finished variants kept.
    """
    directory = StudyDirectory(location)
    directory.check_empty()
    if not directory.exists():
        check_setups(checked.plan, executor, options.observer.checked)
    with directory.locked():
        parts = _intact_parts(directory, options.observer)
        ended = statuses(directory, parts)
        found = reconcile(checked.plan, directory, ended, options.changed)
        _write_plan(directory, checked, found)
        tasks = [
            Task(v.number, v.index, v.identity, v.home_key)
            for v in found.plan.variants
            if ended.get(v.number) != "complete"
        ]
        _describe(found, directory, options.observer)
        journal = directory.open_journal(parts)
        book = _Book(directory, parts, journal)
        counts = Counts(len(found.plan.variants), len(found.plan.variants) - len(tasks), 0)
        options.observer.began(counts, executor.workers)
        failed = 0
        try:
            with closing(_events(executor, checked.job, tasks)) as events:
                for event in events:
                    record = _record(event)
                    book.keep(record)
                    options.observer.ended(record)
                    failed += not record.is_complete
                    if failed and options.fail_fast:
                        break
        finally:
            book.pause()
        book.finish()
        write_variants(directory)
    final = statuses(directory, directory.parts())
    states = [final.get(v.number) for v in found.plan.variants]
    return Counts(len(states), states.count("complete"), states.count("failed"))


def _events(executor: Executor, job: StudyJob, tasks: list[Task]) -> Generator[Event]:
    if tasks:
        yield from executor.run(job, Schedule(tasks))


def _record(event: Event) -> Record:
    if isinstance(event, Lost):
        return record_of(event.task, Outcome("failed", error=event.reason), event.attempts)
    record = Record.decode(event.payload)
    return Record({**record.header, "attempts": event.attempts}, record.body)


class _Book:
    """Keeps results: each in the journal at once, and many together in parts."""

    def __init__(self, directory: StudyDirectory, parts: list[Part], journal: Journal) -> None:
        self._directory, self._parts, self._journal = directory, parts, journal
        self._since = time.monotonic()
        self._is_open = True

    def keep(self, record: Record) -> None:
        """Take in the results of a variant."""
        self._journal.append(record)
        waited = time.monotonic() - self._since
        late = not self._directory.storage.is_local and waited > PART_S_REMOTE
        if self._journal.size > PART_BYTES or late:
            self._commit()
            self._journal = self._directory.open_journal(self._parts)
            self._is_open = True

    def finish(self) -> None:
        """Bring all results into parts."""
        journal = self._directory.open_journal(self._parts)
        self._journal, self._is_open = journal, True
        if len(journal):
            self._commit()
            return
        self.pause()
        journal.path.unlink()

    def pause(self) -> None:
        """Leave what is in the journal there, for the next time."""
        if self._is_open:
            self._journal.close()
            self._is_open = False

    def _commit(self) -> None:
        self._parts.append(self._directory.commit(self._journal, self._parts))
        self._is_open, self._since = False, time.monotonic()


def _intact_parts(directory: StudyDirectory, observer: Observer) -> list[Part]:
    """Return the parts that are whole; others are dropped, and their variants run again."""
    intact = []
    for part in directory.parts():
        problem = part.problem(directory.storage, checksums=directory.storage.is_local)
        if problem is None:
            intact.append(part)
            continue
        observer.note(f"{problem}: the {part.variants} variants of that part are run again")
        drop_part(directory.storage, part)
    return intact


def _write_plan(directory: StudyDirectory, checked: Checked, found: Reconciled) -> None:
    """Write what the study is; the description last, which makes the folder a study."""
    file = checked.specification.file
    source = checked.specification.source
    directory.storage.delete(VARIANTS)  # it may be of another plan
    write_catalogue(directory, found.plan, checked.scenarios.content)
    meta = Meta(
        checked.specification.name,
        file.description,
        code_version(),
        checked.plan.design.columns,
        file.populations,
        file.keep.tables,
        tuple(one.model_dump(mode="json") for one in file.compare),
        source.read_text(encoding="utf-8") if source else "",
    )
    try:
        directory.write_meta(meta)
    except TypeError as error:  # a value in Python that JSON has no word for
        raise ArtifactError(f"the study can't be described: {error}") from error


def _describe(found: Reconciled, directory: StudyDirectory, observer: Observer) -> None:
    if 0 < found.new < len(found.plan.variants):
        observer.note(f"{found.new} variants are new in {directory.location}")
    if found.set_aside:
        observer.note(f"{found.set_aside} results no longer belong to the study: set aside")
