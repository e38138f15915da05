"""The mesh of free space: triangles between walls, and which of them holds a point.

A mesh is a triangulation of the free space whose vertices are all wall vertices. Everything that
sight and paths need follows from it by integer arithmetic. Which of the many possible
triangulations it is never shows in a result.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fleet2d.kernels._jit import kernel

SUB = 64
"""Lattice units per cell."""
CELL_CENTRE = 33
"""Offset of a cell's centre from its corner: odd, so that no axis-parallel wall runs through it."""
BUCKET = 256
"""Side of the square buckets that find the triangle of a point, in lattice units."""
OUTSIDE = -1
"""The triangle of a point that lies in no triangle."""
WALL = -1
"""The neighbor across an edge that is a wall."""

Int64 = npt.NDArray[np.int64]
Int32 = npt.NDArray[np.int32]


class Mesh(NamedTuple):
    """A triangulation of free space without extra points; may have holes and several components.

    Attributes:
        vertices: int64 (n, 2), lattice units, sorted by (x, y), so ids don't depend on the
            triangles.
        triangles: int32 (t, 3), vertex ids, counter-clockwise.
        neighbors: int32 (t, 3), the triangle across edge k (vertex k to vertex k + 1), -1 for a
            wall.
        bucket_start: int32 (rows * columns + 1,), where each bucket's part of `bucket_triangles`
            begins.
        bucket_triangles: int32, the triangles that overlap each square bucket, ascending.
        bucket_columns: Number of buckets along x.
        bucket_rows: Number of buckets along y.
    """

    vertices: Int64
    triangles: Int32
    neighbors: Int32
    bucket_start: Int32
    bucket_triangles: Int32
    bucket_columns: int
    bucket_rows: int


@kernel
def orient(ax: int, ay: int, bx: int, by: int, cx: int, cy: int) -> int:
    """Return twice the signed area of (a, b, c): positive when c lies left of the line from a to b.

    >>> int(orient(0, 0, 4, 0, 0, 2))
    8
    """
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@kernel
def contains_triangle(mesh: Mesh, triangle: int, x: int, y: int) -> bool:
    """Return whether the closed triangle holds the point."""
    vertices, triangles = mesh.vertices, mesh.triangles
    a, b, c = triangles[triangle, 0], triangles[triangle, 1], triangles[triangle, 2]
    ax, ay = vertices[a, 0], vertices[a, 1]
    bx, by = vertices[b, 0], vertices[b, 1]
    cx, cy = vertices[c, 0], vertices[c, 1]
    return bool(
        orient(ax, ay, bx, by, x, y) >= 0
        and orient(bx, by, cx, cy, x, y) >= 0
        and orient(cx, cy, ax, ay, x, y) >= 0
    )


@kernel
def inside_triangle(vertices: Int64, triangles: Int32, triangle: int, x: int, y: int) -> bool:
    """Return whether the point lies in the triangle, and not on its border."""
    a, b, c = triangles[triangle, 0], triangles[triangle, 1], triangles[triangle, 2]
    ax, ay = vertices[a, 0], vertices[a, 1]
    bx, by = vertices[b, 0], vertices[b, 1]
    cx, cy = vertices[c, 0], vertices[c, 1]
    return bool(
        orient(ax, ay, bx, by, x, y) > 0
        and orient(bx, by, cx, cy, x, y) > 0
        and orient(cx, cy, ax, ay, x, y) > 0
    )


@kernel
def touches_wall(
    vertices: Int64, triangles: Int32, neighbors: Int32, triangle: int, x: int, y: int
) -> bool:
    """Return whether a point of the closed triangle lies on a wall or at a wall's end."""
    edges_met = 0
    for k in range(3):
        a, b = triangles[triangle, k], triangles[triangle, k + 1 if k < 2 else 0]
        ax, ay = vertices[a, 0], vertices[a, 1]
        if orient(ax, ay, vertices[b, 0], vertices[b, 1], x, y) == 0:
            edges_met += 1 if neighbors[triangle, k] != WALL else 2
    return edges_met > 1


@kernel
def on_wall(mesh: Mesh, triangle: int, x: int, y: int) -> bool:
    """Return whether a point of the closed triangle lies on a wall or at a wall's end."""
    return touches_wall(mesh.vertices, mesh.triangles, mesh.neighbors, triangle, x, y)


@kernel
def locate(mesh: Mesh, x: int, y: int) -> int:
    """Return the lowest triangle that holds the point (borders included), or -1 outside."""
    column, row = x // BUCKET, y // BUCKET
    if column < 0 or row < 0 or column >= mesh.bucket_columns or row >= mesh.bucket_rows:
        return OUTSIDE
    bucket = row * mesh.bucket_columns + column
    start, triangles = mesh.bucket_start, mesh.bucket_triangles
    for i in range(start[bucket], start[bucket + 1]):
        triangle = int(triangles[i])
        if contains_triangle(mesh, triangle, x, y):
            return triangle
    return OUTSIDE


