"""Borders of rooms without a wall that are as narrow as a doorway."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString

from fleet2d.floorplan.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.mesh import Segment
from fleet2d.floorplan.rooms.doorways import (
    CENTRE,
    MIN_APART_M,
    DoorLine,
    border_cells,
    rooms_beside,
)
from fleet2d.kernels import I16, I64


def narrow_borders(
    lattice: Lattice,
    room_of_cell: I16,
    passages: Sequence[Segment],
    widths_m: tuple[float, float],
) -> list[DoorLine]:
    """Return lines along the borders of rooms without a wall that are as wide as a doorway.

    Args:
        lattice: Of the plan.
        room_of_cell: Room index of each cell, -1 where not free.
        passages: Doorways [lattice]; borders across them, or close to one between the same rooms,
            don't count.
        widths_m: Least and largest width of a doorway [m].
    """
    places: dict[tuple[int, int], list[I64]] = {}
    for axis in (0, 1):
        cells, pairs = border_cells(room_of_cell, axis)
        step = np.array([axis == 1, axis == 0], np.int64) * UNITS_PER_CELL
        first = cells[:, ::-1] * UNITS_PER_CELL + CENTRE
        for place, pair in zip(first + step // 2, np.sort(pairs, axis=1).tolist(), strict=True):
            places.setdefault((pair[0], pair[1]), []).append(place)
    apart = MIN_APART_M * lattice.units_per_m
    known = [
        (LineString(p), tuple(sorted(rooms_beside(lattice, room_of_cell, p)))) for p in passages
    ]
    lines = []
    for pair, points in sorted(places.items(), key=lambda item: item[0]):
        spots = shapely.points(np.array(points, np.float64))
        reach = shapely.union_all(shapely.buffer(spots, UNITS_PER_CELL * 0.75))
        for border in shapely.get_parts(reach).tolist():
            ends = np.array(points, np.float64)[shapely.intersects(border, spots)]
            away = ((ends[:, None] - ends) ** 2).sum(axis=2)
            start, end = np.unravel_index(int(away.argmax()), away.shape)
            line = LineString([ends[start], ends[end]])
            width = (line.length + UNITS_PER_CELL) / lattice.units_per_m
            is_known = any(
                line.distance(passage) < UNITS_PER_CELL
                or (rooms == pair and line.centroid.distance(passage.centroid) < apart)
                for passage, rooms in known
            )
            if widths_m[0] <= width <= widths_m[1] and not is_known and line.length > 0:
                (x0, y0), (x1, y1) = lattice.to_metres(ends[[start, end]]).tolist()
                lines.append(DoorLine((x0, y0), (x1, y1), leaf=False))
    return lines
