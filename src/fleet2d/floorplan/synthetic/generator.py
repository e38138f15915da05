"""Generate a home: draw layouts until some are homes, and keep the best."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.synthetic.access import Access, Gap, Widths, gaps_for, linked, with_loops
from fleet2d.floorplan.synthetic.draws import Choices
from fleet2d.floorplan.synthetic.geometry import (
    Box,
    Wall,
    inner_walls,
    outer_walls,
    overlap,
    turned,
)
from fleet2d.floorplan.synthetic.judge import (
    light_cost,
    outline_corners,
    outline_kind,
    shape_cost,
)
from fleet2d.floorplan.synthetic.layout import Layout, drawn
from fleet2d.floorplan.synthetic.program import Brief, Wishes, rooms_for, settle
from fleet2d.floorplan.synthetic.request import Request

# Layouts drawn for a home: until so many are good, and so many at most.
ENOUGH = 4
TRIES = 480
# A new list of rooms after so many layouts in vain.
PATIENCE = 20
FRONT_DOOR = 19  # 0.95 m
# Clear space before the front door [units].
APPROACH = 30
# How many homes are tried as plain rectangles first [%].
PLAIN = 30
WORST_ACCESS = 6.0
# Where the front door is, the best first; a corridor's end and the living room serve as well where
# there is no entryway.
_FRONT = ("entryway", "hallway", "living_room", "dining_room", "kitchen")


@dataclass(frozen=True)
class Style:
    """How a home is built, where a user says so; None leaves it to the generator.

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
        wishes: What was asked for, everything decided.
        briefs: Its rooms.
        boxes: The rectangles that they are made of [units].
        gaps: The passages through inner walls.
        front_door: The one to outside.
    """

    wishes: Wishes
    briefs: list[Brief]
    boxes: list[Box]
    gaps: list[Gap]
    front_door: Gap


@dataclass(frozen=True)
class _Candidate:
    layout: Layout
    walls: list[Wall]
    outer: list[Wall]
    access: Access
    widths: Widths
    cost: float


def generate(seed: int, wishes: Wishes, style: Style) -> House:
    """Generate the home of a seed.

    Args:
        seed: Which home.
        wishes: What rooms it is to have.
        style: How it is to be built.

    Raises:
        FloorPlanError: No home was found that is as asked for.
    """
    settled = settle(wishes, Choices(seed, "wishes"))
    widths = _style(style, Choices(seed, "style"))
    # The usual outline is a first try; the one asked for is the only one.
    plain = Choices(seed, "outline").chance(PLAIN)
    found: list[_Candidate] = []
    briefs: list[Brief] = []
    for number in range(TRIES):
        if number % PATIENCE == 0 and not found:
            if number >= TRIES // 4 and wishes.garage is None:
                settled = replace(settled, garage=False)
            again = Choices(seed, f"rooms {number // PATIENCE}")
            briefs = rooms_for(settled, again, style.outline == "U")
        usual = "rectangle" if plain and number < 2 * PATIENCE else None
        request = Request(briefs, settled.area_m2 or 0.0, widths.corridor, style.outline or usual)
        layout = drawn(request, Choices(seed, f"layout {number}"))
        candidate = layout and _judged(layout, widths, request.outline, _ease(number))
        if candidate:
            found.append(candidate)
        # Where good layouts are rare, fewer will do.
        if len(found) >= max(ENOUGH - number // PATIENCE, 1):
            break
    for best in sorted(found, key=lambda candidate: candidate.cost):
        house = _finished(best, settled, Choices(seed, "doors"))
        if house is not None:
            return house
    raise FloorPlanError(_nothing_found(settled, style))


def _style(style: Style, choices: Choices) -> Widths:
    """Return the widths of a home; all are drawn, so that one given leaves the others alone."""
    open_plan, corridor = choices.chance(45), choices.between(20, 26)
    door, bath = choices.pick((16, 17, 18)), choices.pick((14, 15, 16))
    door = style.door or door
    open_plan = open_plan if style.open_plan is None else style.open_plan
    return Widths(door, min(bath, door), style.corridor or corridor, open_plan)


def _ease(number: int) -> float:
    """Return by how much rooms may be longer than usual in a late try."""
    return 1.0 + 0.1 * min(number // (2 * PATIENCE), 3)


def _judged(layout: Layout, widths: Widths, outline: str | None, ease: float) -> _Candidate | None:
    """Return the layout with its doors' tree and its cost, or None if it is no home."""
    shape = shape_cost(layout, ease)
    if shape is None or overlap(layout.boxes):
        return None
    walls = inner_walls(layout.boxes)
    access = linked(layout.briefs, layout.boxes, walls, widths)
    if access is None or access.cost > WORST_ACCESS:
        return None
    outer = outer_walls(layout.boxes, walls)
    light = light_cost(layout, outer)
    if light is None:
        return None
    front = _front_wall(layout.briefs, layout.boxes, outer)
    if front is None:
        return None
    turns = outline_corners(layout.boxes)
    if not turns or (outline is not None and outline_kind(turns) != outline):
        return None
    cost = shape + 2 * access.cost + light + 2 * front[0] + 0.15 * max(len(turns) - 8, 0)
    return _Candidate(layout, walls, outer, access, widths, cost)


