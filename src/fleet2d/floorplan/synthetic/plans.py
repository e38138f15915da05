"""Layouts of synthetic homes: rooms in groups, in wings, as rectangles."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import fsum, sqrt

from fleet2d.floorplan.synthetic.program import Brief, Choices
from fleet2d.floorplan.synthetic.slicing import (
    MAX_DEPTH,
    MIN_DEPTH,
    UNITS_PER_M,
    UNITS_PER_M2,
    WALL,
    Box,
    Cut,
    LayoutRequest,
    Leaf,
    Mouth,
    Slot,
    Strip,
    Tree,
    Wing,
    choose_squarest,
    gross_area,
    is_promising,
    slenderness,
    tree_area,
)
from fleet2d.runtime.determinism import sum_in_order

RoomGroup = list[Slot]
"""Slots that stay next to each other in this order."""


@dataclass
class Groups:
    """The rooms of a home, sorted by where they may go.

    Attributes:
        entry: The group with the entryway, or None; its first slot is the entryway.
        private: Groups for strips; the first is that of the main bedroom, which comes last in it.
        service: Rooms for a block of their own: garage, gym and what goes with them.
        pantry: Small rooms beside the kitchen.
        closet: A small room for the end of a corridor, or None.
    """

    entry: RoomGroup | None = None
    private: list[RoomGroup] = field(default_factory=list)
    service: list[int] = field(default_factory=list)
    pantry: list[int] = field(default_factory=list)
    closet: int | None = None


def group_rooms(briefs: Sequence[Brief], choices: Choices) -> Groups:
    """Group the rooms by where they may go."""
    by_kind = _by_kind(briefs)
    groups = Groups()
    if by_kind["garage"]:
        groups.service = by_kind["garage"] + by_kind["gym"]
    small = _small_rooms(by_kind, groups, choices)
    shared = [i for i in by_kind["bathroom"] if briefs[i].partner is None]
    fronts = choices.shuffled(shared + small)
    for bed in by_kind["bedroom"]:
        owned = [i for i, brief in enumerate(briefs) if brief.partner == bed]
        groups.private.append([*_beside(owned, fronts, briefs, choices), (bed,)])
    if by_kind["entryway"]:
        groups.entry = _entry_group(by_kind["entryway"][0], fronts, briefs, choices)
    for room in fronts:
        if briefs[room].kind == "bathroom":
            groups.private.append([(room,)])
        elif groups.closet is None and briefs[room].kind in ("storage", "toilet"):
            groups.closet = room
        else:
            groups.pantry.append(room)
    groups.private += [[(i,)] for i in by_kind["office"]]
    if not by_kind["garage"]:
        groups.private += [[(i,)] for i in by_kind["gym"]]
    return groups


def _by_kind(briefs: Sequence[Brief]) -> dict[str, list[int]]:
    kinds = ("garage", "gym", "laundry", "storage", "toilet", "bathroom", "bedroom", "office")
    return {
        kind: [i for i, brief in enumerate(briefs) if brief.kind == kind]
        for kind in (*kinds, "entryway")
    }


def _small_rooms(by_kind: dict[str, list[int]], groups: Groups, choices: Choices) -> list[int]:
    """Return the small rooms for strips; the others go to the service block or the kitchen."""
    strip_rooms = list(by_kind["toilet"])
    for room in by_kind["laundry"] + by_kind["storage"]:
        place = choices.weighted((("service", 60), ("pantry", 25), ("strip", 15)))
        if place == "service" and groups.service:
            groups.service.append(room)
        elif place == "strip" or groups.pantry:
            strip_rooms.append(room)
        else:
            groups.pantry.append(room)
    return strip_rooms


def _beside(
    owned: list[int], fronts: list[int], briefs: Sequence[Brief], choices: Choices
) -> list[Slot]:
    """Return the slots beside a bedroom: a room of its own at the back, a shared one before it."""
    if len(owned) >= 2:
        first, second = sorted(owned, key=lambda i: briefs[i].area)[:2]
        return [(first, second)]
    if not owned:
        return []
    if fronts and choices.chance(60):
        return [(fronts.pop(), owned[0])]
    return [(owned[0],)]


def _entry_group(
    entry: int, fronts: list[int], briefs: Sequence[Brief], choices: Choices
) -> list[Slot]:
    """Return the entryway, maybe with a toilet beside it and a coat room behind that."""
    toilets = [i for i in fronts if briefs[i].kind == "toilet"]
    closets = [i for i in fronts if briefs[i].kind == "storage"]
    if toilets and closets and choices.chance(75):
        fronts.remove(toilets[0])
        fronts.remove(closets[0])
        return [(entry,), (toilets[0], closets[0])]
    return [(entry,)]


def core_trees(groups: Groups, briefs: Sequence[Brief], choices: Choices) -> list[Tree]:
    """Draw trees of living room, dining room and kitchen; wings join them at high x or high y."""
    room_of = {brief.kind: i for i, brief in enumerate(briefs)}
    living = Leaf(room_of["living_room"])
    trees: list[Tree] = []
    for across in (True, False):
        kitchen = _kitchen(room_of["kitchen"], groups.pantry, across, choices)
        if "dining_room" in room_of:
            trees += _with_dining(living, Leaf(room_of["dining_room"]), kitchen, across)
            continue
        trees += [Cut(across, (kitchen, living)), Cut(across, (living, kitchen))]
        share = choices.between(45, 65)
        low, high = Leaf(living.room, share), Leaf(living.room, 100 - share)
        trees.append(Cut(across, (low, Cut(not across, (kitchen, high)))))
    return choices.shuffled(trees)[: max(5, len(trees) * 5 // 6)]


def _with_dining(living: Leaf, dining: Leaf, kitchen: Tree, across: bool) -> list[Tree]:
    sides = (Cut(not across, (dining, kitchen)), Cut(not across, (kitchen, dining)))
    return [
        *(Cut(across, (side, living)) for side in sides),
        *(Cut(across, (living, side)) for side in sides),
        Cut(across, (kitchen, dining, living)),
        Cut(across, (living, dining, kitchen)),
    ]


def _kitchen(kitchen: int, pantry: Sequence[int], across: bool, choices: Choices) -> Tree:
    """Return the kitchen, with small rooms at one end of it."""
    if not pantry:
        return Leaf(kitchen)
    side: Tree = Leaf(pantry[0])
    if len(pantry) > 1:
        side = Cut(across, tuple(Leaf(room) for room in pantry))
    pair = (side, Leaf(kitchen))
    return Cut(not across, pair if choices.chance(50) else pair[::-1])


@dataclass(frozen=True)
class Service:
    """A block of garage and what is beside it.

    Attributes:
        trees: Ways to divide it.
        width: Its width, where the core is high enough [units].
        whole: Whether it is as high as the core in any case.
        at_high: Whether it is flush with the core's high side, else with its low one.
        out: How far it stands out there [units].
    """

    trees: list[Tree]
    width: int
    whole: bool
    at_high: bool
    out: int

    def boxes(self, areas: Mapping[int, float], right: int, low: int, high: int) -> list[Box]:
        """Return its rooms left of a core between two heights [units]."""
        area = tree_area(self.trees[0], areas)
        height = min(int(area / self.width + 0.5), high - low)
        if self.whole or height > high - low - 20:
            height = high - low
        if not self.whole:
            low, high = (low, high + self.out) if self.at_high else (low - self.out, high)
        low, high = (high - height, high) if self.at_high else (low, low + height)
        width = int(area / height + 0.5)
        return choose_squarest(self.trees, areas, (right - width, low, right, high))


def service_block(groups: Groups, outline: str | None, choices: Choices) -> Service | None:
    """Draw a block of garage and what is beside it."""
    if not groups.service:
        return None
    garage, *others = (Leaf(room) for room in groups.service)
    trees: list[Tree] = []
    for across in (True, False):
        rest: Tree = others[0] if len(others) == 1 else Cut(not across, tuple(others))
        if not others:
            trees = [garage]
        else:
            trees += [Cut(across, (garage, rest)), Cut(across, (rest, garage))]
    return Service(
        choices.shuffled(trees),
        choices.between(72, 130),
        outline is not None,
        choices.chance(50),
        choices.pick((0, 0, 20, 40)),
    )


TRIES = 3


def draw_wing(
    groups: Sequence[RoomGroup],
    entry: RoomGroup | None,
    closet: int | None,
    corridor: int,
    request: LayoutRequest,
    briefs: Sequence[Brief],
    choices: Choices,
) -> Wing | None:
    """Draw a wing; the first group is that of its main bedroom. None if no try fits."""
    areas = {i: brief.area for i, brief in enumerate(briefs)}
    gross = {i: gross_area(area) for i, area in areas.items() if area}
    for _ in range(TRIES):
        suite = closet is None and choices.chance(55)
        front, back = _sides(groups, entry, areas, suite, choices)
        if not front or not back:
            continue
        fore, aft = _strips(front, back, request.outline, bool(entry), choices)
        rooms = [areas[slot[0]] for slot in aft.slots if len(slot) == 1]
        middle = fsum(rooms) / len(rooms) if rooms else 14.0
        width = request.corridor + WALL
        depths = [int(UNITS_PER_M * sqrt(middle) * percent / 100) for percent in (78, 90, 102, 114)]
        wings = [
            Wing(fore, aft, corridor, width, min(max(depth, 56), 112), suite, closet)
            for depth in depths
        ]
        wing = _squarest_wing(wings, gross, briefs)
        if wing is not None:
            return wing
    return None


def _strips(
    front: Sequence[RoomGroup],
    back: Sequence[RoomGroup],
    outline: str | None,
    entry: bool,
    choices: Choices,
) -> tuple[Strip, Strip]:
    """Draw the strips on the two sides of a corridor, with bays."""
    fore, aft = _strip(front), _strip(back)
    if outline is None and choices.chance(45):
        fore = add_bays(fore, choices, entry)
    if outline is None and choices.chance(35):
        aft = add_bays(aft, choices, False)
    if outline == "U" and entry:
        fore = Strip(fore.slots, (-choices.between(28, 40), *fore.bays[1:]))  # a porch
    return fore, aft


def _sides(
    groups: Sequence[RoomGroup],
    entry: RoomGroup | None,
    areas: Mapping[int, float],
    suite: bool,
    choices: Choices,
) -> tuple[list[RoomGroup], list[RoomGroup]]:
    """Divide groups of rooms among the front and the back of a corridor.

    Args:
        groups: The rooms, those of the main bedroom first.
        entry: The group that begins the front, or None.
        areas: Of the rooms [m²].
        suite: Whether the main bedroom ends the back.
        choices: The stream to draw from.
    """
    main, *others = groups
    front: list[RoomGroup] = []
    back: list[RoomGroup] = []
    weights = [_area([entry] if entry else [], areas), _area([main], areas)]
    for group in choices.shuffled(others):
        # Mostly to the side with less in it, so that both come out about as deep.
        to_back = (weights[0] > weights[1]) != choices.chance(15)
        (back if to_back else front).append(group if choices.chance(50) else group[::-1])
        weights[to_back] += _area([group], areas)
    if suite:
        back.append(main)
        # The front room beside the suite must still reach the corridor: the largest does.
        front.sort(key=lambda group: _area([group[-1:]], areas))
    else:
        back.insert(choices.below(len(back) + 1), main if choices.chance(50) else main[::-1])
    return [*([entry] if entry else []), *front], back


def _strip(groups: Sequence[RoomGroup]) -> Strip:
    slots = tuple(slot for group in groups for slot in group)
    return Strip(slots, (0,) * len(slots))


def _squarest_wing(
    wings: Sequence[Wing], areas: Mapping[int, float], briefs: Sequence[Brief]
) -> Wing | None:
    """Return the wing with the squarest rooms, or None where none fits."""
    best, least = None, 0.0
    for wing in wings:
        rooms = wing.place(areas)
        if rooms is not None and is_promising(rooms.boxes, briefs):
            score = slenderness(rooms.boxes)
            if best is None or score < least:
                best, least = wing, score
    return best


def _area(groups: Sequence[RoomGroup], areas: Mapping[int, float]) -> float:
    return fsum(areas[room] for group in groups for slot in group for room in slot)


def add_bays(strip: Strip, choices: Choices, entry: bool) -> Strip:
    """Move one end of a strip, or the entryway, outwards or inwards."""
    count = len(strip.slots)
    if count < 2:
        return strip
    step = choices.between(10, 34) * (1 if choices.chance(60) else -1)
    if entry and choices.chance(40):
        return Strip(strip.slots, (-choices.between(16, 30), *[0] * (count - 1)))
    moved_slots = choices.between(1, count - 1)
    bays = [step if i >= count - moved_slots else 0 for i in range(count)]
    return Strip(strip.slots, tuple(bays))


# Minimum depth of the core [units].
MIN_CORE_DEPTH = 70

Areas = Mapping[int, float]
Placing = Callable[[Areas], list[Box] | None]
"""Places the rooms of a plan, by their gross areas [units²]; returns None where they do not fit."""


def inline(
    groups: Groups, request: LayoutRequest, briefs: Sequence[Brief], hall: int, choices: Choices
) -> Placing | None:
    """Core in the middle, a wing in line with it, the service block on its other side."""
    wing = draw_wing(groups.private, groups.entry, groups.closet, hall, request, briefs, choices)
    if wing is None:
        return None
    core = core_trees(groups, briefs, choices)
    low, high = _offsets(request.outline, choices)
    service = service_block(groups, request.outline, choices)

    mouth = Mouth(True, 0, 0, wing.width)

    def place(areas: Areas) -> list[Box] | None:
        rooms = wing.place(areas)
        if rooms is None:
            return None
        y0, y1 = rooms.low - low, rooms.high + high
        if y1 - y0 < MIN_CORE_DEPTH:
            return None
        width = int(tree_area(core[0], areas) / (y1 - y0) + 0.5)
        boxes = rooms.boxes + choose_squarest(core, areas, (-width, y0, 0, y1), [mouth])
        if service is not None:
            boxes += service.boxes(areas, -width, y0, y1)
        return boxes

    return place


def _offsets(outline: str | None, choices: Choices) -> tuple[int, int]:
    """Draw how far the core reaches beyond the wing at its low and its high side [units].

    Between two wings it protrudes on one side (`bar`), or is set back there (`court`).
    """
    step = choices.between(24, 60)
    side = choices.below(2)
    if outline in ("rectangle", "U"):  # a wing's porch makes the U
        return 0, 0
    if outline == "L":
        out = step if choices.chance(60) else -step
        return (out, 0) if side else (0, out)
    if outline == "T":
        return choices.between(18, 34), choices.between(18, 34)
    if outline in ("bar", "court"):
        out = choices.between(24, 44) * (1 if outline == "bar" else -1)
        return (out, 0) if side else (0, out)
    low, high = (choices.weighted(((0, 50), (1, 30), (-1, 20))) for _ in range(2))
    if low == -1 and high == -1:
        low = 0
    return low * step, high * choices.between(12, 44)


def across(
    groups: Groups, request: LayoutRequest, briefs: Sequence[Brief], hall: int, choices: Choices
) -> Placing | None:
    """A long core with a wing at a right angle to it, and the service block at its end."""
    wing = draw_wing(groups.private, groups.entry, groups.closet, hall, request, briefs, choices)
    if wing is None:
        return None
    core = core_trees(groups, briefs, choices)
    service = service_block(groups, request.outline, choices)
    at = {"L": choices.pick((0, 100)), "T": 50}.get(request.outline or "")
    if at is None:
        at = choices.weighted(((0, 40), (100, 40), (50, 20)))
    height = choices.between(86, 150)

    mouth = Mouth(False, 0, 0, wing.width)

    def place(areas: Areas) -> list[Box] | None:
        rooms = wing.place(areas)
        if rooms is None:
            return None
        area = tree_area(core[0], areas)
        depth = max(rooms.high - rooms.low, 1)
        length = max(int(area / height + 0.5), depth if request.outline == "rectangle" else 0)
        left = rooms.low + (depth - length) * at // 100
        high = int(area / length + 0.5)
        if high < MIN_CORE_DEPTH:
            return None
        boxes = [Box(b.room, b.y0, b.x0, b.y1, b.x1) for b in rooms.boxes]
        boxes += choose_squarest(core, areas, (left, -high, left + length, 0), [mouth])
        if service is not None:
            boxes += service.boxes(areas, left, -high, 0)
        return boxes

    return place


def two_wings(
    groups: Groups,
    request: LayoutRequest,
    briefs: Sequence[Brief],
    halls: tuple[int, int],
    choices: Choices,
) -> Placing | None:
    """A core between two wings."""
    main, *others = choices.shuffled(groups.private)
    half = (len(others) + choices.below(2)) // 2
    if half < 1 or len(others) - half < 2:
        return None
    plain = replace(request, outline=request.outline and "rectangle")  # without a porch
    first = draw_wing(
        [main, *others[:half]], groups.entry, groups.closet, halls[0], plain, briefs, choices
    )
    second = draw_wing(others[half:], None, None, halls[1], plain, briefs, choices)
    if first is None or second is None:
        return None
    core = core_trees(groups, briefs, choices)
    shape = {"T": "bar", "U": "court"}.get(request.outline or "", request.outline)
    offsets = _offsets(shape, choices)
    as_core = choices.chance(50) if shape is None else shape in ("rectangle", "L")
    return partial(_between, core, (first, second), offsets, as_core)


def _between(
    core: list[Tree],
    wings: tuple[Wing, Wing],
    offsets: tuple[int, int],
    as_core: bool,
    areas: Areas,
) -> list[Box] | None:
    """Place a core between two wings.

    Args:
        core: Ways to divide the core.
        wings: The wing at its high x, and the one at its low x.
        offsets: How far the core reaches beyond the first wing, at low and at high y [units].
        as_core: Whether the second wing is as deep as the core, else as the first wing.
        areas: Gross areas of the rooms [units²].
    """
    first, second = wings
    east = first.place(areas)
    if east is None:
        return None
    y0, y1 = east.low - offsets[0], east.high + offsets[1]
    west = _fit_wing(second, areas, *((y0, y1) if as_core else (east.low, east.high)))
    if west is None or y1 - y0 < MIN_CORE_DEPTH:
        return None
    width = int(tree_area(core[0], areas) / (y1 - y0) + 0.5)
    other = next(box for box in west if box.room == second.corridor)
    mouths = [Mouth(True, 0, 0, first.width), Mouth(True, -width, other.y0, other.y1)]
    boxes = east.boxes + choose_squarest(core, areas, (-width, y0, 0, y1), mouths)
    return boxes + [Box(b.room, -width - b.x1, b.y0, -width - b.x0, b.y1) for b in west]


def _fit_wing(wing: Wing, areas: Areas, low: int, high: int) -> list[Box] | None:
    """Return a wing's rooms, moved and deepened to fill a span along y [units]."""
    rooms = wing.place(areas)
    for _ in range(2):
        if rooms is None:
            return None
        current = rooms.high - rooms.low - wing.width
        depth = wing.back_depth * (high - low - wing.width) / current
        wing = replace(wing, back_depth=int(depth + 0.5))
        rooms = wing.place(areas)
    if rooms is None:
        return None
    shift = low - rooms.low
    rest = high - rooms.high - shift
    if abs(rest) > 6:
        return None
    top = rooms.high
    return [
        Box(b.room, b.x0, b.y0 + shift, b.x1, b.y1 + shift + (rest if b.y1 == top else 0))
        for b in rooms.boxes
    ]


