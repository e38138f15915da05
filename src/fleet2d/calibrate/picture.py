"""Pictures of fits: curves with observed shares, and predicted against observed probabilities."""

from pathlib import Path

import numpy as np

from fleet2d.calibrate.likelihood import wilson
from fleet2d.calibrate.log import recognized
from fleet2d.calibrate.perception import Calibration, ProbabilityGroup
from fleet2d.errors import extra
from fleet2d.kernels import F64, Bool
from fleet2d.pictures.floorplan import check_picture, drawing_style, save_figure

with extra("viz", "drawing needs matplotlib"):
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


BINS = 12
LEAST = 10  # the least mean number of rows per bin
FIT_COLOR, OBSERVED_COLOR = "#2b6cb0", "#3d4148"


def draw_fit(calibration: Calibration, target: Path) -> None:
    """Draw a fit to a file.

    Raises:
        InputError: The name ends with neither `.png` nor `.svg`, or the file can't be written.
    """
    check_picture(target)
    with drawing_style():
        figure = _figure(calibration)
        save_figure(figure, target)


def _figure(calibration: Calibration) -> Figure:
    """Return a figure with a panel for each quantity, and one of predicted against observed."""
    log, shares = calibration.log, calibration.detection.fit.shares
    panels: list[tuple[str, str, F64, Bool, F64]] = []
    for label, values in (
        ("distance [m]", log.distance),
        ("angle off the optical axis [deg]", log.bearing),
        ("turned away from the camera [deg]", log.orientation),
    ):
        if values is not None:
            panels.append(("noticed", label, values, log.detected, shares))
    if calibration.identity is not None:
        distance, right = log.distance[log.detected], recognized(log)
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
    axes.plot(x, fit, color=FIT_COLOR, lw=2, label="fitted")
    axes.errorbar(
        x, y, yerr=[below, above], fmt="o", ms=4, color=OBSERVED_COLOR, lw=1, label="observed, 95 %"
    )


def _draw_groups(axes: Axes, groups: list[ProbabilityGroup]) -> None:
    """Draw observed against predicted probabilities, with intervals."""
    axes.plot([0, 1], [0, 1], color="#b0b5bd", lw=1)
    for group in groups:
        low, high = group.observed.low or 0.0, group.observed.high or 1.0
        axes.plot([group.predicted] * 2, [low, high], color=OBSERVED_COLOR, lw=1)
        axes.plot(group.predicted, group.observed.value, "o", ms=4, color=OBSERVED_COLOR)
    axes.set(xlabel="predicted", ylabel="observed", xlim=(0, 1), ylim=(0, 1))
