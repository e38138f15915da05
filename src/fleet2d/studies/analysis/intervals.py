"""Means with intervals over homes, people and seeds, by a hierarchical bootstrap.

Each value belongs to one home and one seed (or more such levels). Seeds are crossed with homes: a
seed is the same life in each home. Each resample draws homes and seeds with replacement (the
pigeonhole bootstrap, Owen 2007). With few homes or seeds the shape of their distribution is right
but not its width. So deviations are scaled to the variance that an analysis of variance estimates
without bias, and widened as Student's t is for its degrees of freedom (Satterthwaite).
"""

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fleet2d.extras import extra
from fleet2d.kernels import F64, I64
from fleet2d.sums import sum_in_order

LEVEL = 0.95
RESAMPLES = 2000
POWER_Z = 0.84  # standard normal quantile of a power of 80 %
MOST_NEEDED = 10_000  # units of a level
BLOCK = 4_000_000  # largest number of weights in memory


@dataclass(frozen=True)
class Spread:
    """The variance of values, by level.

    Attributes:
        units: The number of units of each level, such as homes.
        components: The variance between the units of a level.
        residual: The variance of a single value beyond that.
        values: The number of values.
    """

    units: Mapping[str, int]
    components: Mapping[str, float]
    residual: float
    values: int

    def detects(self, size: float, units: Mapping[str, int]) -> bool:
        """Return whether this sample size detects a mean of `size` with a power of 80 %.

        Args:
            size: The mean.
            units: The number of units of each level.
        """
        parts = [(self.components[level] / n, n - 1) for level, n in units.items()]
        parts.append((self.residual / math.prod(units.values()), max(units.values()) - 1))
        variance = sum_in_order(part for part, _ in parts)
        if not variance:
            return True
        freedom = variance**2 / sum_in_order(part**2 / df for part, df in parts)
        return math.sqrt(variance) * (_student_quantile(freedom, LEVEL) + POWER_Z) <= abs(size)


@dataclass(frozen=True)
class MeanEstimate:
    """A mean, with its interval.

    Attributes:
        mean: The mean.
        low: The lower end of the interval; NaN if there is one value only.
        high: The upper end.
        error: The standard error.
        freedom: Degrees of freedom.
        spread: The variance of the values by level.
    """

    mean: float
    low: float = math.nan
    high: float = math.nan
    error: float = math.nan
    freedom: float = math.nan
    spread: Spread = field(default_factory=lambda: Spread({}, {}, 0.0, 1))

    @property
    def is_clear(self) -> bool:
        """Whether the interval excludes zero."""
        return self.low > 0 or self.high < 0

    def needed(self) -> dict[str, int]:
        """Return for each level how many units are needed to show that the mean isn't zero.

        Each number is for one level while the others stay as they are; levels of which no number
        is enough are missing. The power is 80 %.
        """
        counts: dict[str, int] = {}
        for level, current in self.spread.units.items():

            def is_enough(count: int, level: str = level) -> bool:
                return self.spread.detects(self.mean, {**self.spread.units, level: count})

            if current >= 2 and is_enough(MOST_NEEDED):
                count = bisect_left(range(MOST_NEEDED), True, lo=2, key=is_enough)
                counts[level] = max(count, current + 1)
        return counts


def estimate(
    values: Sequence[float] | F64,
    levels: Mapping[str, Sequence[Any]] | None = None,
    *,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
) -> MeanEstimate:
    """Return the mean of values and its interval over the units that they belong to.

    Args:
        values: One for each combination of units, such as home and seed.
        levels: For each level the unit of each value; None: each value is a unit of its own.
        level: The share of studies whose interval contains the true mean.
        resamples: The number of resamples; they are the same at each call.

    Example:
        >>> score = estimate([1.0, 2.0, 4.0], {"seed": [0, 1, 2]})
        >>> round(score.mean, 2), score.spread.units
        (2.33, {'seed': 3})
    """
    data: F64 = np.asarray(values, np.float64)
    if not len(data):
        return MeanEstimate(math.nan)
    codes = _codes(levels if levels else {"value": range(len(data))}, len(data))
    mean = float(data.mean())
    if not codes:
        return MeanEstimate(mean)
    spread, variance, freedom = _analyse(data, codes)
    if variance <= 0 or not np.ptp(data):
        return MeanEstimate(mean, mean, mean, 0.0, freedom, spread)
    deviations = _resampled_means(data, list(codes.values()), resamples) - mean
    error = math.sqrt(variance)
    widening = _student_quantile(freedom, level) / _normal_quantile(level)
    scale = widening * error / max(float(deviations.std()), 1e-300)
    low, high = np.quantile(deviations, [(1 - level) / 2, (1 + level) / 2]) * scale
    return MeanEstimate(mean, mean + float(low), mean + float(high), error, freedom, spread)


