"""A picture of a fit: curves beside what was observed, and predicted against observed."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fleet2d.calibrate.likelihood import wilson
from fleet2d.calibrate.log import recognized
from fleet2d.calibrate.perception import Calibration, Group
from fleet2d.errors import InputError
from fleet2d.view.floorplan import check_picture, drawing_style, save_figure

try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
except ImportError:
    raise InputError('drawing needs matplotlib: pip install "fleet2d[viz]"') from None

F64 = NDArray[np.float64]
Flags = NDArray[np.bool_]

BINS = 12
LEAST = 10  # rows in a bin, on the average; else there are fewer bins
FITTED, SEEN = "#2b6cb0", "#3d4148"


def draw_fit(found: Calibration, target: Path) -> None:
    """Draw a fit to a file.

    Raises:
        InputError: The name ends with neither `.png` nor `.svg`, or the file can't be written.
    """
    check_picture(target)
    with drawing_style():
        figure = _figure(found)
        save_figure(figure, target)


def _figure(found: Calibration) -> Figure:
    """Return a panel for each quantity of the log, and predicted against observed."""
    log, shares = found.log, found.detection.fit.shares
    panels: list[tuple[str, str, F64, Flags, F64]] = []
    for label, values in (
        ("distance [m]", log.distance),
        ("angle off the optical axis [deg]", log.bearing),
        ("turned away from the camera [deg]", log.orientation),
    ):
        if values is not None:
            panels.append(("noticed", label, values, log.detected, shares))
    if found.identity is not None:
        distance, right = log.distance[log.detected], recognized(log)
        fitted = found.identity.right.fit.shares
        panels.append(("recognized, if noticed", "distance [m]", distance, right, fitted))
    figure = Figure(figsize=(3.4 * (len(panels) + 1), 3.4), layout="constrained", dpi=150)
    axes = figure.subplots(1, len(panels) + 1, squeeze=False)[0]
    for each, (what, label, values, hits, fitted) in zip(axes[:-1], panels, strict=True):
        _by(each, values, hits, fitted)
        each.set(xlabel=label, ylim=(0, 1.02), ylabel=what)
    axes[0].legend(frameon=False, fontsize=8, loc="upper right")
    _predicted(axes[-1], found.detection.groups)
    for each in axes:
        each.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"{log.path.name}: {len(log)} times in view", fontsize=10)
    return figure


def _by(axes: Axes, values: F64, detected: Flags, shares: F64) -> None:
    """Draw observed shares with their intervals, and the fit's mean over the same rows."""
    bins = min(BINS, max(1, len(values) // LEAST))
    edges = np.quantile(values, np.linspace(0, 1, bins + 1))
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)
    rows = []
    for part in range(bins):
        inside = index == part
        if inside.any():
            hit = wilson(int(detected[inside].sum()), int(inside.sum()))
            ends = (hit.value - (hit.low or 0.0), (hit.high or 1.0) - hit.value)
            rows.append((values[inside].mean(), hit.value, *ends, shares[inside].mean()))
    x, y, below, above, fit = np.array(rows).T
    axes.plot(x, fit, color=FITTED, lw=2, label="fitted")
    axes.errorbar(
        x, y, yerr=[below, above], fmt="o", ms=4, color=SEEN, lw=1, label="observed, 95 %"
    )


def _predicted(axes: Axes, groups: list[Group]) -> None:
    axes.plot([0, 1], [0, 1], color="#b0b5bd", lw=1)
    for group in groups:
        low, high = group.observed.low or 0.0, group.observed.high or 1.0
        axes.plot([group.predicted] * 2, [low, high], color=SEEN, lw=1)
        axes.plot(group.predicted, group.observed.value, "o", ms=4, color=SEEN)
    axes.set(xlabel="predicted", ylabel="observed", xlim=(0, 1), ylim=(0, 1))
