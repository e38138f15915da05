"""Answers of a study: means with intervals, paired comparisons, effects, shares of the variance."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.configuration.problems import suggest
from fleet2d.errors import InputError
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.studies.intervals import LEVEL, POWER, UNLIMITED, Limits, MeanEstimate, estimate
from fleet2d.studies.results import VARIANT

if TYPE_CHECKING:
    import polars as pl


MAX_P = 1 - LEVEL  # below which a difference is clear
FEW_UNITS = 5  # the smallest size of a study whose power is told
NOISE = 1e-9  # shares of the variance up to here are rounding errors
RESIDUAL = "residual"
SIZES = (2, 3, 5, 8, 10, 15, 20, 30, 50, 100)  # of studies, in units of a kind


def check_axes(axes: Iterable[str], columns: Sequence[str]) -> None:
    """Check that a study has axes.

    Raises:
        InputError: It has no such axis.
    """
    for axis in axes:
        if axis not in columns:
            raise InputError(f"the study has no axis {axis!r}{suggest(axis, columns, 'It has')}")


class StudyAnswers:
    """What a study says of its metrics: the base of `Study`, which has its variants.

    Attributes:
        columns: The columns of the axes, the seed last.
        populations: The columns whose values are a sample of a population.
    """

    columns: tuple[str, ...]
    populations: tuple[str, ...]

    def with_metric(self, metric: str) -> "pl.DataFrame":
        """Return the variants that are complete and have a metric.

        Raises:
            InputError: There is no such metric.
        """
        raise NotImplementedError

    def limits(self, metric: str) -> Limits:
        """Return the least and the largest value that a metric can have."""
        return UNLIMITED

    def better(self, metric: str) -> str:
        """Return which values of a metric are better: `higher`, `lower`, or empty: neither is."""
        return ""

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
            A row for each other value: mean, reference, difference, low and high (95 %), doubt (why
            the interval can't be trusted), relative (to the size of the reference), effect_size (in
            standard deviations of the units' differences), p, p_holm (corrected for the rows of
            this table), pairs, and how many are above and below the reference, n_UNIT,
            variance_ratio (of unpaired to paired differences), needed (replicates for a difference
            of this size to show), clear (whether `p_holm` shows one), and a verdict in words.

        Raises:
            InputError: There is no such metric, axis or value, or no pair.
        """
        import polars as pl

        frame = self.with_metric(metric)
        units = self._units(by, against)
        limits = difference_limits(self.limits(metric))
        better = self.better(metric)
        ((axis, reference),) = against.items()
        check_axes((axis, *within), self.columns)
        if axis in (*units, *within):
            raise InputError(f"{axis} is what is compared: leave it out of `by` and `within`")
        rows = []
        for value, pairs in self._pairs(frame, metric, axis, reference):
            groups = pairs.partition_by(list(within), as_dict=True) if within else {(): pairs}
            for key, group in groups.items():
                if len(group):
                    labels = dict(zip(within, key, strict=True))
                    facts = {"to": str(reference), "better": better}
                    row = _difference(group, units, limits)
                    rows.append({axis: value, **labels, **row, **facts})
        if not rows:
            raise InputError(
                f"no two variants differ by {axis} alone, one of them with {axis} = {reference!r}:"
                " a paired comparison needs the same homes and seeds on both sides"
            )
        (table,) = judged([pl.DataFrame(rows, infer_schema_length=None)])
        return table

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
            and size, the column `detectable`.

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
            for counts in itertools.product(SIZES, repeat=len(others)):
                sizes = dict(zip(others, counts, strict=True))
                label = {axis: value, **sizes}
                if effect is not None:
                    rows.append({**label, first: spread.needed(effect, first, power, **sizes)})
                    continue
                for count in SIZES[SIZES.index(FEW_UNITS) :]:
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
        for value in (value for value in values if value != reference):
            of_value = frame.filter(pl.col(axis) == value)
            sides = (of_value, of_reference)
            keys = [c for c in others if all(side[c].null_count() < len(side) for side in sides)]
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
        """Return the share of a metric's variance by axis, and by pairs of axes beyond both.

        The largest share comes first, what is left over last. In designs that are not balanced the
        shares may overlap.

        Raises:
            InputError: There is no such metric.
        """
        import polars as pl

        frame = self.with_metric(metric)
        values = frame[metric]
        total = float(((values - values.mean()) ** 2).sum()) if len(values) else 0.0
        varying = [c for c in self.columns if frame[c].n_unique() > 1]
        rows: list[tuple[str, float]] = []
        if total > 0:
            squares = {column: _between(frame, metric, column) for column in varying}
            rows += [(column, square / total) for column, square in squares.items()]
            for a, b in itertools.combinations(varying, 2):
                # With one variant a cell it is the residual, no interaction.
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
        labels = dict(zip(axes, key, strict=True))
        spread = float(group[column].std() or 0.0)
        rows.append(
            {**labels, "mean": mean.mean, "low": mean.low, "high": mean.high, "doubt": mean.doubt,
             "deviation": spread, "variants": len(group)}
        )  # fmt: skip
    return pl.DataFrame(rows, infer_schema_length=None)


