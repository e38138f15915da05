"""What an order of looks is worth, look by look."""

from typing import NamedTuple

import numpy as np


class SearchOutcome(NamedTuple):
    """When each look ends [s], and the probability that the target is first found by it."""

    time: list[float]
    chance: list[float]

    @property
    def cost(self):
        """Sum of time times chance [s], by which the orders of all sites are compared."""
        return float(np.dot(self.time, self.chance))

    @property
    def success(self):
        """Probability that the target is found at all."""
        return sum(self.chance)


def play(problem, order):
    """Return the outcome of an order, in which a site may be several times."""
    undetected = problem.prior.copy()  # the target is at the site, and no look has found it
    now = 0.0
    at = None
    outcome = SearchOutcome([], [])
    for site in order:
        now += float(problem.reach[site] if at is None else problem.travel[at, site])
        now += float(problem.look[site])
        outcome.time.append(now)
        outcome.chance.append(float(undetected[site] * problem.detect[site]))
        undetected[site] *= 1 - problem.detect[site]
        at = site
    return outcome