@kernel
def strictly_inside(mesh: Mesh, x: int, y: int) -> bool:
    """Return whether the point lies in free space and on no wall."""
    triangle = locate(mesh, x, y)
    return triangle != OUTSIDE and not on_wall(mesh, triangle, x, y)


@kernel
def _overlaps_bucket(vertices: Int64, corners: Int32, x: int, y: int) -> bool:
    """Return whether the bucket with corner (x, y) reaches the inner side of all three edges."""
    for k in range(3):
        a, b = corners[k], corners[k + 1 if k < 2 else 0]
        ax, ay = vertices[a, 0], vertices[a, 1]
        bx, by = vertices[b, 0], vertices[b, 1]
        # The bucket's corner that lies farthest to the left of the edge decides.
        far_x = x if by > ay else x + BUCKET
        far_y = y + BUCKET if bx > ax else y
        if orient(ax, ay, bx, by, far_x, far_y) < 0:
            return False
    return True


@kernel
def build_buckets(
    vertices: Int64, triangles: Int32, bucket_rows: int, bucket_columns: int
) -> tuple[Int32, Int32]:
    """List the triangles that overlap each square bucket.

    Returns:
        `bucket_start` and `bucket_triangles` as in :class:`Mesh`.
    """
    start = np.zeros(bucket_rows * bucket_columns + 1, np.int32)
    listed = np.empty(0, np.int32)
    next_free = start
    for filling in range(2):
        if filling:
            for bucket in range(bucket_rows * bucket_columns):
                start[bucket + 1] += start[bucket]
            listed = np.empty(start[-1], np.int32)
            next_free = start[:-1].copy()
        for triangle in range(triangles.shape[0]):
            a, b, c = triangles[triangle, 0], triangles[triangle, 1], triangles[triangle, 2]
            ax, bx, cx = vertices[a, 0], vertices[b, 0], vertices[c, 0]
            ay, by, cy = vertices[a, 1], vertices[b, 1], vertices[c, 1]
            for row in range(min(ay, by, cy) // BUCKET, max(ay, by, cy) // BUCKET + 1):
                for column in range(min(ax, bx, cx) // BUCKET, max(ax, bx, cx) // BUCKET + 1):
                    x, y = column * BUCKET, row * BUCKET
                    if not _overlaps_bucket(vertices, triangles[triangle], x, y):
                        continue
                    bucket = row * bucket_columns + column
                    if filling:
                        listed[next_free[bucket]] = triangle
                        next_free[bucket] += 1
                    else:
                        start[bucket + 1] += 1
    return start, listed


@kernel
def _columns_in_triangle(mesh: Mesh, triangle: int, row: int, columns: int) -> tuple[int, int]:
    """Return the first and last column of `row` whose cell centres the closed triangle holds."""
    vertices, triangles = mesh.vertices, mesh.triangles
    first, last = 0, columns - 1
    y = row * SUB + CELL_CENTRE
    for k in range(3):
        a, b = triangles[triangle, k], triangles[triangle, k + 1 if k < 2 else 0]
        ax, ay = vertices[a, 0], vertices[a, 1]
        run, rise = vertices[b, 0] - ax, vertices[b, 1] - ay
        # Left of the edge: rise * (x - ax) <= run * (y - ay), with x = SUB * column + CELL_CENTRE.
        slope = SUB * rise
        bound = run * (y - ay) + rise * (ax - CELL_CENTRE)
        if rise > 0:
            last = min(last, bound // slope)
        elif rise < 0:
            first = max(first, -(bound // -slope))
        elif bound < 0:
            return 0, -1
    return first, last


@kernel
def rasterize_cells(mesh: Mesh, rows: int, columns: int) -> Int32:
    """Return the triangle of every cell centre that lies strictly inside free space.

    Returns:
        int32 (rows, columns): the lowest triangle that holds the centre; -1 for a centre outside or
        on a wall.
    """
    vertices, triangles = mesh.vertices, mesh.triangles
    cells = np.full((rows, columns), OUTSIDE, np.int32)
    for triangle in range(triangles.shape[0]):
        a, b, c = triangles[triangle, 0], triangles[triangle, 1], triangles[triangle, 2]
        ay, by, cy = vertices[a, 1], vertices[b, 1], vertices[c, 1]
        lowest = max(0, -((CELL_CENTRE - min(ay, by, cy)) // SUB))
        highest = min(rows - 1, (max(ay, by, cy) - CELL_CENTRE) // SUB)
        for row in range(lowest, highest + 1):
            first, last = _columns_in_triangle(mesh, triangle, row, columns)
            y = row * SUB + CELL_CENTRE
            for column in range(first, last + 1):
                if cells[row, column] != OUTSIDE:
                    continue
                # Only the ends of the run can lie on an edge.
                at_end = column in (first, last)
                if at_end and on_wall(mesh, triangle, column * SUB + CELL_CENTRE, y):
                    continue
                cells[row, column] = triangle
    return cells
