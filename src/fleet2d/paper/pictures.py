"""The figures of the results."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.errors import extra
from fleet2d.metrics.rtp_score import GAPS
from fleet2d.paper import results
from fleet2d.paper.results import Result, interval
from fleet2d.pictures.floorplan import check_picture, drawing_style, save_figure

with extra("viz", "drawing needs matplotlib"):
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

DPI = 150
SIZE = (8.4, 4.4)
COLORS = (
    "#b5305c", "#2c6fb0", "#3f8a4f", "#c26a12", "#8153b5", "#1f8a8c", "#8a6d3b", "#5b6770",
)  # fmt: skip
DARK, PALE = "#2d3138", "#b9bec6"
NEVER_SEEN = GAPS[-1]  # no time: it can't be drawn on a time axis
ROOMS = 6  # with the largest gaps, which get a colour and a name; other rooms are pale


def draw(result: Result, path: Path) -> None:
    """Draw a result to a file; the same numbers give the same bytes.

    Raises:
        InputError: The name ends with neither `.png` nor `.svg`, or the file can't be written.
    """
    check_picture(path)
    with drawing_style():
        figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
        axes = figure.subplots()
        axes.spines[["top", "right"]].set_visible(False)
        DRAWERS[result.name](result.numbers, axes)
        save_figure(figure, path)


def draw_speed(numbers: Mapping[str, Any], axes: Axes) -> None:
    """Draw the speed of each row in times real time."""
    rows = [row for row in numbers["rows"] if "speedup" in row][::-1]
    speedups = [row["speedup"] for row in rows]
    positions = np.arange(len(rows))
    axes.barh(positions, speedups, 0.62, color=COLORS[1])
    for y, value in zip(positions, speedups, strict=True):
        axes.text(value * 1.12, float(y), f"{value:,.0f}", va="center", fontsize=8, color=DARK)
    axes.set_yticks(positions, [row["case"] for row in rows], fontsize=8)
    axes.set_xscale("log")
    axes.set_xlim(1, max(speedups) * 8)
    pairs = zip(rows, positions, strict=True)
    markers = [(row["paper_speedup"], y) for row, y in pairs if "paper_speedup" in row]
    axes.plot(
        *zip(*markers, strict=True), "D", ms=5, color=COLORS[0], label="the paper's", ls="none"
    )
    axes.legend(frameon=False, fontsize=8, loc="upper right", bbox_to_anchor=(1, 1.06))
    axes.set_xlabel("times real time")


def draw_ltp_gap(numbers: Mapping[str, Any], axes: Axes) -> None:
    """Draw the gap of each room over days, and of all rooms with their band over robots."""
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
    axes.set_xlabel("day")
    axes.set_ylabel("|estimated − true| share of time at home")
    axes.set_ylim(bottom=0)
    axes.set_xlim(1, max(2, numbers["days"]))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(frameon=False, fontsize=8)


def draw_rtp_gap(numbers: Mapping[str, Any], axes: Axes) -> None:
    """Draw the share of right rooms by gap, with intervals."""
    rows = numbers["means"]["top_1"]
    gaps = [gap for gap in GAPS if gap in rows[results.NAIVE_GUESS] and gap != NEVER_SEEN]
    for number, (name, by_gap) in enumerate(rows.items()):
        is_naive = name == results.NAIVE_GUESS
        values = np.array([by_gap[gap] for gap in gaps])
        x = np.arange(len(gaps)) + 0.06 * (number - (len(rows) - 1) / 2)
        axes.errorbar(
            x,
            values[:, 0],
            yerr=np.abs(values[:, 1:] - values[:, :1]).T,
            fmt="s--" if is_naive else "o-",
            color=DARK if is_naive else COLORS[number],
            lw=1.2,
            ms=4,
            capsize=2,
            label="naive: where last seen" if is_naive else name.replace("_", " "),
        )
    axes.set_xticks(range(len(gaps)), gaps)
    axes.set_xlabel("time since the user was last seen")
    axes.set_ylabel("share of right rooms")
    axes.set_ylim(0, 1)
    axes.legend(frameon=False, fontsize=8, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1))


def draw_feedback(numbers: Mapping[str, Any], axes: Axes) -> None:
    """Draw the mean errors of estimators under each policy, with intervals."""
    tv = numbers["tv"]
    for number, estimator in enumerate(results.ESTIMATORS):
        cells = np.array([interval(by[estimator]) for by in tv.values()])
        x = np.arange(len(tv)) + 0.16 * (number - (len(results.ESTIMATORS) - 1) / 2)
        ends = np.abs(cells[:, 1:] - cells[:, :1]).T
        label = estimator.replace("_", " ")
        axes.bar(x, cells[:, 0], 0.15, color=COLORS[number], label=label)
        axes.errorbar(x, cells[:, 0], yerr=ends, fmt="none", ecolor=DARK, elinewidth=0.8)
    axes.set_xticks(range(len(tv)), [_broken_lines(policy) for policy in tv], fontsize=8)
    axes.set_ylabel("total variation from the truth")
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, fontsize=8, ncols=2)


def _broken_lines(policy: str) -> str:
    """Return the name of a policy with line breaks between its parts."""
    return policy.replace(", ", ",\n").replace(" at ", "\nat ").replace(" by ", "\nby ")


DRAWERS: dict[str, Callable[[Mapping[str, Any], Axes], None]] = {
    results.SPEED: draw_speed,
    results.LTP_GAP: draw_ltp_gap,
    results.RTP_GAP: draw_rtp_gap,
    results.FEEDBACK: draw_feedback,
}
