"""The region visible from a point.

A region is a list of pieces, counter-clockwise, each a triangle between the eye and a wall. A piece
is stored as two numbers: the vertex that its right border runs through, and the wall edge that it
ends at (``3 * triangle + k``). The piece's left border is the right border of the next piece, so
every direction belongs to exactly one piece. Coordinates appear only when a region is measured or
drawn.

The method is triangular expansion (Bungiu, Hemmer et al. 2014, arXiv 1403.3905): see
``src/core/region.hpp``.
"""

from fleet2d._core import (
    region_contains,
    region_contains_points,
    region_outline,
    regions_of_cells,
    visible_region,
)

__all__ = [
    "region_contains",
    "region_contains_points",
    "region_outline",
    "regions_of_cells",
    "visible_region",
]
