"""The facts of a home that the page draws."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from fleet2d.floorplan.lattice import UNITS_PER_CELL
from fleet2d.floorplan.objects import PlacedObject
from fleet2d.floorplan.plan import FloorPlan, Room, rings
from fleet2d.kernels import I16
from fleet2d.kernels.space import Mesh
from fleet2d.palette import deep_color, room_color
from fleet2d.viewer.facts.contract import (
    DoorFacts,
    HomeFacts,
    ObjectFacts,
    Point,
    RoomFacts,
    WallsFacts,
)

DIGITS = 4  # tenths of a millimetre


def home_facts(plan: FloorPlan, doors: Sequence[DoorFacts] = ()) -> HomeFacts:
    """Return the facts of a floor plan.

    Args:
        plan: The floor plan.
        doors: The doors in its doorways.
    """
    lattice = plan.lattice
    origin = np.rint(np.asarray(lattice.origin) / lattice.cell).astype(int) * UNITS_PER_CELL
    return HomeFacts(
        name=plan.name,
        cell=lattice.cell,
        origin_units=(int(origin[0]), int(origin[1])),
        units_per_m=lattice.units_per_m,
        columns=lattice.columns,
        rows=lattice.rows,
        bounds=plan.bounds,
        area_m2=plan.area_m2,
        free=[
            [points(lattice.to_metres(shapely.get_coordinates(ring)[:-1])) for ring in rings(part)]
            for part in plan.polygons
        ],
        rooms=[_room_facts(room) for room in plan.rooms],
        room_cells=runs_of(plan.room_of_cell),
        place_cells=runs_of(plan.room_of_place),
        doorways=[(d.start, d.end) for d in plan.doorways],
        doors=list(doors),
        objects=[object_facts(item) for item in plan.objects],
        no_go=[points(shapely.get_coordinates(area.exterior)[:-1]) for area in plan.no_go],
        entrance=plan.entrance,
    )


def object_facts(item: PlacedObject) -> ObjectFacts:
    """Return the facts of a piece of furniture."""
    outline = shapely.get_coordinates(item.footprint.exterior)[:-1]
    return ObjectFacts(name=item.name, type=item.type, outline=points(outline), blocks=item.blocks)


def walls_facts(mesh: Mesh) -> WallsFacts:
    """Return the walls that block sight."""
    return WallsFacts(
        vertices=mesh.vertices.ravel().tolist(),
        triangles=mesh.triangles.ravel().tolist(),
        neighbors=mesh.neighbors.ravel().tolist(),
    )


def runs_of(cells: I16) -> list[int]:
    """Return cells as pairs (value, number of cells), row by row.

    >>> runs_of(np.array([[1, 1], [1, 2]], np.int16))
    [1, 3, 2, 1]
    """
    flat = cells.ravel()
    ends = np.append(np.flatnonzero(np.diff(flat)) + 1, len(flat))
    pairs = np.stack([flat[ends - 1].astype(np.int64), np.diff(ends, prepend=0)], axis=1)
    return pairs.ravel().tolist()


def points(coordinates: NDArray[Any]) -> list[Point]:
    """Return points, float64 (n, 2) [m], as pairs rounded to 0.1 mm."""
    return [(x, y) for x, y in np.round(coordinates, DIGITS).tolist()]


def _room_facts(room: Room) -> RoomFacts:
    return RoomFacts(
        name=room.name,
        type=room.type,
        color=room_color(room.type),
        deep_color=deep_color(room.type),
        anchor=room.anchor_xy,
        area_m2=room.area_m2,
    )
