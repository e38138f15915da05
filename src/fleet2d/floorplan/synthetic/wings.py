"""Draw wings: which rooms go to which side of a corridor, and how deep the sides are."""

from collections.abc import Mapping, Sequence
from math import fsum, sqrt

from fleet2d.floorplan.synthetic.draws import Choices
from fleet2d.floorplan.synthetic.geometry import PER_M, WALL
from fleet2d.floorplan.synthetic.grouping import RoomGroup
from fleet2d.floorplan.synthetic.program import Brief
from fleet2d.floorplan.synthetic.request import LayoutRequest, is_promising
from fleet2d.floorplan.synthetic.slicing import Strip, gross_area, slenderness
from fleet2d.floorplan.synthetic.wing import Wing

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
        depths = [int(PER_M * sqrt(middle) * percent / 100) for percent in (78, 90, 102, 114)]
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
    """Return the wing whose rooms are least slender, or None where none fits."""
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
