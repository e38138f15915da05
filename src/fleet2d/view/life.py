"""A home being lived in: over its floor plan, where bodies were, how they went, what robots saw."""

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
from numpy.typing import NDArray

from fleet2d.errors import PlacementError
from fleet2d.floorplan.geometry.lattice import Lattice
from fleet2d.floorplan.home.home import Home
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels.mesh import Mesh
from fleet2d.palette import VIEW_COLOR, VIEW_EDGE
from fleet2d.sight.region import VisibleRegion, WallPlan
from fleet2d.view.traces import Trace

BLUR_M = 0.14  # a body is a soft spot of about its own size
REACH = 5  # standard deviations; with fewer, spots would show square edges
# Opacity where somebody was longest: the plan and all that is drawn on it stay legible.
SOLID = 0.4
# Opacity is half of that where somebody was so many times as long as if everywhere equally long.
HALF = 4.0
MOST_WAYS = 3_000  # legs drawn of a body
CANDIDATES = 60  # moments looked at to find one that shows what a robot sees
SPOTS = 260  # places of sightings that are drawn; more would cover the plan and tell nothing
CLEAR_M = 0.5  # twice the space between a name and a robot
FAR_ENOUGH_M = 2.0
RIM_COLOR = "#ffffffb0"  # around names

F64 = NDArray[np.float64]


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
class View:
    """What a camera sees at one moment.

    Attributes:
        robot: Whose camera.
        step: When.
        xy: Where the robot is [m].
        heading: Where it looks [rad].
        outline: Pieces of the field of view, each float64 (n, 2) [m].
        seen: Where the users are that it sees, float64 (m, 2) [m].
    """

    robot: Trace
    step: int
    xy: F64
    heading: float
    outline: list[F64]
    seen: F64


def draw_presence(plan: FloorPlan, trace: Trace, axes: Axes) -> None:
    """Draw where a body spent its time, the more opaque the longer."""
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


def opacity(time: F64, free: NDArray[np.bool_]) -> F64:
    """Return how opaque to draw each cell in which a body spent some time.

    It goes by the time per area, compared to a body that is everywhere equally long: that one
    leaves a faint tint in any home, and an hour at a table still shows beside a night in bed.

    Args:
        time: Time in each cell, in any unit, float64 (rows, columns).
        free: Which cells a body can be in.

    Example:
        >>> everywhere = np.ones((2, 3))
        >>> opacity(everywhere, everywhere > 0).max().round(3)
        np.float64(0.08)
    """
    mean = time[free].mean() if free.any() else 0.0
    if mean <= 0:
        return np.zeros_like(time)
    ratio = time / mean
    found: F64 = SOLID * ratio / (ratio + HALF)
    return found


