"""Answers of a study: means with intervals, paired comparisons, effects, shares of the variance."""

import itertools
import math
from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.configuration.problems import suggest
from fleet2d.errors import InputError, extra
from fleet2d.kernels import F64, I64
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.studies.parts import VARIANT

if TYPE_CHECKING:
    import polars as pl


LEVEL = 0.95
RESAMPLES = 2000
POWER_Z = 0.84  # standard normal quantile of a power of 80 %
MAX_NEEDED_UNITS = 10_000  # units of a level
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

            if current >= 2 and is_enough(MAX_NEEDED_UNITS):
                count = bisect_left(range(MAX_NEEDED_UNITS), True, lo=2, key=is_enough)
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


FEW_UNITS = 5  # below which intervals are called uncertain


def check_axes(axes: Iterable[str], columns: Sequence[str]) -> None:
    """Check that a study has axes.

    Raises:
        InputError: It has no such axis.
    """
    for axis in axes:
        if axis not in columns:
            raise InputError(f"the study has no axis {axis!r}{suggest(axis, columns, 'It has')}")


def paired(
    frame: "pl.DataFrame",
    columns: Sequence[str],
    metric: str,
    against: Mapping[str, Any],
    by: Sequence[str],
    within: Sequence[str] = (),
) -> "pl.DataFrame":
    """Return a row for each value of an axis that is compared with the reference.

    Args:
        frame: The complete variants.
        columns: The columns of all axes.
        metric: The number to compare.
        against: The axis and its reference value.
        by: The columns of the units: homes, people, seeds.
        within: Axes with a comparison for each of their values.

    Raises:
        InputError: There is no such axis or value, or no pair.
    """
    import polars as pl

    ((axis, reference),) = against.items()
    check_axes((axis, *within), columns)
    values = frame.get_column(axis).unique(maintain_order=True).drop_nulls().to_list()
    if reference not in values:
        raise InputError(
            f"no variant with {metric} has {axis} = {reference!r}{suggest(reference, values)}"
        )
    references = frame.filter(pl.col(axis) == reference)
    rows = []
    for value in (value for value in values if value != reference):
        group_of_value = frame.filter(pl.col(axis) == value)
        pairs = match_pairs(group_of_value, references, columns, axis, metric)
        groups = pairs.partition_by(list(within), as_dict=True) if within else {(): pairs}
        for key, group in groups.items():
            if len(group):
                labels = dict(zip(within, key, strict=True))
                rows.append({axis: value, **labels, **_difference(group, by, reference)})
    if not rows:
        raise InputError(
            f"no two variants differ by {axis} alone, one of them with {axis} = {reference!r}:"
            " a paired comparison needs the same homes and seeds on both sides"
        )
    return pl.DataFrame(rows, infer_schema_length=None)


def match_pairs(
    values: "pl.DataFrame",
    references: "pl.DataFrame",
    columns: Sequence[str],
    axis: str,
    metric: str,
) -> "pl.DataFrame":
    """Return the pairs of variants that differ by an axis alone.

    The columns are the other axes, `metric`, `reference_metric` and `difference`. An axis that
    applies to one side only is not matched: all of its values form pairs.
    """
    import polars as pl

    other_axes = [c for c in columns if c != axis]
    keys = [c for c in other_axes if all(f[c].null_count() < len(f) for f in (values, references))]
    pairs = values.select(*other_axes, metric=metric).join(
        references.select(*keys, reference_metric=metric), on=keys, how="inner", nulls_equal=True
    )
    return pairs.with_columns(difference=pl.col("metric") - pl.col("reference_metric"))


def _difference(pairs: "pl.DataFrame", by: Sequence[str], reference: Any) -> dict[str, Any]:
    """Return the columns of a comparison."""
    units = by_units(pairs, by, ("metric", "reference_metric", "difference"))
    difference = estimate(units["difference"].to_numpy(), {c: units[c].to_list() for c in by})
    values, references = units["metric"].to_numpy(), units["reference_metric"].to_numpy()
    return {
        "mean": float(values.mean()),
        "reference": float(references.mean()),
        "difference": difference.mean,
        "low": difference.low,
        "high": difference.high,
        "pairs": len(pairs),
        **{f"n_{column}": units[column].n_unique() for column in by},
        "variance_ratio": variance_ratio(values, references),
        "verdict": verdict(difference, str(reference)),
    }


def by_units(frame: "pl.DataFrame", by: Sequence[str], columns: Sequence[str]) -> "pl.DataFrame":
    """Return the mean of columns for each unit, such as home and seed."""
    import polars as pl

    if not by:
        return frame.select(*columns)
    means = [pl.col(column).mean() for column in columns]
    return frame.group_by(list(by), maintain_order=True).agg(means)


def variance_ratio(values: Any, references: Any) -> float:
    """Return the variance of unpaired differences over that of paired differences.

    >>> variance_ratio([1.0, 2.0, 4.0], [1.1, 2.2, 4.0]) > 10
    True
    """
    first, second = np.asarray(values, np.float64), np.asarray(references, np.float64)
    if len(first) < 2:
        return math.nan
    unpaired = float(first.var(ddof=1) + second.var(ddof=1))
    differences = float((first - second).var(ddof=1))
    return unpaired / differences if differences > 0 else math.inf


