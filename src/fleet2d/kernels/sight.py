"""Sight lines, by the strict rule: a sight line touches no wall, not even a corner.

All of it is integer arithmetic on the mesh of free space, so verdicts are exact and symmetric, and
they don't depend on how the free space is cut into triangles.
"""

from typing import NamedTuple

import numpy as np

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.mesh import OUTSIDE, WALL, Int32, Int64, Mesh, orient, touches_wall


@kernel
def entry_edge(neighbors: Int32, triangle: int, previous: int) -> int:
    """Return which edge (0, 1, 2) of `triangle` it shares with the triangle `previous`."""
    if neighbors[triangle, 0] == previous:
        return 0
    return 1 if neighbors[triangle, 1] == previous else 2


@kernel
def _is_before_corner(
    vertices: Int64, triangles: Int32, triangle: int, qx: int, qy: int, dx: int, dy: int
) -> bool:
    """Return whether q + d comes before the corner that the ray from q along d hits."""
    for k in range(3):
        corner = triangles[triangle, k]
        vx, vy = vertices[corner, 0] - qx, vertices[corner, 1] - qy
        if dx * vy - dy * vx == 0 and dx * vx + dy * vy > 0:
            return bool(dx * dx + dy * dy < vx * vx + vy * vy)
    return False


@kernel
def walk_line_of_sight(
    vertices: Int64,
    triangles: Int32,
    neighbors: Int32,
    qx: int,
    qy: int,
    triangle: int,
    px: int,
    py: int,
) -> bool:
    """Walk from triangle to triangle along a line of sight; see :func:`line_of_sight`.

    It takes the arrays of the mesh, for loops over many lines: compiled code counts a reference
    each time that it takes an array out of a tuple, which costs half as much as the walk.
    """
    if triangle == OUTSIDE or touches_wall(vertices, triangles, neighbors, triangle, qx, qy):
        return False
    dx, dy = px - qx, py - qy
    if dx == 0 and dy == 0:
        return True
    a, b, c = triangles[triangle, 0], triangles[triangle, 1], triangles[triangle, 2]
    # Which side of the ray each corner is on: positive is left.
    side_a = dx * (vertices[a, 1] - qy) - dy * (vertices[a, 0] - qx)
    side_b = dx * (vertices[b, 1] - qy) - dy * (vertices[b, 0] - qx)
    side_c = dx * (vertices[c, 1] - qy) - dy * (vertices[c, 0] - qx)
    if side_a < 0 < side_b:
        leaving, right, left = 0, a, b
    elif side_b < 0 < side_c:
        leaving, right, left = 1, b, c
    elif side_c < 0 < side_a:
        leaving, right, left = 2, c, a
    else:
        return _is_before_corner(vertices, triangles, triangle, qx, qy, dx, dy)
    while True:
        rx, ry = vertices[right, 0], vertices[right, 1]
        if orient(rx, ry, vertices[left, 0], vertices[left, 1], px, py) > 0:
            return True
        following = int(neighbors[triangle, leaving])
        if following == WALL:
            return False
        entry = entry_edge(neighbors, following, triangle)
        apex = triangles[following, entry - 1 if entry > 0 else 2]
        apex_x, apex_y = vertices[apex, 0] - qx, vertices[apex, 1] - qy
        side = dx * apex_y - dy * apex_x
        if side > 0:
            leaving, left = entry + 1 if entry < 2 else 0, apex
        elif side < 0:
            leaving, right = entry - 1 if entry > 0 else 2, apex
        else:
            return bool(dx * dx + dy * dy < apex_x * apex_x + apex_y * apex_y)
        triangle = following


@kernel
def line_of_sight(mesh: Mesh, qx: int, qy: int, triangle: int, px: int, py: int) -> bool:
    """Return whether p is visible from q: the segment between them touches no wall point.

    A point outside or on a wall sees nothing and isn't seen.

    Args:
        mesh: Free space.
        qx: Where the eye is, lattice units.
        qy: Where the eye is, lattice units.
        triangle: A triangle that holds q, from :func:`~fleet2d.kernels.mesh.locate`; -1 is allowed.
        px: Where the looked-for point is, lattice units.
        py: Where the looked-for point is, lattice units.
    """
    return walk_line_of_sight(
        mesh.vertices, mesh.triangles, mesh.neighbors, qx, qy, triangle, px, py
    )


@kernel
def scratch_for(vertices: Int64) -> tuple[Int32, Int32]:
    """Return scratch space for one list of pieces: int32 (n,) and the stack, int32 (n, 3)."""
    size = vertices.shape[0] + 4
    return np.empty(size, np.int32), np.empty((size, 3), np.int32)


