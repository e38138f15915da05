"""Distances between an estimated distribution over rooms and the true one.

They use IEEE arithmetic only, no logarithms of the system's math library, so that stored tables are
the same on every machine.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.presence.logarithm import LN_2, natural_log
from fleet2d.sums import sum_in_order

F64 = NDArray[np.float64]

NOTHING = 1e-12  # probability mass below which nothing is moved


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


def earth_mover(truth: F64, estimate: F64, cost: F64) -> float:
    """Return the least mean distance by which one distribution is moved onto the other.

    The minimum of sum f_ij cost_ij over flows f >= 0 from room to room that turn q into p. Solved
    exactly, by successive shortest paths; mass that both have in a room stays.

    Args:
        truth: float64 (rooms,), sums to one.
        estimate: float64 (rooms,), sums to one.
        cost: float64 (rooms, rooms), finite, distances on foot [m]; 0 on the diagonal, and the
            triangle inequality holds.

    Example:
        >>> metres = np.array([[0.0, 4, 9], [4, 0, 5], [9, 5, 0]])
        >>> earth_mover(np.array([0.5, 0.5, 0]), np.array([0.5, 0, 0.5]), metres)
        2.5
    """
    surplus, metres = (estimate - truth).tolist(), cost.tolist()
    sources = [i for i, mass in enumerate(surplus) if mass > NOTHING]
    sinks = [j for j, mass in enumerate(surplus) if mass < -NOTHING]
    flow = _Flow([[metres[i][j] for j in sinks] for i in sources], [-surplus[j] for j in sinks])
    for row, i in enumerate(sources):
        rest = surplus[i]
        while rest > NOTHING and max(flow.demand, default=0.0) > NOTHING:
            rest -= flow.push(row, rest)
    return flow.cost


class _Flow:
    """A minimum cost flow from sources to sinks, which grows by shortest paths.

    Dijkstra's algorithm finds these paths by reduced costs, the costs less the difference of the
    potentials of both ends, which are never below zero, and zero for edges in use.

    Attributes:
        metres: The cost of each edge, by source and sink.
        demand: The mass that each sink still lacks.
        mass: The flow along each edge, by source and sink.
    """

    def __init__(self, metres: list[list[float]], demand: list[float]) -> None:
        self.metres, self.demand = metres, demand
        self.mass = [[0.0] * len(demand) for _ in metres]
        self._source_potential, self._sink_potential = [0.0] * len(metres), [0.0] * len(demand)

    @property
    def cost(self) -> float:
        """The sum of mass times metres."""
        pairs = zip(self.mass, self.metres, strict=True)
        return sum_in_order(a * b for row, costs in pairs for a, b in zip(row, costs, strict=True))

    def push(self, source: int, most: float) -> float:
        """Send at most `most` mass from a source along a shortest path; return how much."""
        distance, parent = [float("inf")] * len(self.demand), [source] * len(self.demand)
        visited, back = {source: 0.0}, dict[int, int]()
        open_sinks = dict.fromkeys(range(len(self.demand)))  # whose distance isn't final yet
        self._relax(source, 0.0, distance, parent, open_sinks)
        while True:
            end = min(open_sinks, key=distance.__getitem__)
            if self.demand[end] > NOTHING:
                break
            del open_sinks[end]
            for i, row in enumerate(self.mass):
                if row[end] > NOTHING and i not in visited:
                    visited[i], back[i] = distance[end], end
                    self._relax(i, distance[end], distance, parent, open_sinks)
        for i, length in visited.items():
            self._source_potential[i] += distance[end] - length
        for j in range(len(self.demand)):
            if j not in open_sinks:
                self._sink_potential[j] -= distance[end] - distance[j]
        return self._augment(source, end, parent, back, most)

    def _relax(
        self,
        i: int,
        length: float,
        distance: list[float],
        parent: list[int],
        open_sinks: Iterable[int],
    ) -> None:
        """Shorten the distances of sinks by the edges of source `i`, `length` from the start."""
        begin, costs = length - self._source_potential[i], self.metres[i]
        for j in open_sinks:
            reduced = begin + costs[j] - self._sink_potential[j]
            if reduced < distance[j]:
                distance[j], parent[j] = reduced, i

    def _augment(
        self, source: int, end: int, parent: list[int], back: dict[int, int], most: float
    ) -> float:
        """Send mass to the sink `end` along the path found; return how much."""
        forward, backward = [(parent[end], end)], list[tuple[int, int]]()
        while (i := forward[-1][0]) != source:
            backward.append((i, back[i]))
            forward.append((parent[back[i]], back[i]))
        amount = min(most, self.demand[end], *(self.mass[i][j] for i, j in backward))
        for i, j in forward:
            self.mass[i][j] += amount
        for i, j in backward:
            self.mass[i][j] -= amount
        self.demand[end] -= amount
        return amount


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
