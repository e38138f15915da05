"""Generate a home: link the rooms of many layouts by doors, judge each, and finish the best."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import shapely

from fleet2d.errors import NoLayoutError
from fleet2d.homes.synthetic.plans import RoomLayout, draw_layout
from fleet2d.homes.synthetic.program import (
    SIZES,
    WIDE_FROM_M2,
    Brief,
    Choices,
    Style,
    Wishes,
    choose_rooms,
    settle_wishes,
)
from fleet2d.homes.synthetic.slicing import (
    UNITS_PER_M,
    UNITS_PER_M2,
    WALL,
    Box,
    LayoutRequest,
    MisfitError,
    Rectangle,
    Wall,
    boxes_overlap,
    inner_walls,
    outer_walls,
    overlap,
    turn_boxes,
)
from fleet2d.runtime.determinism import sum_in_order

# The largest cost that taste adds to a passage and to a layout, at a variety of 1.
LINK_TASTE = 2
LAYOUT_TASTE = 12
JAMB = 2  # minimum distance of a door from the corner of a room [units]
STUB = 4  # length of wall that is left beside openings of an open plan [units]


class Gap(NamedTuple):
    """A passage through a wall.

    Attributes:
        wall: The wall.
        low: Its first jamb along the wall [units].
        high: Its other jamb [units].
        leaf: Whether a door hangs in it; None where the two sides are one room.
    """

    wall: Wall
    low: int
    high: int
    leaf: bool | None


Prices = Mapping[tuple[str, str], float]
"""The costs of passages by the types of their two rooms."""
# Cost of a passage between two types of rooms; other pairs never open to each other.
_COSTS: dict[str, dict[str, float]] = {
    "entryway": {"hallway": 0, "living_room": 0, "dining_room": 1.5, "kitchen": 3},
    "hallway": {"living_room": 0.2, "dining_room": 1.2, "kitchen": 2.5, "hallway": 0},
    "living_room": {"dining_room": 0, "kitchen": 0.6},
    "dining_room": {"kitchen": 0},
    "bedroom": {"hallway": 0, "entryway": 0.8, "living_room": 0.8, "dining_room": 3},
    "bathroom": {"hallway": 0, "entryway": 0.6, "living_room": 1.2, "laundry": 3, "dining_room": 4},
    "toilet": {"hallway": 0, "entryway": 0, "laundry": 1, "living_room": 2.5},
    "office": {"hallway": 0, "entryway": 0, "living_room": 0.8, "dining_room": 1.5},
    "gym": {"hallway": 0, "living_room": 1.5, "garage": 1.5, "laundry": 2.5, "dining_room": 2},
    "laundry": {
        "kitchen": 0, "hallway": 0.2, "garage": 0.5, "entryway": 1, "dining_room": 2,
        "living_room": 3,
    },
    "storage": {
        "hallway": 0, "kitchen": 0.2, "entryway": 0.2, "laundry": 0.3, "garage": 0.5,
        "dining_room": 2, "living_room": 2.5,
    },
    "garage": {
        "laundry": 0, "entryway": 0.3, "hallway": 0.3, "storage": 1, "kitchen": 0.8,
    },
}  # fmt: skip
_PAIRS = {(a, b): cost for a, row in _COSTS.items() for b, cost in row.items()}
# Links that old flats have, and that homes have only where they vary.
_RARE_PAIRS = {
    ("bathroom", "kitchen"): 1.5,
    ("toilet", "kitchen"): 2.0,
    ("bedroom", "kitchen"): 2.5,
}
COSTS: Prices = _PAIRS | {(b, a): cost for (a, b), cost in _PAIRS.items()}
# Rooms through which the way to other rooms may lead; through those of service only to others of
# service.
_PASSABLE = ("entryway", "hallway", "living_room", "dining_room", "kitchen")
_PASSABLE_SERVICE = ("laundry", "garage")
_SERVICE = (*_PASSABLE_SERVICE, "storage", "gym")
# Between these a passage needs no jambs: a corridor of 1 m may end in a door of 0.9 m.
_WITHOUT_JAMBS = {"hallway", "entryway", "living_room", "dining_room", "kitchen"}
_SOCIAL = ("living_room", "dining_room", "kitchen")


@dataclass(frozen=True)
class Widths:
    """Widths of passages [units].

    Attributes:
        door: Between rooms.
        bath: To bathrooms, toilets and small rooms.
        corridor: Clear width of hallways.
        open_plan: Whether living, dining and kitchen are open to each other.
        prices: The cost of a passage by the types of its two rooms.
    """

    door: int
    bath: int
    corridor: int
    open_plan: bool
    prices: Prices

    def of(self, kinds: set[str]) -> int:
        """Return the width of a door between rooms of two kinds."""
        small = kinds & {"bathroom", "toilet", "wardrobe", "storage", "laundry"}
        return self.bath if small and "garage" not in kinds else self.door


Pair = frozenset[int]
"""Two boxes."""
RoomLinks = dict[tuple[int, int], tuple[float, Wall]]
"""The cost of a passage between two rooms, and the wall that it is in, by their indices."""


def link_rooms(layout: RoomLayout, best: RoomLinks) -> tuple[list[Wall], float]:
    """Return the tree of links that joins all rooms at the lowest cost, and that cost.

    Prim's algorithm from the entryway, else the living room. Nobody has to pass through a private
    room, except to the bathroom or wardrobe that belongs to it.

    Raises:
        MisfitError: There is no such tree.
    """
    kinds = [brief.kind for brief in layout.briefs]
    start = kinds.index("entryway" if "entryway" in kinds else "living_room")
    reached = {start}
    links = []
    cost = 0.0
    while len(reached) < len(kinds):
        candidates = [
            (price, pair, wall)
            for pair, (price, wall) in best.items()
            if (pair[0] in reached) != (pair[1] in reached)
            and _passable(layout.briefs, *(pair if pair[0] in reached else pair[::-1]))
        ]
        if not candidates:
            raise MisfitError
        price, pair, wall = min(candidates, key=lambda link: link[:2])
        reached.update(pair)
        links.append(wall)
        cost += price
    return links, cost


def _passable(briefs: Sequence[Brief], through: int, to: int) -> bool:
    """Return whether the way to a room may lead through another."""
    if briefs[through].kind in _SERVICE:
        return briefs[through].kind in _PASSABLE_SERVICE and briefs[to].kind in _SERVICE
    if briefs[to].kind in ("kitchen", "dining_room"):  # these belong to the living space
        return briefs[through].kind in _SOCIAL
    return briefs[through].kind in _PASSABLE or briefs[to].partner == through


def _best_links(layout: RoomLayout, walls: Sequence[Wall], widths: Widths) -> RoomLinks:
    """Return the cost and the longest common wall of each pair of rooms that may be linked."""
    briefs = layout.briefs
    best: RoomLinks = {}
    for wall in walls:
        a, b = layout.rooms(wall)
        if a == b:
            continue
        kinds = layout.kinds(wall)
        price = widths.prices.get((briefs[a].kind, briefs[b].kind))
        if briefs[a].partner is not None or briefs[b].partner is not None:
            price = 0.0 if briefs[a].partner == b or briefs[b].partner == a else None
        needed = widths.of(kinds) + (0 if kinds <= _WITHOUT_JAMBS else 2 * JAMB)
        if price is None or wall.length < needed:
            continue
        if (a, b) not in best or wall.length > best[a, b][1].length:
            best[a, b] = (price, wall)
    return best


def add_loops(best: "_Candidate", choices: Choices) -> list[Wall]:
    """Return the links of a layout and a few more, since real homes have circular routes.

    In an open plan only two of the three borders between living room, dining room and kitchen are
    open: three would leave a post in the middle.
    """
    links = list(best.links)
    open_pairs = {best.layout.rooms(wall) for wall in links}
    for pair, (price, wall) in best.possible.items():
        kinds = {best.layout.briefs[room].kind for room in pair}
        percent = 0
        if kinds <= set(_SOCIAL):
            percent = 45 if not best.widths.open_plan else 0
        elif kinds <= {*_SOCIAL, "hallway", "entryway"}:
            percent = 60 if price < 1 else 20
        elif kinds & {"laundry", "garage", "storage"} and price <= 0.3:
            percent = 30
        if pair not in open_pairs and choices.chance(percent):
            links.append(wall)
            open_pairs.add(pair)
    return links


def draw_gaps(
    layout: RoomLayout, walls: Sequence[Wall], links: set[Pair], widths: Widths, choices: Choices
) -> list[Gap]:
    """Draw the passages: openings between living spaces, elsewhere doors near a corner.

    Args:
        layout: The rooms.
        walls: The walls between their boxes.
        links: The pairs of boxes that a passage links.
        widths: The widths of passages.
        choices: The stream to draw from.
    """
    inside = [wall for wall in walls if len(set(layout.rooms(wall))) == 1]
    gaps = [Gap(wall, wall.low, wall.high, None) for wall in inside]
    for wall in walls:
        if frozenset((wall.first, wall.second)) not in links:
            continue
        kinds = layout.kinds(wall)
        opening = _opening(kinds, wall, widths, choices)
        if opening:
            gaps.append(Gap(wall, *opening, False))
            continue
        width = widths.of(kinds)
        spare = wall.length - width
        # A door stands near a corner, so that the rest of the wall is of use.
        aside = min(choices.between(JAMB, 5), spare // 2)
        at = wall.low + (aside if choices.chance(50) else spare - aside)
        gaps.append(Gap(wall, at, at + width, True))
    return gaps


def _opening(
    kinds: set[str], wall: Wall, widths: Widths, choices: Choices
) -> tuple[int, int] | None:
    """Return the jambs of an opening without a door, or None for a door."""
    if kinds <= set(_SOCIAL):
        if widths.open_plan:
            return wall.low + STUB, wall.high - STUB
        if choices.chance(30):
            return None
        width = min(choices.between(28, 56), wall.length - 8)
    elif kinds in ({"hallway", "living_room"}, {"hallway", "dining_room"}) and wall.length < 40:
        return (wall.low, wall.high) if choices.chance(60) else None
    elif kinds <= {"hallway", "entryway"} or (
        kinds <= {"hallway", "entryway", *_SOCIAL} and choices.chance(60)
    ):
        width = min(wall.length - 8, choices.between(24, 40))
    else:
        return None
    if width < widths.door:
        return None
    low = wall.low + (wall.length - width) // 2
    return low, low + width


# Rooms that need a window, and the length of outer wall that it takes [units].
_LIT = {"bedroom": 24, "living_room": 30, "kitchen": 16, "dining_room": 20, "office": 20}
# Largest part of a home that is corridor, and the part from which on it costs points.
MAX_CORRIDOR_SHARE = 0.35
COSTLY_CORRIDOR_SHARE = 0.25
# A longer corridor, as in a hotel, costs points; the longest is refused [units].
LONG_CORRIDOR = 150
MAX_CORRIDOR = 300
# Smallest and largest bathroom [m²].
BATHROOM_M2 = (3.05, 8.8)
# Narrower open air between two parts of a home is a crack, not a court [units].
MIN_COURT = 28
# Largest ratio of the home's length to its width.
MAX_ASPECT = 2.3
# From this ratio on it costs points, and how many.
LONG_ASPECT = 1.5
LONG_COST = 12
_COMFORTABLE_RATIO = 1.45


def shape_cost(layout: RoomLayout, ease: float) -> float:
    """Return how far the rooms' shapes are from comfortable ones.

    Args:
        layout: The rooms.
        ease: Factor by which rooms and corridors may be longer than usual.

    Raises:
        MisfitError: One is unacceptable.
    """
    cost = 0.0
    for box in layout.boxes:
        kind = layout.briefs[box.room].kind
        size = SIZES[kind]
        short, long = sorted(box.clear)
        if short < size.side * UNITS_PER_M:
            raise MisfitError
        if kind == "hallway":
            if long > MAX_CORRIDOR * ease:
                raise MisfitError
            cost += 0.03 * max(long - LONG_CORRIDOR, 0)
            continue
        ratio = long / short
        is_rectangle = sum(b.room == box.room for b in layout.boxes) == 1
        if is_rectangle and ratio > size.slender * ease:
            raise MisfitError
        excess = max(ratio - _COMFORTABLE_RATIO, 0.0)
        cost += excess * excess * (2.0 if kind in _LIT else 0.7)
    x0 = min(b.x0 for b in layout.boxes)
    y0 = min(b.y0 for b in layout.boxes)
    x1 = max(b.x1 for b in layout.boxes)
    y1 = max(b.y1 for b in layout.boxes)
    short, long = sorted((x1 - x0, y1 - y0))
    if long > MAX_ASPECT * short:
        raise MisfitError
    cost += LONG_COST * max(long / short - LONG_ASPECT, 0.0)
    halls = [box for box in layout.boxes if layout.briefs[box.room].kind == "hallway"]
    hall_area = sum_in_order(hall.clear_area for hall in halls)
    corridor = hall_area / sum_in_order(box.clear_area for box in layout.boxes)
    if corridor > MAX_CORRIDOR_SHARE:
        raise MisfitError
    return cost + 12 * max(corridor - COSTLY_CORRIDOR_SHARE, 0.0)


def check_light(layout: RoomLayout, outer: Sequence[Wall]) -> None:
    """Refuse rooms without the outer wall that they need for a window.

    Raises:
        MisfitError: There is such a room.
    """
    lit = set()
    for wall in outer:
        room = layout.room_inside(wall)
        if wall.length >= _LIT.get(layout.briefs[room].kind, 0):
            lit.add(room)
    if any(b.kind in _LIT and room not in lit for room, b in enumerate(layout.briefs)):
        raise MisfitError


def check_sizes(layout: RoomLayout) -> None:
    """Refuse what an architect would: bathrooms like halls, and rooms above the living room.

    Raises:
        MisfitError: There is such a room.
    """
    areas = room_areas(layout)
    living = _living_area(layout, areas)
    for area, brief in zip(areas, layout.briefs, strict=True):
        kind = brief.kind
        if kind == "bathroom" and not BATHROOM_M2[0] <= area / UNITS_PER_M2 <= BATHROOM_M2[1]:
            raise MisfitError
        if kind != "garage" and area > living:
            raise MisfitError


def room_areas(layout: RoomLayout) -> list[int]:
    """Return the clear areas of rooms [units²], without what joins boxes of one room."""
    areas = [0] * len(layout.briefs)
    for box in layout.boxes:
        areas[box.room] += box.clear_area
    return areas


def _living_area(layout: RoomLayout, areas: Sequence[int]) -> int:
    kinds = [brief.kind for brief in layout.briefs]
    return areas[kinds.index("living_room")]


def outline_corners(boxes: Sequence[Box]) -> list[bool]:
    """Return for each corner of the outline, counter-clockwise, whether it turns left.

    An empty list if the boxes enclose a court or a narrow crack, or are in several parts.
    """
    union = shapely.union_all([shapely.box(b.x0, b.y0, b.x1, b.y1) for b in boxes])
    if not isinstance(union, shapely.Polygon) or union.interiors:
        return []
    ring = shapely.get_coordinates(shapely.orient_polygons(union))[:-1]
    into = ring - np.roll(ring, 1, axis=0)
    out = np.roll(ring, -1, axis=0) - ring
    turns = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0]
    is_left = turns[turns != 0] > 0
    # Between two walls there is a crack only if the outline turns right at both of its ends.
    if np.count_nonzero(~is_left) > 1:
        half = MIN_COURT / 2
        closed = union.buffer(half, join_style="mitre").buffer(-half, join_style="mitre")
        if closed.area > union.area + 1:
            return []
    return list(is_left)


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


# Layouts are drawn until this many are good …
ENOUGH_LAYOUTS = 4
# Ducts: range of the sides [units], probability in a rectangle of a room [%], least side of that,
# and the least distance from passages [units].
SHAFT_SIDE = (6, 16)
SHAFT_PERCENT = 12
SHAFT_ROOM_SIDE = 34
SHAFT_CLEARANCE = 12
# Ranges of the width of corridors [units], and their weights.
CORRIDORS = (((20, 24), 40), ((25, 28), 40), ((29, 32), 20))
# … and at most this many; where the area is free, this many times as many, of other areas.
MAX_LAYOUTS = 480
FREE_AREAS = 4
# Layouts drawn in vain before a new list of rooms is drawn, and before what was not requested is.
PATIENCE = 20
REDRAW = 80
FRONT_DOOR = 19  # 0.95 m
# Clear space before the front door [units].
APPROACH = 30
# Share of homes that are first tried as plain rectangles [%].
PLAIN_PERCENT = 30
MAX_ACCESS_COST = 6.0
# Rooms that the front door may lead into, the best first; without an entryway a hallway and the
# living room are as good.
_FRONT = ("entryway", "hallway", "living_room", "dining_room", "kitchen")


@dataclass(frozen=True)
class House(RoomLayout):
    """A generated home, on a grid of 5 cm.

    Attributes:
        gaps: The passages through inner walls.
        front_door: The passage to the outside.
        shafts: Ducts and chimneys in corners of rooms [units].
    """

    gaps: list[Gap]
    front_door: Gap
    shafts: list[Rectangle]


@dataclass(frozen=True)
class _Candidate:
    """A layout that is a home: its links, further ones that are possible, and how bad it is."""

    layout: RoomLayout
    possible: RoomLinks
    links: list[Wall]
    widths: Widths
    cost: float


def generate(seed: int, wishes: Wishes, style: Style) -> House:
    """Generate the home of a seed.

    Args:
        seed: The seed of the home.
        wishes: The request for its rooms.
        style: The request for its shape.

    Raises:
        NoLayoutError: No home was found that meets the request.
    """
    decided = settle_wishes(wishes, Choices(seed, "wishes"), style)
    used = style
    area = decided.area_m2 or 0.0
    is_wide = area >= WIDE_FROM_M2
    prices = _tastes(Choices(seed, "taste"), style)
    widths = _style(style, Choices(seed, "style"), is_wide, prices)
    # A plain outline is only a first try; a requested outline is binding.
    plain = Choices(seed, "outline").chance(PLAIN_PERCENT)
    candidates: list[_Candidate] = []
    briefs: list[Brief] = []
    most = MAX_LAYOUTS if wishes.area_m2 else FREE_AREAS * MAX_LAYOUTS
    for number in range(most):
        if number % PATIENCE == 0 and not candidates:
            if number and number % REDRAW == 0:
                # The area stays at first, so that large homes don't get rarer.
                anew = wishes if number >= MAX_LAYOUTS // 2 else replace(wishes, area_m2=area)
                decided = settle_wishes(anew, Choices(seed, f"wishes {number}"), style)
            choices = Choices(seed, f"rooms {number // PATIENCE}")
            if number >= MAX_LAYOUTS * 3 // 4:  # rare rooms fit into no layout
                used = replace(style, variety=style.variety // 2)
                is_wide = False
                widths = replace(widths, prices=COSTS)
            briefs = choose_rooms(decided, choices, used, is_wide)
        usual = "rectangle" if plain and number < 2 * PATIENCE else None
        request = LayoutRequest(
            briefs, decided.area_m2 or 0.0, widths.corridor, style.outline or usual
        )
        limit = MAX_ACCESS_COST + LINK_TASTE * used.variety / 100
        # Rooms may be longer than usual after some tries.
        ease = 1.0 + 0.1 * min(number // (2 * PATIENCE), 3)
        with suppress(MisfitError):
            layout = draw_layout(request, Choices(seed, f"layout {number}"))
            candidate = _judge(layout, widths, request, ease, limit)
            taste = Choices(seed, f"taste {number}").below(LAYOUT_TASTE * used.variety + 1)
            candidates.append(replace(candidate, cost=candidate.cost + taste / 100))
        # Where good layouts are rare, fewer are enough.
        if len(candidates) >= max(ENOUGH_LAYOUTS - number // PATIENCE, 1):
            break
    for best in sorted(candidates, key=lambda candidate: candidate.cost):
        with suppress(MisfitError):
            return _finish(best, Choices(seed, "doors"), style)
    raise NoLayoutError(_failure(decided, style, most))


def _tastes(choices: Choices, style: Style) -> Prices:
    """Return costs of passages to which those of one family's taste are added."""
    if not style.variety:
        return COSTS
    most = LINK_TASTE * style.variety
    pairs = _PAIRS | _RARE_PAIRS
    prices = {pair: cost + choices.below(most) / 100 for pair, cost in pairs.items()}
    return prices | {(b, a): cost for (a, b), cost in prices.items()}


