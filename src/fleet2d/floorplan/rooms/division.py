"""How the free space of a plan is divided into rooms, by what its source says of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from fleet2d.floorplan.geometry.lattice import Lattice
from fleet2d.floorplan.geometry.mesh import build_mesh
from fleet2d.floorplan.rooms.adjacency import open_borders
from fleet2d.floorplan.rooms.chambers import Chambers, cut_chambers
from fleet2d.floorplan.rooms.doorway_search import MAX_DOOR_M, find_passages
from fleet2d.floorplan.rooms.doorways import DoorLine, Segment, fit_lines, rooms_beside
from fleet2d.floorplan.rooms.labelling import label_chambers
from fleet2d.floorplan.rooms.regions import LabelledRegion, Region, cells_in, snap_regions
from fleet2d.floorplan.rooms.room import NO_ROOM, Room, assign_rooms, lost_note, make_rooms
from fleet2d.floorplan.rooms.segmentation import segment_rooms
from fleet2d.kernels.mesh import Mesh

Regions = Literal["exact", "boxes", "none"]
"""What a source's regions are: the rooms themselves, boxes that label what walls bound, or nothing,
so that the rooms are found."""

ROOM = "room"
HALLWAY = "hallway"
HALLWAY_ROOMS = 3
HALLWAY_MAX_M2 = 25.0
"""Space that no label covers is a hallway where one gets from it to so many rooms; if it is larger
than this, more is done in it than walking through."""
MOST_CORNERS = 6_000
"""The search for passages looks at pairs of corners: where there are more, as in a scan with a
point each millimetre, it looks at walls that are straightened …"""
STRAIGHTENED_M = (0.01, 0.02, 0.04, 0.08, 0.16)
"""… by at most so much: the least that leaves few enough corners, or the last."""
ISLAND_M, WALL_M, THICK_M = 3.0, 1.2, 0.25
"""What stands free is a column or furniture, and no wall, if it is shorter than the first; or than
the second if it is as thin as a wall, which is at most the third."""


@dataclass(frozen=True)
class Survey:
    """The passages of a plan.

    Attributes:
        segments: Where they are [lattice], exactly from wall to wall.
        wide: Whether each is an opening, and no doorway.
    """

    segments: list[Segment]
    wide: list[bool]


def survey(
    lattice: Lattice, polygons: list[Polygon], kind: Regions
) -> tuple[list[Polygon], Survey]:
    """Find the passages of free space, which gets corners where they meet slanted walls."""
    walls = [_without_islands(polygon, lattice.units_per_m) for polygon in polygons]
    if len(walls) > 1:  # one may lie in what was an island of another
        walls = shapely.orient_polygons(shapely.get_parts(shapely.union_all(walls))).tolist()
    walls = _with_few_corners(walls, lattice.units_per_m)
    mesh = build_mesh(walls, lattice.columns, lattice.rows)
    passages = find_passages(mesh, walls, lattice.units_per_m, gaps_only=kind != "none")
    lines = [_line(lattice, passage.segment) for passage in passages]
    polygons, fitted, _ = fit_lines(lattice, polygons, lines)
    segments = [segment for segment in fitted if segment is not None]
    limit2 = (MAX_DOOR_M * lattice.units_per_m) ** 2
    wide = [(x1 - x0) ** 2 + (y1 - y0) ** 2 > limit2 for (x0, y0), (x1, y1) in segments]
    return polygons, Survey(segments, wide)


def _without_islands(polygon: Polygon, units_per_m: float) -> Polygon:
    """Return the polygon without its small holes: furniture and columns end no room."""
    if not polygon.interiors:
        return polygon
    islands = np.array([Polygon(hole) for hole in polygon.interiors])
    bounds = shapely.bounds(islands) / units_per_m
    length = (bounds[:, 2:] - bounds[:, :2]).max(axis=1)
    thickness = 2 * shapely.area(islands) / shapely.length(islands) / units_per_m
    large = length >= np.where(thickness <= THICK_M, WALL_M, ISLAND_M)
    holes = [hole for hole, kept in zip(polygon.interiors, large, strict=True) if kept]
    return Polygon(polygon.exterior, holes)


def _with_few_corners(walls: list[Polygon], units_per_m: float) -> list[Polygon]:
    """Return the walls, straightened where they have very many corners."""
    found, shape = walls, shapely.MultiPolygon(walls)
    for tolerance in STRAIGHTENED_M:
        if shapely.get_num_coordinates(found).sum() <= MOST_CORNERS:
            break
        simple = shapely.simplify(shape, tolerance * units_per_m)
        found = shapely.orient_polygons(shapely.get_parts(simple)).tolist()
    return found


def divide(
    lattice: Lattice,
    polygons: Sequence[Polygon],
    mesh: Mesh,
    free: NDArray[np.bool_],
    regions: Sequence[LabelledRegion],
    kind: Regions,
    passages: Survey | None,
) -> tuple[NDArray[np.int16], tuple[Room, ...], list[str]]:
    """Divide the free cells among rooms; see `assign_rooms`, `label_rooms`, `segment_rooms`."""
    if kind == "exact" or passages is None:
        return assign_rooms(lattice, free, regions)
    chambers = cut_chambers(lattice, polygons, mesh, free, passages.segments)
    if not regions:
        return found_rooms(lattice, segment_rooms(chambers, passages.wide, lattice.cell))
    return label_rooms(lattice, free, regions, chambers, passages.segments, passages.wide)


def found_doorways(
    lattice: Lattice,
    polygons: Sequence[Polygon],
    room_of_cell: NDArray[np.int16],
    passages: Survey,
) -> list[tuple[DoorLine, Segment]]:
    """Return the doorways among passages: those that are narrow, with a room on either side."""
    segments = []
    for segment, wide in zip(passages.segments, passages.wide, strict=True):
        left, right = rooms_beside(lattice, room_of_cell, segment)
        if not wide and left != right:
            segments.append(segment)
    lines = [_line(lattice, segment) for segment in segments]
    # A stored plan must come back as it is: fitting a line again may not move it.
    _, again, _ = fit_lines(lattice, polygons, lines)
    return [
        (line, segment)
        for line, segment, same in zip(lines, segments, again, strict=True)
        if segment == same
    ]


def _line(lattice: Lattice, segment: Segment) -> DoorLine:
    (x0, y0), (x1, y1) = lattice.to_metres(segment).tolist()
    return DoorLine((x0, y0), (x1, y1), leaf=False)


def label_rooms(
    lattice: Lattice,
    free: NDArray[np.bool_],
    regions: Sequence[LabelledRegion],
    chambers: Chambers,
    passages: Sequence[Segment],
    wide: Sequence[bool],
) -> tuple[NDArray[np.int16], tuple[Room, ...], list[str]]:
    """Divide the free cells among rooms that walls bound, and that rough boxes label.

    See `label_chambers` for how boxes and chambers are matched. What no box claims becomes rooms
    of type `unknown`, or `hallway` where one that isn't large leads to three rooms or more.

    Args:
        lattice: The plan's lattice.
        free: Free cells, bool (rows, columns).
        regions: What the file says, in the file's order.
        chambers: The free space, cut at passages.
        passages: The lines at which it was cut [lattice].
        wide: Whether each of them is an opening, and no doorway.

    Returns:
        As `assign_rooms`; rooms without a label come last, the largest first.
    """
    merged = snap_regions(lattice, regions)
    boxes = [cells_in(free, region.shape) for region in merged]
    found = label_chambers(chambers, boxes, wide, lattice.cell)
    notes = [
        lost_note(lattice, merged[box], f"{why}: it is no room") for box, why in found.lost.items()
    ]
    notes += _merge(merged, found.merged)
    first = len(merged)
    sizes = np.bincount(found.of_cell[free], minlength=first + found.rests)[first:]
    rank = np.empty(first + found.rests + 1, np.int64)  # its last entry serves -1
    rank[:first], rank[-1] = np.arange(first), NO_ROOM
    order = np.argsort(-sizes, kind="stable")
    rank[first + order], sizes = first + np.arange(found.rests), sizes[order]
    painted = rank[found.of_cell]
    ways = _ways(lattice, painted, [passages[link.line] for link in chambers.links])
    for rest in range(first, first + found.rests):
        small = sizes[rest - first] * lattice.cell**2 <= HALLWAY_MAX_M2
        hall = small and len(ways.get(rest, ())) >= HALLWAY_ROOMS
        merged.append(Region((), Polygon(), given_type=HALLWAY if hall else None))
    room_of_cell, rooms = make_rooms(lattice, painted, merged)
    notes += [
        f"{room.name} is a guess: no label covers its {room.area_m2:.1f} m2, from which one gets"
        f" to {HALLWAY_ROOMS} rooms or more"
        for room in rooms
        if room.type == HALLWAY and not room.labels
    ]
    return room_of_cell, rooms, notes


def _merge(regions: list[Region], into: Mapping[int, int]) -> list[str]:
    """Add the labels of regions to those that cover them; return notes of it."""
    notes = []
    for box, other in into.items():
        while into[other] != other:
            other = into[other]
        if other != box:
            types = tuple(dict.fromkeys(regions[other].types + regions[box].types))
            regions[other] = replace(regions[other], types=types)
            what, with_what = (" and ".join(regions[k].types) for k in (box, other))
            notes.append(f"a region {what} lies under smaller ones: it is one room, {with_what}")
    return notes


def found_rooms(
    lattice: Lattice, room_of_cell: NDArray[np.int64]
) -> tuple[NDArray[np.int16], tuple[Room, ...], list[str]]:
    """Return rooms without labels: `room_0` and so on; one that is all of the plan is `unknown`.

    Args:
        lattice: The plan's lattice.
        room_of_cell: The room of each cell, -1 where not free, (rows, columns).

    Returns:
        As `assign_rooms`.
    """
    count = int(room_of_cell.max()) + 1
    kind = ROOM if count > 1 else None
    regions = [Region((), Polygon(), given_type=kind) for _ in range(count)]
    return (*make_rooms(lattice, room_of_cell, regions), [])


def _ways(
    lattice: Lattice, painted: NDArray[np.int64], passages: Sequence[Segment]
) -> dict[int, set[int]]:
    """Return the regions that one gets to from each region."""
    rooms = painted.astype(np.int16)
    pairs = [link.rooms for link in open_borders(lattice, rooms, ())]
    pairs += [rooms_beside(lattice, rooms, passage) for passage in passages]
    ways: dict[int, set[int]] = {}
    for a, b in pairs:
        if a != b:
            ways.setdefault(a, set()).add(b)
            ways.setdefault(b, set()).add(a)
    return ways
