"""The manifest of a run: scenario, versions, inputs and results, as a model of strict JSON."""

from __future__ import annotations

import datetime as dt
import json
import math
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from fleet2d.artifacts.table import Kind, TableSpec
from fleet2d.bounds import FILE_BYTES, read_bytes, unique_keys
from fleet2d.configuration.problems import did_you_mean
from fleet2d.configuration.units import parse_duration
from fleet2d.errors import RunDirectoryError, printable
from fleet2d.inputs import sha256_of_file
from fleet2d.runtime.local_time import Zone
from fleet2d.sight.camera import DEFAULT_ANGLE_DEG, DEFAULT_RANGE_M
from fleet2d.storage.files import path_in, write_atomically


def plain(value: Any) -> Any:
    """Convert a value to plain JSON data: NaN and infinity become null.

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


def canonical(content: Mapping[str, Any]) -> str:
    """Return the canonical text of a manifest's content, with sorted keys.

    Only the keys within sections of the scenario keep their order, since it matters: users, for
    example, decide in the order in which they are listed.
    """
    ordered = _sorted({key: value for key, value in content.items() if key != "scenario"})
    if "scenario" in content:
        ordered["scenario"] = dict(sorted(content["scenario"].items()))
    return json.dumps(dict(sorted(ordered.items())), indent=2, allow_nan=False) + "\n"


def _sorted(value: Any) -> Any:
    """Return plain data with all keys sorted."""
    if isinstance(value, Mapping):
        return {key: _sorted(value[key]) for key in sorted(value)}
    return [_sorted(entry) for entry in value] if isinstance(value, list) else value


def read_json(text: bytes) -> Any:
    """Return the content of a JSON text.

    Raises:
        ValueError: The text is not JSON, or is nested too deeply.

    Example:
        >>> read_json(b'{"steps": 3}')
        {'steps': 3}
        >>> read_json(b'{"steps": 3, "steps": 4}')
        Traceback (most recent call last):
        ValueError: the key 'steps' is given twice in an object
    """
    try:
        return json.loads(
            text.decode(),
            object_pairs_hook=unique_keys,
            parse_constant=_refuse_constant,
            parse_float=_finite_float,
        )
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def _refuse_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number")


def _finite_float(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:60]} is too large a number")
    return number


def versions() -> dict[str, str]:
    """Return the versions of all software that the numbers of a run may depend on."""
    packages = {name: _version(name) for name in ("fleet2d", "numpy", "pyarrow", "shapely")}
    machine = os.uname().machine if hasattr(os, "uname") else "unknown"
    python = ".".join(map(str, sys.version_info[:3]))
    return {**packages, "python": python, "platform": f"{sys.platform} {machine}"}


@cache
def _version(package: str) -> str:
    # Searching the installed packages takes longer than simulating a day.
    version = getattr(sys.modules.get(package), "__version__", None)
    if isinstance(version, str):
        return version
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"


# The longest range of a camera, far beyond any home [m].
_FARTHEST_M = 1000.0


def _check_range(distances: list[float]) -> list[float]:
    near, far = distances
    if not 0 <= near < far <= _FARTHEST_M:
        raise ValueError("it should be two distances, the nearest first")
    return distances


def _check_duration(text: str) -> str:
    parse_duration(text)
    return text


Count = Annotated[int, Field(ge=0, lt=2**62)]
_Pair = Annotated[list[float], Field(min_length=2, max_length=2)]


class _StoredPart(BaseModel):
    """A part of which some keys are checked; others are left as they are."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False, defer_build=True)


class _StoredTyped(_StoredPart):
    type: str = ""


class _StoredPan(_StoredPart):
    headings_deg: list[float] = []
    dwell: Annotated[str, AfterValidator(_check_duration)] = ""


class _StoredCamera(_StoredPart):
    range: Annotated[_Pair, AfterValidator(_check_range)] = list(DEFAULT_RANGE_M)
    angle_deg: Annotated[float, Field(gt=0, le=360)] = DEFAULT_ANGLE_DEG
    offset: _Pair = [0.0, 0.0]
    heading_deg: float = 0.0
    pan: _StoredPan | None = None


