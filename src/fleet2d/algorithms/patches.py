"""Patches: rooms divided into parts, each mostly in view as a whole or not at all."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fleet2d.algorithms.observations import NOWHERE
from fleet2d.floorplan.cache import read_only
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I16, I64
from fleet2d.kernels.space import label_triangles, rasterize_cells

# Side of a patch [m], approximately; larger where a room would have more than about MOST_PATCHES.
SIDE_M = 1.0
MOST_PATCHES = 12


@dataclass(frozen=True)
class Patches:
    """The rooms of a floor plan, divided into patches.

    Attributes:
        of_cell: int16 (rows, columns), the patch of each cell; NOWHERE outside rooms.
        room: int64 (patches,), ascending, the room of each patch; each room has at least one.
        cells: int64 (patches,), number of cells of each patch.
        island: int64 (rooms,), which part of the free space holds each room, where nothing joins
            the parts; None: it is in one part.
    """

    of_cell: I16
    room: I64
    cells: I64
    island: I64 | None = None

    @cached_property
    def first(self) -> I64:
        """The first patch of each room: int64 (rooms,)."""
        return read_only(np.flatnonzero(np.diff(self.room, prepend=-1)))

    @cached_property
    def room_cells(self) -> I64:
        """Number of cells of each room, at least 1: int64 (rooms,)."""
        cells: I64 = np.maximum(np.add.reduceat(self.cells, self.first), 1)
        return read_only(cells)


def whole_rooms(plan: FloorPlan) -> Patches:
    """Return each room as one patch."""
    rooms, count = plan.room_of_cell, len(plan.rooms)
    cells = np.bincount(rooms[rooms != NOWHERE], minlength=count)
    return Patches(rooms, read_only(np.arange(count)), read_only(cells), islands(plan))


def patches_of(plan: FloorPlan) -> Patches:
    """Divide the bounding box of each room into equal boxes along both axes.

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
    side = np.maximum(SIDE_M / plan.lattice.cell, np.sqrt(np.ceil(total / MOST_PATCHES)))
    box_row, box_rows = _divide(row, room, side, count)
    box_column, box_columns = _divide(column, room, side, count)
    boxes = box_rows * box_columns
    first = np.cumsum(boxes) - boxes
    box = first[room] + box_row * box_columns[room] + box_column
    cells = np.bincount(box, minlength=int(boxes.sum()))
    is_patch = cells > 0
    is_patch[first[total == 0]] = True
    number = np.cumsum(is_patch) - 1
    of_cell = np.full(rooms.shape, NOWHERE, np.int16)
    of_cell[row, column] = number[box]
    room = np.repeat(np.arange(count), boxes)[is_patch]
    cells = read_only(cells[is_patch])
    return Patches(read_only(of_cell), read_only(room), cells, islands(plan))


def islands(plan: FloorPlan) -> I64 | None:
    """Return the part of the free space that holds each room: int64 (rooms,).

    Rooms with floor in the same part, and parts with floor in the same room, count as one. None if
    the free space is in one part.

    Example:
        >>> import fleet2d
        >>> print(islands(fleet2d.load_floorplan()))
        None
    """
    if len(plan.polygons) == 1:
        return None
    triangle = rasterize_cells(plan.mesh, plan.lattice.rows, plan.lattice.columns)
    part = np.where(triangle >= 0, label_triangles(plan.mesh.neighbors)[triangle], NOWHERE)
    is_floor = (plan.room_of_cell != NOWHERE) & (part != NOWHERE)
    pairs = np.unique(np.stack([plan.room_of_cell, part], axis=-1)[is_floor], axis=0)
    island = np.arange(len(plan.rooms))
    for number in np.unique(pairs[:, 1]):
        rooms = pairs[pairs[:, 1] == number, 0]
        island[np.isin(island, island[rooms])] = island[rooms].min()
    return read_only(island)


def _divide(place: I64, room: I64, side: F64, count: int) -> tuple[I64, I64]:
    """Divide the extent of each room along one axis into equal parts.

    Args:
        place: int64 (cells,), row or column of each cell.
        room: int64 (cells,), room of each cell.
        side: float64 (rooms,), length of a part, approximately [cells].
        count: Number of rooms.

    Returns:
        The part that each cell is in, int64 (cells,), and the number of parts, int64 (rooms,).
    """
    low, high = np.full(count, np.iinfo(np.int64).max), np.full(count, -1)
    np.minimum.at(low, room, place)
    np.maximum.at(high, room, place)
    extent = np.maximum(high - low + 1, 1)
    parts = np.maximum(1, np.rint(extent / side)).astype(np.int64)
    part: I64 = (place - low[room]) * parts[room] // extent[room]
    return part, parts
