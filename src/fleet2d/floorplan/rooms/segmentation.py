"""Segment free space by its walls alone: passages, the chambers between them, rooms.

A passage is a line from a corner of a wall to another corner, or to the nearest point of a wall,
that can't be made shorter by moving its ends: where the clearance to the walls has a local minimum.
These are the critical lines of Thrun, "Learning metric-topological maps for indoor mobile robot
navigation" (Artificial Intelligence 99, 1998), found on the walls themselves instead of on a grid.
To cut the free space at them and to join what is too small to be a room is Voronoi segmentation,
one of the four methods that Bormann, Jordan, Li, Hampp and Hägele compare in "Room Segmentation:
Survey, Implementation, and Analysis" (ICRA 2016).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from fleet2d.floorplan.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.mesh import Gates, Segment, build_mesh, doubled_areas
from fleet2d.floorplan.rooms.doorways import MIN_APART_M
from fleet2d.floorplan.rooms.shape import ACROSS_SHARE, LONG, by_size, without_furniture
from fleet2d.kernels import (
    F64,
    I32,
    I64,
    WALL,
    Bool,
    Mesh,
    label_frames,
    label_triangles,
    pairs_in_sight,
    rasterize_cells,
    spread_labels,
    squared_distance,
)
from fleet2d.runtime.determinism import sum_in_order

Corners = NDArray[np.intp]

MIN_DOOR_M = 0.5
MAX_DOOR_M = 1.4
"""Widths of doorways, from what a person fits through to a double door."""
MAX_OPENING_M = 2.8
"""The widest opening that still separates rooms, such as a kitchen and its dining area."""
MAX_LEAN = 0.2
"""Largest sine of the angle between a passage and the shortest line, since traced walls lean."""
OFFSETS_M = (0.15, 0.3, 0.45, 0.6)
"""Distances behind a passage at which the space is checked; the last is the thickest wall."""
WIDENINGS_M = (0.1, 0.2, 0.3, 0.45, 0.6, 0.8)
"""Amounts of widening, on either side of a passage, that are checked behind it."""
MIN_WIDENING_M = 0.3
WIDENING_SHARE = 0.2
"""Least widening behind a passage: in metres, and as a share of its width."""
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
NOISE_M = 0.12
"""Walls are straightened within this before their directions are compared."""
SPREAD_DEG = 8
"""Walls whose directions differ by less than this add to each other's."""
STRAIGHT_SHARE = 0.75
"""Walls are straight if at least this share of their length runs in main directions."""


@dataclass(frozen=True)
class WallDirections:
    """The directions in which the walls of a plan run; walls at a right angle count as one.

    Attributes:
        weight: For each degree from 0 to 89, how much wall runs in that direction, float64 (90,):
            1 if at least half as much as in the commonest one.
        straight: Whether most of the walls run in main directions; else they are ragged, as those
            of cluttered maps are.
    """

    weight: F64
    straight: bool

    @classmethod
    def of(cls, polygons: Sequence[Polygon], units_per_m: float) -> "WallDirections":
        """Return the directions of the walls around free space [lattice].

        >>> square = shapely.box(0, 0, 512, 512)
        >>> WallDirections.of([square], 128).are_main(np.array([[0, 0, 0, 9], [0, 0, 9, 9]]))
        array([ True, False])
        """
        simple = shapely.simplify(shapely.MultiPolygon(list(polygons)), NOISE_M * units_per_m)
        rings = shapely.get_rings(shapely.get_parts(simple))
        sides = np.concatenate([np.diff(shapely.get_coordinates(ring), axis=0) for ring in rings])
        length = np.sqrt((sides * sides).sum(axis=1))
        degrees = _degrees(sides)
        square = np.bincount(degrees, weights=length * length, minlength=90)
        weight = np.zeros(90)
        for k in range(1 - SPREAD_DEG, SPREAD_DEG):  # in this order on every machine
            weight += (1 - abs(k) / SPREAD_DEG) * np.roll(square, k)
        weight = np.minimum(2 * weight / weight.max(), 1)
        main = sum_in_order(length[weight[degrees] >= 0.5].tolist())
        return cls(weight, main >= STRAIGHT_SHARE * sum_in_order(length.tolist()))

    def are_main(self, lines: I64) -> Bool:
        """Return which lines (x0, y0, x1, y1) run in a main direction of the walls."""
        return self.weights(lines) >= 0.5

    def weights(self, lines: I64) -> F64:
        """Return how much wall runs in the direction of each line, at most 1."""
        return self.weight[_degrees(lines[:, 2:] - lines[:, :2])]


