"""Claims about rates: is a test to hold in 95 % of lives judged right, after as few as possible?

The judge is Wald's sequential probability ratio test, cut off at a number of seeds. Its boundaries
are numbers of failures, so that its error rates are exact sums over binomial paths, not
approximations; the rate that it tells from the claimed one follows from the number of seeds.

Wald, A. (1945). Sequential tests of statistical hypotheses. Ann. Math. Statist. 16(2), 117–186.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fleet2d.errors import InputError

MOST_SEEDS = 10_000
BISECTIONS = 14


@dataclass(frozen=True)
class RateTest:
    """When a claim about a rate is decided, and how often wrongly.

    Attributes:
        seeds: How many seeds are looked at, at most.
        holds: The claimed rate, above 0 and up to 1.
        error: How often, at most, a true claim is refused; and a rate of `told_from` accepted.
        told_from: The largest rate that is told from the claimed one with that error.
        accept: The most failures with which the claim is accepted, by seeds looked at: int64
            (seeds + 1,), -1 where it can't be yet.
        refuse: The fewest failures with which it is refused: int64 (seeds + 1,).

    Example:
        >>> test = rate_test(seeds=100, holds=0.95)
        >>> test.decide(seeds=10, failures=0) is None, test.decide(seeds=100, failures=20)
        (True, False)
    """

    seeds: int
    holds: float
    error: float
    told_from: float
    accept: NDArray[np.int64]
    refuse: NDArray[np.int64]

    def decide(self, seeds: int, failures: int) -> bool | None:
        """Return whether the claim is accepted; None while more seeds are needed."""
        if failures >= self.refuse[seeds]:
            return False
        return True if failures <= self.accept[seeds] else None

    def acceptance(self, rate: float) -> float:
        """Return how likely the claim is accepted where the true rate is this; exact."""
        accepted, _ = _walk(self.accept, self.refuse, rate)
        return accepted

    def mean_seeds(self, rate: float) -> float:
        """Return how many seeds it takes on average where the true rate is this; exact."""
        _, undecided = _walk(self.accept, self.refuse, rate)
        return float(sum(undecided))


@lru_cache(maxsize=64)
def rate_test(seeds: int, holds: float = 1.0, error: float = 0.05) -> RateTest:
    """Return the sequential test of a claim.

    Args:
        seeds: How many seeds there are at most.
        holds: The claimed rate; 1 claims that every seed holds, and one failure refuses it.
        error: The error rate, for both kinds of error.

    Raises:
        InputError: A number is out of range.
    """
    if not 1 <= seeds <= MOST_SEEDS:
        raise InputError(f"seeds={seeds}: 1 to {MOST_SEEDS:,} seeds are wanted")
    if not 0 < holds <= 1:
        raise InputError(f"holds={holds}: a rate above 0 and up to 1 is wanted, such as 0.95")
    if not 0 < error < 0.5:
        raise InputError(f"error={error}: a rate above 0 and below 0.5 is wanted, such as 0.05")
    if holds == 1:
        accept = np.full(seeds + 1, -1)
        accept[seeds] = 0
        every = np.ones(seeds + 1, np.int64)
        return RateTest(seeds, holds, error, error ** (1 / seeds), accept, every)
    low, high = 0.0, holds
    best = _bounded(seeds, holds, 0.0, error)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        test = _bounded(seeds, holds, middle, error)
        if test.acceptance(middle) <= error:
            low, best = middle, test
        else:
            high = middle
    if best.told_from == 0:
        fewest = math.floor(math.log(error) / math.log(1 - holds)) + 1
        raise InputError(
            f"seeds={seeds} can't refuse holds={holds:g} with an error of {error:g} at most: take"
            f" {max(fewest, seeds + 1)} seeds or more"
        )
    return best


def _bounded(seeds: int, holds: float, other: float, error: float) -> RateTest:
    """Return the test of a claimed rate against another, which never refuses truth too often.

    Boundaries before the last seed each spend half of the error at most (Ville's inequality);
    the one at the last seed spends what is left.
    """
    number = np.arange(seeds + 1)
    likelier = math.log((1 - other) / (1 - holds))  # by which a failure speaks for the other rate
    with np.errstate(divide="ignore"):
        held = float(np.log(holds / other)) if other > 0 else math.inf
    enough = math.log(2 / error)
    if math.isinf(held):  # one that holds refutes a rate of 0
        accept, refuse = np.full(seeds + 1, -1), number + 1
    else:
        slope, shift = held / (held + likelier), enough / (held + likelier)
        accept = np.floor(slope * number - shift).astype(np.int64).clip(-1)
        refuse = np.minimum(np.ceil(slope * number + shift), seeds + 1).astype(np.int64)
    accept[seeds] = -1
    refuse[seeds] = seeds + 2
    refused, last = _ending(accept, refuse, holds)
    # The most failures at the last seed with which truth is refused no oftener than it may be.
    tail = refused + np.cumsum(last[::-1])[::-1]  # refused if so many failures are too many
    most = int(np.argmax(np.append(tail, 0.0) <= error)) - 1
    accept[seeds], refuse[seeds] = most, most + 1
    return RateTest(seeds, holds, error, other, accept, refuse)


def _steps(
    accept: NDArray[np.int64], refuse: NDArray[np.int64], rate: float
) -> "list[tuple[float, float, NDArray[np.float64]]]":
    """Return (accepted, refused, undecided by failures) after each seed: exact probabilities."""
    width = int(refuse[:-1].max()) + 2
    failures = np.arange(width)
    undecided = np.zeros(width)
    undecided[0] = 1.0
    steps = []
    for number in range(1, len(accept)):
        moved = undecided * rate
        moved[1:] += undecided[:-1] * (1 - rate)
        is_accepted, is_refused = failures <= accept[number], failures >= refuse[number]
        steps.append((float(moved[is_accepted].sum()), float(moved[is_refused].sum()), moved))
        undecided = np.where(is_accepted | is_refused, 0.0, moved)
    return steps


def _walk(
    accept: NDArray[np.int64], refuse: NDArray[np.int64], rate: float
) -> tuple[float, list[float]]:
    """Return how likely acceptance is, and how likely each seed is needed."""
    accepted, going = 0.0, 1.0
    needed = []
    for yes, no, _ in _steps(accept, refuse, rate):
        needed.append(going)
        accepted += yes
        going -= yes + no
    return accepted, needed


def _ending(
    accept: NDArray[np.int64], refuse: NDArray[np.int64], rate: float
) -> tuple[float, NDArray[np.float64]]:
    """Return how likely refusal before the last seed is, and failures at the last by number."""
    steps = _steps(accept, refuse, rate)
    refused = sum(no for _, no, _ in steps[:-1])
    return refused, steps[-1][2]
