"""Doorways: passages between rooms, their walls, and the links that they make between rooms."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon

from fleet2d.floorplan.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.mesh import Segment, cross_products
from fleet2d.floorplan.placed_objects import Point
from fleet2d.kernels import F64, I16, I64, Bool

# How far beyond the end of a door line its wall may be [m].
REACH_M = 0.3
MIN_APART_M = 0.5
"""Passages with middles nearer than this are the two sides of one wall."""
# A line that meets a wall within this distance of a corner ends at the corner [lattice].
CORNER_DISTANCE = 8
# Distances from a door line at which the rooms on its two sides are looked up [m].
BESIDE_M = (0.1, 0.2, 0.3, 0.45, 0.6)
# DE-9IM pattern of a line and an area: the line lies in the area, with its ends on the border.
_FROM_WALL_TO_WALL = "1FFF0F***"
# DE-9IM pattern of a wall of which at most the ends meet something.
_INSIDE_APART = "FF*******"


@dataclass(frozen=True)
class DoorLine:
    """A doorway in a file, or from a search: a line across a passage.

    Attributes:
        start: One jamb (x, y) [m], on a wall or near one.
        end: The other jamb (x, y) [m].
        name: Its name, or None to be named after the rooms that it joins.
        leaf: Whether there is a door in it that can be shut; False for a mere opening.
    """

    start: Point
    end: Point
    name: str | None = None
    leaf: bool = True


@dataclass(frozen=True)
class Doorway:
    """A passage between two rooms, from wall to wall.

    Attributes:
        index: Its number in the plan.
        name: Unique in the plan, such as `bathroom_1-hallway_1`.
        start: One jamb (x, y) [m], exactly on a wall.
        end: The other jamb (x, y) [m].
        rooms: Indices of the rooms on its left and its right, looking from start to end; equal if
            it stands in the middle of a room.
        leaf: Whether there is a door in it that can be shut; False for a mere opening.
    """

    index: int
    name: str
    start: Point
    end: Point
    rooms: tuple[int, int]
    leaf: bool

    @property
    def width_m(self) -> float:
        """Distance between the jambs [m]."""
        (x0, y0), (x1, y1) = self.start, self.end
        return float(((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5)


def fit_lines(
    lattice: Lattice, polygons: Sequence[Polygon], lines: Sequence[DoorLine]
) -> tuple[list[Polygon], list[Segment | None], list[str]]:
    """Fit door lines to the walls, exactly.

    A line is lengthened or cut to end at the walls beside it. A slanted wall may have no lattice
    point there, so it gets a corner, less than a millimetre off.

    Args:
        lattice: Of the plan.
        polygons: Free space [lattice].
        lines: The doorways [m].

    Returns:
        The free space, with corners added; the segment of each line [lattice], or None where it
        stands in no passage; and a sentence for each such line.
    """
    walls = list(polygons)
    segments: list[Segment | None] = []
    notes: list[str] = []
    placed: list[LineString] = []
    for line in lines:
        ends = lattice.to_lattice((line.start, line.end)).astype(np.float64)
        fitted = _fit(walls, ends, REACH_M * lattice.units_per_m)
        if fitted is not None and not any(fitted[1].intersects(other) for other in placed):
            walls = fitted[0]
            placed.append(fitted[1])
            start, end = shapely.get_coordinates(fitted[1]).astype(np.int64).tolist()
            segments.append(((start[0], start[1]), (end[0], end[1])))
            continue
        (x0, y0), (x1, y1) = line.start, line.end
        name = f" {line.name}" if line.name else ""
        why = "touches another one"
        advice = ""
        if fitted is None:
            why = "ends at no wall"
            advice = _missing_corner(lattice, walls, ends)
        notes.append(
            f"the doorway{name} from ({x0:.2f}, {y0:.2f}) to ({x1:.2f}, {y1:.2f}) m {why}: left"
            f" out{advice}"
        )
        segments.append(None)
    return walls, segments, notes


def _missing_corner(lattice: Lattice, walls: Sequence[Polygon], ends: F64) -> str:
    """Return a hint at the wall in which a corner is likely missing, if a line ends at no wall."""
    middle = shapely.Point(ends.mean(axis=0))
    is_free = any(shapely.intersects(wall, middle) for wall in walls)
    places = [shapely.Point(end) for end in ends] if is_free else [middle]
    rings = [shapely.get_coordinates(ring) for wall in walls for ring in shapely.get_rings(wall)]
    sides = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    lines = np.asarray(shapely.linestrings(sides))
    away = np.array([shapely.distance(lines, place) for place in places])
    worst = int(np.argmax(away.min(axis=1)))
    (ax, ay), (bx, by) = lattice.to_metres(sides[int(np.argmin(away[worst]))]).tolist()
    wall = f"from ({ax:.2f}, {ay:.2f}) to ({bx:.2f}, {by:.2f}) m"
    if not is_free:
        return f"; no free space leads through it: corners of the passage may be missing {wall}"
    metres = float(away[worst].min()) / lattice.units_per_m
    x, y = lattice.to_metres(shapely.get_coordinates(places[worst])[0]).tolist()
    return f"; ({x:.2f}, {y:.2f}) is {metres:.2f} m from the wall {wall}: a corner may be missing"


def name_doorways(
    lattice: Lattice,
    room_of_place: I16,
    room_names: Sequence[str],
    fitted: Sequence[tuple[DoorLine, Segment]],
) -> tuple[Doorway, ...]:
    """Return the doorways of fitted lines, with the rooms that they join and names.

    Args:
        lattice: Of the plan.
        room_of_place: Room index of each cell, -1 inside walls.
        room_names: By room index.
        fitted: The lines, and where they are [lattice].
    """
    doorways: list[Doorway] = []
    own_names = {line.name for line, _ in fitted if line.name}
    used: Counter[str] = Counter()
    for line, segment in fitted:
        rooms = rooms_beside(lattice, room_of_place, segment)
        name = line.name
        while name is None or (not line.name and name in own_names):
            joined = "-".join(room_names[room] for room in rooms)
            used[joined] += 1
            name = joined if used[joined] == 1 else f"{joined}-{used[joined]}"
        (x0, y0), (x1, y1) = lattice.to_metres(segment).tolist()
        doorways.append(Doorway(len(doorways), name, (x0, y0), (x1, y1), rooms, line.leaf))
    return tuple(doorways)


def _fit(walls: list[Polygon], ends: F64, reach: float) -> tuple[list[Polygon], LineString] | None:
    """Return the walls and the line from wall to wall, or None where there is no such line."""
    middle = ends.mean(axis=0)
    along = ends[1] - ends[0]
    length = float(np.sqrt(along @ along))
    if length == 0:
        return None
    index = next((i for i, p in enumerate(walls) if shapely.intersects_xy(p, *middle)), None)
    if index is None:
        return None
    far = (0.5 + reach / length) * along
    outline = shapely.get_coordinates(shapely.get_rings(walls[index]), return_index=True)
    jambs = [
        _jamb(*outline, middle, end, middle + side * far)
        for end, side in zip(ends, (-1, 1), strict=True)
    ]
    if jambs[0] is None or jambs[1] is None or jambs[0] == jambs[1]:
        return None
    line = LineString([jambs[0], jambs[1]])
    polygon = walls[index]
    stays_valid = len(walls) == 1
    for jamb in jambs:
        polygon, is_alone = _with_corner(polygon, np.array(jamb, np.float64))
        stays_valid &= is_alone
    changed = [*walls[:index], polygon, *walls[index + 1 :]]
    is_sound = polygon is walls[index] or stays_valid or shapely.MultiPolygon(changed).is_valid
    if not is_sound or not shapely.relate_pattern(line, polygon, _FROM_WALL_TO_WALL):
        return None
    return changed, line


def _jamb(corners: F64, ring_of: I64, start: F64, end: F64, far: F64) -> tuple[int, int] | None:
    """Return the even lattice point where the way from `start` by `end` to `far` meets a wall.

    A way that passes beside the corner at `end`, as along a slanted wall, ends there.

    Args:
        corners: The corners of all rings of the polygon, float64 (n, 2).
        ring_of: The ring of each, int64 (n,).
        start: The middle of the doorway.
        end: Its end.
        far: The farthest point at which it may end.
    """
    begins = corners[:-1]
    ends = corners[1:]
    least = np.minimum(start, far)
    most = np.maximum(start, far)
    low = np.minimum(begins, ends)
    high = np.maximum(begins, ends)
    is_near = ((low <= most) & (high >= least)).all(axis=1)
    is_near &= ring_of[:-1] == ring_of[1:]
    hits = _crossings(begins[is_near], ends[is_near], start, far)
    nearest = end
    if len(hits):
        squared = ((hits - start) ** 2).sum(axis=1)
        nearest = hits[squared.argmin()]
    away = np.maximum(*np.abs(corners - nearest).T)
    if away.min() <= CORNER_DISTANCE:
        x, y = corners[np.argmin(away)].tolist()
    elif len(hits) == 0:
        return None
    else:
        x, y = (2 * np.rint(nearest / 2)).tolist()
    return int(x), int(y)


def _crossings(begins: F64, ends: F64, start: F64, far: F64) -> F64:
    """Return where the way from `start` to `far` meets walls whose boxes overlap its own."""
    is_level = start == far
    if is_level.any() and (begins == ends)[:, ~is_level].all():
        # The way is parallel to an axis, and all walls are at a right angle to it.
        return np.where(is_level, start, begins)
    sides = shapely.linestrings(np.stack([begins, ends], axis=1))
    return shapely.get_coordinates(shapely.intersection(sides, LineString([start, far])))


def _with_corner(polygon: Polygon, point: F64) -> tuple[Polygon, bool]:
    """Return the polygon with a corner at a point on or beside one of its walls.

    It is added even if the point is on the wall, since another corner might move that wall.

    Returns:
        The polygon, and whether the wall moved over no other wall. If so, the polygon is as valid
        as before; to find that out from the whole polygon takes long.
    """
    rings = shapely.get_rings(polygon)
    corners, ring_of = shapely.get_coordinates(rings, return_index=True)
    if (corners == point).all(axis=1).any():
        return polygon, True
    first = np.flatnonzero(ring_of[:-1] == ring_of[1:])  # a wall goes from a corner to the next
    sides = np.stack([corners[first], corners[first + 1]], axis=1)
    low = sides.min(axis=1)
    high = sides.max(axis=1)

    def walls_near(least: F64, most: F64) -> I64:
        return np.flatnonzero(((low <= most) & (high >= least)).all(axis=1))

    beside = walls_near(point - CORNER_DISTANCE, point + CORNER_DISTANCE)
    beside = beside if len(beside) else np.arange(len(sides))
    wall = _wall_through(low, high, beside, point)
    if wall is not None:
        return _with_inserted(rings, corners, ring_of, int(first[wall]), point), True
    lines = shapely.linestrings(sides[beside])
    wall = int(beside[np.argmin(shapely.distance(lines, shapely.Point(point)))])
    ends = sides[wall]
    moved = np.concatenate([ends, [point]])
    swept = shapely.convex_hull(shapely.multipoints(moved))
    others = walls_near(moved.min(axis=0), moved.max(axis=0))
    others = others[others != wall]
    loose = sides[others].reshape(-1, 2)
    loose = loose[~(loose[:, None] == ends).all(axis=2).any(axis=1)]
    along = ends[1] - ends[0]
    is_alone = (
        0 < (point - ends[0]) @ along < along @ along  # a point beyond its ends makes a spike
        and shapely.relate_pattern(shapely.linestrings(sides[others]), swept, _INSIDE_APART).all()
        and not shapely.intersects(shapely.points(loose), swept).any()
    )
    return _with_inserted(rings, corners, ring_of, int(first[wall]), point), bool(is_alone)


def _wall_through(low: F64, high: F64, beside: I64, point: F64) -> int | None:
    """Return the wall along an axis that a point is on, if it meets only the two next to it.

    Args:
        low: Least x and y of each wall, float64 (n, 2).
        high: Greatest x and y.
        beside: Walls near the point.
        point: The point (x, y).
    """
    on = beside[((low[beside] <= point) & (point <= high[beside])).all(axis=1)]
    if len(on) != 1 or (low[on] < high[on]).sum() != 1:
        return None
    meets = ((low <= high[on]) & (high >= low[on])).all(axis=1)
    return int(on[0]) if meets.sum() == 3 else None


def _with_inserted(
    rings: NDArray[np.object_], corners: F64, ring_of: I64, before: int, point: F64
) -> Polygon:
    """Return the polygon of some rings with a further corner after one of theirs."""
    number = ring_of[before]
    place = before + 1 - np.searchsorted(ring_of, number)
    rings[number] = shapely.linearrings(np.insert(corners[ring_of == number], place, point, axis=0))
    return shapely.polygons(rings[0], rings[1:])


def rooms_beside(lattice: Lattice, room_of_place: I16, segment: Segment) -> tuple[int, int]:
    """Return the rooms to the left and to the right of a segment, the nearest that differ."""
    (x0, y0), (x1, y1) = segment
    dx, dy = x1 - x0, y1 - y0
    length = (dx * dx + dy * dy) ** 0.5
    sides: list[int] = []
    for side in (1, -1):
        room = -1
        for step in BESIDE_M:
            reach = side * step * lattice.units_per_m / length
            x = round((x0 + x1) / 2 - dy * reach)
            y = round((y0 + y1) / 2 + dx * reach)
            row, column = lattice.cell_of(x, y)
            if 0 <= row < lattice.rows and 0 <= column < lattice.columns:
                other = int(room_of_place[row, column])
                room = other if room < 0 else room
                if other >= 0 and sides and room == sides[0]:
                    room = other
        sides.append(room)
    left, right = sides
    if left < 0 or right < 0:
        left = right = max(left, right, 0)
    return left, right


CENTRE = UNITS_PER_CELL // 2 + 1
"""Offset of the middle of a cell from its lower left corner [lattice]."""
# Minimum length of an open border [cells]; a shorter one is an artifact of the cells at walls.
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
        cells, pairs = border_cells(room_of_cell, axis)
        step = np.array([axis == 1, axis == 0], np.int64) * UNITS_PER_CELL
        first = cells[:, ::-1] * UNITS_PER_CELL + CENTRE
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


def border_cells(rooms: I16, axis: int) -> tuple[I64, I64]:
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
        return np.sign(cross_products(direction, point - origin))

    meets_line = side(start, along, first) * side(start, along, first + step) <= 0
    meets_segment = side(first, step, start) * side(first, step, start + along) <= 0
    return meets_line & meets_segment
