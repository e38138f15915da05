"""Rooms: their types, the regions that a file labels, and the cells of which each consists."""

import json
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.placed_objects import number_names
from fleet2d.floorplan.rooms.doorways import open_borders
from fleet2d.kernels import I16, I64, Bool, label_frames, label_parts, squared_distance

UNKNOWN = "unknown"

ALSO_CALLED: dict[str, list[str]] = json.loads(
    Path(__file__).with_name("types.json").read_text(encoding="utf-8")
)
"""The types of rooms, HouseExpo's 25 categories, each with its other names, as people and apps use
them in English, German, French, Spanish, Italian and Dutch."""
PRIORITY = tuple(ALSO_CALLED)
"""The types of rooms in the order that decides the type of a room with several labels: living
spaces come first, special types before general ones (a child's room is a bedroom), and catch-alls
last."""
_LAST = ("room", UNKNOWN)
_TYPES_OF: dict[str, tuple[str, ...]] = {}
for _kind, _names in ALSO_CALLED.items():
    for _name in (_kind, *_names):
        _TYPES_OF[_name] = (*_TYPES_OF.get(_name, ()), _kind)
# What joins the uses of a room in its name.
_JOINTS = re.compile(r"[/+&,;|]|\s-\s|\s(?:and|und|et|y|e|en|with|mit)\s", re.IGNORECASE)
LIVING_ROOM = "living_room"
# Rooms in which nobody spends the day, and those in which people do so if the home has no others.
NIGHT_ROOMS = ("bedroom", "child_room", "guest_room")
PASSED_THROUGH = ("hallway", "entryway", "hall", "lobby")
_LAST_DAY_ROOMS = ("hall", "lobby")
_DAY_ROOMS = ("dining_room", "kitchen", "room", "office", UNKNOWN)
# The smallest room that serves as a living room [m2].
LEAST_DAY_M2 = 8.0


def room_type(label: str) -> str:
    """Return the snake_case room type that a label in a floor plan file means.

    Example:
        >>> room_type("Child_Room"), room_type("Living room"), room_type("Yoga-Studio ")
        ('child_room', 'living_room', 'yoga_studio')
        >>> room_type("  ")
        'unknown'
    """
    words = re.findall(r"[^\W_]+", label.lower())
    return "_".join(words) or UNKNOWN


def usual_type(name: str) -> str:
    """Return the room type that a room's name means, from the vocabulary where it has one.

    The last words decide, then the first ones; a trailing number is ignored.

    Example:
        >>> usual_type("Master Bedroom"), usual_type("Küche"), usual_type("Bedroom 2")
        ('bedroom', 'kitchen', 'bedroom')
        >>> usual_type("Salle de bain"), usual_type("Chambre parentale")
        ('bathroom', 'bedroom')
        >>> usual_type("Yoga Studio 3")
        'yoga_studio_3'
    """
    return leading_type(usual_types(name))


def usual_types(name: str) -> tuple[str, ...]:
    """Return all room types that a room's name means, each once; itself if it means none.

    Example:
        >>> usual_types("Kitchen / Living room"), usual_types("Wohnküche 1")
        (('kitchen', 'living_room'), ('kitchen', 'living_room'))
        >>> usual_types("Ana & Ben's bedroom"), usual_types("Yoga Studio")
        (('bedroom',), ('yoga_studio',))
    """
    known = [kind for part in _JOINTS.split(name) for kind in _known_types(part)]
    return tuple(dict.fromkeys(known)) or (room_type(name),)


def _known_types(name: str) -> tuple[str, ...]:
    """Return the types of the vocabulary that a name without joints means."""
    words = room_type(name).split("_")
    while len(words) > 1 and words[-1].isdigit():
        words.pop()
    endings = ["_".join(words[first:]) for first in range(len(words))]
    beginnings = ["_".join(words[:last]) for last in range(len(words) - 1, 0, -1)]
    return next((_TYPES_OF[part] for part in (*endings, *beginnings) if part in _TYPES_OF), ())