def _finished(best: _Candidate, wishes: Wishes, choices: Choices) -> House | None:
    """Give a layout its doors and turn it some way."""
    layout, walls = best.layout, best.walls
    links = with_loops(best.access, layout.briefs, layout.boxes, walls, best.widths, choices)
    boxes = turned(layout.boxes, choices.below(8))
    # The turned walls, for the same pairs of boxes.
    again = inner_walls(boxes)
    pairs = {frozenset((wall.first, wall.second)) for wall in links}
    kept = [wall for wall in again if frozenset((wall.first, wall.second)) in pairs]
    gaps = gaps_for(kept, layout.briefs, boxes, again, best.widths, choices)
    front = _front_door(layout.briefs, boxes, outer_walls(boxes, again), choices)
    if front is None:
        return None
    return House(wishes, layout.briefs, boxes, gaps, front)


def _front_door(
    briefs: Sequence[Brief], boxes: Sequence[Box], outer: Sequence[Wall], choices: Choices
) -> Gap | None:
    """Return the front door, in the best wall for it, or None where there is none."""
    found = _front_wall(briefs, boxes, outer)
    if found is None:
        return None
    _, wall = found
    spare = wall.length - FRONT_DOOR
    low = wall.low + (spare // 2 if spare < 30 else choices.between(4, spare - 4))
    return Gap(wall, low, low + FRONT_DOOR, True)


def _front_wall(
    briefs: Sequence[Brief], boxes: Sequence[Box], outer: Sequence[Wall]
) -> tuple[int, Wall] | None:
    """Return the wall for the front door, and how poor a place it is (0 is the best)."""
    fitting = []
    for wall in outer:
        kind = briefs[boxes[max(wall.first, wall.second)].room].kind
        if kind in _FRONT and wall.length >= FRONT_DOOR + 4 and _approachable(wall, boxes):
            fitting.append((_FRONT.index(kind), -min(wall.length, 60), wall))
    if not fitting:
        return None
    rank, _, wall = min(fitting)
    entryway = any(brief.kind == "entryway" for brief in briefs)
    return (rank if entryway else max(rank - 2, 0)), wall


def _approachable(wall: Wall, boxes: Sequence[Box]) -> bool:
    """Tell whether there is open ground before an outer wall."""
    near, far = (
        (wall.at, wall.at + APPROACH) if wall.second == -1 else (wall.at - APPROACH, wall.at)
    )
    low, high = wall.low, wall.high
    x0, x1, y0, y1 = (near, far, low, high) if wall.upright else (low, high, near, far)
    return not any(b.x0 < x1 and x0 < b.x1 and b.y0 < y1 and y0 < b.y1 for b in boxes)


def _nothing_found(wishes: Wishes, style: Style) -> str:
    asked = (
        f"{wishes.area_m2:g} m2 with {wishes.bedrooms} bedrooms and {wishes.bathrooms} bathrooms"
    )
    shape = f" and the outline {style.outline}" if style.outline else ""
    return (
        f"no synthetic home of {asked}{shape} was found in {TRIES} layouts: ask for more or less"
        " area, other numbers of rooms, another floorplan.outline, or take another seed"
    )