def columns(
    groups: Groups, request: LayoutRequest, briefs: Sequence[Brief], choices: Choices
) -> Placing | None:
    """A small home without a corridor: rooms in a column beside the core open to it."""
    slots = [*(groups.entry or [])]
    for group in choices.shuffled(groups.private):
        slots += group if choices.chance(50) else group[::-1]
    column = Strip(tuple(slots), (0,) * len(slots))
    if request.outline == "U":
        if len(slots) < 3:
            return None
        at = choices.between(1, len(slots) - 2)
        column = replace(column, bays=tuple(-30 * (i == at) for i in range(len(slots))))
    elif request.outline is None and choices.chance(35):
        column = add_bays(column, choices, False)
    core = core_trees(groups, briefs, choices)
    service = service_block(groups, request.outline, choices)
    ratio = choices.between(62, 110)
    low, high = _offsets(request.outline, choices)

    def place(areas: Areas) -> list[Box] | None:
        total = fsum(areas.values())
        height = int(sqrt(total * 100 / (1.45 * ratio)))
        y0, y1 = -low, height + high
        if y1 - y0 < MIN_CORE_DEPTH:
            return None
        width = int(tree_area(core[0], areas) / (y1 - y0) + 0.5)
        boxes = choose_squarest(core, areas, (-width, y0, 0, y1))
        depth = column.depth(areas, height)
        if depth < 40:
            return None
        beside = column.boxes(areas, height, depth, 0, 1)
        boxes += [Box(b.room, b.y0, b.x0, b.y1, b.x1) for b in beside]
        if service is not None:
            boxes += service.boxes(areas, -width, y0, y1)
        return boxes

    return place


