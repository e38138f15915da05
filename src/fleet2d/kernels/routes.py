"""Shortest paths among walls: A* over the corners that a taut string can touch.

A shortest path in a polygonal space bends only at its reflex corners (Lozano-Pérez and Wesley,
Communications of the ACM 22, 1979). The space is the free space shrunk by a body's radius, so a
path may touch its border. Which corners see each other is decided in integers; lengths are the only
floats (sums of correctly rounded square roots, the same on every machine).
"""

from typing import NamedTuple

from fleet2d._core import Routes, distance
from fleet2d.kernels import I64, Bool

__all__ = ["Corners", "Routes", "distance"]


class Corners(NamedTuple):
    """The reflex corners of a space: the nodes of its route graph."""

    vertex: I64  # (nodes,) the vertex of the mesh at each, ascending
    before: I64  # (nodes, 2) the vertex of the border before the corner [lattice]
    after: I64  # (nodes, 2) and the one after it
    simple: Bool  # (nodes,) False where several walls meet: no one before and after
