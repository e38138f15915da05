"""The folder of a study: its description, plan and results so far, and the lock of its writer."""

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from fleet2d.errors import RunDirectoryError
from fleet2d.storage.files import PARTIAL
from fleet2d.studies.parts import (
    VARIANT,
    Part,
    next_number,
    part_name,
    read_parts,
    read_results,
    results_table,
    write_part,
)
from fleet2d.studies.records import Journal, read_journal
from fleet2d.studies.storage import Storage, write_error

if TYPE_CHECKING:
    import pyarrow as pa

FORMAT = 1
LOCK = "lock"
META, PLAN, SCENARIOS, VARIANTS = (
    "study.json", "plan.parquet", "scenarios.parquet", "variants.parquet",
)  # fmt: skip


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
        compare: The comparisons that the report shows.
        source: The study file's text, for readers.
    """

    name: str
    description: str
    code: str
    columns: tuple[str, ...]
    populations: tuple[str, ...]
    tables: tuple[str, ...]
    compare: tuple[Mapping[str, Any], ...] = ()
    source: str = ""

    def to_json(self) -> bytes:
        """Return the file's content."""
        return json.dumps({"format": FORMAT, **vars(self)}, indent=1).encode()

    @classmethod
    def of(cls, content: Mapping[str, Any], location: str) -> "Meta":
        """Return the content of a file, checked for its format.

        Raises:
            RunDirectoryError: A later version of Fleet2D wrote it.
        """
        if content.get("format", FORMAT + 1) > FORMAT:
            raise RunDirectoryError(
                f"{location} was written by a later Fleet2D (format {content.get('format')}):"
                " update Fleet2D"
            )
        lists = ("columns", "populations", "tables", "compare")
        values: dict[str, Any] = {key: content[key] for key in cls.__dataclass_fields__}
        values |= {key: tuple(values[key]) for key in lists}
        return cls(**values)


class StudyDirectory:
    """A study on the disk or in a store.

    Attributes:
        storage: The folder or store of its files.
        scratch: A local folder for the journal and for unfinished files.
    """

    def __init__(self, location: str | Path) -> None:
        """Name the folder; nothing is read or written."""
        self.storage = Storage(location)
        folder = self.storage.folder
        self.scratch = folder or _scratch_of(self.storage.location)

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
        if names and not {LOCK} <= names <= {LOCK, PLAN, SCENARIOS, META}:
            raise RunDirectoryError(
                f"{folder} exists and holds no study: choose another --out or remove it"
            )

    def read_meta(self) -> Meta:
        """Return the description of the study.

        Raises:
            RunDirectoryError: There is no study, or a later version wrote it.
        """
        try:
            content = json.loads(self.storage.read(META))
        except FileNotFoundError:
            raise RunDirectoryError(
                f"{self.location} holds no study: give the folder that `fleet2d study run` wrote"
            ) from None
        except ValueError as error:
            raise RunDirectoryError(
                f"{self.location}/{META} is damaged ({error}): the runs in the folder are whole;"
                " run the study again in a new folder"
            ) from error
        return Meta.of(content, self.location)

    def write_meta(self, meta: Meta) -> None:
        """Write the description of the study."""
        self.storage.write(META, meta.to_json())

    def write_table(self, name: str, table: "pa.Table") -> None:
        """Write a Parquet file; readers see all of it, or none."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        sink = pa.BufferOutputStream()
        pq.write_table(table, sink, compression="zstd", row_group_size=50_000)
        self.storage.write(name, bytes(sink.getvalue()))

    def read_table(self, name: str, columns: Iterable[str] | None = None) -> "pa.Table":
        """Return a Parquet file's table.

        Raises:
            FileNotFoundError: There is none.
        """
        import pyarrow.parquet as pq

        names = None if columns is None else list(columns)
        path = self.storage.path(name)
        return pq.read_table(path, filesystem=self.storage.filesystem, columns=names)

    def parts(self) -> list[Part]:
        """Return the parts of the data set that are committed."""
        return read_parts(self.storage)

    def journal_path(self, parts: Iterable[Part]) -> Path:
        """Return the path of the journal of the next part."""
        return self.scratch / f"journal-{part_name(next_number(parts))}.bin"

    def open_journal(self, parts: Iterable[Part]) -> Journal:
        """Open the journal of the next part; journals of committed parts are removed.

        Raises:
            ArtifactError: It can't be written.
        """
        path = self.journal_path(parts)
        try:
            self.scratch.mkdir(parents=True, exist_ok=True)
            for journal in self.scratch.glob("journal-*.bin"):
                if journal.name < path.name:  # left by a crash between commit and removal
                    journal.unlink()
        except OSError as error:
            raise write_error(self.scratch, error) from error
        return Journal(path)

    def commit(self, journal: Journal, parts: Iterable[Part]) -> Part:
        """Turn a journal into a part, and remove it.

        Raises:
            ArtifactError: The part can't be written; the journal stays.
        """
        scratch = self.scratch / "partial"
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
        try:
            self.scratch.mkdir(parents=True, exist_ok=True)
            file = os.open(self.scratch / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise write_error(self.scratch, error) from error
        try:
            _lock(file, self.location)
            yield
        finally:
            os.close(file)


def _lock(file: int, location: str) -> None:
    """Lock a file while it is open; do nothing where the system has no such locks."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise RunDirectoryError(
            f"another process is running the study in {location}: wait for it or end it;"
            " `fleet2d study status` shows how far it is"
        ) from error


