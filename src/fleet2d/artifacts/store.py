"""The run store: its settings, and the writer of a run directory that survives crashes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator

from fleet2d.artifacts.manifest import FILE_NAME, Manifest, Status, TableRecord, table_record
from fleet2d.artifacts.seal import TableDigest, make_seal, run_digest
from fleet2d.artifacts.table import (
    FLUSH_ROWS,
    Batch,
    Chunk,
    Columns,
    TableBuffer,
    TableSpec,
    rows_of,
)
from fleet2d.artifacts.unfinished import FOLDER as UNFINISHED
from fleet2d.artifacts.unfinished import (
    LOCK_NAME,
    Commit,
    UnfinishedRun,
    columns_of,
    remove_leftovers,
)
from fleet2d.bounds import FILE_BYTES
from fleet2d.configuration.components import Settings
from fleet2d.configuration.units import PositiveDuration
from fleet2d.errors import ArtifactError, Fleet2DError, RunDirectoryError
from fleet2d.storage.files import PARTIAL, is_disk_full, sync_directory, write_atomically

if TYPE_CHECKING:
    import pyarrow as pa

    from fleet2d.artifacts.arrow import ParquetTable


def _off_as_text(value: Any) -> Any:
    """Undo YAML 1.1, where a bare `off` is the truth value false."""
    return "off" if value is False else value


class ArtifactSettings(Settings):
    """Which tables a run stores, and how finely.

    Attributes:
        trajectories: Store every entity's pose this often (a multiple of simulation.step), at
            `every step`, or not at all (`off`).
        key_frames: Store the key frames of every movement: few rows, from which the pose at any
            step can be rebuilt.
        observations: Store every observation that a robot makes.
        events: Store events: a user seen or lost, an arrival, a change of activity.
        outputs: Store the outputs of algorithms and metrics, one table each.
        decisions: Store every decision: who decided, which behavior for it, why, and until when.
        learned: Store what each algorithm has learned at the end, learned/NAME.npz: another run can
            start from it.
        checkpoint: Write the state of the run this often in simulated time, so that `fleet2d
            resume` can continue from there, or at the first decision after that; `auto`: after
            every 10 s or more of computing; or not at all (`off`).

    Example:
        >>> ArtifactSettings(trajectories="off", events=False).observations
        True
    """

    trajectories: Annotated[
        PositiveDuration | Literal["off", "every step"], BeforeValidator(_off_as_text)
    ] = timedelta(hours=1)
    key_frames: bool = True
    observations: bool = True
    events: bool = True
    outputs: bool = True
    decisions: bool = False
    learned: bool = False
    checkpoint: Annotated[
        PositiveDuration | Literal["auto", "off"], BeforeValidator(_off_as_text)
    ] = "auto"


def cannot_write(directory: Path, error: OSError) -> Fleet2DError:
    """Return the error to raise when a run directory can't be created."""
    if is_disk_full(error):
        return ArtifactError(
            f"the disk is full: {directory} can't be made; free some space or choose another --out"
        )
    reason = error.strerror or str(error)
    return RunDirectoryError(
        f"{directory} can't be made or written ({reason}): choose another --out"
    )


