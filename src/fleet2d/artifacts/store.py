"""The run store: takes rows while a run goes on, and leaves a run directory that can be trusted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet2d.artifacts.buffer import FLUSH_ROWS, Checked, TableBuffer
from fleet2d.artifacts.digest import TableDigest, run_digest
from fleet2d.artifacts.directory import (
    cannot_write,
    check_run_directory,
    is_disk_full,
    make_directories,
    remove_directories,
)
from fleet2d.artifacts.files import sync_directory, write_atomically
from fleet2d.artifacts.journal import Commit
from fleet2d.artifacts.ledger import Ledger, columns_of, remove_leftovers
from fleet2d.artifacts.lock import LOCK_NAME
from fleet2d.artifacts.manifest import FILE_NAME, Manifest, Status
from fleet2d.artifacts.seal import make_seal
from fleet2d.artifacts.table import TableSpec
from fleet2d.artifacts.table_writer import TableWriter
from fleet2d.errors import ArtifactError, RunDirectoryError

if TYPE_CHECKING:
    import pyarrow as pa


class RunStore:
    """Tables of a run, in a directory or in memory.

    Files are called `NAME.parquet.partial` until they are whole and on the disk. Only then are
    they renamed, and only after that does the manifest say that the run is done: however the
    process ends, a file called `NAME.parquet` is whole.

    Attributes:
        directory: Where the run is stored; None keeps it in memory.
        manifest: What `manifest.json` will hold. The engine fills it in; status, tables and
            digest are the store's.

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
        manifest: Manifest | None = None,
        *,
        flush_rows: int = FLUSH_ROWS,
    ) -> None:
        """Touch nothing yet: `open` does."""
        self.directory = None if directory is None else Path(directory)
        self.manifest = manifest or Manifest()
        self._root = None if self.directory is None else self.directory.absolute()
        self._flush_rows = flush_rows
        self._tables: dict[str, TableWriter] = {}
        self._made: list[Path] = []
        self._digests: dict[str, str] | None = None
        self._is_open = directory is None
        self._failure: ArtifactError | None = None
        self._ledger = None if self._root is None else Ledger(self._root)
        for spec in specs:
            self.add_table(spec)

    def hash_again(self) -> None:
        """Make the digests of a run in memory anew from its rows, which a file alone holds."""
        for entry in self._tables.values():
            entry.hash_again()

    def check(self) -> None:
        """Say, without writing, that the directory can't be used: worth asking before set-up.

        Raises:
            RunDirectoryError: It exists and holds something, is a file, or can't be written.
        """
        if self.directory is not None:
            check_run_directory(self.directory)

    def open(self) -> None:
        """Make the directory and its manifest, with the status `running`.

        Raises:
            RunDirectoryError: The directory can't be used; nothing is left behind.
            ArtifactError: The disk is full.
        """
        if self._is_open or self.directory is None or self._root is None:
            return
        self.check()
        try:
            self._made = make_directories(self._root)
            self._take_directory(self._root)
            self._is_open = True
            self._ledger_of().begin()
            self.manifest.status = "running"
            self.manifest.write(self._root)
        except OSError as error:
            self.discard()
            raise cannot_write(self.directory, error) from error

    def _take_directory(self, root: Path) -> None:
        """Lock the directory, and see that no other run has begun there since it was checked."""
        ledger = self._ledger_of()
        ledger.lock()
        if any(path.name != LOCK_NAME for path in root.iterdir()):
            ledger.release()
            raise RunDirectoryError(f"another run was stored in {self.directory} just now")

    def reopen(self, ledger: Ledger, commit: Commit | None) -> None:
        """Go on in the directory of an unfinished run, behind a commit of its journal.

        Args:
            ledger: What the run wrote down, locked for this process.
            commit: Where to go on; None begins anew.

        Raises:
            ArtifactError: The journal is damaged, or the directory can't be written.
        """
        assert self._root is not None
        self._ledger, self._is_open = ledger, True
        with self._writing("the directory"):
            self.manifest.status = "running"
            self.manifest.write(self._root)
            for path in (*self._root.glob("*.parquet"), *self._root.glob("*.parquet.partial")):
                path.unlink()  # as they were when the run ended early
            for entry in ledger.go_on(commit):
                self.add_table(entry.spec)
                table = self._tables[entry.spec.name]
                table.buffer.learn_words(entry.words)
                self._fill(table, table.buffer.check(columns_of(entry)), log=False)

    def keep(self, name: str, content: str) -> None:
        """Write a file beside the tables, at one stroke.

        Raises:
            ArtifactError: It can't be written.
        """
        assert self._root is not None
        with self._writing(name):
            write_atomically(self._root / name, content.encode())

    def keep_checkpoint(self, content: bytes) -> None:
        """Replace the checkpoint of the run.

        Raises:
            ArtifactError: It can't be written; the run is marked as failed.
        """
        with self._writing("the checkpoint"):
            self._ledger_of().keep_checkpoint(content)

    def commit(self, step: int, *, sync: bool = False) -> Commit | None:
        """Let all rows so far survive the end of this process; nothing for a run in memory.

        Args:
            step: The step before which they are.
            sync: Whether they must survive a power cut too.

        Raises:
            ArtifactError: They can't be written; the run is marked as failed.
        """
        if self._root is None:
            return None
        self._check_usable()
        with self._writing("the journal"):
            for entry in self._tables.values():
                entry.log(self._ledger)
            return self._ledger_of().commit(step, sync=sync)

    def add_table(self, spec: TableSpec) -> None:
        """Add a table, at any time before the run is closed; one that is there may come again.

        Raises:
            ArtifactError: Another table has that name, or the run is closed.
        """
        self._check_usable()
        known = self._tables.get(spec.name)
        if known is None:
            buffer = TableBuffer(spec, self._flush_rows)
            self._tables[spec.name] = TableWriter(buffer, TableDigest(spec))
        elif known.buffer.spec != spec:
            raise ArtifactError(
                f"there is a table {spec.name!r} with other columns already: name yours otherwise"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the tables, as they were added."""
        return tuple(self._tables)

    def append(self, table: str, **columns: Any) -> None:
        """Add rows to a table; arrays are copied, and may be used again.

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
            raise ArtifactError(f"there is no table {table!r}: add_table() it first")
        entry = self._tables[table]
        self._fill(entry, entry.buffer.check(columns))

    def _fill(self, entry: TableWriter, checked: Checked, *, log: bool = True) -> None:
        """Take rows; those that the journal has already are not logged."""
        start = 0
        while start < checked.rows:
            start = entry.buffer.fill(checked, start)
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
        return table_of(entry.kept, entry.buffer.spec, entry.buffer.words)

    def close_tables(self) -> dict[str, str]:
        """Write what waits, make all files whole, and return the digest of each table.

        Raises:
            ArtifactError: They can't be written; the run is marked as failed.
        """
        self._check_failure()
        if self._digests is not None:
            return self._digests
        for entry in self._tables.values():
            self._flush(entry)
        if self._root is not None:
            self._finish_files(self._root)
        self._digests = {
            name: entry.digest.hexdigest(entry.buffer.words) for name, entry in self._tables.items()
        }
        return self._digests

    def close(self, status: Status = "complete") -> dict[str, str]:
        """End the run: close the tables if that is still to do, then write the manifest.

        Returns:
            The digest of each table; the run's own is in `manifest.digest`.

        Raises:
            ArtifactError: The run can't be written; it is marked as failed.
        """
        if self._failure is None and not self._is_open:
            raise ArtifactError("the run directory is not open: call open() before close()")
        digests = self.close_tables()
        self.manifest.status = status
        self.manifest.tables = {
            name: self._tables[name].record(digests[name]) for name in sorted(digests)
        }
        self.manifest.digest = run_digest(digests)
        if self._root is not None:
            with self._writing(FILE_NAME):
                self.manifest.seal = make_seal(self.manifest, self._root)
                self.manifest.write(self._root)
                sync_directory(self._root)
            self._ledger_of().end(keep=status != "complete")
        return digests

    def discard(self) -> None:
        """Take back everything that was made, for a run that failed before its first step."""
        for entry in self._tables.values():
            if entry.file is not None:
                entry.file.abandon()
        if self._root is not None and self._is_open:
            names = [name for table in self._tables for name in _file_names(table)]
            self._ledger_of().end()
            remove_leftovers(self._root)
            for name in (FILE_NAME, f"{FILE_NAME}.partial", *names):
                with suppress(OSError):
                    (self._root / name).unlink()
            remove_directories(self._made)
        self._is_open = False

    @property
    def is_closed(self) -> bool:
        """Whether the run is closed, so that it can be read back."""
        return self._digests is not None

    def _flush(self, entry: TableWriter) -> None:
        """Hash the rows that wait, and write or keep them."""
        rows = entry.buffer.rows
        if not rows:
            return
        with self._writing("the journal"):
            entry.log(self._ledger)
        chunk = entry.buffer.take(reuse=self._root is not None)
        entry.logged = 0
        entry.digest.update(chunk, rows)
        if self._root is None:
            entry.kept.append((chunk, rows))
            return
        name = entry.buffer.spec.name
        with self._writing(f"{name}.parquet", entry):
            entry.file_in(self._root).write(chunk, rows, entry.buffer.words)

    def _ledger_of(self) -> Ledger:
        assert self._ledger is not None, "a run in memory has no ledger"
        return self._ledger

    def _finish_files(self, root: Path) -> None:
        """Make every file whole before any gets its name."""
        for name, entry in self._tables.items():
            with self._writing(f"{name}.parquet", entry):
                entry.file_in(root).finish()
        for name, entry in self._tables.items():
            with self._writing(f"{name}.parquet"):
                entry.file_in(root).publish()
        with self._writing("the directory"):
            sync_directory(root)

    def _check_usable(self) -> None:
        self._check_failure()
        if self._digests is not None:
            raise ArtifactError("the run is closed: nothing more can be stored in it")

    def _check_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    @contextmanager
    def _writing(self, what: str, entry: TableWriter | None = None) -> Iterator[None]:
        """Turn a failed write into the end of the run, marked as failed."""
        try:
            yield
        except OSError as error:
            reason = f"{what} can't be written ({error.strerror or error})"
            advice = "Run again with another --out"
            if is_disk_full(error):
                reason = f"the disk is full: {what} can't be written"
                advice = (
                    f"Free some space and go on by `fleet2d resume {self.directory}`, or store less"
                    " (`artifacts:` in the scenario) and run again with another --out"
                )
            marked = self._mark_failed(reason, entry)
            self._failure = ArtifactError(
                f"{reason}; the run so far is in {self.directory} and "
                f"{'marked as failed' if marked else 'not marked as complete'}. {advice}"
            )
            raise self._failure from error

    def _mark_failed(self, reason: str, entry: TableWriter | None) -> bool:
        """Leave the files partial; return whether the manifest could still say so."""
        for other in self._tables.values():
            if other.file is not None:
                other.file.abandon()
        self._ledger_of().end(keep=True, undo=True)
        self.manifest.status = "failed"
        self.manifest.notes.append(reason)
        return _try_write(self.manifest, self._root) or (
            # The file is lost; what it takes up is enough for a manifest on a full disk.
            entry is not None
            and entry.file is not None
            and entry.file.empty()
            and _try_write(self.manifest, self._root)
        )


def _file_names(table: str) -> tuple[str, str]:
    return f"{table}.parquet", f"{table}.parquet.partial"


def _try_write(manifest: Manifest, root: Path | None) -> bool:
    """Write the manifest of a run that failed; return whether that worked."""
    with suppress(OSError):
        if root is not None:
            manifest.write(root)
            return True
    return False
