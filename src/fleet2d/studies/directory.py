"""The folder of a study: its description, plan and results so far, and the lock of its writer."""

import hashlib
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from fleet2d.errors import ArtifactError, RunDirectoryError, errors_as
from fleet2d.kernels import I32, U8, Bool
from fleet2d.storage.files import PARTIAL, FolderLock, path_in
from fleet2d.studies.intervals import Limits
from fleet2d.studies.parts import (
    Part,
    ResultRows,
    next_number,
    part_name,
    read_parts,
    read_results,
    record_names,
    write_part,
)
from fleet2d.studies.records import (
    VARIANT,
    Journal,
    array_of,
    check_numbers,
    numbers_of,
    read_journal,
)
from fleet2d.studies.storage import Storage, from_json, writing

if TYPE_CHECKING:
    import pyarrow as pa

FORMAT = 1
MISSING = "missing"
# Statuses of variants with results.
COMPLETE = 1
FAILED = 2
LOCK = "lock"
META = "study.json"
PLAN = "plan.parquet"
SCENARIOS = "scenarios.parquet"
VARIANTS = "variants.parquet"
_STATE = b"fleet2d.parts"
_PLAN_ONLY = ("identity", "scenario", "template", "home_key")  # no columns of `variants`


@dataclass(frozen=True)
class Counts:
    """How far a study is.

    Attributes:
        total: The number of its variants.
        complete: The number of variants that are complete.
        failed: The number of variants that failed.
    """

    total: int
    complete: int
    failed: int

    @classmethod
    def of(cls, statuses: Sequence[str | None]) -> Self:
        """Count the statuses of variants."""
        return cls(len(statuses), statuses.count("complete"), statuses.count("failed"))

    @property
    def missing(self) -> int:
        """The number of variants without results."""
        return self.total - self.complete - self.failed


SHARE = "share"  # the unit of numbers from 0 to 1 begins with it


@dataclass(frozen=True)
class MetricFacts:
    """What readers should know of a metric.

    Attributes:
        description: What it measures, in one line.
        unit: The unit of its numbers.
        units: The units of those that differ, by the last part of their names.
        least: Their least values by the last part of their names, "" for all others.
        largest: Their largest values, likewise.
        better: Which of two values is better, `higher` or `lower`, by the same names.
    """

    description: str = ""
    unit: str = ""
    units: Mapping[str, str] = field(default_factory=dict)
    least: Mapping[str, float] = field(default_factory=dict)
    largest: Mapping[str, float] = field(default_factory=dict)
    better: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Meta:
    """The content of `study.json`.

    Attributes:
        name: The name of the study.
        description: The question that it answers.
        code: The version of the code that runs it.
        columns: The columns of the axes, the seed last.
        populations: The columns whose values are a sample of a population.
        tables: The names of the tables to keep.
        compare: The comparisons that the report shows, as `PairedComparison` takes them.
        source: The study file's text, for readers.
        metrics: The metrics of the scenarios, by name.
        tags: Words to find the study by.
        notes: Remarks of its author.
    """

    name: str
    description: str
    code: str
    columns: tuple[str, ...]
    populations: tuple[str, ...]
    tables: tuple[str, ...]
    compare: tuple[Mapping[str, Any], ...] = ()
    source: str = ""
    metrics: Mapping[str, MetricFacts] = field(default_factory=dict)
    tags: tuple[str, ...] = ()
    notes: str = ""

    def unit(self, metric: str) -> str:
        """Return the unit of a metric such as `ltp_error.ana.tv`; empty if unknown."""
        facts, last = self._facts(metric)
        return facts.units.get(last, facts.unit)

    def limits(self, metric: str) -> Limits:
        """Return the least and the largest value that a metric can have; a share is 0 to 1."""
        if self.unit(metric).startswith(SHARE):
            return 0.0, 1.0
        facts, last = self._facts(metric)
        least = facts.least.get(last, facts.least.get("", -math.inf))
        return least, facts.largest.get(last, facts.largest.get("", math.inf))

    def better(self, metric: str) -> str:
        """Return which values of a metric are better, `higher` or `lower`; empty: neither is."""
        facts, last = self._facts(metric)
        return facts.better.get(last, facts.better.get("", ""))

    def _facts(self, metric: str) -> tuple[MetricFacts, str]:
        """Return what readers should know of a metric, and the last part of its name."""
        names = metric.split(".")
        return self.metrics.get(names[0], MetricFacts()), names[-1]


