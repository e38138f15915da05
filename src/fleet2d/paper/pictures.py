"""The figures of the results."""

import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fleet2d.metrics.rtp_score import GAPS
from fleet2d.paper.results import FEEDBACK, LTP_GAP, RTP_GAP, SPEED, Result
from fleet2d.pictures.floorplan import write_picture
from fleet2d.studies.figures import COLORS, DARK, draw_interaction

DPI = 150
SIZE = (8.4, 4.4)
PALE = "#b9bec6"
DRAWN_GAPS = GAPS[:-1]  # without `never seen`, which is no time
ROOMS = 6  # with the largest gaps, which get a colour and a name; other rooms are pale


def draw(result: Result, path: Path) -> None:
    """Draw a result to a file; the same numbers give the same bytes.

    Raises:
        InputError: The name ends with neither `.png` nor `.svg`, or the file can't be written.
    """
    write_picture(path, lambda: DRAWERS[result.name](result.numbers))


def _figure() -> tuple[Figure, Axes]:
    figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
    axes = figure.subplots()
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def draw_speed(numbers: Mapping[str, Any]) -> Figure:
    """Draw the speed of each row in times real time."""
    figure, axes = _figure()
    rows = [row for row in numbers["rows"] if "speedup" in row][::-1]
    speedups = [row["speedup"] for row in rows]
    positions = np.arange(len(rows))
    axes.barh(positions, speedups, 0.62, color=COLORS[1])
    for y, value in zip(positions, speedups, strict=True):
        axes.text(value * 1.12, float(y), f"{value:,.0f}", va="center", fontsize=8, color=DARK)
    axes.set_yticks(positions, [row["case"] for row in rows], fontsize=8)
    axes.set(xlabel="times real time", xscale="log", xlim=(1, max(speedups) * 8))
    pairs = zip(rows, positions, strict=True)
    markers = [(row["paper_speedup"], y) for row, y in pairs if "paper_speedup" in row]
    axes.plot(
        *zip(*markers, strict=True), "D", ms=5, color=COLORS[0], label="the paper's", ls="none"
    )
    axes.legend(frameon=False, fontsize=8, loc="upper right", bbox_to_anchor=(1, 1.06))
    return figure


def draw_ltp_gap(numbers: Mapping[str, Any]) -> Figure:
    """Draw the gap of each room over days, and of all rooms with their band over robots."""
    figure, axes = _figure()
    days = np.arange(1, numbers["days"] + 1)
    by_size = sorted(numbers["mean"].items(), key=lambda item: -float(np.mean(item[1])))
    for number, (room, line) in enumerate(by_size):
        is_large = number < ROOMS
        color = COLORS[number] if is_large else PALE
        label = room if is_large else ("other rooms" if number == ROOMS else None)
        axes.plot(days, line, lw=1.1, color=color, label=label, zorder=3 if is_large else 2)
    overall = numbers["all_rooms"]
    label = f"all rooms, band of 80 % of {numbers['robots']} robots"
    axes.fill_between(days, overall["low"], overall["high"], color=DARK, alpha=0.18, lw=0, zorder=1)
    axes.plot(days, overall["mean"], lw=2.2, color=DARK, label=label, zorder=4)
    axes.set(xlabel="day", ylabel="|estimated − true| share of time at home")
    axes.set(xlim=(1, max(2, numbers["days"])), ylim=(0, None))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(frameon=False, fontsize=8)
    return figure


def draw_rtp_gap(numbers: Mapping[str, Any]) -> Figure:
    """Draw the share of right rooms by gap, with intervals."""
    rows = [row for row in numbers["means"]["top_1"] if row["gap"] in DRAWN_GAPS]
    means = pl.DataFrame(rows).rename({"gap": "time since the user was last seen"})
    figure = draw_interaction(means, means.columns[1], "model", "share of right rooms")
    figure.set_size_inches(*SIZE)
    figure.axes[0].set_ylim(0, 1)
    return figure


def draw_feedback(numbers: Mapping[str, Any]) -> Figure:
    """Draw the mean errors of estimators under each policy, with intervals."""
    figure, axes = _figure()
    estimators = pl.DataFrame(numbers["means"]).partition_by("estimator", maintain_order=True)
    for number, of in enumerate(estimators):
        x = np.arange(len(of)) + 0.16 * (number - (len(estimators) - 1) / 2)
        mean, low, high = of.select("mean", "low", "high").to_numpy().T
        label = of["estimator"][0].replace("_", " ")
        ends = (mean - low, high - mean)
        axes.bar(x, mean, 0.15, yerr=ends, color=COLORS[number], label=label, ecolor=DARK)
    policies = [textwrap.fill(name, 18) for name in estimators[0]["robot"]]
    axes.set_xticks(range(len(policies)), policies, fontsize=8)
    axes.set(ylabel="total variation from the truth", ylim=(0, None))
    axes.legend(frameon=False, fontsize=8, ncols=2)
    return figure


DRAWERS: Mapping[str, Callable[[Mapping[str, Any]], Figure]] = {
    SPEED: draw_speed,
    LTP_GAP: draw_ltp_gap,
    RTP_GAP: draw_rtp_gap,
    FEEDBACK: draw_feedback,
}
