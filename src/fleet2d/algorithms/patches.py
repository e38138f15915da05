"""Patches: rooms cut into parts, each mostly in view as a whole or not at all."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.observations import NOWHERE
from fleet2d.floorplan.kept import read_only

if TYPE_CHECKING:
    from fleet2d.floorplan.plan import FloorPlan

# Patches are about so long and wide [m], and a room has about so many at most: larger ones then.
SIDE = 1.0
MOST = 12


@dataclass(frozen=True)
class Patches:
    """The rooms of a floor plan, cut into patches.

    Attributes:
        of_cell: int16 (rows, columns), the patch of each cell, NOWHERE where there is no room.
        room: int64 (patches,), the room of each, in ascending order; each room has one at least.
        cells: int64 (patches,), how many cells each has.
    """

    of_cell: NDArray[np.int16]
    room: NDArray[np.int64]
    cells: NDArray[np.int64]

    @cached_property
    def first(self) -> NDArray[np.int64]:
        """The first patch of each room: int64 (rooms,)."""
        return read_only(np.flatnonzero(np.diff(self.room, prepend=-1)))

    @cached_property
    def room_cells(self) -> NDArray[np.int64]:
        """How many cells each room has, 1 at least: int64 (rooms,)."""
        cells: NDArray[np.int64] = np.maximum(np.add.reduceat(self.cells, self.first), 1)
        return read_only(cells)


def whole_rooms(plan: "FloorPlan") -> Patches:
    """Return the rooms as they are, each a patch."""
    rooms, count = plan.room_of_cell, len(plan.rooms)
    cells = np.bincount(rooms[rooms != NOWHERE], minlength=count)
    return Patches(rooms, read_only(np.arange(count)), read_only(cells))


def patches_of(plan: "FloorPlan") -> Patches:
    """Cut each room into boxes of cells: its own box by equal parts along both sides.

    Example:
        >>> import fleet2d
        >>> plan = fleet2d.load_floorplan()
        >>> patches = patches_of(plan)
        >>> len(plan.rooms), len(patches.room), round(float(plan.rooms[2].area_m2))
        (14, 122, 40)
        >>> living = patches.room == 2
        >>> int(living.sum()), bool(patches.cells[living].sum() == plan.rooms[2].cells)
        (12, True)
    """
    rooms, count = plan.room_of_cell, len(plan.rooms)
    row, column = np.nonzero(rooms != NOWHERE)
    room = rooms[row, column].astype(np.int64)
    total = np.bincount(room, minlength=count)
    side = np.maximum(SIDE / plan.lattice.cell, np.sqrt(np.ceil(total / MOST)))
    along, parts_along = _cut(row, room, side, count)
    across, parts_across = _cut(column, room, side, count)
    boxes = parts_along * parts_across
    first = np.cumsum(boxes) - boxes
    box = first[room] + along * parts_across[room] + across
    cells = np.bincount(box, minlength=int(boxes.sum()))
    kept = cells > 0
    kept[first[total == 0]] = True
    number = np.cumsum(kept) - 1
    of_cell = np.full(rooms.shape, NOWHERE, np.int16)
    of_cell[row, column] = number[box]
    room = np.repeat(np.arange(count), boxes)[kept]
    return Patches(read_only(of_cell), read_only(room), read_only(cells[kept]))


def _cut(
    place: NDArray[np.int64], room: NDArray[np.int64], side: NDArray[np.float64], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return which part of its room's extent each cell is in, and into how many that is cut."""
    low, high = np.full(count, np.iinfo(np.int64).max), np.full(count, -1)
    np.minimum.at(low, room, place)
    np.maximum.at(high, room, place)
    extent = np.maximum(high - low + 1, 1)
    parts = np.maximum(1, np.rint(extent / side)).astype(np.int64)
    found: NDArray[np.int64] = (place - low[room]) * parts[room] // extent[room]
    return found, parts
