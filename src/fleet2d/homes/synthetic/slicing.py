"""Rectangles on a raster of 5 cm, the walls between them, and how they are cut into rooms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from math import fsum, sqrt
from typing import NamedTuple, TypeAlias

from fleet2d.errors import FloorPlanError
from fleet2d.homes.synthetic.program import SIZES, Brief

UNIT_M = 0.05
UNITS_PER_M = 20  # units per metre
UNITS_PER_M2 = UNITS_PER_M * UNITS_PER_M
WALL = 2  # 0.10 m: an inner wall
OUTER_WALL = 6  # 0.30 m: the depth of the front door's reveal


Rectangle = tuple[int, int, int, int]
"""x0, y0, x1, y1 [units]."""


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
            low, high = max(a.y0, b.y0), min(a.y1, b.y1) - WALL
            pair = (i, j, True, a.x1) if a.x1 == b.x0 else (j, i, True, b.x1)
        elif a.y1 == b.y0 or b.y1 == a.y0:
            low, high = max(a.x0, b.x0), min(a.x1, b.x1) - WALL
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
    x0, y0 = min(b.x0 for b in oriented), min(b.y0 for b in oriented)
    return [box.moved(-x0, -y0) for box in oriented]


# Penalty, in slenderness, for a corridor that ends at the wall between two rooms.
MOUTH_PENALTY = 3.0
# Minimum width of a slot: a bathroom at the end of a deep strip gets larger, not narrower [units].
MIN_SLOT_WIDTH = 35.0


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


def tree_area(tree: Tree, areas: Mapping[int, float]) -> float:
    """Return the gross area of all rooms of a tree [units²]."""
    if isinstance(tree, Leaf):
        return areas[tree.room] * tree.percent / 100
    return fsum(tree_area(part, areas) for part in tree.parts)


def slice_tree(
    tree: Tree, areas: Mapping[int, float], x0: int, y0: int, x1: int, y1: int
) -> list[Box]:
    """Return the rooms of a tree in a rectangle, in proportion to their areas."""
    if isinstance(tree, Leaf):
        return [Box(tree.room, x0, y0, x1, y1)]
    low, high = (x0, x1) if tree.across else (y0, y1)
    boxes: list[Box] = []
    spans = divide_span([tree_area(part, areas) for part in tree.parts], low, high)
    for part, (start, end) in zip(tree.parts, spans, strict=True):
        if tree.across:
            boxes += slice_tree(part, areas, start, y0, end, y1)
        else:
            boxes += slice_tree(part, areas, x0, start, x1, end)
    return boxes


def choose_squarest(
    trees: Sequence[Tree],
    areas: Mapping[int, float],
    sides: Rectangle,
    mouths: Sequence[Rectangle] = (),
) -> list[Box]:
    """Return the rooms of the tree that makes them squarest, the first if tied.

    Args:
        trees: The trees to choose from.
        areas: Gross areas of the rooms [units²].
        sides: The rectangle (x0, y0, x1, y1) [units].
        mouths: Ends of corridors at a side of the rectangle [units]: no wall should end there.
    """

    def penalty(boxes: list[Box]) -> float:
        return slenderness(boxes) + MOUTH_PENALTY * _blocked_mouths(boxes, mouths)

    return min((slice_tree(tree, areas, *sides) for tree in trees), key=penalty)


def _blocked_mouths(boxes: Sequence[Box], mouths: Sequence[Rectangle]) -> int:
    """Return how many corridors do not end at a single room."""
    return sum(
        not any(b.x0 <= x0 and x1 <= b.x1 and b.y0 <= y0 and y1 <= b.y1 for b in boxes)
        for x0, y0, x1, y1 in mouths
    )


def slenderness(boxes: Sequence[Box]) -> float:
    """Return how far rooms are from squares: 0 where no side is over 1.2 times the other."""
    total = 0.0
    for _, x0, y0, x1, y1 in boxes:
        width, height = x1 - x0 - WALL, y1 - y0 - WALL
        if width > height:
            ratio = width / height if height > 0 else 99.0
        else:
            ratio = height / max(width, 1)
        if ratio > 1.2:
            total += (ratio - 1.2) * (ratio - 1.2)
    return total


def divide_span(sizes: Sequence[float], low: int, high: int) -> list[tuple[int, int]]:
    """Divide [low, high] in proportion to sizes, without gaps."""
    total = fsum(sizes)
    ends = [low]
    reached = 0.0
    for size in sizes:
        reached += size
        ends.append(low + int((high - low) * reached / total + 0.5))
    return list(pairwise(ends))


@dataclass(frozen=True)
class Strip:
    """Rooms side by side along a line.

    Attributes:
        slots: From low to high along the line.
        bays: How much deeper than the strip each slot is [units]; negative for a recess.
    """

    slots: tuple[Slot, ...]
    bays: tuple[int, ...]

    def area(self, areas: Mapping[int, float]) -> float:
        """Return the area of its rooms [units²]."""
        return fsum(areas[room] for slot in self.slots for room in slot)

    def widths(self, areas: Mapping[int, float], depth: float) -> list[float]:
        """Return the widths of its slots [units] at a depth [units]."""
        return _slot_widths(self._sizes(areas), depth)

    def _sizes(self, areas: Mapping[int, float]) -> list[tuple[float, int]]:
        """Return the gross area [units²] and the bay of each slot."""
        sizes = []
        for slot, bay in zip(self.slots, self.bays, strict=True):
            size = areas[slot[0]]
            if len(slot) > 1:
                size += areas[slot[1]]
            sizes.append((size, bay))
        return sizes

    def depth(self, areas: Mapping[int, float], length: float) -> int:
        """Return the depth [units] at which it has a length [units]; 0 for none below 12 m."""
        depth = self.area(areas) / length if not any(self.bays) else 0.0
        low, high = max(20, 20 - min(self.bays)), 240
        if depth:
            return int(depth + 0.5) if low <= depth <= high else 0
        sizes = self._sizes(areas)
        if fsum(_slot_widths(sizes, low)) < length:
            return 0
        while high - low > 1:
            middle = (low + high) // 2
            if fsum(_slot_widths(sizes, middle)) > length:
                low = middle
            else:
                high = middle
        return high

    def boxes(self, areas: Mapping[int, float], length: int, depth: int) -> list[Box]:
        """Return its rooms along x, from 0 on, with their front at y = 0.

        Args:
            areas: Gross areas of the rooms [units²].
            length: Its length [units].
            depth: Its depth [units].
        """
        boxes: list[Box] = []
        spans = divide_span(self.widths(areas, depth), 0, length)
        for slot, bay, (x0, x1) in zip(self.slots, self.bays, spans, strict=True):
            back = depth + bay
            if len(slot) == 1:
                boxes.append(Box(slot[0], x0, 0, x1, back))
                continue
            first = areas[slot[0]]
            second = areas[slot[1]]
            middle = int(back * first / (first + second) + 0.5)
            boxes += [Box(slot[0], x0, 0, x1, middle), Box(slot[1], x0, middle, x1, back)]
        return boxes

    def deepened_at_end(self, depth: int) -> "Strip":
        """Return the strip with its last slot as much deeper [units]."""
        return replace(self, bays=(*self.bays[:-1], self.bays[-1] + depth))


def _slot_widths(sizes: Sequence[tuple[float, int]], depth: float) -> list[float]:
    """Return the widths of slots of some gross areas and bays at a depth [units]."""
    return [max(size / (depth + bay), MIN_SLOT_WIDTH) for size, bay in sizes]


MIN_DEPTH = 44
MAX_DEPTH = 124
# How much of the corridor the last room of the front strip needs for its door [units].
REACH = 25


@dataclass(frozen=True)
class Corridor:
    """A corridor along a strip of rooms.

    Attributes:
        hall: Index of the hallway.
        width: Its gross width [units].
        suite: Whether the last room of the strip ends the corridor, and is as much deeper.
        closet: A small room at the end of the corridor, or None.
    """

    hall: int
    width: int
    suite: bool
    closet: int | None = None

    def beside(self, strip: list[Box], areas: Mapping[int, float]) -> tuple[list[Box], list[Box]]:
        """Return the corridor from y = 0 on, with its closet, and the strip of rooms above it.

        Args:
            strip: The rooms along x, with their front at y = 0.
            areas: Gross areas of the rooms [units²].

        Raises:
            MisfitError: There is no space for a corridor.
        """
        above = [box.moved(0, self.width) for box in strip]
        length = end = strip[-1].x1
        if self.suite:
            end = strip[-1].x0
            above = [new if new.x0 < end else old for old, new in zip(strip, above, strict=True)]
        hallway: list[Box] = []
        if self.closet is not None:
            end -= min(max(int(areas[self.closet] / self.width + 0.5), 24), 52)
            hallway = [Box(self.closet, end, 0, length, self.width)]
        if end < 24:
            raise MisfitError
        return [*hallway, Box(self.hall, 0, 0, end, self.width)], above


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
    corridor: Corridor
    back_depth: int

    def place(self, areas: Mapping[int, float]) -> "PlacedWing":
        """Place the wing's rooms.

        Args:
            areas: Gross areas of the rooms [units²].

        Raises:
            MisfitError: They do not fit together.
        """
        width = self.corridor.width
        is_suite = self.corridor.suite
        back = self.back.deepened_at_end(width) if is_suite else self.back
        length = int(fsum(back.widths(areas, self.back_depth)) + 0.5)
        depth = self.front.depth(areas, length)
        if not MIN_DEPTH <= depth <= MAX_DEPTH:
            raise MisfitError
        front = [box.flipped() for box in self.front.boxes(areas, length, depth)]
        strip = back.boxes(areas, length, self.back_depth)
        if is_suite and front[-1].x0 > strip[-1].x0 - REACH:
            return replace(self, corridor=replace(self.corridor, suite=False)).place(areas)
        hallway, above = self.corridor.beside(strip, areas)
        return PlacedWing([*front, *hallway, *above], -depth, width + self.back_depth)


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


def is_promising(boxes: Sequence[Box], briefs: Sequence[Brief]) -> bool:
    """Return whether the rooms could fit at another scale: none is far too narrow or too long."""
    for room, x0, y0, x1, y1 in boxes:
        width, height = x1 - x0 - WALL, y1 - y0 - WALL
        short, long = (width, height) if width < height else (height, width)
        size = SIZES[briefs[room].kind]
        if short < 0.88 * UNITS_PER_M * size.side or long > 1.6 * size.slender * short:
            return False
    return True
