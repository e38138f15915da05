"""Shapes that touch or cross themselves, made valid in a bounded time."""

from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from fleet2d.bounds import CROSSINGS
from fleet2d.errors import FloorPlanError

# Edges that are looked up at once: each may cross all others.
_EDGES = 64


def repair(shape: BaseGeometry) -> BaseGeometry:
    """Return the area that an invalid shape encloses: all that its outlines go round is inside.

    Raises:
        FloorPlanError: It crosses itself too often; repairing would take too long.

    Example:
        >>> bow = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
        >>> repair(bow).area
        2.0
    """
    _check_crossings(shape)
    return shapely.make_valid(shape, method="structure", keep_collapsed=False)


def _check_crossings(shape: BaseGeometry) -> None:
    outlines = shapely.get_rings(shapely.get_parts(shape))
    corners = [shapely.get_coordinates(outline) for outline in outlines]
    ends = [np.stack([c[:-1], c[1:]], axis=1) for c in corners]
    edges: Any = shapely.linestrings(np.concatenate(ends)) if ends else np.empty(0, object)
    tree, count = shapely.STRtree(edges), 0
    for begin in range(0, len(edges), _EDGES):
        pairs = tree.query(edges[begin : begin + _EDGES], predicate="crosses")
        count += pairs.shape[1] // 2  # each crossing is found from both edges
        CROSSINGS.check(count, "it", FloorPlanError, least="at least ")