# Length of rows, squared, over the area of their rooms [%].
LENGTH_RATIOS = (55, 70, 85, 105, 130, 160, 195)


def rows(
    groups: Groups,
    request: LayoutRequest,
    briefs: Sequence[Brief],
    halls: Sequence[int],
    choices: Choices,
) -> Placing | None:
    """A compact home: the core with the service block, along it a corridor and a strip of rooms.

    With two halls there is such a strip on both of its sides.
    """
    areas_m2 = {i: brief.area for i, brief in enumerate(briefs)}
    strips = _row_strips(groups, areas_m2, len(halls), request.outline, choices)
    if not strips:
        return None
    core = core_trees(groups, briefs, choices)
    service = service_block(groups, request.outline, choices)
    if service is not None:
        pairs = [(tree, service.trees[choices.below(len(service.trees))]) for tree in core]
        core = [Cut(True, pair if choices.chance(50) else pair[::-1]) for pair in pairs]
    width = request.corridor + WALL
    closets = [groups.closet, None]
    suites = [closet is None and choices.chance(65) for closet in closets]

    def place(ratio: int, areas: Areas) -> list[Box] | None:
        length = int(sqrt(fsum(areas.values()) * ratio / 100))
        depth = int(tree_area(core[0], areas) / length + 0.5)
        if depth < MIN_CORE_DEPTH:
            return None
        boxes: list[Box] = []
        for strip, hall, suite, closet, away in zip(
            strips, halls, suites, closets, (1, -1), strict=False
        ):
            side = depth if away == 1 else 0
            beside = _corridor_row(strip, hall, suite, closet, areas, length, width)
            if beside is None:
                return None
            boxes += [
                Box(b.room, b.x0, min(side + away * b.y0, side + away * b.y1), b.x1,
                    max(side + away * b.y0, side + away * b.y1))
                for b in beside
            ]  # fmt: skip
        return boxes + choose_squarest(core, areas, (0, 0, length, depth))

    gross = {i: gross_area(area) for i, area in areas_m2.items() if area}
    for ratio in choices.shuffled(LENGTH_RATIOS)[:TRIES]:
        boxes = place(ratio, gross)
        if boxes is not None and is_promising(boxes, briefs):
            return partial(place, ratio)
    return None