def _codes(levels: Mapping[str, Sequence[Any]], count: int) -> dict[str, I64]:
    """Return the number of the unit of each value, by level: int64 (values,).

    Levels with one unit are left out, as are levels with a unit for each value unless there is no
    other: the units of the other levels vary with it.
    """
    codes = {}
    for name, labels in levels.items():
        texts = np.array([repr(label) for label in labels])
        units, numbers = np.unique(texts, return_inverse=True)
        if len(units) > 1:
            codes[name] = numbers.astype(np.int64)
    crossed = {name: numbers for name, numbers in codes.items() if numbers.max() + 1 < count}
    return crossed or dict(list(codes.items())[-1:])


def _analyse(data: F64, codes: Mapping[str, I64]) -> tuple[Spread, float, float]:
    """Return variance components, the variance of the mean, and its degrees of freedom."""
    count, units = len(data), {name: int(numbers.max()) + 1 for name, numbers in codes.items()}
    if len(codes) == 1:
        ((name, numbers),) = codes.items()
        means = _unit_means(data, numbers)
        variance = float(means.var(ddof=1)) / len(means)
        within_units = float(((data - means[numbers]) ** 2).sum()) / max(count - len(means), 1)
        between_units = max(0.0, float(means.var(ddof=1)) - within_units * len(means) / count)
        return Spread(units, {name: between_units}, within_units, count), variance, len(means) - 1.0
    residuals, squares = data - data.mean(), {}
    for name, numbers in codes.items():
        means = _unit_means(data, numbers)
        squares[name] = float(means.var(ddof=1)) / len(means)
        residuals = residuals - (means[numbers] - data.mean())
    residual_freedom = max(count - 1 - sum(n - 1 for n in units.values()), 1)
    residual = float((residuals**2).sum()) / residual_freedom
    share = residual / count
    variance = max(sum_in_order(squares.values()) - (len(codes) - 1) * share, share)
    parts = [(square, units[name] - 1.0) for name, square in squares.items()]
    parts.append(((len(codes) - 1) * share, float(residual_freedom)))
    freedom = variance**2 / max(sum_in_order(part**2 / df for part, df in parts), 1e-300)
    freedom = max(freedom, min(units.values()) - 1.0)
    components = {name: max(0.0, (squares[name] - share) * units[name]) for name in codes}
    return Spread(units, components, residual, count), variance, freedom


def _unit_means(data: F64, numbers: I64) -> F64:
    return np.bincount(numbers, data) / np.bincount(numbers)


def _resampled_means(data: F64, codes: list[I64], resamples: int) -> F64:
    """Return the means of resamples: float64 (resamples,)."""
    generator = np.random.Generator(np.random.Philox(key=0))
    blocks: list[F64] = []
    remaining = resamples
    while remaining:
        block = max(1, min(remaining, BLOCK // len(data)))
        weights = np.ones((block, len(data)))
        for numbers in codes:
            units = int(numbers.max()) + 1
            counts = generator.multinomial(units, np.full(units, 1 / units), block)
            weights *= counts[:, numbers]
        sums = weights.sum(axis=1)
        means = np.divide(weights @ data, sums, out=np.full(block, data.mean()), where=sums > 0)
        blocks.append(means)
        remaining -= block
    return np.concatenate(blocks)


def _normal_quantile(level: float) -> float:
    from statistics import NormalDist

    return NormalDist().inv_cdf((1 + level) / 2)


def _student_quantile(freedom: float, level: float) -> float:
    with extra("study", "intervals need scipy"):
        from scipy.stats import t
    return float(t.ppf((1 + level) / 2, freedom))
