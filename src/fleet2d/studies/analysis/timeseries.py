"""A metric over simulated time, from the tables that a study keeps."""

from typing import TYPE_CHECKING

from fleet2d.studies.data.parts import VARIANT

if TYPE_CHECKING:
    import polars as pl

    from fleet2d.studies.analysis.reader import Study

VALUE, DAY = "value", "day"
_US_A_DAY = 86_400_000_000
_CLOCK = (VARIANT, "step", "time")


def over_time(study: "Study", metric: str) -> "pl.DataFrame | None":
    """Return a metric at each moment: columns `variant`, `day`, `value` and the axes.

    The first part of the metric's name is the table, the last part the column, and the parts
    between select rows: `ltp_error.ana.tv` is column `tv` of the rows of ana in `ltp_error`.

    Returns:
        The rows by variant and day; None if the study keeps no such table.
    """
    import polars as pl

    name, *middle, end = metric.split(".")
    if name not in study.tables:
        return None
    rows = study.polars(name)
    schema = rows.collect_schema()
    columns = [c for c in schema if c not in (*_CLOCK, *study.columns)]
    numbers = [c for c in columns if schema[c].is_float()]
    texts = [c for c in columns if schema[c] == pl.String]
    if end in numbers:
        column, selectors = end, middle
    elif numbers:
        column, selectors = numbers[0], [*middle, end]
    else:
        return None
    for selector in selectors:
        if not texts:
            return None
        rows = rows.filter(pl.any_horizontal(pl.col(c) == selector for c in texts))
    start = pl.col("time").dt.truncate("1d").min().over(VARIANT)
    day = (pl.col("time") - start).dt.total_microseconds() / _US_A_DAY
    return (
        rows.with_columns(day.alias(DAY), pl.col(column).alias(VALUE))
        .group_by(VARIANT, DAY, *study.columns)
        .agg(pl.col(VALUE).mean())
        .sort(VARIANT, DAY)
        .collect()
    )
