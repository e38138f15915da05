"""Triangulate wall outlines on the lattice into the mesh that the kernels use."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import MultiPolygon, Polygon

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.geometry.lattice import COORDINATE_LIMIT
from fleet2d.kernels import I32, I64
from fleet2d.kernels.space import SUB, WALL, Mesh
from fleet2d.runtime.determinism import sum_in_order

GRID = 2
"""Walls lie on even lattice units; cell centres are odd, so no straight wall hits one."""


class SnappedPolygon(NamedTuple):
    """A polygon moved onto the wall lattice.

    Attributes:
        polygons: Its parts, with even integer coordinates; none if it was too thin.
        area_change: New area minus old area, square lattice units.
        tolerance: The most that moving every wall point by the rounding can change the area.
    """

    polygons: list[Polygon]
    area_change: float
    tolerance: float


def snap_polygon(polygon: Polygon | MultiPolygon) -> SnappedPolygon:
    """Move a polygon in lattice units onto even coordinates, and drop what collapses to nothing.

    Parts thinner than the lattice vanish, and a part that is joined by less than that becomes a
    polygon of its own. So do the loops of an outline that crosses itself; the change of the area
    shows whether that was a small slip or a wrong outline, so check
    `abs(area_change) <= tolerance`.

    Args:
        polygon: Free space in lattice units; any coordinates.

    >>> snapped = snap_polygon(shapely.box(0.3, 0.2, 99.7, 10.9))
    >>> [part.bounds for part in snapped.polygons], round(snapped.area_change, 2)
    ([(0.0, 0.0, 100.0, 10.0)], -63.58)
    """
    sound = polygon if polygon.is_valid else shapely.make_valid(polygon, method="structure")
    snapped = shapely.set_precision(sound, GRID)
    parts = [part for part in shapely.get_parts(snapped) if part.area > 0]
    parts = [shapely.orient_polygons(part) for part in parts]
    area_change = sum_in_order(part.area for part in parts) - polygon.area
    return SnappedPolygon(parts, area_change, GRID * polygon.length)


def build_mesh(
    polygons: Sequence[Polygon], columns: int, rows: int, corners: Sequence[tuple[int, int]] = ()
) -> Mesh:
    """Triangulate free space.

    Args:
        polygons: The free space; even integer coordinates, interiors disjoint. Rings may touch each
            other in points.
        columns: Width of the plan, cells.
        rows: Height of the plan, cells.
        corners: Points on walls that become vertices, even where the wall is straight.

    Raises:
        FloorPlanError: If the polygons are not such a free space, or don't fit the plan.

    >>> mesh = build_mesh([shapely.box(0, 0, 640, 320)], columns=10, rows=5)
    >>> mesh.vertices.tolist(), len(mesh.triangles)
    ([[0, 0], [0, 320], [640, 0], [640, 320]], 2)
    """
    rings = _rings(polygons, columns * SUB, rows * SUB)
    if corners:
        rings = _split_at(rings, np.array(corners, np.int64).reshape(-1, 2))
    mesh = _build(rings)
    if mesh is None:
        # A corner that touches the middle of another wall: make it a vertex of that wall, too.
        mesh = _build(_split_at_touching_vertices(rings))
    if mesh is None:
        raise FloorPlanError(
            "The free space can't be cut into triangles that end at its walls. Send the outlines "
            "to snap_polygon first."
        )
    return mesh


def _rings(polygons: Sequence[Polygon], width: int, height: int) -> list[list[I64]]:
    """Return each polygon as open rings, outer first: int64 (n, 2), free space on the left."""
    if not polygons or any(polygon.area <= 0 for polygon in polygons):
        raise FloorPlanError(
            "The floor plan has no free space: there is no polygon, or one without an area."
        )
    whole = MultiPolygon(list(polygons))
    if not whole.is_valid:
        raise FloorPlanError(
            "The outlines cross, overlap or share a piece of wall: "
            f"{shapely.is_valid_reason(whole)} (lattice units). Merge outlines that overlap."
        )
    rings = []
    for polygon in polygons:
        exact = shapely.get_coordinates(polygon)
        if not np.array_equal(exact % GRID, np.zeros_like(exact)):
            raise FloorPlanError(
                "Walls must lie on even lattice units. Pass the polygon to snap_polygon first."
            )
        low, high = exact.min(axis=0), exact.max(axis=0)
        if low.min() < 0 or high[0] > width or high[1] > height or high.max() >= COORDINATE_LIMIT:
            raise FloorPlanError(
                f"The walls reach from {low.tolist()} to {high.tolist()} lattice units, but the "
                f"plan covers [0, 0] to [{width}, {height}], and nothing may reach "
                f"{COORDINATE_LIMIT}. Use larger cells."
            )
        oriented = shapely.orient_polygons(polygon)
        rings.append(
            [
                shapely.get_coordinates(ring)[:-1].astype(np.int64)
                for ring in (oriented.exterior, *oriented.interiors)
            ]
        )
    return _drop_flat_vertices(rings)


def _keys(points: I64) -> I64:
    """Return one number per point that sorts like (x, y)."""
    return points[..., 0] * (2 * COORDINATE_LIMIT) + points[..., 1]


def _drop_flat_vertices(polygons: list[list[I64]]) -> list[list[I64]]:
    """Drop vertices in the middle of a straight wall, except where rings touch."""
    everywhere = np.concatenate([_keys(ring) for rings in polygons for ring in rings])
    keys, counts = np.unique(everywhere, return_counts=True)
    touching = keys[counts > 1]

    def straighten(ring: I64) -> I64:
        before, after = np.roll(ring, 1, axis=0) - ring, np.roll(ring, -1, axis=0) - ring
        bends = before[:, 0] * after[:, 1] != before[:, 1] * after[:, 0]
        return ring[bends | np.isin(_keys(ring), touching)]

    return [[straighten(ring) for ring in rings] for rings in polygons]


def _split_at_touching_vertices(polygons: list[list[I64]]) -> list[list[I64]]:
    """Insert every vertex that lies in the middle of a wall into that wall."""
    return _split_at(
        polygons, np.unique(np.concatenate([r for rings in polygons for r in rings]), axis=0)
    )


def _split_at(polygons: list[list[I64]], vertices: I64) -> list[list[I64]]:
    """Insert each of some points that lies in the middle of a wall into that wall."""
    tree = shapely.STRtree(np.asarray(shapely.points(vertices)))

    def split(ring: I64) -> I64:
        ends = np.roll(ring, -1, axis=0)
        boxes = shapely.box(*np.minimum(ring, ends).T, *np.maximum(ring, ends).T)
        wall, near = tree.query(np.asarray(boxes))
        along, offsets = (ends - ring)[wall], vertices[near] - ring[wall]
        distances = (offsets * along).sum(axis=1)
        on_line = along[:, 0] * offsets[:, 1] == along[:, 1] * offsets[:, 0]
        between = on_line & (distances > 0) & (distances < (along * along).sum(axis=1))
        inserted = np.flatnonzero(between)
        order = inserted[np.lexsort((distances[inserted], wall[inserted]))]
        return np.insert(ring, wall[order] + 1, vertices[near[order]], axis=0)

    return [[split(ring) for ring in rings] for rings in polygons]


def _build(polygons: list[list[I64]]) -> Mesh | None:
    """Return the mesh, or None when the triangles don't fill just the space between the rings."""
    rings = [ring for rings in polygons for ring in rings]
    wall_starts = np.concatenate(rings)
    wall_ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    # Not np.unique, which imports masked arrays.
    keys = np.sort(_keys(wall_starts))
    keys = keys[np.diff(keys, prepend=-1) != 0]
    vertices = np.stack([keys // (2 * COORDINATE_LIMIT), keys % (2 * COORDINATE_LIMIT)], axis=1)
    corners = _triangulate(polygons)
    triangles = np.searchsorted(keys, _keys(corners))
    area = int(_doubled_areas(corners).sum())
    area_between_walls = int(_cross_products(wall_starts, wall_ends).sum())
    if area != area_between_walls or not np.array_equal(vertices[triangles], corners):
        return None
    walls = np.searchsorted(keys, _keys(wall_starts)) * len(keys)
    walls += np.searchsorted(keys, _keys(wall_ends))
    neighbors = _neighbors(triangles, len(keys), np.sort(walls, kind="stable"))
    if neighbors is None:
        return None
    return Mesh(vertices, triangles.astype(np.int32), neighbors)


def _triangulate(polygons: list[list[I64]]) -> I64:
    """Return triangles that fill the polygons: int64 (t, 3, 2), counter-clockwise corners."""
    shapes = [Polygon(rings[0], rings[1:]) for rings in polygons]
    filled = shapely.get_parts(shapely.constrained_delaunay_triangles(shapes))
    exact = shapely.get_coordinates(filled).reshape(len(filled), 4, 2)[:, :3]
    corners: I64 = exact.astype(np.int64)
    areas = _doubled_areas(corners)
    corners[areas < 0] = corners[areas < 0][:, ::-1]
    return corners[areas != 0]


def _cross_products(starts: I64, ends: I64) -> I64:
    """Return the cross products of points; over a closed ring they add up to twice its area."""
    return starts[:, 0] * ends[:, 1] - starts[:, 1] * ends[:, 0]


def _doubled_areas(corners: I64) -> I64:
    """Return twice the signed area of each triangle; `corners` is int64 (t, 3, 2)."""
    return _cross_products(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _neighbors(triangles: I64, vertex_count: int, walls: I64) -> I32 | None:
    """Return the triangle across each edge.

    Args:
        triangles: int64 (t, 3), vertex ids.
        vertex_count: Number of vertices.
        walls: start * vertex_count + end of each wall, with the free space on its left, sorted.

    Returns:
        int32 (t, 3); None unless every edge is either shared by two triangles or is a wall.
    """
    starts, ends = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    edges = starts * vertex_count + ends
    order = np.argsort(edges, kind="stable")
    ordered = edges[order]
    reverse = ends * vertex_count + starts
    position = np.minimum(np.searchsorted(ordered, reverse), len(ordered) - 1)
    shared = ordered[position] == reverse
    if (ordered[1:] == ordered[:-1]).any() or not np.array_equal(np.sort(edges[~shared]), walls):
        return None
    across = np.where(shared, order[position] // 3, WALL)
    return across.reshape(-1, 3).astype(np.int32)
