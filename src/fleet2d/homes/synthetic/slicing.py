"""Rectangles on a raster of 5 cm, the walls between them, and how they are cut into rooms."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from math import fsum, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np

from fleet2d.errors import FloorPlanError
from fleet2d.homes.synthetic.program import SIZES, Brief
from fleet2d.kernels import (
    DEEPEST_STRIP,
    F64,
    I64,
    INNER_WALL,
    CorridorRule,
    Divisions,
    is_promising,
    row_rooms,
    squarest_depth,
    squarest_rooms,
    strip_rooms,
    wing_rooms,
)

UNIT_M = 0.05
UNITS_PER_M = 20  # units per metre
UNITS_PER_M2 = UNITS_PER_M * UNITS_PER_M
WALL = INNER_WALL  # 0.10 m
OUTER_WALL = 6  # 0.30 m: the depth of the front door's reveal


Rectangle = tuple[int, int, int, int]
"""x0, y0, x1, y1 [units]."""


Areas = F64
"""Gross areas of rooms by their index [units²], float64 (rooms,)."""


class MisfitError(FloorPlanError):
    """A layout is none of a home: its rooms don't fit together as drawn, or can't be used."""


def overlap(a: Rectangle, b: Rectangle) -> bool:
    """Return whether two rectangles share more than their sides."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


class Box(NamedTuple):
    """A rectangle of a room [units], its low sides included in the clear space.

    Attributes:
        room: Index of its room; rooms may have several boxes.
        x0: Low side.
        y0: Low side.
        x1: High side, the far face of the wall.
        y1: High side, the far face of the wall.
    """

    room: int
    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def clear(self) -> tuple[int, int]:
        """Clear width and height [units]."""
        return self.x1 - self.x0 - WALL, self.y1 - self.y0 - WALL

    @property
    def clear_area(self) -> int:
        """Clear area [units²]."""
        width, height = self.clear
        return width * height

    @property
    def sides(self) -> Rectangle:
        """Its sides [units]."""
        return self.x0, self.y0, self.x1, self.y1

    def moved(self, x: int, y: int) -> "Box":
        """Return the box moved [units]."""
        return Box(self.room, self.x0 + x, self.y0 + y, self.x1 + x, self.y1 + y)

    def turned(self) -> "Box":
        """Return the box with x and y exchanged."""
        return Box(self.room, self.y0, self.x0, self.y1, self.x1)

    def mirrored(self) -> "Box":
        """Return the box with low and high x exchanged."""
        return Box(self.room, -self.x1, self.y0, -self.x0, self.y1)

    def flipped(self) -> "Box":
        """Return the box with low and high y exchanged."""
        return Box(self.room, self.x0, -self.y1, self.x1, -self.y0)


class Wall(NamedTuple):
    """The wall between two boxes, or between a box and outside.

    Attributes:
        first: Index of the box on its low side.
        second: Index of the box on its high side; -1 is outside, on either side.
        upright: Whether it runs along y.
        at: Its high face (x where upright, else y) [units].
        low: Where the clear wall begins along its length [units].
        high: Where that ends.
    """

    first: int
    second: int
    upright: bool
    at: int
    low: int
    high: int

    @property
    def length(self) -> int:
        """Its clear length [units]."""
        return self.high - self.low


def inner_walls(boxes: Sequence[Box]) -> list[Wall]:
    """Return the walls between boxes that touch along more than a corner."""
    walls = []
    for (i, a), (j, b) in combinations(enumerate(boxes), 2):
        if a.x1 == b.x0 or b.x1 == a.x0:
            low = max(a.y0, b.y0)
            high = min(a.y1, b.y1) - WALL
            pair = (i, j, True, a.x1) if a.x1 == b.x0 else (j, i, True, b.x1)
        elif a.y1 == b.y0 or b.y1 == a.y0:
            low = max(a.x0, b.x0)
            high = min(a.x1, b.x1) - WALL
            pair = (i, j, False, a.y1) if a.y1 == b.y0 else (j, i, False, b.y1)
        else:
            continue
        if high > low:
            walls.append(Wall(*pair, low, high))
    return walls


def outer_walls(boxes: Sequence[Box], walls: Sequence[Wall]) -> list[Wall]:
    """Return the parts of the boxes' sides that no other box touches."""
    outer = []
    for i, box in enumerate(boxes):
        below = [wall for wall in walls if wall.second == i]
        above = [wall for wall in walls if wall.first == i]
        for side, pair, touching, upright in (
            (box.x1, (i, -1), above, True),
            (box.x0, (-1, i), below, True),
            (box.y1, (i, -1), above, False),
            (box.y0, (-1, i), below, False),
        ):
            spans = sorted((wall.low, wall.high) for wall in touching if wall.upright == upright)
            low, high = (box.y0, box.y1) if upright else (box.x0, box.x1)
            for start, end in _gaps(spans, low, high - WALL):
                outer.append(Wall(*pair, upright, side, start, end))
    return outer


