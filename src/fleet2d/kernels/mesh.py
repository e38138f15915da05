"""The mesh of free space: triangles between walls, and which of them holds a point.

A mesh is a triangulation of the free space whose vertices are all wall vertices. Everything that
sight and paths need follows from it by integer arithmetic. Which of the many possible
triangulations it is never shows in a result.

Constants:
    SUB: Lattice units per cell.
    CELL_CENTRE: Offset of a cell's centre from its corner: odd, so that no axis-parallel wall runs
        through it.
    BUCKET: Side of the square buckets that find the triangle of a point, in lattice units.
    WALL: The neighbor across an edge that is a wall.
"""

from fleet2d._core import (
    BUCKET,
    CELL_CENTRE,
    SUB,
    WALL,
    Mesh,
    contains_triangle,
    label_triangles,
    locate,
    orient,
    rasterize_cells,
    strictly_inside,
)

__all__ = [
    "BUCKET",
    "CELL_CENTRE",
    "SUB",
    "WALL",
    "Mesh",
    "contains_triangle",
    "label_triangles",
    "locate",
    "orient",
    "rasterize_cells",
    "strictly_inside",
]
