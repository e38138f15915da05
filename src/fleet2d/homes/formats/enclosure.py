"""What walls enclose: the space within them, what rooms leave of it, and the gaps in walls."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import shapely
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.homes.formats.passages import MAX_WALL_M, TOUCH_M
from fleet2d.kernels import F64

# Widths of gaps in walls that are closed in turn to find what they enclose [m], none of them that
# of usual doors, and the share of the largest space that it must keep.
GAPS_M = (0.0, 0.05, 0.2, 0.53, 1.07, 1.43)
KEPT_SHARE = 0.97
# The share of the outlines of rooms, or of where they touch, along which a file that draws walls
# has some.
DRAWN_SHARE = 1 / 3
DRAWN_BORDER_SHARE = 1 / 2
# Widths of a gap in a wall that is a way [m]: people fit through, and wider outside is no doorway.
LEAST_WAY_M = 0.5
WIDEST_FRONT_DOOR_M = 1.3
# The part of its rectangle that a straight gap fills, and of its sides that walls and rooms touch.
STRAIGHT_SHARE = 0.85
SIDE_SHARE = 0.5
# The narrowest space, and the smallest, that is more than a gap in a wall.
NARROW_M = 0.5
LEAST_M2 = 0.5


def multi(shape: BaseGeometry) -> MultiPolygon:
    """Return the areas of a shape."""
    return MultiPolygon(parts_of(shape))


def parts_of(shape: BaseGeometry) -> list[Polygon]:
    """Return the polygons of a shape."""
    return [part for part in shapely.get_parts(shape).tolist() if part.geom_type == "Polygon"]


def grown(shape: BaseGeometry, by: float) -> BaseGeometry:
    """Return a shape grown by a length, or shrunk by a negative one, with its corners kept."""
    with np.errstate(invalid="ignore"):  # GEOS divides by zero at corners in line, without harm
        return shape.buffer(by, join_style="mitre")


def opened(shape: BaseGeometry, width: float) -> BaseGeometry:
    """Return the part of an area that is at least as wide [m]."""
    return grown(grown(shape, -width / 2), width / 2).intersection(shape)


def enclosed_space(
    walls: BaseGeometry, doors: Iterable[BaseGeometry], notes: list[str]
) -> MultiPolygon:
    """Return the space within walls and doors, with gaps closed that would lose most of it.

    Args:
        walls: The walls [m]; what they cover isn't left out.
        doors: Doors, at which walls may have gaps [m].
        notes: A note is added if gaps are closed.
    """
    shut = shapely.union_all([walls, *(door.buffer(GAPS_M[1]) for door in doors)])
    outlines = []
    for gap in GAPS_M:
        solid = parts_of(grown(shut, gap / 2))
        shells = [Polygon(part.exterior) for part in solid if part.interiors]
        whole = grown(shapely.union_all(shells), -gap / 2)
        outlines.append((whole, gap))
    most = max(float(whole.area) for whole, _ in outlines)
    whole, gap = next((w, g) for w, g in outlines if w.area >= KEPT_SHARE * most)
    if gap > 0 and most > 0:
        notes.append(f"gaps in the walls are closed up to {gap:g} m to find the inside")
    return multi(whole)


def outer_gaps(walls: BaseGeometry, whole: MultiPolygon) -> list[Polygon]:
    """Return the gaps in outer walls, each as a straight piece of wall between its two ends.

    Args:
        walls: The walls [m].
        whole: What they enclose, with gaps closed.
    """
    pieces = []
    rims = shapely.get_parts(whole.boundary.difference(walls.buffer(TOUCH_M / 2))).tolist()
    for rim in rims:
        if rim.is_empty:
            continue
        ends = shapely.get_coordinates(rim)[[0, -1]]
        width = float(np.hypot(*(ends[1] - ends[0])))
        if width < LEAST_WAY_M / 2:
            continue
        along = (ends[1] - ends[0]) / width
        normal = np.array([-along[1], along[0]])
        middle = ends.mean(axis=0)
        if not whole.intersects(shapely.Point(middle + TOUCH_M * normal)):
            normal = -normal
        depths = [_depth(walls, end, normal) for end in _beyond(ends, along)]
        depth = min([d for d in depths if 0 < d < MAX_WALL_M], default=TOUCH_M)
        wide = _beyond(ends, along)  # up to the walls, from which the rim was cut
        corners = [wide[0] - TOUCH_M * normal, wide[1] - TOUCH_M * normal]
        corners += [wide[1] + depth * normal, wide[0] + depth * normal]
        pieces.append(Polygon(corners))
    return pieces


def _beyond(ends: F64, along: F64) -> F64:
    """Return the ends of a gap, moved a little into the walls on both sides."""
    return ends + np.stack([-along, along]) * TOUCH_M


def _depth(walls: BaseGeometry, start: F64, normal: F64) -> float:
    """Return how thick the wall is that begins at a place [m]."""
    across = LineString([start + TOUCH_M * normal / 2, start + 2 * MAX_WALL_M * normal])
    inside = shapely.get_parts(across.intersection(walls)).tolist()
    near = [part for part in inside if part.distance(shapely.Point(start)) < TOUCH_M]
    return max((float(part.length) for part in near), default=0.0) + TOUCH_M / 2


def draws_walls(
    walls: BaseGeometry,
    rooms: Sequence[MultiPolygon],
    borders: Sequence[LineString],
    wall_m: float,
) -> bool:
    """Return whether a file that has rooms draws all walls that there are, too.

    Args:
        walls: The walls [m].
        rooms: The rooms.
        borders: The lines along which rooms touch.
        wall_m: Thickness of walls that are drawn as lines.
    """
    if walls.is_empty:
        return False
    near = grown(walls, TOUCH_M + wall_m / 2)
    outlines = shapely.union_all([room.boundary for room in rooms])
    touching = shapely.union_all(borders)
    return bool(
        outlines.intersection(near).length >= DRAWN_SHARE * outlines.length
        or touching.intersection(near).length >= max(DRAWN_BORDER_SHARE * touching.length, TOUCH_M)
    )


def within_walls(room: MultiPolygon, walls: BaseGeometry, whole: BaseGeometry) -> MultiPolygon:
    """Return a room without the walls, and without what these part from it outside.

    Args:
        room: The room as drawn [m].
        walls: The walls.
        whole: What they enclose.
    """
    pieces = parts_of(room.difference(walls))
    largest = max(pieces, key=lambda piece: piece.area, default=None)
    kept = [
        piece
        for piece in pieces
        if piece is largest or piece.intersection(whole).area >= piece.area / 2
    ]
    return MultiPolygon(kept)


def unnamed_space(walls: BaseGeometry, rooms: Sequence[MultiPolygon]) -> list[Polygon]:
    """Return the spaces that walls and rooms surround, and that are in no room.

    Gaps in the wall between two rooms are left out.
    """
    solid = shapely.union_all([walls, *rooms])
    holes = [Polygon(ring) for part in parts_of(solid) for ring in part.interiors]
    spaces = parts_of(opened(shapely.union_all(holes).difference(solid), 2 * TOUCH_M))

    def is_gap(space: Polygon) -> bool:
        is_narrow = opened(space, NARROW_M).is_empty
        return is_narrow and sum(room.distance(space) <= TOUCH_M for room in rooms) != 1

    return [space for space in spaces if space.area >= LEAST_M2 and not is_gap(space)]


def wall_gaps(walls: BaseGeometry, rooms: Sequence[MultiPolygon]) -> Iterator[LineString]:
    """Yield the gaps in walls beside rooms that are ways, each as the line from jamb to jamb.

    A gap is straight, at most as thick as a wall, with walls at its two ends; on one side or both
    is a room.

    Args:
        walls: The walls [m].
        rooms: The rooms, without the walls.
    """
    solid = shapely.union_all([walls, *rooms])
    closed = grown(grown(solid, WIDEST_FRONT_DOOR_M / 2), -WIDEST_FRONT_DOOR_M / 2)
    inner = shapely.union_all(rooms)
    for piece in parts_of(opened(closed.difference(solid), TOUCH_M)):  # no slivers along walls
        box = piece.minimum_rotated_rectangle
        if box.area == 0 or piece.area < STRAIGHT_SHARE * box.area:
            continue
        corners = shapely.get_coordinates(box)[:4]
        sides = [LineString([corners[k], corners[(k + 1) % 4]]) for k in range(4)]
        at_walls = [_share_beside(side, walls) for side in sides]
        at_rooms = [_share_beside(side, inner) for side in sides]
        for k in (0, 1):
            width = sides[k].length
            depth = sides[k + 1].length
            is_between = min(at_walls[k + 1], at_walls[(k + 3) % 4]) >= SIDE_SHARE
            is_at_room = max(at_rooms[k], at_rooms[k + 2]) >= SIDE_SHARE
            is_thin = TOUCH_M < depth <= MAX_WALL_M and width >= LEAST_WAY_M
            if is_between and is_at_room and is_thin:
                yield LineString([sides[k + 1].centroid, sides[(k + 3) % 4].centroid])
                break


def _share_beside(side: LineString, shape: BaseGeometry) -> float:
    """Return the share of a line that lies along a shape."""
    near = side.intersection(shape.buffer(TOUCH_M))
    return float(near.length) / max(side.length, TOUCH_M)
