"""Answers from the variants of a study: paired comparisons, means, effects, shares of variance."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.errors import InputError
from fleet2d.problems import did_you_mean
from fleet2d.studies.intervals import Estimate, estimate
from fleet2d.studies.parts import VARIANT

if TYPE_CHECKING:
    import polars as pl

FEW_UNITS = 5


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
        within: Axes for whose values comparisons are made one by one.

    Raises:
        InputError: There is no such axis or value, or no pair.
    """
    import polars as pl

    ((axis, reference),) = against.items()
    for column in (axis, *within):
        if column not in columns:
            raise InputError(
                f"the study has no axis {column!r}{did_you_mean(column, columns)} It has:"
                f" {', '.join(columns)}"
            )
    values = frame.get_column(axis).unique(maintain_order=True).drop_nulls().to_list()
    if reference not in values:
        raise InputError(
            f"no variant with {metric} has {axis} = {reference!r}{did_you_mean(reference, values)}"
            f" There are: {', '.join(map(str, values))}"
        )
    base = frame.filter(pl.col(axis) == reference)
    rows = []
    for value in (value for value in values if value != reference):
        pairs = match_pairs(frame.filter(pl.col(axis) == value), base, columns, axis, metric)
        groups = pairs.partition_by(list(within), as_dict=True) if within else {(): pairs}
        for key, group in groups.items():
            if len(group):
                labels = dict(zip(within, key, strict=True))
                rows.append({axis: value, **labels, **_difference(group, by, reference)})
    if not rows:
        raise InputError(
            f"no two variants differ by {axis} alone, one of them with {axis} = {reference!r}:"
            " a paired comparison wants the same homes and seeds on both sides"
        )
    return pl.DataFrame(rows, infer_schema_length=None)


def match_pairs(
    mine: "pl.DataFrame",
    base: "pl.DataFrame",
    columns: Sequence[str],
    axis: str,
    metric: str,
) -> "pl.DataFrame":
    """Return pairs of variants that differ by an axis alone: `mine`, `base`, `difference`.

    An axis that applies to one side only can't be matched; its values are all paired.
    """
    import polars as pl

    others = [c for c in columns if c != axis]
    shared = [c for c in others if mine.get_column(c).null_count() < len(mine)]
    shared = [c for c in shared if base.get_column(c).null_count() < len(base)]
    left = mine.select(*others, pl.col(metric).alias("mine"))
    right = base.select(*shared, pl.col(metric).alias("base"))
    pairs = left.join(right, on=shared, how="inner", nulls_equal=True)
    return pairs.with_columns(difference=pl.col("mine") - pl.col("base"))


def _difference(pairs: "pl.DataFrame", by: Sequence[str], reference: Any) -> dict[str, Any]:
    """Return the columns of a comparison."""
    units = by_units(pairs, by, ("mine", "base", "difference"))
    found = estimate(units["difference"].to_numpy(), {c: units[c].to_list() for c in by})
    mine, base = units["mine"].to_numpy(), units["base"].to_numpy()
    return {
        "mean": float(mine.mean()),
        "reference": float(base.mean()),
        "difference": found.mean,
        "low": found.low,
        "high": found.high,
        "pairs": len(pairs),
        **{f"n_{column}": units[column].n_unique() for column in by},
        "variance_ratio": variance_ratio(mine, base),
        "verdict": verdict(found, str(reference)),
    }


def by_units(frame: "pl.DataFrame", by: Sequence[str], columns: Sequence[str]) -> "pl.DataFrame":
    """Return the mean of columns for each unit, such as home and seed."""
    import polars as pl

    if not by:
        return frame.select(*columns)
    means = [pl.col(column).mean() for column in columns]
    return frame.group_by(list(by), maintain_order=True).agg(means)


def variance_ratio(mine: Any, base: Any) -> float:
    """Return how many times the variance of a difference is less because it is taken in pairs.

    >>> variance_ratio([1.0, 2.0, 4.0], [1.1, 2.2, 4.0]) > 10
    True
    """
    left, right = np.asarray(mine, np.float64), np.asarray(base, np.float64)
    if len(left) < 2:
        return math.nan
    unpaired = float(left.var(ddof=1) + right.var(ddof=1))
    differences = float((left - right).var(ddof=1))
    return unpaired / differences if differences > 0 else math.inf


