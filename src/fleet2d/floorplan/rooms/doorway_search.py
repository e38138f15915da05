"""Find the passages of a floor plan: short lines between walls, with wider space on both sides.

A passage is a line from a corner of a wall to another corner, or to the nearest point of a wall,
that can't be made shorter by moving its ends: where the clearance to the walls has a local minimum.
These are the critical lines of Thrun, "Learning metric-topological maps for indoor mobile robot
navigation" (Artificial Intelligence 99, 1998), found on the walls themselves instead of on a grid.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from fleet2d.floorplan.geometry.gates import Segment
from fleet2d.kernels import F64, I64, Bool
from fleet2d.kernels.space import Mesh, pairs_in_sight

Corners = NDArray[np.intp]

MIN_DOOR_M, MAX_DOOR_M = 0.5, 1.4
"""Widths of doorways, from what a person fits through to a double door."""
MAX_OPENING_M = 2.8
"""The widest opening that still separates rooms, such as a kitchen and its dining area."""
MAX_LEAN = 0.2
"""Largest sine of the angle between a passage and the shortest line, since traced walls lean."""
OFFSETS_M = (0.15, 0.3, 0.45, 0.6)
"""Distances behind a passage at which the space is checked; the last is the thickest wall."""
WIDENINGS_M = (0.1, 0.2, 0.3, 0.45, 0.6, 0.8)
"""Amounts of widening, on either side of a passage, that are checked behind it."""
MIN_WIDENING_M, WIDENING_SHARE = 0.3, 0.2
"""Least widening behind a passage: in metres, and as a share of its width."""
MIN_APART_M = 0.5
"""Passages with middles nearer than this are the two sides of one wall."""
VISIBLE_SHARE = 0.97
"""Share of a passage that must be visible from its middle; the very ends are on walls."""
STUBS_M = (0.15, 0.3, 0.45)
"""Distances beyond the ends of an opening at which there must be wall for it to be a gap in one."""
ASIDE_M = 0.06
"""How far beside the line of an opening that wall may be."""
SIDEWAYS = (-1, 0, 1)
TINY = 1e-9
BATCH = 64
"""Corners that are looked at together: very jagged walls have millions of pairs of them."""
PER_CORNER = 6
"""Number of passages that are checked for each corner, the shortest first."""


@dataclass(frozen=True)
class _Walls:
    """All walls.

    Attributes:
        start: First corner of each wall [lattice], float64 (n, 2).
        end: Its last corner.
        before: The corner before `start` on the same ring.
        reflex: Whether the corner at `start` stands out into free space, bool (n,).
    """

    start: F64
    end: F64
    before: F64
    reflex: Bool


def find_passages(
    mesh: Mesh, polygons: Sequence[Polygon], units_per_m: float, *, gaps_only: bool = True
) -> list[Segment]:
    """Return the lines at which free space narrows and opens out on both sides, shortest first.

    Args:
        mesh: The free space.
        polygons: The same, outer rings counter-clockwise [lattice].
        units_per_m: Lattice units to a metre.
        gaps_only: Whether openings wider than a doorway must be gaps in a wall; if not, any
            narrowing counts.

    Returns:
        Lines that don't touch each other [lattice]; their ends have even coordinates, and are on
        corners or within a unit of a wall.
    """
    walls = _walls(polygons)
    corners = np.flatnonzero(walls.reflex)
    batches = np.array_split(corners, -(-len(corners) // BATCH) or 1)
    lines = _shortest_first(
        np.concatenate([
            *_corner_to_corner(walls, corners, batches, units_per_m),
            *_to_walls(walls, batches, units_per_m),
        ])
    )  # fmt: skip
    lines = lines[_all_free(mesh, lines)]
    for side in (1, -1):
        lines = lines[_opens(mesh, lines, side, units_per_m)]
    if gaps_only:
        lines = lines[_in_a_wall(mesh, walls, lines, units_per_m)]
    apart = lines[_one_of_each(lines, units_per_m)].tolist()
    return [((x0, y0), (x1, y1)) for x0, y0, x1, y1 in apart]


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


def _corner_to_corner(
    walls: _Walls, corners: Corners, batches: Sequence[Corners], units_per_m: float
) -> Iterator[I64]:
    """Yield lines between corners that stand out, int64 (n, 4), for each batch of corners."""
    tree = shapely.STRtree(np.asarray(shapely.points(walls.start[corners])))
    for batch in batches:
        first, second = tree.query(_around(walls.start[batch], units_per_m))
        first, second = batch[first], corners[second]
        in_order = first < second
        first, second = first[in_order], second[in_order]
        length2 = _length2(np.hstack([walls.start[first], walls.start[second]]).astype(np.int64))
        near = length2 <= (MAX_OPENING_M * units_per_m) ** 2
        first, second = first[near], second[near]
        shortest = _ends_well(walls, first, walls.start[second])
        shortest &= _ends_well(walls, second, walls.start[first])
        lines = np.hstack([walls.start[first[shortest]], walls.start[second[shortest]]])
        yield _shortest_first(_of_width(lines.astype(np.int64), units_per_m))


def _to_walls(walls: _Walls, batches: Sequence[Corners], units_per_m: float) -> Iterator[I64]:
    """Yield lines from corners that stand out to the nearest point of a wall, int64 (n, 4)."""
    lines_of = np.asarray(shapely.linestrings(np.stack([walls.start, walls.end], axis=1)))
    tree = shapely.STRtree(lines_of)
    for batch in batches:
        near, wall = tree.query(_around(walls.start[batch], units_per_m))
        corner = batch[near]
        at, along = walls.start[wall], walls.end[wall] - walls.start[wall]
        away = walls.start[corner] - at
        share = (away * along).sum(axis=1) / (along * along).sum(axis=1)
        inside = along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0] > 0
        inside &= (share > 0) & (share < 1)
        corner, at, along, share = corner[inside], at[inside], along[inside], share[inside]
        foot = 2 * np.rint((at + share[:, None] * along) / 2)
        shortest = _ends_well(walls, corner, foot)
        lines = np.hstack([walls.start[corner[shortest]], foot[shortest]])
        yield _shortest_first(_of_width(lines.astype(np.int64), units_per_m))


def _around(points: F64, units_per_m: float) -> NDArray[np.object_]:
    """Return the boxes that reach from points as far as a passage may be wide."""
    reach = MAX_OPENING_M * units_per_m
    return np.asarray(shapely.box(*(points - reach).T, *(points + reach).T))


def _ends_well(walls: _Walls, corner: NDArray[np.intp], other: F64) -> Bool:
    """Return which lines to other points get no shorter if their end moves off the corner."""
    is_shortest = np.ones(len(corner), np.bool_)
    line = other - walls.start[corner]
    length = np.sqrt((line * line).sum(axis=1))
    for side in (walls.before[corner], walls.end[corner]):
        wall = side - walls.start[corner]
        component = (line * wall).sum(axis=1)
        is_shortest &= component <= MAX_LEAN * length * np.sqrt((wall * wall).sum(axis=1))
    return is_shortest


def _of_width(lines: I64, units_per_m: float) -> I64:
    length2 = _length2(lines)
    low, high = (MIN_DOOR_M * units_per_m) ** 2, (MAX_OPENING_M * units_per_m) ** 2
    return lines[(length2 >= low) & (length2 <= high)]


def _length2(lines: I64) -> I64:
    span: I64 = lines[:, 2:] - lines[:, :2]
    return (span * span).sum(axis=1)


def _shortest_first(lines: I64) -> I64:
    """Sort the lines by length, and drop all but the shortest from each corner."""
    order = np.lexsort((*lines.T[::-1], _length2(lines)))
    ordered = lines[order]
    keys = _keys(ordered[:, :2])
    by_corner = np.argsort(keys, kind="stable")
    sorted_keys = keys[by_corner]
    rank = np.arange(len(sorted_keys)) - np.searchsorted(sorted_keys, sorted_keys)
    is_short = np.empty(len(ordered), np.bool_)
    is_short[by_corner] = rank < PER_CORNER
    return ordered[is_short]


def _all_free(mesh: Mesh, lines: I64) -> Bool:
    """Return which lines cross only free space."""
    middle = (lines[:, :2] + lines[:, 2:]) // 2
    half = np.rint((lines[:, 2:] - lines[:, :2]) * (VISIBLE_SHARE / 2)).astype(np.int64)
    free: Bool = pairs_in_sight(mesh, middle, middle + half)
    free &= pairs_in_sight(mesh, middle, middle - half)
    return free


def _opens(mesh: Mesh, lines: I64, side: int, units_per_m: float) -> Bool:
    """Return which lines have wider space behind them on a side (1: left, -1: right)."""
    span = (lines[:, 2:] - lines[:, :2]).astype(np.float64)
    length = np.sqrt((span * span).sum(axis=1))
    along = span / length[:, None]
    away = np.stack([-along[:, 1], along[:, 0]], axis=1) * side
    middle = (lines[:, :2] + lines[:, 2:]) // 2
    needed = np.maximum(MIN_WIDENING_M, WIDENING_SHARE * length / units_per_m)
    opens = np.zeros(len(lines), np.bool_)
    undecided = np.arange(len(lines))
    for offset in OFFSETS_M:
        behind = middle + np.rint(away * (offset * units_per_m)).astype(np.int64)
        undecided = undecided[pairs_in_sight(mesh, middle[undecided], behind[undecided])]
        targets = [
            along[undecided] * (length[undecided] / 2 + step * units_per_m)[:, None] * direction
            for direction in (1, -1)
            for step in WIDENINGS_M
        ]
        # All targets of one line in a row, so that the triangle of its eye is located only once.
        eyes = np.repeat(behind[undecided], len(targets), axis=0)
        goals = eyes + np.rint(np.stack(targets, axis=1).reshape(-1, 2)).astype(np.int64)
        seen = pairs_in_sight(mesh, eyes, goals).reshape(-1, 2, len(WIDENINGS_M))
        wider = np.where(seen, WIDENINGS_M, 0.0).max(axis=2).sum(axis=1)
        enough = wider >= needed[undecided] - TINY
        opens[undecided[enough]] = True
        undecided = undecided[~enough]
    return opens


def _in_a_wall(mesh: Mesh, walls: _Walls, lines: I64, units_per_m: float) -> Bool:
    """Return which lines are no wider than a door, or continue in a wall at both ends."""
    span = (lines[:, 2:] - lines[:, :2]).astype(np.float64)
    length = np.sqrt((span * span).sum(axis=1))
    along = span / length[:, None] * units_per_m
    aside = np.stack([-along[:, 1], along[:, 0]], axis=1) * ASIDE_M
    both_in_wall = np.ones(len(lines), np.bool_)
    corners = _keys(walls.start[walls.reflex].astype(np.int64))
    for end, outwards in ((lines[:, :2], -along), (lines[:, 2:], along)):
        in_wall = ~np.isin(_keys(end), corners)
        shifts = [
            outwards * beyond + sideways * aside for sideways in SIDEWAYS for beyond in STUBS_M
        ]
        places = (end + np.rint(np.stack(shifts)).astype(np.int64)).reshape(-1, 2)
        seen = pairs_in_sight(mesh, places, places)  # in free space a place sees itself
        walled = ~seen.reshape(len(SIDEWAYS), len(STUBS_M), len(lines))
        in_wall |= walled.all(axis=1).any(axis=0)
        both_in_wall &= in_wall
    both_in_wall |= length <= MAX_DOOR_M * units_per_m
    return both_in_wall


def _keys(points: I64) -> I64:
    """Return one number per point."""
    return points[:, 0] * 2**21 + points[:, 1]


def _one_of_each(lines: I64, units_per_m: float) -> list[int]:
    """Return the indices of lines that are apart from all lines chosen before them."""
    chosen: list[int] = []
    shapes = np.asarray(shapely.linestrings(lines.reshape(-1, 2, 2).astype(np.float64)))
    middle = (lines[:, :2] + lines[:, 2:]) / 2
    apart2 = (MIN_APART_M * units_per_m) ** 2
    for i in range(len(lines)):
        if chosen:
            gap = middle[chosen] - middle[i]
            if (gap * gap).sum(axis=1).min() < apart2:
                continue
            if shapely.intersects(shapes[chosen], shapes[i]).any():
                continue
        chosen.append(i)
    return chosen
