"""The `synthetic` floor plan: a home generated from a seed, its settings, and its floor plan."""

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field

from fleet2d.configuration.units import Length, Share, limited_to
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.rooms.doorways import DoorLine
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.homes.synthetic.generator import Gap, House, generate
from fleet2d.homes.synthetic.program import (
    LARGEST_M2,
    MAX_ROOMS_PER_TYPE,
    SMALLEST_M2,
    Style,
    Wishes,
)
from fleet2d.homes.synthetic.slicing import (
    OUTER_WALL,
    UNIT_M,
    UNITS_PER_M,
    WALL,
    Rectangle,
    Wall,
)


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
    """Return the rooms up to the middle of their walls; the front door belongs to its room.

    The living room also has the types of rooms that people need and the home lacks.
    """
    kinds = {brief.kind for brief in house.briefs}
    lacking = [kind for kind in ("bedroom", "kitchen") if kind not in kinds]
    regions = []
    half = WALL // 2
    for index, brief in enumerate(house.briefs):
        boxes = [box for box in house.boxes if box.room == index]
        shapes = [(b.x0 - half, b.y0 - half, b.x1 - half, b.y1 - half) for b in boxes]
        if house.room_inside(house.front_door.wall) == index:
            shapes.append(_hole(house.front_door))
        labels = (brief.kind, *lacking) if brief.kind == "living_room" else (brief.kind,)
        regions.append(LabelledRegion(labels, _metres(shapes), None, brief.kind))
    return regions


def _metres(sides: Sequence[Rectangle]) -> shapely.Polygon | shapely.MultiPolygon:
    """Return the union of rectangles [units] in metres."""
    union = shapely.union_all([shapely.box(*box) for box in sides])
    metres = shapely.transform(union, lambda xy: xy * UNIT_M)
    assert isinstance(metres, shapely.Polygon | shapely.MultiPolygon)
    return metres


def _free_space(
    house: House, regions: Sequence[LabelledRegion]
) -> shapely.Polygon | shapely.MultiPolygon:
    """Return the space of rooms and passages, without shafts [m]."""
    spaces = [(box.x0, box.y0, box.x1 - WALL, box.y1 - WALL) for box in house.boxes]
    air = _metres([*spaces, *(_hole(gap) for gap in [*house.gaps, house.front_door])])
    holes = [shapely.Polygon(ring) for part in shapely.get_parts(air) for ring in part.interiors]
    # No post stands where rectangles of one room meet.
    rooms = np.array([region.shape for region in regions])
    posts = [hole for hole in holes if shapely.covers(rooms, hole).any()]
    shafts = shapely.union_all([_metres([shaft]) for shaft in house.shafts])
    free = shapely.difference(shapely.union_all([air, *posts]), shafts)
    assert isinstance(free, shapely.Polygon | shapely.MultiPolygon)
    return free


_CorridorWidth = Annotated[Length, limited_to(lambda m: 0.9 <= m <= 2, "a width of 0.9 m to 2 m")]
_DoorWidth = Annotated[Length, limited_to(lambda m: 0.7 <= m <= 1.2, "a width of 0.7 m to 1.2 m")]


class Synthetic(FloorPlanSource):
    """A generated home; the same configuration is the same home on every machine.

    Attributes:
        seed: The seed of the home.
        area_m2: Free space, 18 to 450 m2; below 30 m2 a studio, whose living room is the bedroom.
        bedrooms: Number of bedrooms, 1 to 8.
        bathrooms: Number of bathrooms, 1 to 6.
        garage: Whether it has one.
        outline: The shape of the home.
        open_plan: Whether living, dining and kitchen are open to each other.
        corridor_width: Clear width of hallways, 0.9 m to 2 m, rounded to 5 cm.
        door_width: Width of doors between rooms, 0.7 m to 1.2 m, rounded to 5 cm.
        variety: How much rooms and their links differ from the usual ones.

    Example:
        >>> plan = Synthetic(seed=7, area_m2=120, bedrooms=3).load()
        >>> len(plan.rooms_of_type("bedroom")), plan.room("kitchen_1").type
        (3, 'kitchen')
    """

    seed: int = Field(default=0, ge=0)
    area_m2: float | None = Field(default=None, ge=SMALLEST_M2, le=LARGEST_M2)
    bedrooms: int | None = Field(default=None, ge=1, le=MAX_ROOMS_PER_TYPE)
    bathrooms: int | None = Field(default=None, ge=1, le=6)
    garage: bool | None = None
    outline: Literal["rectangle", "L", "T", "U"] | None = None
    open_plan: bool | None = None
    corridor_width: _CorridorWidth | None = None
    door_width: _DoorWidth | None = None
    variety: Share = 0.0

    def load(self) -> FloorPlan:
        """Generate the home.

        Raises:
            FloorPlanError: The settings contradict each other.
        """
        wishes = Wishes(self.area_m2, self.bedrooms, self.bathrooms, self.garage)
        sizes = (self.corridor_width, self.door_width)
        corridor, door = (None if m is None else int(m * UNITS_PER_M + 0.5) for m in sizes)
        percent = round(self.variety * 100)
        style = Style(self.outline, self.open_plan, corridor, door, percent)
        house = generate(self.seed, wishes, style)
        regions = _regions(house)
        doors = [_line(gap) for gap in house.gaps if gap.leaf is not None]
        return FloorPlan.build(
            f"synthetic_{self.seed}",
            _free_space(house, regions),
            regions,
            self.cell,
            source=f"synthetic home, seed {self.seed}",
            entrance=_entrance(house.front_door),
            doorways=[*doors, _line(house.front_door, "front_door")],
            scale=self.scale,
        )
