"""Rooms of ESPresense Companion, which locates phones and tags: `floors` in its configuration."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import shapely
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter
from shapely import Polygon

from fleet2d.configuration.units import InputPath
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.files import Listed, Ring, in_file, parse_document, validate
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.homes.formats.features import Draft, Feature
from fleet2d.homes.formats.storeys import Storey, arrange

Height = Annotated[float, Field(ge=-1e4, le=1e4)]


class _PointedRoom(BaseModel):
    model_config = ConfigDict(defer_build=True, coerce_numbers_to_str=True)

    name: str = ""
    points: Ring


class _EspresenseFloor(BaseModel):
    """A storey; `bounds` are two corners (x, y, z) [m]."""

    model_config = ConfigDict(defer_build=True, coerce_numbers_to_str=True)

    id: str = ""
    name: str = ""
    bounds: Listed[Listed[Height]] = []
    rooms: Listed[_PointedRoom] = []


_FLOORS = TypeAdapter(Listed[_EspresenseFloor])


class Espresense(FileSource):
    """Rooms of ESPresense Companion: its configuration, in YAML.

    Attributes:
        path: The file.
        level: The storey, by name or id; left out: all of them, side by side.
    """

    marks = (("floors.0.rooms.0.points", None),)

    path: InputPath
    level: str | None = Field(default=None, coerce_numbers_to_str=True)

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the rooms, which have neither walls nor doors: those that touch are open.

        Raises:
            FloorPlanError: The file can't be read, or has no rooms.
        """
        content = parse_document(files[self.path], self.path)
        with in_file(self.path):
            notes: list[str] = []
            floors = validate(_FLOORS, content.get("floors"), "floors")
            storeys: list[Storey] = []
            drawn: list[Feature] = []
            for number, floor in enumerate(floors):
                key = floor.id or floor.name or str(number)
                heights = [corner[2] for corner in floor.bounds if len(corner) > 2]
                elevation = min(heights, default=float(number))
                storeys.append(Storey(key, floor.name or key, elevation))
                for index, room in enumerate(floor.rooms):
                    where = f"floors[{number}].rooms[{index}]"
                    outline = shapely.make_valid(Polygon(room.points), method="structure")
                    properties: dict[str, Any] = {"name": room.name} if room.name else {}
                    drawn.append(Feature("room", where, outline, properties, key))
            metre = 1 / (self.scale or 1)
            features = arrange(drawn, storeys, self.level, notes, metre=metre)
            notes.append("the file has no walls and no doors: rooms that touch are open")
            draft = Draft(features, 0.0, notes, scale=self.scale)
            return draft.build(self.path.stem, self.cell, f"ESPresense, {self.path.name}")
