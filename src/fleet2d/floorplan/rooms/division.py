"""Divide free space into rooms, by its walls and the regions that a file labels.

Where the regions are rough boxes, walls determine where rooms end, and boxes how they are labelled:
a box is matched to the chamber that it outlines, and doesn't reach into others. Several boxes in
one chamber, as in an open plan, divide it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import shapely
from shapely import Geometry, LinearRing, MultiPolygon, Polygon

from fleet2d.floorplan.lattice import Lattice
from fleet2d.floorplan.mesh import Segment, build_mesh
from fleet2d.floorplan.rooms.doorways import (
    DoorLine,
    fit_lines,
    open_borders,
    rooms_beside,
)
from fleet2d.floorplan.rooms.narrow_borders import narrow_borders
from fleet2d.floorplan.rooms.room import (
    NO_ROOM,
    LabelledRegion,
    Patch,
    Room,
    assign_rooms,
    cells_in,
    dropped_note,
    make_rooms,
    snap_regions,
)
from fleet2d.floorplan.rooms.segmentation import (
    MAX_DOOR_M,
    MIN_DOOR_M,
    Chambers,
    WallDirections,
    cut_chambers,
    find_passages,
    segment_rooms,
)
from fleet2d.floorplan.rooms.shape import (
    IN_RAGGED_WALLS,
    IN_STRAIGHT_WALLS,
    OF_VACUUMS,
    WALL_M,
    divide_by_shape,
)
from fleet2d.kernels import (
    F64,
    I16,
    I32,
    I64,
    Bool,
    Mesh,
    label_frames,
    label_parts,
    spread_labels,
    squared_distance,
)

MIN_OUTLINE_OVERLAP = 0.5
"""A box outlines a chamber if the intersection of box and chamber's frame is at least this share
of their union."""
MIN_REACH_SHARE = 0.3
"""A box also claims a chamber that an opening joins to its own, if it covers this share of it."""
MIN_TOUCH_SHARE = 0.15
"""A box only touches a chamber that has less than this share of the box's cells, and of which the
box covers less than half."""
NOT_FREE = "covers no free space"
TOO_SMALL = "covers too little free space"
ONLY_TOUCHES = "only touches rooms"
MIN_KEPT_SHARE = 0.25
"""Where boxes overlap: one that keeps less than this share of its cells is no room of its own."""
MIN_ROOM_M2 = 0.5
MIN_ROOM_WIDTH_M = 0.4
"""Least area and width of a room with a label."""
MIN_REST_M2 = 2.5
MIN_REST_WIDTH_M = 0.8
"""Least area and width of a room without a label …"""
REST_SHARE = 0.06
REST_SHARE_OF_ONE = 0.3
"""… and its minimum share of a chamber that has several labels, or only one."""


@dataclass
class _JoinedChambers:
    """Chambers that openings join into one, and for each box the chambers that it claims."""

    chambers: list[int]
    claims: dict[int, set[int]] = field(default_factory=dict)


@dataclass(frozen=True)
class ChamberLabels:
    """The rooms that chambers and boxes make.

    Attributes:
        of_cell: For each free cell the number of its box; rooms that no box claims are numbered
            after the boxes; -1 where not free. int32 (rows, columns).
        rests: Number of rooms that no box claims.
        merged: For each box the box that gets its labels: itself, or one that covers it.
        dropped: For each box that is not a room the reason; by box.
    """

    of_cell: I32
    rests: int
    merged: dict[int, int]
    dropped: dict[int, str]


def label_chambers(
    chambers: Chambers, boxes: Sequence[Patch], is_opening: Sequence[bool], cell: float
) -> ChamberLabels:
    """Divide the free space among the boxes that label the rooms of a plan.

    Args:
        chambers: The free space, cut at doorways and openings.
        boxes: The free cells in each labelled rectangle of the plan.
        is_opening: Whether each line at which the chambers were cut is an opening, not a doorway.
        cell: Side of a cell [m].
    """
    frames = label_frames(chambers.of_cell, chambers.count)
    claims, dropped = _claims(chambers, frames, boxes, is_opening, cell)
    blocks = _blocks(chambers, claims, is_opening, cell)
    out = np.full(chambers.of_cell.shape, -1, np.int32)
    for box in sorted(claims, key=lambda b: (-boxes[b].cells, -b)):
        claimed = np.zeros(chambers.count + 1, np.bool_)  # its last entry serves -1
        claimed[list(claims[box])] = True
        window = boxes[box].window
        out[window][boxes[box].mask & claimed[chambers.of_cell[window]]] = box
    merged = {box: box for box in range(len(boxes))}
    next_room = len(boxes)
    for block in blocks:
        window = _window(frames[block.chambers])
        inside = np.isin(chambers.of_cell[window], block.chambers)
        labels = np.where(inside, out[window], -1).astype(np.int32)
        for box in sorted(block.claims, key=lambda b: (-boxes[b].cells, -b)):
            cells = _cells_in(boxes[box], window, inside)
            _keep_one_piece(labels, box, cells, cell, merged, dropped)
        labels, next_room = _fill(labels, inside, cell, next_room)
        out[window][inside] = labels[inside]
    return ChamberLabels(out, next_room - len(boxes), merged, dict(sorted(dropped.items())))


# --- Which boxes claim which chambers ------------------------------------------------------------


def _claims(
    chambers: Chambers, frames: I64, boxes: Sequence[Patch], is_opening: Sequence[bool], cell: float
) -> tuple[dict[int, set[int]], dict[int, str]]:
    """Return the chambers that each box claims, and the reasons of boxes that claim none."""
    sizes = np.bincount(chambers.of_cell[chambers.of_cell >= 0], minlength=chambers.count)
    neighbors: dict[int, set[int]] = {c: set() for c in range(chambers.count)}
    for link in chambers.links:
        if is_opening[link.line]:
            a, b = link.chambers
            neighbors[a].add(b)
            neighbors[b].add(a)
    claims: dict[int, set[int]] = {}
    dropped: dict[int, str] = {}
    for number, box in enumerate(boxes):
        counts = np.bincount(chambers.of_cell[box.window][box.mask], minlength=chambers.count)
        if _too_small(box, cell):
            dropped[number] = TOO_SMALL if box.cells else NOT_FREE
            continue
        overlap = _overlaps(box.frame, frames)
        overlap[counts < MIN_OUTLINE_OVERLAP * MIN_OUTLINE_OVERLAP * sizes] = 0
        best = int(np.argmax(overlap if overlap.max() >= MIN_OUTLINE_OVERLAP else counts))
        if (
            counts[best] < MIN_TOUCH_SHARE * counts.sum()
            and counts[best] < MIN_OUTLINE_OVERLAP * sizes[best]
        ):
            dropped[number] = ONLY_TOUCHES
            continue
        claims[number] = {best}
        queue = [best]
        while queue:
            for neighbor in sorted(neighbors[queue.pop()] - claims[number]):
                if counts[neighbor] >= MIN_REACH_SHARE * sizes[neighbor]:
                    claims[number].add(neighbor)
                    queue.append(neighbor)
    return claims, dropped


def _too_small(box: Patch, cell: float) -> bool:
    row, column, end_row, end_column = box.frame.tolist()
    narrow = min(end_row - row, end_column - column) * cell < MIN_ROOM_WIDTH_M
    return narrow or box.cells * cell**2 < MIN_ROOM_M2


def _overlaps(frame: I64, frames: I64) -> F64:
    """Return the intersection of a frame with each of others, as a share of their union."""
    low = np.maximum(frame[:2], frames[:, :2])
    high = np.minimum(frame[2:], frames[:, 2:])
    common = np.clip(high - low, 0, None).prod(axis=1)
    areas = (frames[:, 2:] - frames[:, :2]).prod(axis=1)
    return common / ((frame[2:] - frame[:2]).prod() + areas - common)


def _blocks(
    chambers: Chambers, claims: dict[int, set[int]], is_opening: Sequence[bool], cell: float
) -> list[_JoinedChambers]:
    """Join chambers across openings, except where they separate two labels."""
    owner = list(range(chambers.count))
    sizes = np.bincount(chambers.of_cell[chambers.of_cell >= 0], minlength=chambers.count)
    by_chamber: dict[int, set[int]] = {c: set() for c in owner}
    for box, claimed in claims.items():
        for chamber in claimed:
            by_chamber[chamber].add(box)
    for link in chambers.links:
        a, b = link.chambers
        free = not by_chamber[a] and not by_chamber[b]
        shared = bool(by_chamber[a] & by_chamber[b])
        tiny = any(
            not by_chamber[one] and sizes[one] * cell**2 < MIN_REST_M2 for one in link.chambers
        )
        if is_opening[link.line] and (free or shared or tiny):
            low, high = sorted((owner[a], owner[b]))
            owner = [low if root == high else root for root in owner]
    blocks = {root: _JoinedChambers([]) for root in sorted(set(owner))}
    for chamber, root in enumerate(owner):
        blocks[root].chambers.append(chamber)
        for box in by_chamber[chamber]:
            blocks[root].claims.setdefault(box, set()).add(chamber)
    return list(blocks.values())


# --- Dividing a block among its boxes -------------------------------------------------------------


def _window(frames: I64) -> tuple[slice, slice]:
    """Return the rows and columns of the smallest window that holds all frames."""
    row, column = frames[:, :2].min(axis=0)
    end_row, end_column = frames[:, 2:].max(axis=0)
    return slice(int(row), int(end_row)), slice(int(column), int(end_column))


def _cells_in(box: Patch, window: tuple[slice, slice], inside: Bool) -> Bool:
    """Return the cells of a box inside a block, bool (rows, columns) of the block's window."""
    targets = []
    sources = []
    for own, other in zip(box.window, window, strict=True):
        low = max(own.start, other.start)
        high = max(min(own.stop, other.stop), low)
        targets.append(slice(low - other.start, high - other.start))
        sources.append(slice(low - own.start, high - own.start))
    cells = np.zeros(inside.shape, np.bool_)
    cells[tuple(targets)] = box.mask[tuple(sources)]
    return cells & inside


