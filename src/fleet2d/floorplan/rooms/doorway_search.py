"""Find the passages of a floor plan: where the way between two walls is short, and opens out.

A passage is a line from a corner of a wall to another corner, or to the nearest point of a wall,
that can't be made shorter by moving its ends: where the clearance to the walls has a local minimum.
These are the critical lines of Thrun, "Learning metric-topological maps for indoor mobile robot
navigation" (Artificial Intelligence 99, 1998), found on the walls themselves instead of on a grid.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from fleet2d.floorplan.rooms.doorways import Segment
from fleet2d.kernels.chambers import see_each
from fleet2d.kernels.mesh import Mesh

I64 = NDArray[np.int64]
F64 = NDArray[np.float64]

MIN_DOOR_M, MAX_DOOR_M = 0.5, 1.4
"""Widths of doorways: a person doesn't get through less, and double doors end at about that."""
MAX_OPENING_M = 2.8
"""The widest opening that still parts two rooms, as between a kitchen and where one eats."""
LEAN = 0.2
"""How far a passage may lean: sine of the angle between it and the shortest. Traced walls do."""
OFFSETS_M = (0.15, 0.3, 0.45, 0.6)
"""How far behind a passage the space is looked at; the last is the thickest wall."""
WIDENINGS_M = (0.1, 0.2, 0.3, 0.45, 0.6, 0.8)
"""By how much the space behind a passage may be seen to be wider, on either side of it."""
MIN_WIDENING_M, WIDENING_SHARE = 0.3, 0.2
"""So much wider it must be: in metres, and in parts of the passage's width."""
APART_M = 0.5
"""Passages with middles nearer than this are the two sides of one wall."""
SHRINK = 0.97
"""How much of a passage must be seen from its middle: its ends, on walls, see nothing."""
STUB_M = (0.15, 0.3, 0.45)
"""How far beyond the ends of an opening there must be wall: it is a gap in one."""
ASIDE_M = 0.06
"""How far beside that line the wall may be found."""
SIDEWAYS = (-1, 0, 1)
TINY = 1e-9
PER_CORNER = 6
"""The shortest of so many passages that could end at a corner are looked at."""


@dataclass(frozen=True)
class Passage:
    """A short way from wall to wall.

    Attributes:
        segment: Its ends [lattice], even, on corners or within a unit of a wall.
        width_m: Distance between its ends [m].
    """

    segment: Segment
    width_m: float

    @property
    def is_doorway(self) -> bool:
        """Whether it is as narrow as a doorway; else it is a wider opening."""
        return self.width_m <= MAX_DOOR_M


@dataclass(frozen=True)
class _Walls:
    """All walls: start, end, and what comes before and after each start; float64 (n, 2)."""

    start: F64
    end: F64
    before: F64
    reflex: NDArray[np.bool_]