def _degrees(spans: NDArray[Any]) -> I64:
    """Return the directions of spans (n, 2) in whole degrees modulo 90."""
    turned = np.degrees(np.arctan2(spans[:, 1], spans[:, 0]))
    # Rounded twice, so that the last bit of a machine's arctangent doesn't matter.
    return np.rint(turned.round(9)).astype(np.int64) % 90


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
    mesh: Mesh,
    polygons: Sequence[Polygon],
    units_per_m: float,
    directions: WallDirections | None = None,
) -> list[Segment]:
    """Return the lines at which free space narrows and opens out on both sides, likeliest first.

    Args:
        mesh: The free space.
        polygons: The same, outer rings counter-clockwise [lattice].
        units_per_m: Lattice units to a metre.
        directions: Main directions of straight walls: openings wider than a doorway must run in
            these, in line with the walls at their ends, and passages in main directions rank
            before others. None if such openings must be gaps in a wall.

    Returns:
        Lines that don't touch each other [lattice]; their ends have even coordinates, and are on
        corners or within a unit of a wall.
    """
    walls = _walls(polygons)
    corners = np.flatnonzero(walls.reflex)
    batches = np.array_split(corners, -(-len(corners) // BATCH) or 1)
    lines = _shortest_of_each_corner(
        np.concatenate([
            _shortest_of_each_corner(_of_width(walls, lines, units_per_m, directions), directions)
            for lines in chain(
                _corner_to_corner(walls, corners, batches, units_per_m),
                _to_walls(walls, batches, units_per_m),
            )
        ]),
        directions,
    )  # fmt: skip
    lines = lines[_all_free(mesh, lines)]
    for side in (1, -1):
        lines = lines[_opens(mesh, lines, side, units_per_m)]
    if directions is None:
        lines = lines[_in_a_wall(mesh, walls, lines, units_per_m)]
    apart = lines[_one_of_each(lines, units_per_m)].tolist()
    return [((x0, y0), (x1, y1)) for x0, y0, x1, y1 in apart]


def _walls(polygons: Sequence[Polygon]) -> _Walls:
    starts = []
    ends = []
    befores = []
    for polygon in polygons:
        for ring in shapely.get_rings(polygon):
            corners = shapely.get_coordinates(ring)[:-1]
            starts.append(corners)
            ends.append(np.roll(corners, -1, axis=0))
            befores.append(np.roll(corners, 1, axis=0))
    start, end, before = (np.concatenate(points) for points in (starts, ends, befores))
    into = start - before
    out = end - start
    reflex = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0] < 0
    return _Walls(start, end, before, reflex)


def _corner_to_corner(
    walls: _Walls, corners: Corners, batches: Sequence[Corners], units_per_m: float
) -> Iterator[I64]:
    """Yield lines between corners that stand out, int64 (n, 4), for each batch of corners."""
    tree = shapely.STRtree(np.asarray(shapely.points(walls.start[corners])))
    for batch in batches:
        first, second = tree.query(_around(walls.start[batch], units_per_m))
        first = batch[first]
        second = corners[second]
        in_order = first < second
        first = first[in_order]
        second = second[in_order]
        length2 = _length2(np.hstack([walls.start[first], walls.start[second]]).astype(np.int64))
        near = length2 <= (MAX_OPENING_M * units_per_m) ** 2
        first = first[near]
        second = second[near]
        shortest = _ends_well(walls, first, walls.start[second])
        shortest &= _ends_well(walls, second, walls.start[first])
        lines = np.hstack([walls.start[first[shortest]], walls.start[second[shortest]]])
        yield lines.astype(np.int64)


def _to_walls(walls: _Walls, batches: Sequence[Corners], units_per_m: float) -> Iterator[I64]:
    """Yield lines from reflex corners to the nearest point of a wall, int64 (n, 4)."""
    lines_of = np.asarray(shapely.linestrings(np.stack([walls.start, walls.end], axis=1)))
    tree = shapely.STRtree(lines_of)
    for batch in batches:
        near, wall = tree.query(_around(walls.start[batch], units_per_m))
        corner = batch[near]
        at = walls.start[wall]
        along = walls.end[wall] - at
        away = walls.start[corner] - at
        share = (away * along).sum(axis=1) / (along * along).sum(axis=1)
        inside = along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0] > 0
        inside &= (share > 0) & (share < 1)
        corner = corner[inside]
        at = at[inside]
        along = along[inside]
        share = share[inside]
        foot = 2 * np.rint((at + share[:, None] * along) / 2)
        shortest = _ends_well(walls, corner, foot)
        lines = np.hstack([walls.start[corner[shortest]], foot[shortest]])
        yield lines.astype(np.int64)


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


