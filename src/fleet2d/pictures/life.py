"""Life in a home, over its floor plan: presence and paths of bodies, and what robots saw."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle, Polygon
from matplotlib.patheffects import withStroke

from fleet2d.errors import PlacementError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.lattice import Lattice
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, Bool
from fleet2d.kernels.space import Mesh
from fleet2d.palette import VIEW_COLOR, VIEW_EDGE
from fleet2d.pictures.traces import BodyTrace
from fleet2d.sight.fov import VisibleRegion, WallPlan

BLUR_M = 0.14  # standard deviation of the spot of a body, about its own size
REACH = 5  # radius of the blur [standard deviations]; with less, spots have square edges
SOLID = 0.4  # the highest opacity of presence, at which the plan stays legible
HALF = 4.0  # time, in multiples of the mean over all cells, at which presence has half of that
MOST_LEGS = 3_000  # drawn of a body
CANDIDATES = 60  # moments to compare when a view is chosen
MOST_PLACES = 260  # places of sightings that are drawn; more would hide the plan
CLEAR_M = 0.5  # twice the space between a name and a robot
FAR_ENOUGH_M = 2.0
RIM_COLOR = "#ffffffb0"  # around names


@dataclass(frozen=True)
class SightWalls:
    """The walls that block sight, with shut doors and tall furniture; see `field_of_view`."""

    mesh: Mesh
    lattice: Lattice

    @classmethod
    def of(cls, home: Home) -> "SightWalls":
        """Return those of a home as it is now."""
        return cls(home.walls, home.plan.lattice)


@dataclass(frozen=True)
class CameraView:
    """The region that a camera sees at one moment.

    Attributes:
        robot: The robot of the camera.
        step: The step.
        xy: The position of the robot, float64 (2,) [m].
        heading: The heading of the robot [rad].
        outlines: The parts of the region, each float64 (n, 2) [m].
        users: The positions of the users that it sees, float64 (m, 2) [m].
    """

    robot: BodyTrace
    step: int
    xy: F64
    heading: float
    outlines: list[F64]
    users: F64


def draw_presence(plan: FloorPlan, trace: BodyTrace, axes: Axes) -> None:
    """Draw where a body spent its time; longer is more opaque."""
    at_home = trace.room >= 0
    lattice = plan.lattice
    cells = (trace.xy[at_home] - lattice.origin) / lattice.cell
    column, row = np.floor(cells).astype(np.int64).T
    shape = (lattice.rows, lattice.columns)
    flat = np.clip(row, 0, shape[0] - 1) * shape[1] + np.clip(column, 0, shape[1] - 1)
    time = np.bincount(flat, minlength=shape[0] * shape[1]).reshape(shape).astype(np.float64)
    time = blurred(time, BLUR_M / lattice.cell) * plan.free
    image = np.empty((*shape, 4))
    image[..., :3] = to_rgb(trace.color)
    image[..., 3] = opacity(time, plan.free)
    low, high = np.array(lattice.origin), np.array(shape[::-1]) * lattice.cell
    extent = (low[0], low[0] + high[0], low[1], low[1] + high[1])
    axes.imshow(image, extent=extent, origin="lower", interpolation="bilinear", zorder=3)


def opacity(time: F64, free: Bool) -> F64:
    """Return the opacity of each cell for the time that a body spent there.

    It depends on the time relative to the mean over all free cells: equal times give a faint tint
    in homes of any size, and an hour at a table is visible beside a night in bed.

    Args:
        time: The time in each cell, in any unit, float64 (rows, columns).
        free: Whether a body can be in a cell, bool (rows, columns).

    Example:
        >>> everywhere = np.ones((2, 3))
        >>> opacity(everywhere, everywhere > 0).max().round(3)
        np.float64(0.08)
    """
    mean = time[free].mean() if free.any() else 0.0
    if mean <= 0:
        return np.zeros_like(time)
    ratio = time / mean
    return SOLID * ratio / (ratio + HALF)


def draw_paths(trace: BodyTrace, axes: Axes) -> None:
    """Draw the paths of a body as thin lines."""
    # Many paths are drawn fainter than few: opacity adds up where they cross.
    darkest, faintest, enough = (0.6, 0.09, 60) if trace.robot else (0.3, 0.04, 60)
    legs = trace.legs[:: 1 + len(trace.legs) // (MOST_LEGS + 1)]
    alpha = min(darkest, max(faintest, enough / max(1, len(legs))))
    width = 0.9 if len(legs) <= 600 else 0.6
    lines = LineCollection(list(legs), colors=trace.color, lw=width, alpha=alpha, zorder=2.5)
    axes.add_collection(lines, autolim=False)


def places_of(spots: F64) -> F64:
    """Return the places of sightings rounded to 0.1 m, each once: float64 (n, 2) [m]."""
    return np.unique(np.rint(spots * 10), axis=0) / 10


def draw_sightings(places: F64, color: str, axes: Axes) -> None:
    """Draw a ring at each place where a robot saw a user."""
    axes.scatter(
        places[:, 0],
        places[:, 1],
        s=7,
        facecolors="none",
        edgecolors=color,
        linewidths=0.45,
        alpha=0.6,
        zorder=3.5,
    )


def draw_view(view: CameraView, radius: float, axes: Axes) -> None:
    """Draw the region that a camera sees, the robot, and lines to the users in view."""
    color = view.robot.color
    for outline in view.outlines:
        axes.add_patch(
            Polygon(outline, facecolor=VIEW_COLOR, alpha=0.38, edgecolor="none", zorder=2.2)
        )
        axes.add_patch(Polygon(outline, fill=False, edgecolor=VIEW_EDGE, lw=0.7, zorder=3.2))
    for x, y in view.users.tolist():
        axes.plot([view.xy[0], x], [view.xy[1], y], color=color, lw=0.9, ls=(0, (2, 1.5)), zorder=4)
        axes.plot(x, y, "o", ms=5, mfc="white", mec=color, mew=1.1, zorder=4.2)
    x, y = view.xy.tolist()
    size = max(radius, 0.13)
    axes.add_patch(Circle((x, y), size, facecolor=color, edgecolor="white", lw=0.9, zorder=4.3))
    nose = [[x, x + size * np.cos(view.heading)], [y, y + size * np.sin(view.heading)]]
    axes.plot(*nose, color="white", lw=1.1, zorder=4.4, solid_capstyle="butt")


def clear_names(plan: FloorPlan, views: Sequence[CameraView], axes: Axes) -> None:
    """Keep the names of rooms legible: with a soft outline, away from robots and users."""
    marks = np.array([xy for view in views for xy in (view.xy, *view.users)]).reshape(-1, 2)
    canvas: Any = axes.figure.canvas
    pixels = axes.transData.inverted()
    for text in axes.texts:
        text.set_path_effects([withStroke(linewidth=2.0, foreground=RIM_COLOR)])
        box = text.get_window_extent(canvas.get_renderer())
        (x0, y0), (x1, y1) = pixels.transform(box.get_points()).tolist()
        x, y = text.get_position()
        room = plan.room_at(x, y)
        if room is None or not len(marks):
            continue
        for shift in (0.0, *(sign * 0.1 * k for k in range(1, 25) for sign in (-1, 1))):
            ends = (y0 + shift, y1 + shift)
            is_inside = all(plan.room_at(at, end) is room for at in (x0, x, x1) for end in ends)
            distance = (abs(marks - [(x0 + x1) / 2, sum(ends) / 2]) * 2).T
            is_covered = (distance[0] < x1 - x0 + CLEAR_M) & (distance[1] < y1 - y0 + CLEAR_M)
            if (is_inside or shift == 0) and not is_covered.any():
                text.set_position((x, y + shift))
                break


def best_view(
    plan: FloorPlan, robot: BodyTrace, camera: dict[str, Any], sightings: dict[int, F64]
) -> CameraView | None:
    """Return the moment that shows best what a robot sees, and what walls hide from it.

    It is the moment with the largest visible area that a wall limits; a moment with a user in view,
    if there is any.

    Args:
        plan: The home.
        robot: The robot.
        camera: Its camera, as in the scenario.
        sightings: The positions of users that it saw, by step, each float64 (n, 2) [m].
    """
    index = np.flatnonzero(np.isin(robot.step, np.fromiter(sightings, np.int64, len(sightings))))
    if len(index) == 0:
        index = np.arange(len(robot.step))
    index = index[:: 1 + len(index) // CANDIDATES]
    highest, best = -1.0, None
    near, far = camera["range"]
    sector_area = (far**2 - near**2) * np.deg2rad(camera["angle_deg"]) / 2
    for i in index.tolist():
        if robot.room[i] < 0:
            continue
        outline = field_of_view(plan, robot.xy[i], float(robot.heading[i]), camera)
        area = outline.area
        step = int(robot.step[i])
        users = sightings.get(step, np.zeros((0, 2)))
        score = area if area < 0.97 * sector_area else 0.3 * area
        if len(users):
            distance = float(np.hypot(*(users - robot.xy[i]).T).max())
            score *= min(1.0, distance / FAR_ENOUGH_M)
        if score > highest:
            highest = score
            parts = [shapely.get_coordinates(p.exterior) for p in shapely.get_parts(outline)]
            best = CameraView(robot, step, robot.xy[i], float(robot.heading[i]), parts, users)
    return best


def field_of_view(
    plan: WallPlan, xy: F64, heading: float, camera: dict[str, Any]
) -> shapely.MultiPolygon:
    """Return the region that a camera sees from a place [m], within its range and angle."""
    try:
        visible = shapely.Polygon(VisibleRegion(plan, *xy.tolist()).polygon())
    except PlacementError:
        return shapely.MultiPolygon()
    near, far = camera["range"]
    half = np.deg2rad(camera["angle_deg"]) / 2
    angles = np.linspace(heading - half, heading + half, max(3, round(half * 2 / pi * 180)))
    arc = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    inner_arc = [xy] if near == 0 else (xy + near * arc[::-1]).tolist()
    if camera["angle_deg"] >= 360:
        sector = shapely.Point(xy).buffer(far).difference(shapely.Point(xy).buffer(near))
    else:
        sector = shapely.Polygon([*(xy + far * arc).tolist(), *inner_arc])
    cut = shapely.intersection(shapely.make_valid(visible), shapely.make_valid(sector))
    polygons = [p for p in shapely.get_parts(cut) if p.geom_type == "Polygon"]
    return shapely.MultiPolygon(polygons)


def blurred(image: F64, sigma: float) -> F64:
    """Return an image blurred by a Gaussian of standard deviation `sigma` [cells]."""
    reach = max(1, round(REACH * sigma))
    offsets = np.arange(-reach, reach + 1)
    weights = np.exp(-0.5 * (offsets / max(sigma, 1e-6)) ** 2)
    weights /= weights.sum()
    blurred = image
    for axis in (0, 1):
        padding = [(reach, reach) if a == axis else (0, 0) for a in (0, 1)]
        padded = np.pad(blurred, padding)
        size = image.shape[axis]
        slices = [np.take(padded, range(k, k + size), axis=axis) for k in range(len(offsets))]
        blurred = np.sum([w * s for w, s in zip(weights, slices, strict=True)], axis=0)
    return blurred