def find_passages(
    mesh: Mesh, polygons: Sequence[Polygon], units_per_m: float, *, gaps_only: bool = True
) -> list[Passage]:
    """Return where free space narrows and opens out again on both sides, the shortest first.

    Args:
        mesh: The free space.
        polygons: The same, outer rings counter-clockwise [lattice].
        units_per_m: Lattice units to a metre.
        gaps_only: Whether openings wider than a doorway must be gaps in a wall; if not, any
            narrowing counts.

    Returns:
        Lines that don't touch each other.
    """
    walls = _walls(polygons)
    lines = np.concatenate([_corner_to_corner(walls, units_per_m), _to_walls(walls, units_per_m)])
    lines = _shortest_first(lines)
    lines = lines[_all_free(mesh, lines)]
    for side in (1, -1):
        lines = lines[_opens(mesh, lines, side, units_per_m)]
    if gaps_only:
        lines = lines[_in_a_wall(mesh, walls, lines, units_per_m)]
    return [
        Passage(
            ((int(x0), int(y0)), (int(x1), int(y1))),
            float(((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5) / units_per_m,
        )
        for x0, y0, x1, y1 in lines[_one_of_each(lines, units_per_m)].tolist()
    ]


def _walls(polygons: Sequence[Polygon]) -> _Walls:
    starts, ends, befores = [], [], []
    for polygon in polygons:
        for ring in (polygon.exterior, *polygon.interiors):
            corners = shapely.get_coordinates(ring)[:-1]
            starts.append(corners)
            ends.append(np.roll(corners, -1, axis=0))
            befores.append(np.roll(corners, 1, axis=0))
    start, end, before = (np.concatenate(points) for points in (starts, ends, befores))
    into, out = start - before, end - start
    reflex = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0] < 0
    return _Walls(start, end, before, reflex)


def _corner_to_corner(walls: _Walls, units_per_m: float) -> I64:
    """Return lines between corners that stand out, int64 (n, 4)."""
    chosen = np.flatnonzero(walls.reflex)
    tree = shapely.STRtree(np.asarray(shapely.points(walls.start[chosen])))
    first, second = tree.query(_around(walls.start[chosen], units_per_m))
    once = first < second
    first, second = chosen[first[once]], chosen[second[once]]
    length2 = _length2(np.hstack([walls.start[first], walls.start[second]]).astype(np.int64))
    near = length2 <= (MAX_OPENING_M * units_per_m) ** 2
    first, second = first[near], second[near]
    shortest = _ends_well(walls, first, walls.start[second])
    shortest &= _ends_well(walls, second, walls.start[first])
    lines = np.hstack([walls.start[first[shortest]], walls.start[second[shortest]]])
    return _of_width(lines.astype(np.int64), units_per_m)


def _to_walls(walls: _Walls, units_per_m: float) -> I64:
    """Return lines from corners that stand out to the nearest point of a wall, int64 (n, 4)."""
    chosen = np.flatnonzero(walls.reflex)
    lines_of = np.asarray(shapely.linestrings(np.stack([walls.start, walls.end], axis=1)))
    tree = shapely.STRtree(lines_of)
    near, wall = tree.query(_around(walls.start[chosen], units_per_m))
    corner = chosen[near]
    at, along = walls.start[wall], walls.end[wall] - walls.start[wall]
    away = walls.start[corner] - at
    share = (away * along).sum(axis=1) / (along * along).sum(axis=1)
    inside = along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0] > 0
    inside &= (share > 0) & (share < 1)
    corner, at, along, share = corner[inside], at[inside], along[inside], share[inside]
    foot = 2 * np.rint((at + share[:, None] * along) / 2)
    shortest = _ends_well(walls, corner, foot)
    lines = np.hstack([walls.start[corner[shortest]], foot[shortest]])
    return _of_width(lines.astype(np.int64), units_per_m)


def _around(points: F64, units_per_m: float) -> NDArray[np.object_]:
    """Return the boxes that reach from points as far as a passage may be wide."""
    reach = MAX_OPENING_M * units_per_m
    return np.asarray(shapely.box(*(points - reach).T, *(points + reach).T))


def _ends_well(walls: _Walls, corner: NDArray[np.intp], other: F64) -> NDArray[np.bool_]:
    """Return whether lines to other points don't get shorter by moving off the corner."""
    well = np.ones(len(corner), np.bool_)
    line = other - walls.start[corner]
    length = np.sqrt((line * line).sum(axis=1))
    for side in (walls.before[corner], walls.end[corner]):
        wall = side - walls.start[corner]
        along = (line * wall).sum(axis=1)
        well &= along <= LEAN * length * np.sqrt((wall * wall).sum(axis=1))
    return well


def _of_width(lines: I64, units_per_m: float) -> I64:
    length2 = _length2(lines)
    low, high = (MIN_DOOR_M * units_per_m) ** 2, (MAX_OPENING_M * units_per_m) ** 2
    kept: I64 = lines[(length2 >= low) & (length2 <= high)]
    return kept


def _length2(lines: I64) -> I64:
    span: I64 = lines[:, 2:] - lines[:, :2]
    total: I64 = (span * span).sum(axis=1)
    return total


def _shortest_first(lines: I64) -> I64:
    """Return the lines in one order, of those from one corner only the shortest."""
    order = np.lexsort((*lines.T[::-1], _length2(lines)))
    ordered = lines[order]
    keys = _keys(ordered[:, :2])
    by_corner = np.argsort(keys, kind="stable")
    found = keys[by_corner]
    rank = np.arange(len(found)) - np.searchsorted(found, found)
    kept = np.empty(len(ordered), np.bool_)
    kept[by_corner] = rank < PER_CORNER
    result: I64 = ordered[kept]
    return result