def draw_ways(trace: Trace, axes: Axes) -> None:
    """Draw the ways that a body went as thin lines."""
    # Few ways are drawn dark, many faint: they add up where they meet.
    darkest, faintest, enough = (0.6, 0.09, 60) if trace.robot else (0.3, 0.04, 60)
    legs = trace.legs[:: 1 + len(trace.legs) // (MOST_WAYS + 1)]
    alpha = min(darkest, max(faintest, enough / max(1, len(legs))))
    width = 0.9 if len(legs) <= 600 else 0.6
    lines = LineCollection(list(legs), colors=trace.color, lw=width, alpha=alpha, zorder=2.5)
    axes.add_collection(lines, autolim=False)


def places_of(spots: F64) -> F64:
    """Return the places [m] of sightings, those within a decimetre once."""
    places: F64 = np.unique(np.rint(spots * 10), axis=0) / 10
    return places


def draw_sightings(places: F64, color: str, axes: Axes) -> None:
    """Draw where users were when robots saw them, one ring per place."""
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


def draw_view(view: View, radius: float, axes: Axes) -> None:
    """Draw what a camera sees: its field of view, the robot, and lines to whom it sees."""
    color = view.robot.color
    for outline in view.outline:
        axes.add_patch(
            Polygon(outline, facecolor=VIEW_COLOR, alpha=0.38, edgecolor="none", zorder=2.2)
        )
        axes.add_patch(Polygon(outline, fill=False, edgecolor=VIEW_EDGE, lw=0.7, zorder=3.2))
    for x, y in view.seen.tolist():
        axes.plot([view.xy[0], x], [view.xy[1], y], color=color, lw=0.9, ls=(0, (2, 1.5)), zorder=4)
        axes.plot(x, y, "o", ms=5, mfc="white", mec=color, mew=1.1, zorder=4.2)
    x, y = view.xy.tolist()
    size = max(radius, 0.13)
    axes.add_patch(Circle((x, y), size, facecolor=color, edgecolor="white", lw=0.9, zorder=4.3))
    nose = [[x, x + size * np.cos(view.heading)], [y, y + size * np.sin(view.heading)]]
    axes.plot(*nose, color="white", lw=1.1, zorder=4.4, solid_capstyle="butt")


def clear_names(plan: FloorPlan, views: Sequence[View], axes: Axes) -> None:
    """Keep the rooms' names legible: on a soft ground, off the robots and whom they see."""
    marks = np.array([xy for view in views for xy in (view.xy, *view.seen)]).reshape(-1, 2)
    canvas: Any = axes.figure.canvas
    pixels = axes.transData.inverted()
    for text in axes.texts:
        text.set_path_effects([withStroke(linewidth=2.0, foreground=RIM_COLOR)])
        box = text.get_window_extent(canvas.get_renderer())
        (x0, y0), (x1, y1) = pixels.transform(box.get_points()).tolist()
        x, y = text.get_position()
        home = plan.room_at(x, y)
        if home is None or not len(marks):
            continue
        for shift in (0.0, *(sign * 0.1 * k for k in range(1, 25) for sign in (-1, 1))):
            ends = (y0 + shift, y1 + shift)
            inside = all(plan.room_at(at, end) is home for at in (x0, x, x1) for end in ends)
            near = (abs(marks - [(x0 + x1) / 2, sum(ends) / 2]) * 2).T
            covered = (near[0] < x1 - x0 + CLEAR_M) & (near[1] < y1 - y0 + CLEAR_M)
            if (inside or shift == 0) and not covered.any():
                text.set_position((x, y + shift))
                break


def telling_view(
    plan: FloorPlan, robot: Trace, camera: dict[str, Any], seen: dict[int, F64]
) -> View | None:
    """Return a moment that shows what a robot sees, and what walls hide from it.

    Of moments at which it sees somebody if there are any, else of any, the one at which it sees the
    largest area while a wall is in the way.

    Args:
        plan: The home.
        robot: The robot.
        camera: Its camera, as the scenario says.
        seen: Where users were that it saw, by step.
    """
    index = np.flatnonzero(np.isin(robot.step, np.fromiter(seen, np.int64, len(seen))))
    if len(index) == 0:
        index = np.arange(len(robot.step))
    index = index[:: 1 + len(index) // CANDIDATES]
    best, found = -1.0, None
    near, far = camera["range"]
    whole = (far**2 - near**2) * np.deg2rad(camera["angle_deg"]) / 2
    for i in index.tolist():
        if robot.room[i] < 0:
            continue
        outline = field_of_view(plan, robot.xy[i], float(robot.heading[i]), camera)
        area = outline.area
        step = int(robot.step[i])
        where = seen.get(step, np.zeros((0, 2)))
        score = area if area < 0.97 * whole else 0.3 * area
        if len(where):
            distance = float(np.hypot(*(where - robot.xy[i]).T).max())
            score *= min(1.0, distance / FAR_ENOUGH_M)
        if score > best:
            best = score
            parts = [shapely.get_coordinates(p.exterior) for p in shapely.get_parts(outline)]
            found = View(robot, step, robot.xy[i], float(robot.heading[i]), parts, where)
    return found


def field_of_view(
    plan: WallPlan, xy: F64, heading: float, camera: dict[str, Any]
) -> shapely.MultiPolygon:
    """Return what a camera sees from a place [m]: visible, in range, and within its angle."""
    try:
        visible = shapely.Polygon(VisibleRegion(plan, *xy.tolist()).polygon())
    except PlacementError:
        return shapely.MultiPolygon()
    near, far = camera["range"]
    half = np.deg2rad(camera["angle_deg"]) / 2
    angles = np.linspace(heading - half, heading + half, max(3, round(half * 2 / pi * 180)))
    arc = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    inner = [xy] if near == 0 else (xy + near * arc[::-1]).tolist()
    whole_turn = camera["angle_deg"] >= 360
    if whole_turn:
        sector = shapely.Point(xy).buffer(far).difference(shapely.Point(xy).buffer(near))
    else:
        sector = shapely.Polygon([*(xy + far * arc).tolist(), *inner])
    cut = shapely.intersection(shapely.make_valid(visible), shapely.make_valid(sector))
    polygons = [p for p in shapely.get_parts(cut) if p.geom_type == "Polygon"]
    return shapely.MultiPolygon(polygons)


def blurred(image: F64, sigma: float) -> F64:
    """Return an image blurred by a bell curve of standard deviation `sigma` [cells]."""
    reach = max(1, round(REACH * sigma))
    at = np.arange(-reach, reach + 1)
    bell = np.exp(-0.5 * (at / max(sigma, 1e-6)) ** 2)
    bell /= bell.sum()
    blurred = image
    for axis in (0, 1):
        padding = [(reach, reach) if a == axis else (0, 0) for a in (0, 1)]
        padded = np.pad(blurred, padding)
        size = image.shape[axis]
        slices = [np.take(padded, range(k, k + size), axis=axis) for k in range(len(at))]
        blurred = np.sum([w * s for w, s in zip(bell, slices, strict=True)], axis=0)
    return blurred
