"""A picture of a fit: curves beside what was observed, and predicted against observed."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fleet2d.calibrate.likelihood import wilson
from fleet2d.calibrate.perception import Calibration, Group
from fleet2d.errors import InputError

try:
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
except ImportError:
    raise InputError('drawing needs matplotlib: pip install "fleet2d[viz]"') from None

F64 = NDArray[np.float64]

BINS = 12
LEAST = 5  # rows in a bin that is drawn
FITTED, SEEN = "#2b6cb0", "#3d4148"


def draw_fit(found: Calibration, target: Path) -> None:
    """Draw a fit to a .png or .svg file."""
    log, shares = found.log, found.detection.fit.shares
    panels: list[tuple[str, F64]] = [("distance [m]", log.distance)]
    if log.bearing is not None:
        panels.append(("angle off the optical axis [deg]", log.bearing))
    if log.orientation is not None:
        panels.append(("turned away from the camera [deg]", log.orientation))
    figure = Figure(figsize=(3.4 * (len(panels) + 1), 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, len(panels) + 1, squeeze=False)[0]
    for each, (label, values) in zip(axes[:-1], panels, strict=True):
        _by(each, values, log.detected, shares)
        each.set(xlabel=label, ylim=(0, 1.02), ylabel="noticed")
    axes[0].legend(frameon=False, fontsize=8, loc="lower left")
    _predicted(axes[-1], found.detection.groups)
    for each in axes:
        each.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"{log.path.name}: {len(log)} times in view", fontsize=10)
    figure.savefig(target, dpi=150)


def _by(axes: Axes, values: F64, detected: NDArray[np.bool_], shares: F64) -> None:
    """Draw observed shares with their intervals, and the fit's mean over the same rows."""
    edges = np.quantile(values, np.linspace(0, 1, BINS + 1))
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, BINS - 1)
    rows = []
    for part in range(BINS):
        inside = index == part
        if inside.sum() >= LEAST:
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
