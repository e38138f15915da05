"""Walls on the lattice: repaired, snapped, triangulated, and cut by gates that shut."""

from collections.abc import Collection, Sequence
from contextlib import suppress
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.bounds import CROSSINGS
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import COORDINATE_LIMIT, Lattice, unit_hint
from fleet2d.kernels import I32, I64, SUB, WALL, Mesh
from fleet2d.runtime.determinism import sum_in_order

# Edges that are looked up at once: each may cross all others.
_EDGES = 64


def repair(shape: BaseGeometry) -> BaseGeometry:
    """Return the area that an invalid shape encloses: everything within its outlines is inside.

    Raises:
        FloorPlanError: It crosses itself too often; repairing would take too long.

    Example:
        >>> bow = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
        >>> repair(bow).area
        2.0
    """
    outlines = shapely.get_rings(shapely.get_parts(shape))
    corners = [shapely.get_coordinates(outline) for outline in outlines]
    ends = [np.stack([c[:-1], c[1:]], axis=1) for c in corners]
    edges: Any = shapely.linestrings(np.concatenate(ends)) if ends else np.empty(0, object)
    tree = shapely.STRtree(edges)
    count = 0
    for begin in range(0, len(edges), _EDGES):
        pairs = tree.query(edges[begin : begin + _EDGES], predicate="crosses")
        count += pairs.shape[1] // 2  # each crossing is found from both edges
        CROSSINGS.check(count, "it", FloorPlanError, prefix="at least ")
    return shapely.make_valid(shape, method="structure", keep_collapsed=False)


GRID = 2
"""Walls lie on even lattice units; cell centres are odd, so no straight wall hits one."""


class SnappedPolygon(NamedTuple):
    """A polygon moved onto the wall lattice.

    Attributes:
        polygons: Its parts, with even integer coordinates; none if it was too thin.
        area_change: New area minus old area, square lattice units.
        tolerance: The largest change of the area that rounding every wall point can cause.
    """

    polygons: list[Polygon]
    area_change: float
    tolerance: float


def snap_polygon(polygon: BaseGeometry) -> SnappedPolygon:
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
    parts = [shapely.orient_polygons(p) for p in shapely.get_parts(snapped) if p.area > 0]
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
        vertices = np.concatenate([ring for polygon in rings for ring in polygon])
        mesh = _build(_split_at(rings, np.unique(vertices, axis=0)))
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
        low = exact.min(axis=0)
        high = exact.max(axis=0)
        if low.min() < 0 or high[0] > width or high[1] > height or high.max() >= COORDINATE_LIMIT:
            raise FloorPlanError(
                f"The walls reach from {low.tolist()} to {high.tolist()} lattice units, but the "
                f"plan covers [0, 0] to [{width}, {height}], and nothing may reach "
                f"{COORDINATE_LIMIT}. Use larger cells."
            )
        outlines = shapely.get_rings(shapely.orient_polygons(polygon))
        rings.append([shapely.get_coordinates(r)[:-1].astype(np.int64) for r in outlines])
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
        before = np.roll(ring, 1, axis=0) - ring
        after = np.roll(ring, -1, axis=0) - ring
        bends = cross_products(before, after) != 0
        return ring[bends | np.isin(_keys(ring), touching)]

    return [list(map(straighten, rings)) for rings in polygons]


def _split_at(polygons: list[list[I64]], vertices: I64) -> list[list[I64]]:
    """Insert each of some points that lies in the middle of a wall into that wall."""
    tree = shapely.STRtree(np.asarray(shapely.points(vertices)))

    def split(ring: I64) -> I64:
        ends = np.roll(ring, -1, axis=0)
        boxes = shapely.box(*np.minimum(ring, ends).T, *np.maximum(ring, ends).T)
        wall, near = tree.query(np.asarray(boxes))
        along = (ends - ring)[wall]
        offsets = vertices[near] - ring[wall]
        distances = (offsets * along).sum(axis=1)
        on_line = cross_products(along, offsets) == 0
        between = on_line & (distances > 0) & (distances < (along * along).sum(axis=1))
        inserted = np.flatnonzero(between)
        order = inserted[np.lexsort((distances[inserted], wall[inserted]))]
        return np.insert(ring, wall[order] + 1, vertices[near[order]], axis=0)

    return [list(map(split, rings)) for rings in polygons]


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
    area = int(doubled_areas(corners).sum())
    area_between_walls = int(cross_products(wall_starts, wall_ends).sum())
    if area != area_between_walls or not np.array_equal(vertices[triangles], corners):
        return None
    walls = np.searchsorted(keys, _keys(wall_starts)) * len(keys)
    walls += np.searchsorted(keys, _keys(wall_ends))
    neighbors = _neighbors(triangles, len(keys), np.sort(walls, kind="stable"))
    if neighbors is None:
        return None
    return Mesh(vertices, triangles.astype(np.int32), neighbors)


