"""Corrections of rooms in a scenario: their names, types and outlines."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np
import shapely
from pydantic import Field, model_validator
from shapely import MultiPolygon, Polygon

from fleet2d.configuration.components import Settings
from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import Length
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.adjacency import doorway_segments
from fleet2d.floorplan.rooms.doorways import DoorLine, name_doorways
from fleet2d.floorplan.rooms.regions import LabelledRegion, Region, cells_in, snap_regions
from fleet2d.floorplan.rooms.room import Room, make_rooms
from fleet2d.floorplan.rooms.vocabulary import usual_type
from fleet2d.kernels import I64
from fleet2d.kernels.space import fill_from_neighbors


class RoomCorrection(Settings):
    """A room to name or retype, given by a place in it, or to draw anew, given by its corners.

    Attributes:
        at: A place in the room [x, y] [m].
        polygon: Corners of a room that takes this space from others.
        name: Its name; left out: unchanged, or numbered by its type.
        type: Its type, such as bedroom; left out: unchanged, or room.

    Example:
        >>> RoomCorrection(at=(2, 1), type="Kitchen").type
        'Kitchen'
    """

    at: tuple[Length, Length] | None = Field(default=None, examples=[[2.5, 1.0]])
    polygon: tuple[tuple[Length, Length], ...] | None = Field(
        default=None, examples=[[[0, 0], [4, 0], [4, 3]]]
    )
    name: str | None = Field(default=None, min_length=1)
    type: str | None = Field(default=None, min_length=1)

    @model_validator(mode="after")
    def _says_where_and_what(self) -> Self:
        if (self.at is None) == (self.polygon is None):
            raise problem("a room needs either 'at' (a point in it) or 'polygon' (its corners)")
        if self.at is not None and self.name is None and self.type is None:
            raise problem("a room at a place needs a name or a type to give it")
        if self.polygon is not None and not _shape(self.polygon).is_valid:
            raise problem(
                "polygon is not a valid outline: at least 3 corners, and no crossing sides"
            )
        return self


def correct_rooms(plan: FloorPlan, corrections: Sequence[RoomCorrection]) -> FloorPlan:
    """Return a plan with rooms renamed, retyped and drawn anew.

    Each correction applies to the rooms that those before it left. A room that loses all its cells
    is dropped.

    Args:
        plan: The plan.
        corrections: In the order of the scenario.

    Raises:
        FloorPlanError: A place is in no room, a polygon holds no free cell, or two rooms would
            have one name.
    """
    if not corrections:
        return plan
    regions = [_as_region(room) for room in plan.rooms]
    painted = plan.room_of_cell.astype(np.int64)
    for number, correction in enumerate(corrections):
        where = f"floorplan.rooms[{number}]"
        if correction.polygon is not None:
            painted = _draw(plan, painted, correction, len(regions), where)
            types = (usual_type(correction.type),) if correction.type else ()
            regions.append(Region(types, Polygon(), correction.name, None if types else "room"))
        else:
            index = _region_at(plan, painted, correction, where)
            regions[index] = _rename(regions[index], correction)
    room_of_cell, rooms = make_rooms(plan.lattice, painted, regions)
    room_of_cell.setflags(write=False)
    segments = doorway_segments(plan.lattice, plan.doorways)
    return replace(
        plan,
        room_of_cell=room_of_cell,
        rooms=rooms,
        doorways=name_doorways(
            plan.lattice,
            fill_from_neighbors(room_of_cell),
            [room.name for room in rooms],
            [(line, segments[k]) for k, line in enumerate(_door_lines(plan))],
        ),
    )


def _shape(corners: Sequence[tuple[float, float]]) -> Polygon:
    return Polygon(corners) if len(corners) >= 3 else Polygon([(0, 0), (1, 1), (0, 0)])


def _make_valid(shape: Polygon | MultiPolygon) -> MultiPolygon:
    """Return the polygons of a shape, which may cross itself since it was rounded."""
    parts = shapely.get_parts(shapely.make_valid(shape))
    return MultiPolygon([part for part in parts if part.geom_type == "Polygon"])


def _as_region(room: Room) -> Region:
    return Region(room.labels, Polygon(), room.name, room.type)


def _rename(region: Region, correction: RoomCorrection) -> Region:
    """Return a region with another name or type; a name of type and number follows the type."""
    if correction.type is None:
        return replace(region, name=correction.name)
    kind = usual_type(correction.type)
    is_numbered = region.name is not None and region.name.rpartition("_")[0] == region.type
    name = correction.name or (None if is_numbered and kind != region.type else region.name)
    return Region((kind,), region.shape, name, kind)


def _region_at(plan: FloorPlan, painted: I64, correction: RoomCorrection, where: str) -> int:
    """Return the index of the region that holds the place of a correction."""
    x, y = correction.at or (0.0, 0.0)
    row, column = plan.lattice.cell_of(*plan.lattice.point_at((x, y)))
    if 0 <= row < plan.lattice.rows and 0 <= column < plan.lattice.columns:
        index = int(fill_from_neighbors(painted.astype(np.int16))[row, column])
        if index >= 0:
            return index
    near_x, near_y = plan.nearest_free(x, y)
    raise FloorPlanError(
        f"{where}: ({x:g}, {y:g}) m is in no room of {plan.name}: the nearest free place is"
        f" ({near_x:.2f}, {near_y:.2f}) m"
    )


def _draw(plan: FloorPlan, painted: I64, correction: RoomCorrection, index: int, where: str) -> I64:
    """Return the regions of the cells, with those inside the polygon set to `index`."""
    shape = _shape(correction.polygon or ())
    (region,) = snap_regions(plan.lattice, [LabelledRegion((), shape)])
    patch = cells_in(plan.free, _make_valid(region.shape))
    if patch.cells == 0:
        x0, y0, x1, y1 = shape.bounds
        raise FloorPlanError(
            f"{where}: no free cell of {plan.name} is inside the polygon from ({x0:g}, {y0:g}) to"
            f" ({x1:g}, {y1:g}) m"
        )
    changed = painted.copy()
    changed[patch.window][patch.mask] = index
    return changed


def _door_lines(plan: FloorPlan) -> list[DoorLine]:
    """Return the doorways as lines; those named after their rooms get new names later."""
    lines = []
    for doorway in plan.doorways:
        joined = "-".join(plan.rooms[room].name for room in doorway.rooms)
        own = None if doorway.name.startswith(joined) else doorway.name
        lines.append(DoorLine(doorway.start, doorway.end, own, doorway.leaf))
    return lines
