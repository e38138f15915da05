"""Perception fitted to a log of detections: the model, how well it fits, and its scenario."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.calibrate.factors import Constant, Falling, Turned
from fleet2d.calibrate.likelihood import (
    Estimate,
    Factor,
    Fit,
    Likelihood,
    chi_square_tail,
    wilson,
)
from fleet2d.calibrate.log import DetectionLog, recognized

GROUPS = 10
WORTH = 0.05  # a factor is kept if chance alone would improve the fit so much less often than this
LEAST_KNOWN = 20  # detections with an identity that are needed to fit it
MOST_ROWS = 60  # of a curve by distance


@dataclass(frozen=True)
class Group:
    """Rows of about the same predicted probability, and what was observed."""

    rows: int
    predicted: float
    observed: Estimate


@dataclass(frozen=True)
class Curves:
    """A fitted probability.

    Attributes:
        estimates: Its parameters, by name; `top` is the probability where nothing lowers it.
        fit: The fit.
        left_out: Factors that the log says nothing of, and why.
        groups: What was observed beside what is predicted.
    """

    estimates: dict[str, Estimate]
    fit: Fit
    left_out: dict[str, str]
    groups: list[Group]

    @property
    def chi_square(self) -> float:
        """How far observed and predicted are apart (Hosmer and Lemeshow)."""
        return sum(
            group.rows * (group.observed.value - group.predicted) ** 2
            / max(group.predicted * (1 - group.predicted), 1e-12)
            for group in self.groups
        )  # fmt: skip

    @property
    def p_value(self) -> float:
        """How often chance alone puts a true model that far apart."""
        return chi_square_tail(self.chi_square, max(1, len(self.groups) - 2))


@dataclass(frozen=True)
class WhoIsWho:
    """How users are recognized.

    Attributes:
        right: The probability to be recognized, by distance.
        mistaken: Share of those not recognized who are taken for another user.
        confusion: For whom, as shares of each user's mistakes.
    """

    right: Curves
    mistaken: Estimate
    confusion: dict[str, dict[str, float]]


@dataclass(frozen=True)
class Calibration:
    """All that a log tells of a perception."""

    log: DetectionLog
    detection: Curves
    identity: WhoIsWho | None
    notes: list[str] = field(default_factory=list)

    def section(self) -> dict[str, Any]:
        """Return the `perception` section of a scenario; the camera's `detection` is 1 then."""
        found = self.detection.estimates
        detection: dict[str, Any] = {"distance": _curve(found, "distance")}
        if "bearing midpoint" in found:
            detection["bearing"] = _curve(found, "bearing", top=1.0)
        if "side" in found:
            side, back = found["side"].value, found["back"].value
            detection["orientation"] = [[0, 1], [90, _short(side)], [180, _short(back)]]
        section: dict[str, Any] = {"detection": detection}
        if self.identity:
            section["identity"] = self._identity(self.identity)
        return section

    def _identity(self, who: WhoIsWho) -> dict[str, Any]:
        """Return the section as tables of the same distances, whose sum is nowhere above 1."""
        estimates, farthest = who.right.estimates, float(self.log.distance.max())
        # So dense that straight lines between rows stay within 0.3 % of the logistic.
        width = estimates["distance width"].value if "distance width" in estimates else farthest
        rows = min(MOST_ROWS, 2 + int(2 * farthest / width))
        places = [_short(x) for x in np.linspace(0, farthest, rows).tolist()]
        shares = [round(_at(estimates, x), 4) for x in places]
        right = [[x, share] for x, share in zip(places, shares, strict=True)]
        mistaken = [  # rounded down
            [x, int(who.mistaken.value * (1 - share) * 10_000) / 10_000]
            for x, share in zip(places, shares, strict=True)
        ]
        confusion = {
            user: {name: share for name, share in others.items() if share}
            for user, others in who.confusion.items()
        }
        return {"right": right, "mistaken": mistaken, "confusion": confusion}


