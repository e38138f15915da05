"""Rectangles on a raster of 5 cm, the walls between them, and how they are cut into rooms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import fsum, sqrt
from typing import NamedTuple, TypeAlias

from fleet2d.floorplan.synthetic.program import SIZES, Brief

UNIT_M = 0.05
UNITS_PER_M = 20  # units per metre
UNITS_PER_M2 = UNITS_PER_M * UNITS_PER_M
WALL = 2  # 0.10 m: an inner wall
OUTER_WALL = 6  # 0.30 m: the depth of the front door's reveal


Rectangle = tuple[int, int, int, int]
"""x0, y0, x1, y1 [units]."""


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
    for i, a in enumerate(boxes):
        for j in range(i + 1, len(boxes)):
            b = boxes[j]
            if a.x1 < b.x0 or b.x1 < a.x0 or a.y1 < b.y0 or b.y1 < a.y0:
                continue
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
        touching: dict[tuple[bool, bool], list[tuple[int, int]]] = {
            (upright, high): [] for upright in (True, False) for high in (True, False)
        }
        for wall in walls:
            if i in (wall.first, wall.second):
                span = (wall.low, wall.high)
                touching[wall.upright, wall.first == i].append(span)
        for (upright, high), spans in touching.items():
            low_end, high_end = (box.y0, box.y1) if upright else (box.x0, box.x1)
            side = (box.x1 if upright else box.y1) if high else (box.x0 if upright else box.y0)
            pair = (i, -1) if high else (-1, i)
            for low, top in _gaps(sorted(spans), low_end, high_end - WALL):
                outer.append(Wall(*pair, upright, side, low, top))
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
    return any(
        a.x0 < b.x1 and b.x0 < a.x1 and a.y0 < b.y1 and b.y0 < a.y1
        for i, a in enumerate(boxes)
        for b in boxes[i + 1 :]
    )


def turn_boxes(boxes: Sequence[Box], orientation: int) -> list[Box]:
    """Return the boxes in one of their eight orientations, turned and mirrored (0 to 7)."""
    oriented = list(boxes)
    if orientation & 1:
        oriented = [Box(b.room, -b.x1, b.y0, -b.x0, b.y1) for b in oriented]
    if orientation & 2:
        oriented = [Box(b.room, b.x0, -b.y1, b.x1, -b.y0) for b in oriented]
    if orientation & 4:
        oriented = [Box(b.room, b.y0, b.x0, b.y1, b.x1) for b in oriented]
    x0, y0 = min(b.x0 for b in oriented), min(b.y0 for b in oriented)
    return [Box(b.room, b.x0 - x0, b.y0 - y0, b.x1 - x0, b.y1 - y0) for b in oriented]


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
    for part, (start, end) in zip(
        tree.parts,
        divide_span([tree_area(part, areas) for part in tree.parts], low, high),
        strict=True,
    ):
        if tree.across:
            boxes += slice_tree(part, areas, start, y0, end, y1)
        else:
            boxes += slice_tree(part, areas, x0, start, x1, end)
    return boxes


class Mouth(NamedTuple):
    """The end of a corridor at a rectangle's side.

    Attributes:
        upright: Whether that side runs along y.
        at: The coordinate of that side [units].
        low: The beginning of the corridor along it [units].
        high: The end of the corridor along it [units].
    """

    upright: bool
    at: int
    low: int
    high: int


def choose_squarest(
    trees: Sequence[Tree],
    areas: Mapping[int, float],
    sides: tuple[int, int, int, int],
    mouths: Sequence[Mouth] = (),
) -> list[Box]:
    """Return the rooms of the tree that makes them squarest, the first if tied.

    Args:
        trees: The trees to choose from.
        areas: Gross areas of the rooms [units²].
        sides: The rectangle (x0, y0, x1, y1) [units].
        mouths: Corridors that a wall should not end in.
    """
    layouts = [slice_tree(tree, areas, *sides) for tree in trees]
    return min(
        layouts,
        key=lambda boxes: slenderness(boxes) + MOUTH_PENALTY * _blocked_mouths(boxes, mouths),
    )


def _blocked_mouths(boxes: Sequence[Box], mouths: Sequence[Mouth]) -> int:
    """Return how many corridors do not end at a single room."""
    return sum(not any(_meets(box, mouth) for box in boxes) for mouth in mouths)


def _meets(box: Box, mouth: Mouth) -> bool:
    if mouth.upright:
        return mouth.at in (box.x0, box.x1) and box.y0 <= mouth.low and mouth.high <= box.y1
    return mouth.at in (box.y0, box.y1) and box.x0 <= mouth.low and mouth.high <= box.x1


def slenderness(boxes: Sequence[Box]) -> float:
    """Return how far rooms are from squares: 0 where no side is over 1.2 times the other."""
    total = 0.0
    for _, x0, y0, x1, y1 in boxes:
        width, height = x1 - x0 - WALL, y1 - y0 - WALL
        ratio = (
            (width / height if height > 0 else 99.0) if width > height else height / max(width, 1)
        )
        if ratio > 1.2:
            total += (ratio - 1.2) * (ratio - 1.2)
    return total


def divide_span(sizes: Sequence[float], low: int, high: int) -> list[tuple[int, int]]:
    """Divide [low, high] in proportion to sizes, without gaps."""
    total = fsum(sizes)
    ends, reached = [low], 0.0
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

    def widths(self, areas: Mapping[int, float], depth: float) -> list[float]:
        """Return the widths of its slots [units] at a depth [units]."""
        widths = []
        for slot, bay in zip(self.slots, self.bays, strict=True):
            area = areas[slot[0]]
            if len(slot) > 1:
                area += areas[slot[1]]
            widths.append(max(area / (depth + bay), MIN_SLOT_WIDTH))
        return widths

    def depth(self, areas: Mapping[int, float], length: float) -> int:
        """Return the depth [units] at which it has a length [units]; 0 for none below 12 m."""
        total = fsum(areas[room] for slot in self.slots for room in slot)
        depth = total / length if not any(self.bays) else 0.0
        low, high = max(20, 20 - min(self.bays)), 240
        if depth:
            return int(depth + 0.5) if low <= depth <= high else 0
        if fsum(self.widths(areas, low)) < length:
            return 0
        while high - low > 1:
            middle = (low + high) // 2
            if fsum(self.widths(areas, middle)) > length:
                low = middle
            else:
                high = middle
        return high

    def boxes(
        self, areas: Mapping[int, float], length: int, depth: int, front: int, away: int
    ) -> list[Box]:
        """Return its rooms along x, from 0 on, with their front at y = `front`.

        Args:
            areas: Gross areas of the rooms [units²].
            length: Its length [units].
            depth: Its depth [units].
            front: y of its front [units].
            away: 1 to extend upwards from its front, -1 downwards.
        """
        boxes: list[Box] = []
        spans = divide_span(self.widths(areas, depth), 0, length)
        for slot, bay, (x0, x1) in zip(self.slots, self.bays, spans, strict=True):
            back = front + away * (depth + bay)
            if len(slot) == 1:
                boxes.append(Box(slot[0], x0, min(front, back), x1, max(front, back)))
                continue
            first, second = areas[slot[0]], areas[slot[1]]
            middle = front + away * int((depth + bay) * first / (first + second) + 0.5)
            boxes.append(Box(slot[0], x0, min(front, middle), x1, max(front, middle)))
            boxes.append(Box(slot[1], x0, min(middle, back), x1, max(middle, back)))
        return boxes


MIN_DEPTH = 44
MAX_DEPTH = 124
# How much of the corridor the last room of the front strip needs for its door [units].
REACH = 25


@dataclass(frozen=True)
class Wing:
    """The strips and corridor of a wing; it starts at x = 0, its corridor at y = 0.

    Attributes:
        front: The strip below the corridor.
        back: The strip above it.
        corridor: Index of the hallway, or None where the strips meet.
        width: Gross width of the corridor [units].
        back_depth: Depth of the back strip [units].
        suite: Whether the last room of the back strip ends the corridor, and is as much deeper.
        closet: A small room at the end of the corridor, or None.
    """

    front: Strip
    back: Strip
    corridor: int | None
    width: int
    back_depth: int
    suite: bool
    closet: int | None = None

    def place(self, areas: Mapping[int, float]) -> "PlacedWing | None":
        """Place the wing's rooms; None where they do not fit together.

        Args:
            areas: Gross areas of the rooms [units²].
        """
        back = self._suite_strip()
        length = int(fsum(back.widths(areas, self.back_depth)) + 0.5)
        depth = self.front.depth(areas, length)
        if not MIN_DEPTH <= depth <= MAX_DEPTH:
            return None
        boxes = self.front.boxes(areas, length, depth, 0, -1)
        upper = back.boxes(areas, length, self.back_depth, self.width, 1)
        end = length
        if self.suite:
            suite = upper[-1]  # extends down over the corridor instead of up
            upper[-1] = Box(suite.room, suite.x0, 0, suite.x1, suite.y1 - self.width)
            end = suite.x0
            if boxes[-1].x0 > end - REACH:
                return replace(self, suite=False).place(areas)
        if self.closet is not None:
            depth_of_closet = int(areas[self.closet] / self.width + 0.5)
            end -= min(max(depth_of_closet, 24), 52)
            boxes.append(Box(self.closet, end, 0, length, self.width))
        if self.corridor is not None:
            if end < 24:
                return None
            boxes.append(Box(self.corridor, 0, 0, end, self.width))
        return PlacedWing([*boxes, *upper], length, -depth, self.width + self.back_depth)

    def _suite_strip(self) -> Strip:
        """Return the back strip, its last slot as much deeper as the corridor is wide."""
        if not self.suite:
            return self.back
        *bays, last = self.back.bays
        return Strip(self.back.slots, (*bays, last + self.width))


@dataclass(frozen=True)
class PlacedWing:
    """A wing's rooms in its own frame.

    Attributes:
        boxes: The rooms.
        length: How far it reaches along x [units].
        low: The y of its front [units].
        high: The y of its back [units].
    """

    boxes: list[Box]
    length: int
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
        edition: Of the generator.
    """

    briefs: list[Brief]
    area_m2: float
    corridor: int
    outline: str | None
    edition: int


def is_promising(boxes: Sequence[Box], briefs: Sequence[Brief]) -> bool:
    """Return whether the rooms could fit at another scale: none is far too narrow or too long."""
    for room, x0, y0, x1, y1 in boxes:
        width, height = x1 - x0 - WALL, y1 - y0 - WALL
        short, long = (width, height) if width < height else (height, width)
        size = SIZES[briefs[room].kind]
        if short < 0.88 * UNITS_PER_M * size.side or long > 1.6 * size.slender * short:
            return False
    return True
