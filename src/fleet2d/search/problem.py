"""The search problem: where somebody may be, what it takes to look there, and how an order does.

A target sits still at one of n sites, or is not there at all. A look at a site, once it is over,
finds the target with a known probability if it is there. Minimising the expected time of detection
is the graph search problem (Li and Chong 2009); with equal probabilities it is that of the
traveling deliveryman, or minimum latency (Kulich and others, ECMR 2017).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

F64 = NDArray[np.float64]


class SearchProblem(NamedTuple):
    """What a search has to go by; made by :func:`search_problem`, which checks it.

    Attributes:
        prior: float64 (n,), probability that the target is at each site; what they lack to one is
            the probability that it is at none of them.
        reach: float64 (n,), seconds from where the searcher is to each site.
        travel: float64 (n, n), seconds from site to site; need not be symmetric.
        look: float64 (n,), seconds that a look takes at each site.
        detect: float64 (n,), probability that a look at its site finds the target.
    """

    prior: F64
    reach: F64
    travel: F64
    look: F64
    detect: F64

    @property
    def gain(self) -> F64:
        """Probability that the first look at each site finds the target: float64 (n,)."""
        return self.prior * self.detect


class Found(NamedTuple):
    """What an order of looks comes to, worked out exactly.

    Attributes:
        time: float64 (looks,), seconds after which each look is over.
        chance: float64 (looks,), probability that the target is first found by each look.
    """

    time: F64
    chance: F64

    @property
    def cost(self) -> float:
        """Sum of time times chance [s]: what the orders of all sites are compared by."""
        return float(
            sum(t * p for t, p in zip(self.time.tolist(), self.chance.tolist(), strict=True))
        )

    @property
    def success(self) -> float:
        """Probability that the target is found at all."""
        return float(sum(self.chance.tolist()))

    @property
    def mean(self) -> float:
        """Expected time of detection, given that the target is found [s]; 0 if it never is."""
        return self.cost / self.success if self.success > 0 else 0.0

    def restricted_mean(self, deadline: float) -> float:
        """Return the expected time until the target is found or the deadline is over [s]."""
        inside = self.time <= deadline
        chances, times = self.chance[inside].tolist(), self.time[inside].tolist()
        found = sum(t * p for t, p in zip(times, chances, strict=True))
        return float(found + deadline * (1 - sum(chances)))


def search_problem(
    prior: ArrayLike,
    reach: ArrayLike,
    travel: ArrayLike,
    look: ArrayLike = 0.0,
    detect: ArrayLike = 1.0,
) -> SearchProblem:
    """Return a search problem; a number for `look` or `detect` holds for all sites.

    Raises:
        ValueError: Shapes don't fit, or there is a negative or unknown value.

    Example:
        >>> flat = search_problem([0.5, 0.3], [4, 1], [[0, 5], [5, 0]], look=2)
        >>> flat.prior.tolist(), flat.look.tolist()
        ([0.5, 0.3], [2.0, 2.0])
    """
    chances = np.asarray(prior, np.float64)
    count, ways = len(chances), np.asarray(travel, np.float64)
    problem = SearchProblem(
        chances,
        np.asarray(reach, np.float64),
        ways.reshape(count, count) if ways.size == count * count else ways,
        np.broadcast_to(np.asarray(look, np.float64), (count,)).copy(),
        np.broadcast_to(np.asarray(detect, np.float64), (count,)).copy(),
    )
    shapes = {"reach": (count,), "travel": (count, count)}
    for name, wanted in shapes.items():
        found = getattr(problem, name).shape
        if found != wanted:
            raise ValueError(f"{name} has shape {found}; with {count} sites, {wanted} is wanted")
    for name, values in problem._asdict().items():
        if not (np.isfinite(values).all() and (values >= 0).all()):
            raise ValueError(f"{name} has a value that is negative or not finite: {values}")
    if sum(chances.tolist()) > 1 + 1e-9 or (problem.detect > 1).any():
        raise ValueError("prior sums to more than one, or detect is above one")
    return problem


def play(problem: SearchProblem, order: Sequence[int]) -> Found:
    """Return when each look of an order is over, and the chance that it is the one that finds.

    A site may stand in the order several times: looks miss independently of each other.

    Example:
        >>> flat = search_problem([0.5, 0.3], [4, 1], [[0, 5], [5, 0]], look=2)
        >>> found = play(flat, [1, 0])
        >>> found.time.tolist(), round(found.mean, 3), round(found.restricted_mean(9), 2)
        ([3.0, 10.0], 7.375, 7.2)
    """
    left = problem.prior.copy()
    now, at = 0.0, -1
    times, chances = [], []
    for site in order:
        way = problem.reach[site] if at < 0 else problem.travel[at, site]
        now += float(way + problem.look[site])
        times.append(now)
        chances.append(float(left[site] * problem.detect[site]))
        left[site] *= 1 - problem.detect[site]
        at = site
    return Found(np.array(times, np.float64), np.array(chances, np.float64))


def clairvoyant_time(problem: SearchProblem) -> float:
    """Return the expected time of who knows the site and goes straight there [s], given it is one.

    No policy does better: it is what others are divided by.
    """
    there = problem.reach + problem.look
    total = sum(problem.prior.tolist())
    weighted = sum((problem.prior * there).tolist())
    return float(weighted / total) if total > 0 else 0.0
