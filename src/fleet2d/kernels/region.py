"""The region visible from a point.

A region is a list of pieces, counter-clockwise, each a triangle between the eye and a wall. A piece
is stored as two numbers: the vertex that its right border runs through, and the wall edge that it
ends at (``3 * triangle + k``). The piece's left border is the right border of the next piece, so
every direction belongs to exactly one piece. Coordinates appear only when a region is measured or
drawn.

The method is triangular expansion (Bungiu, Hemmer et al. 2014, arXiv 1403.3905): start with the
triangle of the eye and look through its edges; a cone of sight that enters a triangle is split by
the apex of that triangle if the apex lies strictly inside the cone. Every vertex that is visible
splits a cone, and no other does, so the pieces don't depend on the triangulation.
"""

import numpy as np
import numpy.typing as npt

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.mesh import (
    CELL_CENTRE,
    OUTSIDE,
    SUB,
    Int32,
    Int64,
    Mesh,
    orient,
    touches_wall,
)
from fleet2d.kernels.sight import look_through, scratch_for

Float64 = npt.NDArray[np.float64]


@kernel
def _half(dx: int, dy: int) -> int:
    """Return 0 for a direction in [0, half a turn), 1 for one in [half a turn, a full turn)."""
    return 0 if dy > 0 or (dy == 0 and dx > 0) else 1


@kernel
def look_around(
    vertices: Int64,
    triangles: Int32,
    neighbors: Int32,
    x: int,
    y: int,
    triangle: int,
    right: Int32,
    wall: Int32,
    stack: Int32,
) -> tuple[int, int]:
    """List the pieces seen from (x, y), counter-clockwise, beginning anywhere.

    Returns:
        The number of pieces, and the one whose right border has the smallest angle in [0, one
        turn).
    """
    if triangle == OUTSIDE or touches_wall(vertices, triangles, neighbors, triangle, x, y):
        return 0, 0
    count = 0
    for k in range(3):
        count = look_through(
            vertices, triangles, neighbors, x, y, triangle, k, right, wall, count, stack
        )
    # No piece is as wide as half a turn, so right borders lie in both halves of the turn.
    last = right[count - 1]
    before = _half(vertices[last, 0] - x, vertices[last, 1] - y)
    for first in range(count):
        half = _half(vertices[right[first], 0] - x, vertices[right[first], 1] - y)
        if half < before:
            return count, first
        before = half
    return count, 0


@kernel
def visible_region(
    mesh: Mesh, x: int, y: int, triangle: int, right: Int32, wall: Int32, stack: Int32
) -> int:
    """Find everything that is visible from a point.

    The pieces come counter-clockwise, the first is the one whose right border has the smallest
    angle in [0, one turn) from the x axis.

    Args:
        mesh: Free space.
        x: Where the eye is, lattice units.
        y: Where the eye is, lattice units.
        triangle: A triangle that holds the eye; -1 is allowed.
        right: Out: the vertex on each piece's right border. At most one per vertex.
        wall: Out: the wall edge, 3 * triangle + k, at which each piece ends.
        stack: Scratch space, from :func:`~fleet2d.kernels.sight.scratch_for`.

    Returns:
        The number of pieces; 0 for an eye outside or on a wall.
    """
    vertices, triangles, neighbors = mesh.vertices, mesh.triangles, mesh.neighbors
    count, first = look_around(vertices, triangles, neighbors, x, y, triangle, right, wall, stack)
    if first > 0:
        for values in (right, wall):
            moved = values[:first].copy()
            values[: count - first] = values[first:count].copy()
            values[count - first : count] = moved
    return count


@kernel
def region_contains(
    mesh: Mesh,
    x: int,
    y: int,
    right: Int32,
    wall: Int32,
    px: int,
    py: int,
) -> bool:
    """Return whether p is in the region of (x, y): the verdict of a line of sight.

    Args:
        mesh: Free space.
        x: Where the eye is, lattice units.
        y: Where the eye is, lattice units.
        right: int32 (n,), the vertex on each piece's right border, exactly the region's pieces.
        wall: int32 (n,), the wall edge of each piece.
        px: The looked-for point, lattice units.
        py: The looked-for point, lattice units.
    """
    dx, dy = px - x, py - y
    pieces = right.shape[0]
    if pieces == 0 or (dx == 0 and dy == 0):
        return bool(pieces > 0)
    vertices = mesh.vertices
    half = _half(dx, dy)
    # The last piece whose right border is at or before p; the last of all if p precedes the first.
    low, high = -1, pieces
    while high - low > 1:
        middle = (low + high) >> 1
        vertex = right[middle]
        vx, vy = vertices[vertex, 0] - x, vertices[vertex, 1] - y
        vertex_half = _half(vx, vy)
        if vertex_half < half or (vertex_half == half and vx * dy - vy * dx >= 0):
            low = middle
        else:
            high = middle
    piece = low if low >= 0 else pieces - 1
    vertex = right[piece]
    vx, vy = vertices[vertex, 0] - x, vertices[vertex, 1] - y
    if vx * dy - vy * dx == 0 and vx * dx + vy * dy > 0:
        # Exactly in line with a corner: visible only in front of it.
        return bool(dx * dx + dy * dy < vx * vx + vy * vy)
    triangle = int(wall[piece]) // 3
    k = wall[piece] - 3 * triangle
    a = mesh.triangles[triangle, k]
    b = mesh.triangles[triangle, k + 1 if k < 2 else 0]
    return bool(orient(vertices[a, 0], vertices[a, 1], vertices[b, 0], vertices[b, 1], px, py) > 0)


