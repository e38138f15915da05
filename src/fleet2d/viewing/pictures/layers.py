"""Pictures of values by cell: layers, and what is visible from a place."""

from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.patches import Wedge
from numpy.typing import NDArray

from fleet2d.artifacts.table import LAYER_PREFIX
from fleet2d.errors import InputError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import TURN, Reach
from fleet2d.palette import TEXT_COLOR, VIEW_EDGE
from fleet2d.runs.layers import layer_steps, read_layer
from fleet2d.runs.run import Run
from fleet2d.sight.cached_fov import Flashlight
from fleet2d.sight.camera import DEFAULT_ANGLE_DEG, DEFAULT_RANGE_M
from fleet2d.sight.fov import FieldOfView, VisibleRegion
from fleet2d.viewing.pictures.floorplan import draw_cells, figure_size, floorplan_axes, picture
from fleet2d.viewing.pictures.life import (
    SightWalls,
    draw_region,
    draw_robot,
    field_of_view,
    outlines_of,
)

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
    values = read_layer(run, name, step)
    step = layer_steps(run, name)[-1] if step is None else step
    field = run.tables[f"{LAYER_PREFIX}{name}"].schema.field("value")
    unit = (field.metadata or {}).get(b"unit", b"").decode()
    plan = run.plan
    width, height = figure_size(plan)
    beside = 0.0 if values.dtype == np.bool_ else BAR_IN
    with picture(path, width + beside, height) as figure:
        axes = figure.add_axes((0, 0, width / (width + beside), 1))
        floorplan_axes(plan, axes, title=False)
        colors = layer_on_axes(plan, values, axes)
        quantity = f"{name} [{unit}]" if unit else name
        _write_title(plan, f"{quantity}, after step {step}", axes)
        if colors is not None:
            bar = figure.add_axes(((width + 0.1) / (width + beside), 0.12, 0.018, 0.76))
            figure.colorbar(colors, cax=bar).ax.tick_params(labelsize=8)


