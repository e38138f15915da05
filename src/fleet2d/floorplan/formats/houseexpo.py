"""Floor plans of the HouseExpo data set: one outline and boxes with a room category each."""

from pathlib import Path

import shapely
from pydantic import Field
from shapely import Polygon
from shapely.geometry import MultiPolygon

from fleet2d.component import register
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.source import FloorPlanSource, read_json, read_numbers, read_ring
from fleet2d.paths import InputPath


@register("floorplan", "houseexpo", aliases=("he",))
class HouseExpo(FloorPlanSource):
    """A plan of the HouseExpo data set.

    Attributes:
        path: The plan's JSON file.
    """

    path: InputPath = Field(description="the plan's JSON file")

    def load(self) -> FloorPlan:
        """Read the plan."""
        return read_houseexpo(self.path, self.cell)


def read_houseexpo(path: Path, cell: float = 0.05) -> FloorPlan:
    """Read a HouseExpo file.

    Its `verts` are one outline that traces the inner walls too. Its `room_category` boxes overlap
    each other and the walls, repeat under two names, and may be missing: see `assign_rooms` for
    what comes of them.

    Args:
        path: The JSON file.
        cell: Side of a grid cell [m].

    Raises:
        FloorPlanError: It can't be read, isn't HouseExpo, or has no free space.
    """
    content = read_json(path)
    if "verts" not in content:
        hint = " (it is in Fleet2D's own format: use type native)" if "format" in content else ""
        raise FloorPlanError(f"{path} is no HouseExpo plan: it has no key `verts`{hint}")
    name = content.get("id")
    try:
        free, notes = _free_space(content["verts"])
        regions, box_notes = _regions(content.get("room_category"))
        return FloorPlan.build(
            name if isinstance(name, str) and name else path.stem,
            free,
            regions,
            cell,
            source=f"HouseExpo, {path.name}",
            doorways=None,
            regions_are="boxes",
            notes=[*notes, *box_notes],
        )
    except FloorPlanError as error:
        raise FloorPlanError(f"{path}: {error}") from error


def _free_space(verts: object) -> tuple[Polygon | MultiPolygon, list[str]]:
    """Return what the outline encloses [m], and a sentence if that took a decision."""
    outline = Polygon(read_ring(verts, "verts"))
    if outline.is_valid:
        return outline, []
    # Traced outlines touch themselves where a passage is no wider than a pixel, and at times cross.
    # Inside is what they go round at all ("structure" is nonzero winding): where a loop runs over
    # itself stays free, while even-odd would raise a wall in the middle of the room.
    repaired = shapely.make_valid(outline, method="structure", keep_collapsed=False)
    at = shapely.is_valid_reason(outline).rpartition("[")[2].rstrip("]").replace(" ", ", ")
    parts = [part for part in shapely.get_parts(repaired) if part.geom_type == "Polygon"]
    note = f"the outline touches or crosses itself at ({at}) m: all that it goes round is free"
    return MultiPolygon(parts), [note]


def _regions(categories: object) -> tuple[list[LabelledRegion], list[str]]:
    """Return the labelled boxes in file order, and a sentence for each that was the wrong way."""
    if categories is None:
        return [], []
    if not isinstance(categories, dict):
        raise FloorPlanError("room_category is not an object of category names and their boxes")
    regions: list[LabelledRegion] = []
    notes: list[str] = []
    for category, boxes in categories.items():
        if not isinstance(boxes, list):
            raise FloorPlanError(
                f"room_category.{category} is not a list of boxes [x0, y0, x1, y1]"
            )
        for number, box in enumerate(boxes):
            where = f"room_category.{category}[{number}]"
            x0, y0, x1, y1 = read_numbers(box, 4, where)
            if x1 < x0 or y1 < y0:
                notes.append(
                    f"{where} runs from its high to its low corner: taken the right way round"
                )
            shape = shapely.box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
            regions.append(LabelledRegion((category,), shape))
    return regions, notes