@dataclass
class TableWriter:
    """A table that is being written.

    Attributes:
        buffer: The newest rows.
        digest: Digest of the rows in the file; None before the first, and for a run in memory.
        chunks: Those rows and the number in each chunk, if the run is in memory.
        file: The file with those rows, if the run is in a directory; None before the first.
        logged: Number of rows of the buffer that are in the journal.
    """

    buffer: TableBuffer
    digest: TableDigest | None = None
    chunks: list[tuple[Chunk, int]] = field(default_factory=list)
    file: ParquetTable | None = None
    logged: int = 0

    def hashed(self) -> TableDigest:
        """Hash the rows kept in memory; return the digest of all rows that left the buffer."""
        if self.digest is not None:
            return self.digest
        digest = TableDigest(self.buffer.spec)
        for chunk, rows in self.chunks:
            digest.update(chunk, rows)
        return digest

    def log(self, unfinished: UnfinishedRun | None) -> None:
        """Append those rows of the buffer to the journal that it doesn't have yet.

        Raises:
            OSError: They can't be written.
        """
        first = self.logged
        buffer = self.buffer
        if unfinished is None or first == buffer.rows:
            return
        unfinished.add(buffer.spec, buffer.arrays(first), buffer.rows - first, buffer.words)
        self.logged = buffer.rows

    def file_in(self, root: Path) -> ParquetTable:
        """Return the file of the table; create it if there is none yet."""
        from fleet2d.artifacts.arrow import ParquetTable

        if self.file is None:
            self.file = ParquetTable(root, self.buffer.spec)
        return self.file


