"""Means with intervals over units such as homes and seeds, p values, and the power of a study.

Each end of an interval lies between that of Student's t and the same after Hall's transformation,
which corrects for skewness (Hall 1992, On the removal of skewness by transformation, Journal of
the Royal Statistical Society B 54), three quarters of the way to the wider one. The first alone
misses the mean of skewed units too often, the second alone that of units with outliers on both
sides; the wider one contains that of rare large values too often.
The standard error is that of a random-effects analysis of variance of crossed units, with the
degrees of freedom of Satterthwaite (1946, Biometrics Bulletin 2).

Where there are too few units to trust an interval, the estimate has a doubt. Few units still tell
whether most of them are above zero, by the exact sign test. `benchmarks/intervals.py` measures how
often intervals contain the true mean.
"""

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fleet2d.errors import extra
from fleet2d.kernels import F64, I64
from fleet2d.runtime.determinism import sum_in_order

LEVEL = 0.95
POWER = 0.8
MAX_NEEDED_UNITS = 10_000  # units of a level
RARE = 0.1  # the share of a rare kind of units that a study should include
ENOUGH_UNITS = math.ceil(math.log(1 - LEVEL) / math.log(1 - RARE))  # include it in 95 %
MINOR = 0.1  # a level with a smaller share of the variance of the mean may have few units
ROUNDING = 1e-9  # differences up to here, relative to the values, are rounding errors
MIN_FREEDOM = 2.0  # with less, the skewness of units can't be estimated
# The weight of the wider of the two ends, that of Hall and that of Student's t.
WIDER = 0.75
MIN_SKEWNESS = 1e-6  # for a smaller one, Hall's transformation is the identity


Limits = tuple[float, float]
"""The least and the largest value of a number."""
UNLIMITED = (-math.inf, math.inf)


@dataclass(frozen=True)
class Spread:
    """The variance of values, by level.

    Attributes:
        units: The number of units of each level, such as homes.
        components: The variance between the units of a level.
        residual: The residual variance of a single value.
        values: The number of values.
    """

    units: Mapping[str, int]
    components: Mapping[str, float]
    residual: float
    values: int

    def detectable(
        self, units: Mapping[str, int], power: float = POWER, level: float = LEVEL
    ) -> float:
        """Return the smallest mean that a study of this size detects with a given power.

        Args:
            units: The number of units of each level, 2 or more.
            power: The share of such studies in which the interval excludes zero.
            level: The level of that interval.

        Example:
            >>> spread = Spread({"home": 5}, {"home": 1.0}, 0.0, 5)
            >>> round(spread.detectable({"home": 30}), 2)
            0.53
        """
        from statistics import NormalDist

        counts = units.values()
        variances = [self.components[kind] / count for kind, count in units.items()]
        variances.append(self.residual / math.prod(counts))
        variance = sum_in_order(variances)
        if not variance:
            return 0.0
        freedom = satterthwaite(variances, [*(count - 1 for count in counts), max(counts) - 1])
        quantiles = student_quantile(freedom, level) + NormalDist().inv_cdf(power)
        return math.sqrt(variance) * quantiles

    def needed(
        self,
        size: float,
        kind: str,
        power: float = POWER,
        *,
        level: float = LEVEL,
        units: Mapping[str, int] | None = None,
    ) -> int | None:
        """Return how many units of a kind distinguish a mean of `size` from zero; None: none do.

        Args:
            size: The mean.
            kind: The level whose units are counted, such as `home`.
            power: The share of such studies in which the interval excludes zero.
            level: The level of that interval.
            units: The number of units of other kinds, where it isn't the present one.
        """
        others = {**self.units, **(units or {})}

        def is_enough(count: int) -> bool:
            return self.detectable({**others, kind: count}, power, level) <= abs(size)

        if not is_enough(MAX_NEEDED_UNITS):
            return None
        return bisect_left(range(MAX_NEEDED_UNITS), True, lo=2, key=is_enough)


