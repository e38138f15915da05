"""Rooms of a plan without labels, found from its walls alone.

The method is Voronoi segmentation (Thrun, "Learning metric-topological maps for indoor mobile
robot navigation", Artificial Intelligence 99, 1998), one of the four that Bormann, Jordan, Li,
Hampp and Hägele compare in "Room Segmentation: Survey, Implementation, and Analysis" (ICRA 2016):
cut the free space at the critical lines, where its clearance has a local minimum, and join what is
too small to be a room. The lines are those of `find_passages`.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fleet2d.floorplan.rooms.chambers import Chambers

MIN_ROOM_M2 = 1.2
"""What a doorway parts is a room from this size on: a toilet."""
MIN_OPEN_ROOM_M2 = 4.0
"""What only an opening parts is a room from this size on: smaller is an alcove."""


def segment_rooms(chambers: Chambers, wide: Sequence[bool], cell: float) -> NDArray[np.int64]:
    """Join chambers into rooms.

    Args:
        chambers: The free space, cut at doorways and openings.
        wide: Whether each line that the chambers were cut at is an opening, and no doorway.
        cell: Side of a cell [m].

    Returns:
        The room of each cell, by decreasing size; -1 where not free. int64 (rows, columns).
    """
    sizes = np.bincount(chambers.of_cell[chambers.of_cell >= 0], minlength=chambers.count)
    areas = sizes * cell**2
    owner = np.arange(chambers.count)
    while True:
        ways = [
            (areas[owner[one]], not wide[link.line], link.line, owner[one], owner[other])
            for link in chambers.links
            for one, other in (link.chambers, link.chambers[::-1])
            if owner[one] != owner[other]
            and areas[owner[one]] < (MIN_OPEN_ROOM_M2 if wide[link.line] else MIN_ROOM_M2)
        ]
        if not ways:
            break
        # The smallest goes first, across an opening rather than a doorway.
        *_, small, into = min(ways)
        areas[into] += areas[small]
        owner[owner == small] = into
    roots = sorted(set(owner.tolist()), key=lambda root: (-areas[root], root))
    number = np.full(chambers.count + 1, -1, np.int64)  # its last entry serves -1
    number[:-1] = [roots.index(root) for root in owner.tolist()]
    rooms: NDArray[np.int64] = number[chambers.of_cell]
    return rooms
