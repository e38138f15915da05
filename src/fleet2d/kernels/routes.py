"""Shortest paths among walls: A* over the corners that a taut string can touch.

A shortest path in a polygonal space bends only at its reflex corners (Lozano-Pérez and Wesley,
Communications of the ACM 22, 1979). The space is the free space shrunk by a body's radius, so a
path may touch its border. Which corners see each other is decided in integers; lengths are the only
floats (sums of correctly rounded square roots, the same on every machine).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.mesh import Mesh, locate, orient
from fleet2d.kernels.sight import (
    Fans,
    build_fans,
    line_of_sight,
    vertices_seen_from_point,
    vertices_seen_from_vertex,
)

I64 = NDArray[np.int64]
I32 = NDArray[np.int32]


class Corners(NamedTuple):
    """The reflex corners of a space: the nodes of its route graph.

    A vertex where several walls meet is a node without known neighbours (`simple` is 0).
    """

    node_of_vertex: I32  # (vertices,), -1 = no corner
    vertex: I64  # (nodes,) as wide as ids are elsewhere, or kernels compile twice
    before: I64  # (nodes, 2) the border vertex before the corner [lattice]
    after: I64  # (nodes, 2) and the one after it
    simple: NDArray[np.uint8]  # (nodes,)


class RouteGraph(NamedTuple):
    """Corners and the straight legs between them, as compressed rows."""

    corners: Corners
    start: I32  # (nodes + 1,)
    node: I32  # (legs,)
    length: NDArray[np.float64]  # (legs,) [lattice units]


@kernel
def distance(ax: int, ay: int, bx: int, by: int) -> float:
    """Return the distance of two lattice points."""
    dx, dy = bx - ax, by - ay
    return float(np.sqrt(np.float64(dx * dx + dy * dy)))


@kernel
def is_taut(mesh: Mesh, corners: Corners, node: int, x: int, y: int) -> bool:
    """Tell whether a string from (x, y) can bend round the corner `node`."""
    if not corners.simple[node]:
        return True
    v = int(corners.vertex[node])
    vx, vy = mesh.vertices[v, 0], mesh.vertices[v, 1]
    before = orient(x, y, vx, vy, corners.before[node, 0], corners.before[node, 1])
    after = orient(x, y, vx, vy, corners.after[node, 0], corners.after[node, 1])
    return not ((before > 0 and after < 0) or (before < 0 and after > 0))


@kernel
def legs_of_corner(mesh: Mesh, fans: Fans, corners: Corners, node: int, seen: I32) -> int:
    """Write the nodes that one taut leg connects with `node` to `seen`; return their number."""
    v = int(corners.vertex[node])
    legs = 0
    for i in range(vertices_seen_from_vertex(mesh, fans, v, seen)):
        other = int(corners.node_of_vertex[seen[i]])
        if other < 0:
            continue
        w = int(corners.vertex[other])
        if not is_taut(mesh, corners, other, mesh.vertices[v, 0], mesh.vertices[v, 1]):
            continue
        if is_taut(mesh, corners, node, mesh.vertices[w, 0], mesh.vertices[w, 1]):
            seen[legs] = other
            legs += 1
    return legs


@kernel
def build_route_graph(mesh: Mesh, corners: Corners) -> RouteGraph:
    """Connect all corners of a space that see each other along a taut leg."""
    nodes = corners.vertex.shape[0]
    fans = build_fans(mesh)
    seen = np.empty(mesh.vertices.shape[0] + 4, np.int32)
    start = np.zeros(nodes + 1, np.int32)
    for node in range(nodes):
        start[node + 1] = start[node] + legs_of_corner(mesh, fans, corners, node, seen)
    target = np.empty(start[nodes], np.int32)
    length = np.empty(start[nodes], np.float64)
    for node in range(nodes):
        v = int(corners.vertex[node])
        legs = legs_of_corner(mesh, fans, corners, node, seen)
        others = np.sort(seen[:legs])
        for i in range(legs):
            w = int(corners.vertex[others[i]])
            target[start[node] + i] = others[i]
            length[start[node] + i] = distance(
                mesh.vertices[v, 0], mesh.vertices[v, 1], mesh.vertices[w, 0], mesh.vertices[w, 1]
            )
    return RouteGraph(corners, start, target, length)


@kernel
def corners_seen(mesh: Mesh, corners: Corners, x: int, y: int, triangle: int, seen: I32) -> int:
    """Write the corners that a taut string from (x, y) can reach to `seen`; return their number."""
    count = 0
    for i in range(vertices_seen_from_point(mesh, x, y, triangle, seen)):
        node = int(corners.node_of_vertex[seen[i]])
        if node >= 0 and is_taut(mesh, corners, node, x, y):
            seen[count] = node
            count += 1
    return count


@kernel
def find_route(mesh: Mesh, graph: RouteGraph, ax: int, ay: int, bx: int, by: int, out: I64) -> int:
    """Write the shortest path from (ax, ay) to (bx, by) to `out` (nodes + 2, 2).

    Both ends are strictly inside the space: a goal on its border is not seen by the last corner.
    Returns the number of its points, or 0 when there is no way or an end lies outside the space.
    Ties go to the lower node id: ids are sorted by position, so the path depends on the walls only.
    """
    at_a, at_b = locate(mesh, ax, ay), locate(mesh, bx, by)
    if at_a < 0 or at_b < 0:
        return 0
    out[0, 0], out[0, 1] = ax, ay
    if (ax == bx and ay == by) or line_of_sight(mesh, ax, ay, at_a, bx, by):
        out[1, 0], out[1, 1] = bx, by
        return 2
    corners, vertices = graph.corners, mesh.vertices
    nodes = corners.vertex.shape[0]
    seen = np.empty(vertices.shape[0] + 4, np.int32)
    to_goal = np.full(nodes, -1.0)  # length of the last leg, for corners that see the goal
    for i in range(corners_seen(mesh, corners, bx, by, at_b, seen)):
        v = int(corners.vertex[seen[i]])
        to_goal[seen[i]] = distance(vertices[v, 0], vertices[v, 1], bx, by)
    travelled = np.full(nodes, np.inf)
    bound = np.full(nodes, np.inf)  # travelled + straight line to the goal, inf = not open
    before = np.full(nodes, -1, np.int32)
    for i in range(corners_seen(mesh, corners, ax, ay, at_a, seen)):
        v = int(corners.vertex[seen[i]])
        travelled[seen[i]] = distance(ax, ay, vertices[v, 0], vertices[v, 1])
        bound[seen[i]] = travelled[seen[i]] + distance(vertices[v, 0], vertices[v, 1], bx, by)
    best, last = search_corners(mesh, graph, to_goal, travelled, bound, before, bx, by)
    if best == np.inf:
        return 0
    return unwind(mesh, corners, before, last, bx, by, out)


@kernel
def search_corners(
    mesh: Mesh,
    graph: RouteGraph,
    to_goal: NDArray[np.float64],
    travelled: NDArray[np.float64],
    bound: NDArray[np.float64],
    before: I32,
    bx: int,
    by: int,
) -> tuple[float, int]:
    """Run A* from the open corners; return the path's length (inf = none) and its last corner.

    The open corner is found by a scan: a home opens a few dozen, where a heap gains nothing.
    """
    vertices, vertex = mesh.vertices, graph.corners.vertex
    best, last = np.inf, -1
    while True:
        node = int(np.argmin(bound)) if bound.shape[0] > 0 else -1
        if node < 0 or not bound[node] < best:
            return best, last
        bound[node] = np.inf
        if to_goal[node] >= 0 and travelled[node] + to_goal[node] < best:
            best, last = travelled[node] + to_goal[node], node
        for k in range(graph.start[node], graph.start[node + 1]):
            other = graph.node[k]
            length = travelled[node] + graph.length[k]
            if length < travelled[other]:
                v = int(vertex[other])
                travelled[other] = length
                before[other] = node
                bound[other] = length + distance(vertices[v, 0], vertices[v, 1], bx, by)


@kernel
def unwind(mesh: Mesh, corners: Corners, before: I32, last: int, bx: int, by: int, out: I64) -> int:
    """Write the corners up to `last` and the goal behind out[0]; return the number of points."""
    count = 1
    node = last
    while node >= 0:
        count += 1
        node = before[node]
    out[count, 0], out[count, 1] = bx, by
    node = last
    for i in range(count - 1, 0, -1):
        v = int(corners.vertex[node])
        out[i, 0], out[i, 1] = mesh.vertices[v, 0], mesh.vertices[v, 1]
        node = before[node]
    return count + 1