def verdict(found: Estimate, reference: str) -> str:
    """Return in words what a difference shows, and how many replicates would show more."""
    units = found.spread.units
    if math.isnan(found.low):
        return "one pair only: nothing can be told; run it with more seeds and homes"
    few = [f"{n} values of {level}" for level, n in units.items() if n < FEW_UNITS]
    caution = f"; few replicates: {', '.join(few)}" if few else ""
    if found.low == found.high == 0:
        return f"the same as {reference} in every pair"
    if found.is_clear:
        way = "above" if found.mean > 0 else "below"
        return f"{way} {reference}{caution}"
    needed = found.needed()
    ways = [f"{n} values of {level} (now {units[level]})" for level, n in needed.items()]
    if not ways:
        ways = ["many more of " + " and of ".join(units)]
    return (
        f"too few replicates to tell: a difference of this size would show with {' or '.join(ways)}"
    )


def summary(
    frame: "pl.DataFrame", metric: str, axes: Sequence[str], by: Sequence[str]
) -> "pl.DataFrame":
    """Return the mean of a metric for each combination of values of axes.

    Raises:
        InputError: There is no such axis.
    """
    import polars as pl

    for axis in axes:
        if axis not in frame.columns:
            raise InputError(f"the study has no axis {axis!r}{did_you_mean(axis, frame.columns)}")
    units = [column for column in by if column not in axes]
    groups = frame.partition_by(list(axes), as_dict=True) if axes else {(): frame}
    rows = []
    for key, group in groups.items():
        means = by_units(group, units, (metric,))
        found = estimate(means[metric].to_numpy(), {c: means[c].to_list() for c in units})
        labels = dict(zip(axes, key, strict=True))
        spread = float(group[metric].std() or 0.0)
        rows.append(
            {**labels, "mean": found.mean, "low": found.low, "high": found.high,
             "deviation": spread, "variants": len(group)}
        )  # fmt: skip
    return pl.DataFrame(rows, infer_schema_length=None)


def effects(
    frame: "pl.DataFrame", axes: Sequence[str], metric: str, by: Sequence[str]
) -> "pl.DataFrame":
    """Return for each value of each axis how far its mean is from the mean of all values.

    The difference is taken within each unit, so that what homes and lives have in common is out.
    """
    import polars as pl

    rows = []
    for axis in axes:
        known = frame.filter(pl.col(axis).is_not_null())
        labels = known.get_column(axis).unique(maintain_order=True).to_list()
        if len(labels) < 2:
            continue
        cells = by_units(known, [*by, axis], (metric,))
        over = list(by) or [pl.lit(0)]
        cells = cells.with_columns(pl.col(metric) - pl.col(metric).mean().over(over))
        for label in labels:
            mine = cells.filter(pl.col(axis) == label)
            found = estimate(mine[metric].to_numpy(), {c: mine[c].to_list() for c in by})
            rows.append(
                {"axis": axis, "value": str(label), "effect": found.mean, "low": found.low,
                 "high": found.high}
            )  # fmt: skip
    schema = {"axis": pl.String, "value": pl.String}
    floats = dict.fromkeys(("effect", "low", "high"), pl.Float64)
    return pl.DataFrame(rows, schema={**schema, **floats})


def variance_shares(frame: "pl.DataFrame", columns: Sequence[str], metric: str) -> "pl.DataFrame":
    """Return how much of a metric's variance goes with each axis, and with pairs beyond both.

    The largest first. Of designs that are not balanced the shares may overlap.
    """
    import polars as pl

    values = frame[metric]
    total = float(((values - values.mean()) ** 2).sum()) if len(frame) else 0.0
    varying = [c for c in columns if frame[c].n_unique() > 1]
    rows: list[dict[str, Any]] = []
    if total > 0:
        alone = {column: _between(frame, [column], metric) for column in varying}
        rows += [{"source": c, "share": square / total} for c, square in alone.items()]
        for one, other in itertools.combinations(varying, 2):
            both = _between(frame, [one, other], metric) - alone[one] - alone[other]
            cells = frame.select(one, other).n_unique()
            if cells < len(frame):  # else it is what is left over, not an interaction
                rows.append({"source": f"{one} × {other}", "share": max(both, 0.0) / total})
    table = pl.DataFrame(rows, schema={"source": pl.String, "share": pl.Float64})
    return table.sort("share", descending=True)


def _between(frame: "pl.DataFrame", columns: Sequence[str], metric: str) -> float:
    """Return the sum of squares between the cells of columns."""
    import polars as pl

    cells = frame.group_by(list(columns)).agg(pl.col(metric).mean(), pl.len().alias(VARIANT))
    grand = float(frame[metric].mean())
    return float((cells[VARIANT] * (cells[metric] - grand) ** 2).sum())
