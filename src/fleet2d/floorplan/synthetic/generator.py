"""Generate a home: draw layouts until several are good, and take the best."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.synthetic.access import Access, Gap, Widths, add_loops, draw_gaps, link_rooms
from fleet2d.floorplan.synthetic.draws import Choices
from fleet2d.floorplan.synthetic.geometry import (
    Box,
    Wall,
    boxes_overlap,
    inner_walls,
    outer_walls,
    turn_boxes,
)
from fleet2d.floorplan.synthetic.judge import light_cost, outline_corners, outline_kind, shape_cost
from fleet2d.floorplan.synthetic.layout import RoomLayout, draw_layout
from fleet2d.floorplan.synthetic.program import Brief, Wishes, choose_rooms, settle_wishes
from fleet2d.floorplan.synthetic.request import LayoutRequest

# Layouts are drawn until this many are good …
ENOUGH = 4
# … and at most this many.
TRIES = 480
# Layouts drawn in vain before a new list of rooms is drawn.
PATIENCE = 20
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
class Style:
    """The user's request for the shape of a home; None where it is left to the generator.

    Attributes:
        outline: `rectangle`, `L`, `T` or `U`.
        open_plan: Whether living, dining and kitchen are open to each other.
        corridor: Clear width of corridors [units].
        door: Width of doors between rooms [units].
    """

    outline: str | None = None
    open_plan: bool | None = None
    corridor: int | None = None
    door: int | None = None


@dataclass(frozen=True)
class House:
    """A generated home, on a grid of 5 cm.

    Attributes:
        wishes: The request, with everything decided.
        briefs: Its rooms.
        boxes: The rectangles that they are made of [units].
        gaps: The passages through inner walls.
        front_door: The passage to the outside.
    """

    wishes: Wishes
    briefs: list[Brief]
    boxes: list[Box]
    gaps: list[Gap]
    front_door: Gap


@dataclass(frozen=True)
class _Candidate:
    layout: RoomLayout
    walls: list[Wall]
    outer: list[Wall]
    access: Access
    widths: Widths
    cost: float


def generate(seed: int, wishes: Wishes, style: Style) -> House:
    """Generate the home of a seed.

    Args:
        seed: The seed of the home.
        wishes: The request for its rooms.
        style: The request for its shape.

    Raises:
        FloorPlanError: No home was found that meets the request.
    """
    decided = settle_wishes(wishes, Choices(seed, "wishes"))
    widths = _style(style, Choices(seed, "style"))
    # A plain outline is only a first try; a requested outline is binding.
    plain = Choices(seed, "outline").chance(PLAIN_PERCENT)
    candidates: list[_Candidate] = []
    briefs: list[Brief] = []
    for number in range(TRIES):
        if number % PATIENCE == 0 and not candidates:
            if number >= TRIES // 4 and wishes.garage is None:
                decided = replace(decided, garage=False)
            choices = Choices(seed, f"rooms {number // PATIENCE}")
            briefs = choose_rooms(decided, choices, style.outline == "U")
        usual = "rectangle" if plain and number < 2 * PATIENCE else None
        request = LayoutRequest(
            briefs, decided.area_m2 or 0.0, widths.corridor, style.outline or usual
        )
        layout = draw_layout(request, Choices(seed, f"layout {number}"))
        candidate = layout and _judge(layout, widths, request.outline, _ease(number))
        if candidate:
            candidates.append(candidate)
        # Where good layouts are rare, fewer are enough.
        if len(candidates) >= max(ENOUGH - number // PATIENCE, 1):
            break
    for best in sorted(candidates, key=lambda candidate: candidate.cost):
        house = _finish(best, decided, Choices(seed, "doors"))
        if house is not None:
            return house
    raise FloorPlanError(_failure(decided, style))


def _style(style: Style, choices: Choices) -> Widths:
    """Return the widths of a home; all are drawn, so that setting one leaves the others as is."""
    open_plan, corridor = choices.chance(45), choices.between(20, 26)
    door, bath = choices.pick((16, 17, 18)), choices.pick((14, 15, 16))
    door = style.door or door
    open_plan = open_plan if style.open_plan is None else style.open_plan
    return Widths(door, min(bath, door), style.corridor or corridor, open_plan)


def _ease(number: int) -> float:
    """Return the factor by which rooms may be longer than usual, which grows with the tries."""
    return 1.0 + 0.1 * min(number // (2 * PATIENCE), 3)


def _judge(
    layout: RoomLayout, widths: Widths, outline: str | None, ease: float
) -> _Candidate | None:
    """Return the layout with its links and its cost, or None if it is not a home."""
    shape = shape_cost(layout, ease)
    if shape is None or boxes_overlap(layout.boxes):
        return None
    walls = inner_walls(layout.boxes)
    access = link_rooms(layout, walls, widths)
    if access is None or access.cost > MAX_ACCESS_COST:
        return None
    outer = outer_walls(layout.boxes, walls)
    light = light_cost(layout, outer)
    if light is None:
        return None
    front_wall = _front_wall(layout, outer)
    if front_wall is None:
        return None
    corners = outline_corners(layout.boxes)
    if not corners or (outline is not None and outline_kind(corners) != outline):
        return None
    cost = shape + 2 * access.cost + light + 2 * front_wall[0] + 0.15 * max(len(corners) - 8, 0)
    return _Candidate(layout, walls, outer, access, widths, cost)


def _finish(best: _Candidate, wishes: Wishes, choices: Choices) -> House | None:
    """Turn a layout and give it its doors; None where no front door fits."""
    links = add_loops(best.access, best.layout, best.walls, best.widths, choices)
    layout = replace(best.layout, boxes=turn_boxes(best.layout.boxes, choices.below(8)))
    # The turned walls, for the same pairs of boxes.
    inner = inner_walls(layout.boxes)
    pairs = {frozenset((wall.first, wall.second)) for wall in links}
    doors = [wall for wall in inner if frozenset((wall.first, wall.second)) in pairs]
    gaps = draw_gaps(doors, layout, inner, best.widths, choices)
    front_door = _front_door(layout, outer_walls(layout.boxes, inner), choices)
    if front_door is None:
        return None
    return House(wishes, layout.briefs, layout.boxes, gaps, front_door)


def _front_door(layout: RoomLayout, outer: Sequence[Wall], choices: Choices) -> Gap | None:
    """Return the front door, in the best wall for it, or None where there is none."""
    best = _front_wall(layout, outer)
    if best is None:
        return None
    _, wall = best
    spare = wall.length - FRONT_DOOR
    low = wall.low + (spare // 2 if spare < 30 else choices.between(4, spare - 4))
    return Gap(wall, low, low + FRONT_DOOR, True)


def _front_wall(layout: RoomLayout, outer: Sequence[Wall]) -> tuple[int, Wall] | None:
    """Return the best wall for the front door, and its rank (0 is the best)."""
    candidates = []
    for wall in outer:
        kind = layout.briefs[layout.boxes[max(wall.first, wall.second)].room].kind
        if kind in _FRONT and wall.length >= FRONT_DOOR + 4 and _approachable(wall, layout.boxes):
            candidates.append((_FRONT.index(kind), -min(wall.length, 60), wall))
    if not candidates:
        return None
    rank, _, wall = min(candidates)
    has_entryway = any(brief.kind == "entryway" for brief in layout.briefs)
    return (rank if has_entryway else max(rank - 2, 0)), wall


def _approachable(wall: Wall, boxes: Sequence[Box]) -> bool:
    """Return whether the ground before an outer wall is open."""
    near, far = (
        (wall.at, wall.at + APPROACH) if wall.second == -1 else (wall.at - APPROACH, wall.at)
    )
    low, high = wall.low, wall.high
    x0, x1, y0, y1 = (near, far, low, high) if wall.upright else (low, high, near, far)
    return not any(b.x0 < x1 and x0 < b.x1 and b.y0 < y1 and y0 < b.y1 for b in boxes)


def _failure(wishes: Wishes, style: Style) -> str:
    rooms = (
        f"{wishes.area_m2:g} m2 with {wishes.bedrooms} bedrooms and {wishes.bathrooms} bathrooms"
    )
    shape = f" and the outline {style.outline}" if style.outline else ""
    return (
        f"no synthetic home of {rooms}{shape} was found in {TRIES} layouts: ask for more or less"
        " area, other numbers of rooms, another floorplan.outline, or take another seed"
    )
