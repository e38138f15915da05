"""Draw a layer of a stored run over its floor plan, with a scale of its colours."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from numpy.typing import NDArray

from fleet2d.floorplan.plan import FloorPlan
from fleet2d.palette import TEXT_COLOR
from fleet2d.pictures.floorplan import check_picture, figure_size, floorplan_axes, picture
from fleet2d.pictures.theme import SCALE
from fleet2d.runs.layers import PREFIX, layer_steps, read_layer
from fleet2d.runs.run import Run

# The brighter part of viridis: names of rooms are written over it.
COLORS = ListedColormap(mpl.colormaps["viridis"](np.linspace(0.35, 1.0, 256)))
SEEN_COLOR = (0.12, 0.53, 0.54)
SOLID = 0.75
BAR_IN = 0.95  # width of the colour bar with its labels, beside the plan


def draw_layer(run: Run, name: str, path: Path, step: int | None = None) -> None:
    """Draw a layer of a run to a PNG or SVG file; the same layer gives the same bytes.

    Args:
        run: The run.
        name: The layer, such as ``explored.astro``.
        path: The file, whose name ends with `.png`, `.svg` or `.pdf`. An existing file is replaced.
        step: The step after which the layer was stored; None for the last.

    Raises:
        ArtifactError: The run stored no such layer, or not after that step.
        InputError: The file name has another suffix, or the file can't be written.
    """
    check_picture(path)
    values = read_layer(run, name, step)
    step = layer_steps(run, name)[-1] if step is None else step
    field = run.tables[f"{PREFIX}{name}"].schema.field("value")
    unit = (field.metadata or {}).get(b"unit", b"").decode()
    plan = run.plan
    width, height = figure_size(plan)
    beside = 0.0 if values.dtype == np.bool_ else BAR_IN
    with picture(path, width + beside, height) as figure:
        axes = figure.add_axes((0, 0, width / (width + beside), 1))
        floorplan_axes(plan, axes, title=False)
        colors = layer_on_axes(plan, values, axes)
        title = f"{name}{f' [{unit}]' if unit else ''}, after step {step}"
        x0, _, _, y1 = plan.bounds
        axes.text(x0, y1 + 0.3, title, fontsize=11, color=TEXT_COLOR, va="bottom", zorder=5)
        if colors is not None:
            bar = figure.add_axes(((width + 0.1) / (width + beside), 0.12, 0.018, 0.76))
            figure.colorbar(colors, cax=bar).ax.tick_params(labelsize=8)


def layer_on_axes(plan: FloorPlan, values: NDArray[Any], axes: Axes) -> ScalarMappable | None:
    """Draw the values of a layer over a floor plan; return their colours for a colour bar.

    Cells that aren't free or have no value are left out: NaN means no value, and
    so does -1 in a layer of steps.

    Args:
        plan: The floor plan, already drawn.
        values: (rows, columns); of bool, true cells are tinted, and there is no colour bar.
        axes: The axes to draw on, in metres.
    """
    image = np.zeros((*values.shape, 4))
    colors: ScalarMappable | None = None
    if values.dtype == np.bool_:
        image[plan.free & values] = (*SEEN_COLOR, SOLID)
    else:
        has_value = plan.free & ~np.isnan(values.astype(np.float64))
        if values.dtype.kind == "i" and (values[has_value] >= -1).all():
            has_value &= values >= 0
        numbers = values[has_value].astype(np.float64)
        low, high = (float(numbers.min()), float(numbers.max())) if numbers.size else (0.0, 1.0)
        colors = ScalarMappable(Normalize(low, high if high > low else low + 1.0), COLORS)
        image[has_value] = colors.to_rgba(numbers)
        image[has_value, 3] = SOLID
    left, bottom = plan.lattice.origin
    width, height = (n * plan.lattice.cell for n in (plan.lattice.columns, plan.lattice.rows))
    extent = (left, left + width, bottom, bottom + height)
    axes.imshow(
        image, extent=extent, origin="lower", interpolation="nearest", zorder=2.1, label=SCALE
    )
    return colors
