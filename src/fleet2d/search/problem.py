"""The search problem: probabilities of sites, travel times, and the outcome of an order of looks.

A target stays at one of n sites, or is at none of them. A look takes time; when it ends at the
target's site, it detects the target with a known probability. To minimize the expected time of
detection is the graph search problem (Li and Chong 2009); with equal probabilities it is that of
the traveling deliveryman, or minimum latency (Kulich and others, ECMR 2017).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fleet2d.kernels import F64
from fleet2d.runtime.determinism import sum_in_order


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


class SearchOutcome(NamedTuple):
    """The distribution of the time of detection for an order of looks.

    Attributes:
        time: When each look ends [s], float64 (looks,).
        chance: Probability that the target is first found by each look, float64 (looks,).
    """

    time: F64
    chance: F64

    @property
    def cost(self) -> float:
        """Sum of time times chance [s], by which the orders of all sites are compared."""
        return float(
            sum_in_order(
                t * p for t, p in zip(self.time.tolist(), self.chance.tolist(), strict=True)
            )
        )

    @property
    def success(self) -> float:
        """Probability that the target is found at all."""
        return sum_in_order(self.chance.tolist())

    @property
    def mean(self) -> float:
        """Expected time of detection, given that the target is found [s]; 0 if it never is."""
        return self.cost / self.success if self.success > 0 else 0.0

    def restricted_mean(self, deadline: float) -> float:
        """Return the expected time until the target is found or the deadline is reached [s]."""
        inside = self.time <= deadline
        chances, times = self.chance[inside].tolist(), self.time[inside].tolist()
        before_deadline = sum_in_order(t * p for t, p in zip(times, chances, strict=True))
        return float(before_deadline + deadline * (1 - sum_in_order(chances)))


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
    count, ways = len(chances), np.asarray(travel, np.float64)
    problem = SearchProblem(
        chances,
        np.asarray(reach, np.float64),
        ways.reshape(count, count) if ways.size == count * count else ways,
        np.broadcast_to(np.asarray(look, np.float64), (count,)).copy(),
        np.broadcast_to(np.asarray(detect, np.float64), (count,)).copy(),
    )
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


def play(problem: SearchProblem, order: Sequence[int]) -> SearchOutcome:
    """Return when each look of an order ends, and the probability that it finds the target.

    A site may be in the order several times: the outcomes of looks are independent.

    Example:
        >>> flat = search_problem([0.5, 0.3], [4, 1], [[0, 5], [5, 0]], look=2)
        >>> outcome = play(flat, [1, 0])
        >>> outcome.time.tolist(), round(outcome.mean, 3), round(outcome.restricted_mean(9), 2)
        ([3.0, 10.0], 7.375, 7.2)
    """
    undetected = problem.prior.copy()  # the target is at the site, and no look has found it
    now, at = 0.0, -1
    times, chances = [], []
    for site in order:
        way = problem.reach[site] if at < 0 else problem.travel[at, site]
        now += float(way + problem.look[site])
        times.append(now)
        chances.append(float(undetected[site] * problem.detect[site]))
        undetected[site] *= 1 - problem.detect[site]
        at = site
    return SearchOutcome(np.array(times, np.float64), np.array(chances, np.float64))


def clairvoyant_time(problem: SearchProblem) -> float:
    """Return the expected time of a searcher who knows the target's site [s].

    The target is assumed to be at one of the sites. No policy is faster: times of policies are
    compared with it by division.
    """
    direct = problem.reach + problem.look
    total = sum_in_order(problem.prior.tolist())
    weighted = sum_in_order((problem.prior * direct).tolist())
    return float(weighted / total) if total > 0 else 0.0
