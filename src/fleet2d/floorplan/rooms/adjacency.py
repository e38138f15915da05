"""Links between rooms: doorways, and borders without a wall."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fleet2d.floorplan.geometry.gates import Segment
from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.rooms.doorways import Doorway
from fleet2d.kernels import I16, I64, Bool

_CENTRE = UNITS_PER_CELL // 2 + 1

# Least length of an open border [cells]; a shorter one is an artifact of the cells at walls.
MIN_SIDES = 2


@dataclass(frozen=True)
class RoomLink:
    """A link between two rooms.

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
    lattice: Lattice, room_of_cell: I16, doorways: Sequence[Doorway]
) -> tuple[RoomLink, ...]:
    """Return the links between rooms: doorways by index, then open borders by rooms."""
    doors = [
        RoomLink((min(d.rooms), max(d.rooms)), "doorway", d.width_m, d.index)
        for d in doorways
        if d.rooms[0] != d.rooms[1]
    ]
    segments = doorway_segments(lattice, doorways)
    return (*doors, *open_borders(lattice, room_of_cell, segments))


def doorway_segments(lattice: Lattice, doorways: Sequence[Doorway]) -> list[Segment]:
    """Return the doorways as segments [lattice]."""
    segments = []
    for doorway in doorways:
        (x0, y0), (x1, y1) = lattice.to_lattice((doorway.start, doorway.end)).tolist()
        segments.append(((x0, y0), (x1, y1)))
    return segments


def open_borders(
    lattice: Lattice, room_of_cell: I16, passages: Sequence[Segment]
) -> tuple[RoomLink, ...]:
    """Return the borders of rooms without a wall, except in passages.

    Args:
        lattice: Of the plan.
        room_of_cell: Room index of each cell, -1 where not free.
        passages: Doorways [lattice]; borders across them don't count.
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
        keys, sides = np.unique(pairs[:, 0] * 2**16 + pairs[:, 1], return_counts=True)
        for pair, number in zip(keys.tolist(), sides.tolist(), strict=True):
            counts.setdefault(divmod(pair, 2**16), [0, 0])[axis] = number
    return tuple(
        RoomLink(rooms, "open", max(sides) * lattice.cell)
        for rooms, sides in sorted(counts.items())
        if max(sides) >= MIN_SIDES
    )


def _border(rooms: I16, axis: int) -> tuple[I64, I64]:
    """Return the (row, column) of cells whose successor has another room, and both rooms."""
    before, after = (rooms[:-1], rooms[1:]) if axis == 0 else (rooms[:, :-1], rooms[:, 1:])
    differ = (before != after) & (before >= 0) & (after >= 0)
    pairs = np.stack([before[differ], after[differ]], axis=1).astype(np.int64)
    return np.argwhere(differ), pairs


def _crosses(first: I64, step: I64, passage: Segment) -> Bool:
    """Return which steps from cell centres meet a passage."""
    start = np.array(passage[0])
    along = np.array(passage[1]) - start

    def side(origin: I64, direction: I64, point: I64) -> I64:
        gap = point - origin
        return np.sign(direction[..., 0] * gap[..., 1] - direction[..., 1] * gap[..., 0])

    meets_line = side(start, along, first) * side(start, along, first + step) <= 0
    meets_segment = side(first, step, start) * side(first, step, start + along) <= 0
    return meets_line & meets_segment