def layer_on_axes(plan: FloorPlan, values: NDArray[Any], axes: Axes) -> ScalarMappable | None:
    """Draw the values of a layer over a floor plan; return their colours for a colour bar.

    Cells that aren't free or have no value are left out: NaN means no value, and
    so does -1 in a layer of steps.

    Args:
        plan: The floor plan, already drawn.
        values: (rows, columns); if they are bool, true cells are tinted, without a colour bar.
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
        low = float(numbers.min()) if numbers.size else 0.0
        high = float(numbers.max()) if numbers.size else 1.0
        colors = ScalarMappable(Normalize(low, high if high > low else low + 1.0), COLORS)
        image[has_value] = colors.to_rgba(numbers)
        image[has_value, 3] = SOLID
    draw_cells(plan, image, axes, interpolation="nearest", zorder=2.1)
    return colors


ROBOT_COLOR = "#22344f"
RADIUS_M = 0.17


class CameraPose(NamedTuple):
    """The pose of a camera, with its range and angle.

    Attributes:
        x: Its position [m].
        y: Its position [m].
        heading_deg: Its heading, counter-clockwise from +x [degrees].
        far: Its range [m].
        angle_deg: Its angle of view, at most 360 [degrees].
    """

    x: float
    y: float
    heading_deg: float
    far: float = DEFAULT_RANGE_M[1]
    angle_deg: float = DEFAULT_ANGLE_DEG

    def reach(self, plan: FloorPlan) -> Reach:
        """Return its range and angle in the integers of the kernels."""
        far = round(self.far * plan.lattice.units_per_m)
        return Reach(0, far * far, max(1, round(self.angle_deg / 360 * TURN)))


def parse_pose(text: str) -> CameraPose:
    """Return the pose of a text of three to five numbers.

    Raises:
        InputError: The text isn't three to five numbers, or one is out of range.

    Example:
        >>> parse_pose("2.5, 1, 90")
        CameraPose(x=2.5, y=1.0, heading_deg=90.0, far=4.5, angle_deg=108.0)
    """
    try:
        numbers = [float(part) for part in text.split(",")]
        pose = CameraPose(*numbers)
        is_in_range = 0 < pose.far <= 1000 and 0 < pose.angle_deg <= 360
        is_valid = is_in_range and np.isfinite(numbers).all()
    except (ValueError, TypeError):
        is_valid = False
    if not is_valid:
        raise InputError(
            f"--fov {text}: write x,y,heading [m, m, degrees], optionally a range [m] and an angle"
            " up to 360 degrees: --fov 2.5,1,90,4.5,108"
        )
    return pose


def draw_fov(plan: FloorPlan, pose: CameraPose, path: Path) -> None:
    """Draw the field of view of a camera in a floor plan to a PNG, SVG or PDF file.

    Left is the region of `line_of_sight` and `visibility_polygon`, right the cells of
    `flashlight`.

    Args:
        plan: The floor plan.
        pose: The camera.
        path: The file, whose name ends with `.png`, `.svg` or `.pdf`. An existing file is replaced.

    Raises:
        PlacementError: The pose is in a wall or outside the home.
        InputError: The file name has another suffix, or the file can't be written.
    """
    VisibleRegion(SightWalls.of(Home(plan)), pose.x, pose.y)  # raises PlacementError
    width, height = figure_size(plan)
    with picture(path, 2 * width, height) as figure:
        left = figure.add_axes((0, 0, 0.5, 1))
        right = figure.add_axes((0.5, 0, 0.5, 1))
        region_panel(plan, pose, left, "visibility_polygon, line_of_sight")
        cells_panel(plan, pose, right, Flashlight(), "flashlight")


def region_panel(plan: FloorPlan, pose: CameraPose, axes: Axes, title: str) -> None:
    """Draw the exact region in view of a pose, and the sector of its range and angle."""
    _draw_plan(plan, axes, title)
    half = pose.angle_deg / 2
    ends = (pose.heading_deg - half, pose.heading_deg + half)
    sector = Wedge((pose.x, pose.y), pose.far, *ends, fill=False)
    sector.set(edgecolor=VIEW_EDGE, linewidth=0.8, linestyle=":", zorder=3)
    axes.add_patch(sector)
    camera = {"range": (0.0, pose.far), "angle_deg": pose.angle_deg}
    heading = float(np.deg2rad(pose.heading_deg))
    eye = np.array([pose.x, pose.y])
    region = field_of_view(SightWalls.of(Home(plan)), eye, heading, camera)
    draw_region(outlines_of(region), axes)
    _draw_robot(pose, axes)


def cells_panel(
    plan: FloorPlan, pose: CameraPose, axes: Axes, method: FieldOfView, title: str
) -> None:
    """Draw the cells in view of a pose by a method."""
    _draw_plan(plan, axes, title)
    x, y = plan.lattice.point_at((pose.x, pose.y))
    heading = round(pose.heading_deg / 360 * TURN) % TURN
    mask = method.cells(Home(plan), x, y, heading, pose.reach(plan))
    layer_on_axes(plan, mask, axes)
    _draw_robot(pose, axes)


def _draw_plan(plan: FloorPlan, axes: Axes, title: str) -> None:
    floorplan_axes(plan, axes, names=False, title=False)
    _write_title(plan, title, axes)


def _write_title(plan: FloorPlan, title: str, axes: Axes) -> None:
    x0, _, _, y1 = plan.bounds
    axes.text(x0, y1 + 0.3, title, fontsize=11, color=TEXT_COLOR, va="bottom", zorder=5)


def _draw_robot(pose: CameraPose, axes: Axes) -> None:
    heading = float(np.deg2rad(pose.heading_deg))
    draw_robot(np.array([pose.x, pose.y]), heading, RADIUS_M, ROBOT_COLOR, axes)
