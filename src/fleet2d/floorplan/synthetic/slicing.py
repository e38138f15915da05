"""Slice rectangles into rooms by area: a treemap, whose tree an architect would recognise.

After F. Marson and S. R. Musse, "Automatic real-time generation of floor plans based on squarified
treemaps algorithm", International Journal of Computer Games Technology 2010. They let a squarified
treemap divide the home into zones and zones into rooms; here the trees are drawn from those that
homes are built by (columns, rows, strips along a corridor) and the best of several is kept.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import fsum, sqrt
from typing import NamedTuple, TypeAlias

from fleet2d.floorplan.synthetic.geometry import PER_M2, WALL, Box

# Penalty, in slenderness, for a corridor that ends at the wall between two rooms.
MOUTH_PENALTY = 3.0
# Least width of a slot: a bathroom at the end of a deep strip gets larger, not narrower [units].
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
    clear = area_m2 * PER_M2
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
    """Return the rooms of that tree in which they are least slender; of equals, the first.

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
