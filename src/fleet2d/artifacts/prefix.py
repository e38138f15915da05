"""The prefix of an unfinished run: the rows of its journal up to the last commit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fleet2d.artifacts.journal import (
    FOLDER,
    JOURNAL_NAME,
    Commit,
    LoggedRows,
    last_commit,
    read_journal,
)
from fleet2d.errors import ArtifactError

if TYPE_CHECKING:
    import pyarrow as pa


class Prefix:
    """The rows of an unfinished run that can be read.

    Attributes:
        commit: The last commit.
        names: Names of the tables, sorted.
    """

    def __init__(self, path: Path, commit: Commit) -> None:
        """Read nothing yet; `find` creates prefixes."""
        self._path, self.commit = path, commit
        self.names = tuple(sorted(commit.rows))

    @classmethod
    def find(cls, directory: Path) -> Prefix | None:
        """Return the prefix in a run directory, if it has one.

        Raises:
            ArtifactError: The journal can't be read.
        """
        path = directory / FOLDER / JOURNAL_NAME
        commit = last_commit(path)
        return None if commit is None else cls(path, commit)

    def read(self, name: str) -> pa.Table:
        """Return a table up to the last commit.

        Raises:
            ArtifactError: The journal is damaged.
        """
        from fleet2d.artifacts.arrow import table_of

        rows = [e for e in read_journal(self._path, self.commit.end) if e.spec.name == name]
        if not rows:
            raise ArtifactError(f"{self._path} names the table {name!r}, but has no rows of it")
        last: LoggedRows = rows[-1]  # its dictionaries hold the words of all
        return table_of([(entry.chunk, entry.rows) for entry in rows], last.spec, last.words)