def _all_free(mesh: Mesh, lines: I64) -> NDArray[np.bool_]:
    """Return which lines cross free space alone."""
    middle = (lines[:, :2] + lines[:, 2:]) // 2
    half = np.rint((lines[:, 2:] - lines[:, :2]) * (SHRINK / 2)).astype(np.int64)
    one, other = see_each(mesh, middle, middle + half), see_each(mesh, middle, middle - half)
    free: NDArray[np.bool_] = one & other
    return free


def _opens(mesh: Mesh, lines: I64, side: int, units_per_m: float) -> NDArray[np.bool_]:
    """Return which lines have clearly wider space behind them on a side (1 is the left)."""
    span = (lines[:, 2:] - lines[:, :2]).astype(np.float64)
    length = np.sqrt((span * span).sum(axis=1))
    along = span / length[:, None]
    away = np.stack([-along[:, 1], along[:, 0]], axis=1) * side
    middle = (lines[:, :2] + lines[:, 2:]) // 2
    needed = np.maximum(MIN_WIDENING_M, WIDENING_SHARE * length / units_per_m)
    opens = np.zeros(len(lines), np.bool_)
    waiting = np.arange(len(lines))
    for offset in OFFSETS_M:
        behind = middle + np.rint(away * (offset * units_per_m)).astype(np.int64)
        waiting = waiting[see_each(mesh, middle[waiting], behind[waiting])]
        targets = [
            along[waiting] * (length[waiting] / 2 + step * units_per_m)[:, None] * direction
            for direction in (1, -1)
            for step in WIDENINGS_M
        ]
        # One line after the other, so that its eye is looked up once.
        eyes = np.repeat(behind[waiting], len(targets), axis=0)
        there = eyes + np.rint(np.stack(targets, axis=1).reshape(-1, 2)).astype(np.int64)
        seen = see_each(mesh, eyes, there).reshape(-1, 2, len(WIDENINGS_M))
        wider = np.where(seen, WIDENINGS_M, 0.0).max(axis=2).sum(axis=1)
        enough = wider >= needed[waiting] - TINY
        opens[waiting[enough]] = True
        waiting = waiting[~enough]
    return opens


def _in_a_wall(mesh: Mesh, walls: _Walls, lines: I64, units_per_m: float) -> NDArray[np.bool_]:
    """Return which lines are narrow, or have a wall in line with them at both corners."""
    span = (lines[:, 2:] - lines[:, :2]).astype(np.float64)
    length = np.sqrt((span * span).sum(axis=1))
    along = span / length[:, None] * units_per_m
    aside = np.stack([-along[:, 1], along[:, 0]], axis=1) * ASIDE_M
    fine = np.ones(len(lines), np.bool_)
    corners = _keys(walls.start[walls.reflex].astype(np.int64))
    for end, outwards in ((lines[:, :2], -along), (lines[:, 2:], along)):
        found = ~np.isin(_keys(end), corners)
        shifts = [
            outwards * beyond + sideways * aside for sideways in SIDEWAYS for beyond in STUB_M
        ]
        places = (end + np.rint(np.stack(shifts)).astype(np.int64)).reshape(-1, 2)
        seen = see_each(mesh, places, places)  # in free space a place sees itself
        walled = ~seen.reshape(len(SIDEWAYS), len(STUB_M), len(lines))
        found |= walled.all(axis=1).any(axis=0)
        fine &= found
    fine |= length <= MAX_DOOR_M * units_per_m
    return fine


def _keys(points: I64) -> I64:
    """Return one number per point."""
    keys: I64 = points[:, 0] * 2**21 + points[:, 1]
    return keys


def _one_of_each(lines: I64, units_per_m: float) -> list[int]:
    """Return which lines to keep, going by the order given, so that none is beside another."""
    kept: list[int] = []
    shapes = np.asarray(shapely.linestrings(lines.reshape(-1, 2, 2).astype(np.float64)))
    middle = (lines[:, :2] + lines[:, 2:]) / 2
    apart2 = (APART_M * units_per_m) ** 2
    for i in range(len(lines)):
        if kept:
            gap = middle[kept] - middle[i]
            if (gap * gap).sum(axis=1).min() < apart2:
                continue
            if shapely.intersects(shapes[kept], shapes[i]).any():
                continue
        kept.append(i)
    return kept