# GEOS fails for some polygons in which holes touch, but not for their mirror images.
_MIRRORS = ((1, 1), (-1, -1), (-1, 1), (1, -1))


def _triangulate(polygons: list[list[I64]]) -> I64:
    """Return triangles that fill the polygons: int64 (t, 3, 2), counter-clockwise corners.

    There are none where GEOS fails.
    """
    for sides in _MIRRORS:
        shapes = [_mirrored(rings, sides) for rings in polygons]
        with suppress(shapely.GEOSException):
            filled = shapely.get_parts(shapely.constrained_delaunay_triangles(shapes))
            break
    else:
        return np.zeros((0, 3, 2), np.int64)
    exact = shapely.get_coordinates(filled).reshape(len(filled), 4, 2)[:, :3]
    corners: I64 = exact.astype(np.int64) * sides
    areas = doubled_areas(corners)
    corners[areas < 0] = corners[areas < 0][:, ::-1]
    return corners[areas != 0]


def _mirrored(rings: list[I64], sides: tuple[int, int]) -> Polygon:
    outline, *holes = (ring * sides for ring in rings)
    return Polygon(outline, holes)


def cross_products(starts: I64, ends: I64) -> I64:
    """Return the cross products of points; over a closed ring they add up to twice its area."""
    return starts[..., 0] * ends[..., 1] - starts[..., 1] * ends[..., 0]


