"""Rectangles on a grid of 5 cm, and the walls between them.

A box goes from wall to wall: its clear space ends `WALL` before its high sides, so boxes that touch
have a wall of that thickness between them.
"""

from collections.abc import Sequence
from typing import NamedTuple

UNIT_M = 0.05
PER_M = 20  # units per metre
PER_M2 = PER_M * PER_M
WALL = 2  # 0.10 m: an inner wall
OUTER_WALL = 6  # 0.30 m: the depth of the front door's reveal


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