def _fill(labels: I32, inside: Bool, cell: float, next_room: int) -> tuple[I32, int]:
    """Give every cell of a block a room; return also the number of the next room without a box."""
    boxes = np.flatnonzero(np.bincount(labels[labels >= 0]))
    first_room = next_room
    next_room = _number_rests(labels, inside, len(boxes), cell, next_room)
    if len(boxes) == 1 and next_room == first_room:
        return np.where(inside, boxes[0], -1).astype(np.int32), next_room
    if (labels[inside] < 0).any():
        labels = spread_labels(labels, inside)
    while (labels[inside] < 0).any():  # parts that share no side with labelled cells
        part = label_parts(inside & (labels < 0), False)
        labels[part == 0] = next_room
        next_room += 1
    return labels, next_room


def _keep_one_piece(
    labels: I32, box: int, whole: Bool, cell: float, merged: dict[int, int], dropped: dict[int, str]
) -> None:
    """Leave a box its largest piece, or nothing if that is too small to be a room."""
    own = labels == box
    if own.any():
        part = label_parts(own, False)
        largest = part == np.argmax(np.bincount(part[own]))
        labels[own & ~largest] = -1
        own = largest
    cells = int(np.count_nonzero(own))
    if cells >= MIN_KEPT_SHARE * np.count_nonzero(whole) and cells * cell**2 >= MIN_ROOM_M2:
        return
    labels[own] = -1
    covering = labels[whole & (labels >= 0)]
    if len(covering) and np.count_nonzero(whole):
        merged[box] = int(np.argmax(np.bincount(covering)))
    else:
        dropped[box] = TOO_SMALL


