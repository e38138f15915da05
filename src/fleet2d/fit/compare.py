"""Distances between two sets of days: shares of time, shares by hour, durations of stays."""

from typing import NamedTuple

import numpy as np

from fleet2d.fit.timeline import MINUTES, runs
from fleet2d.kernels import F64, I16
from fleet2d.runtime.determinism import sum_in_order

HOURS = 24
FEWEST_STAYS = 5  # the fewest stays at a place whose durations are compared


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
    """Return the distances between days, labels int16 (days, 1440), -1 where unknown.

    Durations are compared place by place, weighted by the number of stays in the real days. Stays
    that midnight cuts, or of which an end is unknown, are left out in both.
    """
    pairs = [
        (times, other_times)
        for times, other_times in zip(
            dwell_times(real, count), dwell_times(other, count), strict=True
        )
        if len(times) >= FEWEST_STAYS
    ]
    total = max(sum(len(times) for times, _ in pairs), 1)
    hours = zip(by_hour(real, count), by_hour(other, count), strict=True)
    return Distances(
        share=_variation(shares(real, count), shares(other, count)),
        hours=float(np.mean([_variation(a, b) for a, b in hours])),
        ks=sum_in_order(len(a) * ks_distance(a, b) for a, b in pairs) / total,
        stay_min=sum_in_order(len(a) * wasserstein(a, b) for a, b in pairs) / total,
    )


def shares(labels: I16, count: int) -> F64:
    """Return the share of each label in the known time, float64 (count,)."""
    known = labels[labels >= 0]
    return np.bincount(known, minlength=count) / max(len(known), 1)


def by_hour(labels: I16, count: int) -> F64:
    """Return the shares of the labels in each hour of the day, (24, count)."""
    hours = labels.reshape(len(labels), HOURS, MINUTES // HOURS)
    return np.stack([shares(hours[:, hour], count) for hour in range(HOURS)])


def dwell_times(labels: I16, count: int) -> list[F64]:
    """Return the durations of the complete stays at each label [min], sorted."""
    times: list[list[int]] = [[] for _ in range(count)]
    for day in labels:
        parts = runs(day)
        for i, (label, _, length) in enumerate(parts):
            is_inside = 0 < i < len(parts) - 1
            if label >= 0 and is_inside and min(parts[i - 1][0], parts[i + 1][0]) >= 0:
                times[label].append(length)
    return [np.sort(np.array(lengths, np.float64)) for lengths in times]


def ks_distance(a: F64, b: F64) -> float:
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


def wasserstein(a: F64, b: F64) -> float:
    """Return the Wasserstein distance of two sorted samples; an empty one counts as a single 0.

    >>> wasserstein(np.array([1.0, 2.0]), np.array([2.0, 5.0]))
    2.0
    """
    a, b = (sample if len(sample) else np.zeros(1) for sample in (a, b))
    points = np.sort(np.concatenate([a, b]))
    below_a = np.searchsorted(a, points[:-1], side="right") / len(a)
    below_b = np.searchsorted(b, points[:-1], side="right") / len(b)
    return float((np.abs(below_a - below_b) * np.diff(points)).sum())


def _variation(a: F64, b: F64) -> float:
    """Return the total variation between two distributions."""
    return float(np.abs(a - b).sum() / 2)
