"""The files of an unfinished run beside its tables: the lock, the journal, the checkpoint."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from fleet2d.artifacts.files import PARTIAL, replacing, sync_directory
from fleet2d.artifacts.journal import (
    FOLDER,
    JOURNAL_NAME,
    Commit,
    JournalWriter,
    LoggedRows,
    read_journal,
)
from fleet2d.artifacts.lock import RunLock

CHECKPOINT_NAME = "checkpoint"
# How often the journal is flushed to the disk [s]: so much is lost in a power cut, at most. A crash
# of the process loses none of it.
SYNC_S = 5.0


class Ledger:
    """The folder `unfinished` of a run directory, and the right to write there.

    Attributes:
        folder: The path of that folder.
        journal: All rows so far; set by `begin` and `resume`.
    """

    journal: JournalWriter

    def __init__(self, directory: Path) -> None:
        """Create no file yet: `begin` and `resume` do."""
        self.directory, self.folder = directory, directory / FOLDER
        self._lock: RunLock | None = None
        self._has_journal = False
        self._synced = time.monotonic()

    @property
    def checkpoint(self) -> Path:
        """The path of the last checkpoint, if there is one."""
        return self.folder / CHECKPOINT_NAME

    def lock(self) -> None:
        """Acquire the right to write.

        Raises:
            RunDirectoryError: Another process has it.
            OSError: The lock file can't be created.
        """
        self._lock = self._lock or RunLock(self.directory)

    def begin(self) -> None:
        """Lock the directory and begin a new journal, which replaces an old one.

        Raises:
            RunDirectoryError: Another process is writing there.
            OSError: They can't be written.
        """
        self.lock()
        self.folder.mkdir(exist_ok=True)
        for name in (JOURNAL_NAME, CHECKPOINT_NAME):
            (self.folder / name).unlink(missing_ok=True)
        self._set_journal(JournalWriter(self.folder / JOURNAL_NAME))

    def resume(self, commit: Commit | None) -> Iterator[LoggedRows]:
        """Truncate the journal after a commit, and yield the rows before it.

        Raises:
            ArtifactError: The journal is damaged.
            OSError: It can't be written.
        """
        if commit is None:
            self.begin()
            return
        path = self.folder / JOURNAL_NAME
        self._set_journal(JournalWriter(path, commit.end))
        for entry in read_journal(path, commit.end):
            self.journal.replay(entry)
            yield entry

    def commit(self, step: int, *, sync: bool = False) -> Commit:
        """Commit all rows so far.

        Args:
            step: The step before which they are.
            sync: Whether to flush the journal to the disk now.

        Raises:
            OSError: They can't be written.
        """
        commit = self.journal.commit(step)
        now = time.monotonic()
        if sync or now - self._synced > SYNC_S:
            self.journal.sync()
            self._synced = now
        return commit

    def keep_checkpoint(self, write: Callable[[int], None]) -> None:
        """Replace the checkpoint atomically; the rows that it refers to must be synced before.

        Args:
            write: Writes the checkpoint to the handle of an open file.

        Raises:
            OSError: It can't be written; the checkpoint before it is unchanged.
        """
        with replacing(self.checkpoint) as handle:
            write(handle)
        sync_directory(self.folder)

    def end(self, *, keep: bool = False, undo: bool = False) -> None:
        """Close the journal and release the run directory.

        Args:
            keep: Whether the run can be resumed later; else the folder is removed.
            undo: Whether to remove what was written since the last commit, as after a failed write.
        """
        if self._has_journal:
            self.journal.close(undo=undo)
        if not keep and self._lock is not None:
            remove_leftovers(self.directory)
        self.release()

    def release(self) -> None:
        """Release the right to write, if it is held."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    def _set_journal(self, journal: JournalWriter) -> None:
        self.journal, self._has_journal = journal, True


def remove_leftovers(directory: Path) -> None:
    """Remove the files that a complete run no longer needs, and no others."""
    folder = directory / FOLDER
    for name in (JOURNAL_NAME, CHECKPOINT_NAME, f"{CHECKPOINT_NAME}{PARTIAL}"):
        with suppress(OSError):
            (folder / name).unlink()
    with suppress(OSError):
        folder.rmdir()


def columns_of(entry: LoggedRows) -> dict[str, object]:
    """Return the rows of a journal's entry as columns that `RunStore.append` takes."""
    from fleet2d.artifacts.arrow import table_of

    table = table_of([(entry.chunk, entry.rows)], entry.spec, entry.words)
    columns: dict[str, object] = {}
    for column in entry.spec.columns:
        values, valid, _ = entry.chunk[column.name]
        if column.takes_strings:
            columns[column.name] = table[column.name].to_pylist()
        else:
            columns[column.name] = values if valid is None else np.ma.MaskedArray(values, ~valid)
    return columns