def _number_rests(labels: I32, inside: Bool, boxes: int, cell: float, next_room: int) -> int:
    """Number the parts of a block that no box covers and that are large enough to be rooms."""
    rest = inside & (labels < 0)
    if boxes == 0:
        labels[rest] = next_room
        return next_room + 1
    share = REST_SHARE_OF_ONE if boxes == 1 else REST_SHARE
    least = max(MIN_REST_M2 / cell**2, share * np.count_nonzero(inside))
    if np.count_nonzero(rest) < least:
        return next_room
    radius = MIN_REST_WIDTH_M / 2 / cell
    core = squared_distance(np.pad(rest, 1))[1:-1, 1:-1] >= radius**2
    if not core.any():
        return next_room
    opened = rest & (squared_distance(~core) < radius**2)
    part = label_parts(opened, False)
    sizes = np.bincount(part[opened])
    for number in np.flatnonzero(sizes >= least):
        labels[part == number] = next_room
        next_room += 1
    return next_room


RegionKind = Literal["exact", "segments", "boxes", "none", "vacuum"]
"""The regions of a source are the rooms themselves (`exact`), the same and doorways where they meet
at a narrow place (`segments`), boxes that label what walls bound (`boxes`), or absent, so that
rooms are found from the walls (`none`) or, in what a vacuum has reached, from where it narrows
(`vacuum`)."""