def _row_strips(
    groups: Groups, areas: Areas, count: int, outline: str | None, choices: Choices
) -> list[Strip]:
    """Divide the private rooms among strips, at most two; an empty list where one has none."""
    parts: list[list[RoomGroup]] = [[] for _ in range(count)]
    # Groups of about one area share a strip, so that none is much narrower than it is deep.
    ordered = sorted(choices.shuffled(groups.private), key=lambda group: _area([group], areas))
    half = _area(ordered, areas) / len(parts)
    for group in ordered if choices.chance(50) else ordered[::-1]:
        part = next((part for part in parts if _area(part, areas) < half), parts[-1])
        part.append(group if choices.chance(50) else group[::-1])
    parts = [choices.shuffled(part) for part in parts]
    if not all(parts):
        return []
    if groups.entry:
        parts[-1].insert(0, groups.entry)
    strips = [_strip(part) for part in parts]
    if outline is None:
        strips = [
            add_bays(strip, choices, False) if choices.chance(40) else strip for strip in strips
        ]
    return strips


def _corridor_row(
    strip: Strip,
    hall: int,
    suite: bool,
    closet: int | None,
    areas: Areas,
    length: int,
    width: int,
) -> list[Box] | None:
    """Return a corridor from y = 0 on and the strip of rooms above it.

    With `suite` the last room reaches over the end of the corridor; a closet ends it, too.
    """
    if suite and len(strip.slots) > 1:
        strip = replace(strip, bays=(*strip.bays[:-1], strip.bays[-1] + width))
    else:
        suite = False
    depth = strip.depth(areas, length)
    if not MIN_DEPTH <= depth <= MAX_DEPTH:
        return None
    boxes = strip.boxes(areas, length, depth, width, 1)
    end = length
    if suite:
        end = boxes[-1].x0
        boxes = [
            b if b.x0 < end else Box(b.room, b.x0, b.y0 - width, b.x1, b.y1 - width) for b in boxes
        ]
    if closet is not None:
        end -= min(max(int(areas[closet] / width + 0.5), 24), 52)
        boxes.append(Box(closet, end, 0, length, width))
    return None if end < 24 else [*boxes, Box(hall, 0, 0, end, width)]


