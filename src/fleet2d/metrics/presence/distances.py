"""Distances between an estimated distribution over rooms and the true one.

They use IEEE arithmetic only, no logarithm of the system's library: a stored table is the same on
every machine.
"""

from collections.abc import Iterable

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
    spare, metres = (estimate - truth).tolist(), cost.tolist()
    giving = [i for i, mass in enumerate(spare) if mass > NOTHING]
    taking = [j for j, mass in enumerate(spare) if mass < -NOTHING]
    flow = _Flow([[metres[i][j] for j in taking] for i in giving], [-spare[j] for j in taking])
    for row, i in enumerate(giving):
        left = spare[i]
        while left > NOTHING and max(flow.need, default=0.0) > NOTHING:
            left -= flow.push(row, left)
    return flow.cost


class _Flow:
    """A cheapest flow from those who give to those who take, which grows by shortest ways.

    Ways are measured by what they cost beyond what their ends are worth, never below zero, so that
    Dijkstra's algorithm finds the shortest; ways in use cost nothing.

    Attributes:
        metres: What a way costs.
        need: What each who takes still lacks.
        mass: What goes each of the ways.
    """

    def __init__(self, metres: list[list[float]], need: list[float]) -> None:
        self.metres, self.need = metres, need
        self.mass = [[0.0] * len(need) for _ in metres]
        self._give, self._take = [0.0] * len(metres), [0.0] * len(need)  # what they are worth

    @property
    def cost(self) -> float:
        """The sum of mass times metres."""
        pairs = zip(self.mass, self.metres, strict=True)
        return sum(a * b for row, ways in pairs for a, b in zip(row, ways, strict=True))

    def push(self, source: int, most: float) -> float:
        """Send mass from one who gives, shifting what others send; return how much."""
        far, came = [float("inf")] * len(self.need), [source] * len(self.need)
        reached, back = {source: 0.0}, dict[int, int]()
        left = dict.fromkeys(range(len(self.need)))  # takers whose shortest way isn't known yet
        self._reach(source, 0.0, far, came, left)
        while True:
            end = min(left, key=far.__getitem__)
            if self.need[end] > NOTHING:
                break
            del left[end]
            for i, row in enumerate(self.mass):
                if row[end] > NOTHING and i not in reached:
                    reached[i], back[i] = far[end], end
                    self._reach(i, far[end], far, came, left)
        for i, way in reached.items():
            self._give[i] += far[end] - way
        for j in range(len(self.need)):
            if j not in left:
                self._take[j] -= far[end] - far[j]
        return self._shift(source, end, came, back, most)

    def _reach(
        self, i: int, way: float, far: list[float], came: list[int], left: Iterable[int]
    ) -> None:
        """Take in the ways on from one who gives."""
        begin, ways = way - self._give[i], self.metres[i]
        for j in left:
            reduced = begin + ways[j] - self._take[j]
            if reduced < far[j]:
                far[j], came[j] = reduced, i

    def _shift(
        self, source: int, end: int, came: list[int], back: dict[int, int], most: float
    ) -> float:
        """Send mass to `end` by the way that it came; return how much."""
        there, again = [(came[end], end)], list[tuple[int, int]]()
        while (i := there[-1][0]) != source:
            again.append((i, back[i]))
            there.append((came[back[i]], back[i]))
        amount = min(most, self.need[end], *(self.mass[i][j] for i, j in again))
        for i, j in there:
            self.mass[i][j] += amount
        for i, j in again:
            self.mass[i][j] -= amount
        self.need[end] -= amount
        return amount


def rank_correlation(truth: F64, estimate: F64) -> F64:
    """Return how far the order of rooms is right: Kendall's tau, -1 to 1.

    (concordant - discordant) / pairs, of the pairs of rooms that differ in truth; those tied in the
    estimate are neither (Somers' D of the estimate given the truth: with no ties at all Kendall's
    tau). So rooms that are never used don't keep it from 1. 1 if no rooms differ in truth.

    Example:
        >>> float(rank_correlation(np.array([0.6, 0.4, 0, 0]), np.array([0.5, 0.3, 0.2, 0])))
        1.0
        >>> float(rank_correlation(np.array([0.5, 0.3, 0.2]), np.array([0.5, 0.2, 0.3])).round(4))
        0.3333
    """
    true = np.sign(truth[..., :, None] - truth[..., None, :])
    signs = true * np.sign(estimate[..., :, None] - estimate[..., None, :])
    pairs, right = np.abs(true).sum(axis=(-2, -1)), signs.sum(axis=(-2, -1))
    found: F64 = np.where(pairs > 0, right / np.maximum(pairs, 1), 1.0)
    return found
