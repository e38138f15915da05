"""Rooms of a plan without labels, segmented by its walls alone.

The method is Voronoi segmentation (Thrun, "Learning metric-topological maps for indoor mobile
robot navigation", Artificial Intelligence 99, 1998), one of the four that Bormann, Jordan, Li,
Hampp and Hägele compare in "Room Segmentation: Survey, Implementation, and Analysis" (ICRA 2016):
cut the free space at the critical lines, where its clearance has a local minimum, and join what is
too small to be a room. The lines are those of `find_passages`.
"""

from collections.abc import Sequence

import numpy as np

from fleet2d.floorplan.rooms.chambers import Chambers
from fleet2d.kernels import I64

MIN_ROOM_M2 = 1.2
"""Least area of a room behind a doorway, such as a toilet."""
MIN_OPEN_ROOM_M2 = 4.0
"""Least area of a room behind an opening; a smaller space is an alcove."""


def segment_rooms(chambers: Chambers, is_opening: Sequence[bool], cell: float) -> I64:
    """Join chambers into rooms.

    Args:
        chambers: The free space, cut at doorways and openings.
        is_opening: Whether each line at which the chambers were cut is an opening, not a doorway.
        cell: Side of a cell [m].

    Returns:
        The room of each cell, by decreasing size; -1 where not free. int64 (rows, columns).
    """
    sizes = np.bincount(chambers.of_cell[chambers.of_cell >= 0], minlength=chambers.count)
    areas = sizes * cell**2
    owner = np.arange(chambers.count)
    while True:
        candidates = [
            (areas[owner[one]], not is_opening[link.line], link.line, owner[one], owner[other])
            for link in chambers.links
            for one, other in (link.chambers, link.chambers[::-1])
            if owner[one] != owner[other]
            and areas[owner[one]] < (MIN_OPEN_ROOM_M2 if is_opening[link.line] else MIN_ROOM_M2)
        ]
        if not candidates:
            break
        # The smallest goes first, across an opening rather than a doorway.
        *_, smallest, into = min(candidates)
        areas[into] += areas[smallest]
        owner[owner == smallest] = into
    roots = sorted(set(owner.tolist()), key=lambda root: (-areas[root], root))
    number = np.full(chambers.count + 1, -1, np.int64)  # its last entry serves -1
    number[:-1] = [roots.index(root) for root in owner.tolist()]
    return number[chambers.of_cell]
