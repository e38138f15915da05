"""What an unfinished run keeps beside its tables: the lock, the journal, the checkpoint."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from fleet2d.artifacts.files import PARTIAL, sync_directory, write_atomically
from fleet2d.artifacts.journal import (
    FOLDER,
    JOURNAL_NAME,
    Commit,
    Entry,
    JournalWriter,
    read_journal,
)
from fleet2d.artifacts.lock import RunLock

CHECKPOINT_NAME = "checkpoint"
# The journal is seen onto the disk this often [s]; the system keeps it through a crash anyway.
SYNC_S = 5.0


class Ledger:
    """The folder `unfinished` of a run directory, and the right to write there.

    Attributes:
        folder: Where it is.
        journal: All rows so far; there once the ledger has begun.
    """

    journal: JournalWriter

    def __init__(self, directory: Path) -> None:
        """Touch nothing yet."""
        self.directory, self.folder = directory, directory / FOLDER
        self._lock: RunLock | None = None
        self._has_journal = False
        self._synced = time.monotonic()

    @property
    def checkpoint(self) -> Path:
        """The file of the last checkpoint, if there is one."""
        return self.folder / CHECKPOINT_NAME

    def lock(self) -> None:
        """Take the right to write.

        Raises:
            RunDirectoryError: Another process has it.
            OSError: The lock can't be made.
        """
        self._lock = self._lock or RunLock(self.directory)

    def begin(self) -> None:
        """Lock the directory and begin a journal, in the place of any that is there.

        Raises:
            RunDirectoryError: Another process is writing there.
            OSError: They can't be written.
        """
        self.lock()
        self.folder.mkdir(exist_ok=True)
        for name in (JOURNAL_NAME, CHECKPOINT_NAME):
            (self.folder / name).unlink(missing_ok=True)
        self._set_journal(JournalWriter(self.folder / JOURNAL_NAME))

    def go_on(self, commit: Commit | None) -> Iterator[Entry]:
        """Cut the journal off behind a commit, and yield the rows that stay.

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

        Raises:
            OSError: They can't be written.
        """
        commit = self.journal.commit(step)
        now = time.monotonic()
        if sync or now - self._synced > SYNC_S:
            self.journal.sync()
            self._synced = now
        return commit

    def keep_checkpoint(self, content: bytes) -> None:
        """Replace the checkpoint at one stroke; the rows that it names must be synced before.

        Raises:
            OSError: It can't be written; the one before stands.
        """
        write_atomically(self.checkpoint, content)
        sync_directory(self.folder)

    def end(self, *, keep: bool = False, undo: bool = False) -> None:
        """Let go of the run directory.

        Args:
            keep: Whether the run is to be gone on with; else the folder is removed.
            undo: Whether a write failed, so that what it left is cut off.
        """
        if self._has_journal:
            self.journal.close(undo=undo)
        if not keep and self._lock is not None:
            remove_leftovers(self.directory)
        self.release()

    def release(self) -> None:
        """Give back the right to write."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    def _set_journal(self, journal: JournalWriter) -> None:
        self.journal, self._has_journal = journal, True


def remove_leftovers(directory: Path) -> None:
    """Remove what a complete run no longer needs, and nothing else."""
    folder = directory / FOLDER
    for name in (JOURNAL_NAME, CHECKPOINT_NAME, f"{CHECKPOINT_NAME}{PARTIAL}"):
        with suppress(OSError):
            (folder / name).unlink()
    with suppress(OSError):
        folder.rmdir()


def columns_of(entry: Entry) -> dict[str, object]:
    """Return the rows of a journal in the form in which a store takes them."""
    columns: dict[str, object] = {}
    for column in entry.spec.columns:
        values, valid, lengths = entry.chunk[column.name]
        if lengths is not None:
            ends = np.cumsum(lengths).tolist()
            text = values.tobytes()
            strings = [text[a:b].decode() for a, b in zip([0, *ends[:-1]], ends, strict=True)]
            columns[column.name] = _with_gaps(strings, valid)
        elif column.is_growing:
            words = entry.words[column.name].listed()
            columns[column.name] = _with_gaps(
                [words[code] for code in values.tolist()] if words else [""] * entry.rows, valid
            )
        elif valid is None:
            columns[column.name] = values
        else:
            columns[column.name] = np.ma.MaskedArray(values, ~valid)
    return columns


def _with_gaps(strings: list[str], valid: object) -> list[str | None]:
    if not isinstance(valid, np.ndarray):
        return list(strings)
    return [string if there else None for string, there in zip(strings, valid, strict=True)]
