"""Convert a generated home to a floor plan."""

from collections.abc import Sequence

import shapely

from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.rooms.doorways import DoorLine
from fleet2d.floorplan.synthetic.access import Gap
from fleet2d.floorplan.synthetic.generator import House
from fleet2d.floorplan.synthetic.geometry import OUTER_WALL, UNIT_M, WALL, Box, Wall

Rectangle = tuple[int, int, int, int]


def floor_plan(house: House, name: str, cell: float, source: str) -> FloorPlan:
    """Convert a generated home to a floor plan.

    Args:
        house: The home.
        name: The name of the plan.
        cell: Side of a grid cell [m].
        source: The source of the plan, for readers.
    """
    spaces = [_clear(box) for box in house.boxes]
    through = [_hole(gap) for gap in [*house.gaps, house.front_door]]
    doors = [_line(gap) for gap in house.gaps if gap.leaf is not None]
    doors.append(_line(house.front_door, "front_door"))
    return FloorPlan.build(
        name,
        _metres([*spaces, *through]),
        _regions(house),
        cell,
        source=source,
        entrance=_entrance(house.front_door),
        doorways=doors,
    )


def _clear(box: Box) -> Rectangle:
    return box.x0, box.y0, box.x1 - WALL, box.y1 - WALL


def _hole(gap: Gap) -> Rectangle:
    """Return the space of a passage, which is as deep as its wall."""
    near, far = _faces(gap.wall)
    if gap.wall.upright:
        return near, gap.low, far, gap.high
    return gap.low, near, gap.high, far


def _faces(wall: Wall) -> tuple[int, int]:
    """Return the coordinates of a wall's low and high face [units]."""
    if wall.second == -1:
        return wall.at - WALL, wall.at - WALL + OUTER_WALL
    if wall.first == -1:
        return wall.at - OUTER_WALL, wall.at
    return wall.at - WALL, wall.at


def _line(gap: Gap, name: str | None = None) -> DoorLine:
    """Return the doorway across a passage, in the middle of the wall."""
    middle = sum(_faces(gap.wall)) / 2
    ends: list[tuple[float, float]] = [(middle, gap.low), (middle, gap.high)]
    if not gap.wall.upright:
        ends = [(along, across) for across, along in ends]
    start, end = ((x * UNIT_M, y * UNIT_M) for x, y in ends)
    return DoorLine(start, end, name, bool(gap.leaf))


def _entrance(door: Gap) -> tuple[float, float]:
    """Return a place half a metre inside the front door [m]."""
    inside = door.wall.at - WALL - 10 if door.wall.second == -1 else door.wall.at + 10
    along = (door.low + door.high) // 2
    x, y = (inside, along) if door.wall.upright else (along, inside)
    return x * UNIT_M, y * UNIT_M


def _regions(house: House) -> list[LabelledRegion]:
    """Return the rooms up to the middle of their walls; the front door belongs to its room."""
    regions = []
    for index, brief in enumerate(house.briefs):
        shapes = [_to_middle(box) for box in house.boxes if box.room == index]
        wall = house.front_door.wall
        if house.boxes[max(wall.first, wall.second)].room == index:
            shapes.append(_hole(house.front_door))
        regions.append(LabelledRegion((brief.kind,), _metres(shapes)))
    return regions


def _to_middle(box: Box) -> Rectangle:
    half = WALL // 2
    return box.x0 - half, box.y0 - half, box.x1 - half, box.y1 - half


def _metres(sides: Sequence[Rectangle]) -> shapely.Polygon | shapely.MultiPolygon:
    """Return the union of rectangles [units] in metres."""
    union = shapely.union_all([shapely.box(*box) for box in sides])
    metres = shapely.transform(union, lambda xy: xy * UNIT_M)
    assert isinstance(metres, shapely.Polygon | shapely.MultiPolygon)
    return metres