def calibrate(log: DetectionLog) -> Calibration:
    """Fit a perception to a log."""
    rows = len(log)
    wanted: dict[str, Factor] = {"distance": Falling("distance", log.distance)}
    if log.bearing is not None:
        wanted["bearing"] = Falling("bearing", log.bearing)
    if log.orientation is not None:
        wanted["orientation"] = Turned(log.orientation)
    detection = fit_curves(log.detected, Constant("top", rows), wanted)
    notes: list[str] = []
    identity = _fit_identity(log, notes)
    return Calibration(log, detection, identity, notes)


def fit_curves(outcomes: NDArray[np.bool_], top: Constant, wanted: dict[str, Factor]) -> Curves:
    """Fit a constant and those factors that the outcomes speak for, each tried without the rest."""
    kept = dict(wanted)
    left_out = {}
    best = Likelihood([top, *kept.values()], outcomes).fit()
    for name, factor in wanted.items():
        others = [other for key, other in kept.items() if key != name]
        without = Likelihood([top, *others], outcomes).fit()
        lost = without.deviance - best.deviance
        p_value = chi_square_tail(lost, len(factor.names))
        if p_value > WORTH:
            left_out[name] = f"the log shows no effect of it (p = {p_value:.2g})"
            del kept[name]
            best = without
    likelihood = Likelihood([top, *kept.values()], outcomes)
    return Curves(likelihood.estimates(best), best, left_out, group(best.shares, outcomes))


def group(shares: NDArray[np.float64], outcomes: NDArray[np.bool_]) -> list[Group]:
    """Sort rows by their probability into groups of one size, and count."""
    parts: Sequence[NDArray[np.int64]] = np.array_split(np.argsort(shares, kind="stable"), GROUPS)
    return [
        Group(len(part), float(shares[part].mean()), wilson(int(outcomes[part].sum()), len(part)))
        for part in parts
        if len(part)
    ]


def _fit_identity(log: DetectionLog, notes: list[str]) -> WhoIsWho | None:
    if log.identity is None or log.true_identity is None:
        return None
    true, found = log.true_identity[log.detected], log.identity[log.detected]
    right = recognized(log)
    if len(true) < LEAST_KNOWN or right.all() or not right.any():
        notes.append(
            f"identity: left out: {int(right.sum())} of {len(true)} detections are recognized,"
            " which tells nothing of when"
        )
        return None
    distance = log.distance[log.detected]
    curves = fit_curves(
        right, Constant("top", len(right)), {"distance": Falling("distance", distance)}
    )
    wrong = ~right
    mistaken = wrong & (found != "")
    confusion: dict[str, dict[str, float]] = {}
    for user in sorted(set(true.tolist())):
        names, counts = np.unique(found[mistaken & (true == user)], return_counts=True)
        if len(names):
            confusion[user] = _whole(dict(zip(names.tolist(), counts.tolist(), strict=True)))
    if confusion:
        notes.append(
            f"identity: the confusion is of the log's people, {', '.join(sorted(set(true)))}: name"
            " the scenario's users so, or take it out"
        )
    return WhoIsWho(curves, wilson(int(mistaken.sum()), int(wrong.sum())), confusion)


def _whole(counts: dict[str, int]) -> dict[str, float]:
    """Return counts as shares of four decimals that add up to 1."""
    total = sum(counts.values())
    shares = {name: round(count / total, 4) for name, count in counts.items()}
    most = max(shares, key=lambda name: shares[name])
    shares[most] = round(1 - sum(v for name, v in shares.items() if name != most), 4)
    return shares


def _at(estimates: dict[str, Estimate], distance: float) -> float:
    """Return the probability at a distance."""
    top = estimates["top"].value
    if "distance midpoint" not in estimates:
        return top
    midpoint, width = (estimates[f"distance {name}"].value for name in ("midpoint", "width"))
    share: float = top / (1 + np.exp(np.clip((distance - midpoint) / width, -700, 700)))
    return float(share)


def _curve(estimates: dict[str, Estimate], name: str, top: float | None = None) -> Any:
    height = estimates["top"].value if top is None else top
    if f"{name} midpoint" not in estimates:
        return _short(height)
    found = {part: _short(estimates[f"{name} {part}"].value) for part in ("midpoint", "width")}
    return found if height == 1 else {**found, "top": _short(height)}


def _short(value: float) -> float:
    """Return a number with the digits that a fit can tell."""
    return float(f"{value:.4g}")
