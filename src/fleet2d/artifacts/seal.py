"""The seal of a run: one digest of all that it stored, and the comparison with it.

A seal is not a signature: after a change anybody can seal the run again, with another digest. Keep
the digest elsewhere to notice that, too.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fleet2d.artifacts.digest import changed_tables, digest_of_file, run_digest, sha256_of
from fleet2d.artifacts.manifest import (
    FILE_NAME,
    FileRecord,
    Manifest,
    Seal,
    is_regular,
    json_of,
)
from fleet2d.artifacts.plain import canonical
from fleet2d.artifacts.unfinished import FOLDER, LOCK_NAME
from fleet2d.bounds import FILE_BYTES, read_bytes
from fleet2d.errors import ArtifactError, RunDirectoryError

# Files that may be added to a run later.
_PICTURES = frozenset({"picture.png", "picture.svg"})
_LEARNED = "learned"


@dataclass(frozen=True)
class Verification:
    """The result of comparing a run with its seal.

    Attributes:
        differing: How files and fields of the manifest differ from what was stored, by name.
        foreign: Files in the directory that are not part of the run.
        notes: Remarks about what could not be compared.
        digest: The seal's digest; None for a run that has none.
    """

    differing: dict[str, str]
    foreign: list[str]
    notes: list[str] = field(default_factory=list)
    digest: str | None = None

    @property
    def same(self) -> bool:
        """Whether all that could be compared is what was stored."""
        return not self.differing


def make_seal(manifest: Manifest, directory: Path) -> Seal:
    """Return the seal of a run of which all files but the manifest are written.

    Raises:
        OSError: A file can't be read.
    """
    paths = {path.name: path for path in directory.iterdir() if path.suffix == ".parquet"}
    paths = {name: path for name, path in paths.items() if path.stem in manifest.tables}
    learned = directory / _LEARNED
    if learned.is_dir():
        paths |= {f"{_LEARNED}/{path.name}": path for path in learned.glob("*.npz")}
    plan = directory / "floorplan.json"
    if plan.exists():
        paths[plan.name] = plan
    files = {name: _file_record(path) for name, path in sorted(paths.items())}
    fields = digest_fields(manifest.content())
    return Seal(digest=_digest_of(fields, files), fields=fields, files=files)


def verify_run(directory: Path | str) -> Verification:
    """Compare a stored run with its seal, without running or unpacking anything.

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
    if manifest.seal is None:
        return _without_seal(root, manifest)
    try:
        text = read_bytes(root / FILE_NAME, FILE_BYTES, RunDirectoryError)
        differing = _differing_fields(root, text, manifest.seal)
        for name, record in manifest.seal.files.items():
            if difference := _difference(root / name, record):
                differing[name] = difference
        differing |= _unsealed_tables(manifest)
        foreign = foreign_files(root, manifest.seal.files.keys() | {FILE_NAME})
    except OSError as error:
        raise ArtifactError(f"{root} can't be read: {error.strerror or error}") from error
    return Verification(differing, foreign, digest=manifest.seal.digest)


def foreign_files(root: Path, run_files: set[str]) -> list[str]:
    """Return the files of a run directory that are not part of the run.

    Raises:
        OSError: The directory can't be read.
    """
    names = {path.name for path in root.iterdir()}
    learned = root / _LEARNED
    if learned.is_dir() and not learned.is_symlink():
        names |= {f"{_LEARNED}/{path.name}" for path in learned.iterdir()}
        names.discard(_LEARNED)
    return sorted(names - run_files - _PICTURES - {FOLDER, LOCK_NAME})


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
    return {
        name: sha256_of(value, ordered=name.startswith("scenario")) for name, value in parts.items()
    }


def _differing_fields(root: Path, text: bytes, seal: Seal) -> dict[str, str]:
    """Return the fields of a manifest that are not as they were sealed."""
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


def _unsealed_tables(manifest: Manifest) -> dict[str, str]:
    """Return the tables that the manifest names and the seal doesn't cover."""
    assert manifest.seal is not None
    files = manifest.seal.files
    return {
        f"{name}.parquet": "is not covered by the seal"
        for name in manifest.tables
        if f"{name}.parquet" not in files
    }


def _without_seal(root: Path, manifest: Manifest) -> Verification:
    """Compare the tables of a run of format 1 with their digests, the only ones that it has."""
    digests = {name: table.digest or "" for name, table in manifest.tables.items()}
    tables = changed_tables(digests, lambda name: digest_of_file(root / f"{name}.parquet"))
    differing = {f"{name}.parquet": "was changed" for name in tables}
    if run_digest(digests) != manifest.digest:
        differing[FILE_NAME] = "was changed"
    run_files = {f"{name}.parquet" for name in manifest.tables} | {FILE_NAME, "floorplan.json"}
    learned = {f"{_LEARNED}/{name}.npz" for name in manifest.scenario.get("algorithms", {})}
    notes = [
        f"{root} has no seal (format {manifest.format}): the content of its tables was compared,"
        " not its metrics, floor plan, learned state and the rest of the manifest"
    ]
    return Verification(differing, foreign_files(root, run_files | learned), notes)


def _difference(path: Path, record: FileRecord) -> str:
    """Return how a file differs from what was sealed; empty if it doesn't."""
    try:
        if path.is_symlink() or not is_regular(path):
            return "is not a file any more"
        if path.stat().st_size != record.bytes:
            return f"has {path.stat().st_size} bytes, {record.bytes} were stored"
        return "" if _file_record(path) == record else "was changed"
    except FileNotFoundError:
        return "is missing"


def _file_record(path: Path) -> FileRecord:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        return FileRecord(bytes=file.tell(), sha256=digest)


def _digest_of(fields: Mapping[str, str], files: Mapping[str, FileRecord]) -> str:
    return sha256_of([dict(fields), {name: record.model_dump() for name, record in files.items()}])