@dataclass(frozen=True)
class MeanEstimate:
    """A mean, with its interval.

    Attributes:
        mean: The mean.
        doubt: Why the interval can't be trusted, or why there is none; empty if it can.
        error: The standard error.
        freedom: Degrees of freedom.
        skewness: The skewness of the mean, estimated from that of the units.
        spread: The variance of the values by level.
        signs: The numbers of units above and below zero, by level, of levels with too few units.
        limits: The least and the largest mean that are possible.
    """

    mean: float
    doubt: str = ""
    error: float = math.nan
    freedom: float = math.nan
    skewness: float = 0.0
    spread: Spread = field(default_factory=lambda: Spread({}, {}, 0.0, 1))
    signs: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    limits: Limits = UNLIMITED

    @property
    def low(self) -> float:
        """The lower end of the 95 % interval; NaN if values don't differ, or there is one only."""
        return self.interval()[0]

    @property
    def high(self) -> float:
        """The upper end of the 95 % interval; NaN likewise."""
        return self.interval()[1]

    def interval(self, level: float = LEVEL) -> Limits:
        """Return the interval that contains the true mean in a share `level` of studies."""
        if not self.error > 0:
            return math.nan, math.nan
        quantile = student_quantile(self.freedom, level)
        low = self.mean - self.error * _reach(quantile, self.skewness)
        high = self.mean + self.error * _reach(quantile, -self.skewness)
        least, largest = self.limits
        return max(low, least), min(high, largest)

    @property
    def is_clear(self) -> bool:
        """Whether the interval excludes zero."""
        return self.low > 0 or self.high < 0

    @property
    def p_value(self) -> float:
        """The p value of a mean of zero: below 5 % exactly if the 95 % interval excludes zero.

        If all values are equal, it is that of the sign test; NaN for a single value.
        """
        if self.error == 0:
            return self.sign_p
        with extra("study", "intervals need scipy"):
            from scipy.special import stdtr
        skewness = math.copysign(self.skewness, self.skewness * self.mean)
        quantile = _quantile_of(abs(self.mean) / self.error, skewness)
        return float(2 * stdtr(self.freedom, -abs(quantile)))

    @property
    def sign_p(self) -> float:
        """The p value of the exact sign test, whether as many units are above zero as below.

        It is the largest of the levels with too few units; NaN without such a level.
        """
        with extra("study", "intervals need scipy"):
            from scipy.special import bdtr
        tails = [float(bdtr(min(signs), sum(signs), 0.5)) for signs in self.signs.values()]
        return max((min(1.0, 2 * tail) for tail in tails), default=math.nan)

    def needed(self, level: float = LEVEL) -> dict[str, int]:
        """Return for each kind of units how many are needed to show that the mean isn't zero.

        Each number is for one kind while the others stay as they are; kinds of which no number
        is enough are missing. The power is 80 %.

        Args:
            level: The level of the interval that would exclude zero.
        """
        if self.error == 0:
            # The fewest units whose equal signs are significant in the sign test.
            fewest = math.floor(2 - math.log2(1 - level))
            return dict.fromkeys(self.spread.units, fewest) if self.mean else {}
        found = {}
        for kind, current in self.spread.units.items():
            count = self.spread.needed(self.mean, kind, level=level) if current >= 2 else None
            if count is not None:
                fewest = ENOUGH_UNITS if kind in self.signs else 0
                found[kind] = max(count, current + 1, fewest)
        return found