def verdict(difference: MeanEstimate, reference: str) -> str:
    """Return in words what a difference shows, or how many more replicates are needed."""
    units = difference.spread.units
    if math.isnan(difference.low):
        return "one pair only: no interval; run the study with more seeds and homes"
    scarce = [f"{n} values of {level}" for level, n in units.items() if n < FEW_UNITS]
    caution = f"; few replicates: {', '.join(scarce)}" if scarce else ""
    if difference.low == difference.high == 0:
        return f"the same as {reference} in every pair"
    if difference.is_clear:
        side = "above" if difference.mean > 0 else "below"
        return f"{side} {reference}{caution}"
    needed = [
        f"{n} values of {level} (now {units[level]})" for level, n in difference.needed().items()
    ]
    if not needed:
        needed = ["many more of " + " and of ".join(units)]
    return (
        "too few replicates to tell: a difference of this size would show with"
        f" {' or '.join(needed)}"
    )


def summary(
    frame: "pl.DataFrame", metric: str, axes: Sequence[str], by: Sequence[str]
) -> "pl.DataFrame":
    """Return the mean of a metric for each combination of values of axes.

    Raises:
        InputError: There is no such axis.
    """
    import polars as pl

    check_axes(axes, frame.columns)
    units = [column for column in by if column not in axes]
    groups = frame.partition_by(list(axes), as_dict=True) if axes else {(): frame}
    rows = []
    for key, group in groups.items():
        means = by_units(group, units, (metric,))
        mean = estimate(means[metric].to_numpy(), {c: means[c].to_list() for c in units})
        labels = dict(zip(axes, key, strict=True))
        spread = float(group[metric].std() or 0.0)
        rows.append(
            {**labels, "mean": mean.mean, "low": mean.low, "high": mean.high,
             "deviation": spread, "variants": len(group)}
        )  # fmt: skip
    return pl.DataFrame(rows, infer_schema_length=None)


def effects(
    frame: "pl.DataFrame", axes: Sequence[str], metric: str, by: Sequence[str]
) -> "pl.DataFrame":
    """Return for each value of each axis the difference of its mean to the mean of all values.

    Differences are taken within units, so that differences between homes and lives don't count.
    """
    import polars as pl

    rows = []
    for axis in axes:
        applicable = frame.filter(pl.col(axis).is_not_null())
        labels = applicable.get_column(axis).unique(maintain_order=True).to_list()
        if len(labels) < 2:
            continue
        cells = by_units(applicable, [*by, axis], (metric,))
        unit = list(by) or [pl.lit(0)]
        cells = cells.with_columns(pl.col(metric) - pl.col(metric).mean().over(unit))
        for label in labels:
            units = cells.filter(pl.col(axis) == label)
            effect = estimate(units[metric].to_numpy(), {c: units[c].to_list() for c in by})
            rows.append(
                {"axis": axis, "value": str(label), "effect": effect.mean, "low": effect.low,
                 "high": effect.high}
            )  # fmt: skip
    schema = {"axis": pl.String, "value": pl.String}
    floats = dict.fromkeys(("effect", "low", "high"), pl.Float64)
    return pl.DataFrame(rows, schema={**schema, **floats})


def variance_shares(frame: "pl.DataFrame", columns: Sequence[str], metric: str) -> "pl.DataFrame":
    """Return the share of a metric's variance by axis, and by the interaction of two axes.

    The largest share comes first. In designs that are not balanced the shares may overlap.
    """
    import polars as pl

    values = frame[metric]
    total = float(((values - values.mean()) ** 2).sum()) if len(frame) else 0.0
    varying = [c for c in columns if frame[c].n_unique() > 1]
    rows: list[dict[str, Any]] = []
    if total > 0:
        squares = {column: _between(frame, [column], metric) for column in varying}
        rows += [{"source": c, "share": square / total} for c, square in squares.items()]
        for a, b in itertools.combinations(varying, 2):
            joint = _between(frame, [a, b], metric) - squares[a] - squares[b]
            cells = frame.select(a, b).n_unique()
            if cells < len(frame):  # with one variant a cell it is the residual, no interaction
                rows.append({"source": f"{a} × {b}", "share": max(joint, 0.0) / total})
    table = pl.DataFrame(rows, schema={"source": pl.String, "share": pl.Float64})
    return table.sort("share", descending=True)


def _between(frame: "pl.DataFrame", columns: Sequence[str], metric: str) -> float:
    """Return the sum of squares between the groups of equal values of columns."""
    import polars as pl

    cells = frame.group_by(list(columns)).agg(pl.col(metric).mean(), pl.len().alias(VARIANT))
    mean = float(frame[metric].mean())
    return float((cells[VARIANT] * (cells[metric] - mean) ** 2).sum())
