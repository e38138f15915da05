"""What a layout is drawn for, and whether a room can become what it is for."""

from collections.abc import Sequence
from dataclasses import dataclass

from fleet2d.floorplan.synthetic.geometry import PER_M, WALL, Box
from fleet2d.floorplan.synthetic.program import SIZES, Brief


@dataclass(frozen=True)
class Request:
    """What layouts are drawn for.

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


def promising(boxes: Sequence[Box], briefs: Sequence[Brief]) -> bool:
    """Tell whether rooms are not so slender that no other scale can help."""
    for room, x0, y0, x1, y1 in boxes:
        wide, high = x1 - x0 - WALL, y1 - y0 - WALL
        short, long = (wide, high) if wide < high else (high, wide)
        size = SIZES[briefs[room].kind]
        if short < 0.88 * PER_M * size.side or long > 1.6 * size.slender * short:
            return False
    return True
