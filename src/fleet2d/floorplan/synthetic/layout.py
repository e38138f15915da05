"""Draw a layout: a kind of plan, at the scale at which the home is as large as asked for."""

from collections.abc import Sequence
from dataclasses import dataclass

from fleet2d.floorplan.synthetic.draws import Choices
from fleet2d.floorplan.synthetic.geometry import PER_M2, Box
from fleet2d.floorplan.synthetic.grouping import grouped
from fleet2d.floorplan.synthetic.plans import Placing, across, columns, inline, two_wings
from fleet2d.floorplan.synthetic.program import Brief
from fleet2d.floorplan.synthetic.request import Request, promising
from fleet2d.floorplan.synthetic.slicing import gross

# Clear area of the rooms in that of the home: the rest are gaps of doors.
ROOMS_SHARE = 0.992
CLOSE = 0.012
ROUNDS = 7


@dataclass(frozen=True)
class Layout:
    """A home's rooms, placed.

    Attributes:
        briefs: What the rooms are, hallways included.
        boxes: Where they are [units]; a room may have several.
    """

    briefs: list[Brief]
    boxes: list[Box]


def drawn(request: Request, choices: Choices) -> Layout | None:
    """Draw one layout, or return None where the rooms do not fit as drawn."""
    groups = grouped(request.briefs, choices)
    bedrooms = sum(brief.kind == "bedroom" for brief in request.briefs)
    briefs = [*request.briefs, Brief("hallway", 0.0)]
    hall = len(briefs) - 1
    if groups.closet is None and bedrooms <= 2 and choices.chance(70 if bedrooms == 1 else 25):
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
    boxes = _sized(placing, briefs, request.area_m2)
    return None if boxes is None else Layout(briefs, boxes)


def _sized(placing: Placing, briefs: Sequence[Brief], area_m2: float) -> list[Box] | None:
    """Place the rooms at the scale at which their clear areas add up as wanted."""
    wanted = area_m2 * PER_M2 * ROOMS_SHARE
    factor = 1.0
    for _ in range(ROUNDS):
        areas = {i: gross(brief.area * factor) for i, brief in enumerate(briefs) if brief.area}
        boxes = placing(areas)
        if boxes is None or not promising(boxes, briefs):
            return None
        found = sum(box.clear_area for box in boxes)
        if abs(found - wanted) <= CLOSE * wanted:
            return boxes
        factor *= wanted / found
    return None