class _StoredBody(_StoredPart):
    radius: Annotated[float, Field(gt=0, le=2)] = 0.2
    camera: _StoredCamera | None = None
    cameras: dict[str, _StoredCamera] | None = None
    behaviors: list[_StoredTyped] = []


class _StoredScenario(_StoredPart):
    name: str | None = None
    simulation: dict[str, Any] = {}
    floorplan: dict[str, Any] = {}
    users: dict[str, _StoredBody] = {}
    robots: dict[str, _StoredBody] = {}
    objects: dict[str, _StoredTyped] = {}
    algorithms: dict[str, _StoredTyped] = {}
    metrics: dict[str, _StoredTyped] = {}


class _StoredIntervention(_StoredPart):
    step: Count = 0
    by: str = ""


class _StoredVerdict(_StoredPart):
    expectation: str
    first: Count
    holds: bool | None = True  # None: the expectation was never tested
    decided: bool = True


class ManifestParts(_StoredPart):
    """The parts of a manifest that readers rely on.

    Example:
        >>> camera = {"range": [2, 1]}
        >>> ManifestParts.model_validate({"scenario": {"robots": {"astro": {"camera": camera}}}})
        Traceback (most recent call last):
        pydantic_core._pydantic_core.ValidationError: 1 validation error for ManifestParts
        scenario.robots.astro.camera.range
          Value error, it should be two distances, the nearest first ...
    """

    scenario: _StoredScenario = _StoredScenario()
    interventions: list[_StoredIntervention] = []
    expectations: dict[str, _StoredVerdict] = {}


def start_of(manifest: Mapping[str, Any]) -> dt.datetime:
    """Return the start of a run, by the clock of its home."""
    start = dt.datetime.fromisoformat(manifest["start"])
    record = manifest["scenario"].get("simulation", {}).get("time_zone")
    return Zone.of_record(record).at(start) if record else start


def time_problem(manifest: Mapping[str, Any]) -> str:
    """Explain why the steps of a run have no times; empty if they have.

    Example:
        >>> start = "9999-12-31T00:00:00"
        >>> time_problem({"start": start, "step_us": 1_000_000, "steps": 10**6, "scenario": {}})
        '1000000 steps from 9999-12-31T00:00:00 end after the year 9999'
    """
    start, step_us, steps = (manifest[name] for name in ("start", "step_us", "steps"))
    has_zone = bool(manifest["scenario"].get("simulation", {}).get("time_zone"))
    if not step_us:
        return "step_us is 0"
    if not start:
        return "start is empty"
    if (dt.datetime.fromisoformat(start).tzinfo is not None) != has_zone:
        expected = "with its offset" if has_zone else "without a time zone"
        return f"start: it should be a local time, {expected}, and is {start}"
    try:
        _ = start_of(manifest) + dt.timedelta(microseconds=steps * step_us)
    except OverflowError:
        return f"{steps} steps from {start} end after the year 9999"
    except (AttributeError, KeyError, TypeError, ValueError):
        return f"scenario.simulation.time_zone does not fit the start, {start}"
    return ""


FORMAT = 2
"""Version of the layout of run directories; a reader refuses others."""

FILE_NAME = "manifest.json"
FLOORPLAN_NAME = "floorplan.json"
"""The floor plan in a run directory, in Fleet2D's own format."""
LEARNED_NAME = "learned"


def learned_files(root: Path) -> set[str]:
    """Return the files with learned states in a run directory, by their paths in it."""
    return {f"{LEARNED_NAME}/{path.name}" for path in (root / LEARNED_NAME).glob("*.npz")}


"""The folder in a run directory of what algorithms have learned."""

# A message lists at most this many problems of a manifest.
_MAX_PROBLEMS = 5
# A message quotes at most this many characters of a wrong value.
_MAX_CHARACTERS = 60

SLOW = "simulation.speedup is"
"""Beginning of the note that a run was slower than its speedup."""

Status = Literal["running", "complete", "interrupted", "failed"]


# Marks a field of the manifest that differs between repetitions of a run.
VARIES = "varies"


def _check_time(text: str) -> str:
    """Refuse text that is not a time."""
    if text:
        dt.datetime.fromisoformat(text)
    return text


Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
# The name of a table is that of its file, and must not lead out of the directory.
TableName = Annotated[str, Field(pattern=r"^\w[\w.\-]*$")]
FileName = Annotated[str, Field(pattern=r"^(learned/)?\w[\w.\-]*$")]


