"""Rooms: disjoint sets of cells that cover all free space, with their names and types."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from shapely import Polygon

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.names import number_names
from fleet2d.floorplan.rooms.adjacency import open_borders
from fleet2d.floorplan.rooms.regions import LabelledRegion, Region, paint_regions, snap_regions
from fleet2d.floorplan.rooms.vocabulary import UNKNOWN
from fleet2d.kernels import I16, I64, Bool
from fleet2d.kernels.space import label_frames, label_parts, squared_distance

NO_ROOM = -1
MAX_GAP_M2 = 0.8
"""Free space between two regions that no region covers is a gap if its area is below this."""


@dataclass(frozen=True)
class Room:
    """A named part of the free space: a set of cells.

    Attributes:
        index: Its number in the plan, the value of its cells in `FloorPlan.room_of_cell`.
        name: Unique in the plan, such as `bedroom_0`.
        type: Its type, such as `bedroom`.
        labels: Every type that the file gives it, in file order; empty for space without a label.
        cells: Number of cells.
        area_m2: Area of the cells [m²].
        anchor_xy: Centre of the cell that is deepest inside the room [m].
        bounds: Smallest box around the cells (x0, y0, x1, y1) [m].
    """

    index: int
    name: str
    type: str
    labels: tuple[str, ...]
    cells: int
    area_m2: float
    anchor_xy: tuple[float, float]
    bounds: tuple[float, float, float, float]


def assign_rooms(
    lattice: Lattice, free: Bool, regions: Sequence[LabelledRegion]
) -> tuple[I16, tuple[Room, ...], list[str]]:
    """Divide the free cells among rooms.

    Where regions overlap the smaller one wins, of equal ones the first. Regions that are equal once
    they are on the lattice are one room with the labels of all of them. Free cells of no region
    form one room of type `unknown`.

    Args:
        lattice: The plan's lattice.
        free: Free cells, bool (rows, columns).
        regions: The labelled regions, in the order of the file.

    Returns:
        The room of each cell, int16 (rows, columns), -1 where not free; the rooms in the file's
        order; and a sentence for each region that is not a room, and about gaps between regions.

    Raises:
        FloorPlanError: Two regions ask for the same name.
    """
    merged = snap_regions(lattice, regions)
    painted = paint_regions(free, merged)
    counts = np.bincount(painted[free], minlength=len(merged) + 1)
    notes = [dropped_note(lattice, merged[k]) for k in range(len(merged)) if counts[k] == 0]
    if counts[-1]:
        notes += _gap_notes(lattice, painted, len(merged))
        merged = [*merged, Region((), Polygon())]
    room_of_cell, rooms = make_rooms(lattice, painted, merged)
    return room_of_cell, rooms, notes


def _gap_notes(lattice: Lattice, painted: I64, regions: int) -> list[str]:
    """Return a sentence about small gaps between regions, such as doorways, if there are any.

    Args:
        lattice: The plan's lattice.
        painted: Region of each cell, `regions` for free cells of none, -1 where not free.
        regions: Number of regions.
    """
    part = label_parts(painted == regions, False)
    sizes = np.bincount(part[part >= 0])
    if regions + len(sizes) > np.iinfo(np.int16).max:
        return []  # a plan in shreds
    divided = np.where(part >= 0, regions + part, painted).astype(np.int16)
    borders = Counter(max(link.rooms) - regions for link in open_borders(lattice, divided, ()))
    gaps = [
        gap
        for gap, count in sorted(borders.items())
        if gap >= 0 and count > 1 and sizes[gap] * lattice.cell**2 < MAX_GAP_M2
    ]
    if not gaps:
        return []
    row, column = np.argwhere(part == gaps[0]).mean(axis=0).astype(int).tolist()
    x, y = lattice.to_metres(lattice.cell_centre(row, column)).tolist()
    return [
        f"small gaps between rooms that no region covers, such as doorways: {len(gaps)}, the first"
        f" at ({x:.2f}, {y:.2f}) m; they make a room of type {UNKNOWN}, so let the regions meet"
        " there"
    ]


def make_rooms(
    lattice: Lattice, painted: I64, merged: Sequence[Region]
) -> tuple[I16, tuple[Room, ...]]:
    """Return the rooms of the regions that have cells, and the room of each cell.

    Args:
        lattice: The plan's lattice.
        painted: Region of each cell, -1 where not free, (rows, columns).
        merged: The regions.
    """
    counts = np.bincount(painted[painted != NO_ROOM], minlength=len(merged))
    with_cells = [k for k in range(len(merged)) if counts[k] > 0]
    if len(with_cells) > np.iinfo(np.int16).max:
        raise FloorPlanError(
            f"the floor plan has {len(with_cells)} rooms: at most 32767 are possible"
        )
    index_of = np.full(len(counts) + 1, NO_ROOM, np.int16)  # its last entry serves -1
    index_of[with_cells] = np.arange(len(with_cells))
    room_of_cell = index_of[painted]
    regions = [merged[k] for k in with_cells]
    names = number_names([r.name for r in regions], [r.type for r in regions], "room")
    frames = label_frames(room_of_cell.astype(np.int32), len(with_cells))
    rooms = tuple(
        _room(lattice, room_of_cell, frames[i], i, names[i], region)
        for i, region in enumerate(regions)
    )
    return room_of_cell, rooms


def _room(
    lattice: Lattice,
    room_of_cell: I16,
    frame: I64,
    index: int,
    name: str,
    region: Region,
) -> Room:
    row0, column0, row1, column1 = frame.tolist()
    inside = room_of_cell[row0:row1, column0:column1] == index
    depth = squared_distance(np.pad(inside, 1))
    deepest = np.unravel_index(np.argmax(depth), depth.shape)  # the first of equals
    row, column = row0 + int(deepest[0]) - 1, column0 + int(deepest[1]) - 1
    x, y = lattice.to_metres(lattice.cell_centre(row, column)).tolist()
    corners = np.array([(column0, row0), (column1, row1)]) * UNITS_PER_CELL
    (x0, y0), (x1, y1) = lattice.to_metres(corners).tolist()
    cells = int(np.count_nonzero(inside))
    return Room(
        index=index,
        name=name,
        type=region.type,
        labels=region.types,
        cells=cells,
        area_m2=cells * lattice.cell**2,
        anchor_xy=(x, y),
        bounds=(x0, y0, x1, y1),
    )


def dropped_note(
    lattice: Lattice,
    region: Region,
    reason: str = "has no free cell that isn't in a smaller room: it is not a room",
) -> str:
    """Return the sentence which says that a region is not a room, and why."""
    name = region.name or " and ".join(region.types) or UNKNOWN
    if region.shape.is_empty:
        return f"the region {name} is empty: it is not a room"
    (x0, y0), (x1, y1) = lattice.to_metres(np.reshape(region.shape.bounds, (2, 2))).tolist()
    return f"the region {name} from ({x0:.2f}, {y0:.2f}) to ({x1:.2f}, {y1:.2f}) m {reason}"
