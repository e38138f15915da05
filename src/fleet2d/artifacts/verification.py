"""Checks of a stored run against its seal, and of its tables against the manifest."""

from dataclasses import dataclass
from pathlib import Path

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
)
from fleet2d.artifacts.seal import (
    digest_fields,
    file_record,
    record_of_file,
    run_digest,
    seal_digest,
)
from fleet2d.artifacts.unfinished import CHECKPOINT_NAME, FOLDER, JOURNAL_NAME
from fleet2d.bounds import FILE_BYTES, read_bytes
from fleet2d.errors import ArtifactError, RunDirectoryError, os_errors_as, printable
from fleet2d.storage.files import path_in

# Files that may be added to a run later.
_PICTURES = frozenset({"picture.png", "picture.svg"})


@dataclass(frozen=True)
class Verification:
    """The result of comparing a run with its seal.

    Attributes:
        differing: The differences of files and fields of the manifest from the seal, by name.
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
    """Return the entries of a run directory that are not part of the run, as text for a terminal.

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


def _differing_parts(root: Path, manifest: Manifest) -> dict[str, str]:
    """Describe how files and fields differ from the seal, by name."""
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
    """Return the fields of the manifest that differ from the seal."""
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
    if seal_digest(seal.fields, seal.files) != seal.digest:
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
    """Describe how a file differs from its seal; empty if it doesn't."""
    try:
        path = path_in(root, name)
        size = path.stat().st_size
        if not path.is_file():
            return "is not a file any more"
        if size != record.bytes:
            return f"has {size} bytes, {record.bytes} were stored"
        return "" if file_record(path) == record else "was changed"
    except RunDirectoryError:
        return "is not a file any more"
    except FileNotFoundError:
        return "is missing"
