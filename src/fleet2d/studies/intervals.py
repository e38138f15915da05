"""Means with intervals over homes, people and seeds, by a hierarchical bootstrap.

A value stands for one home with one seed (or more such levels). Seeds are crossed with homes: a
seed is the same life in each. Each resample draws homes and seeds with replacement (the pigeonhole
bootstrap, Owen 2007). It has the right shape but not the right width with few homes or seeds, so
its deviations are scaled to the variance that an analysis of variance estimates without bias, and
widened as Student's t does for its degrees of freedom (Satterthwaite).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.errors import InputError

F64 = NDArray[np.float64]
LEVEL = 0.95
RESAMPLES = 2000
POWER_Z = 0.84  # standard normal quantile of a power of 80 %
MOST_NEEDED = 10_000
BLOCK = 4_000_000  # cells of a matrix of weights at a time


@dataclass(frozen=True)
class Spread:
    """How values vary, by level.

    Attributes:
        units: How many there are of each level, such as homes.
        components: The variance between the units of a level.
        residual: The variance of a single value beside that.
        values: How many values there are.
    """

    units: Mapping[str, int]
    components: Mapping[str, float]
    residual: float
    values: int

    def shows(self, size: float, units: Mapping[str, int]) -> bool:
        """Return whether so many units would show a mean of a size to differ from zero.

        In four of five such studies they would: a power of 80 %.
        """
        parts = [(self.components[level] / n, n - 1) for level, n in units.items()]
        parts.append((self.residual / math.prod(units.values()), max(units.values()) - 1))
        variance = sum(part for part, _ in parts)
        if not variance:
            return True
        freedom = variance**2 / sum(part**2 / df for part, df in parts)
        return math.sqrt(variance) * (_student_quantile(freedom, LEVEL) + POWER_Z) <= abs(size)


@dataclass(frozen=True)
class Estimate:
    """A mean, with its interval.

    Attributes:
        mean: The mean.
        low: The lower end of the interval; NaN if there is one value only.
        high: The upper end.
        error: The standard error.
        freedom: Degrees of freedom.
        spread: How the values vary.
    """

    mean: float
    low: float = math.nan
    high: float = math.nan
    error: float = math.nan
    freedom: float = math.nan
    spread: Spread = field(default_factory=lambda: Spread({}, {}, 0.0, 1))

    @property
    def is_clear(self) -> bool:
        """Whether the interval leaves zero out."""
        return self.low > 0 or self.high < 0

    def needed(self) -> dict[str, int]:
        """Return how many units of a level would show the mean to differ from zero.

        Each number is that of one level, the others staying as they are; a level that can't do it
        alone is missing. With so many, four of five such studies show a mean of this size.
        """
        counts: dict[str, int] = {}
        for level, now in self.spread.units.items():

            def enough(count: int, level: str = level) -> bool:
                return self.spread.shows(self.mean, {**self.spread.units, level: count})

            if now < 2 or not enough(MOST_NEEDED):
                continue
            low, high = 2, MOST_NEEDED
            while low < high:
                middle = (low + high) // 2
                low, high = (low, middle) if enough(middle) else (middle + 1, high)
            counts[level] = max(low, now + 1)
        return counts


def estimate(
    values: Sequence[float] | F64,
    levels: Mapping[str, Sequence[Any]] | None = None,
    *,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
) -> Estimate:
    """Return the mean of values and its interval over the units that they belong to.

    Args:
        values: One for each combination of units, such as home and seed.
        levels: For each level the unit of each value; left out: each value is a unit.
        level: How often the interval is to hold the true mean.
        resamples: How many resamples are drawn; the same at each call.

    Example:
        >>> found = estimate([1.0, 2.0, 4.0], {"seed": [0, 1, 2]})
        >>> round(found.mean, 2), found.spread.units
        (2.33, {'seed': 3})
    """
    data: F64 = np.asarray(values, np.float64)
    if not len(data):
        return Estimate(math.nan)
    codes = _codes(levels if levels else {"value": range(len(data))}, len(data))
    mean = float(data.mean())
    if not codes:
        return Estimate(mean)
    spread, variance, freedom = _analyse(data, codes)
    if variance <= 0 or not np.ptp(data):
        return Estimate(mean, mean, mean, 0.0, freedom, spread)
    deviations = _resampled_means(data, list(codes.values()), resamples) - mean
    error = math.sqrt(variance)
    widening = _student_quantile(freedom, level) / _normal_quantile(level)
    scale = widening * error / max(float(deviations.std()), 1e-300)
    low, high = np.quantile(deviations, [(1 - level) / 2, (1 + level) / 2]) * scale
    return Estimate(mean, mean + float(low), mean + float(high), error, freedom, spread)


def _codes(levels: Mapping[str, Sequence[Any]], count: int) -> dict[str, NDArray[np.int64]]:
    """Return the unit of each value as a number, by level; without levels of one unit."""
    codes = {}
    for name, labels in levels.items():
        texts = np.array([repr(label) for label in labels])
        units, own = np.unique(texts, return_inverse=True)
        if len(units) > 1:
            codes[name] = own.astype(np.int64)
    crossed = {name: own for name, own in codes.items() if own.max() + 1 < count}
    # A level with a unit for each value is below all others: their units vary with it.
    return crossed or dict(list(codes.items())[-1:])


def _analyse(data: F64, codes: Mapping[str, NDArray[np.int64]]) -> tuple[Spread, float, float]:
    """Return variance components, the variance of the mean, and its degrees of freedom."""
    count, units = len(data), {name: int(own.max()) + 1 for name, own in codes.items()}
    if len(codes) == 1:
        ((name, own),) = codes.items()
        means = _unit_means(data, own)
        variance = float(means.var(ddof=1)) / len(means)
        within = float(((data - means[own]) ** 2).sum()) / max(count - len(means), 1)
        between = max(0.0, float(means.var(ddof=1)) - within * len(means) / count)
        return Spread(units, {name: between}, within, count), variance, len(means) - 1.0
    residuals, squares = data - data.mean(), {}
    for name, own in codes.items():
        means = _unit_means(data, own)
        squares[name] = float(means.var(ddof=1)) / len(means)
        residuals = residuals - (means[own] - data.mean())
    left = max(count - 1 - sum(n - 1 for n in units.values()), 1)
    residual = float((residuals**2).sum()) / left
    share = residual / count
    variance = max(sum(squares.values()) - (len(codes) - 1) * share, share)
    parts = [(square, units[name] - 1.0) for name, square in squares.items()]
    parts.append(((len(codes) - 1) * share, float(left)))
    freedom = variance**2 / max(sum(part**2 / df for part, df in parts), 1e-300)
    freedom = max(freedom, min(units.values()) - 1.0)
    components = {name: max(0.0, (squares[name] - share) * units[name]) for name in codes}
    return Spread(units, components, residual, count), variance, freedom


def _unit_means(data: F64, own: NDArray[np.int64]) -> F64:
    sums: F64 = np.bincount(own, data) / np.bincount(own)
    return sums


def _resampled_means(data: F64, codes: list[NDArray[np.int64]], resamples: int) -> F64:
    """Return the means of resamples: float64 (resamples,)."""
    generator = np.random.Generator(np.random.Philox(key=0))
    found: list[F64] = []
    left = resamples
    while left:
        block = max(1, min(left, BLOCK // len(data)))
        weights = np.ones((block, len(data)))
        for own in codes:
            units = int(own.max()) + 1
            counts = generator.multinomial(units, np.full(units, 1 / units), block)
            weights *= counts[:, own]
        sums = weights.sum(axis=1)
        means = np.divide(weights @ data, sums, out=np.full(block, data.mean()), where=sums > 0)
        found.append(means)
        left -= block
    return np.concatenate(found)


def _normal_quantile(level: float = LEVEL) -> float:
    from statistics import NormalDist

    return NormalDist().inv_cdf((1 + level) / 2)


def _student_quantile(freedom: float, level: float) -> float:
    try:
        from scipy.stats import t
    except ImportError:
        raise InputError('intervals need scipy: pip install "fleet2d[study]"') from None
    return float(t.ppf((1 + level) / 2, freedom))
