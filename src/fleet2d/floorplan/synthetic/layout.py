"""Draw a layout: a kind of plan, at the scale at which the home has the requested area."""

from collections.abc import Sequence
from dataclasses import dataclass

from fleet2d.floorplan.synthetic.draws import Choices
from fleet2d.floorplan.synthetic.geometry import PER_M2, Box
from fleet2d.floorplan.synthetic.grouping import group_rooms
from fleet2d.floorplan.synthetic.plans import Placing, across, columns, inline, two_wings
from fleet2d.floorplan.synthetic.program import Brief
from fleet2d.floorplan.synthetic.request import LayoutRequest, is_promising
from fleet2d.floorplan.synthetic.slicing import gross_area
from fleet2d.runtime.determinism import sum_in_order

# Share of the home's clear area that is in rooms; the rest is in door gaps.
ROOMS_SHARE = 0.992
# How far the area may be from the requested one, as a share of it, and the tries to get there.
TOLERANCE = 0.012
ROUNDS = 7


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
    groups = group_rooms(request.briefs, choices)
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
    boxes = _place_at_scale(placing, briefs, request.area_m2)
    return None if boxes is None else RoomLayout(briefs, boxes)


def _place_at_scale(placing: Placing, briefs: Sequence[Brief], area_m2: float) -> list[Box] | None:
    """Place the rooms at the scale at which their clear areas add up to the requested area."""
    target = area_m2 * PER_M2 * ROOMS_SHARE
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
