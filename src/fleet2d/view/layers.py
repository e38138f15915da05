"""Draw a layer of a stored run over its floor plan, with a scale of its colours."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fleet2d.artifacts.layers import PREFIX
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.palette import TEXT_COLOR
from fleet2d.runs.layers import layer_steps, read_layer
from fleet2d.runs.run import Run
from fleet2d.view.floorplan import (
    DPI,
    check_picture,
    drawing_style,
    figure_size,
    floorplan_axes,
    save_figure,
)
from fleet2d.view.theme import SCALE

# The brighter part of viridis: names of rooms are written over it.
COLORS = ListedColormap(mpl.colormaps["viridis"](np.linspace(0.35, 1.0, 256)))
SEEN_COLOR = (0.12, 0.53, 0.54)
SOLID = 0.75
BAR_IN = 0.95  # beside the plan: the scale of the colours and its words


def draw_layer(run: Run, name: str, path: Path, step: int | None = None) -> None:
    """Draw a layer of a run to a PNG or SVG file; the same layer gives the same bytes.

    Args:
        run: The run.
        name: The layer, such as ``explored.astro``.
        path: Where to; the name ends with `.png` or `.svg`. A file there is replaced.
        step: After which step, one of those after which it was stored; None for the last.

    Raises:
        ArtifactError: The run stored no such layer, or not after that step.
        InputError: The name ends otherwise, or the file can't be written.
    """
    check_picture(path)
    values = read_layer(run, name, step)
    step = layer_steps(run, name)[-1] if step is None else step
    field = run.tables[f"{PREFIX}{name}"].schema.field("value")
    unit = (field.metadata or {}).get(b"unit", b"").decode()
    plan = run.plan
    with drawing_style():
        width, height = figure_size(plan)
        beside = 0.0 if values.dtype == np.bool_ else BAR_IN
        figure = Figure(figsize=(width + beside, height), dpi=DPI)
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, width / (width + beside), 1))
        floorplan_axes(plan, axes, title=False)
        shown = layer_on_axes(plan, values, axes)
        words = f"{name}{f' [{unit}]' if unit else ''}, after step {step}"
        x0, _, _, y1 = plan.bounds
        axes.text(x0, y1 + 0.3, words, fontsize=11, color=TEXT_COLOR, va="bottom", zorder=5)
        if shown is not None:
            bar = figure.add_axes(((width + 0.1) / (width + beside), 0.12, 0.018, 0.76))
            figure.colorbar(shown, cax=bar).ax.tick_params(labelsize=8)
        save_figure(figure, path)


def layer_on_axes(plan: FloorPlan, values: NDArray[Any], axes: Axes) -> ScalarMappable | None:
    """Draw a layer's values over a floor plan; return what a scale of colours is made from.

    Cells that aren't free are left out, and those of no value; of a layer of step numbers, -1 is
    no value.

    Args:
        plan: The floor plan, drawn already.
        values: (rows, columns); of bool, cells that are true are tinted, and there is no scale.
        axes: Where to draw, in metres.
    """
    image = np.zeros((*values.shape, 4))
    shown: ScalarMappable | None = None
    if values.dtype == np.bool_:
        image[plan.free & values] = (*SEEN_COLOR, SOLID)
    else:
        there = plan.free & ~np.isnan(values.astype(np.float64))
        if values.dtype.kind == "i" and (values[there] >= -1).all():
            there &= values >= 0
        inside = values[there].astype(np.float64)
        low, high = (float(inside.min()), float(inside.max())) if inside.size else (0.0, 1.0)
        shown = ScalarMappable(Normalize(low, high if high > low else low + 1.0), COLORS)
        image[there] = shown.to_rgba(inside)
        image[there, 3] = SOLID
    left, bottom = plan.lattice.origin
    width, height = (n * plan.lattice.cell for n in (plan.lattice.columns, plan.lattice.rows))
    extent = (left, left + width, bottom, bottom + height)
    axes.imshow(
        image, extent=extent, origin="lower", interpolation="nearest", zorder=2.1, label=SCALE
    )
    return shown