def _of_width(
    walls: _Walls, lines: I64, units_per_m: float, directions: WallDirections | None
) -> I64:
    """Return the lines as wide as a passage.

    Between straight walls, those wider than a doorway run in main directions, and in line with the
    walls at their ends: others cut a corner of a corridor, or go to its side from a cupboard.
    """
    length2 = _length2(lines)
    low, door, high = ((w * units_per_m) ** 2 for w in (MIN_DOOR_M, MAX_DOOR_M, MAX_OPENING_M))
    fits = (length2 >= low) & (length2 <= high)
    if directions is not None:
        is_gap = directions.are_main(lines) & _continue_walls(walls, lines)
        fits &= is_gap | (length2 <= door)
    return lines[fits]


def _continue_walls(walls: _Walls, lines: I64) -> Bool:
    """Return which lines have a wall in line with them at each end that is on a corner."""
    corners = np.flatnonzero(walls.reflex)
    keys = _keys(walls.start[corners].astype(np.int64))
    order = np.argsort(keys, kind="stable")
    corners = corners[order]
    keys = keys[order]
    in_line = np.ones(len(lines), np.bool_)
    for end, other in ((lines[:, :2], lines[:, 2:]), (lines[:, 2:], lines[:, :2])):
        end_keys = _keys(end)
        nearest = np.minimum(np.searchsorted(keys, end_keys), len(keys) - 1)
        corner = corners[nearest]
        outwards = end - other
        goes_on = keys[nearest] != end_keys
        for side in (walls.before[corner], walls.end[corner]):
            wall = side - walls.start[corner]
            along = (outwards * wall).sum(axis=1)
            across = outwards[:, 0] * wall[:, 1] - outwards[:, 1] * wall[:, 0]
            goes_on |= np.abs(across) <= MAX_LEAN * along
        in_line &= goes_on
    return in_line


def _length2(lines: I64) -> I64:
    span: I64 = lines[:, 2:] - lines[:, :2]
    return (span * span).sum(axis=1)


def _shortest_of_each_corner(lines: I64, directions: WallDirections | None) -> I64:
    """Sort the lines by length, and drop all but the shortest from each corner.

    Those off the main directions count as up to twice as long.
    """
    length2: NDArray[Any] = _length2(lines)
    if directions is not None:
        length2 = length2 * (2 - directions.weights(lines)) ** 2
    order = np.lexsort((*lines.T[::-1], length2))
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


MIN_CHAMBER_M2 = 0.8
"""Least area of a chamber; smaller ones, such as space in a thick wall, are joined to others."""


@dataclass(frozen=True)
class Link:
    """A passage between two chambers.

    Attributes:
        line: Number of its line among those given.
        chambers: The chambers on its two sides.
    """

    line: int
    chambers: tuple[int, int]


@dataclass(frozen=True)
class Chambers:
    """Free space, cut at passages.

    Attributes:
        of_cell: The chamber of each free cell, -1 elsewhere, int32 (rows, columns).
        count: Number of chambers; each has a cell.
        links: The passages that separate two of them.
    """

    of_cell: I32
    count: int
    links: tuple[Link, ...]


