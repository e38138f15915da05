"""Distances between an estimated distribution over rooms and the true one.

They use IEEE arithmetic only, no logarithms of the system's math library, so that stored tables are
the same on every machine.
"""

import numpy as np

from fleet2d.algorithms.presence.estimator import LN_2, natural_log
from fleet2d.kernels import F64
from fleet2d.kernels.presence import earth_mover as minimal_cost


def total_variation(truth: F64, estimate: F64) -> F64:
    """Return 1/2 sum |p - q|: the largest difference in probability of any set of rooms, 0 to 1.

    Like the other distances, it sums over the last axis.

    Example:
        >>> float(total_variation(np.array([0.5, 0.5]), np.array([0.75, 0.25])))
        0.25
    """
    return np.abs(truth - estimate).sum(axis=-1) / 2


def kl_divergence(truth: F64, estimate: F64, alpha: float = 1e-3) -> F64:
    """Return sum p ln(p / q') in nats, with q' = (q + alpha) / (1 + alpha rooms).

    p is the truth and q the estimate; the smoothing by `alpha` keeps it finite where an estimate
    has ruled out a room. Rooms with p = 0 add nothing. At least 0 up to rounding, and above 0
    even where p = q, by less than alpha times the number of rooms.

    Example:
        >>> float(kl_divergence(np.array([1.0, 0.0]), np.array([0.5, 0.5])).round(4))
        0.6931
    """
    smoothed = (estimate + alpha) / (1 + alpha * estimate.shape[-1])
    return _relative_entropy(truth, smoothed)


def jensen_shannon(truth: F64, estimate: F64) -> F64:
    """Return 1/2 KL(p || m) + 1/2 KL(q || m) with m = (p + q) / 2, to base 2: from 0 to 1.

    Example:
        >>> float(jensen_shannon(np.array([1.0, 0.0]), np.array([0.0, 1.0])))
        1.0
    """
    middle = (truth + estimate) / 2
    both = _relative_entropy(truth, middle) + _relative_entropy(estimate, middle)
    return np.clip(both / (2 * LN_2), 0.0, 1.0)


def _relative_entropy(p: F64, q: F64) -> F64:
    is_positive = p > 0
    ratio = np.where(is_positive, p, 1) / np.where(is_positive, q, 1)
    return (p * natural_log(ratio)).sum(axis=-1)


def room_gaps(truth: F64, estimate: F64) -> F64:
    """Return |p - q| of each room."""
    return np.abs(truth - estimate)


def earth_mover(truth: F64, estimate: F64, cost: F64) -> F64:
    """Return the least mean distance by which one distribution is moved onto the other.

    The minimum of sum f_ij cost_ij over flows f >= 0 from room to room that turn q into p. Solved
    exactly, by successive shortest paths; mass that both have in a room stays.

    Args:
        truth: float64 (..., rooms), each sums to one.
        estimate: float64 (..., rooms), each sums to one.
        cost: float64 (rooms, rooms), finite, distances on foot [m]; 0 on the diagonal, and the
            triangle inequality holds.

    Example:
        >>> metres = np.array([[0.0, 4, 9], [4, 0, 5], [9, 5, 0]])
        >>> float(earth_mover(np.array([0.5, 0.5, 0]), np.array([0.5, 0, 0.5]), metres))
        2.5
    """
    rooms = len(cost)
    moved = minimal_cost(estimate.reshape(-1, rooms), truth.reshape(-1, rooms), cost)
    return moved.reshape(truth.shape[:-1])


def rank_correlation(truth: F64, estimate: F64) -> F64:
    """Return the rank correlation of the rooms: Kendall's tau, -1 to 1.

    (concordant - discordant) / pairs, over the pairs of rooms that differ in truth; pairs tied in
    the estimate are neither (Somers' D of the estimate given the truth: without ties Kendall's
    tau). So it can be 1 with rooms that are never used. It is 1 if no rooms differ in truth.

    Example:
        >>> float(rank_correlation(np.array([0.6, 0.4, 0, 0]), np.array([0.5, 0.3, 0.2, 0])))
        1.0
        >>> float(rank_correlation(np.array([0.5, 0.3, 0.2]), np.array([0.5, 0.2, 0.3])).round(4))
        0.3333
    """
    true = np.sign(truth[..., :, None] - truth[..., None, :])
    signs = true * np.sign(estimate[..., :, None] - estimate[..., None, :])
    pairs, balance = np.abs(true).sum(axis=(-2, -1)), signs.sum(axis=(-2, -1))
    return np.where(pairs > 0, balance / np.maximum(pairs, 1), 1.0)
