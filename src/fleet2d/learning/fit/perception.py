"""Perception fitted to a log of detections: estimates, goodness of fit, scenario section."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from fleet2d.bounds import LOG_ROWS, one_line
from fleet2d.errors import InputError
from fleet2d.kernels import F64, I64, Bool
from fleet2d.learning.fit.likelihood import (
    Constant,
    Factor,
    Falling,
    Fit,
    Orientation,
    ParameterEstimate,
    ProductLikelihood,
    wilson,
)
from fleet2d.logs.tables import LogTable
from fleet2d.runtime.determinism import sum_in_order

MIN_ROWS = 50
MAX_METRES = 100.0  # a larger distance in a home is in another unit
MAX_DEGREES = 360.0
FLAGS = {"1": 1.0, "true": 1.0, "yes": 1.0, "0": 0.0, "false": 0.0, "no": 0.0}
COLUMNS = (
    "distance", "detected", "identity", "true_identity", "bearing", "bearing_deg", "bearing_rad",
    "orientation", "orientation_deg", "orientation_rad",
)  # fmt: skip
UNKNOWN = frozenset({"", "unknown", "none", "null"})
GROUPS = 10
SIGNIFICANCE = 0.05  # the largest p value of a likelihood ratio test with which a factor is used
MIN_IDENTIFIED = 20  # minimum number of detections with an identity to fit recognition to
# The number of rows of a curve by distance.
MAX_ROWS = 60


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


def read_detections(path: Path) -> DetectionLog:
    """Read a table: CSV, Parquet or JSON Lines.

    It has the columns `distance` [m] and `detected` (0 or 1); it may have `bearing_deg` or
    `bearing_rad`, `orientation_deg` or `orientation_rad`, and `identity` with `true_identity`.
    Other columns are ignored.

    Raises:
        InputError: The file can't be read, lacks a column, or has a wrong value; the message names
            the line and the column.
    """
    table = LogTable.read(path, None, {name: (name,) for name in COLUMNS}, ("distance", "detected"))
    LOG_ROWS.check(len(table.line), path)
    if len(table.line) < MIN_ROWS:
        raise InputError(f"{path} has {len(table.line)} rows: a fit needs at least {MIN_ROWS}")
    has_identity = {"identity", "true_identity"} <= table.named.keys()
    log = DetectionLog(
        path,
        _numbers(table, "distance", 0, MAX_METRES, f"a distance from 0 to {MAX_METRES:g} m"),
        _detected(table),
        _angle(table, "bearing"),
        _angle(table, "orientation"),
        _names(table, "true_identity") if has_identity else None,
        _names(table, "identity") if has_identity else None,
    )
    if log.true_identity is not None and (log.true_identity == "").any():
        line = table.line[int(np.argmax(log.true_identity == ""))]
        raise InputError(f"{path}, line {line}: true_identity is empty: who it was must be known")
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


def _numbers(table: LogTable, name: str, low: float, high: float, expected: str) -> F64:
    """Return a column of numbers from a range."""
    values = table.numbers(name)
    _refuse(table, name, ~((values >= low) & (values <= high)), expected)
    return values


def _detected(table: LogTable) -> Bool:
    """Return whether the person of each row was noticed."""
    texts = table.texts("detected").to_pylist()
    values = np.array([FLAGS.get((text or "").lower(), math.nan) for text in texts])
    _refuse(table, "detected", np.isnan(values), "0 or 1")
    return values > 0


def _refuse(table: LogTable, name: str, wrong: Bool, expected: str) -> None:
    """Refuse the first wrong value of a column."""
    for row in np.flatnonzero(wrong)[:1].tolist():
        text = one_line(str(table.column(name)[row].as_py()))
        raise InputError(
            f"{table.path}, line {table.line[row]}: {name}: expected {expected}, got {text!r}"
        )


def _names(table: LogTable, name: str) -> NDArray[np.str_]:
    """Return a column of names of people; empty for unknown people."""
    texts = [text or "" for text in table.texts(name).to_pylist()]
    return np.array(["" if text.lower() in UNKNOWN else text for text in texts])


def _angle(table: LogTable, name: str) -> F64 | None:
    """Return the size of an angle, 0 to 180 [deg], from the column with its unit in the name.

    Raises:
        InputError: There is only a column without a unit.
    """
    for unit, factor in (("deg", 1.0), ("rad", 180 / math.pi)):
        if (column := f"{name}_{unit}") in table.named:
            most = MAX_DEGREES / factor
            expected = f"an angle from -{most:.4g} to {most:.4g}"
            degrees = _numbers(table, column, -most - 1e-3, most + 1e-3, expected) * factor
            return np.abs((degrees + 180) % 360 - 180)
    if name in table.named:
        raise InputError(
            f"{table.path}: the unit of the column {name!r} is unknown: call it {name}_deg or"
            f" {name}_rad"
        )
    return None


class ProbabilityGroup(NamedTuple):
    """Rows of similar predicted probability.

    Attributes:
        rows: The number of rows.
        predicted: Their mean predicted probability.
        observed: The share of them that was observed.
    """

    rows: int
    predicted: float
    observed: ParameterEstimate


@dataclass(frozen=True)
class FittedProbability:
    """A fitted model of one probability.

    Attributes:
        estimates: The parameters, by name; `top` is the probability where nothing lowers it.
        fit: The fit.
        omitted: Factors without an effect in the log, and the reason for each.
        groups: Predicted and observed probabilities.
    """

    estimates: dict[str, ParameterEstimate]
    fit: Fit
    omitted: dict[str, str]
    groups: list[ProbabilityGroup]

    @property
    def chi_square(self) -> float:
        """The statistic of Hosmer and Lemeshow: the distance of observed from predicted numbers."""
        return sum_in_order(
            group.rows * (group.observed.value - group.predicted) ** 2
            / max(group.predicted * (1 - group.predicted), 1e-12)
            for group in self.groups
        )  # fmt: skip

    @property
    def p_value(self) -> float:
        """The probability of such a statistic or a larger one, if the model is true."""
        return float(chi2.sf(self.chi_square, max(1, len(self.groups) - 2)))


class Recognition(NamedTuple):
    """The fitted recognition of users.

    Attributes:
        right: The probability of being recognized, by distance.
        mistaken: The share of detections without recognition that have another user's name.
        confusion: For each user, the shares of the names in such mistakes.
    """

    right: FittedProbability
    mistaken: ParameterEstimate
    confusion: dict[str, dict[str, float]]


@dataclass(frozen=True)
class Calibration:
    """A perception that was fitted to a log.

    Attributes:
        log: The log.
        detection: The probability of being noticed.
        identity: The recognition of users; None if the log doesn't show it.
        notes: Remarks for the report.
    """

    log: DetectionLog
    detection: FittedProbability
    identity: Recognition | None
    notes: list[str] = field(default_factory=list)

    def section(self) -> dict[str, Any]:
        """Return the `perception` section of a scenario.

        The section holds the whole probability of detection: set the camera's `detection` to 1.
        """
        estimates = self.detection.estimates
        detection: dict[str, Any] = {"distance": _curve(estimates, "distance")}
        if "bearing midpoint" in estimates:
            detection["bearing"] = _curve(estimates, "bearing", top=1.0)
        if "side" in estimates:
            side = estimates["side"].value
            back = estimates["back"].value
            detection["orientation"] = [[0, 1], [90, _short(side)], [180, _short(back)]]
        section: dict[str, Any] = {"detection": detection}
        if self.identity:
            section["identity"] = self._identity(self.identity)
        return section

    def _identity(self, recognition: Recognition) -> dict[str, Any]:
        """Return the section as tables of the same distances, whose sum is nowhere above 1."""
        estimates = recognition.right.estimates
        farthest = float(self.log.distance.max())
        # Dense enough for straight lines between rows to be within 0.3 % of the logistic curve.
        width = estimates["distance width"].value if "distance width" in estimates else farthest
        rows = min(MAX_ROWS, 2 + int(2 * farthest / width))
        right = []
        mistaken = []
        for place in map(_short, np.linspace(0, farthest, rows).tolist()):
            share = round(_probability_at(estimates, place), 4)
            right.append([place, share])
            taken_for_others = recognition.mistaken.value * (1 - share)
            mistaken.append([place, int(taken_for_others * 10_000) / 10_000])  # rounded down
        confusion = {}
        for user, others in recognition.confusion.items():
            confusion[user] = {name: share for name, share in others.items() if share}
        return {"right": right, "mistaken": mistaken, "confusion": confusion}


def calibrate(log: DetectionLog) -> Calibration:
    """Fit a perception to a log."""
    rows = len(log)
    candidates: dict[str, Factor] = {"distance": Falling("distance", log.distance)}
    if log.bearing is not None:
        candidates["bearing"] = Falling("bearing", log.bearing)
    if log.orientation is not None:
        candidates["orientation"] = Orientation(log.orientation)
    detection = fit_probability(log.detected, Constant("top", rows), candidates)
    notes: list[str] = []
    identity = _fit_identity(log, notes)
    return Calibration(log, detection, identity, notes)


def fit_probability(
    outcomes: Bool, top: Constant, candidates: dict[str, Factor]
) -> FittedProbability:
    """Fit the product of a constant and of those factors that improve the fit significantly."""
    factors = dict(candidates)
    omitted = {}
    best = ProductLikelihood([top, *factors.values()], outcomes).fit()
    for name, factor in candidates.items():
        others = [other for key, other in factors.items() if key != name]
        reduced = ProductLikelihood([top, *others], outcomes).fit()
        p_value = float(chi2.sf(reduced.deviance - best.deviance, len(factor.names)))
        if p_value > SIGNIFICANCE:
            omitted[name] = f"the log shows no effect of it (p = {p_value:.2g})"
            del factors[name]
            best = reduced
    likelihood = ProductLikelihood([top, *factors.values()], outcomes)
    groups = group_rows(best.shares, outcomes)
    return FittedProbability(likelihood.estimates(best), best, omitted, groups)


def group_rows(shares: F64, outcomes: Bool) -> list[ProbabilityGroup]:
    """Return groups of equal size of the rows, sorted by their predicted probability."""
    parts: Sequence[I64] = np.array_split(np.argsort(shares, kind="stable"), GROUPS)
    groups = []
    for part in parts:
        if len(part):
            observed = wilson(int(outcomes[part].sum()), len(part))
            groups.append(ProbabilityGroup(len(part), float(shares[part].mean()), observed))
    return groups


def _fit_identity(log: DetectionLog, notes: list[str]) -> Recognition | None:
    """Fit the recognition of users if the log has identities; else add a note."""
    if log.identity is None or log.true_identity is None:
        return None
    true = log.true_identity[log.detected]
    perceived = log.identity[log.detected]
    right = recognized(log)
    if len(true) < MIN_IDENTIFIED or right.all() or not right.any():
        notes.append(
            f"identity: left out: {int(right.sum())} of {len(true)} detections are recognized,"
            " too few or too uniform to fit anything to"
        )
        return None
    distance = log.distance[log.detected]
    factors: dict[str, Factor] = {"distance": Falling("distance", distance)}
    fitted = fit_probability(right, Constant("top", len(right)), factors)
    wrong = ~right
    mistaken = wrong & (perceived != "")
    confusion: dict[str, dict[str, float]] = {}
    for user in sorted(set(true.tolist())):
        names, counts = np.unique(perceived[mistaken & (true == user)], return_counts=True)
        if len(names):
            confusion[user] = _shares(dict(zip(names.tolist(), counts.tolist(), strict=True)))
    if confusion:
        notes.append(
            f"identity: the confusion has the names of the log, {', '.join(sorted(set(true)))}:"
            " give them to the scenario's users, or remove the confusion"
        )
    return Recognition(fitted, wilson(int(mistaken.sum()), int(wrong.sum())), confusion)


def _shares(counts: dict[str, int]) -> dict[str, float]:
    """Return counts as shares of four decimals that add up to 1."""
    total = sum(counts.values())
    shares = {name: round(count / total, 4) for name, count in counts.items()}
    most = max(shares, key=lambda name: shares[name])
    others = [share for name, share in shares.items() if name != most]
    shares[most] = round(1 - sum_in_order(others), 4)
    return shares


def _probability_at(estimates: dict[str, ParameterEstimate], distance: float) -> float:
    """Return the probability at a distance."""
    top = estimates["top"].value
    if "distance midpoint" not in estimates:
        return top
    midpoint = estimates["distance midpoint"].value
    width = estimates["distance width"].value
    scaled = np.clip((distance - midpoint) / width, -700, 700)
    return float(top / (1 + np.exp(scaled)))


def _curve(estimates: dict[str, ParameterEstimate], name: str, top: float | None = None) -> Any:
    """Return a fitted curve in the form of a scenario: a number, or midpoint, width and top."""
    height = estimates["top"].value if top is None else top
    if f"{name} midpoint" not in estimates:
        return _short(height)
    curve = {part: _short(estimates[f"{name} {part}"].value) for part in ("midpoint", "width")}
    return curve if height == 1 else {**curve, "top": _short(height)}


def _short(value: float) -> float:
    """Return a number rounded to four significant digits."""
    return float(f"{value:.4g}")