ROOM = "room"
HALLWAY = "hallway"
HALLWAY_ROOMS = 3
HALLWAY_MAX_M2 = 25.0
"""Space without a label is a hallway if it leads to at least this many rooms, and is no larger than
this: larger space has other uses, too."""
MAX_CORNERS = 6_000
"""The search for passages looks at pairs of corners. With more corners than this, as in a scan with
a point each millimetre, it straightens the walls first …"""
STRAIGHTENED_M = (0.01, 0.02, 0.04, 0.08, 0.16)
"""… within the first of these tolerances that leaves few enough corners, or within the last."""
ISLAND_M = 3.0
THICK_M = 0.25
"""A free-standing obstacle counts as a wall from a length of `ISLAND_M` on, or of `WALL_M` if it is
at most `THICK_M` thick, or parts of it are over such a length, as of a wall with a cupboard at it;
shorter ones are columns or furniture."""
BUMP_M = 0.3
"""Obstacles up to this long that touch the outer wall at a corner are noise of it [m]."""


@dataclass(frozen=True)
class Passages:
    """The passages of a plan.

    Attributes:
        segments: Where they are [lattice], exactly from wall to wall.
        widths_m: How long each is [m].
        is_opening: Whether each is wider than a doorway, or a gap that is narrower than one.
        between_straight_walls: Whether rooms can be found by them, as walls are straight.
    """

    segments: list[Segment]
    widths_m: list[float]
    is_opening: list[bool]
    between_straight_walls: bool


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
    islands = shapely.difference(MultiPolygon(walls), MultiPolygon(polygons))
    directions = WallDirections.of(walls, lattice.units_per_m) if kind == "none" else None
    straight = directions is not None and directions.straight
    walls = _with_few_corners(walls, lattice.units_per_m)
    mesh = build_mesh(walls, lattice.columns, lattice.rows)
    narrow = find_passages(mesh, walls, lattice.units_per_m, directions if straight else None)
    lines = [_line(lattice, piece) for piece in _between_islands(narrow, islands)]
    polygons, fitted, _ = fit_lines(lattice, polygons, lines)
    segments = [segment for segment in fitted if segment is not None]
    widths = [math.dist(*segment) / lattice.units_per_m for segment in segments]
    is_opening = [not MIN_DOOR_M <= width <= MAX_DOOR_M for width in widths]
    return polygons, Passages(segments, widths, is_opening, straight)


