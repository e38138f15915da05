"""Which rooms open to which: doors and openings by the types of rooms, until all are linked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from fleet2d.floorplan.synthetic.draws import Choices
from fleet2d.floorplan.synthetic.geometry import Wall
from fleet2d.floorplan.synthetic.layout import RoomLayout
from fleet2d.floorplan.synthetic.program import Brief

JAMB = 2  # least distance of a door from the corner of a room [units]


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
        "dining_room": 2.5, "living_room": 3,
    },
}  # fmt: skip
_PAIRS = {(a, b): cost for a, row in _COSTS.items() for b, cost in row.items()}
COSTS: Mapping[tuple[str, str], float] = _PAIRS | {(b, a): cost for (a, b), cost in _PAIRS.items()}
# Rooms through which the way to other rooms may lead.
_PASSABLE = ("entryway", "hallway", "living_room", "dining_room", "kitchen", "laundry", "garage")
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
    """

    door: int
    bath: int
    corridor: int
    open_plan: bool

    def of(self, kinds: set[str]) -> int:
        """Return the width of a door between rooms of two kinds."""
        small = kinds & {"bathroom", "toilet", "wardrobe", "storage", "laundry"}
        return self.bath if small and "garage" not in kinds else self.door


@dataclass
class Access:
    """A tree of links that joins all rooms.

    Attributes:
        links: The walls with a passage, in the order in which they joined the tree.
        cost: Sum of the costs of the links, see `COSTS`.
    """

    links: list[Wall]
    cost: float


def link_rooms(layout: RoomLayout, walls: Sequence[Wall], widths: Widths) -> Access | None:
    """Return the tree of links that joins all rooms at the least cost, or None if there is none.

    Prim's algorithm from the entryway, else the living room. Nobody has to pass through a private
    room, except to the bathroom or wardrobe that belongs to it.
    """
    best = _best_links(layout, walls, widths)
    kinds = [brief.kind for brief in layout.briefs]
    start = kinds.index("entryway" if "entryway" in kinds else "living_room")
    reached, links, cost = {start}, [], 0.0
    while len(reached) < len(kinds):
        candidates = [
            (price, pair, wall)
            for pair, (price, wall) in best.items()
            if (pair[0] in reached) != (pair[1] in reached)
            and _passable(layout.briefs, *(pair if pair[0] in reached else pair[::-1]))
        ]
        if not candidates:
            return None
        price, pair, wall = min(candidates, key=lambda link: link[:2])
        reached.update(pair)
        links.append(wall)
        cost += price
    return Access(links, cost)


def _passable(briefs: Sequence[Brief], through: int, to: int) -> bool:
    """Return whether the way to a room may lead through another."""
    if briefs[to].kind in ("kitchen", "dining_room"):  # these belong to the living space
        return briefs[through].kind in _SOCIAL
    return briefs[through].kind in _PASSABLE or briefs[to].partner == through


def _best_links(
    layout: RoomLayout, walls: Sequence[Wall], widths: Widths
) -> dict[tuple[int, int], tuple[float, Wall]]:
    """Return the cost and the longest common wall of each pair of rooms that may be linked."""
    briefs = layout.briefs
    best: dict[tuple[int, int], tuple[float, Wall]] = {}
    for wall in walls:
        a, b = _rooms(layout, wall)
        if a == b:
            continue
        price = _price(briefs, a, b)
        kinds = {briefs[a].kind, briefs[b].kind}
        needed = widths.of(kinds) + (0 if kinds <= _WITHOUT_JAMBS else 2 * JAMB)
        if price is None or wall.length < needed:
            continue
        if (a, b) not in best or wall.length > best[a, b][1].length:
            best[a, b] = (price, wall)
    return best


def _price(briefs: Sequence[Brief], a: int, b: int) -> float | None:
    owners = {briefs[a].partner, briefs[b].partner} - {None}
    if owners:
        return 0.0 if briefs[a].partner == b or briefs[b].partner == a else None
    return COSTS.get((briefs[a].kind, briefs[b].kind))


def add_loops(
    access: Access, layout: RoomLayout, walls: Sequence[Wall], widths: Widths, choices: Choices
) -> list[Wall]:
    """Return the tree's links and a few more, since real homes have circular routes.

    In an open plan only two of the three borders between living room, dining room and kitchen are
    open: three would leave a post in the middle.
    """
    links = list(access.links)
    open_pairs = {_rooms(layout, wall) for wall in links}
    for pair, (price, wall) in _best_links(layout, walls, widths).items():
        kinds = {layout.briefs[room].kind for room in pair}
        percent = 0
        if kinds <= set(_SOCIAL):
            percent = 45 if not widths.open_plan else 0
        elif kinds <= {*_SOCIAL, "hallway", "entryway"}:
            percent = 60 if price < 1 else 20
        elif kinds & {"laundry", "garage", "storage"} and price <= 0.3:
            percent = 30
        if pair not in open_pairs and choices.chance(percent):
            links.append(wall)
            open_pairs.add(pair)
    return links


def _rooms(layout: RoomLayout, wall: Wall) -> tuple[int, int]:
    """Return the rooms on the two sides of an inner wall, the lower first."""
    a, b = sorted((layout.boxes[wall.first].room, layout.boxes[wall.second].room))
    return a, b


def draw_gaps(
    links: Sequence[Wall],
    layout: RoomLayout,
    walls: Sequence[Wall],
    widths: Widths,
    choices: Choices,
) -> list[Gap]:
    """Draw the passages: openings between living spaces, elsewhere doors near a corner."""
    inside = [wall for wall in walls if len(set(_rooms(layout, wall))) == 1]
    gaps = [Gap(wall, wall.low, wall.high, None) for wall in inside]
    for wall in links:
        kinds = {layout.briefs[room].kind for room in _rooms(layout, wall)}
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
            return wall.low, wall.high
        if choices.chance(30):
            return None
        width = min(choices.between(28, 56), wall.length - 8)
    elif kinds <= {"hallway", "entryway"}:
        width = min(wall.length - 8, choices.between(24, 40))
    elif kinds in ({"hallway", "living_room"}, {"hallway", "dining_room"}) and wall.length < 40:
        return (wall.low, wall.high) if choices.chance(60) else None
    elif kinds <= {"hallway", "entryway", *_SOCIAL} and choices.chance(60):
        width = min(wall.length - 8, choices.between(24, 40))
    else:
        return None
    if width < widths.door:
        return None
    low = wall.low + (wall.length - width) // 2
    return low, low + width