# Share of the home's clear area that is in rooms; the rest is in door gaps.
ROOMS_SHARE = 0.992
# How far the area may be from the requested one, as a share of it, and the tries to get there.
TOLERANCE = 0.012
ROUNDS = 7
# Probabilities [%] of edition 2, by the number of bedrooms up to four: that a home is made of rows,
# and has rooms on both sides of its core.
ROWS_PERCENT, TWO_ROWS_PERCENT = {1: 25, 2: 40, 3: 65, 4: 80}, {1: 5, 2: 20, 3: 55, 4: 75}


@dataclass(frozen=True)
class RoomLayout:
    """A home's rooms, placed.

    Attributes:
        briefs: The rooms, hallways included.
        boxes: The places of the rooms [units]; a room may have several.
    """

    briefs: list[Brief]
    boxes: list[Box]


def draw_layout(request: LayoutRequest, choices: Choices) -> RoomLayout | None:
    """Draw one layout, or return None where the rooms do not fit as drawn."""
    if all(brief.kind != "bedroom" for brief in request.briefs):
        return RoomLayout(request.briefs, _studio(request.briefs, choices))
    groups = group_rooms(request.briefs, choices)
    bedrooms = sum(brief.kind == "bedroom" for brief in request.briefs)
    briefs = [*request.briefs, Brief("hallway", 0.0)]
    hall = len(briefs) - 1
    if (
        request.edition == 2
        and request.outline in (None, "rectangle")
        and choices.chance(ROWS_PERCENT[min(bedrooms, 4)])
    ):
        halls = [hall]
        if choices.chance(TWO_ROWS_PERCENT[min(bedrooms, 4)]):
            briefs.append(Brief("hallway", 0.0))
            halls.append(hall + 1)
        placing = rows(groups, request, briefs, halls, choices)
    elif groups.closet is None and bedrooms <= 2 and choices.chance(70 if bedrooms == 1 else 25):
        briefs.pop()
        placing = columns(groups, request, briefs, choices)
    elif bedrooms > 3 and choices.chance(65 if bedrooms < 6 else 90):
        groups.private += [[(room,)] for room in groups.service]
        briefs.append(Brief("hallway", 0.0))
        placing = two_wings(groups, request, briefs, (hall, hall + 1), choices)
    elif choices.chance(65):
        placing = inline(groups, request, briefs, hall, choices)
    else:
        placing = across(groups, request, briefs, hall, choices)
    if placing is None:
        return None
    boxes = _place_at_scale(placing, briefs, request.area_m2)
    return None if boxes is None else RoomLayout(briefs, boxes)