def _between(frame: "pl.DataFrame", metric: str, *columns: str) -> float:
    """Return the sum of squares between the groups of equal values of columns."""
    import polars as pl

    groups = frame.group_by(columns, maintain_order=True)
    cells = groups.agg(pl.col(metric).mean(), pl.len().alias(VARIANT))
    mean = float(frame[metric].mean())
    return sum_in_order((cells[VARIANT] * (cells[metric] - mean) ** 2).to_list())


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


def _difference(pairs: "pl.DataFrame", by: Sequence[str], limits: Limits) -> dict[str, Any]:
    """Return the columns of a comparison."""
    units = by_units(pairs, by, "metric", "reference_metric", "difference")
    difference = estimate_units(units, by, "difference", limits)
    values = units["metric"].to_numpy()
    references = units["reference_metric"].to_numpy()
    reference_mean = float(references.mean())
    differences = values - references
    deviation = float(differences.std(ddof=1)) if len(differences) > 1 else math.nan
    needed = [
        f"{n} values of {level} (now {difference.spread.units[level]})"
        for level, n in difference.needed().items()
    ]
    return {
        "mean": float(values.mean()),
        "reference": reference_mean,
        "difference": difference.mean,
        "low": difference.low,
        "high": difference.high,
        "doubt": difference.doubt,
        "relative": difference.mean / abs(reference_mean) if reference_mean else math.nan,
        "effect_size": difference.mean / deviation if deviation > 0 else math.nan,
        "p": difference.p_value,
        "pairs": len(pairs),
        "above": int((pairs["difference"] > 0).sum()),
        "below": int((pairs["difference"] < 0).sum()),
        **{f"n_{column}": units[column].n_unique() for column in by},
        "variance_ratio": variance_ratio(values, references),
        "needed": " or ".join(needed) or "many more of " + " and of ".join(difference.spread.units),
    }


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


def judged(tables: "Sequence[pl.DataFrame]") -> "list[pl.DataFrame]":
    """Return tables of comparisons with corrected p values, and the verdicts that follow from them.

    Args:
        tables: Comparisons that are read together: p values are corrected for all of their rows.
    """
    import polars as pl

    p_values = itertools.chain.from_iterable(table["p"].to_list() for table in tables)
    corrected = iter(holm(list(p_values)))
    results = []
    for table in tables:
        position = table.get_column_index("p") + 1
        bare = table.drop("p_holm", "clear", "verdict", strict=False)
        p_holm = pl.Series("p_holm", list(itertools.islice(corrected, len(table))), pl.Float64)
        result = bare.insert_column(position, p_holm)
        rows = result.to_dicts()
        clear = pl.Series("clear", [is_clear(row) for row in rows])
        verdicts = pl.Series("verdict", [verdict(row) for row in rows])
        results.append(result.with_columns(clear, verdicts))
    return results


def is_clear(row: Mapping[str, Any]) -> bool:
    """Whether a comparison shows a difference: all claims of one follow from this.

    The corrected p value must be small enough; and if there are too few units to trust the mean,
    most pairs must differ in its direction, too.
    """
    agreeing = row["above"] if row["difference"] > 0 else row["below"]
    return row["p_holm"] < MAX_P and (not row["doubt"] or 2 * agreeing > row["pairs"])


def verdict(row: Mapping[str, Any]) -> str:
    """Return in words what a comparison shows, or how many more replicates are needed."""
    if math.isnan(row["p"]):
        return "one pair only: no interval; run the study with more seeds and homes"
    if not row["above"] and not row["below"]:
        return f"the same as {row['to']} in every pair"
    side = "above" if row["difference"] > 0 else "below"
    if is_clear(row):
        direction = "higher" if side == "above" else "lower"
        value = "better" if row["better"] == direction else "worse"
        judgement = f", which is {value}" if row["better"] else ""
        amount = f"; how much can't be told: {row['doubt']}" if row["doubt"] else ""
        return f"{side} {row['to']} in {row[side]} of {row['pairs']} pairs{judgement}{amount}"
    if row["p"] >= MAX_P:
        return (
            f"too few replicates to tell: a difference of this size would show with {row['needed']}"
        )
    if row["p_holm"] >= MAX_P:
        return f"too few replicates to tell: p is {row['p_holm']:.2g} for so many comparisons"
    return (
        f"too few replicates to tell: the mean is {side} {row['to']}, but only {row[side]} of"
        f" {row['pairs']} pairs are"
    )
