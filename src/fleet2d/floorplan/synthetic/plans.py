"""Whole plans: arrangements of core, wings and garage."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import fsum, sqrt

from fleet2d.floorplan.synthetic.core import core_trees, service_block
from fleet2d.floorplan.synthetic.draws import Choices
from fleet2d.floorplan.synthetic.geometry import Box
from fleet2d.floorplan.synthetic.grouping import Groups
from fleet2d.floorplan.synthetic.program import Brief
from fleet2d.floorplan.synthetic.request import LayoutRequest
from fleet2d.floorplan.synthetic.slicing import Mouth, Strip, Tree, choose_squarest, tree_area
from fleet2d.floorplan.synthetic.wing import Wing
from fleet2d.floorplan.synthetic.wings import add_bays, draw_wing

# Least depth of the core [units].
LEAST_CORE = 70

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
        if y1 - y0 < LEAST_CORE:
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
        if high < LEAST_CORE:
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
    if west is None or y1 - y0 < LEAST_CORE:
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
        if y1 - y0 < LEAST_CORE:
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