def cut_chambers(
    lattice: Lattice,
    polygons: Sequence[Polygon],
    mesh: Mesh,
    free: Bool,
    segments: Sequence[Segment],
    min_area_m2: float = MIN_CHAMBER_M2,
) -> Chambers:
    """Cut free space at passages.

    A passage with the same chamber on both sides is ignored. So is the widest passage of a chamber
    that is too small.

    Args:
        lattice: Of the plan.
        polygons: Free space [lattice].
        mesh: The same, in triangles.
        free: Free cells, bool (rows, columns).
        segments: The passages [lattice], exactly from wall to wall; they don't touch each other.
        min_area_m2: Chambers smaller than this are joined to others [m²].
    """
    corners = {(x, y) for x, y in mesh.vertices.tolist()}
    jambs = [end for segment in segments for end in segment if end not in corners]
    if jambs:
        mesh = build_mesh(polygons, lattice.columns, lattice.rows, corners=jambs)
    gates = Gates(mesh, segments)
    shut = gates.shut(range(len(segments)))
    part = label_triangles(shut.neighbors)
    sides = _sides(gates.mesh, shut, part, segments)
    areas = _areas(shut, part) / lattice.units_per_m**2
    lengths = [(x1 - x0) ** 2 + (y1 - y0) ** 2 for (x0, y0), (x1, y1) in segments]
    joined = _join_small(areas, sides, lengths, min_area_m2)
    triangle = rasterize_cells(shut, lattice.rows, lattice.columns)
    chamber = np.append(joined[part], -1).astype(np.int32)[triangle]  # the last serves -1
    if (free & (chamber < 0)).any():  # the centre of a cell on a passage has no triangle
        chamber = spread_labels(chamber, free)
    return _number_chambers(chamber, free, joined, sides)


def _sides(
    open_mesh: Mesh, shut_mesh: Mesh, part: I32, segments: Sequence[Segment]
) -> list[tuple[int, int]]:
    """Return the parts on the two sides of each passage."""
    number = {frozenset(segment): i for i, segment in enumerate(segments)}
    parts_beside: list[list[int]] = [[] for _ in segments]
    for triangle, edge in np.argwhere(
        (open_mesh.neighbors != WALL) & (shut_mesh.neighbors == WALL)
    ):
        ends = open_mesh.triangles[triangle, [edge, (edge + 1) % 3]]
        (x0, y0), (x1, y1) = open_mesh.vertices[ends].tolist()
        parts_beside[number[frozenset(((x0, y0), (x1, y1)))]].append(int(part[triangle]))
    return [(min(parts), max(parts)) for parts in parts_beside]


def _areas(mesh: Mesh, part: I32) -> F64:
    """Return the area of each part, square lattice units."""
    total = np.zeros(int(part.max()) + 1, np.int64)
    np.add.at(total, part, doubled_areas(mesh.vertices[mesh.triangles]))
    return total / 2


def _join_small(
    areas: F64,
    sides: Sequence[tuple[int, int]],
    lengths: Sequence[int],
    min_area_m2: float,
) -> I64:
    """Join small parts to others; return for each part the lowest part of its chamber."""
    owner = np.arange(len(areas))
    total = areas.copy()
    while True:
        inner = [i for i, (a, b) in enumerate(sides) if owner[a] != owner[b]]
        small = [
            (total[owner[part]], -lengths[i], i)
            for i in inner
            for part in sides[i]
            if total[owner[part]] < min_area_m2
        ]
        if not small:
            return owner
        a, b = (int(owner[part]) for part in sides[min(small)[2]])
        low, high = min(a, b), max(a, b)
        total[low] += total[high]
        owner[owner == high] = low


def _number_chambers(
    chamber: I32,
    free: Bool,
    joined: I64,
    sides: Sequence[tuple[int, int]],
) -> Chambers:
    """Return the chambers numbered by their first cells, row by row."""
    lost = free & (chamber < 0)
    if lost.any():  # free cells that share no side with others
        chamber = np.where(lost, len(joined), chamber).astype(np.int32)
    chamber_of_free = chamber[free]
    first = np.full(len(joined) + 1, -1)
    first[chamber_of_free[::-1]] = np.arange(len(chamber_of_free))[::-1]  # the last write wins
    kinds = np.flatnonzero(first >= 0)
    number = np.full(len(joined) + 2, -1, np.int32)
    number[kinds[np.argsort(first[kinds], kind="stable")]] = np.arange(len(kinds))
    links = []
    for line, parts in enumerate(sides):
        a, b = (int(number[joined[part]]) for part in parts)
        if a != b and min(a, b) >= 0:
            links.append(Link(line, (min(a, b), max(a, b))))
    return Chambers(number[chamber], len(kinds), tuple(links))


MIN_ROOM_M2 = 1.2
"""Least area of a room, such as a toilet."""
WIDE_SHARE = 1.1
"""An opening that is wider than this share of the narrower space beside it separates no rooms: what
is behind it is the same corridor or hall, past a column, a niche or a cupboard."""