def _style(style: Style, choices: Choices, is_wide: bool, prices: Prices) -> Widths:
    """Return the widths of a home; all are drawn, so that setting one leaves the others as is."""
    open_plan = choices.chance(45)
    narrow = choices.between(20, 26)
    bath = choices.choice((14, 15, 16))
    corridor = choices.between(*choices.weighted(CORRIDORS)) if is_wide else narrow
    door = choices.choice((15, 15, 16, 16, 17, 18, 20))
    door = style.door or door
    open_plan = open_plan if style.open_plan is None else style.open_plan
    return Widths(door, min(bath, door), style.corridor or corridor, open_plan, prices)


def _judge(
    layout: RoomLayout, widths: Widths, request: LayoutRequest, ease: float, limit: float
) -> _Candidate:
    """Return the layout with its links and its cost.

    Raises:
        MisfitError: It is not a home.
    """
    shape = shape_cost(layout, ease)
    if boxes_overlap(layout.boxes):
        raise MisfitError
    check_sizes(layout)
    walls = inner_walls(layout.boxes)
    possible = _best_links(layout, walls, widths)
    links, access = link_rooms(layout, possible)
    if access > limit:
        raise MisfitError
    outer = outer_walls(layout.boxes, walls)
    check_light(layout, outer)
    rank, _ = _front_wall(layout, outer)
    corners = outline_corners(layout.boxes)
    if not corners or (request.outline and outline_kind(corners) != request.outline):
        raise MisfitError
    cost = shape + 2 * access + 2 * rank + 0.4 * max(len(corners) - 8, 0)
    return _Candidate(layout, possible, links, widths, cost)


