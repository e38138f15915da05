"""Scores of forecasts: probabilities of rooms at many times, against where the user was."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.presence.logarithm import natural_log

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

LEAST = 1e-6  # to which probabilities are raised before a logarithm is taken
MASSES = 15  # groups of about equal size by what was said


def log_loss(probability: F64, truth: I64, least: float = LEAST) -> F64:
    """Return -ln max(p(truth), least) of each forecast, in nats; strictly proper but for the clip.

    Args:
        probability: float64 (n, places), rows sum to one.
        truth: int64 (n,), the place it was.
        least: What smaller probabilities are raised to.

    Example:
        >>> log_loss(np.array([[0.5, 0.5], [1.0, 0.0]]), np.array([0, 1])).round(3).tolist()
        [0.693, 13.816]
    """
    found: F64 = -natural_log(np.maximum(_of(probability, truth), least))
    return found


def brier_score(probability: F64, truth: I64) -> F64:
    """Return sum over places of (p - 1{truth})^2 of each forecast, 0 to 2; strictly proper.

    Example:
        >>> brier_score(np.array([[0.5, 0.5], [1.0, 0.0]]), np.array([0, 1])).tolist()
        [0.5, 2.0]
    """
    found: F64 = (probability * probability).sum(axis=1) - 2 * _of(probability, truth) + 1
    return found


def top_k(probability: F64, truth: I64, k: int) -> F64:
    """Return 1 where the truth was among the k likeliest places.

    Where places are equally likely, the chance that it is if they are put in any order: of two
    alike of which one is taken, 1/2. The mean is the accuracy. It is not proper: read it beside a
    proper score.

    Example:
        >>> top_k(np.array([[0.5, 0.5, 0], [0.6, 0.3, 0.1]]), np.array([0, 1]), 1).tolist()
        [0.5, 0.0]
        >>> top_k(np.array([[0.5, 0.5, 0], [0.6, 0.3, 0.1]]), np.array([0, 1]), 2).tolist()
        [1.0, 1.0]
    """
    true = _of(probability, truth)[:, np.newaxis]
    above, alike = (probability > true).sum(axis=1), (probability == true).sum(axis=1)
    found: F64 = np.clip((k - above) / alike, 0, 1)
    return found


def groups_of(values: F64, masses: int = MASSES) -> I64:
    """Return which of some groups of about equal size each value is in, from small to large.

    Values that are the same are in the same group, that of the middle of their places in order:
    forecasts that say the same are never told apart.

    Example:
        >>> groups_of(np.array([0.9, 0.1, 0.5, 0.5, 0.5, 0.2]), masses=3).tolist()
        [2, 0, 1, 1, 1, 0]
    """
    order = np.sort(values)
    first, last = (np.searchsorted(order, values, side) for side in ("left", "right"))
    found: I64 = (first + last - 1) // 2 * masses // max(len(values), 1)
    return found


def calibration_error(probability: F64, truth: I64, masses: int = MASSES) -> float:
    """Return the expected calibration error: sum over groups of n_g / n |accuracy - confidence|.

    The groups are of about equal size by confidence, the probability of the likeliest place
    (`groups_of`); of them accuracy and confidence are means. 0 of no forecasts.

    Example:
        >>> calibration_error(np.array([[0.75, 0.25]] * 4), np.array([0, 0, 0, 1]))
        0.0
    """
    if not len(truth):
        return 0.0
    return _gaps(probability.max(axis=1), top_k(probability, truth, 1), masses)


def classwise_error(probability: F64, truth: I64, masses: int = MASSES) -> float:
    """Return the class-wise calibration error: the mean over places of each place's own.

    Of a place it is the sum over groups of n_g / n |share true - mean probability|, the groups
    being of about equal size by its probability (Kull and others, 2019). Places that are neither
    forecast nor true count, with 0. 0 of no forecasts.

    Example:
        >>> classwise_error(np.array([[0.75, 0.25]] * 4), np.array([0, 0, 0, 0]))
        0.25
    """
    if not len(truth):
        return 0.0
    places = range(probability.shape[1])
    gaps = (_gaps(probability[:, c], (truth == c).astype(np.float64), masses) for c in places)
    return sum(gaps) / len(places)


class Murphy(NamedTuple):
    """The Brier score in parts: it is reliability - resolution + uncertainty.

    Attributes:
        reliability: How far what was said is from how often it came true; 0 is best.
        resolution: How much that differs from one forecast to the other; more is better.
        uncertainty: The Brier score of who always says the mean: of the matter, not of the
            forecasts.
    """

    reliability: float
    resolution: float
    uncertainty: float


def murphy(probability: F64, truth: I64, masses: int = MASSES) -> Murphy:
    """Return Murphy's split of the Brier score, summed over places.

    Of each place, forecasts are put into groups of about equal size by its probability
    (`groups_of`): reliability is the sum of n_g / n (mean probability - share true)^2, uncertainty
    s (1 - s) with s the share true of all. Resolution is what remains, so that the parts add up:
    the sum of n_g / n (share true - s)^2, but for what forecasts of one group differ (Stephenson
    and others, 2008); of forecasts that take few values it is just that.

    Example:
        >>> said = np.array([[0.5, 0.5]] * 2 + [[1.0, 0.0]] * 2)
        >>> murphy(said, np.array([0, 1, 0, 0]))
        Murphy(reliability=0.0, resolution=0.125, uncertainty=0.375)
    """
    count = max(len(truth), 1)
    reliability = uncertainty = 0.0
    for place in range(probability.shape[1]):
        said, true = probability[:, place], (truth == place).astype(np.float64)
        size, difference = _grouped(said, true, masses)
        reliability += float((difference * difference / np.maximum(size, 1)).sum()) / count
        share = float(true.sum()) / count
        uncertainty += share * (1 - share)
    brier = float(brier_score(probability, truth).sum()) / count
    return Murphy(reliability, reliability + uncertainty - brier, uncertainty)


def reliability_curve(said: F64, true: F64, masses: int = MASSES) -> tuple[F64, F64, I64]:
    """Return the points of a reliability diagram.

    Args:
        said: float64 (n,), probabilities.
        true: float64 (n,), 1 where that came true.
        masses: Groups of about equal size.

    Returns:
        Of each group that isn't empty: mean probability, share that came true, and size.

    Example:
        >>> said, true = np.array([0.2, 0.2, 0.2, 0.2, 0.8]), np.array([1, 0, 0, 0, 1.0])
        >>> [part.tolist() for part in reliability_curve(said, true, masses=2)]
        [[0.2, 0.8], [0.25, 1.0], [4, 1]]
    """
    group = groups_of(said, masses)
    size = np.bincount(group, minlength=masses)
    some = size > 0
    sums = (np.bincount(group, values, minlength=masses)[some] for values in (said, true))
    confidence, share = (total / size[some] for total in sums)
    return confidence, share, size[some].astype(np.int64)


def _gaps(said: F64, true: F64, masses: int) -> float:
    return float(np.abs(_grouped(said, true, masses)[1]).sum()) / len(said)


def _grouped(said: F64, true: F64, masses: int) -> tuple[I64, F64]:
    """Return the size of each group, and the sum of how much too rarely it came true."""
    group = groups_of(said, masses)
    size: I64 = np.bincount(group, minlength=masses)
    difference = np.bincount(group, true - said, masses).astype(np.float64)
    return size, difference


def sharpness(probability: F64) -> F64:
    """Return the entropy of each forecast in nats; only of use between calibrated forecasts.

    Example:
        >>> sharpness(np.array([[1.0, 0.0], [0.5, 0.5]])).round(4).tolist()
        [0.0, 0.6931]
    """
    some = np.where(probability > 0, probability, 1)
    found: F64 = -(some * natural_log(some)).sum(axis=1)
    return np.maximum(found, 0)


def skill(score: float, reference: float) -> float:
    """Return 1 - score / reference: 1 is perfect, 0 as bad as the reference. 0 if that is perfect.

    Example:
        >>> skill(0.5, 2.0)
        0.75
    """
    return 1 - score / reference if reference > 0 else 0.0


def _of(values: NDArray[Any], truth: I64) -> NDArray[Any]:
    found: NDArray[Any] = values[np.arange(len(truth)), truth]
    return found
