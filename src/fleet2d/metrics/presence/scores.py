"""Scores of forecasts: probabilities of rooms at many times, against where the user was."""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.presence.logarithm import natural_log

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

LEAST = 1e-6  # to which probabilities are raised before a logarithm is taken
MASSES = 15  # groups of equal size by confidence


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


def top_1(probability: F64, truth: I64) -> F64:
    """Return 1 where the likeliest place was right, shared among those that are equally likely.

    The mean is the accuracy. It is not proper: read it beside a proper score.

    Example:
        >>> top_1(np.array([[0.5, 0.5], [0.9, 0.1]]), np.array([0, 1])).tolist()
        [0.5, 0.0]
    """
    best = probability == probability.max(axis=1, keepdims=True)
    return np.where(_of(best, truth), 1 / best.sum(axis=1), 0.0)


def calibration_error(probability: F64, truth: I64, masses: int = MASSES) -> float:
    """Return the expected calibration error: sum over groups of n_g / n |accuracy - confidence|.

    Forecasts are sorted by confidence, the probability of their likeliest place, and cut into
    groups of equal size (to one). 0 of no forecasts.

    Example:
        >>> calibration_error(np.array([[0.75, 0.25]] * 4), np.array([0, 0, 0, 1]), masses=1)
        0.0
    """
    count = len(truth)
    if not count:
        return 0.0
    confidence, right = probability.max(axis=1), top_1(probability, truth)
    order = np.argsort(confidence, kind="stable")
    cuts = (np.arange(masses + 1) * count // masses).tolist()
    gaps = (
        abs(float((right[group] - confidence[group]).sum()))
        for group in (order[a:b] for a, b in pairwise(cuts))
    )
    return sum(gaps) / count


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
