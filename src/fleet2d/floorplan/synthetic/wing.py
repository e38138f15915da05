"""A wing: rooms in a strip on either side of a corridor, the spine of the plan."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import fsum

from fleet2d.floorplan.synthetic.geometry import Box
from fleet2d.floorplan.synthetic.slicing import Strip

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