def _scratch_of(location: str) -> Path:
    """Return the local folder for the unfinished files of a remote store."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    name = hashlib.sha256(location.encode()).hexdigest()[:16]
    return Path(base) / "fleet2d" / "studies" / name


_STATE = b"fleet2d.parts"
_PLAN_ONLY = ("identity", "scenario", "template", "home_key")  # no columns of `variants`
MISSING = "missing"


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


def statuses(directory: StudyDirectory, parts: Iterable[Part]) -> dict[int, str]:
    """Return the status of each variant with results, by number; the newest result counts."""
    parts = tuple(parts)
    status_of: dict[int, str] = {}
    for table in read_results(directory.storage, parts):
        status_of |= zip(
            table.column(VARIANT).to_pylist(), table.column("status").to_pylist(), strict=True
        )
    for record in read_journal(directory.journal_path(parts)):
        status_of[record.number] = record.header["status"]
    return status_of


def count(directory: StudyDirectory) -> Counts:
    """Return how far a study is."""
    numbers = directory.read_table(PLAN, [VARIANT]).column(VARIANT).to_pylist()
    status_of = statuses(directory, directory.parts())
    return Counts.of([status_of.get(number) for number in numbers])


def assemble(directory: StudyDirectory) -> "pa.Table":
    """Return `variants`: parameters, status, time, digest, metrics, in the order of the design."""
    import pyarrow as pa

    parts = directory.parts()
    headers = [record.header for record in read_journal(directory.journal_path(parts))]
    results = list(read_results(directory.storage, parts))
    if headers or not results:
        results.append(results_table(headers))
    table = pa.concat_tables(results, promote_options="default")
    plan = directory.read_table(PLAN)
    rows = _newest_rows(table.column(VARIANT).to_numpy(), plan.column(VARIANT).to_numpy())
    newest = table.take(pa.array(rows, pa.int64(), mask=rows < 0))
    columns = {name: plan.column(name) for name in plan.column_names if name not in _PLAN_ONLY}
    columns |= {name: newest.column(name) for name in newest.column_names if name != VARIANT}
    columns["status"] = columns["status"].fill_null(MISSING)
    return pa.table(columns).replace_schema_metadata({_STATE: _state(parts, bool(headers))})


def variants_table(directory: StudyDirectory) -> "pa.Table":
    """Return `variants`, read from its file if that is up to date."""
    parts = directory.parts()
    has_journal = next(read_journal(directory.journal_path(parts)), None) is not None
    if not has_journal:
        with suppress(FileNotFoundError):
            table = directory.read_table(VARIANTS)
            if (table.schema.metadata or {}).get(_STATE) == _state(parts, has_journal=False):
                return table
    return assemble(directory)


def write_variants(directory: StudyDirectory) -> None:
    """Write `variants.parquet`."""
    directory.write_table(VARIANTS, assemble(directory))


def _newest_rows(numbers: Any, variants: Any) -> Any:
    """Return the last row of each variant in a table of results, -1 where there is none.

    Args:
        numbers: The variant of each row of the results: int32 (rows,).
        variants: The variants to look up: int32 (variants,).
    """
    rows = np.full(max(numbers.max(initial=-1), variants.max(initial=-1)) + 2, -1, np.int64)
    rows[numbers] = np.arange(len(numbers))
    return rows[variants]


def _state(parts: Iterable[Part], has_journal: bool) -> bytes:
    sizes = [[part.number, *(file.sha256[:16] for file in part.files)] for part in parts]
    return json.dumps([sizes, has_journal]).encode()