def _finish(best: _Candidate, choices: Choices, style: Style) -> House:
    """Turn a layout and give it its doors.

    Raises:
        MisfitError: No front door fits.
    """
    links = add_loops(best, choices)
    layout = replace(best.layout, boxes=turn_boxes(best.layout.boxes, choices.below(8)))
    layout = merge_rooms(layout, links, choices, style.variety)
    links = [wall for wall in links if len(set(layout.rooms(wall))) == 2]
    # The turned walls, for the same pairs of boxes.
    inner = inner_walls(layout.boxes)
    pairs = {frozenset((wall.first, wall.second)) for wall in links}
    gaps = draw_gaps(layout, inner, pairs, best.widths, choices)
    _, wall = _front_wall(layout, outer_walls(layout.boxes, inner))
    spare = wall.length - FRONT_DOOR
    low = wall.low + (spare // 2 if spare < 30 else choices.between(4, spare - 4))
    front_door = Gap(wall, low, low + FRONT_DOOR, True)
    shafts = draw_shafts(layout, [*gaps, front_door], choices)
    return House(layout.briefs, layout.boxes, gaps, front_door, shafts)


# Probability [%] that a room is part of one that it opens to: an alcove, or a living
# room with a passage.
_MERGED = {
    ("hallway", "living_room"): 75, ("entryway", "living_room"): 75, ("hallway", "entryway"): 35,
    ("dining_room", "living_room"): 45, ("dining_room", "kitchen"): 40,
    ("kitchen", "living_room"): 25, ("wardrobe", "bedroom"): 90, ("storage", "kitchen"): 55,
    ("laundry", "kitchen"): 55, ("laundry", "bathroom"): 50,
    ("office", "living_room"): 20,
}  # fmt: skip


# Largest area of a room with what is merged into it [units²], or in percent of the home; of others
# that of the living room.
MOST_MERGED = {"bathroom": int(BATHROOM_M2[1] * UNITS_PER_M2), "entryway": 14 * UNITS_PER_M2}
MOST_LIVING_PERCENT = 48
MOST_KITCHEN_PERCENT = 24
# A longer corridor isn't merged into another room [units].
MERGED_CORRIDOR = 160


def merge_rooms(
    layout: RoomLayout, links: Sequence[Wall], choices: Choices, variety: int
) -> RoomLayout:
    """Draw which rooms are one with another that they open to, so that not all are rectangles."""
    room_of = [box.room for box in layout.boxes]
    kept_apart = _kept_apart(layout, links)
    areas = room_areas(layout)
    living = _living_area(layout, areas)
    most = MOST_MERGED | {
        "kitchen": min(living, sum(areas) * MOST_KITCHEN_PERCENT // 100),
        "living_room": sum(areas) * MOST_LIVING_PERCENT // 100,
    }
    for wall in links:
        pair = room_of[wall.first], room_of[wall.second]
        for part, whole in (pair, pair[::-1]):
            kinds = layout.briefs[part].kind, layout.briefs[whole].kind
            percent = _MERGED.get(kinds, 0) * (100 - variety * 3 // 4) // 100
            if part == whole or part in kept_apart or not choices.chance(percent):
                continue
            if areas[part] + areas[whole] <= most.get(kinds[1], living):
                areas[whole] += areas[part]
                room_of = [whole if room == part else room for room in room_of]
                break
    kept = sorted(set(room_of))
    boxes = [
        box._replace(room=kept.index(room)) for box, room in zip(layout.boxes, room_of, strict=True)
    ]
    return RoomLayout([layout.briefs[room] for room in kept], boxes)


def _kept_apart(layout: RoomLayout, links: Sequence[Wall]) -> set[int]:
    """Return long corridors, and the rooms from which one gets to a garage."""
    corridors = {
        box.room
        for box in layout.boxes
        if layout.briefs[box.room].kind == "hallway" and max(box.clear) > MERGED_CORRIDOR
    }
    by_garages = {
        room for wall in links if "garage" in layout.kinds(wall) for room in layout.rooms(wall)
    }
    return corridors | by_garages


def draw_shafts(layout: RoomLayout, gaps: Sequence[Gap], choices: Choices) -> list[Rectangle]:
    """Draw ducts and chimneys in corners of rooms, away from all passages."""
    shafts = []
    for box in layout.boxes:
        width = choices.between(*SHAFT_SIDE)
        depth = choices.between(*SHAFT_SIDE)
        x = choices.choice((box.x0, box.x1 - WALL - width))
        y = choices.choice((box.y0, box.y1 - WALL - depth))
        if not choices.chance(SHAFT_PERCENT) or min(box.clear) < SHAFT_ROOM_SIDE:
            continue
        shaft = (x, y, x + width, y + depth)
        if not any(_near(shaft, gap) for gap in gaps):
            shafts.append(shaft)
    return shafts


def _near(shaft: Rectangle, gap: Gap) -> bool:
    """Return whether a passage is less than a robot's width away from a shaft."""
    wall = gap.wall
    low = gap.low - SHAFT_CLEARANCE
    high = gap.high + SHAFT_CLEARANCE
    near = wall.at - SHAFT_CLEARANCE
    far = wall.at + SHAFT_CLEARANCE
    return overlap(shaft, (near, low, far, high) if wall.upright else (low, near, high, far))


def _front_wall(layout: RoomLayout, outer: Sequence[Wall]) -> tuple[int, Wall]:
    """Return the rank of the best wall for the front door (0 is the best), and the wall.

    Raises:
        MisfitError: There is none.
    """
    candidates = []
    for wall in outer:
        kind = layout.briefs[layout.room_inside(wall)].kind
        if kind in _FRONT and wall.length >= FRONT_DOOR + 4 and _approachable(wall, layout.boxes):
            candidates.append((_FRONT.index(kind), -min(wall.length, 60), wall))
    if not candidates:
        raise MisfitError
    rank, _, wall = min(candidates)
    has_entryway = any(brief.kind == "entryway" for brief in layout.briefs)
    return (rank if has_entryway else max(rank - 2, 0)), wall


def _approachable(wall: Wall, boxes: Sequence[Box]) -> bool:
    """Return whether the ground before an outer wall is open."""
    near = wall.at if wall.second == -1 else wall.at - APPROACH
    ground = (near, wall.low, near + APPROACH, wall.high)
    if not wall.upright:
        ground = (wall.low, near, wall.high, near + APPROACH)
    return not any(overlap(ground, box.sides) for box in boxes)


def _failure(wishes: Wishes, style: Style, layouts: int) -> str:
    numbers = f"{wishes.bedrooms} bedrooms and {wishes.bathrooms} bathrooms"
    shape = f" and the outline {style.outline}" if style.outline else ""
    return (
        f"no synthetic home of {wishes.area_m2:g} m2 with {numbers}{shape} was found in"
        f" {layouts} layouts: ask for more or less area, other numbers of rooms, another"
        " floorplan.outline, or take another seed"
    )
