"""Doorways: passages between rooms, where a door may hang."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import LineString, Polygon

from fleet2d.floorplan.geometry.gates import Segment
from fleet2d.floorplan.geometry.lattice import Lattice
from fleet2d.floorplan.objects import Point
from fleet2d.kernels import F64, I16

# How far beyond the end of a door line its wall may be [m].
REACH_M = 0.3
# A line that meets a wall within this distance of a corner ends at the corner [lattice].
CORNER_DISTANCE = 8
# Distances from a door line at which the rooms on its two sides are looked up [m].
BESIDE_M = (0.1, 0.2, 0.3, 0.45, 0.6)
# DE-9IM pattern of a line and an area: the line lies in the area, with its ends on the border.
_FROM_WALL_TO_WALL = "1FFF0F***"


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
        name: Unique in the plan, such as `bathroom_0-hallway_0`.
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
        why = "ends at no wall" if fitted is None else "touches another one"
        notes.append(
            f"the doorway{name} from ({x0:.2f}, {y0:.2f}) to ({x1:.2f}, {y1:.2f}) m {why}: left out"
        )
        segments.append(None)
    return walls, segments, notes


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
    middle, along = ends.mean(axis=0), ends[1] - ends[0]
    length = float(np.sqrt(along @ along))
    if length == 0:
        return None
    index = next((i for i, p in enumerate(walls) if shapely.intersects_xy(p, *middle)), None)
    if index is None:
        return None
    far = (0.5 + reach / length) * along
    jambs = [_jamb(walls[index], middle, middle + side * far) for side in (-1, 1)]
    if jambs[0] is None or jambs[1] is None or jambs[0] == jambs[1]:
        return None
    line = LineString([jambs[0], jambs[1]])
    polygon = walls[index]
    for jamb in jambs:
        polygon = _with_corner(polygon, np.array(jamb, np.float64))
    changed = [*walls[:index], polygon, *walls[index + 1 :]]
    sound = polygon is walls[index] or shapely.MultiPolygon(changed).is_valid
    if not sound or not shapely.relate_pattern(line, polygon, _FROM_WALL_TO_WALL):
        return None
    return changed, line


def _jamb(polygon: Polygon, start: F64, end: F64) -> tuple[int, int] | None:
    """Return the even lattice point where the way from `start` to `end` first meets a wall."""
    hits = shapely.get_coordinates(shapely.intersection(polygon.boundary, LineString([start, end])))
    if len(hits) == 0:
        return None
    nearest = hits[np.argmin(((hits - start) ** 2).sum(axis=1))]
    corners = shapely.get_coordinates(polygon)
    away = np.abs(corners - nearest).max(axis=1)
    if away.min() <= CORNER_DISTANCE:
        x, y = corners[np.argmin(away)].tolist()
    else:
        x, y = (2 * np.rint(nearest / 2)).tolist()
    return int(x), int(y)


def _with_corner(polygon: Polygon, point: F64) -> Polygon:
    """Return the polygon with a corner at a point on or beside one of its walls.

    It is added even if the point is on the wall, since another corner might move that wall.
    """
    if (shapely.get_coordinates(polygon) == point).all(axis=1).any():
        return polygon
    rings = [np.asarray(ring.coords) for ring in (polygon.exterior, *polygon.interiors)]
    walls = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    after = int(np.argmin(shapely.distance(shapely.linestrings(walls), shapely.Point(point))))
    number = 0
    while after >= len(rings[number]) - 1:
        after -= len(rings[number]) - 1
        number += 1
    rings[number] = np.insert(rings[number], after + 1, point, axis=0)
    return Polygon(rings[0], rings[1:])


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
            x, y = round((x0 + x1) / 2 - dy * reach), round((y0 + y1) / 2 + dx * reach)
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
