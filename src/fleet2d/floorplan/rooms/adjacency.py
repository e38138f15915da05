"""Which rooms one can walk to from a room: through doorways, and across borders without a wall."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.rooms.doorways import Doorway, Segment

_CENTRE = UNITS_PER_CELL // 2 + 1

# A shorter border without a wall, in cells, is where two walls' cells happen to touch.
MIN_SIDES = 2


@dataclass(frozen=True)
class RoomLink:
    """A way between two rooms.

    Attributes:
        rooms: Their indices, the lower first.
        kind: `doorway`, or `open` where they meet without a wall between them.
        width_m: Width of the doorway, or length of the open border along the longer axis [m].
        doorway: Index of the doorway, None for an open border.
    """

    rooms: tuple[int, int]
    kind: Literal["doorway", "open"]
    width_m: float
    doorway: int | None = None


def room_links(
    lattice: Lattice, room_of_cell: NDArray[np.int16], doorways: Sequence[Doorway]
) -> tuple[RoomLink, ...]:
    """Return the ways between rooms: doorways by index, then open borders by rooms."""
    doors = [
        RoomLink((min(d.rooms), max(d.rooms)), "doorway", d.width_m, d.index)
        for d in doorways
        if d.rooms[0] != d.rooms[1]
    ]
    segments = doorway_segments(lattice, doorways)
    return (*doors, *open_borders(lattice, room_of_cell, segments))


def doorway_segments(lattice: Lattice, doorways: Sequence[Doorway]) -> list[Segment]:
    """Return where doorways are [lattice]."""
    found = []
    for doorway in doorways:
        (x0, y0), (x1, y1) = lattice.to_lattice((doorway.start, doorway.end)).tolist()
        found.append(((x0, y0), (x1, y1)))
    return found


def open_borders(
    lattice: Lattice, room_of_cell: NDArray[np.int16], passages: Sequence[Segment]
) -> tuple[RoomLink, ...]:
    """Return where rooms meet without a wall, other than in a passage.

    Args:
        lattice: Of the plan.
        room_of_cell: Room index of each cell, -1 where not free.
        passages: Doorways [lattice]: cells on their two sides don't count.
    """
    counts: dict[tuple[int, int], list[int]] = {}
    for axis in (0, 1):
        cells, pairs = _border(room_of_cell, axis)
        step = np.array([axis == 1, axis == 0], np.int64) * UNITS_PER_CELL
        first = cells[:, ::-1] * UNITS_PER_CELL + _CENTRE
        across = np.zeros(len(cells), np.bool_)
        for passage in passages:
            across |= _crosses(first, step, passage)
        pairs = np.sort(pairs[~across], axis=1)
        found, sides = np.unique(pairs[:, 0] * 2**16 + pairs[:, 1], return_counts=True)
        for pair, number in zip(found.tolist(), sides.tolist(), strict=True):
            counts.setdefault(divmod(pair, 2**16), [0, 0])[axis] = number
    return tuple(
        RoomLink(rooms, "open", max(sides) * lattice.cell)
        for rooms, sides in sorted(counts.items())
        if max(sides) >= MIN_SIDES
    )


def _border(rooms: NDArray[np.int16], axis: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the (row, column) of cells whose next one has another room, and both rooms."""
    before, after = (rooms[:-1], rooms[1:]) if axis == 0 else (rooms[:, :-1], rooms[:, 1:])
    differ = (before != after) & (before >= 0) & (after >= 0)
    pairs = np.stack([before[differ], after[differ]], axis=1).astype(np.int64)
    return np.argwhere(differ), pairs


def _crosses(
    first: NDArray[np.int64], step: NDArray[np.int64], passage: Segment
) -> NDArray[np.bool_]:
    """Return which steps from cell centres meet a passage."""
    start = np.array(passage[0])
    along = np.array(passage[1]) - start

    def side(
        of: NDArray[np.int64], way: NDArray[np.int64], point: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        gap = point - of
        turn: NDArray[np.int64] = np.sign(way[..., 0] * gap[..., 1] - way[..., 1] * gap[..., 0])
        return turn

    parted = side(start, along, first) * side(start, along, first + step) <= 0
    between = side(first, step, start) * side(first, step, start + along) <= 0
    both: NDArray[np.bool_] = parted & between
    return both
