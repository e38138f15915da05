"""Whether a layout is a home, and how good a one."""

from collections.abc import Sequence

import shapely

from fleet2d.floorplan.synthetic.geometry import PER_M, Box, Wall
from fleet2d.floorplan.synthetic.layout import Layout
from fleet2d.floorplan.synthetic.program import SIZES

# Rooms with a window, and the outer wall that it takes [units].
_LIT = {"bedroom": 24, "living_room": 30, "kitchen": 16, "dining_room": 20, "office": 20}
MOST_CORRIDOR = 0.15
# A corridor beyond this is one of a hotel [units].
LONG_CORRIDOR = 150
LONGEST_CORRIDOR = 300
# Narrower open air between two parts of a home is a crack, not a court [units].
LEAST_COURT = 28
# Length of the home in its widths.
MOST_LONG = 2.8
_WANTED_SLENDER = 1.45


def shape_cost(layout: Layout, ease: float = 1.0) -> float | None:
    """Return how far the rooms' shapes are from what is comfortable; None for a bad one.

    Args:
        layout: The rooms.
        ease: How much longer than usual rooms and corridors may be.
    """
    cost = 0.0
    for box in layout.boxes:
        kind = layout.briefs[box.room].kind
        size = SIZES[kind]
        short, long = sorted(box.clear)
        if short < size.side * PER_M:
            return None
        if kind == "hallway":
            if long > LONGEST_CORRIDOR * ease:
                return None
            cost += 0.03 * max(long - LONG_CORRIDOR, 0)
            continue
        ratio = long / short
        alone = sum(b.room == box.room for b in layout.boxes) == 1
        if alone and ratio > size.slender * ease:
            return None
        over = max(ratio - _WANTED_SLENDER, 0.0)
        cost += over * over * (2.0 if kind in _LIT else 0.7)
    x0, y0 = min(b.x0 for b in layout.boxes), min(b.y0 for b in layout.boxes)
    x1, y1 = max(b.x1 for b in layout.boxes), max(b.y1 for b in layout.boxes)
    short, long = sorted((x1 - x0, y1 - y0))
    if long > MOST_LONG * short:
        return None
    cost += 4 * max(long / short - 1.5, 0.0)
    corridor = corridor_share(layout)
    if corridor > MOST_CORRIDOR:
        return None
    return cost + 12 * max(corridor - 0.06, 0.0)


def corridor_share(layout: Layout) -> float:
    """Return the part of the clear area that is hallway."""
    halls = sum(b.clear_area for b in layout.boxes if layout.briefs[b.room].kind == "hallway")
    return halls / sum(box.clear_area for box in layout.boxes)


def light_cost(layout: Layout, outer: Sequence[Wall]) -> float | None:
    """Return how badly rooms lack windows; None where a bedroom or the living room has none."""
    longest: dict[int, int] = {}
    for wall in outer:
        room = layout.boxes[max(wall.first, wall.second)].room
        longest[room] = max(longest.get(room, 0), wall.length)
    cost = 0.0
    for room, brief in enumerate(layout.briefs):
        needed = _LIT.get(brief.kind, 0)
        if longest.get(room, 0) >= needed:
            continue
        if brief.kind in ("bedroom", "living_room"):
            return None
        cost += 1.5
    return cost


def outline_corners(boxes: Sequence[Box]) -> list[bool]:
    """Return the corners of the outline in order, counter-clockwise: True where it turns left.

    Empty where the boxes leave a court or a narrow crack, or are in several parts.
    """
    union = shapely.union_all([shapely.box(b.x0, b.y0, b.x1, b.y1) for b in boxes])
    if not isinstance(union, shapely.Polygon) or union.interiors:
        return []
    half = LEAST_COURT / 2
    closed = union.buffer(half, join_style="mitre").buffer(-half, join_style="mitre")
    if closed.area > union.area + 1:
        return []
    ring = shapely.get_coordinates(shapely.orient_polygons(union))[:-1].tolist()
    turns = []
    for (ax, ay), (bx, by), (cx, cy) in zip(
        [ring[-1], *ring[:-1]], ring, [*ring[1:], ring[0]], strict=True
    ):
        turn = (bx - ax) * (cy - by) - (by - ay) * (cx - bx)
        if turn:
            turns.append(turn > 0)
    return turns


def outline_kind(turns: Sequence[bool]) -> str | None:
    """Return the letter that an outline looks like, or None for a richer one.

    Example:
        >>> outline_kind([True] * 4), outline_kind([True] * 5 + [False])
        ('rectangle', 'L')
        >>> outline_kind([True, True, False, False, True, True, True, True])
        'U'
    """
    notches = [i for i, left in enumerate(turns) if not left]
    if len(turns) == 4:
        return "rectangle"
    if len(turns) == 6:
        return "L"
    if len(turns) != 8 or len(notches) != 2:
        return None
    apart = min(notches[1] - notches[0], 8 - notches[1] + notches[0])
    return {1: "U", 3: "T"}.get(apart)