def _studio(briefs: Sequence[Brief], choices: Choices) -> list[Box]:
    """Return the boxes of a studio: its second and third room in a strip beside the first."""
    (living, first, second) = (brief.area * UNITS_PER_M**2 for brief in briefs)
    width = choices.between(32, 46)
    bath, third = round(first / width), round(second / width)
    height = bath + WALL + third
    end = width + WALL + round(living / height) + WALL
    return [
        Box(0, width + WALL, 0, end, height + WALL),
        Box(1, 0, 0, width + WALL, bath + WALL),
        Box(2, 0, bath + WALL, width + WALL, height + WALL),
    ]


def _place_at_scale(placing: Placing, briefs: Sequence[Brief], area_m2: float) -> list[Box] | None:
    """Place the rooms at the scale at which their clear areas add up to the requested area."""
    target = area_m2 * UNITS_PER_M2 * ROOMS_SHARE
    factor = 1.0
    for _ in range(ROUNDS):
        areas = {i: gross_area(brief.area * factor) for i, brief in enumerate(briefs) if brief.area}
        boxes = placing(areas)
        if boxes is None or not is_promising(boxes, briefs):
            return None
        area = sum_in_order(box.clear_area for box in boxes)
        if abs(area - target) <= TOLERANCE * target:
            return boxes
        factor *= target / area
    return None
