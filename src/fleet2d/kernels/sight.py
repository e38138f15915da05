"""Sight lines, by the strict rule: a sight line touches no wall, not even a corner.

All of it is integer arithmetic on the mesh of free space, so verdicts are exact and symmetric, and
they don't depend on how the free space is cut into triangles.
"""

from fleet2d._core import (
    build_fans,
    line_of_sight,
    vertices_seen_from_point,
    vertices_seen_from_vertex,
)

__all__ = ["build_fans", "line_of_sight", "vertices_seen_from_point", "vertices_seen_from_vertex"]
