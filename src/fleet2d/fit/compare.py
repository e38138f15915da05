"""How far apart two sets of days are: in shares of time, by hour, and in how long one stays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.fit.timeline import I16, MINUTES, runs

HOURS = 24
FEWEST_STAYS = 5  # of a place, for its durations to be compared

Floats = NDArray[np.float64]


class Distances(NamedTuple):
    """Distances between sets of days, 0 where they are alike.

    Attributes:
        share: Total variation between the shares of time, 0 to 1.
        hours: The same hour by hour, on average over the hours of a day.
        ks: Largest gap between the distribution functions of the durations of stays, 0 to 1.
        stay_min: Wasserstein distance between those durations [min].
    """

    share: float
    hours: float
    ks: float
    stay_min: float


def distances(real: I16, other: I16, count: int) -> Distances:
    """Return the distances between days, labels int16 (days, 1440), -1 where nobody knows.

    Durations are compared place by place and weighed by how often one stays there in the real
    days. A stay that midnight cuts, or of which an end isn't known, is left out on both sides.
    """
    stays, others = dwell_times(real, count), dwell_times(other, count)
    weights, gaps, moves = [], [], []
    for mine, theirs in zip(stays, others, strict=True):
        if len(mine) >= FEWEST_STAYS:
            weights.append(len(mine))
            gaps.append(ks_distance(mine, theirs))
            moves.append(wasserstein(mine, theirs))
    nothing = not weights
    return Distances(
        share=_variation(shares(real, count), shares(other, count)),
        hours=float(
            np.mean(
                [
                    _variation(a, b)
                    for a, b in zip(by_hour(real, count), by_hour(other, count), strict=True)
                ]
            )
        ),
        ks=0.0 if nothing else float(np.average(gaps, weights=weights)),
        stay_min=0.0 if nothing else float(np.average(moves, weights=weights)),
    )


def shares(labels: I16, count: int) -> Floats:
    """Return the share of the known time of each label, (count,)."""
    known = labels[labels >= 0]
    found: Floats = np.bincount(known, minlength=count) / max(len(known), 1)
    return found


def by_hour(labels: I16, count: int) -> Floats:
    """Return the shares of the labels in each hour of the day, (24, count)."""
    hours = labels.reshape(len(labels), HOURS, MINUTES // HOURS)
    return np.stack([shares(hours[:, hour], count) for hour in range(HOURS)])


def dwell_times(labels: I16, count: int) -> list[Floats]:
    """Return the durations of the whole stays at each label [min], sorted."""
    found: list[list[int]] = [[] for _ in range(count)]
    for day in labels:
        parts = runs(day)
        for i, (label, _, length) in enumerate(parts):
            whole = 0 < i < len(parts) - 1 and parts[i - 1][0] >= 0 and parts[i + 1][0] >= 0
            if label >= 0 and whole:
                found[label].append(length)
    return [np.sort(np.array(lengths, np.float64)) for lengths in found]


def ks_distance(a: Floats, b: Floats) -> float:
    """Return the Kolmogorov-Smirnov distance of two sorted samples; 1 if either is empty.

    >>> ks_distance(np.array([1.0, 2.0]), np.array([1.0, 3.0]))
    0.5
    """
    if not len(a) or not len(b):
        return 1.0
    points = np.concatenate([a, b])
    below_a = np.searchsorted(a, points, side="right") / len(a)
    below_b = np.searchsorted(b, points, side="right") / len(b)
    return float(np.abs(below_a - below_b).max())


def wasserstein(a: Floats, b: Floats) -> float:
    """Return the Wasserstein distance of two sorted samples; to an empty one, that to 0.

    >>> wasserstein(np.array([1.0, 2.0]), np.array([2.0, 5.0]))
    2.0
    """
    a, b = (sample if len(sample) else np.zeros(1) for sample in (a, b))
    points = np.sort(np.concatenate([a, b]))
    below_a = np.searchsorted(a, points[:-1], side="right") / len(a)
    below_b = np.searchsorted(b, points[:-1], side="right") / len(b)
    return float((np.abs(below_a - below_b) * np.diff(points)).sum())


def _variation(a: Floats, b: Floats) -> float:
    return float(np.abs(a - b).sum() / 2)
