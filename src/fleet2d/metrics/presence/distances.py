"""Distances between an estimated distribution over rooms and the true one.

They use IEEE arithmetic only, no logarithm of the system's library: a stored table is the same on
every machine.
"""

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.presence.logarithm import LN_2, natural_log

F64 = NDArray[np.float64]

NOTHING = 1e-12  # mass and metres below which nothing is moved


def total_variation(truth: F64, estimate: F64) -> F64:
    """Return 1/2 sum |p - q|: the largest gap of probability over any set of rooms, 0 to 1.

    This and what follows sums over the last axis.

    Example:
        >>> float(total_variation(np.array([0.5, 0.5]), np.array([0.75, 0.25])))
        0.25
    """
    found: F64 = np.abs(truth - estimate).sum(axis=-1) / 2
    return found


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
    some = p > 0
    found: F64 = (p * natural_log(np.where(some, p, 1) / np.where(some, q, 1))).sum(axis=-1)
    return found


def room_gaps(truth: F64, estimate: F64) -> F64:
    """Return |p - q| of each room."""
    found: F64 = np.abs(truth - estimate)
    return found


def earth_mover(truth: F64, estimate: F64, cost: F64) -> float:
    """Return the least mean way by which one distribution is moved onto the other.

    The minimum over flows f >= 0 from room to room that turn q into p, of sum f_ij cost_ij. Solved
    exactly, by successive shortest ways; mass that both have in a room stays.

    Args:
        truth: float64 (rooms,), sums to one.
        estimate: float64 (rooms,), sums to one.
        cost: float64 (rooms, rooms), finite, of metres on foot; 0 to a room itself, and no way
            round by a third room is shorter.

    Example:
        >>> metres = np.array([[0.0, 4, 9], [4, 0, 5], [9, 5, 0]])
        >>> earth_mover(np.array([0.5, 0.5, 0]), np.array([0.5, 0, 0.5]), metres)
        2.5
    """
    spare = estimate - truth
    giving = np.flatnonzero(spare > NOTHING).tolist()
    taking = np.flatnonzero(spare < -NOTHING).tolist()
    left = [float(spare[i]) for i in giving]
    need = [-float(spare[j]) for j in taking]
    costs = [[float(cost[i, j]) for j in taking] for i in giving]
    flow = [[0.0] * len(taking) for _ in giving]
    while max(left, default=0.0) > NOTHING and max(need, default=0.0) > NOTHING:
        way = _cheapest_way(costs, flow, left, need)
        amount = min(
            left[way[0][0]],
            need[way[-1][1]],
            *(flow[i][j] for k, (i, j) in enumerate(way) if k % 2),
        )
        for k, (i, j) in enumerate(way):
            flow[i][j] += -amount if k % 2 else amount
        left[way[0][0]] -= amount
        need[way[-1][1]] -= amount
    return sum(flow[i][j] * costs[i][j] for i in range(len(giving)) for j in range(len(taking)))


def _cheapest_way(
    costs: list[list[float]], flow: list[list[float]], left: list[float], need: list[float]
) -> list[tuple[int, int]]:
    """Return the cheapest way from who has left to who has need: legs there, back, there … .

    Legs in even places carry more, those in odd places carry less than so far (Bellman and Ford).
    """
    far = float("inf")
    give = [0.0 if amount > NOTHING else far for amount in left]
    take = [far] * len(need)
    to: list[int] = [-1] * len(need)
    back: list[int] = [-1] * len(left)
    changed = True
    while changed:
        changed = False
        for i, row in enumerate(costs):
            for j, metres in enumerate(row):
                if give[i] + metres < take[j] - NOTHING:
                    take[j], to[j], changed = give[i] + metres, i, True
                if flow[i][j] > NOTHING and take[j] - metres < give[i] - NOTHING:
                    give[i], back[i], changed = take[j] - metres, j, True
    j = min((j for j, amount in enumerate(need) if amount > NOTHING), key=take.__getitem__)
    way: list[tuple[int, int]] = []
    while True:
        i = to[j]
        way.append((i, j))
        if back[i] < 0:
            return way[::-1]
        j = back[i]
        way.append((i, j))


def rank_correlation(truth: F64, estimate: F64) -> float:
    """Return Kendall's tau-a of the order of rooms: (concordant - discordant) / pairs, -1 to 1.

    Pairs that are tied in either are neither. 1 if there is a single room.

    Example:
        >>> rank_correlation(np.array([0.5, 0.3, 0.2]), np.array([0.5, 0.2, 0.3]))
        0.3333333333333333
    """
    count = len(truth)
    if count < 2:
        return 1.0
    signs = np.sign(truth[:, None] - truth) * np.sign(estimate[:, None] - estimate)
    return float(signs.sum() / (count * (count - 1)))