def _gaps(spans: Sequence[tuple[int, int]], low: int, high: int) -> list[tuple[int, int]]:
    """Return the parts of [low, high] that are at least a wall's thickness away from the spans."""
    gaps = []
    for start, end in spans:
        if start - WALL > low:
            gaps.append((low, start - WALL))
        low = max(low, end + WALL)
    if high > low:
        gaps.append((low, high))
    return gaps


def boxes_overlap(boxes: Sequence[Box]) -> bool:
    """Return whether any two boxes share more than their sides."""
    return any(overlap(a.sides, b.sides) for a, b in combinations(boxes, 2))


def turn_boxes(boxes: Sequence[Box], orientation: int) -> list[Box]:
    """Return the boxes in one of their eight orientations, turned and mirrored (0 to 7)."""
    oriented = list(boxes)
    if orientation & 1:
        oriented = [box.mirrored() for box in oriented]
    if orientation & 2:
        oriented = [box.flipped() for box in oriented]
    if orientation & 4:
        oriented = [box.turned() for box in oriented]
    x0 = min(b.x0 for b in oriented)
    y0 = min(b.y0 for b in oriented)
    return [box.moved(-x0, -y0) for box in oriented]


class Leaf(NamedTuple):
    """A room, or a share of it [%] where it is made of several rectangles."""

    room: int
    percent: int = 100


@dataclass(frozen=True)
class Cut:
    """Parts side by side: along x where `across`, else along y, from low to high."""

    across: bool
    parts: tuple["Tree", ...]


Tree: TypeAlias = Leaf | Cut
Slot: TypeAlias = tuple[int, ...]
"""A piece of a strip: one room, or one at the front (where its doors are) and one behind it."""


def gross_area(area_m2: float) -> float:
    """Return the area [units²] that a room of a clear area [m²] takes with its walls."""
    clear = area_m2 * UNITS_PER_M2
    return float(clear + 2.1 * WALL * sqrt(clear) + WALL * WALL)


def tree_area(tree: Tree, areas: Areas) -> float:
    """Return the gross area of all rooms of a tree [units²]."""
    if isinstance(tree, Leaf):
        return areas[tree.room] * tree.percent / 100
    return fsum(tree_area(part, areas) for part in tree.parts)


class TreeWays:
    """Ways to divide a rectangle among the same rooms.

    Attributes:
        trees: The trees, each with all the rooms.
    """

    def __init__(self, trees: Sequence[Tree]) -> None:
        """Take the trees."""
        self.trees = trees

    @cached_property
    def _table(self) -> Divisions:
        """The trees as the core reads them."""
        nodes: list[tuple[int, int]] = []
        starts = []
        for tree in self.trees:
            starts.append(len(nodes))
            _add_nodes(tree, nodes)
        return Divisions(np.array(nodes, np.int64), np.array(starts, np.int64))

    def area(self, areas: Areas) -> float:
        """Return the gross area of all their rooms [units²]."""
        return tree_area(self.trees[0], areas)

    def squarest(
        self, areas: Areas, sides: Rectangle, mouths: Sequence[Rectangle] = ()
    ) -> list[Box]:
        """Return the rooms of the tree that makes them squarest, the first if tied.

        Args:
            areas: Gross areas of the rooms [units²].
            sides: The rectangle (x0, y0, x1, y1) [units].
            mouths: Ends of corridors at a side of the rectangle [units]: no wall should end there.
        """
        ends = np.array(mouths, np.int64).reshape(-1, 4)
        return _boxes(squarest_rooms(self._table, areas, np.array(sides, np.int64), ends))


def _add_nodes(tree: Tree, nodes: list[tuple[int, int]]) -> None:
    """Add the nodes of a tree in preorder, as `Divisions` has them."""
    if isinstance(tree, Leaf):
        nodes.append(tree)
        return
    nodes.append((-2 if tree.across else -1, len(tree.parts)))
    for part in tree.parts:
        _add_nodes(part, nodes)


def _boxes(rows: I64) -> list[Box]:
    return [Box._make(row) for row in rows.tolist()]


