"""The figures of a study: comparisons, means by axis, distributions, and courses over time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.errors import InputError
from fleet2d.studies.intervals import estimate
from fleet2d.studies.timeseries import DAY, VALUE

try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
except ImportError:
    raise InputError('drawing needs matplotlib: pip install "fleet2d[viz]"') from None

if TYPE_CHECKING:
    import polars as pl

DPI = 120
COLORS = (
    "#2c6fb0", "#b5305c", "#3f8a4f", "#c26a12", "#8153b5", "#1f8a8c", "#8a6d3b", "#5b6770",
)  # fmt: skip
DARK, PALE = "#2d3138", "#c4c9d0"
MOST_LINES = 8
MOST_LABELS = 24
MOMENTS = 60


def draw_comparison(table: "pl.DataFrame", axis: str, reference: Any, metric: str) -> Figure:
    """Draw differences to a reference with their intervals, a row each."""
    rows = table.to_dicts()[::-1]
    figure, axes = _figure(0.42 * len(rows) + 1.1)
    for y, row in enumerate(rows):
        clear = row["low"] > 0 or row["high"] < 0
        color = COLORS[0] if clear else PALE
        axes.plot([row["low"], row["high"]], [y, y], color=color, lw=2.2, solid_capstyle="butt")
        axes.plot(row["difference"], y, "o", color=color, ms=6)
    axes.axvline(0, color=DARK, lw=0.8)
    known = {axis, "mean", "reference", "difference", "low", "high", "pairs", "verdict"}
    within = [c for c in table.columns if c not in known and not c.startswith(("n_", "variance_"))]
    labels = [", ".join([str(row[axis]), *(f"{c} {row[c]}" for c in within)]) for row in rows]
    axes.set_yticks(range(len(rows)), labels)
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.set_xlabel(f"{metric}: difference to {axis} = {reference}")
    return figure


def draw_means(tables: "dict[str, pl.DataFrame]", metric: str) -> Figure:
    """Draw the mean of a metric by value of each axis, a panel an axis."""
    figure = Figure(figsize=(8.0, 2.8), dpi=DPI, layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, max(len(tables), 1), sharey=True))
    for panel, (axis, table) in zip(panels, tables.items(), strict=False):
        _tidy(panel)
        rows = table.to_dicts()
        at = np.arange(len(rows))
        means = np.array([row["mean"] for row in rows])
        ends = np.array([[row["low"], row["high"]] for row in rows])
        numeric = all(isinstance(row[axis], int | float) for row in rows)
        if numeric:
            at = np.array([row[axis] for row in rows], np.float64)
        known = np.isfinite(ends).all(axis=1)
        errors = np.abs(ends[known] - means[known, None]).T
        panel.errorbar(at[known], means[known], yerr=errors, fmt="none", ecolor=PALE, lw=2)
        panel.plot(at, means, "o-" if numeric else "o", color=COLORS[0], ms=5, lw=1)
        if not numeric:
            _label(panel, [str(row[axis]) for row in rows])
        panel.set_xlabel(axis)
    panels[0].set_ylabel(metric)
    return figure


def draw_distribution(frame: "pl.DataFrame", metric: str, axis: str | None) -> Figure:
    """Draw every variant's value, by value of an axis, with median and quartiles."""
    import polars as pl

    labels = [None] if axis is None else frame[axis].unique(maintain_order=True).to_list()
    figure, axes = _figure(2.8)
    generator = np.random.Generator(np.random.Philox(key=1))
    for x, label in enumerate(labels):
        mine = frame if axis is None else frame.filter(pl.col(axis).eq_missing(label))
        values = mine[metric].to_numpy()
        shift = generator.uniform(-0.22, 0.22, len(values))
        axes.plot(x + shift, values, ".", color=PALE, ms=4, zorder=1)
        low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
        axes.plot([x, x], [low, high], color=COLORS[0], lw=5, alpha=0.5, solid_capstyle="butt")
        axes.plot([x - 0.16, x + 0.16], [middle, middle], color=DARK, lw=1.6)
    _label(axes, ["all" if label is None else str(label) for label in labels])
    axes.set_xlabel(axis or "")
    axes.set_ylabel(metric)
    return figure


def draw_course(
    frame: "pl.DataFrame", metric: str, axis: str | None, units: Sequence[str]
) -> Figure:
    """Draw a metric over simulated days, by value of an axis, with intervals."""
    import polars as pl

    labels = [None] if axis is None else frame[axis].unique(maintain_order=True).to_list()
    days = frame[DAY].unique().sort().to_numpy()
    shown = days[np.unique(np.linspace(0, len(days) - 1, MOMENTS).round().astype(int))]
    figure, axes = _figure(3.0)
    for number, label in enumerate(labels[:MOST_LINES]):
        mine = frame if axis is None else frame.filter(pl.col(axis).eq_missing(label))
        points = []
        for day in shown:
            now = mine.filter(pl.col(DAY) == day).group_by(list(units) or ["variant"])
            cells = now.agg(pl.col(VALUE).mean()).drop_nulls()
            if len(cells):
                levels = {unit: cells[unit].to_list() for unit in units}
                found = estimate(cells[VALUE].to_numpy(), levels, resamples=300)
                points.append((day, found.mean, found.low, found.high))
        at, means, low, high = np.array(points).T
        color = COLORS[number % len(COLORS)]
        axes.fill_between(at, low, high, color=color, alpha=0.15, lw=0)
        axes.plot(at, means, color=color, lw=1.5, label=str(label))
    axes.set_xlabel("simulated time [days]")
    axes.set_ylabel(metric)
    if axis is not None:
        axes.legend(frameon=False, fontsize=8, title=axis, title_fontsize=8)
    return figure


def _figure(height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(8.0, height), dpi=DPI, layout="constrained")
    axes = figure.subplots()
    _tidy(axes)
    return figure, axes


def _tidy(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)


def _label(axes: Axes, labels: Sequence[str]) -> None:
    """Write labels under points 0, 1, 2 …; few of many."""
    every = max(1, -(-len(labels) // MOST_LABELS))
    at = range(0, len(labels), every)
    longest = max(map(len, labels), default=0)
    slanted = longest * len(labels) > 90
    axes.set_xticks(
        at, [labels[i] for i in at], rotation=30 if slanted else 0,
        ha="right" if slanted else "center",
    )  # fmt: skip
    axes.set_xlim(-0.6, len(labels) - 0.4)