def segment_rooms(
    chambers: Chambers,
    segments: Sequence[Segment],
    is_opening: Sequence[bool],
    widths_m: Sequence[float],
    cell: float,
) -> I64:
    """Join chambers into rooms.

    A passage that is wider than `ACROSS_SHARE` of the wider space beside it lies across a corridor,
    between the doors on either side. So does one that is wider than this share of the narrower
    space, if that is as long as a corridor and both lead on: a corridor that gets wider stays one.

    Args:
        chambers: The free space, cut at doorways and openings.
        segments: The lines at which the chambers were cut [lattice].
        is_opening: Whether each line is an opening, not a doorway.
        widths_m: The length of each line [m].
        cell: Side of a cell [m].

    Returns:
        The room of each cell, by decreasing size; -1 where not free. int64 (rows, columns).
    """
    sizes = np.bincount(chambers.of_cell[chambers.of_cell >= 0], minlength=chambers.count)
    areas = sizes * cell**2
    of_cell = without_furniture(chambers.of_cell, cell)
    across = _clear_widths(of_cell, chambers.count, cell)
    is_across = [
        _is_across(of_cell, link.chambers, segments[link.line], widths_m[link.line] / cell)
        for link in chambers.links
    ]
    owner = np.arange(chambers.count)
    while True:
        candidates = []
        pairs = {frozenset(owner[[*link.chambers]].tolist()) for link in chambers.links}
        borders = [pair for pair in pairs if len(pair) == 2]
        for link, goes_on in zip(chambers.links, is_across, strict=True):
            one, other = (int(owner[chamber]) for chamber in link.chambers)
            opening = is_opening[link.line]
            width = widths_m[link.line]
            narrower, wider = sorted((one, other), key=across.__getitem__)
            narrow = across[narrower]
            is_wide = opening and width > WIDE_SHARE * narrow
            is_wide |= goes_on or width > ACROSS_SHARE * across[wider]
            if areas[narrower] >= LONG * narrow**2 and width > ACROSS_SHARE * narrow:
                is_wide |= _leads_on(one, borders) and _leads_on(other, borders)
            for room, into in ((one, other), (other, one)):
                if room != into and (areas[room] < MIN_ROOM_M2 or is_wide):
                    candidates.append((areas[room], not opening, link.line, room, into))
        if not candidates:
            break
        # The smallest first, across an opening rather than a doorway.
        *_, smallest, into = min(candidates)
        areas[into] += areas[smallest]
        across[into] = max(across[into], across[smallest])
        owner[owner == smallest] = into
    return by_size(np.append(owner, -1)[chambers.of_cell])


def _is_across(of_cell: I32, pair: tuple[int, int], segment: Segment, width: float) -> bool:
    """Return whether a line lies across a corridor: beside it, space is as wide on both sides.

    Args:
        of_cell: The chamber of each cell.
        pair: The chambers on its sides.
        segment: The line [lattice].
        width: Its length [cells].
    """
    column, row = (np.mean(segment, axis=0) / UNITS_PER_CELL).tolist()
    left, low = (max(math.floor(at - 3 * width), 0) for at in (column, row))
    window = of_cell[low : math.ceil(row + 3 * width), left : math.ceil(column + 3 * width)]
    rows, columns = np.indices(window.shape)
    near = np.hypot(columns + left + 0.5 - column, rows + low + 0.5 - row) <= width

    def clear(inside: Bool) -> float:
        """Return the diameter of the largest disc in some cells with its centre near the line."""
        squares = squared_distance(np.pad(inside, 1))[1:-1, 1:-1]
        return 2 * math.sqrt(int(squares[near].max()))

    return ACROSS_SHARE * clear(np.isin(window, pair)) < width and all(
        ACROSS_SHARE * width < clear(window == chamber) for chamber in pair
    )


def _leads_on(room: int, borders: Sequence[frozenset[int]]) -> bool:
    """Return whether a room has passages to at least two others."""
    return sum(room in border for border in borders) > 1


def _clear_widths(of_cell: I32, count: int, cell: float) -> F64:
    """Return the diameter of the largest disc in each chamber, float64 (chambers,) [m]."""
    widths = np.zeros(count)
    for chamber, frame in enumerate(label_frames(of_cell, count).tolist()):
        row, column, end_row, end_column = frame
        inside = of_cell[row:end_row, column:end_column] == chamber
        widths[chamber] = 2 * cell * math.sqrt(int(squared_distance(np.pad(inside, 1)).max()))
    return widths