def estimate(
    values: Sequence[float] | F64,
    levels: Mapping[str, Sequence[Any]] | None = None,
    *,
    limits: Limits = UNLIMITED,
) -> MeanEstimate:
    """Return the mean of values and its interval over the units that they belong to.

    Args:
        values: One for each combination of units, such as home and seed.
        levels: For each level the unit of each value, the most important first; None: each value is
            a unit of its own.
        limits: The least and the largest mean that are possible, which an interval doesn't exceed.

    Example:
        >>> score = estimate([1.0, 2.0, 4.0], {"seed": [0, 1, 2]})
        >>> round(score.mean, 2), score.spread.units
        (2.33, {'seed': 3})
    """
    data: F64 = np.asarray(values, np.float64)
    if not len(data) or not np.isfinite(data).all():
        return MeanEstimate(math.nan, doubt="there is no value, or one that is no number")
    codes = _codes(levels if levels else {"value": range(len(data))}, len(data))
    mean = float(data.mean())
    if not codes:
        return MeanEstimate(mean, doubt="one value alone doesn't tell how much others differ")
    spread, variance, freedom, third_moment = _analyse(data, codes)
    signs = {name: _signs(data, numbers) for name, numbers in codes.items()}
    if variance <= 0 or np.ptp(data) <= ROUNDING * np.abs(data).max():
        doubt = f"all {len(data)} values are equal, so how much others differ is unknown"
        return MeanEstimate(mean, doubt, 0.0, freedom, spread=spread, signs=signs)
    error = math.sqrt(variance)
    skewness = third_moment / (error * variance) if freedom >= MIN_FREEDOM else 0.0
    few = _doubts(spread, variance)
    least, largest = limits
    is_within = least <= data.min() and data.max() <= largest
    return MeanEstimate(
        mean,
        next(iter(few.values()), ""),
        error,
        freedom,
        skewness,
        spread,
        {name: signs[name] for name in few},
        limits if is_within else UNLIMITED,
    )


def two_sample_interval(first: F64, second: F64, level: float = LEVEL) -> Limits:
    """Return the interval of the difference of two independent means, by Welch and Hall.

    Each end is the wider of those with and without Hall's transformation, as the estimate of the
    skewness is least certain in the tails.

    Args:
        first: The first sample: float64 (n,).
        second: The second sample: float64 (m,).
        level: The share of such intervals that contain the true difference.
    """
    sides = (first, second)
    variances = [float(side.var(ddof=1)) / len(side) for side in sides]
    variance = sum_in_order(variances)
    mean = float(first.mean() - second.mean())
    if not variance > 0:
        return math.nan, math.nan
    moment, other_moment = [_third_moment(side) / len(side) ** 2 for side in sides]
    error = math.sqrt(variance)
    skewness = (moment - other_moment) / (error * variance)
    quantile = student_quantile(satterthwaite(variances, [len(s) - 1 for s in sides]), level)
    below = max(_inverse(quantile, skewness), quantile)
    above = min(_inverse(-quantile, skewness), -quantile)
    return mean - error * below, mean - error * above


def satterthwaite(variances: Sequence[float], freedoms: Sequence[float]) -> float:
    """Return the degrees of freedom of a sum of variances with `freedoms` of their own."""
    parts = zip(variances, freedoms, strict=True)
    squares = sum_in_order(variance**2 / freedom for variance, freedom in parts)
    return sum_in_order(variances) ** 2 / squares


def _signs(data: F64, numbers: I64) -> tuple[int, int]:
    """Return how many units have a mean above zero, and how many one below."""
    sums = np.bincount(numbers, data)
    smallest = ROUNDING * np.abs(data).max()
    return int((sums > smallest).sum()), int((sums < -smallest).sum())


def _doubts(spread: Spread, variance: float) -> dict[str, str]:
    """Return the levels with too few units to include rare kinds, each with its doubt in words."""
    reasons = {}
    for number, (level, count) in enumerate(spread.units.items()):
        share = spread.components[level] / count / variance
        if count < ENOUGH_UNITS and (number == 0 or share > MINOR):
            missing = 100 * (1 - RARE) ** count
            reasons[level] = (
                f"with {count} {plural(level)}, {missing:.0f} % of studies miss a kind that makes"
                f" up a tenth of all; {ENOUGH_UNITS - count} more would be enough"
            )
    return reasons


