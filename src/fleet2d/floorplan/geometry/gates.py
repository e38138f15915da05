"""Gates in a mesh: segments from wall to wall that can be shut and opened."""

from collections.abc import Collection, Sequence

import numpy as np

from fleet2d.errors import FloorPlanError
from fleet2d.kernels import I64
from fleet2d.kernels.space import WALL, Mesh

Segment = tuple[tuple[int, int], tuple[int, int]]


class Gates:
    """A mesh in which some segments are edges, so that shutting one changes only two numbers.

    The triangles on both sides of a shut gate are not neighbors: every kernel sees a wall without
    thickness.

    Attributes:
        mesh: The mesh with all gates open.

    Example:
        >>> import shapely
        >>> from fleet2d.floorplan.geometry.mesh import build_mesh
        >>> gate = ((320, 0), (320, 640))
        >>> mesh = build_mesh([shapely.box(0, 0, 640, 640)], 10, 10, corners=gate)
        >>> gates = Gates(mesh, [gate])
        >>> from fleet2d.kernels.space import locate
        >>> from fleet2d.kernels.sight import line_of_sight
        >>> for walls in (gates.mesh, gates.shut({0})):
        ...     line_of_sight(walls, 11, 11, locate(walls, 11, 11), 631, 11)
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
        self.mesh, self._sides = _with_edges(mesh, segments)

    def shut(self, gates: Collection[int]) -> Mesh:
        """Return the mesh with these gates shut, by their number."""
        if not gates:
            return self.mesh
        neighbors = self.mesh.neighbors.copy()
        for gate in gates:
            for triangle, edge in self._sides[gate]:
                neighbors[triangle, edge] = WALL
        return self.mesh.with_neighbors(neighbors)


def _with_edges(
    mesh: Mesh, segments: Sequence[Segment]
) -> tuple[Mesh, list[tuple[tuple[int, int], ...]]]:
    """Return the mesh with the segments as edges, and both sides of each: (triangle, edge)."""
    vertices = mesh.vertices
    corners = [tuple(triangle) for triangle in mesh.triangles.tolist()]
    owner = {(t[k], t[(k + 1) % 3]): i for i, t in enumerate(corners) for k in range(3)}
    ends = [(_vertex(vertices, a), _vertex(vertices, b)) for a, b in segments]
    for a, b in ends:
        _force_edge(vertices, corners, owner, a, b)
    triangles = np.array(corners, np.int32)
    neighbors = np.array(
        [[owner.get((t[(k + 1) % 3], t[k]), WALL) for k in range(3)] for t in corners], np.int32
    )
    sides = [
        tuple((owner[edge], corners[owner[edge]].index(edge[0])) for edge in ((a, b), (b, a)))
        for a, b in ends
    ]
    return Mesh(vertices, triangles, neighbors), sides


def _force_edge(
    vertices: I64, corners: list[tuple[int, ...]], owner: dict[tuple[int, int], int], a: int, b: int
) -> None:
    """Flip the edges that cross a segment until it is an edge itself (Sloan 1993)."""
    if (a, b) in owner and (b, a) in owner:
        return
    crossing = _crossing(vertices, owner, a, b)
    attempts = 16 * (len(crossing) + 1) ** 2
    while crossing:
        attempts -= 1
        p, q = crossing.pop(0)
        left, right = owner[p, q], owner[q, p]
        c, d = (next(v for v in corners[t] if v not in (p, q)) for t in (left, right))
        if attempts == 0:
            break
        if _turn(vertices, d, c, q) * _turn(vertices, d, c, p) >= 0:
            crossing.append((p, q))  # the quadrilateral is not convex yet
            continue
        corners[left], corners[right] = (p, d, c), (d, q, c)
        del owner[p, q], owner[q, p]
        for t in (left, right):
            x, y, z = corners[t]
            owner[x, y] = owner[y, z] = owner[z, x] = t
        if {c, d} != {a, b} and _cross(vertices, a, b, c, d):
            crossing.append((c, d))
    if (a, b) not in owner or (b, a) not in owner:
        at = vertices[[a, b]].tolist()
        raise FloorPlanError(f"the door line {at} [lattice] does not cross free space alone")


def _crossing(
    vertices: I64, owner: dict[tuple[int, int], int], a: int, b: int
) -> list[tuple[int, int]]:
    """Return the inner edges that cross a segment, each once."""
    edges = np.array([edge for edge in owner if edge[0] < edge[1] and edge[::-1] in owner])
    if len(edges) == 0:
        return []
    start, along = vertices[a], vertices[b] - vertices[a]
    side = along[0] * (vertices[:, 1] - start[1]) - along[1] * (vertices[:, 0] - start[0])
    apart = edges[np.sign(side[edges[:, 0]]) * np.sign(side[edges[:, 1]]) < 0]
    return [(p, q) for p, q in apart.tolist() if _cross(vertices, a, b, p, q)]


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
    matches = np.flatnonzero((vertices == np.array(point, np.int64)).all(axis=1))
    if len(matches) == 0:
        raise FloorPlanError(f"the door line ends at {point} [lattice], where no wall is")
    return int(matches[0])
