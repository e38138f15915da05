"""Logs of detections: one row for each time that a person was in view of a camera."""

import csv
import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fleet2d.bounds import LOG_BYTES, LOG_ROWS, check_file, one_line
from fleet2d.errors import InputError
from fleet2d.kernels import F64, Bool

LEAST_ROWS = 50
MOST_METRES = 100.0  # a larger distance in a home is in another unit
MOST_DEGREES = 360.0
TRUE, FALSE = frozenset({"1", "true", "yes"}), frozenset({"0", "false", "no"})
ANGLES = (
    "bearing",
    "bearing_deg",
    "bearing_rad",
    "orientation",
    "orientation_deg",
    "orientation_rad",
)
COLUMNS = frozenset({"distance", "detected", *ANGLES, "identity", "true_identity"})
UNKNOWN = frozenset({"", "unknown", "none", "null"})


@dataclass(frozen=True)
class DetectionLog:
    """The columns of a log, each an array with an entry per row, (n,); None: not in the log.

    Attributes:
        path: The file of the log.
        distance: Distance from the camera to the person [m].
        detected: Whether the person was noticed.
        bearing: Angle off the optical axis, 0 to 180 [deg].
        orientation: Angle between where the person faces and the camera, 0 to 180 [deg].
        true_identity: The name of the person.
        identity: The name as perceived; empty: not recognized.
    """

    path: Path
    distance: F64
    detected: Bool
    bearing: F64 | None = None
    orientation: F64 | None = None
    true_identity: NDArray[np.str_] | None = None
    identity: NDArray[np.str_] | None = None

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.distance)


def read_log(path: Path) -> DetectionLog:
    """Read a CSV file with a heading line.

    It has the columns `distance` [m] and `detected` (0 or 1); it may have `bearing_deg` or
    `bearing_rad`, `orientation_deg` or `orientation_rad`, and `identity` with `true_identity`.
    Others are ignored.

    Raises:
        InputError: The file can't be read, lacks a column, or has a wrong value; the message names
            the line and the column.
    """
    table = _read_table(path)
    if len(table) < LEAST_ROWS:
        raise InputError(f"{path} has {len(table)} rows: a fit needs at least {LEAST_ROWS}")
    has_identity = table.has("identity") and table.has("true_identity")
    log = DetectionLog(
        path,
        table.column("distance", _distance),
        table.column("detected", _flag).astype(bool),
        table.angle("bearing"),
        table.angle("orientation"),
        table.names("true_identity") if has_identity else None,
        table.names("identity") if has_identity else None,
    )
    if log.true_identity is not None and (log.true_identity == "").any():
        line = table.lines[int(np.argmax(log.true_identity == ""))]
        raise InputError(f"{path}:{line}: true_identity is empty: who it was must be known")
    if log.detected.all() or not log.detected.any():
        every = "all" if log.detected.any() else "none"
        raise InputError(
            f"{path}: {every} of {len(log)} rows are detected: there is nothing to fit. Were the"
            " times in view without a detection logged, too?"
        )
    return log


def recognized(log: DetectionLog) -> Bool:
    """Return for each detection of a log with identities whether the person was recognized."""
    assert log.identity is not None
    assert log.true_identity is not None
    return np.equal(log.true_identity, log.identity)[log.detected]


def _read_table(path: Path) -> "_LogTable":
    try:
        check_file(path, LOG_BYTES)
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            columns = [name.strip() for name in next(reader, [])]
            _check_columns(path, columns)
            table = _LogTable(path, columns)
            for row in islice(filter(None, reader), LOG_ROWS.most + 1):
                table.add(reader.line_num, row)
        LOG_ROWS.check(len(table), path, least="at least ")
    except UnicodeDecodeError:
        raise InputError(f"{path} is not text in UTF-8: save it as a CSV file in UTF-8") from None
    except (OSError, csv.Error) as error:
        why = getattr(error, "strerror", None) or error
        raise InputError(f"{path} can't be read: {why}") from None
    return table


def _check_columns(path: Path, columns: list[str]) -> None:
    """Refuse a heading line that lacks a column, or names one twice."""
    for name in columns:
        if columns.count(name) > 1:
            raise InputError(f"{path} names the column {one_line(name)!r} twice: name each once")
    for required in ("distance", "detected"):
        if required not in columns:
            has_other_marks = any(mark in name for name in columns for mark in ";\t")
            known = one_line(", ".join(columns), 200) or "none"
            raise InputError(
                f"{path} has no column {required!r}; it has: {known}. Wanted are"
                " distance [m] and detected (0 or 1), and if known bearing_deg,"
                " orientation_deg, identity, true_identity"
                f"{', with commas between' * has_other_marks}"
            )


class _LogTable:
    """The columns of a file that have a meaning, and which line each row is on."""

    def __init__(self, path: Path, columns: list[str]) -> None:
        self.path = path
        self.lines = array("q")  # a log has millions of rows
        self._cells: dict[str, list[str]] = {name: [] for name in columns if name in COLUMNS}
        self._places = [(columns.index(name), cells) for name, cells in self._cells.items()]

    def __len__(self) -> int:
        return len(self.lines)

    def add(self, line: int, row: list[str]) -> None:
        """Add a row; what it lacks is empty."""
        self.lines.append(line)
        for place, cells in self._places:
            cells.append(row[place].strip() if place < len(row) else "")

    def has(self, column: str) -> bool:
        return column in self._cells

    def column(self, name: str, read: Callable[[str], float]) -> F64:
        """Return a column of numbers."""
        values = np.empty(len(self))
        for i, text in enumerate(self._cells[name]):
            try:
                values[i] = read(text)
            except ValueError as error:
                raise InputError(
                    f"{self.path}:{self.lines[i]}: {name}: expected {error}, got {one_line(text)!r}"
                ) from None
        return values

    def names(self, name: str) -> NDArray[np.str_]:
        """Return a column of names of people; empty for unknown people."""
        texts = self._cells[name]
        return np.array(["" if text.lower() in UNKNOWN else text for text in texts])

    def angle(self, name: str) -> F64 | None:
        """Return the size of an angle, 0 to 180 [deg], from the column with its unit in the name.

        Raises:
            InputError: There is only a column without a unit.
        """
        for unit, factor in (("deg", 1.0), ("rad", 180 / math.pi)):
            if self.has(f"{name}_{unit}"):
                degrees = (
                    self.column(f"{name}_{unit}", _angle_up_to(MOST_DEGREES / factor)) * factor
                )
                return np.abs((degrees + 180) % 360 - 180)
        if self.has(name):
            raise InputError(
                f"{self.path}: the unit of the column {name!r} is unknown: call it {name}_deg or"
                f" {name}_rad"
            )
        return None


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError("a number")
    return value


def _distance(text: str) -> float:
    value = _number(text)
    if not 0 <= value <= MOST_METRES:
        raise ValueError(f"a distance from 0 to {MOST_METRES:g} m")
    return value


def _angle_up_to(most: float) -> Callable[[str], float]:
    """Return a function that reads an angle from -`most` to `most`."""

    def read(text: str) -> float:
        value = _number(text)
        if abs(value) > most + 1e-3:
            raise ValueError(f"an angle from -{most:.4g} to {most:.4g}")
        return value

    return read


def _flag(text: str) -> float:
    if text.lower() not in TRUE | FALSE:
        raise ValueError("0 or 1")
    return float(text.lower() in TRUE)
