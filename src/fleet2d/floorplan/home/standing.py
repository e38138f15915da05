"""Cells where a body can stand among walls and furniture, and places to use an object from."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import LineString, Point, Polygon

from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.home.space import Space, is_convex
from fleet2d.floorplan.objects import PlacedObject, UsePlace
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import I64, Bool
from fleet2d.kernels.sight import line_of_sight
from fleet2d.kernels.space import locate, strictly_inside

BODY_RADIUS = 0.25
"""The radius of the body that furniture leaves space for [m]: that of a large person."""

# How far from a place of use a body may stand [m]; and how far from it a body that sits or lies
# there may get up.
STAND_REACH = 0.35
SIT_REACH = 1.6
# Number of cells that are tried for a way onto a piece of furniture, nearest first.
ATTEMPTS = 600
# What snapping of the grown footprint may add [lattice].
SLACK = 8
HALF = UNITS_PER_CELL // 2

Window = tuple[slice, slice]


def standing_cells(
    plan: FloorPlan, radius: float, objects: Iterable[PlacedObject] | None = None
) -> Bool:
    """Return the cells where the middle of a body can be, bool (rows, columns).

    A cell beside furniture counts only if the body can be at every point of it, so that a body can
    walk between neighboring cells.

    Args:
        plan: The floor plan.
        radius: The body's radius [m].
        objects: The furniture in the way; None for the plan's.

    Raises:
        FloorPlanError: The body fits nowhere between the walls.
    """
    cells = Space(plan, radius).part_of_cell >= 0
    for thing in plan.objects if objects is None else objects:
        if thing.blocks != "nothing":
            window, covered = grown_cells(plan.lattice, thing.footprint, radius)
            cells[window] &= ~covered
    return cells


def grown_cells(lattice: Lattice, footprint: Polygon, radius: float) -> tuple[Window, Bool]:
    """Return the cells on which a body of a radius [m] would touch a footprint [m].

    Returns:
        The rows and columns of the smallest window that holds them, and which of its cells.
    """
    reach = radius * lattice.units_per_m + HALF + SLACK
    a, b = int(np.ceil(reach)), int(np.ceil(reach * 0.41421357))
    octagon = np.array([(a, b), (b, a), (-b, a), (-a, b), (-a, -b), (-b, -a), (b, -a), (a, -b)])
    pieces = [footprint] if is_convex(footprint) else _triangles(footprint)
    hulls = []
    for piece in pieces:
        corners = lattice.to_lattice(shapely.get_coordinates(piece)[:-1])
        hull = shapely.convex_hull(shapely.multipoints((corners[:, None] + octagon).reshape(-1, 2)))
        hulls.append(shapely.get_coordinates(shapely.orient_polygons(hull)).astype(np.int64))
    window = _window(lattice, np.concatenate(hulls))
    xs, ys = lattice.centre_axes()
    x, y = xs[window[1]][None, :], ys[window[0]][:, None]
    covered = np.zeros((y.shape[0], x.shape[1]), np.bool_)
    for corners in hulls:
        inside = np.ones_like(covered)
        for (ax, ay), (bx, by) in zip(corners[:-1].tolist(), corners[1:].tolist(), strict=True):
            inside &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0
        covered |= inside
    return window, covered


def with_approaches(
    plan: FloorPlan,
    thing: PlacedObject,
    standing: Bool,
    others: Iterable[PlacedObject] = (),
) -> PlacedObject:
    """Return an object with only those places of use that a body can get to.

    A person who stands at an object stands on the nearest cell where a body can stand. A person who
    sits or lies on it gets there from the nearest such cell in sight of the place.

    Args:
        plan: The floor plan.
        thing: The object; `standing` already excludes its footprint.
        standing: Cells where the middle of the body can be, bool (rows, columns).
        others: Other objects, over which no body steps, except for a chair to sit on.
    """
    x0, y0, x1, y1 = thing.footprint.bounds
    near = shapely.box(x0 - SIT_REACH, y0 - SIT_REACH, x1 + SIT_REACH, y1 + SIT_REACH)
    solid = [
        other.footprint
        for other in others
        if other.blocks != "nothing" and other is not thing and near.intersects(other.footprint)
    ]
    uses = []
    for use in thing.uses:
        reach = STAND_REACH if use.posture == "stand" else SIT_REACH
        at = Point(use.x, use.y)
        is_seat = use.posture != "stand"
        obstacles = [shape for shape in solid if not (is_seat and shape.intersects(at))]
        cell = nearest_standing(plan, use, standing, reach, obstacles)
        if cell is None:
            continue
        x, y = plan.lattice.to_metres(plan.lattice.cell_centre(*cell)).tolist()
        if use.posture == "stand":
            use = replace(use, x=x, y=y)
        uses.append(replace(use, approach=(x, y)))
    return replace(thing, uses=tuple(uses))


def nearest_standing(
    plan: FloorPlan,
    use: UsePlace,
    standing: Bool,
    reach: float,
    obstacles: Sequence[Polygon] = (),
) -> tuple[int, int] | None:
    """Return the cell (row, column) from which a body gets to a place of use, or None.

    Args:
        plan: The floor plan.
        use: The place.
        standing: Cells where the middle of the body can be, bool (rows, columns).
        reach: Largest distance from the place [m].
        obstacles: Shapes over which no body steps [m].
    """
    lattice = plan.lattice
    x, y = lattice.point_at((use.x, use.y))
    if not strictly_inside(plan.mesh, x, y):
        return None
    units = int(reach * lattice.units_per_m) + HALF
    window = _window(lattice, np.array([(x - units, y - units), (x + units, y + units)]))
    rows, columns = np.nonzero(standing[window])
    rows, columns = rows + window[0].start, columns + window[1].start
    xs, ys = lattice.centre_axes()
    away = (xs[columns] - x) ** 2 + (ys[rows] - y) ** 2
    near = np.flatnonzero(away <= units * units)
    triangle = locate(plan.mesh, x, y)
    for i in near[np.argsort(away[near], kind="stable")][:ATTEMPTS].tolist():
        row, column = int(rows[i]), int(columns[i])
        centre = lattice.cell_centre(row, column)
        if not line_of_sight(plan.mesh, x, y, triangle, *centre):
            continue
        step = LineString([(use.x, use.y), lattice.to_metres(centre).tolist()])
        if not any(step.intersects(shape) for shape in obstacles):
            return row, column
    return None


def _window(lattice: Lattice, points: I64) -> Window:
    """Return the rows and columns of the cells around lattice points (n, 2)."""
    (x0, y0), (x1, y1) = points.min(axis=0) // UNITS_PER_CELL, points.max(axis=0) // UNITS_PER_CELL
    rows = slice(*np.clip((y0, y1 + 1), 0, lattice.rows).tolist())
    columns = slice(*np.clip((x0, x1 + 1), 0, lattice.columns).tolist())
    return rows, columns


def _triangles(footprint: Polygon) -> list[Polygon]:
    """Return a footprint as convex pieces."""
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(footprint))
    return parts.tolist()