def plural(kind: str) -> str:
    """Return the name of several units of a kind.

    >>> plural("home"), plural("users.ana.persona")
    ('homes', 'values of users.ana.persona')
    """
    return f"{kind}s" if kind.isalpha() else f"values of {kind}"


def _reach(quantile: float, skewness: float) -> float:
    """Return how many standard errors below the mean an interval ends.

    The upper end is as far above the mean for the opposite skewness.
    """
    by_hall = _inverse(quantile, skewness)
    weight = WIDER if by_hall > quantile else 1 - WIDER
    return quantile + weight * (by_hall - quantile)


def _quantile_of(reach: float, skewness: float) -> float:
    """Return the quantile whose interval ends `reach` standard errors below the mean.

    With u = 1 + skewness / 3 * _inverse(quantile) this is the cubic u³ + 3 a u = k, which has one
    solution.
    """
    if abs(skewness) < MIN_SKEWNESS:
        return reach
    weight = WIDER if skewness < 0 else 1 - WIDER
    a = weight / (1 - weight)
    k = reach * skewness / (1 - weight) + 1 - skewness**2 / 6 + 3 * a
    u = 2 * math.sqrt(a) * math.sinh(math.asinh(k / (2 * a**1.5)) / 3)
    return (reach - weight * 3 / skewness * (u - 1)) / (1 - weight)


def _inverse(quantile: float, skewness: float) -> float:
    """Return the t statistic that Hall's transformation turns into a quantile."""
    if abs(skewness) < MIN_SKEWNESS:
        return quantile
    return 3 / skewness * (math.cbrt(1 + skewness * (quantile - skewness / 6)) - 1)


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


def _analyse(data: F64, codes: Mapping[str, I64]) -> tuple[Spread, float, float, float]:
    """Return variance components; variance, degrees of freedom and third moment of the mean."""
    count = len(data)
    units = {name: int(numbers.max()) + 1 for name, numbers in codes.items()}
    unit_means = {
        name: np.bincount(numbers, data) / np.bincount(numbers) for name, numbers in codes.items()
    }
    third = sum_in_order(_third_moment(means) / len(means) ** 2 for means in unit_means.values())
    residuals = data - data.mean()
    squares = {}
    for name, numbers in codes.items():
        means = unit_means[name]
        squares[name] = float(means.var(ddof=1)) / len(means)
        residuals = residuals - (means[numbers] - data.mean())
    residual_freedom = max(count - 1 - sum(n - 1 for n in units.values()), 1)
    residual = float((residuals**2).sum()) / residual_freedom
    share = residual / count
    variance = sum_in_order(squares.values())
    freedom = min(units.values()) - 1.0
    if len(codes) > 1:
        variance = max(variance - (len(codes) - 1) * share, share)
        parts = [(square, units[name] - 1.0) for name, square in squares.items()]
        parts.append(((len(codes) - 1) * share, float(residual_freedom)))
        squared = sum_in_order(part**2 / df for part, df in parts)
        freedom = max(variance**2 / max(squared, 1e-300), freedom)
    components = {name: max(0.0, (squares[name] - share) * units[name]) for name in codes}
    return Spread(units, components, residual, count), variance, freedom, third


def _third_moment(values: F64) -> float:
    """Return the unbiased third central moment of values; 0 for fewer than three."""
    count = len(values)
    if count < 3:
        return 0.0
    cubes = float(((values - values.mean()) ** 3).sum())
    return cubes * count / ((count - 1) * (count - 2))


def student_quantile(freedom: float, level: float = LEVEL) -> float:
    """Return the quantile of Student's t that a two-sided interval of a level uses.

    Raises:
        InputError: scipy is missing.
    """
    with extra("study", "intervals need scipy"):
        from scipy.special import stdtrit
    return float(stdtrit(freedom, (1 + level) / 2))