@kernel
def region_contains_points(
    mesh: Mesh, x: int, y: int, right: Int32, wall: Int32, points: Int64
) -> npt.NDArray[np.bool_]:
    """Return bool (n,), which of the points int64 (n, 2) are in the region of (x, y)."""
    found = np.zeros(points.shape[0], np.bool_)
    for i in range(points.shape[0]):
        px, py = points[i, 0], points[i, 1]
        found[i] = region_contains(mesh, x, y, right, wall, px, py)
    return found


@kernel
def _grown(pieces: Int32, used: int) -> Int32:
    """Return a copy of the first `used` numbers in an array of about twice the size."""
    larger = np.empty(2 * pieces.shape[0] + 64, np.int32)
    larger[:used] = pieces[:used]
    return larger


@kernel
def regions_of_cells(mesh: Mesh, cells: Int64, cell_triangles: Int32) -> tuple[Int64, Int32, Int32]:
    """Find the regions visible from the centres of many cells.

    Args:
        mesh: Free space.
        cells: int64 (n, 2), row and column of each cell.
        cell_triangles: int32 (rows, columns) from :func:`~fleet2d.kernels.mesh.rasterize_cells`.

    Returns:
        `start` int64 (n + 1,), `right` int32, `wall` int32: the pieces of cell i are
        `right[start[i]:start[i + 1]]` and `wall[start[i]:start[i + 1]]`, as from
        :func:`visible_region`.
    """
    vertices, triangles, neighbors = mesh.vertices, mesh.triangles, mesh.neighbors
    wall, stack = scratch_for(vertices)
    right = np.empty_like(wall)
    start = np.zeros(cells.shape[0] + 1, np.int64)
    all_right = np.empty(32 * cells.shape[0], np.int32)
    all_wall = np.empty(32 * cells.shape[0], np.int32)
    used = 0
    for i in range(cells.shape[0]):
        row, column = cells[i, 0], cells[i, 1]
        x, y = column * SUB + CELL_CENTRE, row * SUB + CELL_CENTRE
        triangle = int(cell_triangles[row, column])
        count, first = look_around(
            vertices, triangles, neighbors, x, y, triangle, right, wall, stack
        )
        while used + count > all_right.shape[0]:
            all_right, all_wall = _grown(all_right, used), _grown(all_wall, used)
        for piece in range(first, count):
            all_right[used], all_wall[used] = right[piece], wall[piece]
            used += 1
        for piece in range(first):
            all_right[used], all_wall[used] = right[piece], wall[piece]
            used += 1
        start[i + 1] = used
    return start, all_right[:used], all_wall[:used]


@kernel
def region_outline(
    mesh: Mesh, x: int, y: int, right: Int32, wall: Int32, outline: Float64
) -> float:
    """Measure a region, and list the corners of its outline.

    Args:
        mesh: Free space.
        x: Where the eye is, lattice units.
        y: Where the eye is, lattice units.
        right: int32 (n,), the vertex on each piece's right border, exactly the region's pieces.
        wall: int32 (n,), the wall edge of each piece.
        outline: Out: float64 (2 n, 2), for each piece the ends of its wall, right before left,
            lattice units.

    Returns:
        The area, square lattice units.
    """
    vertices, triangles = mesh.vertices, mesh.triangles
    pieces = right.shape[0]
    doubled_area = 0.0
    for i in range(pieces):
        triangle = int(wall[i]) // 3
        k = wall[i] - 3 * triangle
        a, b = triangles[triangle, k], triangles[triangle, k + 1 if k < 2 else 0]
        ux, uy = vertices[a, 0] - x, vertices[a, 1] - y
        ex, ey = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1]
        r, left = right[i], right[i + 1 if i + 1 < pieces else 0]
        rx, ry = vertices[r, 0] - x, vertices[r, 1] - y
        lx, ly = vertices[left, 0] - x, vertices[left, 1] - y
        # How far the wall is along each border, as a multiple of the distance to the border's
        # vertex: exactly 1 where the vertex is an end of the wall.
        reach_right = (ux * ey - uy * ex) / (rx * ey - ry * ex)
        reach_left = (ux * ey - uy * ex) / (lx * ey - ly * ex)
        outline[2 * i, 0], outline[2 * i, 1] = x + reach_right * rx, y + reach_right * ry
        outline[2 * i + 1, 0], outline[2 * i + 1, 1] = x + reach_left * lx, y + reach_left * ly
        doubled_area += (rx * ly - ry * lx) * (reach_right * reach_left)
    return doubled_area / 2.0