def doubled_areas(corners: I64) -> I64:
    """Return twice the signed area of each triangle; `corners` is int64 (t, 3, 2)."""
    return cross_products(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _neighbors(triangles: I64, vertex_count: int, walls: I64) -> I32 | None:
    """Return the triangle across each edge.

    Args:
        triangles: int64 (t, 3), vertex ids.
        vertex_count: Number of vertices.
        walls: start * vertex_count + end of each wall, with the free space on its left, sorted.

    Returns:
        int32 (t, 3); None unless every edge is either shared by two triangles or is a wall.
    """
    starts = triangles.ravel()
    ends = np.roll(triangles, -1, axis=1).ravel()
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


Segment = tuple[tuple[int, int], tuple[int, int]]


class Gates:
    """A mesh in which some segments are edges, so that shutting one changes only two numbers.

    The triangles on both sides of a shut gate are not neighbors: every kernel sees a wall without
    thickness.

    Attributes:
        mesh: The mesh with all gates open.

    Example:
        >>> import shapely
        >>> from fleet2d.floorplan.mesh import build_mesh
        >>> gate = ((320, 0), (320, 640))
        >>> mesh = build_mesh([shapely.box(0, 0, 640, 640)], 10, 10, corners=gate)
        >>> gates = Gates(mesh, [gate])
        >>> from fleet2d.kernels import line_of_sight
        >>> for walls in (gates.mesh, gates.shut({0})):
        ...     line_of_sight(walls, 11, 11, 631, 11)
        True
        False
    """

    def __init__(self, mesh: Mesh, segments: Sequence[Segment]) -> None:
        """Make the segments edges of a mesh.

        Args:
            mesh: A mesh with their ends as vertices, and only free space between these.
            segments: From wall to wall [lattice]; they don't cross each other.

        Raises:
            FloorPlanError: The mesh has no such vertices, or a wall is between them.
        """
        vertices = mesh.vertices
        corners = [tuple(triangle) for triangle in mesh.triangles.tolist()]
        owner = {edge: number for number, t in enumerate(corners) for edge in _edges(t)}
        ends = [(_vertex(vertices, a), _vertex(vertices, b)) for a, b in segments]
        for a, b in ends:
            _force_edge(vertices, corners, owner, a, b)
        across = [owner.get((b, a), WALL) for t in corners for a, b in _edges(t)]
        neighbors = np.array(across, np.int32).reshape(-1, 3)
        self.mesh = Mesh(vertices, np.array(corners, np.int32), neighbors)

        def side(a: int, b: int) -> tuple[int, int]:
            triangle = owner[a, b]
            return triangle, corners[triangle].index(a)

        # Both sides of each: (triangle, edge).
        self._sides = [(side(a, b), side(b, a)) for a, b in ends]

    def shut(self, gates: Collection[int]) -> Mesh:
        """Return the mesh with these gates shut, by their number."""
        if not gates:
            return self.mesh
        neighbors = self.mesh.neighbors.copy()
        for gate in gates:
            for triangle, edge in self._sides[gate]:
                neighbors[triangle, edge] = WALL
        return self.mesh.with_neighbors(neighbors)


def _edges(corners: tuple[int, ...]) -> tuple[tuple[int, int], ...]:
    a, b, c = corners
    return (a, b), (b, c), (c, a)


def _force_edge(
    vertices: I64, corners: list[tuple[int, ...]], owner: dict[tuple[int, int], int], a: int, b: int
) -> None:
    """Flip the edges that cross a segment until it is an edge itself (Sloan 1993)."""
    if (a, b) in owner and (b, a) in owner:
        return
    crossing = _crossing(vertices, owner, a, b)
    for _ in range(16 * (len(crossing) + 1) ** 2):
        if not crossing:
            break
        p, q = crossing.pop(0)
        left, right = owner[p, q], owner[q, p]
        (c,) = {*corners[left]} - {p, q}
        (d,) = {*corners[right]} - {p, q}
        if _turn(vertices, d, c, q) * _turn(vertices, d, c, p) >= 0:
            crossing.append((p, q))  # the quadrilateral is not convex yet
            continue
        corners[left], corners[right] = (p, d, c), (d, q, c)
        del owner[p, q], owner[q, p]
        for t in (left, right):
            owner |= dict.fromkeys(_edges(corners[t]), t)
        if {c, d} != {a, b} and _cross(vertices, a, b, c, d):
            crossing.append((c, d))
    if (a, b) not in owner or (b, a) not in owner:
        at = vertices[[a, b]].tolist()
        raise FloorPlanError(f"the door line {at} [lattice] does not cross free space alone")


def _crossing(
    vertices: I64, owner: dict[tuple[int, int], int], a: int, b: int
) -> list[tuple[int, int]]:
    """Return the inner edges that cross a segment, each once."""
    edges = np.fromiter(chain.from_iterable(owner), np.int64, 2 * len(owner)).reshape(-1, 2)
    edges = edges[edges[:, 0] < edges[:, 1]]
    side = np.sign(cross_products(vertices[b] - vertices[a], vertices - vertices[a]))
    apart = edges[side[edges].prod(axis=1) < 0].tolist()
    return [(p, q) for p, q in apart if (q, p) in owner and _cross(vertices, a, b, p, q)]


def _cross(vertices: I64, a: int, b: int, p: int, q: int) -> bool:
    """Return whether two segments cross between their ends."""
    apart = _turn(vertices, a, b, p) * _turn(vertices, a, b, q) < 0
    return apart and _turn(vertices, p, q, a) * _turn(vertices, p, q, b) < 0


def _turn(vertices: I64, a: int, b: int, c: int) -> int:
    """Return 1, 0 or -1 as c lies left of, on or right of the line from a to b."""
    (ax, ay), (bx, by), (cx, cy) = vertices[[a, b, c]].tolist()
    cross = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return int(cross > 0) - int(cross < 0)


def _vertex(vertices: I64, point: tuple[int, int]) -> int:
    """Return the id of the vertex at a point."""
    matches = np.flatnonzero((vertices == point).all(axis=1))
    if len(matches) == 0:
        raise FloorPlanError(f"the door line ends at {point} [lattice], where no wall is")
    return int(matches[0])


# Number of parts of which a note lists the areas.
PARTS_LISTED = 5

# Distance at which a coordinate counts as on the lattice, for rounding of decimals [lattice].
LATTICE_TOLERANCE = 1e-6


def free_on_lattice(
    name: str, free: Polygon | MultiPolygon, cell: float
) -> tuple[Lattice, list[Polygon]]:
    """Put free space [m] on the lattice, in canonical order, so that equal walls make equal plans.

    Args:
        name: Name of the plan, for messages.
        free: The free space between the walls [m].
        cell: Side of a cell [m].

    Returns:
        The lattice that covers it, and the free space on it.

    Raises:
        FloorPlanError: It encloses no area, or would lose more of it than rounding explains.
    """
    if free.is_empty or not free.area > 0:
        raise FloorPlanError(
            f"the outline of {name} encloses no area: check that its points go round the free space"
        )
    first = Lattice.around(free.bounds, cell)
    snapped = _on_walls(free, first.units_per_m)
    if not snapped.polygons:
        raise FloorPlanError(
            f"nothing is left of {name} ({free.area:.3g} m2) at cells of {cell:g} m: choose a"
            f" smaller floorplan.cell, and check that the file is in metres{unit_hint(first.size)}"
        )
    if abs(snapped.area_change) > snapped.tolerance:
        change = snapped.area_change / first.units_per_m**2
        raise FloorPlanError(
            f"rounding the walls of {name} to cells of {cell:g} m would change its area by"
            f" {change:+.2f} of {free.area:.2f} m2: choose a smaller floorplan.cell, and check that"
            " the outline doesn't run over itself"
        )
    # The lattice of the snapped walls, so that a plan and its stored copy agree.
    corners = shapely.total_bounds(snapped.polygons) / first.units_per_m
    lattice = Lattice.around(tuple(corners.tolist()), cell)
    shift = lattice.to_lattice((0.0, 0.0))
    moved = [shapely.transform(polygon, lambda xy: xy + shift) for polygon in snapped.polygons]
    return lattice, canonical_order(moved)


def glazed(
    lattice: Lattice, polygons: Sequence[Polygon], areas: Sequence[Polygon]
) -> tuple[tuple[Polygon, ...], list[str]]:
    """Return the areas of glass that join free space on two sides of a wall, and notes on others.

    Args:
        lattice: The lattice.
        polygons: Free space [lattice].
        areas: Glass in walls, which may reach into the free space [m].

    Returns:
        The areas [lattice], on even coordinates; and the notes.

    Example:
        >>> lattice = Lattice.around((0, 0, 4.1, 2), cell=0.05)
        >>> rooms = [shapely.box(128, 128, 2688, 2688), shapely.box(2816, 128, 5376, 2688)]
        >>> panes, notes = glazed(lattice, rooms, [shapely.box(1.9, 0.5, 2.2, 1.5)])
        >>> [pane.bounds for pane in panes], notes
        ([(2560.0, 768.0, 2944.0, 2048.0)], [])
    """
    free = MultiPolygon(list(polygons))
    panes = []
    notes = list[str]()
    outer = 0
    for area in areas:
        pane = Polygon(lattice.to_walls(np.asarray(area.exterior.coords)[:-1]))
        in_wall = shapely.difference(pane, free)
        contact = shapely.intersection(in_wall.buffer(GRID / 2, join_style="mitre"), free)
        sides = [part for part in shapely.get_parts(contact).tolist() if part.area > 0]
        along = shapely.length(shapely.intersection(in_wall.boundary, free.buffer(GRID / 2)))
        if len(sides) > 1 or along > in_wall.length / 2:
            panes.append(pane)
        elif sides and in_wall.area > 0:
            outer += 1
        else:
            at = area.centroid
            notes.append(
                f"the glass at ({at.x:.2f}, {at.y:.2f}) m is in no wall beside free space: ignored;"
                " glass is part of a wall, so leave its area out of the free space"
            )
    if outer:
        notes.append(f"windows in outer walls, through which nobody is seen: {outer}")
    return tuple(panes), notes


def canonical_order(polygons: Sequence[Polygon]) -> list[Polygon]:
    """Return polygons and their rings in canonical order."""
    normal = shapely.orient_polygons(shapely.normalize(polygons))
    return sorted(normal.tolist(), key=lambda p: shapely.get_coordinates(p).tolist())


def _on_walls(free: Polygon | MultiPolygon, units_per_m: float) -> SnappedPolygon:
    """Snap free space [m] to even lattice units; free space that is there already stays as it is.

    Snapping is not idempotent, as a wall that moves may come near another corner, but a stored plan
    must be read back unchanged.
    """
    exact = shapely.transform(free, lambda xy: xy * units_per_m)
    even = shapely.transform(exact, lambda xy: 2 * np.rint(xy / 2))
    moved = np.abs(shapely.get_coordinates(even) - shapely.get_coordinates(exact)).max()
    if moved < LATTICE_TOLERANCE and even.is_valid:
        parts = shapely.get_parts(even)
        return SnappedPolygon(parts.tolist(), even.area - exact.area, GRID * exact.length)
    return snap_polygon(exact)


def part_notes(lattice: Lattice, polygons: Sequence[Polygon]) -> list[str]:
    """Return a note with the areas of the parts of free space, if there are several."""
    if len(polygons) == 1:
        return []
    areas = sorted((p.area / lattice.units_per_m**2 for p in polygons), reverse=True)
    sizes = ", ".join(f"{area:.2f}" for area in areas[:PARTS_LISTED])
    more = ", …" if len(areas) > PARTS_LISTED else ""
    return [f"the free space is in {len(areas)} parts that nothing joins: {sizes}{more} m2"]
