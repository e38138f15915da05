"""Answers of a study: means with intervals, paired comparisons, effects, shares of the variance."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.configuration.problems import suggest
from fleet2d.errors import InputError
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.studies.intervals import MeanEstimate, estimate
from fleet2d.studies.records import VARIANT

if TYPE_CHECKING:
    import polars as pl


FEW_UNITS = 5  # below which intervals are called uncertain
NOISE = 1e-9  # shares of the variance up to here are rounding errors
RESIDUAL = "residual"


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
    if axis in (*by, *within):
        raise InputError(f"{axis} is what is compared: leave it out of `by` and `within`")
    rows = []
    for value, pairs in _all_pairs(frame, columns, metric, axis, reference):
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
    table = pl.DataFrame(rows, infer_schema_length=None)
    corrected = pl.Series("p_holm", holm(table["p"].to_list()))
    return table.insert_column(table.get_column_index("p") + 1, corrected)


def unit_differences(
    frame: "pl.DataFrame",
    columns: Sequence[str],
    metric: str,
    against: Mapping[str, Any],
    unit: str,
    within: Sequence[str] = (),
) -> "pl.DataFrame":
    """Return the mean difference in each unit: the axis, those of `within`, unit, `difference`."""
    import polars as pl

    ((axis, reference),) = against.items()
    tables = [
        by_units(pairs, [*within, unit], ["difference"]).select(pl.lit(value).alias(axis), pl.all())
        for value, pairs in _all_pairs(frame, columns, metric, axis, reference)
    ]
    return pl.concat(tables)


SIZES = (2, 3, 5, 8, 10, 15, 20, 30, 50, 100)


def power_table(
    frame: "pl.DataFrame",
    columns: Sequence[str],
    metric: str,
    against: Mapping[str, Any],
    by: Sequence[str],
    *,
    effect: float | None,
    power: float,
) -> "pl.DataFrame":
    """Return the differences that studies of some sizes detect, or the sizes that an effect needs.

    Args:
        frame: The complete variants of a study whose units vary as those of the next one will.
        columns: The columns of all axes.
        metric: The number to compare.
        against: The axis and its reference value.
        by: The columns of the units: homes, people, seeds.
        effect: The difference to detect; None: return what can be detected.
        power: The share of studies that detect it.

    Returns:
        With an effect: for each value of the axis and each number of the other units, how many
        units of the first kind are needed, null if no number is enough. Without: for each value
        and size, the column `detectable`.

    Raises:
        InputError: There is no such axis or value, or less than two units.
    """
    import polars as pl

    ((axis, reference),) = against.items()
    check_axes((axis, *by), columns)
    rows: list[dict[str, Any]] = []
    for value, pairs in _all_pairs(frame, columns, metric, axis, reference):
        units = by_units(pairs, by, ("difference",))
        difference = estimate(units["difference"].to_numpy(), {c: units[c].to_list() for c in by})
        if not difference.spread.units:
            continue
        spread = difference.spread
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
            f"no two units of {metric} differ in {' or '.join(by)}: the power follows from how much"
            " units vary; run a small study with some homes and seeds first"
        )
    return pl.DataFrame(rows, infer_schema_length=None)


def _all_pairs(
    frame: "pl.DataFrame", columns: Sequence[str], metric: str, axis: str, reference: Any
) -> "Iterator[tuple[Any, pl.DataFrame]]":
    """Yield every value of an axis but the reference, with its pairs.

    Raises:
        InputError: No variant has the reference.
    """
    import polars as pl

    values = frame.get_column(axis).unique(maintain_order=True).drop_nulls().to_list()
    if reference not in values:
        raise InputError(
            f"no variant with {metric} has {axis} = {reference!r}{suggest(reference, values)}"
        )
    references = frame.filter(pl.col(axis) == reference)
    for value in (value for value in values if value != reference):
        yield (
            value,
            match_pairs(frame.filter(pl.col(axis) == value), references, columns, axis, metric),
        )


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p values corrected for multiplicity by the method of Holm (1979); NaN stays NaN.

    >>> holm([0.01, 0.04, 0.03, math.nan])
    [0.03, 0.06, 0.06, nan]
    """
    known = sorted((p, i) for i, p in enumerate(p_values) if not math.isnan(p))
    corrected, largest = [math.nan] * len(p_values), 0.0
    for rank, (p, i) in enumerate(known):
        largest = max(largest, min(1.0, p * (len(known) - rank)))
        corrected[i] = largest
    return corrected


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
    reference_mean, differences = float(references.mean()), values - references
    deviation = float(differences.std(ddof=1)) if len(differences) > 1 else math.nan
    return {
        "mean": float(values.mean()),
        "reference": reference_mean,
        "difference": difference.mean,
        "low": difference.low,
        "high": difference.high,
        "relative": difference.mean / abs(reference_mean) if reference_mean else math.nan,
        "effect_size": difference.mean / deviation if deviation > 0 else math.nan,
        "p": difference.p_value,
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
    """Return the share of a metric's variance by axis and by the interaction of two axes.

    The largest share comes first, what is left over last. In designs that are not balanced the
    shares may overlap.
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
                rows.append({"source": f"{a} × {b}", "share": joint / total})
        rows = [{**row, "share": row["share"] if row["share"] > NOISE else 0.0} for row in rows]
        rows.sort(key=lambda row: -row["share"])
        rest = 1 - sum_in_order(row["share"] for row in rows)
        rows.append({"source": RESIDUAL, "share": rest if rest > NOISE else 0.0})
    return pl.DataFrame(rows, schema={"source": pl.String, "share": pl.Float64})


def _between(frame: "pl.DataFrame", columns: Sequence[str], metric: str) -> float:
    """Return the sum of squares between the groups of equal values of columns."""
    import polars as pl

    groups = frame.group_by(list(columns), maintain_order=True)
    cells = groups.agg(pl.col(metric).mean(), pl.len().alias(VARIANT))
    mean = float(frame[metric].mean())
    return sum_in_order((cells[VARIANT] * (cells[metric] - mean) ** 2).to_list())