class Record(BaseModel):
    """A part of a manifest: plain values of the right type, and no others."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class ColumnRecord(Record):
    """A column of a table."""

    name: str
    kind: Kind
    unit: str = ""


class TableRecord(Record):
    """A table: its rows, the digest of its content, and its columns in order."""

    rows: Count
    digest: Sha256 | None = None
    columns: list[ColumnRecord] = []


def table_record(spec: TableSpec, rows: int, digest: str) -> TableRecord:
    """Return the record of a table with the columns of its spec."""
    columns = [
        ColumnRecord(name=column.name, kind=column.kind, unit=column.unit)
        for column in spec.columns
    ]
    return TableRecord(rows=rows, digest=digest, columns=columns)


class InputRecord(Record):
    """A file that the run read."""

    path: str
    sha256: Sha256


class FileRecord(Record):
    """The size and the digest of a file of the run directory."""

    bytes: Count
    sha256: Sha256


class Entities(Record):
    """Names of the people and robots in the home."""

    users: list[str] = []
    robots: list[str] = []


class Seal(Record):
    """Digests of a whole run; see `fleet2d.artifacts.seal`.

    Attributes:
        digest: SHA-256 of `fields` and `files`.
        fields: SHA-256 of each field of the manifest, or of each part of it.
        files: Size and digest of each file of the run directory besides the manifest.
    """

    digest: Sha256
    fields: dict[str, Sha256]
    files: dict[FileName, FileRecord]


class Manifest(BaseModel):
    """The content of `manifest.json`.

    A field is declared below, with the mark `VARIES` if it differs between repetitions of a run;
    the simulation sets it before the first step or after the last one.

    Attributes:
        format: Version of the layout of the run directory.
        status: `running` until the run is closed; a crash leaves it so.
        scenario: The resolved configuration.
        seed: The seed of the scenario, or the one that was drawn.
        steps: Number of steps simulated.
        step_us: Length of a step [us].
        start: Simulated start, ISO 8601; with its offset if the home has a time zone.
        simulated_s: Simulated time [s].
        entities: Names of the users and robots.
        versions: Versions of the software that ran it; see `versions`.
        inputs: Path and SHA-256 of every file that was read.
        tables: Rows, digest and columns (name, kind, unit) of each table, by name.
        digest: Digest of all tables; None until the run is closed.
        wall_s: Wall time by phase [s].
        metrics: Summary of the metrics.
        notes: Remarks for the user.
        interventions: All interventions from outside, in order.
        expectations: The verdict on each expectation, by name; see `Verdict.content`.
        resumed: The steps at which it was resumed after it had ended early.
        seal: Digests of the whole run; None until the run is closed.

    Example:
        >>> Manifest(seed=4).seed
        4
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    format: Annotated[int, Field(ge=FORMAT, le=FORMAT)] = FORMAT
    status: Status = "running"
    scenario: dict[str, Any] = {}
    seed: Annotated[int, Field(ge=0, lt=2**63)] | None = None
    steps: Count = 0
    step_us: Count = 0
    start: Annotated[str, AfterValidator(_check_time)] = ""
    simulated_s: Annotated[float, Field(ge=0)] = 0.0
    entities: Entities = Entities()
    versions: Annotated[dict[str, str], VARIES] = {}
    inputs: Annotated[list[InputRecord], VARIES] = []
    tables: dict[TableName, TableRecord] = {}
    digest: Sha256 | None = None
    wall_s: Annotated[dict[str, Annotated[float, Field(ge=0)]], VARIES] = {}
    metrics: dict[str, Any] = {}
    notes: list[str] = []
    interventions: list[dict[str, Any]] = []
    expectations: dict[str, dict[str, Any]] = {}
    resumed: Annotated[list[Count], VARIES] = []
    seal: Seal | None = None

    def add_inputs(self, paths: Iterable[Path]) -> bool:
        """Add files that were read after the run began; return whether any was new."""
        known = {record.path for record in self.inputs}
        new_paths = sorted({path for path in paths if str(path) not in known})
        for path in new_paths:
            with suppress(OSError):  # a file of code may be gone after it ran
                self.inputs.append(input_record(path))
        return bool(new_paths)

    @classmethod
    def varying(cls) -> list[str]:
        """Return the fields that differ between repetitions of a run, marked by `VARIES`.

        Example:
            >>> Manifest.varying()
            ['inputs', 'resumed', 'versions', 'wall_s']
        """
        fields = cls.model_fields.items()
        return sorted(name for name, field in fields if VARIES in field.metadata)

    def content(self) -> dict[str, Any]:
        """Return the manifest as plain JSON data."""
        return plain(self.model_dump())

    def to_json(self) -> str:
        """Return the text of the file: sorted keys, no NaN."""
        return canonical(self.content())

    def write(self, directory: Path) -> int:
        """Replace the manifest of a run directory atomically; return its size [bytes].

        Raises:
            OSError: The directory can't be written.
        """
        text = self.to_json().encode()
        write_atomically(directory / FILE_NAME, text)
        return len(text)

    @classmethod
    def read(cls, directory: Path) -> Manifest:
        """Read the manifest of a run directory.

        Raises:
            RunDirectoryError: There is no manifest, or it is not valid; the message lists its
                problems.
        """
        path = path_in(directory, FILE_NAME)
        try:
            content = json_of(path, read_bytes(path, FILE_BYTES, RunDirectoryError))
        except FileNotFoundError as error:
            raise RunDirectoryError(
                f"{directory} is not a run directory, because it has no {FILE_NAME}: "
                "give the directory that `fleet2d run --out` wrote"
            ) from error
        except OSError as error:
            raise RunDirectoryError(f"{path} can't be read: {error.strerror}") from error
        return cls.of_content(path, content)

    @classmethod
    def of_content(cls, path: Path, content: Any) -> Manifest:
        """Return a manifest from the content of its file.

        Args:
            path: The file, for messages.
            content: Plain JSON data.

        Raises:
            RunDirectoryError: The content is not valid; the message lists its problems.
        """
        if not isinstance(content, dict) or type(content.get("format")) is not int:
            raise _damaged(path, "it has no key 'format'")
        if content["format"] > FORMAT:
            raise RunDirectoryError(
                f"{path} was written by a later Fleet2D (format {content['format']}, this one "
                f"reads {FORMAT}): update Fleet2D"
            )
        if missing := sorted(cls.model_fields.keys() - content.keys()):
            raise _damaged(path, f"it lacks {', '.join(missing)}")
        try:
            manifest = cls.model_validate(content)
            ManifestParts.model_validate(content)
        except ValidationError as error:
            raise _damaged(path, problems_of(error)) from None
        # Tables that no simulation wrote have no scenario, and no times.
        reason = time_problem(content)
        if manifest.scenario and reason:
            raise _damaged(path, reason)
        return manifest


