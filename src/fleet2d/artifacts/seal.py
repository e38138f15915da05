"""Digests of the content of tables, and the seal over all that a run stored."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.artifacts.manifest import (
    FLOORPLAN_NAME,
    FileRecord,
    Manifest,
    Seal,
    TableRecord,
    learned_files,
    table_record,
)
from fleet2d.artifacts.table import Chunk, TableSpec, Words, new_dictionaries

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
        self._hashes = {name: _new_hashes() for name in spec.names}

    def update(self, chunk: Chunk, rows: int) -> None:
        """Add the next `rows` rows."""
        for name, hashes in self._hashes.items():
            for hasher, values in zip(hashes, chunk[name], strict=True):
                if values is not None and len(values):
                    values = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
                    hasher.update(values.view(np.uint8).data)
        self.rows += rows

    def hexdigest(self, words: Words) -> str:
        """Return the digest of all rows so far.

        Args:
            words: The dictionaries of columns with a growing dictionary.
        """
        columns = []
        for column in self.spec.columns:
            names = words[column.name].in_order() if column.is_growing else column.categories
            hashes = [hasher.hexdigest() for hasher in self._hashes[column.name]]
            digest = sha256_of([hashes, list(names)])
            columns.append((column.name, column.kind, column.nullable, digest))
        return sha256_of([self.spec.name, self.rows, columns])


def _new_hashes() -> tuple[hashlib._Hash, ...]:
    """Return a hash each for values, validity and lengths."""
    return hashlib.sha256(), hashlib.sha256(), hashlib.sha256()


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
        spec: The expected columns; None: those of its schema.

    Raises:
        ArtifactError: The table's columns are not those of the spec.
    """
    from fleet2d.artifacts.arrow import spec_of

    return _digest_parts([table], spec or spec_of(table.schema))[1]


def _digest_parts(parts: Iterable[pa.Table], spec: TableSpec) -> tuple[int, str]:
    """Return the number of rows and the digest of a table that comes in parts."""
    from fleet2d.artifacts.arrow import chunks_of

    digest = TableDigest(spec)
    words = new_dictionaries(spec)
    for part in parts:
        for chunk, rows in chunks_of(part, spec, words):
            digest.update(chunk, rows)
    return digest.rows, digest.hexdigest(words)


def record_of_file(path: Path) -> TableRecord:
    """Return the manifest's record of a stored table, from its file.

    Raises:
        ArtifactError: The file can't be read.
    """
    from fleet2d.artifacts.arrow import read_row_groups, spec_of

    parts = read_row_groups(path)
    spec = spec_of(next(parts).schema)
    return table_record(spec, *_digest_parts(parts, spec))


def sha256_of(content: Any, *, ordered: bool = False) -> str:
    """Return the SHA-256 of plain JSON data; the order of its keys counts only if `ordered`."""
    text = json.dumps(content, sort_keys=not ordered, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def make_seal(manifest: Manifest, directory: Path) -> Seal:
    """Return the seal of a run of which all files but the manifest are written.

    Raises:
        OSError: A file can't be read.
    """
    tables = (f"{name}.parquet" for name in manifest.tables)
    names = {FLOORPLAN_NAME, *tables, *learned_files(directory)}
    paths = {name: directory / name for name in sorted(names)}
    files = {name: file_record(path) for name, path in paths.items() if path.exists()}
    fields = digest_fields(manifest.content())
    return Seal(digest=seal_digest(fields, files), fields=fields, files=files)


def digest_fields(content: Mapping[str, Any]) -> dict[str, str]:
    """Return the SHA-256 of each field of a manifest but the seal; of a mapping, of each entry.

    Example:
        >>> sorted(digest_fields({"seed": 4, "metrics": {"distance": {}, "sightings": {}}}))
        ['metrics.distance', 'metrics.sightings', 'seed']
    """
    parts: dict[str, Any] = {}
    for name, value in content.items():
        if name == "seal":
            continue
        if isinstance(value, Mapping) and value:
            parts |= {f"{name}.{key}": entry for key, entry in value.items()}
        else:
            parts[name] = value
    digests = {}
    for name, part in parts.items():
        # The order of the keys of a scenario has an effect on the run.
        digests[name] = sha256_of(part, ordered=name.startswith("scenario"))
    return digests


def file_record(path: Path) -> FileRecord:
    """Return the size and the SHA-256 of a file."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        return FileRecord(bytes=file.tell(), sha256=digest)


def seal_digest(fields: Mapping[str, str], files: Mapping[str, FileRecord]) -> str:
    """Return the digest of a seal, from those of fields and files."""
    records = {name: record.model_dump() for name, record in files.items()}
    return sha256_of([dict(fields), records])
