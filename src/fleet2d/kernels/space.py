"""The space between walls: its mesh, shortest paths, and grids and masks of its cells.

A mesh is a triangulation of the free space whose vertices are all wall vertices. Everything that
sight and paths need follows from it by integer arithmetic. Which of the many possible
triangulations it is never shows in a result.

A shortest path in a polygonal space bends only at its reflex corners (Lozano-Pérez and Wesley,
Communications of the ACM 22, 1979): `Routes` is A* over the corners that a taut string can touch.
The space is the free space shrunk by a body's radius, so a path may touch its border. Which corners
see each other is decided in integers; lengths are the only floats (sums of correctly rounded square
roots, the same on every machine).

Pixels outside a mask count as not in the mask.

Constants:
    SUB: Lattice units per cell.
    CELL_CENTRE: Offset of a cell's centre from its corner: odd, so that no axis-parallel wall runs
        through it.
    BUCKET: Side of the square buckets that find the triangle of a point, in lattice units.
    WALL: The neighbor across an edge that is a wall.
"""

from typing import NamedTuple

# Names that are imported as themselves are part of this module.
# isort: off
from fleet2d._core import (
    CELL_CENTRE as CELL_CENTRE,
    cost_distance as cost_distance,
    count_steps as count_steps,
    descend as descend,
    fill_from_neighbors as fill_from_neighbors,
    label_frames as label_frames,
    label_parts as label_parts,
    label_triangles as label_triangles,
    locate as locate,
    Mesh as Mesh,
    MAX_COST as MAX_COST,
    pairs_in_sight as pairs_in_sight,
    pull_taut as pull_taut,
    rasterize_cells as rasterize_cells,
    Routes as Routes,
    spread_labels as spread_labels,
    squared_distance as squared_distance,
    strictly_inside as strictly_inside,
    SUB as SUB,
    trace_rings as trace_rings,
    walking_distance as walking_distance,
    WALL as WALL,
)
# isort: on

from fleet2d.kernels import I64, Bool


class Corners(NamedTuple):
    """The reflex corners of a space: the nodes of its route graph."""

    vertex: I64  # (nodes,) the vertex of the mesh at each, ascending
    before: I64  # (nodes, 2) the vertex of the border before the corner [lattice]
    after: I64  # (nodes, 2) and the one after it
    simple: Bool  # (nodes,) False where several walls meet: no one before and after