def _between_islands(passages: Sequence[Segment], islands: Geometry) -> F64:
    """Return the pieces of passages beside obstacles in them, such as a pier between two doors.

    Returns:
        The ends of each, float64 (n, 2, 2).
    """
    lines = shapely.linestrings(np.reshape(passages, (-1, 2, 2)))
    pieces = shapely.get_parts(shapely.difference(lines, islands))
    ends = [shapely.get_point(pieces, end) for end in (0, -1)]
    return np.stack([shapely.get_coordinates(points) for points in ends], axis=1)


def _without_islands(polygon: Polygon, units_per_m: float) -> Polygon:
    """Return the polygon without its small holes: furniture and columns are not where rooms end.

    Holes that touch at corners are one obstacle: in a map of pixels, a thin slanted wall is a
    chain of them. What touches the outer wall belongs to it, unless it is a mere bump.
    """
    if not polygon.interiors:
        return polygon
    holes = np.asarray(shapely.polygons(shapely.get_rings(polygon)[1:]))
    chain = np.arange(len(holes))
    for one, other in shapely.STRtree(holes).query(holes, predicate="touches").T.tolist():
        chain[chain == chain[one]] = chain[other]
    at_outer_wall = shapely.intersects(holes, polygon.exterior)
    kept: list[LinearRing] = []
    for number in np.unique(chain):
        links = chain == number
        island = MultiPolygon(holes[links].tolist())
        length = 2 * shapely.minimum_bounding_radius(island) / units_per_m
        is_outer = at_outer_wall[links].any() and length > BUMP_M
        if is_outer or (length >= WALL_M and _is_wall(island, units_per_m)):
            kept += shapely.get_exterior_ring(holes[links]).tolist()
    return Polygon(polygon.exterior, kept)


def _is_wall(island: MultiPolygon, units_per_m: float) -> bool:
    """Return whether a free-standing obstacle is a wall, or furniture with a wall."""
    box = shapely.get_coordinates(shapely.oriented_envelope(island)) / units_per_m
    length = max(math.dist(box[0], box[1]), math.dist(box[1], box[2]))
    if length >= ISLAND_M or length < WALL_M:
        return length >= ISLAND_M
    thick = THICK_M * units_per_m
    if 2 * island.area <= thick * island.length:
        return True
    core = island.buffer(-thick / 2, join_style="mitre").buffer(0.505 * thick, join_style="mitre")
    thin = shapely.length(shapely.get_parts(island.difference(core))) / 2
    return float(thin[thin >= 2 * thick].sum()) >= WALL_M * units_per_m


def _with_few_corners(walls: list[Polygon], units_per_m: float) -> list[Polygon]:
    """Return the walls, straightened where they have very many corners."""
    simpler = walls
    shape = shapely.MultiPolygon(walls)
    for tolerance in STRAIGHTENED_M:
        if shapely.get_num_coordinates(simpler).sum() <= MAX_CORNERS:
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
    passages: Passages,
) -> tuple[I16, tuple[Room, ...], list[str]]:
    """Divide the free cells among rooms.

    See `assign_rooms`, `label_rooms`, `segment_rooms` and `divide_by_shape`.
    """
    if kind in ("exact", "segments"):
        return assign_rooms(lattice, free, regions)
    if kind == "vacuum" or (kind == "none" and not passages.between_straight_walls):
        limits = OF_VACUUMS if kind == "vacuum" else IN_RAGGED_WALLS
        rooms = divide_by_shape(np.where(free, 0, -1), lattice.cell, limits)
        return number_rooms(lattice, rooms)
    chambers = cut_chambers(lattice, polygons, mesh, free, passages.segments)
    if kind == "boxes":
        return label_rooms(lattice, free, regions, chambers, passages)
    rooms = segment_rooms(
        chambers, passages.segments, passages.is_opening, passages.widths_m, lattice.cell
    )
    return number_rooms(lattice, divide_by_shape(rooms, lattice.cell, IN_STRAIGHT_WALLS))


