"""One table that is being written: the rows in the buffer, the rows stored, and their digest."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from fleet2d.artifacts.buffer import TableBuffer
from fleet2d.artifacts.chunk import Chunk
from fleet2d.artifacts.digest import TableDigest
from fleet2d.artifacts.manifest import TableRecord, table_record
from fleet2d.artifacts.unfinished import UnfinishedRun

if TYPE_CHECKING:
    from fleet2d.artifacts.arrow import ParquetTable


@dataclass
class TableWriter:
    """A table that is being written.

    Attributes:
        buffer: The newest rows.
        digest: Digest of the rows that left the buffer.
        chunks: Those rows and the number in each chunk, if the run is in memory.
        file: The file with those rows, if the run is in a directory; None before the first.
        logged: How many rows of the buffer are in the journal.
    """

    buffer: TableBuffer
    digest: TableDigest
    chunks: list[tuple[Chunk, int]] = field(default_factory=list)
    file: ParquetTable | None = None
    logged: int = 0

    def hash_again(self) -> None:
        """Compute the digest again from the chunks in memory."""
        self.digest = TableDigest(self.buffer.spec)
        for chunk, rows in self.chunks:
            self.digest.update(chunk, rows)

    def log(self, unfinished: UnfinishedRun | None) -> None:
        """Append the rows of the buffer to the journal that are not in it yet.

        Raises:
            OSError: They can't be written.
        """
        first, buffer = self.logged, self.buffer
        if unfinished is None or first == buffer.rows:
            return
        unfinished.journal.add(buffer.spec, buffer.arrays(first), buffer.rows - first, buffer.words)
        self.logged = buffer.rows

    def file_in(self, root: Path) -> ParquetTable:
        """Return the file of the table; create it if there is none yet."""
        from fleet2d.artifacts.arrow import ParquetTable

        if self.file is None:
            self.file = ParquetTable(root, self.buffer.spec)
        return self.file

    def record(self, digest: str) -> TableRecord:
        """Return the entry of the manifest about the table."""
        return table_record(self.buffer.spec, self.digest.rows, digest)
