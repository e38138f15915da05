"""Floor plans of the HouseExpo data set: one outline and boxes with a room category each."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import shapely
from pydantic import BaseModel, ConfigDict, TypeAdapter
from shapely import Polygon
from shapely.geometry import MultiPolygon

from fleet2d.configuration.units import InputPath
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.file_source import SMALL_BYTES, FileSource
from fleet2d.floorplan.files import (
    BoxSides,
    Listed,
    Point,
    Ring,
    in_file,
    list_of,
    parse_json,
    validate,
)
from fleet2d.floorplan.mesh import repair
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion


class _HouseFile(BaseModel):
    """The keys of a HouseExpo file that are read; the outline and boxes by category [m]."""

    model_config = ConfigDict(defer_build=True)

    verts: Ring
    room_category: (
        dict[str, Annotated[Listed[BoxSides], list_of("boxes [x0, y0, x1, y1]")]] | None
    ) = None


_HOUSE_FILE = TypeAdapter(_HouseFile)


class HouseExpo(FileSource):
    """A plan of the HouseExpo data set.

    Attributes:
        path: The plan's JSON file.
    """

    marks = (("verts", None),)
    small_bytes = SMALL_BYTES

    path: InputPath

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the plan.

        Its `verts` are one outline that traces the inner walls, too. Its `room_category` boxes
        overlap each other and the walls, repeat under two names, and may be missing;
        `label_rooms` divides the rooms by them.

        Raises:
            FloorPlanError: It can't be read, isn't HouseExpo, or has no free space.
        """
        content = parse_json(files[self.path], self.path)
        if "verts" not in content:
            hint = (
                " (it is in Fleet2D's own format: use type native)" if "format" in content else ""
            )
            raise FloorPlanError(
                f"{self.path} is not a HouseExpo plan: it has no key `verts`{hint}"
            )
        name = content.get("id")
        with in_file(self.path):
            house = validate(_HOUSE_FILE, content)
            free, notes = _free_space(house.verts)
            regions, box_notes = _regions(house.room_category or {})
            return FloorPlan.build(
                name if isinstance(name, str) and name else self.path.stem,
                free,
                regions,
                self.cell,
                source=f"HouseExpo, {self.path.name}",
                doorways=None,
                regions_are="boxes" if regions else "none",
                notes=[*notes, *box_notes],
                scale=self.scale,
            )


def _free_space(corners: list[Point]) -> tuple[Polygon | MultiPolygon, list[str]]:
    """Return the space that the outline encloses [m], and a note if it had to be repaired."""
    outline = Polygon(corners)
    if outline.is_valid:
        return outline, []
    # Traced outlines touch themselves where a passage is no wider than a pixel, and may cross. All
    # that they go round is inside ("structure" is nonzero winding): even-odd would put a wall into
    # the room where a loop overlaps itself.
    sound = repair(outline)
    at = shapely.is_valid_reason(outline).rpartition("[")[2].rstrip("]").replace(" ", ", ")
    parts = [part for part in shapely.get_parts(sound) if part.geom_type == "Polygon"]
    note = f"the outline touches or crosses itself at ({at}) m: everything inside it is free"
    return MultiPolygon(parts), [note]


def _regions(categories: dict[str, list[BoxSides]]) -> tuple[list[LabelledRegion], list[str]]:
    """Return the labelled boxes in file order, and a note for each with swapped corners."""
    regions: list[LabelledRegion] = []
    notes: list[str] = []
    for category, boxes in categories.items():
        for number, (x0, y0, x1, y1) in enumerate(boxes):
            if x1 < x0 or y1 < y0:
                notes.append(
                    f"room_category.{category}[{number}] runs from its high to its low corner:"
                    " the corners are exchanged"
                )
            shape = shapely.box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
            regions.append(LabelledRegion((category,), shape))
    return regions, notes