class RunStore:
    """Tables of a run, in a directory or in memory.

    Files are called `NAME.parquet.partial` until they are complete and on the disk. Then they are
    renamed, and after that the manifest is written with the status of the run: even if the process
    is killed, a file called `NAME.parquet` is complete.

    Attributes:
        directory: The run directory; None: the run is only in memory.
        root: Its absolute path, which stays right if the current directory changes.
        manifest: The content of `manifest.json`; the store sets status, tables and digest.
        row_listeners: Functions that are called with each row, as a table and a mapping.

    Example:
        >>> from fleet2d.artifacts.table import Column
        >>> spec = TableSpec("events", (Column("step", "step"), Column("what", "category")))
        >>> store = RunStore(None, [spec])
        >>> store.append("events", step=[0, 5], what=["seen", "lost"])
        >>> _ = store.close()
        >>> store.arrow("events").num_rows
        2
    """

    def __init__(
        self,
        directory: Path | str | None,
        specs: Iterable[TableSpec] = (),
        *,
        flush_rows: int = FLUSH_ROWS,
    ) -> None:
        """Prepare the store; `open` writes the first files."""
        self.directory = None if directory is None else Path(directory)
        self.manifest = Manifest()
        self.root = None if self.directory is None else self.directory.absolute()
        self._flush_rows = flush_rows
        self._tables: dict[str, TableWriter] = {}
        self.row_listeners: list[Callable[[str, dict[str, Any]], None]] = []
        self._new_directories: list[Path] = []
        self._digests: dict[str, str] | None = None
        self._is_open = directory is None
        self._failure: ArtifactError | None = None
        self._unfinished = None if self.root is None else UnfinishedRun(self.root)
        for spec in specs:
            self.add_table(spec)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the row listeners, which belong to the caller, not to the run."""
        return {**self.__dict__, "row_listeners": []}

    def check(self) -> None:
        """Check, without writing, that the directory can be used.

        Raises:
            RunDirectoryError: The directory isn't empty, is a file, or can't be written.
        """
        directory = self.directory
        if directory is None:
            return
        try:
            nearest = directory
            while not os.path.lexists(nearest) and nearest != nearest.parent:
                nearest = nearest.parent
            if not nearest.is_dir():
                raise RunDirectoryError(
                    f"{directory} can't be a run directory, because {nearest} is not a directory: "
                    "choose another --out or remove it"
                )
            if directory.is_dir() and any(directory.iterdir()):  # is_dir refuses impossible names
                state = "is not empty: "
                if (directory / UNFINISHED).is_dir():
                    state = f"has an unfinished run: continue it by `fleet2d resume {directory}`, "
                raise RunDirectoryError(
                    f"{directory} exists and {state}choose another --out or remove it"
                )
        except OSError as error:
            raise cannot_write(directory, error) from error
        if not os.access(nearest, os.W_OK | os.X_OK):
            raise RunDirectoryError(
                f"{directory} can't be written: you may not write in {nearest}; choose another"
                " --out"
            )

    def open(self) -> None:
        """Create the directory and its manifest, with the status `running`.

        Raises:
            RunDirectoryError: The directory can't be used; no new file remains.
            ArtifactError: The disk is full.
        """
        if self._is_open or self.directory is None or self.root is None:
            return
        self.check()
        paths = (self.root, *self.root.parents)
        unfinished = self._unfinished_run()
        self._new_directories = [path for path in paths if not path.is_dir()]
        try:
            self.root.mkdir(parents=True, exist_ok=True)
            unfinished.lock()
            if any(path.name != LOCK_NAME for path in self.root.iterdir()):
                unfinished.release()
                raise RunDirectoryError(f"another run was stored in {self.directory} just now")
            self._is_open = True
            unfinished.begin()
            self.manifest.status = "running"
            size = self.manifest.write(self.root)
            FILE_BYTES.check(size, self.directory / FILE_NAME, RunDirectoryError)
        except OSError as error:
            self.discard()
            raise cannot_write(self.directory, error) from error
        except RunDirectoryError:  # without a manifest, nobody could open the run
            self.discard()
            raise

    def reopen(self, unfinished: UnfinishedRun, commit: Commit | None) -> None:
        """Continue in the directory of an unfinished run, after a commit of its journal.

        Args:
            unfinished: The journal and checkpoint of the run, locked for this process.
            commit: The commit to continue after; None: start from the beginning.

        Raises:
            ArtifactError: The journal is damaged, or the directory can't be written.
        """
        assert self.root is not None
        self._unfinished = unfinished
        self._is_open = True
        with self._writing("the directory"):
            self.manifest.status = "running"
            self.manifest.write(self.root)
            for path in (*self.root.glob("*.parquet"), *self.root.glob(f"*.parquet{PARTIAL}")):
                path.unlink()  # the journal has all of their rows
            for entry in unfinished.resume(commit):
                self.add_table(entry.spec)
                table = self._tables[entry.spec.name]
                for name, words in entry.words.items():
                    table.buffer.words[name].enter(words.in_order())
                self._fill(table, table.buffer.check(columns_of(entry)), log=False)

    def keep(self, name: str, content: str) -> None:
        """Write a file beside the tables, atomically.

        Raises:
            ArtifactError: It can't be written.
        """
        assert self.root is not None
        with self._writing(name):
            write_atomically(self.root / name, content.encode())

    def journal_digest(self) -> str:
        """Return the SHA-256 of the journal up to the last commit.

        Raises:
            ArtifactError: It can't be read; the run is marked as failed.
        """
        with self._writing("the checkpoint"):
            return self._unfinished_run().journal_digest()

    def keep_checkpoint(self, write: Callable[[int], None]) -> None:
        """Replace the checkpoint of the run; see `UnfinishedRun.keep_checkpoint`.

        Raises:
            ArtifactError: It can't be written; the run is marked as failed.
        """
        with self._writing("the checkpoint"):
            self._unfinished_run().keep_checkpoint(write)

    def commit(self, step: int, *, sync: bool = False) -> Commit | None:
        """Write all rows so far to the journal, so that they survive a crash of the process.

        Args:
            step: The first step of which rows may be missing.
            sync: Whether they must survive a power cut, too.

        Returns:
            The commit; None for a run in memory, which has no journal.

        Raises:
            ArtifactError: They can't be written; the run is marked as failed.
        """
        if self.root is None:
            return None
        self._check_usable()
        with self._writing("the journal"):
            for entry in self._tables.values():
                entry.log(self._unfinished)
            return self._unfinished_run().commit(step, sync=sync)

    def add_table(self, spec: TableSpec) -> None:
        """Add a table, at any time before the run is closed; the same table may be added again.

        Raises:
            ArtifactError: Another table has that name, or the run is closed.
        """
        self._check_usable()
        entry = self._tables.get(spec.name)
        if entry is None:
            self._tables[spec.name] = TableWriter(TableBuffer(spec, self._flush_rows))
        elif entry.buffer.spec != spec:
            raise ArtifactError(
                f"there is a table {spec.name!r} with other columns already: choose another name"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the tables, in the order in which they were added."""
        return tuple(self._tables)

    def add_rows(self, table: str, columns: Columns, description: str = "") -> None:
        """Declare a table by its columns if needed, and add rows to it; see `append`.

        Args:
            table: The name of the table.
            columns: The values of each column.
            description: One line for a reader of the table.
        """
        self.add_table(TableSpec(table, tuple(columns), description))
        self.append(table, **{column.name: values for column, values in columns.items()})

    def append(self, table: str, **columns: Any) -> None:
        """Add rows to a table; arrays are copied.

        Args:
            table: The name of a table that was added.
            columns: One array per column, all of one length; a scalar stands for all rows.

        Raises:
            ArtifactError: The columns don't fit the table, or it can't be written.
        """
        self._check_usable()
        if not self._is_open:
            raise ArtifactError("the run directory is not open: call open() before append()")
        if table not in self._tables:
            raise ArtifactError(f"there is no table {table!r}: add it by add_table() first")
        entry = self._tables[table]
        batch = entry.buffer.check(columns)
        for listener in self.row_listeners:
            for row in rows_of(entry.buffer.spec, columns, batch.rows):
                listener(table, row)
        self._fill(entry, batch)

    def _fill(self, entry: TableWriter, batch: Batch, *, log: bool = True) -> None:
        """Add rows to a buffer; without `log` they are not written to the journal."""
        start = 0
        while start < batch.rows:
            start = entry.buffer.fill(batch, start)
            if not log:
                entry.logged = entry.buffer.rows
            if entry.buffer.is_full:
                self._flush(entry)

    def arrow(self, table: str) -> pa.Table:
        """Return a table of a run in memory, up to the last row appended.

        Raises:
            ArtifactError: There is no such table, or the run is stored in a directory.
        """
        from fleet2d.artifacts.arrow import table_of

        if self.directory is not None:
            raise ArtifactError(
                f"the run is stored in {self.directory}: close it, and read it by open_run()"
            )
        if table not in self._tables:
            raise ArtifactError(f"there is no table {table!r}, only {', '.join(self._tables)}")
        entry = self._tables[table]
        self._flush(entry)
        return table_of(entry.chunks, entry.buffer.spec, entry.buffer.words)

    def close_tables(self) -> dict[str, str]:
        """Write all rows, complete all files, and return the digest of each table.

        After that the manifest has the tables and the digest of the run.

        Raises:
            ArtifactError: They can't be written; the run is marked as failed.
        """
        self._check_failure()
        if self._digests is not None:
            return self._digests
        for entry in self._tables.values():
            self._flush(entry)
        if self.root is not None:  # every file is complete before any is renamed
            for name, entry in self._tables.items():
                with self._writing(f"{name}.parquet", entry):
                    entry.file_in(self.root).finish()
            for name, entry in self._tables.items():
                with self._writing(f"{name}.parquet"):
                    entry.file_in(self.root).publish()
            with self._writing("the directory"):
                sync_directory(self.root)
        digests = dict[str, str]()
        tables = dict[str, TableRecord]()
        for name, entry in self._tables.items():
            digest = entry.hashed()
            spec = entry.buffer.spec
            digests[name] = digest.hexdigest(entry.buffer.words)
            tables[name] = table_record(spec, digest.rows, digests[name])
        self.manifest.tables = dict(sorted(tables.items()))
        self.manifest.digest = run_digest(digests)
        self._digests = digests
        return digests

    def close(self, status: Status = "complete") -> dict[str, str]:
        """End the run: close the tables if they are open, then write the manifest.

        Returns:
            The digest of each table; the run's own is in `manifest.digest`.

        Raises:
            ArtifactError: The run can't be written; it is marked as failed.
        """
        if self._failure is None and not self._is_open:
            raise ArtifactError("the run directory is not open: call open() before close()")
        digests = self.close_tables()
        self.manifest.status = status
        if self.root is not None:
            with self._writing(FILE_NAME):
                self.manifest.seal = make_seal(self.manifest, self.root)
                self.manifest.write(self.root)
                sync_directory(self.root)
            self._unfinished_run().end(keep=status != "complete")
        return digests

    def discard(self) -> None:
        """Remove all written files of a run that failed before its first step."""
        for entry in self._tables.values():
            if entry.file is not None:
                entry.file.abandon()
        if self.root is not None and self._is_open:
            self._unfinished_run().end()
            remove_leftovers(self.root)
            for name in (FILE_NAME, *(f"{table}.parquet" for table in self._tables)):
                for path in (self.root / name, self.root / f"{name}{PARTIAL}"):
                    with suppress(OSError):
                        path.unlink()
        for path in self._new_directories:  # innermost first; only empty ones can be removed
            with suppress(OSError):
                path.rmdir()
        self._is_open = False

    @property
    def is_closed(self) -> bool:
        """Whether the run is closed and can be read back."""
        return self._digests is not None

    def _flush(self, entry: TableWriter) -> None:
        """Move rows from the buffer to the file and hash them, or to the chunks in memory."""
        rows = entry.buffer.rows
        if not rows:
            return
        with self._writing("the journal"):
            entry.log(self._unfinished)
        chunk = entry.buffer.take(reuse=self.root is not None)
        entry.logged = 0
        if self.root is None:
            entry.chunks.append((chunk, rows))
            return
        entry.digest = entry.hashed()
        entry.digest.update(chunk, rows)
        name = entry.buffer.spec.name
        with self._writing(f"{name}.parquet", entry):
            entry.file_in(self.root).write(chunk, rows, entry.buffer.words)

    def _unfinished_run(self) -> UnfinishedRun:
        assert self._unfinished is not None, "a run in memory has no journal"
        return self._unfinished

    def _check_usable(self) -> None:
        self._check_failure()
        if self._digests is not None:
            raise ArtifactError("the run is closed: nothing more can be stored in it")

    def _check_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    @contextmanager
    def _writing(self, subject: str, entry: TableWriter | None = None) -> Iterator[None]:
        """End the run and mark it as failed if a write fails; `subject` names the file."""
        try:
            yield
        except OSError as error:
            reason = f"{subject} can't be written ({error.strerror or error})"
            advice = "Run again with another --out"
            if is_disk_full(error):
                reason = f"the disk is full: {subject} can't be written"
                advice = (
                    f"Free some space and continue by `fleet2d resume {self.directory}`, or store"
                    " less (`artifacts:` in the scenario) and run again with another --out"
                )
            is_marked = self._mark_failed(reason, entry)
            self._failure = ArtifactError(
                f"{reason}; the run so far is in {self.directory} and "
                f"{'marked as failed' if is_marked else 'not marked as complete'}. {advice}"
            )
            raise self._failure from error

    def _mark_failed(self, reason: str, entry: TableWriter | None) -> bool:
        """Leave the files partial; return whether the manifest with that status was written."""
        for table in self._tables.values():
            if table.file is not None:
                table.file.abandon()
        self._unfinished_run().end(keep=True, undo=True)
        self.manifest.status = "failed"
        self.manifest.notes.append(reason)
        if _try_write(self.manifest, self.root):
            return True
        # The file is lost anyway, and frees enough space for a manifest on a full disk.
        file = None if entry is None else entry.file
        return file is not None and file.empty() and _try_write(self.manifest, self.root)


def _try_write(manifest: Manifest, root: Path | None) -> bool:
    """Write the manifest of a failed run; return whether that worked."""
    with suppress(OSError):
        if root is not None:
            manifest.write(root)
            return True
    return False
