"""Divide the free space of a plan into rooms, by the regions that its source gives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import shapely
from shapely import Polygon

from fleet2d.floorplan.geometry.gates import Segment
from fleet2d.floorplan.geometry.lattice import Lattice
from fleet2d.floorplan.geometry.mesh import build_mesh
from fleet2d.floorplan.rooms.adjacency import open_borders
from fleet2d.floorplan.rooms.chambers import Chambers, cut_chambers
from fleet2d.floorplan.rooms.doorway_search import MAX_DOOR_M, find_passages
from fleet2d.floorplan.rooms.doorways import DoorLine, fit_lines, rooms_beside
from fleet2d.floorplan.rooms.labelling import label_chambers
from fleet2d.floorplan.rooms.regions import LabelledRegion, Region, cells_in, snap_regions
from fleet2d.floorplan.rooms.room import NO_ROOM, Room, assign_rooms, dropped_note, make_rooms
from fleet2d.floorplan.rooms.segmentation import segment_rooms
from fleet2d.kernels import I16, I64, Bool
from fleet2d.kernels.space import Mesh

RegionKind = Literal["exact", "boxes", "none"]
"""The regions of a source are the rooms themselves (`exact`), boxes that label what walls bound
(`boxes`), or absent, so that rooms are segmented from the walls (`none`)."""

ROOM = "room"
HALLWAY = "hallway"
HALLWAY_ROOMS = 3
HALLWAY_MAX_M2 = 25.0
"""Space without a label is a hallway if it leads to at least this many rooms, and is no larger than
this: larger space has other uses, too."""
MOST_CORNERS = 6_000
"""The search for passages looks at pairs of corners. With more corners than this, as in a scan with
a point each millimetre, it straightens the walls first …"""
STRAIGHTENED_M = (0.01, 0.02, 0.04, 0.08, 0.16)
"""… within the first of these tolerances that leaves few enough corners, or within the last."""
ISLAND_M, WALL_M, THICK_M = 3.0, 1.2, 0.25
"""A free-standing obstacle counts as a wall from a length of `ISLAND_M` on, or of `WALL_M` if its
thickness is at most `THICK_M`; shorter ones are columns or furniture."""


@dataclass(frozen=True)
class Passages:
    """The passages of a plan.

    Attributes:
        segments: Where they are [lattice], exactly from wall to wall.
        is_opening: Whether each is an opening, which is wider than a doorway.
    """

    segments: list[Segment]
    is_opening: list[bool]


def search_passages(
    lattice: Lattice, polygons: list[Polygon], kind: RegionKind
) -> tuple[list[Polygon], Passages]:
    """Find the passages of free space.

    Returns:
        The free space [lattice], with corners added where passages meet slanted walls; and the
        passages.
    """
    walls = [_without_islands(polygon, lattice.units_per_m) for polygon in polygons]
    if len(walls) > 1:  # one may lie inside a former island of another
        walls = shapely.orient_polygons(shapely.get_parts(shapely.union_all(walls))).tolist()
    walls = _with_few_corners(walls, lattice.units_per_m)
    mesh = build_mesh(walls, lattice.columns, lattice.rows)
    narrow = find_passages(mesh, walls, lattice.units_per_m, gaps_only=kind != "none")
    lines = [_line(lattice, segment) for segment in narrow]
    polygons, fitted, _ = fit_lines(lattice, polygons, lines)
    segments = [segment for segment in fitted if segment is not None]
    limit2 = (MAX_DOOR_M * lattice.units_per_m) ** 2
    is_opening = [(x1 - x0) ** 2 + (y1 - y0) ** 2 > limit2 for (x0, y0), (x1, y1) in segments]
    return polygons, Passages(segments, is_opening)


def _without_islands(polygon: Polygon, units_per_m: float) -> Polygon:
    """Return the polygon without its small holes: furniture and columns are not where rooms end."""
    if not polygon.interiors:
        return polygon
    islands = np.array([Polygon(hole) for hole in polygon.interiors])
    bounds = shapely.bounds(islands) / units_per_m
    length = (bounds[:, 2:] - bounds[:, :2]).max(axis=1)
    thickness = 2 * shapely.area(islands) / shapely.length(islands) / units_per_m
    large = length >= np.where(thickness <= THICK_M, WALL_M, ISLAND_M)
    holes = [hole for hole, is_large in zip(polygon.interiors, large, strict=True) if is_large]
    return Polygon(polygon.exterior, holes)


def _with_few_corners(walls: list[Polygon], units_per_m: float) -> list[Polygon]:
    """Return the walls, straightened where they have very many corners."""
    simpler, shape = walls, shapely.MultiPolygon(walls)
    for tolerance in STRAIGHTENED_M:
        if shapely.get_num_coordinates(simpler).sum() <= MOST_CORNERS:
            break
        simple = shapely.simplify(shape, tolerance * units_per_m)
        simpler = shapely.orient_polygons(shapely.get_parts(simple)).tolist()
    return simpler


def divide(
    lattice: Lattice,
    polygons: Sequence[Polygon],
    mesh: Mesh,
    free: Bool,
    regions: Sequence[LabelledRegion],
    kind: RegionKind,
    passages: Passages | None,
) -> tuple[I16, tuple[Room, ...], list[str]]:
    """Divide the free cells among rooms; see `assign_rooms`, `label_rooms`, `segment_rooms`."""
    if kind == "exact" or passages is None:
        return assign_rooms(lattice, free, regions)
    chambers = cut_chambers(lattice, polygons, mesh, free, passages.segments)
    if not regions:
        return number_rooms(lattice, segment_rooms(chambers, passages.is_opening, lattice.cell))
    return label_rooms(lattice, free, regions, chambers, passages)


def select_doorways(
    lattice: Lattice,
    polygons: Sequence[Polygon],
    room_of_cell: I16,
    passages: Passages,
) -> list[tuple[DoorLine, Segment]]:
    """Return the passages that are doorways: narrow, and between two different rooms."""
    segments = []
    for segment, is_opening in zip(passages.segments, passages.is_opening, strict=True):
        left, right = rooms_beside(lattice, room_of_cell, segment)
        if not is_opening and left != right:
            segments.append(segment)
    lines = [_line(lattice, segment) for segment in segments]
    # A stored plan must be read back unchanged, so fitting a line once more may not move it.
    _, refitted, _ = fit_lines(lattice, polygons, lines)
    return [
        (line, segment)
        for line, segment, same in zip(lines, segments, refitted, strict=True)
        if segment == same
    ]


def _line(lattice: Lattice, segment: Segment) -> DoorLine:
    (x0, y0), (x1, y1) = lattice.to_metres(segment).tolist()
    return DoorLine((x0, y0), (x1, y1), leaf=False)


def label_rooms(
    lattice: Lattice,
    free: Bool,
    regions: Sequence[LabelledRegion],
    chambers: Chambers,
    passages: Passages,
) -> tuple[I16, tuple[Room, ...], list[str]]:
    """Divide the free cells among rooms that walls bound, and that rough boxes label.

    See `label_chambers` for how boxes and chambers are matched. Space that no box claims becomes
    rooms of type `unknown`, or `hallway` if it isn't large and leads to three rooms or more.

    Args:
        lattice: The plan's lattice.
        free: Free cells, bool (rows, columns).
        regions: The labelled regions, in the order of the file.
        chambers: The free space, cut at passages.
        passages: The passages at which it was cut.

    Returns:
        As `assign_rooms`; rooms without a label come last, the largest first.
    """
    merged = snap_regions(lattice, regions)
    boxes = [cells_in(free, region.shape) for region in merged]
    labels = label_chambers(chambers, boxes, passages.is_opening, lattice.cell)
    notes = [
        dropped_note(lattice, merged[box], f"{reason}: it is not a room")
        for box, reason in labels.dropped.items()
    ]
    notes += _merge_labels(merged, labels.merged)
    first = len(merged)
    sizes = np.bincount(labels.of_cell[free], minlength=first + labels.rests)[first:]
    rank = np.empty(first + labels.rests + 1, np.int64)  # its last entry serves -1
    rank[:first], rank[-1] = np.arange(first), NO_ROOM
    order = np.argsort(-sizes, kind="stable")
    rank[first + order], sizes = first + np.arange(labels.rests), sizes[order]
    painted = rank[labels.of_cell]
    lines = [passages.segments[link.line] for link in chambers.links]
    neighbors = _neighbors(lattice, painted, lines)
    for rest in range(first, first + labels.rests):
        is_small = sizes[rest - first] * lattice.cell**2 <= HALLWAY_MAX_M2
        is_hallway = is_small and len(neighbors.get(rest, ())) >= HALLWAY_ROOMS
        merged.append(Region((), Polygon(), own_type=HALLWAY if is_hallway else None))
    room_of_cell, rooms = make_rooms(lattice, painted, merged)
    notes += [
        f"{room.name} is a guess: no label covers its {room.area_m2:.1f} m2, which lead to"
        f" {HALLWAY_ROOMS} rooms or more"
        for room in rooms
        if room.type == HALLWAY and not room.labels
    ]
    return room_of_cell, rooms, notes


def _merge_labels(regions: list[Region], into: Mapping[int, int]) -> list[str]:
    """Add the labels of regions to those that cover them; return a sentence for each."""
    notes = []
    for box, other in into.items():
        while into[other] != other:
            other = into[other]
        if other != box:
            types = tuple(dict.fromkeys(regions[other].types + regions[box].types))
            regions[other] = replace(regions[other], types=types)
            names, all_names = (" and ".join(regions[k].types) for k in (box, other))
            notes.append(f"a region {names} lies under smaller ones: it is one room, {all_names}")
    return notes


def number_rooms(lattice: Lattice, room_of_cell: I64) -> tuple[I16, tuple[Room, ...], list[str]]:
    """Return rooms without labels: `room_0` and so on, or `unknown_0` for a single one.

    Args:
        lattice: The plan's lattice.
        room_of_cell: The room of each cell, -1 where not free, (rows, columns).

    Returns:
        As `assign_rooms`.
    """
    count = int(room_of_cell.max()) + 1
    kind = ROOM if count > 1 else None
    regions = [Region((), Polygon(), own_type=kind) for _ in range(count)]
    return (*make_rooms(lattice, room_of_cell, regions), [])


def _neighbors(lattice: Lattice, painted: I64, passages: Sequence[Segment]) -> dict[int, set[int]]:
    """Return for each region the regions that it is linked to."""
    rooms = painted.astype(np.int16)
    pairs = [link.rooms for link in open_borders(lattice, rooms, ())]
    pairs += [rooms_beside(lattice, rooms, passage) for passage in passages]
    neighbors: dict[int, set[int]] = {}
    for a, b in pairs:
        if a != b:
            neighbors.setdefault(a, set()).add(b)
            neighbors.setdefault(b, set()).add(a)
    return neighbors
