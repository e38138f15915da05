"""The figures of a report: comparisons, differences of units, and metrics over time."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.errors import extra
from fleet2d.runtime.clock import DAY_US
from fleet2d.studies.intervals import estimate
from fleet2d.studies.results import VARIANT

if TYPE_CHECKING:
    import polars as pl

    from fleet2d.studies.reader import Study


VALUE = "value"
DAY = "day"
_CLOCK = (VARIANT, "step", "time")


def over_time(study: "Study", metric: str) -> "pl.DataFrame | None":
    """Return a metric at each moment: columns `variant`, `day`, `value` and the axes.

    `day` is the simulated time since the start of the run, in days.

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
        column = end
        selectors = middle
    elif numbers:
        column = numbers[0]
        selectors = [*middle, end]
    else:
        return None
    for selector in selectors:
        if not texts:
            return None
        rows = rows.filter(pl.any_horizontal(pl.col(c) == selector for c in texts))
    step = pl.col("step")
    time = pl.col("time")
    step_us = (time.max() - time.min()).dt.total_microseconds() / (step.max() - step.min())
    midnight = time.dt.truncate("1d").min()
    # Of one moment alone only the time of day is known.
    since_midnight = (time - midnight.over(VARIANT)).dt.total_microseconds()
    has_moments = (step.max() > step.min()).over(VARIANT)
    elapsed_us = pl.when(has_moments).then(step * step_us.over(VARIANT)).otherwise(since_midnight)
    day = elapsed_us / DAY_US
    return (
        rows.with_columns(day.alias(DAY), pl.col(column).alias(VALUE))
        .group_by(VARIANT, DAY, *study.columns, maintain_order=True)
        .agg(pl.col(VALUE).mean())
        .sort(VARIANT, DAY)
        .collect()
    )


with extra("viz", "drawing needs matplotlib"):
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


DPI = 120
COLORS = (
    "#2c6fb0", "#b5305c", "#3f8a4f", "#c26a12", "#8153b5", "#1f8a8c", "#8a6d3b", "#5b6770",
)  # fmt: skip
DARK = "#2d3138"
PALE = "#c4c9d0"
MAX_LINES = 8
MAX_LABELS = 24
MOMENTS = 60  # maximum number of points of a line over time


def draw_comparison(table: "pl.DataFrame", axis: str, reference: Any, label: str) -> Figure:
    """Draw differences to a reference with their intervals, one row for each value of an axis.

    Clear differences are coloured; intervals that can't be trusted are left out.

    Args:
        table: The comparison; its columns before `mean` are the axis and those within it.
        axis: The axis.
        reference: Its reference value.
        label: The metric with its unit.
    """
    rows = table.to_dicts()[::-1]
    figure, axes = _figure(0.42 * len(rows) + 1.1)
    inner_axes = table.columns[1 : table.get_column_index("mean")]
    labels = []
    for y, row in enumerate(rows):
        color = COLORS[0] if row["clear"] else PALE
        if not row["doubt"]:
            axes.plot([row["low"], row["high"]], [y, y], color=color, lw=2.2, solid_capstyle="butt")
        axes.plot(row["difference"], y, "o", color=color, ms=6)
        inner_labels = [f"{column} {row[column]}" for column in inner_axes]
        labels.append(", ".join([str(row[axis]), *inner_labels]))
    axes.axvline(0, color=DARK, lw=0.8)
    axes.set_yticks(range(len(rows)), labels)
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.set_xlabel(f"{label}: difference to {axis} = {reference}")
    return figure


def draw_unit_differences(
    rows: "pl.DataFrame", axes: Sequence[str], unit: str, label: str
) -> Figure:
    """Draw the difference in each unit, the smallest first; a panel for each value of the axes."""
    tables = rows.partition_by(axes, maintain_order=True)[:MAX_LINES]
    figure, panels = _panels(2.6, len(tables))
    for panel, table in zip(panels, tables, strict=True):
        table = table.sort("difference", unit)
        panel.axhline(0, color=DARK, lw=0.8)
        values = table["difference"].to_numpy()
        x = np.arange(len(values))
        panel.vlines(x, 0, values, color=PALE, lw=1.5)
        panel.plot(x, values, "o", color=COLORS[0], ms=4)
        _label(panel, [str(name) for name in table[unit].to_list()], len(tables))
        title = "\n".join(f"{axis} = {table[axis][0]}" for axis in axes)
        panel.set_title(title, fontsize=8 if len(tables) < 4 else 6)
        panel.set_xlabel(unit)
    _label_y(panels[0], f"difference of {label}")
    return figure


def draw_course(
    frame: "pl.DataFrame", label: str, axis: str | None, units: Sequence[str]
) -> Figure:
    """Draw a metric with its interval over simulated days, one line for each value of an axis."""
    import polars as pl

    labels = [None] if axis is None else frame[axis].unique(maintain_order=True).to_list()
    days = frame[DAY].unique().sort().to_numpy()
    numbers = np.linspace(0, len(days) - 1, MOMENTS).round().astype(int)
    moments = days[np.unique(numbers)]
    figure, axes = _figure(3.0)
    for number, value in enumerate(labels[:MAX_LINES]):
        group = frame if axis is None else frame.filter(pl.col(axis).eq_missing(value))
        points = []
        for day in moments:
            rows = group.filter(pl.col(DAY) == day)
            rows = rows.group_by(list(units) or [VARIANT], maintain_order=True)
            cells = rows.agg(pl.col(VALUE).mean()).drop_nulls()
            if len(cells):
                levels = {unit: cells[unit].to_list() for unit in units}
                mean = estimate(cells[VALUE].to_numpy(), levels)
                ends = (math.nan, math.nan) if mean.doubt else (mean.low, mean.high)
                points.append((day, mean.mean, *ends))
        x, means, low, high = np.array(points).T
        color = COLORS[number % len(COLORS)]
        axes.fill_between(x, low, high, color=color, alpha=0.15, lw=0)
        axes.plot(x, means, color=color, lw=1.5, label=str(value))
    axes.set_xlabel("simulated time [days]")
    _label_y(axes, label)
    if axis is not None:
        axes.legend(frameon=False, fontsize=8, title=axis, title_fontsize=8)
    return figure


def _panels(height: float, count: int) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels next to each other."""
    figure = Figure(figsize=(8.0, height), dpi=DPI, layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, count, sharey=True)).tolist()
    for axes in panels:
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
    return figure, panels


def _figure(height: float) -> tuple[Figure, Axes]:
    figure, (axes,) = _panels(height, 1)
    return figure, axes


def _label_y(axes: Axes, label: str) -> None:
    """Label the y axis, with the unit on a line of its own."""
    axes.set_ylabel(label.replace(" [", "\n["), fontsize=9)


def _label(axes: Axes, labels: Sequence[str], panels: int = 1) -> None:
    """Label the x axis at 0, 1, 2 …; of many labels only every n-th is written."""
    stride = max(1, -(-len(labels) * panels // MAX_LABELS))
    ticks = range(0, len(labels), stride)
    longest = max(map(len, labels), default=0)
    is_slanted = longest * len(labels) * panels > 90
    axes.set_xticks(
        ticks, [labels[i] for i in ticks], rotation=30 if is_slanted else 0,
        ha="right" if is_slanted else "center",
    )  # fmt: skip
    axes.set_xlim(-0.6, len(labels) - 0.4)
