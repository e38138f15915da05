"""Content digests: what a table holds, whatever its chunks, compression and file bytes are."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts.chunk import Chunk, ColumnChunk, Dictionary, new_dictionaries
from fleet2d.artifacts.manifest import TableRecord, table_record
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.errors import ArtifactError

if TYPE_CHECKING:
    import pyarrow as pa


class TableDigest:
    """SHA-256 of a table's content, computed chunk by chunk.

    Values, validity and string lengths of a column have a hash each, so the digest doesn't depend
    on where one chunk ends and the next begins.
    """

    def __init__(self, spec: TableSpec) -> None:
        """Start with no rows."""
        self.spec = spec
        self.rows = 0
        self._columns = [_ColumnDigest(column) for column in spec.columns]

    def update(self, chunk: Chunk, rows: int) -> None:
        """Add the next `rows` rows."""
        for column in self._columns:
            column.update(chunk[column.name])
        self.rows += rows

    def hexdigest(self, words: Mapping[str, Dictionary] | None = None) -> str:
        """Return the digest of all rows so far.

        Args:
            words: The dictionaries of the columns whose dictionary grows.
        """
        columns = [
            (
                column.name,
                column.kind,
                column.nullable,
                digest.hexdigest(
                    words[column.name].in_order()
                    if words and column.is_growing
                    else column.categories
                ),
            )
            for column, digest in zip(self.spec.columns, self._columns, strict=True)
        ]
        return sha256_of([self.spec.name, self.rows, columns])


class _ColumnDigest:
    """The hashes of one column: its values, their validity, and the lengths of strings."""

    def __init__(self, column: Column) -> None:
        self.name = column.name
        self._hashes = [hashlib.sha256() for _ in range(3)]

    def update(self, chunk: ColumnChunk) -> None:
        for hasher, values in zip(self._hashes, chunk, strict=True):
            if values is not None and len(values):
                hasher.update(_little_endian(values))

    def hexdigest(self, categories: Sequence[str]) -> str:
        return sha256_of([[hasher.hexdigest() for hasher in self._hashes], list(categories)])


def run_digest(tables: Mapping[str, str]) -> str:
    """Return the digest of a run from the digests of its tables.

    Example:
        >>> run_digest({"a": "1", "b": "2"}) == run_digest({"b": "2", "a": "1"})
        True
    """
    return sha256_of(sorted(tables.items()))


def digest_table(table: pa.Table, spec: TableSpec | None = None) -> str:
    """Return the digest of a table in memory.

    Args:
        table: A table as read back from a run.
        spec: What the table should be; None: what its schema says.

    Raises:
        ArtifactError: The table's columns are not those of the spec.
    """
    return digest_tables([table], spec)


def digest_tables(parts: Iterable[pa.Table], spec: TableSpec | None = None) -> str:
    """Return the digest of a table that comes in parts, in the order of its rows."""
    return _digest_parts(parts, spec)[1]


def _digest_parts(
    parts: Iterable[pa.Table], spec: TableSpec | None = None
) -> tuple[TableDigest, str]:
    from fleet2d.artifacts.arrow import chunks_of, spec_of

    digest: TableDigest | None = None
    words: dict[str, Dictionary] = {}
    for part in parts:
        if digest is None:
            spec = spec or spec_of(part.schema)
            digest = TableDigest(spec)
            words = new_dictionaries(spec)
        for chunk, rows in chunks_of(part, digest.spec, words):
            digest.update(chunk, rows)
    if digest is None:
        raise ValueError("a table needs at least one part, even if it has no rows")
    return digest, digest.hexdigest(words)


def digest_of_file(path: Path) -> str | None:
    """Return the digest of a stored table, None if it can't be read."""
    try:
        return record_of_file(path).digest
    except ArtifactError:
        return None


def record_of_file(path: Path) -> TableRecord:
    """Return what a manifest says of a stored table, from its file.

    Raises:
        ArtifactError: The file can't be read.
    """
    from fleet2d.artifacts.arrow import read_row_groups

    digest, text = _digest_parts(read_row_groups(path))
    return table_record(digest.spec, digest.rows, text)


def changed_tables(digests: Mapping[str, str], digest_of: Callable[[str], str | None]) -> list[str]:
    """Return the names of the tables whose digest is not the stored one.

    Args:
        digests: The stored digests by name.
        digest_of: Returns the present digest of a table.
    """
    return [name for name, digest in digests.items() if digest_of(name) != digest]


def _little_endian(values: NDArray[Any]) -> memoryview:
    values = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
    return values.view(np.uint8).data


def sha256_of(content: Any, *, ordered: bool = False) -> str:
    """Return the SHA-256 of plain JSON data; the order of its keys counts only if `ordered`."""
    text = json.dumps(content, sort_keys=not ordered, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