@dataclass(frozen=True)
class Strip:
    """Rooms side by side along a line.

    Attributes:
        slots: From low to high along the line.
        bays: How much deeper than the strip each slot is [units]; negative for a recess.
    """

    slots: tuple[Slot, ...]
    bays: tuple[int, ...]

    def area(self, areas: Areas) -> float:
        """Return the area of its rooms [units²]."""
        return fsum(areas[room] for slot in self.slots for room in slot)

    @cached_property
    def table(self) -> I64:
        """Its slots as the core reads them: room, the one behind it or -1, and bay."""
        rows = [
            (slot[0], slot[1] if len(slot) > 1 else -1, bay)
            for slot, bay in zip(self.slots, self.bays, strict=True)
        ]
        return np.array(rows, np.int64)

    def boxes(self, areas: Areas, length: int, least: int) -> list[Box]:
        """Return its rooms along x, from 0 on, with their front at y = 0.

        Args:
            areas: Gross areas of the rooms [units²].
            length: Its length [units].
            least: Its least depth [units].

        Raises:
            MisfitError: It would have to be less deep.
        """
        return _fitting(strip_rooms(self.table, areas, length, least, DEEPEST_STRIP))


def _fitting(rows: I64) -> list[Box]:
    """Return the boxes that the core placed.

    Raises:
        MisfitError: There are none.
    """
    if not len(rows):
        raise MisfitError
    return _boxes(rows)


MIN_DEPTH = 44
MAX_DEPTH = 124


def row(strip: Strip, corridor: CorridorRule, areas: Areas, length: int) -> list[Box]:
    """Return the strip of rooms above a corridor from y = 0 on, and the corridor with its closet.

    Raises:
        MisfitError: They do not fit together.
    """
    return _fitting(row_rooms(strip.table, areas, corridor, length, MIN_DEPTH, MAX_DEPTH))


@dataclass(frozen=True)
class Wing:
    """The strips and corridor of a wing; it starts at x = 0, its corridor at y = 0.

    Attributes:
        front: The strip below the corridor.
        back: The strip above it.
        corridor: The corridor between them.
        back_depth: Depth of the back strip [units].
    """

    front: Strip
    back: Strip
    corridor: CorridorRule
    back_depth: int = 0

    def place(self, areas: Areas) -> "PlacedWing":
        """Place the wing's rooms.

        Args:
            areas: Gross areas of the rooms [units²].

        Raises:
            MisfitError: They do not fit together.
        """
        strips = self.front.table, self.back.table
        rows, depth = wing_rooms(
            *strips, areas, self.corridor, self.back_depth, MIN_DEPTH, MAX_DEPTH
        )
        return PlacedWing(_fitting(rows), -depth, self.corridor.width + self.back_depth)

    def squarest_depth(self, areas: Areas, depths: Sequence[int], limits: F64) -> int | None:
        """Return the depth of the back strip at which its rooms are squarest, or None.

        Args:
            areas: Gross areas of the rooms [units²].
            depths: Depths to try [units].
            limits: What `limits_of` returns.
        """
        strips = self.front.table, self.back.table
        tried = np.array(depths, np.int64)
        best = squarest_depth(*strips, areas, self.corridor, tried, MIN_DEPTH, MAX_DEPTH, limits)
        return None if best < 0 else depths[best]


class PlacedWing(NamedTuple):
    """A wing's rooms in its own frame.

    Attributes:
        boxes: The rooms.
        low: The y of its front [units].
        high: The y of its back [units].
    """

    boxes: list[Box]
    low: int
    high: int


@dataclass(frozen=True)
class LayoutRequest:
    """The request for a layout.

    Attributes:
        briefs: The rooms.
        area_m2: Area of the free space.
        corridor: Clear width of corridors [units].
        outline: One of `rectangle`, `L`, `T`, `U`, or None for any.
    """

    briefs: list[Brief]
    area_m2: float
    corridor: int
    outline: str | None


def are_promising(boxes: Sequence[Box], limits: F64) -> bool:
    """Return whether the rooms could fit at another scale: none is far too narrow or too long.

    Args:
        boxes: The rooms.
        limits: What `limits_of` returns.
    """
    return is_promising(np.array(boxes, np.int64), limits)


def limits_of(briefs: Sequence[Brief]) -> F64:
    """Return the least shorter side [units] and the largest ratio of sides of rooms that fit."""
    return np.array([_LIMITS[brief.kind] for brief in briefs])


_LIMITS = {
    kind: (0.88 * UNITS_PER_M * size.side, 1.6 * size.slender) for kind, size in SIZES.items()
}
