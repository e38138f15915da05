"""Search: orders in which to look for a target.

A target stays at one of n sites, or is at none of them. A look takes time; when it ends at the
target's site, it detects the target with a known probability. To minimize the expected time of
detection is the graph search problem (Li and Chong 2009); with equal probabilities it is that of
the traveling deliveryman, or minimum latency (Kulich and others, ECMR 2017).

Policies are functions of a `SearchProblem` and return each site once. Ties go to the lower site, so
that an order is the same on every machine.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fleet2d.kernels import F64, I8
from fleet2d.runtime.determinism import Draws, sum_in_order


class SearchProblem(NamedTuple):
    """A search problem; made by :func:`search_problem`, which checks it.

    Attributes:
        prior: Probability that the target is at each site, float64 (n,); with the remaining
            probability it is at none of them.
        reach: Time from the searcher's position to each site [s], float64 (n,).
        travel: Time from site to site [s], float64 (n, n); not necessarily symmetric.
        look: Duration of a look at each site [s], float64 (n,).
        detect: Probability that a look at the target's site finds it, float64 (n,).
    """

    prior: F64
    reach: F64
    travel: F64
    look: F64
    detect: F64

    @property
    def gain(self) -> F64:
        """Probability that the first look at each site finds the target, float64 (n,)."""
        return self.prior * self.detect


def search_problem(
    prior: ArrayLike,
    reach: ArrayLike,
    travel: ArrayLike,
    look: ArrayLike = 0.0,
    detect: ArrayLike = 1.0,
) -> SearchProblem:
    """Return a search problem; a number for `look` or `detect` holds for all sites.

    Raises:
        ValueError: Shapes don't fit, a value is negative or not finite, or a probability
            exceeds one.

    Example:
        >>> flat = search_problem([0.5, 0.3], [4, 1], [[0, 5], [5, 0]], look=2)
        >>> flat.prior.tolist(), flat.look.tolist()
        ([0.5, 0.3], [2.0, 2.0])
    """
    chances = np.asarray(prior, np.float64)
    count = len(chances)
    ways = np.asarray(travel, np.float64)
    if ways.size == count * count:
        ways = ways.reshape(count, count)
    looks = np.broadcast_to(np.asarray(look, np.float64), (count,))
    detects = np.broadcast_to(np.asarray(detect, np.float64), (count,))
    reached = np.asarray(reach, np.float64)
    problem = SearchProblem(chances, reached, ways, looks.copy(), detects.copy())
    shapes = {"reach": (count,), "travel": (count, count)}
    for name, expected in shapes.items():
        shape = getattr(problem, name).shape
        if shape != expected:
            raise ValueError(f"{name} has shape {shape}, expected {expected} for {count} sites")
    for name, values in problem._asdict().items():
        if not (np.isfinite(values).all() and (values >= 0).all()):
            raise ValueError(f"{name} has a value that is negative or not finite: {values}")
    if sum_in_order(chances.tolist()) > 1 + 1e-9 or (problem.detect > 1).any():
        raise ValueError("prior sums to more than one, or detect is above one")
    return problem


Policy = Literal["random", "nearest", "likeliest", "greedy", "exact", "receding"]

MAX_EXACT_SITES = 16
"""Maximum number of sites for an exact order, which costs 2**sites: 0.3 s and 25 MB for 16."""
HORIZON = 8
"""The number of sites that a receding horizon orders exactly."""


def random_order(problem: SearchProblem, draws: Draws) -> list[int]:
    """Return the sites in random order."""
    return draws.shuffled(range(len(problem.prior)))


def nearest_first(problem: SearchProblem) -> list[int]:
    """Return the order that takes the nearest site each time, whatever its probability.

    The time of a look counts as part of the way to its site.
    """
    return _step_by_step(problem, lambda way, _: -way)


def likeliest_first(problem: SearchProblem) -> list[int]:
    """Return the sites by the probability of finding the target there, the highest first."""
    return _step_by_step(problem, lambda _, gain: gain)


def greedy(problem: SearchProblem) -> list[int]:
    """Return the order that each time maximizes probability per second of travel and look."""
    return _step_by_step(problem, lambda way, gain: gain / max(way, 1e-9))


def exact(problem: SearchProblem) -> list[int]:
    """Return the order with the lowest expected time: dynamic programming over subsets of sites.

    Bellman 1962 and Held and Karp 1962, for the sum of detection times in place of a tour's length:
    a second after looks at the sites S costs the probability that the target is found outside S. So
    the lowest cost from (S, i) on is V(S, i) = min over j outside S of
    (way(i, j) + look(j)) * gain(outside S) + V(S + j, j). Takes 2**n n**2 operations.

    Raises:
        ValueError: There are more than MAX_EXACT_SITES sites.

    Example:
        >>> from fleet2d.entities.robots.search import search_problem
        >>> line = search_problem([0.2, 0.2, 0.6], [1, 2, 9], [[0, 3, 10], [3, 0, 11], [10, 11, 0]])
        >>> exact(line), likeliest_first(line)
        ([0, 1, 2], [2, 0, 1])
    """
    count = len(problem.prior)
    if count > MAX_EXACT_SITES:
        raise ValueError(
            f"an exact order of {count} sites takes too long: give {MAX_EXACT_SITES} at most"
        )
    if not count:
        return []
    ways = problem.travel + problem.look
    choice, first = _solve(ways, problem.reach + problem.look, problem.gain)
    order = [first]
    done = 1 << first
    while len(order) < count:
        order.append(int(choice[done, order[-1]]))
        done |= 1 << order[-1]
    return order


def receding(problem: SearchProblem, horizon: int = HORIZON) -> list[int]:
    """Return the order of :func:`greedy`, with its first `horizon` sites in the best order.

    It is meant to be computed again after every look, with updated probabilities, so that only its
    first site is used.
    """
    rough = greedy(problem)
    sites = sorted(rough[:horizon])
    prior, reach, travel, look, detect = problem
    ways = travel[np.ix_(sites, sites)]
    part = SearchProblem(prior[sites], reach[sites], ways, look[sites], detect[sites])
    return [sites[number] for number in exact(part)] + rough[horizon:]


def order_by(policy: Policy, problem: SearchProblem, draws: Draws) -> list[int]:
    """Return the order of a policy by its name; only `random` draws."""
    if policy == "random":
        return random_order(problem, draws)
    return _ORDERS[policy](problem)


_ORDERS: dict[str, Callable[[SearchProblem], list[int]]] = {
    "nearest": nearest_first,
    "likeliest": likeliest_first,
    "greedy": greedy,
    "exact": exact,
    "receding": receding,
}


def after_empty_looks(prior: F64, age: F64, memory: float, detect: F64 | float = 1.0) -> F64:
    """Return the probabilities of the sites after looks without success, not normalized.

    A look that finds the target with probability d reduces the probability of its site by the part
    d (Bayes). As people move, older looks count less: by d * memory / (memory + age). With
    d = 1, the result is the probability that another look from the same place finds the target: a
    target that was hidden there stays hidden.

    Args:
        prior: Probabilities without the looks, float64 (n,).
        age: Time since the last look at each site [s], infinite without one, float64 (n,).
        memory: Age at which a look counts half [s]; 0: looks have no effect later.
        detect: The probability d, for each site or for all.

    Example:
        >>> after_empty_looks(np.array([0.6, 0.4]), np.array([60.0, np.inf]), memory=60.0).tolist()
        [0.3, 0.4]
    """
    has_look = np.isfinite(age)
    weight = memory / np.maximum(memory + np.where(has_look, age, 0.0), 1e-9)
    return prior * (1 - detect * np.where(has_look, weight, 0.0))


def _step_by_step(problem: SearchProblem, worth: Callable[[float, float], float]) -> list[int]:
    """Return a greedy order: next the site with the largest worth.

    Args:
        problem: The problem.
        worth: A function of the time of travel and look [s] and the probability of detection.
    """
    gain = problem.gain.tolist()
    look = problem.look.tolist()
    remaining = list(range(len(gain)))
    order = list[int]()
    while remaining:
        ways = problem.travel[order[-1]] if order else problem.reach
        worths = [worth(float(ways[site]) + look[site], gain[site]) for site in remaining]
        best = remaining[worths.index(max(worths))]
        order.append(best)
        remaining.remove(best)
    return order


def _solve(ways: F64, reach: F64, gain: F64) -> tuple[I8, int]:
    """Return the best next site by (subset of sites done, last site), and the best first site.

    Args:
        ways: Time from the end of one look to the end of the next [s], float64 (n, n).
        reach: Time to the end of a first look [s], float64 (n,).
        gain: Probability that the first look at each site finds the target, float64 (n,).
    """
    count = len(gain)
    subsets = np.arange(1 << count, dtype=np.int64)
    outside = np.zeros(1 << count)  # gain of the sites outside each subset
    size = np.zeros(1 << count, np.int64)
    for j, chance in enumerate(gain.tolist()):
        outside += np.where(subsets >> j & 1, 0.0, chance)
        size += subsets >> j & 1
    cost = np.zeros((1 << count, count))
    choice = np.zeros((1 << count, count), np.int8)
    bits = np.left_shift(1, np.arange(count))
    last = np.arange(count)
    for done in range(count - 1, 0, -1):
        layer = subsets[size == done]
        is_done = layer[:, None] & bits
        after = layer[:, None] | bits
        ahead = np.where(is_done, np.inf, cost[after, last])
        # Axes are subset, last site and next site; of equal costs, the first is chosen.
        total = outside[layer][:, None, None] * ways + ahead[:, None, :]
        choice[layer] = total.argmin(axis=2)
        cost[layer] = total.min(axis=2)
    totals = outside[0] * reach + cost[bits, last]
    return choice, int(np.argmin(totals))