def json_of(path: Path, text: bytes) -> Any:
    """Return the text of a manifest as plain JSON data.

    Raises:
        RunDirectoryError: The text is not JSON.
    """
    try:
        return read_json(text)
    except ValueError as error:
        raise _damaged(path, str(error)) from error


def problems_of(error: ValidationError) -> str:
    """Return a message with the wrong fields and the problem of each."""
    lines = []
    for line in error.errors(include_url=False)[:_MAX_PROBLEMS]:
        key = printable(".".join(map(str, line["loc"])))
        if line["type"] == "extra_forbidden":
            known = Manifest.model_fields if len(line["loc"]) == 1 else ()
            lines.append(f"{key} is not a field of a manifest{did_you_mean(key, known)}"[:200])
            continue
        value = repr(line["input"])
        value = value if len(value) <= _MAX_CHARACTERS else f"{value[:_MAX_CHARACTERS]}…"
        lines.append(f"{key}: {line['msg']}, got {value}"[:300])
    more = error.error_count() - len(lines)
    if more > 0:
        lines.append(f"and {more} more")
    return "; ".join(lines).replace(".;", ";")


def _damaged(path: Path, reason: str) -> RunDirectoryError:
    return RunDirectoryError(
        f"{path} is damaged ({reason.rstrip('.')}): copy the run again from where it was whole, "
        "or run the scenario again"
    )


def input_record(path: Path | str) -> InputRecord:
    """Return the record of an input file.

    Raises:
        OSError: The file can't be read.
    """
    return InputRecord(path=str(path), sha256=sha256_of_file(path))