class StudyDirectory:
    """A study on the disk or in a store.

    Attributes:
        storage: The folder or store of its files.
        scratch: A local folder for the journal and for unfinished files.
    """

    def __init__(self, location: str | Path) -> None:
        """Name the folder; nothing is read or written."""
        self.storage = Storage(location)
        self.scratch = self.storage.folder or _scratch_of(self.storage.location)

    @property
    def location(self) -> str:
        """The folder or store as the user wrote it, without secrets."""
        return self.storage.location

    def exists(self) -> bool:
        """Return whether there is a study."""
        return self.storage.exists(META)

    def check_empty(self) -> None:
        """Refuse a folder that holds something else.

        Raises:
            RunDirectoryError: It isn't empty, and holds no study.
        """
        folder = self.storage.folder
        if folder is None or not folder.exists() or self.exists():
            return
        is_folder = folder.is_dir()
        names = {p.name.removesuffix(PARTIAL) for p in folder.iterdir()} if is_folder else {""}
        # A study that was killed while it began has the files that are written before `study.json`.
        if names and not (names <= {LOCK, PLAN, SCENARIOS, META} and names & {LOCK, SCENARIOS}):
            raise RunDirectoryError(
                f"{folder} exists and holds no study: choose another --out or remove it"
            )

    def read_meta(self) -> Meta:
        """Return the description of the study.

        Raises:
            RunDirectoryError: There is no study, its description is damaged, or a later version
                wrote it.
        """
        if not self.exists():
            raise RunDirectoryError(
                f"{self.location} holds no study: give the folder that `fleet2d study run` wrote"
            )
        with self.storage.reading(META):
            content = json.loads(self.storage.read(META))
            version = content.pop("format")
            if isinstance(version, int) and version > FORMAT:
                raise RunDirectoryError(
                    f"{self.location} was written by a later Fleet2D (format {version}): update"
                    " Fleet2D"
                )
            meta: Meta = from_json(Meta, content)
            if unknown := set(meta.populations) - set(meta.columns):
                raise ValueError(f"its populations {', '.join(sorted(unknown))} are no columns")
            return meta

    def write_meta(self, meta: Meta) -> None:
        """Write the description of the study.

        Raises:
            ArtifactError: It can't be written, or holds a Python value that JSON can't hold.
        """
        with errors_as(ArtifactError, "the study can't be described", of=(TypeError, ValueError)):
            content = json.dumps({"format": FORMAT, **asdict(meta)}, indent=1)
        self.storage.write(META, content.encode())

    def intact_parts(self, on_note: Callable[[str], None]) -> list[Part]:
        """Return the undamaged parts; delete the others, so that their variants are run again.

        Args:
            on_note: Receives a remark for each part that is deleted.

        Raises:
            RunDirectoryError: There is a link in the folder.
        """
        intact = []
        for record in record_names(self.storage):
            part = None
            try:
                part = Part.read(self.storage, record)
                problem = part.problem(self.storage, checksums=self.storage.folder is not None)
                count = f"the {part.variants} variants of that part"
            except RunDirectoryError as error:
                self.storage.path(record)  # refuses a link
                problem = str(error).partition(":")[0]
                count = "its variants"
            if part is not None and problem is None:
                intact.append(part)
                continue
            on_note(f"{problem}: {count} are run again")
            # The record first: a part never counts without its files.
            self.storage.delete(record)
            for file in part.files if part else ():
                self.storage.delete(file.name)
        return intact

    def plan_batches(self, columns: Sequence[str] | None = None) -> "Iterator[pa.Table]":
        """Yield the plan, or some of its columns, `variant` among them, some rows at a time.

        Raises:
            RunDirectoryError: It is missing or damaged.
        """
        for table in self.storage.read_batches(PLAN, columns):
            with self.storage.reading(PLAN):
                check_numbers(table)
            yield table

    def statuses(self, parts: Sequence[Part]) -> U8:
        """Return the status of each variant with results, by number: uint8 (n,).

        It is 0 without results, else COMPLETE or FAILED; the newest result counts.
        """
        status = np.zeros(0, np.uint8)

        def note(numbers: I32, is_complete: Bool) -> None:
            nonlocal status
            missing = int(numbers.max(initial=-1)) + 1 - len(status)
            if missing > 0:
                status = np.append(status, np.zeros(max(missing, len(status)), np.uint8))
            status[numbers] = np.where(is_complete, COMPLETE, FAILED)

        for table in read_results(self.storage, parts, (VARIANT, "status")):
            is_complete = [status == "complete" for status in table.column("status").to_pylist()]
            note(numbers_of(table), np.array(is_complete, np.bool_))
        for record in read_journal(self.journal_path(parts)):
            note(np.array([record.number], np.int32), np.array([record.is_complete]))
        return status

    def counts(self) -> Counts:
        """Return how far the study is."""
        numbers = np.concatenate([numbers_of(table) for table in self.plan_batches([VARIANT])])
        status = self.statuses(read_parts(self.storage))
        status = np.append(status, np.zeros(int(numbers.max(initial=0)) + 1, np.uint8))[numbers]
        return Counts(len(numbers), *(int((status == c).sum()) for c in (COMPLETE, FAILED)))

    def scenario(self, number: int) -> dict[str, Any]:
        """Return the scenario of a variant, with its seed.

        Raises:
            RunDirectoryError: The study has no such variant.
        """
        row_filter = [(VARIANT, "=", number)]
        rows = self.storage.read_table(PLAN, ["template", "seed"], row_filter).to_pylist()
        if not rows:
            raise RunDirectoryError(f"{self.location} has no variant {number}")
        template_filter = [("template", "=", rows[0]["template"])]
        with self.storage.reading(SCENARIOS):
            texts = self.storage.read_table(SCENARIOS, filters=template_filter).to_pylist()
            content: dict[str, Any] = json.loads(texts[0]["scenario"])
            content["simulation"]["seed"] = rows[0]["seed"]
        return content

    def variants(self) -> "pa.Table":
        """Return parameters, status, times, digest and metrics of all variants.

        They are in the order of the design, from their file if that is up to date.

        Raises:
            RunDirectoryError: Files are missing or damaged.
        """
        import pyarrow as pa

        parts = read_parts(self.storage)
        headers = [record.header for record in read_journal(self.journal_path(parts))]
        if not headers and self.storage.exists(VARIANTS):
            table = self.storage.read_table(VARIANTS)
            if (table.schema.metadata or {}).get(_STATE) == _state(parts, has_journal=False):
                return table
        return pa.concat_tables(self._variant_tables(parts, headers))

    def _variant_tables(
        self, parts: Sequence[Part], headers: Sequence[Mapping[str, Any]]
    ) -> "Iterator[pa.Table]":
        """Yield the variants, a block of rows of the plan at a time."""
        import pyarrow as pa

        results = ResultRows(self.storage, parts, headers)
        state = {_STATE: _state(parts, bool(headers))}
        for plan in self.plan_batches():
            newest = results.of(numbers_of(plan))
            names = (name for name in plan.column_names if name not in _PLAN_ONLY)
            columns = {name: plan.column(name) for name in names}
            columns |= {
                name: newest.column(name) for name in newest.column_names if name != VARIANT
            }
            statuses = (status or MISSING for status in columns["status"].to_pylist())
            columns["status"] = array_of(statuses, pa.string())
            yield pa.table(columns).replace_schema_metadata(state)

    def write_variants(self, observe: "Callable[[pa.Table], pa.Table]") -> None:
        """Write `variants.parquet`, which may be larger than the memory.

        Args:
            observe: Receives some rows after the other, and returns them.

        Raises:
            ArtifactError: It can't be written.
        """
        tables = map(observe, self._variant_tables(read_parts(self.storage), ()))
        self.storage.write_batches(VARIANTS, tables, self.scratch)

    def journal_path(self, parts: Iterable[Part]) -> Path:
        """Return the path of the journal of the next part."""
        return path_in(self.scratch, f"journal-{part_name(next_number(parts))}.bin")

    def open_journal(self, parts: Iterable[Part]) -> Journal:
        """Open the journal of the next part; journals of committed parts are removed.

        Raises:
            ArtifactError: It can't be written.
        """
        path = self.journal_path(parts)
        with writing(self.scratch):
            self.scratch.mkdir(parents=True, exist_ok=True)
            for journal in self.scratch.glob("journal-*.bin"):
                if journal.name < path.name:  # left by a crash between commit and removal
                    journal.unlink()
        return Journal(path)

    def commit(self, journal: Journal, parts: Iterable[Part]) -> Part:
        """Turn a journal into a part, and remove it.

        Raises:
            ArtifactError: The part can't be written; the journal stays.
        """
        scratch = path_in(self.scratch, "partial")
        part = write_part(self.storage, scratch, next_number(parts), journal)
        journal.close()
        with suppress(OSError):
            journal.path.unlink()
        return part

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from running the same study.

        Raises:
            RunDirectoryError: Another process is running it.
        """
        advice = "wait for it or end it; `fleet2d study status` shows how far it is"
        with writing(self.scratch):
            self.scratch.mkdir(parents=True, exist_ok=True)
            lock = FolderLock(self.scratch, LOCK, advice)
        try:
            yield
        finally:
            lock.release()


def _scratch_of(location: str) -> Path:
    """Return the local folder for the unfinished files of a remote store."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    name = hashlib.sha256(location.encode()).hexdigest()[:16]
    return Path(base) / "fleet2d" / "studies" / name


def _state(parts: Iterable[Part], has_journal: bool) -> bytes:
    sizes = [[part.number, *(file.sha256[:16] for file in part.files)] for part in parts]
    return json.dumps([sizes, has_journal]).encode()
