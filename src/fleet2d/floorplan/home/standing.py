"""Where a body can stand among walls and furniture, on cells, and how it gets to use an object."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Point, Polygon

from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.home.space import Space
from fleet2d.floorplan.objects import PlacedObject, UsePlace
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels.mesh import locate, strictly_inside
from fleet2d.kernels.sight import line_of_sight

BODY_RADIUS = 0.25
"""The radius of the body that furniture leaves ways for [m]: a large person's."""

# How far from what it is used for a body may stand [m]; for somebody who sits or lies there, how
# far it is to the nearest place to get on from.
STAND_REACH = 0.35
SIT_REACH = 1.6
# The nearest places that are tried for a way onto a piece of furniture.
TRIED = 600
# Lattice units that snapping of the grown footprint may add.
SLACK = 8
HALF = UNITS_PER_CELL // 2

Window = tuple[slice, slice]


def standing_cells(
    plan: FloorPlan, radius: float, objects: Iterable[PlacedObject] | None = None
) -> NDArray[np.bool_]:
    """Return the cells on which the middle of a body can be, bool (rows, columns).

    A cell beside furniture counts if the body can be all over it: neighbors among the cells are
    joined in truth.

    Args:
        plan: The floor plan.
        radius: The body's radius [m].
        objects: The furniture to mind; None for the plan's.

    Raises:
        FloorPlanError: The body fits nowhere between the walls.
    """
    cells = Space(plan, radius).part_of_cell >= 0
    for thing in plan.objects if objects is None else objects:
        if thing.blocks != "nothing":
            window, covered = grown_cells(plan.lattice, thing.footprint, radius)
            cells[window] &= ~covered
    return cells


def grown_cells(
    lattice: Lattice, footprint: Polygon, radius: float
) -> tuple[Window, NDArray[np.bool_]]:
    """Return the cells on which a body of a radius [m] would touch a footprint [m].

    Returns:
        The rows and columns of the smallest window that holds them, and which of its cells.
    """
    reach = radius * lattice.units_per_m + HALF + SLACK
    a, b = int(np.ceil(reach)), int(np.ceil(reach * 0.41421357))
    octagon = np.array([(a, b), (b, a), (-b, a), (-a, b), (-a, -b), (-b, -a), (b, -a), (a, -b)])
    pieces = [footprint] if _is_convex(footprint) else _triangles(footprint)
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
    standing: NDArray[np.bool_],
    others: Iterable[PlacedObject] = (),
) -> PlacedObject:
    """Return an object with only those places to use it from that a body can get to.

    Somebody who stands before an object stands on the nearest cell where there is room. Somebody
    who sits or lies on it gets there from the nearest such cell in sight of the place.

    Args:
        plan: The floor plan, whose walls are not stepped through.
        thing: The object; its own footprint is already taken from `standing`.
        standing: Where the middle of the body can be, bool (rows, columns).
        others: What else there is, which is not stepped over; a chair that one sits on may be.
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
        seat = use.posture != "stand"
        in_the_way = [shape for shape in solid if not (seat and shape.intersects(at))]
        cell = nearest_standing(plan, use, standing, reach, in_the_way)
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
    standing: NDArray[np.bool_],
    reach: float,
    in_the_way: Sequence[Polygon] = (),
) -> tuple[int, int] | None:
    """Return the cell (row, column) to get to a use place from, or None if there is none.

    Args:
        plan: The floor plan.
        use: The place.
        standing: Where the middle of the body can be, bool (rows, columns).
        reach: How far it may be from the place [m].
        in_the_way: What is not stepped over [m].
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
    for i in near[np.argsort(away[near], kind="stable")][:TRIED].tolist():
        row, column = int(rows[i]), int(columns[i])
        centre = lattice.cell_centre(row, column)
        if not line_of_sight(plan.mesh, x, y, triangle, *centre):
            continue
        step = LineString([(use.x, use.y), lattice.to_metres(centre).tolist()])
        if not any(step.intersects(shape) for shape in in_the_way):
            return row, column
    return None


def _window(lattice: Lattice, points: NDArray[np.int64]) -> Window:
    """Return the rows and columns of the cells round lattice points (n, 2)."""
    (x0, y0), (x1, y1) = points.min(axis=0) // UNITS_PER_CELL, points.max(axis=0) // UNITS_PER_CELL
    rows = slice(*np.clip((y0, y1 + 1), 0, lattice.rows).tolist())
    columns = slice(*np.clip((x0, x1 + 1), 0, lattice.columns).tolist())
    return rows, columns


def _is_convex(footprint: Polygon) -> bool:
    return not footprint.interiors and footprint.area >= footprint.convex_hull.area * (1 - 1e-9)


def _triangles(footprint: Polygon) -> list[Polygon]:
    """Return a footprint as convex pieces."""
    parts = shapely.get_parts(shapely.constrained_delaunay_triangles(footprint))
    pieces: list[Polygon] = parts.tolist()
    return pieces
