"""Digests of the content of tables, the seal over all that a run stored, and checks of both."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.artifacts.manifest import (
    FILE_NAME,
    FLOORPLAN_NAME,
    LEARNED_NAME,
    FileRecord,
    Manifest,
    Seal,
    TableRecord,
    canonical,
    json_of,
    table_record,
)
from fleet2d.artifacts.table import Chunk, TableSpec, Words, new_dictionaries
from fleet2d.artifacts.unfinished import CHECKPOINT_NAME, FOLDER, JOURNAL_NAME
from fleet2d.bounds import FILE_BYTES, read_bytes
from fleet2d.errors import ArtifactError, RunDirectoryError, os_errors_as, printable
from fleet2d.storage.files import path_in

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
        self._hashes = {name: [hashlib.sha256() for _ in range(3)] for name in spec.names}

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
            words: The dictionaries of the columns whose dictionary grows.
        """
        columns = []
        for column in self.spec.columns:
            names = words[column.name].in_order() if column.is_growing else column.categories
            hashes = [hasher.hexdigest() for hasher in self._hashes[column.name]]
            digest = sha256_of([hashes, list(names)])
            columns.append((column.name, column.kind, column.nullable, digest))
        return sha256_of([self.spec.name, self.rows, columns])


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
    """Return what a manifest says of a stored table, from its file.

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


# Files that may be added to a run later.
_PICTURES = frozenset({"picture.png", "picture.svg"})


@dataclass(frozen=True)
class Verification:
    """The result of comparing a run with its seal.

    Attributes:
        differing: How files and fields of the manifest differ from what was stored, by name.
        foreign: Files in the directory that are not part of the run.
        digest: The seal's digest; None if the run has no seal.
    """

    differing: dict[str, str]
    foreign: list[str]
    digest: str | None

    @property
    def same(self) -> bool:
        """Whether everything equals what was stored."""
        return not self.differing


def make_seal(manifest: Manifest, directory: Path) -> Seal:
    """Return the seal of a run of which all files but the manifest are written.

    Raises:
        OSError: A file can't be read.
    """
    names = {FLOORPLAN_NAME, *(f"{name}.parquet" for name in manifest.tables)}
    names |= {f"{LEARNED_NAME}/{path.name}" for path in (directory / LEARNED_NAME).glob("*.npz")}
    paths = {name: directory / name for name in sorted(names)}
    files = {name: _file_record(path) for name, path in paths.items() if path.exists()}
    fields = digest_fields(manifest.content())
    return Seal(digest=_digest_of(fields, files), fields=fields, files=files)


def verify_run(directory: Path | str) -> Verification:
    """Compare a stored run with its seal, and its tables with the manifest; nothing is run.

    Raises:
        RunDirectoryError: There is no run, or its manifest is not valid.
        ArtifactError: The run has no digest: it was never closed.

    Example:
        >>> import fleet2d, tempfile
        >>> folder = tempfile.mkdtemp()
        >>> run = fleet2d.run(None, "simulation.duration=1 h", seed=4, out=f"{folder}/run")
        >>> verify_run(f"{folder}/run").same
        True
    """
    root = Path(directory)
    if not root.is_dir():
        raise RunDirectoryError(
            f"{root} is not a directory: give one that `fleet2d run --out` wrote"
        )
    manifest = Manifest.read(root)
    if manifest.digest is None:
        raise ArtifactError(
            f"{root} has no digest, because its status is {manifest.status}: there is nothing to"
            " compare with; `fleet2d resume` continues the run"
        )
    with os_errors_as(ArtifactError, f"{root} can't be read"):
        differing = _differing_parts(root, manifest)
        for name, table in manifest.tables.items():
            file = f"{name}.parquet"
            entry = f"{FILE_NAME}: tables.{name}"
            if not differing.keys() & {file, entry} and not _has_content(root, name, table):
                differing[file] = "doesn't hold what the manifest says of it"
        digests = {name: table.digest or "" for name, table in manifest.tables.items()}
        if run_digest(digests) != manifest.digest:
            differing.setdefault(f"{FILE_NAME}: digest", "is not that of the tables")
        foreign = foreign_files(root, manifest)
    digest = None if manifest.seal is None else manifest.seal.digest
    return Verification(differing, foreign, digest)


def foreign_files(root: Path, manifest: Manifest) -> list[str]:
    """Return what is in a run directory and is not part of the run, as text for a terminal.

    Raises:
        OSError: The directory can't be read.
    """
    own = {FILE_NAME, FLOORPLAN_NAME, *(f"{name}.parquet" for name in manifest.tables)}
    own |= {f"{LEARNED_NAME}/{name}.npz" for name in manifest.scenario.get("algorithms", {})}
    if manifest.seal is not None:
        own = {FILE_NAME, *manifest.seal.files}
    if manifest.status != "complete":
        own |= {f"{FOLDER}/{JOURNAL_NAME}", f"{FOLDER}/{CHECKPOINT_NAME}"}
    names = set()
    for path in root.iterdir():
        is_link = path.is_symlink()
        if path.name in (LEARNED_NAME, FOLDER) and path.is_dir() and not is_link:
            names |= {f"{path.name}/{inner.name}" for inner in path.iterdir()}
        elif not (path.name in _PICTURES and path.is_file() and not is_link):
            names.add(path.name)
    return sorted(map(printable, names - own))


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
    # The order of the keys of a scenario has an effect on the run.
    return {n: sha256_of(part, ordered=n.startswith("scenario")) for n, part in parts.items()}


def _differing_parts(root: Path, manifest: Manifest) -> dict[str, str]:
    """Return how files and fields differ from their seal."""
    if manifest.seal is None:
        return {f"{FILE_NAME}: seal": "is missing"}
    differing = _differing_fields(root, manifest.seal)
    for name, record in manifest.seal.files.items():
        if difference := _difference(root, name, record):
            differing[name] = difference
    for name in manifest.tables:
        if f"{name}.parquet" not in manifest.seal.files:
            differing[f"{name}.parquet"] = "is not covered by the seal"
    return differing


def _differing_fields(root: Path, seal: Seal) -> dict[str, str]:
    """Return the fields of the manifest that are not as they were sealed."""
    text = read_bytes(path_in(root, FILE_NAME), FILE_BYTES, RunDirectoryError)
    content = json_of(root / FILE_NAME, text)
    fields = digest_fields(content)
    differing = {}
    for name in sorted(fields.keys() | seal.fields.keys()):
        if name not in fields:
            differing[f"{FILE_NAME}: {name}"] = "was removed"
        elif name not in seal.fields:
            differing[f"{FILE_NAME}: {name}"] = "was added"
        elif fields[name] != seal.fields[name]:
            differing[f"{FILE_NAME}: {name}"] = "was changed"
    if _digest_of(seal.fields, seal.files) != seal.digest:
        differing[f"{FILE_NAME}: seal"] = "was changed"
    elif not differing and text != canonical(content).encode():
        differing[FILE_NAME] = "is formatted differently"
    return differing


def _has_content(root: Path, name: str, stored: TableRecord) -> bool:
    """Whether the rows of a table's file have the digest, number and columns in the manifest."""
    try:
        record = record_of_file(path_in(root, f"{name}.parquet"))
    except (ArtifactError, RunDirectoryError):
        return False
    return record == stored


def _difference(root: Path, name: str, record: FileRecord) -> str:
    """Return how a file differs from what was sealed; empty if it doesn't."""
    try:
        path = path_in(root, name)
        size = path.stat().st_size
        if not path.is_file():
            return "is not a file any more"
        if size != record.bytes:
            return f"has {size} bytes, {record.bytes} were stored"
        return "" if _file_record(path) == record else "was changed"
    except RunDirectoryError:
        return "is not a file any more"
    except FileNotFoundError:
        return "is missing"


def _file_record(path: Path) -> FileRecord:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        return FileRecord(bytes=file.tell(), sha256=digest)


def _digest_of(fields: Mapping[str, str], files: Mapping[str, FileRecord]) -> str:
    return sha256_of([dict(fields), {name: record.model_dump() for name, record in files.items()}])
