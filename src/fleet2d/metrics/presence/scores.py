"""Scores of forecasts: probabilities of rooms at many times, against where the user was."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.presence.estimator import natural_log
from fleet2d.kernels import F64, I64
from fleet2d.runtime.determinism import sum_in_order

LEAST = 1e-6  # smaller probabilities are raised to this before taking logarithms
MASSES = 15  # number of groups of about equal size, by forecast probability


def log_loss(probability: F64, truth: I64, least: float = LEAST) -> F64:
    """Return -ln max(p(truth), least) of each forecast [nats]; strictly proper but for the clip.

    Args:
        probability: float64 (n, places), rows sum to one.
        truth: int64 (n,), the true place.
        least: Smaller probabilities are raised to this.

    Example:
        >>> log_loss(np.array([[0.5, 0.5], [1.0, 0.0]]), np.array([0, 1])).round(3).tolist()
        [0.693, 13.816]
    """
    return -natural_log(np.maximum(_of(probability, truth), least))


def brier_score(probability: F64, truth: I64) -> F64:
    """Return sum over places of (p - 1{truth})^2 of each forecast, 0 to 2; strictly proper.

    Example:
        >>> brier_score(np.array([[0.5, 0.5], [1.0, 0.0]]), np.array([0, 1])).tolist()
        [0.5, 2.0]
    """
    return (probability * probability).sum(axis=1) - 2 * _of(probability, truth) + 1


def top_k(probability: F64, truth: I64, k: int) -> F64:
    """Return 1 for each forecast whose k likeliest places include the truth, 0 for others.

    With equally likely places it is the probability that the truth is included if ties are broken
    at random: 1/2 for one of two equal places. The mean is the accuracy. It is not a proper score:
    read it together with one.

    Example:
        >>> top_k(np.array([[0.5, 0.5, 0], [0.6, 0.3, 0.1]]), np.array([0, 1]), 1).tolist()
        [0.5, 0.0]
        >>> top_k(np.array([[0.5, 0.5, 0], [0.6, 0.3, 0.1]]), np.array([0, 1]), 2).tolist()
        [1.0, 1.0]
    """
    true = _of(probability, truth)[:, np.newaxis]
    above, equal = (probability > true).sum(axis=1), (probability == true).sum(axis=1)
    return np.clip((k - above) / equal, 0, 1)


def groups_of(values: F64, masses: int = MASSES) -> I64:
    """Return the index of the group of each value: groups of about equal size, ascending.

    Equal values are in the same group, that of the middle of their ranks.

    Example:
        >>> groups_of(np.array([0.9, 0.1, 0.5, 0.5, 0.5, 0.2]), masses=3).tolist()
        [2, 0, 1, 1, 1, 0]
    """
    order = np.sort(values)
    first, last = (np.searchsorted(order, values, side) for side in ("left", "right"))
    return (first + last - 1) // 2 * masses // max(len(values), 1)


def calibration_error(probability: F64, truth: I64, masses: int = MASSES) -> float:
    """Return the expected calibration error: sum over groups of n_g / n |accuracy - confidence|.

    The groups are of about equal size by confidence, the probability of the likeliest place
    (`groups_of`); accuracy and confidence are means over a group. 0 without forecasts.

    Example:
        >>> calibration_error(np.array([[0.75, 0.25]] * 4), np.array([0, 0, 0, 1]))
        0.0
    """
    if not len(truth):
        return 0.0
    return _gaps(probability.max(axis=1), top_k(probability, truth, 1), masses)


def classwise_error(probability: F64, truth: I64, masses: int = MASSES) -> float:
    """Return the class-wise calibration error: the mean of the calibration errors of all places.

    The error of a place is the sum over groups of n_g / n |share true - mean probability|, with
    groups of about equal size by its probability (Kull and others, 2019). Places that are neither
    forecast nor true count with 0. 0 without forecasts.

    Example:
        >>> classwise_error(np.array([[0.75, 0.25]] * 4), np.array([0, 0, 0, 0]))
        0.25
    """
    if not len(truth):
        return 0.0
    places = range(probability.shape[1])
    gaps = (_gaps(probability[:, c], (truth == c).astype(np.float64), masses) for c in places)
    return sum_in_order(gaps) / len(places)


class Murphy(NamedTuple):
    """The Brier score in parts: it is reliability - resolution + uncertainty.

    Attributes:
        reliability: Squared difference of forecast probability and frequency; 0 is best.
        resolution: Variance of the frequency between forecasts; larger is better.
        uncertainty: The Brier score of a forecaster that always predicts the base rate; it depends
            on the truth, not on the forecasts.
    """

    reliability: float
    resolution: float
    uncertainty: float


def murphy(probability: F64, truth: I64, masses: int = MASSES) -> Murphy:
    """Return Murphy's split of the Brier score, summed over places.

    For each place, forecasts are put into groups of about equal size by its probability
    (`groups_of`): reliability is the sum of n_g / n (mean probability - share true)^2, uncertainty
    s (1 - s) with s the share true of all. Resolution is the remainder, so that the parts add up:
    the sum of n_g / n (share true - s)^2, except for differences within groups (Stephenson and
    others, 2008); for forecasts with few distinct values it is exactly that.

    Example:
        >>> probability = np.array([[0.5, 0.5]] * 2 + [[1.0, 0.0]] * 2)
        >>> murphy(probability, np.array([0, 1, 0, 0]))
        Murphy(reliability=0.0, resolution=0.125, uncertainty=0.375)
    """
    count = max(len(truth), 1)
    reliability = uncertainty = 0.0
    for place in range(probability.shape[1]):
        forecast, true = probability[:, place], (truth == place).astype(np.float64)
        size, difference = _grouped(forecast, true, masses)
        reliability += float((difference * difference / np.maximum(size, 1)).sum()) / count
        share = float(true.sum()) / count
        uncertainty += share * (1 - share)
    brier = float(brier_score(probability, truth).sum()) / count
    return Murphy(reliability, reliability + uncertainty - brier, uncertainty)


def reliability_curve(forecast: F64, true: F64, masses: int = MASSES) -> tuple[F64, F64, I64]:
    """Return the points of a reliability diagram.

    Args:
        forecast: float64 (n,), probabilities.
        true: float64 (n,), 1 where the event happened, 0 elsewhere.
        masses: Number of groups of about equal size.

    Returns:
        For each group that isn't empty: mean probability, share of true events, and size.

    Example:
        >>> forecast, true = np.array([0.2, 0.2, 0.2, 0.2, 0.8]), np.array([1, 0, 0, 0, 1.0])
        >>> [part.tolist() for part in reliability_curve(forecast, true, masses=2)]
        [[0.2, 0.8], [0.25, 1.0], [4, 1]]
    """
    group = groups_of(forecast, masses)
    counts = np.bincount(group, minlength=masses)
    size = counts[counts > 0]
    sums = (np.bincount(group, values, masses)[counts > 0] for values in (forecast, true))
    confidence, share = (total / size for total in sums)
    return confidence, share, size.astype(np.int64)


def _gaps(forecast: F64, true: F64, masses: int) -> float:
    return float(np.abs(_grouped(forecast, true, masses)[1]).sum()) / len(forecast)


def _grouped(forecast: F64, true: F64, masses: int) -> tuple[I64, F64]:
    """Return for each group of forecasts its size, and the sum of its truth minus forecast."""
    group = groups_of(forecast, masses)
    size: I64 = np.bincount(group, minlength=masses)
    difference = np.bincount(group, true - forecast, masses).astype(np.float64)
    return size, difference


def sharpness(probability: F64) -> F64:
    """Return the entropy of each forecast [nats]; compare it between calibrated forecasts only.

    Example:
        >>> sharpness(np.array([[1.0, 0.0], [0.5, 0.5]])).round(4).tolist()
        [0.0, 0.6931]
    """
    positive = np.where(probability > 0, probability, 1)
    entropy: F64 = -(positive * natural_log(positive)).sum(axis=1)
    return np.maximum(entropy, 0)


def skill(score: float, reference: float) -> float:
    """Return 1 - score / reference: 1 is perfect, 0 as good as the reference, or if that is 0.

    Example:
        >>> skill(0.5, 2.0)
        0.75
    """
    return 1 - score / reference if reference > 0 else 0.0


def _of(values: NDArray[Any], truth: I64) -> NDArray[Any]:
    return values[np.arange(len(truth)), truth]
