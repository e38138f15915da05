"""Sequential tests of rates: decide whether a test holds in, say, 95 % of trials, with few trials.

This is Wald's sequential probability ratio test, truncated at a number of seeds. Its boundaries are
numbers of failures, so that its error rates are exact sums over binomial paths, not approximations;
the largest rate that it can distinguish from the claimed one follows from the number of seeds.

Wald, A. (1945). Sequential tests of statistical hypotheses. Ann. Math. Statist. 16(2), 117–186.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fleet2d.errors import InputError
from fleet2d.kernels import F64, I64
from fleet2d.runtime.determinism import sum_in_order

MOST_SEEDS = 10_000
BISECTIONS = 14


@dataclass(frozen=True)
class RateTest:
    """A sequential test of a claimed rate.

    Attributes:
        seeds: Largest number of seeds.
        holds: The claimed rate, above 0 and up to 1.
        error: Largest probability of refusing a true claim, and of accepting the alternative.
        alternative: The largest rate that is refused with a probability of at least 1 - `error`.
        accept: int64 (seeds + 1,), the most failures with which the claim is accepted, by number of
            seeds so far; -1 where it can't be accepted yet.
        refuse: int64 (seeds + 1,), the fewest failures with which the claim is refused.

    Example:
        >>> test = rate_test(seeds=100, holds=0.95)
        >>> test.decide(seeds=10, failures=0) is None, test.decide(seeds=100, failures=20)
        (True, False)
    """

    seeds: int
    holds: float
    error: float
    alternative: float
    accept: I64
    refuse: I64

    def decide(self, seeds: int, failures: int) -> bool | None:
        """Return whether the claim is accepted; None while more seeds are needed."""
        if failures >= self.refuse[seeds]:
            return False
        return True if failures <= self.accept[seeds] else None

    def acceptance(self, rate: float) -> float:
        """Return the exact probability that the claim is accepted if this is the true rate."""
        return _walk(self.accept, self.refuse, rate)[0]

    def mean_seeds(self, rate: float) -> float:
        """Return the exact mean number of seeds until a decision if this is the true rate."""
        return sum_in_order(_walk(self.accept, self.refuse, rate)[1])


@lru_cache(maxsize=64)
def rate_test(seeds: int, holds: float = 1.0, error: float = 0.05) -> RateTest:
    """Return the sequential test of a claim.

    Args:
        seeds: Largest number of seeds.
        holds: The claimed rate; 1 claims that every seed holds, and one failure refuses it.
        error: The error rate, for both kinds of error.

    Raises:
        InputError: A number is out of range.
    """
    if not 1 <= seeds <= MOST_SEEDS:
        raise InputError(f"seeds={seeds}: expected 1 to {MOST_SEEDS:,} seeds")
    if not 0 < holds <= 1:
        raise InputError(f"holds={holds}: expected a rate above 0 and up to 1, such as 0.95")
    if not 0 < error < 0.5:
        raise InputError(f"error={error}: expected a rate above 0 and below 0.5, such as 0.05")
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
    if best.alternative == 0:
        fewest = math.floor(math.log(error) / math.log(1 - holds)) + 1
        raise InputError(
            f"seeds={seeds} is too few to test holds={holds:g} with an error of {error:g}: take"
            f" {max(fewest, seeds + 1)} seeds or more"
        )
    return best


def _bounded(seeds: int, holds: float, other: float, error: float) -> RateTest:
    """Return the test of a claimed rate against another one.

    Each of its two errors, to refuse the claim or to accept it wrongly, has at most the probability
    `error`. Half of it is for decisions before the last seed (Ville's inequality), the remainder
    for the decision at the last seed.
    """
    number = np.arange(seeds + 1)
    failure = math.log((1 - other) / (1 - holds))  # evidence of one failure for the other rate
    with np.errstate(divide="ignore"):
        success = float(np.log(holds / other)) if other > 0 else math.inf
    threshold = math.log(2 / error)
    if math.isinf(success):  # one success refutes a rate of 0
        accept, refuse = np.full(seeds + 1, -1), number + 1
    else:
        slope, shift = success / (success + failure), threshold / (success + failure)
        accept = np.floor(slope * number - shift).astype(np.int64).clip(-1)
        refuse = np.minimum(np.ceil(slope * number + shift), seeds + 1).astype(np.int64)
    accept[seeds] = -1
    refuse[seeds] = seeds + 2
    refused, last = _ending(accept, refuse, holds)
    # The fewest failures to refuse at the last seed so that refusals stay within the error.
    tail = refused + np.cumsum(last[::-1])[::-1]  # refusals if that many failures refuse
    most = int(np.argmax(np.append(tail, 0.0) <= error)) - 1
    accept[seeds], refuse[seeds] = most, most + 1
    return RateTest(seeds, holds, error, other, accept, refuse)


def _steps(accept: I64, refuse: I64, rate: float) -> "list[tuple[float, float, F64]]":
    """Return (accepted, refused, undecided by failures) after each seed: exact probabilities."""
    width = int(refuse[:-1].max()) + 2
    failures = np.arange(width)
    undecided = np.zeros(width)
    undecided[0] = 1.0
    steps = []
    for number in range(1, len(accept)):
        mass = undecided * rate
        mass[1:] += undecided[:-1] * (1 - rate)
        is_accepted, is_refused = failures <= accept[number], failures >= refuse[number]
        steps.append((float(mass[is_accepted].sum()), float(mass[is_refused].sum()), mass))
        undecided = np.where(is_accepted | is_refused, 0.0, mass)
    return steps


def _walk(accept: I64, refuse: I64, rate: float) -> tuple[float, list[float]]:
    """Return the probability of acceptance, and the probability that each seed is needed."""
    accepted, undecided = 0.0, 1.0
    needed = []
    for accepted_now, refused_now, _ in _steps(accept, refuse, rate):
        needed.append(undecided)
        accepted += accepted_now
        undecided -= accepted_now + refused_now
    return accepted, needed


def _ending(accept: I64, refuse: I64, rate: float) -> tuple[float, F64]:
    """Return the probability of refusal before the last seed, and of each number of failures."""
    steps = _steps(accept, refuse, rate)
    refused = sum(refused_now for _, refused_now, _ in steps[:-1])
    return refused, steps[-1][2]
