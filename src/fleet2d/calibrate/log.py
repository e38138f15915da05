"""Logs of detections: one row for each time that somebody was in a camera's view."""

import csv
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fleet2d.bounds import LOG_BYTES, LOG_ROWS, check_file, one_line
from fleet2d.errors import InputError

F64 = NDArray[np.float64]

LEAST_ROWS = 50
MOST_METRES = 100.0  # farther away in a home means another unit
MOST_DEGREES = 360.0
TRUE, FALSE = frozenset({"1", "true", "yes"}), frozenset({"0", "false", "no"})
UNKNOWN = frozenset({"", "unknown", "none", "null"})


@dataclass(frozen=True)
class DetectionLog:
    """What a log tells; every array has an entry for each row.

    Attributes:
        path: Its file.
        distance: From the camera to the person [m].
        detected: Whether the person was noticed.
        bearing: Angle off the optical axis, either side [deg]; None if the log doesn't tell.
        orientation: Angle between where the person faced and the camera, 0 to 180 [deg].
        true_identity: Who it was.
        identity: For whom the person was taken; empty: for nobody known.
    """

    path: Path
    distance: F64
    detected: NDArray[np.bool_]
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
        InputError: The file can't be read, lacks a column, or holds something else than it should:
            which line and column, what was found, what is wanted.
    """
    try:
        check_file(path, LOG_BYTES)
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            columns = [name.strip() for name in reader.fieldnames or ()]
            reader.fieldnames = columns
            rows = [(reader.line_num, row) for row in islice(reader, LOG_ROWS.most + 1)]
        LOG_ROWS.check(len(rows), path, least="at least ")
    except UnicodeDecodeError:
        raise InputError(f"{path} is no text in UTF-8: save it as a CSV file in UTF-8") from None
    except (OSError, csv.Error) as error:
        why = getattr(error, "strerror", None) or error
        raise InputError(f"{path} can't be read: {why}") from None
    _check_columns(path, columns)
    table = _Table(path, columns, rows)
    if len(rows) < LEAST_ROWS:
        raise InputError(f"{path} has {len(rows)} rows: a fit needs {LEAST_ROWS} at the least")
    who = table.has("identity") and table.has("true_identity")
    log = DetectionLog(
        path,
        table.column("distance", _distance),
        table.column("detected", _flag).astype(bool),
        table.angle("bearing"),
        table.angle("orientation"),
        table.words("true_identity") if who else None,
        table.words("identity") if who else None,
    )
    if log.true_identity is not None and (log.true_identity == "").any():
        line = rows[int(np.argmax(log.true_identity == ""))][0]
        raise InputError(f"{path}:{line}: true_identity is empty: who it was must be known")
    if log.detected.all() or not log.detected.any():
        every = "all" if log.detected.any() else "none"
        raise InputError(
            f"{path}: {every} of {len(log)} rows are detected: there is nothing to fit. Were the"
            " times in view without a detection logged, too?"
        )
    return log


def recognized(log: DetectionLog) -> NDArray[np.bool_]:
    """Return for each detection of a log with identities whether it was of the right person."""
    assert log.identity is not None
    assert log.true_identity is not None
    right: NDArray[np.bool_] = np.equal(log.true_identity, log.identity)[log.detected]
    return right


def _check_columns(path: Path, columns: list[str]) -> None:
    """Refuse a heading line that lacks a column, or names one twice."""
    for name in columns:
        if columns.count(name) > 1:
            raise InputError(f"{path} names the column {one_line(name)!r} twice: name each once")
    for wanted in ("distance", "detected"):
        if wanted not in columns:
            apart = any(mark in name for name in columns for mark in ";\t")
            known = one_line(", ".join(columns), 200) or "none"
            raise InputError(
                f"{path} has no column {wanted!r}; it has: {known}. Wanted are"
                " distance [m] and detected (0 or 1), and if known bearing_deg,"
                f" orientation_deg, identity, true_identity{', with commas between' * apart}"
            )


class _Table:
    """The rows of a file, and which line each is on."""

    def __init__(
        self, path: Path, columns: list[str], rows: list[tuple[int, dict[str, str]]]
    ) -> None:
        self.path, self.columns, self.rows = path, columns, rows

    def has(self, column: str) -> bool:
        return column in self.columns

    def column(self, name: str, read: Callable[[str], float]) -> F64:
        """Return a column of numbers."""
        values = np.empty(len(self.rows))
        for i, (line, row) in enumerate(self.rows):
            text = _cell(row, name)
            try:
                values[i] = read(text)
            except ValueError as error:
                raise InputError(
                    f"{self.path}:{line}: {name} is {one_line(text)!r}; {error} is wanted"
                ) from None
        return values

    def words(self, name: str) -> NDArray[np.str_]:
        """Return a column of names; empty where nobody is named."""
        texts = [_cell(row, name) for _, row in self.rows]
        return np.array(["" if text.lower() in UNKNOWN else text for text in texts])

    def angle(self, name: str) -> F64 | None:
        """Return the size of an angle in degrees, 0 to 180, from the column that tells its unit."""
        for unit, factor in (("deg", 1.0), ("rad", 180 / math.pi)):
            if self.has(f"{name}_{unit}"):
                turned = self.column(f"{name}_{unit}", _within(MOST_DEGREES / factor)) * factor
                size: F64 = np.abs((turned + 180) % 360 - 180)
                return size
        if self.has(name):
            raise InputError(
                f"{self.path}: the column {name!r} doesn't tell its unit: call it {name}_deg or"
                f" {name}_rad"
            )
        return None


def _cell(row: Mapping[str, str | None], name: str) -> str:
    return (row.get(name) or "").strip()


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


def _within(most: float) -> Callable[[str], float]:
    """Return what reads an angle of at most so much to either side."""

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
