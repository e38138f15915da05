"""Judge a layout: whether it is a home, and how comfortable its shapes are."""

from collections.abc import Sequence

import shapely

from fleet2d.floorplan.synthetic.geometry import PER_M, Box, Wall
from fleet2d.floorplan.synthetic.layout import RoomLayout
from fleet2d.floorplan.synthetic.program import SIZES
from fleet2d.runtime.determinism import sum_in_order

# Rooms that need a window, and the length of outer wall that it takes [units].
_LIT = {"bedroom": 24, "living_room": 30, "kitchen": 16, "dining_room": 20, "office": 20}
MAX_CORRIDOR_SHARE = 0.15
# A longer corridor, as in a hotel, costs points; the longest is refused [units].
LONG_CORRIDOR = 150
MAX_CORRIDOR = 300
# Narrower open air between two parts of a home is a crack, not a court [units].
MIN_COURT = 28
# Largest ratio of the home's length to its width.
MAX_ASPECT = 2.8
_COMFORTABLE_RATIO = 1.45


def shape_cost(layout: RoomLayout, ease: float = 1.0) -> float | None:
    """Return how far the rooms' shapes are from comfortable ones; None if one is unacceptable.

    Args:
        layout: The rooms.
        ease: Factor by which rooms and corridors may be longer than usual.
    """
    cost = 0.0
    for box in layout.boxes:
        kind = layout.briefs[box.room].kind
        size = SIZES[kind]
        short, long = sorted(box.clear)
        if short < size.side * PER_M:
            return None
        if kind == "hallway":
            if long > MAX_CORRIDOR * ease:
                return None
            cost += 0.03 * max(long - LONG_CORRIDOR, 0)
            continue
        ratio = long / short
        is_rectangle = sum(b.room == box.room for b in layout.boxes) == 1
        if is_rectangle and ratio > size.slender * ease:
            return None
        excess = max(ratio - _COMFORTABLE_RATIO, 0.0)
        cost += excess * excess * (2.0 if kind in _LIT else 0.7)
    x0, y0 = min(b.x0 for b in layout.boxes), min(b.y0 for b in layout.boxes)
    x1, y1 = max(b.x1 for b in layout.boxes), max(b.y1 for b in layout.boxes)
    short, long = sorted((x1 - x0, y1 - y0))
    if long > MAX_ASPECT * short:
        return None
    cost += 4 * max(long / short - 1.5, 0.0)
    corridor = corridor_share(layout)
    if corridor > MAX_CORRIDOR_SHARE:
        return None
    return cost + 12 * max(corridor - 0.06, 0.0)


def corridor_share(layout: RoomLayout) -> float:
    """Return the part of the clear area that is hallway."""
    halls = sum_in_order(
        b.clear_area for b in layout.boxes if layout.briefs[b.room].kind == "hallway"
    )
    return halls / sum_in_order(box.clear_area for box in layout.boxes)


def light_cost(layout: RoomLayout, outer: Sequence[Wall]) -> float | None:
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
    """Return for each corner of the outline, counter-clockwise, whether it turns left.

    An empty list if the boxes enclose a court or a narrow crack, or are in several parts.
    """
    union = shapely.union_all([shapely.box(b.x0, b.y0, b.x1, b.y1) for b in boxes])
    if not isinstance(union, shapely.Polygon) or union.interiors:
        return []
    half = MIN_COURT / 2
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
    """Return the letter that an outline resembles, or None for a richer one.

    Example:
        >>> outline_kind([True] * 4), outline_kind([True] * 5 + [False])
        ('rectangle', 'L')
        >>> outline_kind([True, True, False, False, True, True, True, True])
        'U'
    """
    right_turns = [i for i, is_left in enumerate(turns) if not is_left]
    if len(turns) == 4:
        return "rectangle"
    if len(turns) == 6:
        return "L"
    if len(turns) != 8 or len(right_turns) != 2:
        return None
    apart = min(right_turns[1] - right_turns[0], 8 - right_turns[1] + right_turns[0])
    return {1: "U", 3: "T"}.get(apart)