def leading_type(types: tuple[str, ...]) -> str:
    """Return the type of a room that carries all of `types`.

    Types outside the vocabulary come after those in it; of several such types the first wins.

    Example:
        >>> leading_type(("toilet", "bathroom"))
        'bathroom'
        >>> leading_type(("room", "yoga_studio"))
        'yoga_studio'
    """
    return min(types, key=_rank) if types else UNKNOWN


def _rank(kind: str) -> int:
    if kind in PRIORITY:
        return PRIORITY.index(kind)
    if kind in _LAST:
        return len(PRIORITY) + 1 + _LAST.index(kind)
    return len(PRIORITY)


NOT_FREE = -1
TO_CENTRE = UNITS_PER_CELL // 2 + 1
# The number of corners from which on it pays to look which way a shape lies.
MANY_CORNERS = 1000


@dataclass(frozen=True)
class LabelledRegion:
    """A part of a floor plan that a file gives a name to.

    Attributes:
        labels: Its labels, as spelled in the file; none for a region of unknown use.
        shape: Its outline [m], or [lattice] once it is snapped; it may reach over walls and over
            other regions. Empty for one that is only cells.
        name: Name of the room, or None to be numbered by type (`bedroom_1`).
        type: Type of the room, or None for the one of its labels that leads.
    """

    labels: tuple[str, ...]
    shape: Polygon | MultiPolygon
    name: str | None = None
    type: str | None = None

    @property
    def types(self) -> tuple[str, ...]:
        """The labels as room types, each once."""
        return tuple(dict.fromkeys(kind for label in self.labels for kind in usual_types(label)))

    @property
    def main_type(self) -> str:
        """The type of the room."""
        return self.type or leading_type(self.types)


@dataclass(frozen=True)
class Patch:
    """Some cells of a plan.

    Attributes:
        window: The rows and columns that they are in.
        mask: Which cells of the window they are.
    """

    window: tuple[slice, slice]
    mask: Bool

    @property
    def cells(self) -> int:
        """Number of cells."""
        return int(np.count_nonzero(self.mask))

    @property
    def frame(self) -> I64:
        """The box around its cells: first row, first column, last row + 1, last column + 1."""
        rows, columns = (np.flatnonzero(self.mask.any(axis=axis)) for axis in (1, 0))
        first = np.array([self.window[0].start, self.window[1].start])
        if len(rows) == 0:
            return np.concatenate([first, first])
        low = np.array([rows[0], columns[0]])
        high = np.array([rows[-1], columns[-1]]) + 1
        return np.concatenate([first + low, first + high])


def snap_regions(lattice: Lattice, regions: Sequence[LabelledRegion]) -> list[LabelledRegion]:
    """Return the regions on the lattice; regions of equal shape become one, with all labels."""
    return _merge_equal([_snap(lattice, region) for region in regions])


def paint_regions(free: Bool, regions: list[LabelledRegion]) -> I64:
    """Return the index of the region of each cell, int64 (rows, columns).

    The smallest region wins. Free cells outside all regions have `len(regions)`, others -1.
    """
    painted = np.where(free, len(regions), NOT_FREE).astype(np.int64)
    by_area = sorted(range(len(regions)), key=lambda k: (-regions[k].shape.area, -k))
    for k in by_area:
        _paint_one(painted, regions[k].shape, k)
    return painted


def _paint_one(painted: I64, shape: Polygon | MultiPolygon, value: int) -> None:
    """Give `value` to the free cells whose centre lies inside `shape`."""
    if not shape.is_empty:
        window = _window(painted.shape, shape)
        painted[window][_inside(painted[window] != NOT_FREE, window, shape)] = value


