"""Distributions of durations and times of day, as tables of quantiles: the same on every machine.

A distribution is stored as its quantiles at (i + 1/2) / KNOTS, in whole seconds, with linear
interpolation. A draw within bounds inverts that curve between them: nothing is rejected, and the
result has the conditional distribution. The tables are computed by + - * / and sqrt only.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import accumulate, pairwise
from typing import NamedTuple

from fleet2d.runtime.determinism import Draws, exp2, sum_in_order

KNOTS = 128
_BITS = 24
_ONE = 1 << _BITS
_LN2 = 0.6931471805599453

# Quantiles of the normal distribution at (64.5, 65.5, … 127.5) / 128, in 1e-5 standard deviations.
_BELL = (
    979, 2938, 4898, 6859, 8824, 10792, 12764, 14740, 16723, 18713, 20709, 22714, 24729, 26753,
    28788, 30835, 32896, 34970, 37060, 39166, 41289, 43431, 45593, 47777, 49984, 52215, 54473,
    56759, 59075, 61423, 63806, 66225, 68683, 71184, 73730, 76325, 78973, 81677, 84442, 87273,
    90175, 93156, 96222, 99382, 102643, 106018, 109518, 113158, 116954, 120926, 125099, 129502,
    134172, 139154, 144507, 150310, 156669, 163733, 171723, 180989, 192135, 206353, 226623,
    266007,
)  # fmt: skip
NORMAL = tuple(-z / 1e5 for z in reversed(_BELL)) + tuple(z / 1e5 for z in _BELL)
"""Standard normal quantiles, -2.66 to 2.66: a normal distribution is cut there."""


class Distribution(NamedTuple):
    """A distribution over whole seconds.

    Attributes:
        knots: Quantiles at evenly spaced probabilities, ascending [s].
        shortest: The smallest value that is drawn [s].
        longest: The largest value that is drawn [s].
        first: The position of `shortest` among the knots.
        last: The position of `longest` among them.

    Example:
        >>> from fleet2d.runtime.determinism import Draws, stream_key
        >>> duration = lognormal(1800, 600)
        >>> draws = Draws(stream_key(4, "users.ana", "doc"), 0)
        >>> [duration.draw(draws) for _ in range(4)], duration.draw(draws, 0, 900)
        ([1997, 1522, 2191, 1736], 812)
    """

    knots: tuple[int, ...]
    shortest: int
    longest: int
    first: int
    last: int

    def draw(self, draws: Draws, low: int | None = None, high: int | None = None) -> int:
        """Draw a value from the distribution, conditional on being from `low` to `high` [s].

        If there are no values between them, the result is the bound that is nearer to the values.
        """
        first, last = self.first, self.last
        if low is None or low <= self.shortest:
            low = self.shortest
        else:
            first = position(self.knots, low)
        if high is None or high >= self.longest:
            high = self.longest
        else:
            last = position(self.knots, high)
        if low >= high:
            return min(low, high) if high < self.shortest else low
        if first >= last:
            return low if low >= self.knots[-1] else high
        at = first + draws.below(last - first)
        i = at >> _BITS
        below = self.knots[i]
        above = self.knots[i + 1]
        value = below + ((above - below) * (at & (_ONE - 1)) >> _BITS)
        return min(max(value, low), high)

    def quantiles(self, count: int) -> list[int]:
        """Return evenly spaced quantiles between the bounds, at (i + 1/2) / count [s].

        >>> uniform(0, 80).quantiles(4)
        [10, 30, 50, 70]
        """
        first = self.first
        wide = self.last - first
        last = len(self.knots) - 1
        values = []
        for k in range(count):
            i, part = divmod(first + wide * (2 * k + 1) // (2 * count), _ONE)
            below = self.knots[i]
            above = self.knots[min(i + 1, last)]
            value = below + ((above - below) * part >> _BITS)
            values.append(min(max(value, self.shortest), self.longest))
        return values

    def mean(self) -> float:
        """Return the mean of the distribution between its bounds [s]."""
        inside = [min(max(knot, self.shortest), self.longest) for knot in self.knots]
        return sum_in_order((a + b) / 2 for a, b in pairwise(inside)) / (len(inside) - 1)

    def within(self, shortest: int | None, longest: int | None) -> "Distribution":
        """Return the distribution cut to bounds [s]."""
        return _bounded(
            self.knots,
            self.shortest if shortest is None else shortest,
            self.longest if longest is None else longest,
        )


def position(knots: Sequence[int], value: int) -> int:
    """Return the fractional index of a value among the knots, in units of 2**-24."""
    i = bisect_right(knots, value) - 1
    if i < 0:
        return 0
    if i >= len(knots) - 1:
        return (len(knots) - 1) << _BITS
    return (i << _BITS) + ((value - knots[i]) << _BITS) // (knots[i + 1] - knots[i])


def _bounded(knots: tuple[int, ...], shortest: int, longest: int) -> Distribution:
    """Return the distribution of knots between two bounds."""
    return Distribution(
        knots, shortest, longest, position(knots, shortest), position(knots, longest)
    )


def _from_normal(quantile: Callable[[float], float]) -> Distribution:
    """Return the distribution whose quantiles are a function of standard normal ones."""
    knots = tuple(accumulate((max(int(quantile(z) + 0.5), 0) for z in NORMAL), max))
    return _bounded(knots, knots[0], knots[-1])


@lru_cache(None)
def lognormal(mean_s: float, std_s: float) -> Distribution:
    """Return the lognormal distribution of a mean and a standard deviation [s]."""
    ratio = std_s / mean_s
    variance = log(1 + ratio * ratio)
    sigma = math.sqrt(variance)
    middle = mean_s / math.sqrt(1 + ratio * ratio)
    return _from_normal(lambda z: middle * exp2(sigma * z / _LN2))


@lru_cache(None)
def gamma(mean_s: float, std_s: float) -> Distribution:
    """Return the gamma distribution of a mean and a standard deviation [s] (Wilson, Hilferty)."""
    ninth = (std_s / mean_s) * (std_s / mean_s) / 9  # 1 / (9 k), k the shape

    def quantile(z: float) -> float:
        root = max(1 - ninth + z * math.sqrt(ninth), 0.0)
        return mean_s * root * root * root

    return _from_normal(quantile)


@lru_cache(None)
def normal(mean_s: float, std_s: float) -> Distribution:
    """Return the normal distribution of a mean and a standard deviation [s], cut at 0."""
    return _from_normal(lambda z: max(mean_s + std_s * z, 0.0))


@lru_cache(None)
def exponential(mean_s: float) -> Distribution:
    """Return the exponential distribution of a mean [s]: times between events at random."""
    knots = [int(-mean_s * log((KNOTS - i - 0.5) / KNOTS) + 0.5) for i in range(KNOTS)]
    return _bounded(tuple(knots), knots[0], knots[-1])


def uniform(low_s: int, high_s: int) -> Distribution:
    """Return the uniform distribution of whole seconds from `low_s` to `high_s`."""
    return _bounded((low_s, high_s), low_s, high_s)


def empirical(quantiles: Sequence[int]) -> Distribution:
    """Return the distribution with quantiles at evenly spaced probabilities from 0 to 1 [s]."""
    return _bounded(tuple(quantiles), quantiles[0], quantiles[-1])


def draw_weighted(draws: Draws, weights: Sequence[int]) -> int:
    """Draw an index of `weights` with a probability proportional to its weight.

    Args:
        draws: The random draws.
        weights: Whole numbers from 0 on, not all 0.

    >>> from fleet2d.runtime.determinism import Draws, stream_key
    >>> draws = Draws(stream_key(4, "users.ana", "doc"), 0)
    >>> [draw_weighted(draws, [0, 8, 0]) for _ in range(8)]
    [1, 1, 1, 1, 1, 1, 1, 1]
    """
    sums = list(accumulate(weights))
    return bisect_right(sums, draws.below(sums[-1]))


def log(x: float) -> float:
    """Return the natural logarithm of x > 0, using only + - * /: the same on every machine.

    >>> round(log(10.0), 12), round(log(0.05), 12)
    (2.302585092994, -2.995732273554)
    """
    halvings = 0
    while x > 1.5:
        x = x / 2
        halvings = halvings + 1
    while x < 0.75:
        x = x * 2
        halvings = halvings - 1
    ratio = (x - 1) / (x + 1)
    square = ratio * ratio
    power = ratio
    total = 0.0
    for n in range(1, 40, 2):
        total += power / n
        power *= square
    return 2 * total + halvings * _LN2
