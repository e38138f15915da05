"""The manifest of a run: what was run, with what, and what came out."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fleet2d.errors import RunDirectoryError

FORMAT = 1
"""Version of the run directory's layout; a reader refuses a later one."""

FILE_NAME = "manifest.json"

Status = Literal["running", "complete", "interrupted", "failed"]


@dataclass
class Manifest:
    """What `manifest.json` holds.

    Attributes:
        format: Version of the layout of the run directory.
        status: `running` until the run is closed; a crash leaves it so.
        scenario: The resolved configuration.
        seed: The seed that was given or drawn.
        steps: Number of steps simulated.
        step_us: Length of a step [us].
        start: Simulated start, ISO 8601.
        simulated_s: Simulated time [s].
        entities: Names of what lives in the home, by bucket.
        versions: What ran it; see `versions`.
        inputs: Every file that was read, as `file_record` describes it.
        tables: Per table its rows, digest and columns (name, kind, unit).
        digest: Digest of all tables; None until the run is closed.
        wall_s: Wall time by phase [s].
        metrics: Summary of the metrics.
        notes: Remarks in plain words.
        interventions: What was done to the run from outside, in order.
    """

    format: int = FORMAT
    status: Status = "running"
    scenario: dict[str, Any] = field(default_factory=dict)
    seed: int | None = None
    steps: int = 0
    step_us: int = 0
    start: str = ""
    simulated_s: float = 0.0
    entities: Any = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    inputs: list[dict[str, str]] = field(default_factory=list)
    tables: dict[str, dict[str, Any]] = field(default_factory=dict)
    digest: str | None = None
    wall_s: dict[str, float] = field(default_factory=dict)
    metrics: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    interventions: list[dict[str, Any]] = field(default_factory=list)

    def to_json(self) -> str:
        """Return the text of the file: sorted keys, no NaN."""
        return json.dumps(plain(asdict(self)), indent=2, sort_keys=True, allow_nan=False) + "\n"

    def write(self, directory: Path) -> None:
        """Replace the manifest of a run directory at one stroke.

        Raises:
            OSError: The directory can't be written.
        """
        partial = directory / f"{FILE_NAME}.partial"
        with partial.open("w", encoding="utf-8") as file:
            file.write(self.to_json())
            file.flush()
            os.fsync(file.fileno())
        partial.replace(directory / FILE_NAME)

    @classmethod
    def read(cls, directory: Path) -> Manifest:
        """Read the manifest of a run directory.

        Raises:
            RunDirectoryError: There is none, or it can't be understood.
        """
        path = directory / FILE_NAME
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError as error:
            raise RunDirectoryError(
                f"{directory} is no run directory, for it has no {FILE_NAME}: "
                "give the directory that `fleet2d run --out` wrote"
            ) from error
        except OSError as error:
            raise RunDirectoryError(f"{path} can't be read: {error.strerror}") from error
        except ValueError as error:
            raise _damaged(path, str(error)) from error
        return cls._from_content(path, content)

    @classmethod
    def _from_content(cls, path: Path, content: Any) -> Manifest:
        if not isinstance(content, dict) or not isinstance(content.get("format"), int):
            raise _damaged(path, "it does not say its format")
        if content["format"] > FORMAT:
            raise RunDirectoryError(
                f"{path} was written by a later Fleet2D (format {content['format']}, this one "
                f"reads up to {FORMAT}): update Fleet2D"
            )
        names = {entry.name for entry in fields(cls)}
        content = {"interventions": [], **content}  # runs before it was a field had none
        missing = sorted(names - content.keys())
        if missing:
            raise _damaged(path, f"it lacks {', '.join(missing)}")
        if not isinstance(content["tables"], dict) or not isinstance(content["notes"], list):
            raise _damaged(path, "its tables or notes are not what they should be")
        return cls(**{name: content[name] for name in names})


def _damaged(path: Path, reason: str) -> RunDirectoryError:
    return RunDirectoryError(
        f"{path} is damaged ({reason}): copy the run again from where it was whole, "
        "or run the scenario again"
    )


def file_record(path: Path | str) -> dict[str, str]:
    """Return `{"path", "sha256"}` of an input file, to be kept in the manifest.

    Raises:
        OSError: The file can't be read.
    """
    with Path(path).open("rb") as file:
        return {"path": str(path), "sha256": hashlib.file_digest(file, "sha256").hexdigest()}


def versions() -> dict[str, str]:
    """Return the versions of what a run's numbers may depend on.

    A package that is loaded is asked itself: searching the installed packages takes longer than
    simulating a day.
    """
    found = {name: _version(name) for name in ("fleet2d", "numpy", "pyarrow", "shapely")}
    machine = os.uname().machine if hasattr(os, "uname") else "unknown"
    python = ".".join(map(str, sys.version_info[:3]))
    return {**found, "python": python, "platform": f"{sys.platform} {machine}"}


def _version(package: str) -> str:
    loaded = getattr(sys.modules.get(package), "__version__", None)
    if isinstance(loaded, str):
        return loaded
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"


def plain(value: Any) -> Any:
    """Turn a value into what JSON has words for: NaN and infinity become null.

    Example:
        >>> plain({"mean": float("nan"), "at": dt.timedelta(hours=1), 3: (1, 2)})
        {'mean': None, 'at': 3600.0, '3': [1, 2]}
    """
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, set | frozenset):
        return sorted(plain(entry) for entry in value)
    if isinstance(value, Sequence):
        return [plain(entry) for entry in value]
    if isinstance(value, dt.timedelta):
        return value.total_seconds()
    if isinstance(value, dt.date | dt.time):
        return value.isoformat()
    return str(value)
