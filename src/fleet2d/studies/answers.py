"""Answers of a study: means with intervals, paired comparisons, effects, shares of the variance."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.configuration.problems import did_you_mean, suggest
from fleet2d.errors import InputError
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.studies.directory import COMPLETE, FAILED, Counts, Meta
from fleet2d.studies.intervals import (
    ENOUGH_UNITS,
    LEVEL,
    POWER,
    UNLIMITED,
    Limits,
    MeanEstimate,
    estimate,
    plural,
)
from fleet2d.studies.results import RESULT_COLUMNS, VARIANT

if TYPE_CHECKING:
    import polars as pl

    from fleet2d.studies.specification import PairedComparison


MAX_P = 1 - LEVEL  # a difference is clear below this p value
NOISE = 1e-9  # shares of the variance up to here are rounding errors
RESIDUAL = "residual"
# The numbers of seeds for which power is computed.
OTHER_SIZES = (2, 3, 5, 10, 20, 30, 50, 100)
# The numbers of homes, likewise; with fewer, no interval can be trusted.
SIZES = (ENOUGH_UNITS, 50, 100, 200, 500, 1000)


def check_axes(axes: Iterable[str], columns: Sequence[str]) -> None:
    """Check that a study has axes.

    Raises:
        InputError: The study has no such axis.
    """
    for axis in axes:
        if axis not in columns:
            raise InputError(f"the study has no axis {axis!r}{suggest(axis, columns, 'It has')}")


class StudyAnswers:
    """The answers of a study about its metrics; base class of `Study`, which reads the variants.

    Attributes:
        location: The folder or store, without secrets.
        meta: The description of the study: name, columns, populations, comparisons.
        columns: The columns of the axes, the seed last.
        populations: The columns whose values are a sample of a population.
    """

    location: str
    meta: Meta
    columns: tuple[str, ...]
    populations: tuple[str, ...]

    @property
    def variants(self) -> "pl.DataFrame":
        """The variants, a row each: parameters, status, time, digest and metrics."""
        raise NotImplementedError

    @property
    def comparisons(self) -> "tuple[PairedComparison, ...]":
        """The comparisons that the study file asks for."""
        raise NotImplementedError

    def polars(self, table: str) -> "pl.LazyFrame":
        """Return a table of all variants with their parameters as a lazy frame."""
        raise NotImplementedError

    def scenario(self, variant: int) -> dict[str, Any]:
        """Return the scenario of a variant, with its seed."""
        raise NotImplementedError

    @property
    def counts(self) -> Counts:
        """The numbers of complete, failed and missing variants."""
        return Counts.of(self.variants)

    @property
    def metrics(self) -> tuple[str, ...]:
        """The names of the metrics, such as `ltp_error.ana.tv`."""
        no_metrics = {*self.columns, *RESULT_COLUMNS, "simulated_s"}
        return tuple(name for name in self.variants.columns if name not in no_metrics)

    @property
    def failures(self) -> "pl.DataFrame":
        """The variants that failed, with their errors."""
        frame = self.variants.filter(status=FAILED)
        return frame.select(VARIANT, *self.columns, "error", "trace", "attempts")

    @property
    def complete(self) -> "pl.DataFrame":
        """The variants that are complete."""
        return self.variants.filter(status=COMPLETE)

    def with_metric(self, metric: str) -> "pl.DataFrame":
        """Return the variants that are complete and have a metric.

        Raises:
            InputError: There is no such metric.
        """
        if not self.counts.complete:
            raise InputError(f"{self.location} has no complete variant, and so no {metric!r}")
        if metric not in self.metrics:
            hint = did_you_mean(metric, self.metrics)
            raise InputError(
                f"no variant has a numeric metric {metric!r}{hint} There are:"
                f" {', '.join(self.metrics[:20])}{', …' if len(self.metrics) > 20 else ''}"
            )
        import polars as pl

        return self.complete.filter(pl.col(metric).is_not_null() & pl.col(metric).is_finite())

    def limits(self, metric: str) -> Limits:
        """Return the least and the largest value that a metric can have."""
        return self.meta.limits(metric)

    def better(self, metric: str) -> str:
        """Return which values of a metric are better: `higher`, `lower`, or empty for neither."""
        return self.meta.better(metric)

    def paired(
        self,
        metric: str,
        against: Mapping[str, Any],
        by: Sequence[str] | None = None,
        within: Sequence[str] = (),
    ) -> "pl.DataFrame":
        """Compare the values of an axis with one of them, pair by pair.

        A pair is two variants that differ by that axis alone: same home, same people, same seed,
        and so the same lives of the people.

        Args:
            metric: A number, such as `ltp_error.ana.tv`.
            against: The axis and its reference value, as in {"robot": "patrol"}.
            by: Columns of the units over which intervals hold; None: homes, people and seeds.
            within: Axes with a comparison for each of their values; over other axes the differences
                are averaged.

        Returns:
            A row for each other value: mean, reference, difference, low and high (of an interval
            that all rows of this table keep in 95 % of studies), doubt (why the interval can't be
            trusted), relative (to the size of the reference), effect_size (in standard deviations
            of the units' differences), p, p_holm (corrected for the rows of this table), pairs, and
            how many are above and below the reference, n_UNIT, variance_ratio (of unpaired to
            paired differences), needed (replicates for a difference of this size to show), clear
            (whether `p_holm` shows one), and a verdict in words.

        Raises:
            InputError: There is no such metric, axis or value, or no pair.
        """
        import polars as pl

        rows = [each.row() for each in judged(self.compared(metric, against, by, within))]
        return pl.DataFrame(rows, infer_schema_length=None)

    def compared(
        self,
        metric: str,
        against: Mapping[str, Any],
        by: Sequence[str] | None = None,
        within: Sequence[str] = (),
    ) -> "list[Comparison]":
        """Return the comparisons behind the rows of `paired`, before p values are corrected.

        Raises:
            InputError: There is no such metric, axis or value, or no pair.
        """
        frame = self.with_metric(metric)
        units = self._units(by, against)
        limits = difference_limits(self.limits(metric))
        ((axis, reference),) = against.items()
        check_axes((axis, *within), self.columns)
        if axis in (*units, *within):
            raise InputError(f"{axis} is what is compared: leave it out of `by` and `within`")
        found = []
        for value, pairs in self._pairs(frame, metric, axis, reference):
            groups = pairs.partition_by(list(within), as_dict=True) if within else {(): pairs}
            for key, group in groups.items():
                if len(group):
                    labels = {axis: value, **dict(zip(within, key, strict=True))}
                    found.append(comparison(group, units, limits, metric, labels, reference))
        if not found:
            raise InputError(
                f"no two variants differ by {axis} alone, one of them with {axis} = {reference!r}:"
                " a paired comparison needs the same homes and seeds on both sides"
            )
        return [replace(each, better=self.better(metric)) for each in found]

    def differences(
        self, metric: str, against: Mapping[str, Any], unit: str, within: Sequence[str] = ()
    ) -> "pl.DataFrame":
        """Return the mean difference to the reference in each unit, such as each home.

        With `within`, a row for each value of other axes and each unit.

        Raises:
            InputError: There is no such metric, axis or value.
        """
        import polars as pl

        ((axis, reference),) = against.items()
        check_axes((axis, unit, *within), self.columns)
        tables = []
        for value, pairs in self._pairs(self.with_metric(metric), metric, axis, reference):
            units = by_units(pairs, [*within, unit], "difference")
            tables.append(units.select(pl.lit(value).alias(axis), pl.all()))
        return pl.concat(tables)

    def power(
        self,
        metric: str,
        against: Mapping[str, Any],
        effect: float | None = None,
        *,
        power: float = POWER,
        by: Sequence[str] | None = None,
    ) -> "pl.DataFrame":
        """Return how many homes and seeds detect an effect, from how much they vary in this study.

        Args:
            metric: A number, such as `ltp_error.ana.tv`.
            against: The axis and its reference value, as in {"robot": "patrol"}.
            effect: The difference to detect; None: return the difference that each size detects.
            power: The share of studies whose interval would exclude zero.
            by: Columns of the units; None: homes, people and seeds.

        Returns:
            With an effect: for each value of the axis and each number of the other units, how many
            units of the first kind are needed, null if no number is enough. Without: for each value
            and size, the column `detectable`. Only sizes for which intervals can be trusted are
            listed.

        Raises:
            InputError: There is no such metric, axis or value, or less than two units.
        """
        import polars as pl

        units = self._units(by, against)
        ((axis, reference),) = against.items()
        check_axes((axis,), self.columns)
        rows: list[dict[str, Any]] = []
        for value, pairs in self._pairs(self.with_metric(metric), metric, axis, reference):
            spread = estimate_units(pairs, units, "difference").spread
            if not spread.units:
                continue
            first, *others = spread.units
            for counts in itertools.product(OTHER_SIZES, repeat=len(others)):
                sizes = dict(zip(others, counts, strict=True))
                label = {axis: value, **sizes}
                if effect is not None:
                    needed = spread.needed(effect, first, power, units=sizes)
                    rows.append({**label, first: needed and max(needed, ENOUGH_UNITS)})
                    continue
                for count in SIZES:
                    detectable = spread.detectable({**sizes, first: count}, power)
                    rows.append({**label, first: count, "detectable": detectable})
        if not rows:
            raise InputError(
                f"no two units of {metric} differ in {' or '.join(units)}: the power follows from"
                " how much units vary; run a small study with some homes and seeds first"
            )
        return pl.DataFrame(rows, infer_schema_length=None)

    def _pairs(
        self, frame: "pl.DataFrame", metric: str, axis: str, reference: Any
    ) -> "Iterator[tuple[Any, pl.DataFrame]]":
        """Yield every value of an axis but the reference, with the pairs that differ by it alone.

        Pairs have the columns of the other axes, `metric`, `reference_metric` and `difference`. An
        axis that applies to one side only is not matched: all of its values form pairs.

        Raises:
            InputError: No variant has the reference.
        """
        import polars as pl

        values = frame.get_column(axis).unique(maintain_order=True).drop_nulls().to_list()
        if reference not in values:
            raise InputError(
                f"no variant with {metric} has {axis} = {reference!r}{suggest(reference, values)}"
            )
        others = [column for column in self.columns if column != axis]
        of_reference = frame.filter(pl.col(axis) == reference)
        for value in values:
            if value == reference:
                continue
            of_value = frame.filter(pl.col(axis) == value)
            keys = [
                column
                for column in others
                if not (of_value[column].is_null().all() or of_reference[column].is_null().all())
            ]
            pairs = of_value.select(*others, metric=metric).join(
                of_reference.select(*keys, reference_metric=metric),
                on=keys, how="inner", nulls_equal=True,
            )  # fmt: skip
            difference = pl.col("metric") - pl.col("reference_metric")
            yield value, pairs.with_columns(difference=difference)

    def summary(
        self, metric: str, axes: Sequence[str], by: Sequence[str] | None = None
    ) -> "pl.DataFrame":
        """Return the mean of a metric for each combination of values of axes, with intervals.

        Raises:
            InputError: There is no such metric or axis.
        """
        frame = self.with_metric(metric)
        check_axes(axes, frame.columns)
        return group_means(frame, metric, axes, self._units(by), self.limits(metric))

    def shares(self, metric: str) -> "pl.DataFrame":
        """Return the shares of a metric's variance by axis and by interaction of two axes.

        The largest share comes first, the residual last. Shares may overlap if a design isn't
        balanced.

        Raises:
            InputError: There is no such metric.
        """
        import polars as pl

        frame = self.with_metric(metric)
        values = frame[metric]
        total = 0.0
        if len(values):
            total = float(((values - values.mean()) ** 2).sum())
        drawn = [c for c in self.meta.features if c not in self.populations]
        varying = [c for c in self.columns if c not in drawn and frame[c].n_unique() > 1]
        rows: list[tuple[str, float]] = []
        if total > 0:
            squares = {column: _between(frame, metric, column) for column in varying}
            rows += [(column, square / total) for column, square in squares.items()]
            for a, b in itertools.combinations(varying, 2):
                # With one variant a cell, an interaction can't be told from the residual.
                if frame.select(a, b).n_unique() < len(values):
                    joint = _between(frame, metric, a, b) - squares[a] - squares[b]
                    rows.append((f"{a} × {b}", joint / total))
            rows = [(source, share if share > NOISE else 0.0) for source, share in rows]
            rows.sort(key=lambda row: -row[1])
            rest = 1 - sum_in_order(share for _, share in rows)
            rows.append((RESIDUAL, rest if rest > NOISE else 0.0))
        return pl.DataFrame(rows, schema={"source": pl.String, "share": pl.Float64}, orient="row")

    def _units(self, by: Sequence[str] | None, compared: Iterable[str] = ()) -> tuple[str, ...]:
        units = tuple(by or ())
        if by is None:
            units = tuple(c for c in self.populations if c not in compared)
        check_axes(units, self.columns)
        return units


def group_means(
    frame: "pl.DataFrame",
    column: str,
    axes: Sequence[str],
    by: Sequence[str],
    limits: Limits = UNLIMITED,
) -> "pl.DataFrame":
    """Return the mean of a column for each combination of values of axes, with intervals."""
    import polars as pl

    units = [unit for unit in by if unit not in axes]
    groups = frame.partition_by(list(axes), as_dict=True) if axes else {(): frame}
    rows = []
    for key, group in groups.items():
        mean = estimate_units(group, units, column, limits)
        row = {
            **dict(zip(axes, key, strict=True)),
            "mean": mean.mean,
            "low": mean.low,
            "high": mean.high,
            "doubt": mean.doubt,
            "deviation": float(group[column].std() or 0.0),
            "variants": len(group),
        }
        rows.append(row)
    return pl.DataFrame(rows, infer_schema_length=None)


def _between(frame: "pl.DataFrame", metric: str, *columns: str) -> float:
    """Return the sum of squares between the groups of equal values of columns."""
    import polars as pl

    groups = frame.group_by(columns, maintain_order=True)
    cells = groups.agg(pl.col(metric).mean(), pl.len().alias("variants in cell"))
    mean = float(frame[metric].mean())
    squares = cells["variants in cell"] * (cells[metric] - mean) ** 2
    return sum_in_order(squares.to_list())


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p values corrected for multiplicity by the method of Holm (1979); NaN stays NaN.

    >>> holm([0.01, 0.04, 0.03, math.nan])
    [0.03, 0.06, 0.06, nan]
    """
    known = sorted((p, i) for i, p in enumerate(p_values) if not math.isnan(p))
    corrected = [math.nan] * len(p_values)
    largest = 0.0
    for rank, (p, i) in enumerate(known):
        largest = max(largest, min(1.0, p * (len(known) - rank)))
        corrected[i] = largest
    return corrected


def difference_limits(limits: Limits) -> Limits:
    """Return the limits of a difference of two values from their limits."""
    least, largest = limits
    return least - largest, largest - least


@dataclass(frozen=True)
class Comparison:
    """A metric at a value of an axis and at the reference, compared over pairs of variants.

    Attributes:
        metric: The metric.
        labels: The values of the compared axis, which comes first, and of the axes within.
        reference: The label of the reference.
        better: Which values of the metric are better: `higher`, `lower`, or empty for neither.
        mean: The mean over units.
        reference_mean: The mean of the reference over units.
        estimate: The mean difference.
        deviation: The standard deviation of the units' differences.
        variance_ratio: The variance of unpaired differences over that of paired ones.
        pairs: The number of pairs.
        above: The number of pairs above the reference.
        below: The number of pairs below the reference.
        units: The number of units of each kind.
        p_holm: The p value, corrected for all comparisons that are read together; see `judged`.
        number: The number of comparisons that are read together.
    """

    metric: str
    labels: Mapping[str, Any]
    reference: Any
    mean: float
    reference_mean: float
    estimate: MeanEstimate
    deviation: float
    variance_ratio: float
    pairs: int
    above: int
    below: int
    units: Mapping[str, int]
    better: str = ""
    p_holm: float = math.nan
    number: int = 1

    @property
    def difference(self) -> float:
        """The mean difference."""
        return self.estimate.mean

    @property
    def p(self) -> float:
        """The p value of the mean, or of the exact sign test if there are too few units."""
        return self.estimate.sign_p if self.estimate.doubt else self.estimate.p_value

    @property
    def level(self) -> float:
        """The level of each interval, at which all of `number` hold in 95 % of studies."""
        return 1 - MAX_P / self.number

    @property
    def interval(self) -> Limits:
        """The interval of the difference: it excludes zero exactly if the difference is clear."""
        low, high = self.estimate.interval(self.level)
        if not self.is_clear or self.estimate.doubt:
            return low, high
        # Holm's method shows a few more differences than the intervals, which are Bonferroni's.
        return (max(low, 0.0), high) if self.difference > 0 else (low, min(high, 0.0))

    @property
    def direction(self) -> str:
        """Whether the mean is `higher` or `lower` than the reference."""
        return "higher" if self.difference > 0 else "lower"

    @property
    def is_clear(self) -> bool:
        """Whether the pairs show a difference; every claim of a difference follows from this.

        The corrected p value must be small enough; and if there are too few units to trust the
        mean, most pairs and most units must differ in its direction, too.
        """
        if not self.p_holm < MAX_P:
            return False
        side = int(self.direction == "lower")
        agreeing = (self.above, self.below)[side]
        is_majority = 2 * agreeing > self.pairs
        is_one_way = all(signs[side] > signs[1 - side] for signs in self.estimate.signs.values())
        return not self.estimate.doubt or (is_majority and is_one_way)

    @property
    def is_same(self) -> bool:
        """Whether no pair differs."""
        return not self.above and not self.below

    @property
    def outcome(self) -> str:
        """The outcome in a word or two."""
        if self.is_same:
            return "the same"
        if not self.is_clear:
            return "can't tell"
        if not self.better:
            return self.direction
        return "better" if self.better == self.direction else "worse"

    @property
    def needed(self) -> str:
        """How many units would show a difference of this size, in words."""
        spread = self.estimate.spread
        parts = [
            f"{count:,} {plural(kind)} (now {spread.units[kind]})"
            for kind, count in self.estimate.needed(self.level).items()
        ]
        return " or ".join(parts) or f"many more {' and '.join(map(plural, spread.units))}"

    @property
    def verdict(self) -> str:
        """The verdict in words, or how many more replicates are needed."""
        side = "above" if self.difference > 0 else "below"
        count = self.above if side == "above" else self.below
        doubt = self.estimate.doubt
        if math.isnan(self.p):
            return "one pair only: no interval; run the study with more seeds and homes"
        if self.is_same:
            return f"the same as {self.reference} in every pair"
        if self.is_clear:
            judgement = f", which is {self.outcome}" if self.better else ""
            amount = f"; how much can't be told: {doubt}" if doubt else ""
            return f"{side} {self.reference} in {count} of {self.pairs} pairs{judgement}{amount}"
        if self.p_holm < MAX_P:
            return (
                f"too few replicates to tell: the mean is {side} {self.reference}, but only"
                f" {count} of {self.pairs} pairs are"
            )
        many = f"p is {self.p_holm:.2g} for so many comparisons; " if self.p < MAX_P else ""
        size = f"a difference of this size would show with {self.needed}"
        return f"too few replicates to tell: {many}{size}"

    def row(self) -> dict[str, Any]:
        """Return the columns of `StudyAnswers.paired`."""
        reference = self.reference_mean
        low, high = self.interval
        return {
            **self.labels,
            "mean": self.mean,
            "reference": reference,
            "difference": self.difference,
            "low": low,
            "high": high,
            "doubt": self.estimate.doubt,
            "relative": self.difference / abs(reference) if reference else math.nan,
            "effect_size": self.difference / self.deviation if self.deviation > 0 else math.nan,
            "p": self.p,
            "p_holm": self.p_holm,
            "pairs": self.pairs,
            "above": self.above,
            "below": self.below,
            **{f"n_{kind}": count for kind, count in self.units.items()},
            "variance_ratio": self.variance_ratio,
            "needed": self.needed,
            "clear": self.is_clear,
            "verdict": self.verdict,
        }


def comparison(
    pairs: "pl.DataFrame",
    by: Sequence[str],
    limits: Limits,
    metric: str,
    labels: Mapping[str, Any],
    reference: Any,
) -> Comparison:
    """Return the comparison of a metric over pairs of variants."""
    units = by_units(pairs, by, "metric", "reference_metric", "difference")
    values = units["metric"].to_numpy()
    references = units["reference_metric"].to_numpy()
    differences = values - references
    return Comparison(
        metric,
        labels,
        reference,
        float(values.mean()),
        float(references.mean()),
        estimate_units(units, by, "difference", limits),
        float(differences.std(ddof=1)) if len(differences) > 1 else math.nan,
        variance_ratio(values, references),
        len(pairs),
        int((pairs["difference"] > 0).sum()),
        int((pairs["difference"] < 0).sum()),
        {column: units[column].n_unique() for column in by},
    )


def by_units(frame: "pl.DataFrame", by: Sequence[str], *columns: str) -> "pl.DataFrame":
    """Return the mean of columns for each unit, such as home and seed."""
    if not by:
        return frame.select(columns)
    import polars as pl

    return frame.group_by(list(by), maintain_order=True).agg(pl.col(columns).mean())


def estimate_units(
    frame: "pl.DataFrame", by: Sequence[str], column: str, limits: Limits = UNLIMITED
) -> MeanEstimate:
    """Return the mean of a column, and its interval over units."""
    means = by_units(frame, by, column)
    levels = {unit: means[unit].to_list() for unit in by}
    return estimate(means[column].to_numpy(), levels, limits=limits)


def variance_ratio(values: Any, references: Any) -> float:
    """Return the variance of unpaired differences over that of paired differences.

    >>> variance_ratio([1.0, 2.0, 4.0], [1.1, 2.2, 4.0]) > 10
    True
    """
    first = np.asarray(values, np.float64)
    second = np.asarray(references, np.float64)
    if len(first) < 2:
        return math.nan
    unpaired = float(first.var(ddof=1) + second.var(ddof=1))
    differences = float((first - second).var(ddof=1))
    return unpaired / differences if differences > 0 else math.inf


def judged(comparisons: Sequence[Comparison]) -> list[Comparison]:
    """Return comparisons that are read together, with p values corrected for all of them."""
    corrected = holm([each.p for each in comparisons])
    number = max(1, sum(not math.isnan(p) for p in corrected))
    pairs = zip(comparisons, corrected, strict=True)
    return [replace(each, p_holm=p, number=number) for each, p in pairs]