@kernel
def look_through(
    vertices: Int64,
    triangles: Int32,
    neighbors: Int32,
    x: int,
    y: int,
    triangle: int,
    edge: int,
    right: Int32,
    wall: Int32,
    count: int,
    stack: Int32,
) -> int:
    """Append the pieces seen from (x, y) through one edge of its triangle, from right to left.

    Returns:
        The new number of pieces in `right` and `wall`.
    """
    stack[0, 0] = 3 * triangle + edge
    stack[0, 1] = triangles[triangle, edge]
    stack[0, 2] = triangles[triangle, edge + 1 if edge < 2 else 0]
    waiting = 1
    while waiting > 0:
        waiting -= 1
        # The cone of sight between two vertices, as far as the edge `seen` of triangle `here`.
        seen = int(stack[waiting, 0])
        cone_right, cone_left = stack[waiting, 1], stack[waiting, 2]
        here = seen // 3
        beyond = int(neighbors[here, seen - 3 * here])
        rx, ry = vertices[cone_right, 0] - x, vertices[cone_right, 1] - y
        lx, ly = vertices[cone_left, 0] - x, vertices[cone_left, 1] - y
        while beyond != WALL:
            entry = entry_edge(neighbors, beyond, here)
            right_edge = entry + 1 if entry < 2 else 0
            left_edge = entry - 1 if entry > 0 else 2
            apex = triangles[beyond, left_edge]
            ox, oy = vertices[apex, 0] - x, vertices[apex, 1] - y
            here = beyond
            if rx * oy - ry * ox <= 0:
                following = left_edge
            else:
                following = right_edge
                if lx * oy - ly * ox < 0:
                    stack[waiting, 0] = 3 * here + left_edge
                    stack[waiting, 1], stack[waiting, 2] = apex, cone_left
                    waiting += 1
                    cone_left, lx, ly = apex, ox, oy
            seen = 3 * here + following
            beyond = int(neighbors[here, following])
        right[count], wall[count] = cone_right, seen
        count += 1
    return count


class Fans(NamedTuple):
    """The triangles around each vertex.

    Attributes:
        start: int32 (vertices + 1,), where the triangles of each vertex begin in `triangles`.
        triangles: int32, ascending for each vertex.
    """

    start: Int32
    triangles: Int32


@kernel
def build_fans(mesh: Mesh) -> Fans:
    """List the triangles around each vertex."""
    vertex_count, corners = mesh.vertices.shape[0], mesh.triangles
    start = np.zeros(vertex_count + 1, np.int32)
    for triangle in range(corners.shape[0]):
        for k in range(3):
            start[corners[triangle, k] + 1] += 1
    for vertex in range(vertex_count):
        start[vertex + 1] += start[vertex]
    fans = np.empty(start[-1], np.int32)
    next_free = start[:-1].copy()
    for triangle in range(corners.shape[0]):
        for k in range(3):
            vertex = corners[triangle, k]
            fans[next_free[vertex]] = triangle
            next_free[vertex] += 1
    return Fans(start, fans)


@kernel
def vertices_seen_from_point(mesh: Mesh, x: int, y: int, triangle: int, seen: Int32) -> int:
    """Find the vertices that a straight way from a point leads to.

    Between the point and the vertex the way touches no wall and no other vertex. A point on a wall
    also sees the ends of that wall. A point at a vertex sees only that vertex.

    Args:
        mesh: Free space.
        x: The point, lattice units.
        y: The point, lattice units.
        triangle: A triangle that holds the point; -1 is allowed.
        seen: Out: int32 (vertices,), the vertices found, in no particular order, each once.

    Returns:
        The number of vertices.
    """
    vertices, triangles, neighbors = mesh.vertices, mesh.triangles, mesh.neighbors
    if triangle == OUTSIDE:
        return 0
    for k in range(3):
        vertex = triangles[triangle, k]
        if vertices[vertex, 0] == x and vertices[vertex, 1] == y:
            seen[0] = vertex
            return 1
    wall, stack = scratch_for(vertices)
    count = 0
    for k in range(3):
        a, b = triangles[triangle, k], triangles[triangle, k + 1 if k < 2 else 0]
        ax, ay = vertices[a, 0], vertices[a, 1]
        on_edge = orient(ax, ay, vertices[b, 0], vertices[b, 1], x, y) == 0
        if on_edge and neighbors[triangle, k] == WALL:
            seen[count] = a
            count += 1
        else:
            count = look_through(
                vertices, triangles, neighbors, x, y, triangle, k, seen, wall, count, stack
            )
    return count


@kernel
def vertices_seen_from_vertex(mesh: Mesh, fans: Fans, vertex: int, seen: Int32) -> int:
    """Find the vertices that a straight way from a vertex leads to.

    Between the two the way touches no wall and no other vertex, or it runs along one wall.

    Args:
        mesh: Free space.
        fans: From :func:`build_fans`.
        vertex: The vertex to start from.
        seen: Out: int32 (vertices,), the vertices found, in no particular order, each once.

    Returns:
        The number of vertices.
    """
    vertices, triangles, neighbors = mesh.vertices, mesh.triangles, mesh.neighbors
    x, y = vertices[vertex, 0], vertices[vertex, 1]
    wall, stack = scratch_for(vertices)
    count = 0
    for i in range(fans.start[vertex], fans.start[vertex + 1]):
        triangle = int(fans.triangles[i])
        corner = 0
        while triangles[triangle, corner] != vertex:
            corner += 1
        opposite = corner + 1 if corner < 2 else 0
        count = look_through(
            vertices, triangles, neighbors, x, y, triangle, opposite, seen, wall, count, stack
        )
        last = corner - 1 if corner > 0 else 2
        if neighbors[triangle, last] == WALL:
            seen[count] = triangles[triangle, last]
            count += 1
    return count