def _window(size: tuple[int, ...], shape: Polygon | MultiPolygon) -> tuple[slice, slice]:
    """Return the rows and columns of the cells whose centre lies in the box around a shape."""
    # Shapes have even coordinates and centres odd ones, so no centre is on the side of a box.
    x0, y0, x1, y1 = ((int(v) - TO_CENTRE) // UNITS_PER_CELL + 1 for v in shape.bounds)
    row, end_row = (min(max(y, 0), size[0]) for y in (y0, y1))
    column, end_column = (min(max(x, 0), size[1]) for x in (x0, x1))
    return slice(row, end_row), slice(column, end_column)


def _inside(free: Bool, window: tuple[slice, slice], shape: Polygon | MultiPolygon) -> Bool:
    """Return which free cells of a window have their centre inside a shape."""
    inside = free.copy()
    if not shape.equals(shapely.box(*shape.bounds)):
        upright = _inside_upright(free.shape, window, shape)
        if upright is not None:
            return inside & upright
        y, x = np.nonzero(inside)
        centre_x = (x + window[1].start) * UNITS_PER_CELL + TO_CENTRE
        centre_y = (y + window[0].start) * UNITS_PER_CELL + TO_CENTRE
        if _is_met_more_along_x(shape):
            shape = shapely.transform(shape, lambda xy: xy[:, ::-1])
            centre_x, centre_y = centre_y, centre_x
        shapely.prepare(shape)
        inside[y, x] = shapely.contains_xy(shape, centre_x, centre_y)
    return inside


def _inside_upright(
    size: tuple[int, ...], window: tuple[slice, slice], shape: Polygon | MultiPolygon
) -> Bool | None:
    """Return the cells of a window with their centre inside a shape with sides along the axes.

    None for another shape. Each upright side turns the inside out for the cells to its right.
    """
    rings = shapely.get_rings(shapely.get_parts(shape))
    corners, ring = shapely.get_coordinates(rings, return_index=True)
    sides = np.stack([corners[:-1], corners[1:]], axis=1)[ring[:-1] == ring[1:]]
    is_upright = sides[:, 0, 0] == sides[:, 1, 0]
    if not (is_upright | (sides[:, 0, 1] == sides[:, 1, 1])).all():
        return None
    upright = np.sort(sides[is_upright], axis=1)
    first = np.array([window[1].start, window[0].start])
    cells = (upright.astype(np.int64) - TO_CENTRE) // UNITS_PER_CELL + 1 - first
    turns = np.zeros((size[0], size[1] + 1), np.bool_)
    for (column, low), (_, high) in np.maximum(cells, 0).tolist():
        turns[low:high, min(column, size[1])] ^= True
    return np.logical_xor.accumulate(turns[:, :-1], axis=1)


def _is_met_more_along_x(shape: Polygon | MultiPolygon) -> bool:
    """Whether a line along x meets more edges of a shape of many corners than one along y.

    GEOS compares a point with all edges that the line through it along x meets: with thousands, if
    the shape has thin teeth along y.
    """
    if shapely.get_num_coordinates(shape) < MANY_CORNERS:
        return False
    edges = np.abs(np.diff(shapely.get_coordinates(shape), axis=0)).sum(axis=0)
    x0, y0, x1, y1 = shape.bounds
    return bool(edges[1] * (x1 - x0) > edges[0] * (y1 - y0))


def cells_in(free: Bool, shape: Polygon | MultiPolygon) -> Patch:
    """Return the free cells inside a shape."""
    if shape.is_empty:
        return Patch((slice(0, 0), slice(0, 0)), np.zeros((0, 0), np.bool_))
    window = _window(free.shape, shape)
    return Patch(window, _inside(free[window], window, shape))


def _snap(lattice: Lattice, region: LabelledRegion) -> LabelledRegion:
    shape = shapely.transform(region.shape, lambda xy: lattice.to_walls(xy).astype(np.float64))
    return LabelledRegion(region.types, shapely.normalize(shape), region.name, region.type)


def _merge_equal(regions: list[LabelledRegion]) -> list[LabelledRegion]:
    """Join regions of exactly the same shape, at the place of the first."""
    by_shape: dict[bytes, LabelledRegion] = {}
    for region in regions:
        key = shapely.to_wkb(region.shape)
        first = by_shape.get(key)
        if first is None:
            by_shape[key] = region
            continue
        types = tuple(dict.fromkeys(first.types + region.types))
        by_shape[key] = LabelledRegion(
            types, first.shape, first.name or region.name, first.type or region.type
        )
    return list(by_shape.values())


NO_ROOM = -1
MAX_GAP_M2 = 0.8
"""Free space between two regions that no region covers is a gap if its area is below this."""


@dataclass(frozen=True)
class Room:
    """A named part of the free space: a set of cells.

    Attributes:
        index: Its number in the plan, the value of its cells in `FloorPlan.room_of_cell`.
        name: Unique in the plan, such as `bedroom_1`.
        type: Its type, such as `bedroom`.
        labels: Every type that the file gives it, in file order; empty for space without a label.
            Each is a function: a kitchen with the label living_room is a living room, too.
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

    @property
    def words(self) -> tuple[str, ...]:
        """What it may be called by: its name, its type and its other functions, each once."""
        return tuple(dict.fromkeys((self.name, self.type, *self.labels)))

    def is_called(self, name: str) -> bool:
        """Return whether a name is that of the room, of its type or of another of its functions."""
        return name in (self.name, self.type) or name in self.labels


def day_room(rooms: Sequence[Room]) -> Room | None:
    """Return the room that serves as a living room: the largest in which people spend the day.

    None if a room is one, or none is large enough.
    """
    if any(room.is_called(LIVING_ROOM) for room in rooms):
        return None
    large = [room for room in rooms if room.area_m2 >= LEAST_DAY_M2]
    for kinds in (_DAY_ROOMS, _LAST_DAY_ROOMS):
        fitting = [room for room in large if room.type in kinds]
        if fitting:
            return max(fitting, key=lambda room: room.area_m2)
    return None


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
        merged = [*merged, LabelledRegion((), Polygon())]
    room_of_cell, rooms = make_rooms(lattice, painted, merged)
    return room_of_cell, rooms, notes


def _gap_notes(lattice: Lattice, painted: I64, regions: int) -> list[str]:
    """Return a sentence about small gaps between regions, such as doorways, if there are any.

    Args:
        lattice: The plan's lattice.
        painted: LabelledRegion of each cell, `regions` for free cells of none, -1 where not free.
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
    lattice: Lattice, painted: I64, merged: Sequence[LabelledRegion]
) -> tuple[I16, tuple[Room, ...]]:
    """Return the rooms of the regions that have cells, and the room of each cell.

    Args:
        lattice: The plan's lattice.
        painted: LabelledRegion of each cell, -1 where not free, (rows, columns).
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
    names = number_names([r.name for r in regions], [r.main_type for r in regions], "room")
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
    region: LabelledRegion,
) -> Room:
    row0, column0, row1, column1 = frame.tolist()
    inside = room_of_cell[row0:row1, column0:column1] == index
    depth = squared_distance(np.pad(inside, 1))
    deepest = np.unravel_index(np.argmax(depth), depth.shape)  # the first of equals
    row = row0 + int(deepest[0]) - 1
    column = column0 + int(deepest[1]) - 1
    x, y = lattice.to_metres(lattice.cell_centre(row, column)).tolist()
    corners = np.array([(column0, row0), (column1, row1)]) * UNITS_PER_CELL
    (x0, y0), (x1, y1) = lattice.to_metres(corners).tolist()
    cells = int(np.count_nonzero(inside))
    return Room(
        index=index,
        name=name,
        type=region.main_type,
        labels=region.types,
        cells=cells,
        area_m2=cells * lattice.cell**2,
        anchor_xy=(x, y),
        bounds=(x0, y0, x1, y1),
    )


def dropped_note(
    lattice: Lattice,
    region: LabelledRegion,
    reason: str = "has no free cell that isn't in a smaller room: it is not a room",
) -> str:
    """Return the sentence which says that a region is not a room, and why."""
    name = region.name or " and ".join(region.types) or UNKNOWN
    if region.shape.is_empty:
        return f"the region {name} is empty: it is not a room"
    (x0, y0), (x1, y1) = lattice.to_metres(np.reshape(region.shape.bounds, (2, 2))).tolist()
    return f"the region {name} from ({x0:.2f}, {y0:.2f}) to ({x1:.2f}, {y1:.2f}) m {reason}"
