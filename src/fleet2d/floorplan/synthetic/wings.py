"""Draw wings: which groups of rooms go to which side of a corridor, and how deep."""

from collections.abc import Mapping, Sequence
from math import fsum, sqrt

from fleet2d.floorplan.synthetic.draws import Choices
from fleet2d.floorplan.synthetic.geometry import PER_M, WALL
from fleet2d.floorplan.synthetic.grouping import Group
from fleet2d.floorplan.synthetic.program import Brief
from fleet2d.floorplan.synthetic.request import Request, promising
from fleet2d.floorplan.synthetic.slicing import Strip, gross, slenderness
from fleet2d.floorplan.synthetic.wing import Wing

TRIES = 3


def drawn_wing(
    groups: Sequence[Group],
    entry: Group | None,
    closet: int | None,
    corridor: int,
    request: Request,
    briefs: Sequence[Brief],
    choices: Choices,
) -> Wing | None:
    """Draw a wing, a few times if need be."""
    for _ in range(TRIES):
        wing = _divided(groups, entry, closet, corridor, request, briefs, choices)
        if wing is not None:
            return wing
    return None


def _divided(
    groups: Sequence[Group],
    entry: Group | None,
    closet: int | None,
    corridor: int,
    request: Request,
    briefs: Sequence[Brief],
    choices: Choices,
) -> Wing | None:
    """Draw a wing; the first group is that of its main bedroom."""
    areas = {i: brief.area for i, brief in enumerate(briefs)}
    suite = closet is None and choices.chance(55)
    front, back = _sides(groups, entry, areas, suite, choices)
    if not front or not back:
        return None
    fore, aft = _strip(front), _strip(back)
    if request.outline is None and choices.chance(45):
        fore = with_bays(fore, choices, bool(entry))
    if request.outline is None and choices.chance(35):
        aft = with_bays(aft, choices, False)
    if request.outline == "U" and entry:
        fore = Strip(fore.slots, (-choices.between(28, 40), *fore.bays[1:]))  # a porch
    rooms = [areas[slot[0]] for slot in aft.slots if len(slot) == 1]
    middle = fsum(rooms) / len(rooms) if rooms else 14.0
    wide = request.corridor + WALL
    depths = [int(PER_M * sqrt(middle) * percent / 100) for percent in (78, 90, 102, 114)]
    wings = [
        Wing(fore, aft, corridor, wide, min(max(depth, 56), 112), suite, closet) for depth in depths
    ]
    return _squarest_wing(wings, {i: gross(area) for i, area in areas.items() if area}, briefs)


def _sides(
    groups: Sequence[Group],
    entry: Group | None,
    areas: Mapping[int, float],
    suite: bool,
    choices: Choices,
) -> tuple[list[Group], list[Group]]:
    """Divide groups of rooms among the front and the back of a corridor.

    Args:
        groups: The rooms, those of the main bedroom first.
        entry: The group that begins the front, or None.
        areas: Of the rooms [m²].
        suite: Whether the main bedroom ends the back.
        choices: The stream to draw from.
    """
    main, *others = groups
    front: list[Group] = []
    back: list[Group] = []
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


def _strip(groups: Sequence[Group]) -> Strip:
    slots = tuple(slot for group in groups for slot in group)
    return Strip(slots, (0,) * len(slots))


def _squarest_wing(
    wings: Sequence[Wing], areas: Mapping[int, float], briefs: Sequence[Brief]
) -> Wing | None:
    """Return the wing whose rooms are least slender, or None where none fits."""
    best, least = None, 0.0
    for wing in wings:
        placed = wing.placed(areas)
        if placed is not None and promising(placed.boxes, briefs):
            found = slenderness(placed.boxes)
            if best is None or found < least:
                best, least = wing, found
    return best


def _area(groups: Sequence[Group], areas: Mapping[int, float]) -> float:
    return fsum(areas[room] for group in groups for slot in group for room in slot)


def with_bays(strip: Strip, choices: Choices, entry: bool) -> Strip:
    """Let one end of a strip, or the entryway, stand out or back."""
    count = len(strip.slots)
    if count < 2:
        return strip
    step = choices.between(10, 34) * (1 if choices.chance(60) else -1)
    if entry and choices.chance(40):
        return Strip(strip.slots, (-choices.between(16, 30), *[0] * (count - 1)))
    few = choices.between(1, count - 1)
    bays = [step if i >= count - few else 0 for i in range(count)]
    return Strip(strip.slots, tuple(bays))
