"""The request for a layout, and whether its rooms can fit at another scale."""

from collections.abc import Sequence
from dataclasses import dataclass

from fleet2d.floorplan.synthetic.geometry import PER_M, WALL, Box
from fleet2d.floorplan.synthetic.program import SIZES, Brief


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
        if short < 0.88 * PER_M * size.side or long > 1.6 * size.slender * short:
            return False
    return True