def select_doorways(
    lattice: Lattice,
    polygons: list[Polygon],
    room_of_cell: I16,
    passages: Passages,
    kind: RegionKind,
) -> tuple[list[tuple[DoorLine, Segment]], list[Polygon]]:
    """Return the passages that are doorways: narrow, and between two different rooms.

    Except for rooms that are `exact` or have `boxes`, so are narrow borders. The free space is
    returned, too, with corners added on straight walls where these end.
    """
    segments = []
    for segment, is_opening in zip(passages.segments, passages.is_opening, strict=True):
        left, right = rooms_beside(lattice, room_of_cell, segment)
        if not is_opening and left != right:
            segments.append(segment)
    lines = [_line(lattice, segment) for segment in segments]
    narrows = kind not in ("exact", "boxes")
    if narrows:
        borders = narrow_borders(lattice, room_of_cell, segments, (MIN_DOOR_M, MAX_DOOR_M))
        _, fitted, _ = fit_lines(lattice, polygons, [*lines, *borders])
        segments += [
            segment
            for segment in fitted[len(lines) :]
            if segment is not None and np.ptp(rooms_beside(lattice, room_of_cell, segment))
        ]
        lines = [_line(lattice, segment) for segment in segments]
    # A stored plan must be read back unchanged, so fitting a line once more may not move it.
    fitted_polygons, refitted, _ = fit_lines(lattice, polygons, lines)
    return [
        (line, segment)
        for line, segment, same in zip(lines, segments, refitted, strict=True)
        if segment == same
    ], fitted_polygons if narrows else list(polygons)


def _line(lattice: Lattice, segment: Segment | F64) -> DoorLine:
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
    rank[:first] = np.arange(first)
    rank[-1] = NO_ROOM
    order = np.argsort(-sizes, kind="stable")
    rank[first + order] = first + np.arange(labels.rests)
    sizes = sizes[order]
    painted = rank[labels.of_cell]
    lines = [passages.segments[link.line] for link in chambers.links]
    neighbors = _neighbors(lattice, painted, lines)
    for rest in range(first, first + labels.rests):
        is_small = sizes[rest - first] * lattice.cell**2 <= HALLWAY_MAX_M2
        is_hallway = is_small and len(neighbors.get(rest, ())) >= HALLWAY_ROOMS
        merged.append(LabelledRegion((), Polygon(), type=HALLWAY if is_hallway else None))
    room_of_cell, rooms = make_rooms(lattice, painted, merged)
    notes += [
        f"{room.name} is a guess: no label covers its {room.area_m2:.1f} m2, which lead to"
        f" {HALLWAY_ROOMS} rooms or more"
        for room in rooms
        if room.type == HALLWAY and not room.labels
    ]
    return room_of_cell, rooms, notes


def _merge_labels(regions: list[LabelledRegion], into: Mapping[int, int]) -> list[str]:
    """Add the labels of regions to those that cover them; return a sentence for each."""
    notes = []
    for box, other in into.items():
        while into[other] != other:
            other = into[other]
        if other != box:
            types = tuple(dict.fromkeys(regions[other].types + regions[box].types))
            regions[other] = replace(regions[other], labels=types)
            names, all_names = (" and ".join(regions[k].types) for k in (box, other))
            notes.append(f"a region {names} lies under smaller ones: it is one room, {all_names}")
    return notes


def number_rooms(lattice: Lattice, room_of_cell: I64) -> tuple[I16, tuple[Room, ...], list[str]]:
    """Return rooms without labels: `room_1` and so on, or `unknown_1` for a single one.

    Args:
        lattice: The plan's lattice.
        room_of_cell: The room of each cell, -1 where not free, (rows, columns).

    Returns:
        As `assign_rooms`, with a note if there are several.
    """
    count = int(room_of_cell.max()) + 1
    is_divided = count > 1
    kind = ROOM if is_divided else None
    regions = [LabelledRegion((), Polygon(), type=kind) for _ in range(count)]
    notes = [
        f"the file tells no rooms: walls and passages divide its floor into {count}, which may be"
        " others than people see; look at them, and name or redraw them by floorplan.rooms"
    ]
    return (*make_rooms(lattice, room_of_cell, regions), notes if is_divided else [])


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
