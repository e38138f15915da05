"""Pictures of fits: of a persona beside its log, and of probabilities beside observed shares."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.errors import extra
from fleet2d.kernels import F64, Bool
from fleet2d.learning.fit.persona import FittedPersona
from fleet2d.learning.fit.timeline import LivedDay, Timeline, by_hour, dwell_times, shares
from fleet2d.learning.fit.validation import sample_markov, sample_persona
from fleet2d.logs.log import AWAY
from fleet2d.palette import OTHER_COLOR, ROOM_COLORS
from fleet2d.viewing.pictures.floorplan import write_picture

if TYPE_CHECKING:  # they need scipy, which the picture of a persona doesn't
    from fleet2d.learning.fit.perception import Calibration, ProbabilityGroup

SAMPLED = 140
LABELS = ("log", "persona", "Markov chain")
LINES = ("#222222", "#c2410c", "#9aa5b1")
BINS = 12
MIN_ROWS_PER_BIN = 10  # the smallest mean number of rows per bin
FIT_COLOR = "#2b6cb0"
OBSERVED_COLOR = "#3d4148"


def draw_persona(
    timeline: Timeline, days: Sequence[LivedDay], fitted: FittedPersona, target: Path, seed: int = 0
) -> None:
    """Draw the days of the log, of the persona and of a Markov chain next to each other.

    At the top: the shares of the rooms in each hour. At the bottom: the distribution function of
    the durations of stays, room by room.

    Raises:
        InputError: The file name has another suffix, or the file can't be written.
    """
    write_picture(target, lambda: _persona_figure(timeline, days, fitted, seed))


def _persona_figure(
    timeline: Timeline, days: Sequence[LivedDay], fitted: FittedPersona, seed: int
) -> "Figure":
    count = len(timeline.places)
    real = timeline.rooms[[day.number for day in days]]
    sampled = sample_persona(fitted, timeline, SAMPLED, seed)[1]
    sets = (real, sampled, sample_markov(real, count, SAMPLED, seed))
    colors = {place: ROOM_COLORS.get(place, OTHER_COLOR) for place in timeline.places}
    colors[AWAY] = "white"
    figure = Figure(figsize=(2.1 * max(3, count), 5.2), dpi=150, layout="constrained")
    upper: Any
    lower: Any
    upper, lower = figure.subfigures(2, 1)  # type: ignore[misc]
    panels = upper.subplots(1, 3, sharey=True)
    for axes, labels, label in zip(panels, sets, LABELS, strict=True):
        stacked = np.cumsum(by_hour(labels, count), axis=1)
        below = np.zeros(24)
        for above, place in zip(stacked.T, timeline.places, strict=True):
            style = {"color": colors[place], "edgecolor": "#d0d0d0", "linewidth": 0.3}
            axes.bar(np.arange(24) + 0.5, above - below, 1, below, label=place, **style)
            below = above
        axes.set(title=label, xlim=(0, 24), ylim=(0, 1), xticks=(0, 6, 12, 18, 24))
        axes.set_xlabel("hour of the day")
    upper.axes[0].set_ylabel("share of the time")
    handles, names = upper.axes[0].get_legend_handles_labels()
    upper.legend(handles, names, loc="outside right upper", frameon=False, fontsize=8)
    _draw_stays(lower.subplots(1, count, sharey=True, squeeze=False)[0], sets, timeline)
    return figure


def _draw_stays(panels: Sequence[Any], sets: Sequence[Any], timeline: Timeline) -> None:
    count = len(timeline.places)
    stays = [dwell_times(labels, count) for labels in sets]
    share = [shares(labels, count) for labels in sets]
    for i, (axes, place) in enumerate(zip(panels, timeline.places, strict=True)):
        for lengths_by_place, label, color in zip(stays, LABELS, LINES, strict=True):
            lengths = lengths_by_place[i]
            if len(lengths):
                at = np.arange(1, len(lengths) + 1) / len(lengths)
                axes.step(lengths, at, where="post", color=color, linewidth=1.3, label=label)
        percent = " / ".join(f"{100 * part[i]:.0f}" for part in share)
        axes.set_title(f"{place.replace('_', ' ')}\n{percent} %", fontsize=8)
        axes.set(xscale="log", xlim=(1, 1440), ylim=(0, 1), xticks=(1, 10, 100, 1000))
        axes.set_xticklabels(["1", "10", "100", "1000"], fontsize=7)
        axes.set_xlabel("stay [min]", fontsize=8)
    panels[0].set_ylabel("share of the stays\nthat are over")
    panels[0].legend(frameon=False, fontsize=7, loc="lower right")


with extra("viz", "drawing needs matplotlib"):
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_calibration(calibration: "Calibration", target: Path) -> None:
    """Draw a fit to a file.

    Raises:
        InputError: The name ends with neither `.png` nor `.svg`, or the file can't be written.
    """
    write_picture(target, lambda: _figure(calibration))


def _figure(calibration: "Calibration") -> Figure:
    """Return a figure with a panel for each quantity, and one of predicted against observed."""
    from fleet2d.learning.fit.perception import recognized

    log = calibration.log
    shares = calibration.detection.fit.shares
    panels: list[tuple[str, str, F64, Bool, F64]] = []
    for label, values in (
        ("distance [m]", log.distance),
        ("angle off the optical axis [deg]", log.bearing),
        ("turned away from the camera [deg]", log.orientation),
    ):
        if values is not None:
            panels.append(("noticed", label, values, log.detected, shares))
    if calibration.identity is not None:
        distance = log.distance[log.detected]
        right = recognized(log)
        fitted = calibration.identity.right.fit.shares
        panels.append(("recognized, if noticed", "distance [m]", distance, right, fitted))
    figure = Figure(figsize=(3.4 * (len(panels) + 1), 3.4), layout="constrained", dpi=150)
    axes = figure.subplots(1, len(panels) + 1, squeeze=False)[0]
    for panel, (outcome, label, values, hits, fitted) in zip(axes[:-1], panels, strict=True):
        _draw_shares(panel, values, hits, fitted)
        panel.set(xlabel=label, ylim=(0, 1.02), ylabel=outcome)
    axes[0].legend(frameon=False, fontsize=8, loc="upper right")
    _draw_groups(axes[-1], calibration.detection.groups)
    for panel in axes:
        panel.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"{log.path.name}: {len(log)} times in view", fontsize=10)
    return figure


def _draw_shares(axes: Axes, values: F64, detected: Bool, shares: F64) -> None:
    """Draw observed shares with their intervals, and the mean fitted share of the same rows."""
    from fleet2d.learning.fit.likelihood import wilson

    bins = min(BINS, max(1, len(values) // MIN_ROWS_PER_BIN))
    edges = np.quantile(values, np.linspace(0, 1, bins + 1))
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)
    rows = []
    for part in range(bins):
        inside = index == part
        if inside.any():
            hit = wilson(int(detected[inside].sum()), int(inside.sum()))
            below = hit.value - (hit.low or 0.0)
            above = (hit.high or 1.0) - hit.value
            fitted = shares[inside].mean()
            rows.append((values[inside].mean(), hit.value, below, above, fitted))
    x, y, *reach, fit = np.array(rows).T
    axes.plot(x, fit, color=FIT_COLOR, lw=2, label="fitted")
    style: dict[str, Any] = {"fmt": "o", "ms": 4, "color": OBSERVED_COLOR, "lw": 1}
    axes.errorbar(x, y, reach, label="observed, 95 %", **style)


def _draw_groups(axes: Axes, groups: "list[ProbabilityGroup]") -> None:
    """Draw observed against predicted probabilities, with intervals."""
    axes.plot([0, 1], [0, 1], color="#b0b5bd", lw=1)
    for group in groups:
        interval = [group.observed.low or 0.0, group.observed.high or 1.0]
        axes.plot([group.predicted] * 2, interval, color=OBSERVED_COLOR, lw=1)
        axes.plot(group.predicted, group.observed.value, "o", ms=4, color=OBSERVED_COLOR)
    axes.set(xlabel="predicted", ylabel="observed", xlim=(0, 1), ylim=(0, 1))
