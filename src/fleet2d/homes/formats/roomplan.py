"""Room scans of Apple's RoomPlan, as its JSON has them: walls, doors, openings and furniture."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
import shapely
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, TypeAdapter
from shapely import LineString, Polygon

from fleet2d.configuration.units import InputPath, Length
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.files import Listed, in_file, parse_json, validate
from fleet2d.floorplan.furniture import measured_height
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.homes.formats.features import Draft, Feature
from fleet2d.kernels import F64

# Names of furniture in the catalogue that RoomPlan has under others.
FURNITURE = {
    "refrigerator": "fridge",
    "television": "tv",
    "washerdryer": "washing_machine",
    "storage": "shelf",
    "oven": "stove",
    "dishwasher": "kitchen_counter",
}
# Axes of a scan are rounded to this [m], and turned so that its longest wall is along x.
ROUNDED_M = 0.001
# What begins higher above the floor hangs on a wall, and hides nobody who stands behind it [m].
RAISED_M = 0.2

Number = Annotated[float, Field(ge=-1e4, le=1e4)]  # metres, none of them infinite or NaN
Extent = Annotated[list[Number], Field(min_length=3, max_length=3)]
Matrix = Annotated[list[Number], Field(min_length=16, max_length=16)]


def _name_of(category: object) -> object:
    """Return the name of a category, which is written as `{"sofa": {}}`."""
    return next(iter(category), "object") if isinstance(category, dict) else category


class _Surface(BaseModel):
    """A wall, door, opening, window or piece of furniture.

    Attributes:
        dimensions: Its width, height and depth [m].
        transform: Its place, a matrix of 4 x 4 by columns; y points up.
        category: What it is.
    """

    model_config = ConfigDict(defer_build=True)

    dimensions: Extent
    transform: Matrix
    category: Annotated[str, BeforeValidator(_name_of)] = "object"

    @property
    def line(self) -> F64:
        """Its two ends on the floor (x, y), float64 (2, 2) [m]; seen from above."""
        matrix = np.array(self.transform).reshape(4, 4)
        along = matrix[0, [0, 2]] * self.dimensions[0] / 2
        at = matrix[3, [0, 2]]
        return np.stack([at - along, at + along]) * (1, -1)

    @property
    def kind(self) -> str:
        """The type of furniture."""
        kind = self.category.lower()
        return FURNITURE.get(kind, kind)

    @property
    def low_m(self) -> float:
        """How high it begins, in the frame of the scan [m]."""
        return self.transform[13] - self.dimensions[1] / 2

    def height(self, floor_m: float) -> float | None:
        """Return its height above the floor [m]: 0 if it hangs; None: the usual one of its type."""
        if self.low_m - floor_m > RAISED_M:
            return 0.0
        return measured_height(self.kind, self.low_m + self.dimensions[1] - floor_m)

    @property
    def front(self) -> F64:
        """The direction of its front (x, y), float64 (2,); seen from above."""
        return np.array([self.transform[8], -self.transform[10]])

    @property
    def box(self) -> F64:
        """The corners of what it covers of the floor, float64 (4, 2) [m]."""
        start, end = self.line
        across = self.front * self.dimensions[2] / 2
        return np.stack([start - across, end - across, end + across, start + across])


class _Scan(BaseModel):
    model_config = ConfigDict(defer_build=True)

    walls: Listed[_Surface]
    doors: Listed[_Surface] = []
    openings: Listed[_Surface] = []
    windows: Listed[_Surface] = []
    objects: Listed[_Surface] = []


_SCAN = TypeAdapter(_Scan)


class RoomPlan(FileSource):
    """A scan by Apple's RoomPlan, exported as JSON.

    Attributes:
        path: The scan's JSON file.
        wall_m: Thickness of walls, which a scan sees from one side.
    """

    marks = (("openings", None),)

    path: InputPath
    wall_m: Length = Field(default=0.1, ge=0.01, le=1)

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the scan; its longest wall is turned along x.

        Raises:
            FloorPlanError: The file can't be read, isn't such a scan, or its walls enclose nothing.
        """
        content = parse_json(files[self.path], self.path)
        with in_file(self.path):
            features = _features(validate(_SCAN, content))
            draft = Draft(features, self.wall_m, [], scale=self.scale)
            return draft.build(self.path.stem, self.cell, f"RoomPlan scan, {self.path.name}")


def _features(scan: _Scan) -> list[Feature]:
    """Return what a scan has as features [m]."""
    spans = [end - start for start, end in (wall.line for wall in scan.walls)]
    spans = spans or [np.array([1.0, 0.0])]
    longest = max(spans, key=lambda span: float(span @ span))
    x, y = longest / max(float(np.sqrt(longest @ longest)), 1e-9)
    turn = np.array([[x, -y], [y, x]])

    def place(points: F64) -> F64:
        return np.round(points @ turn / ROUNDED_M) * ROUNDED_M

    features = []
    surfaces = (scan.walls, scan.doors, scan.openings, scan.windows)
    for kind, things in zip(("wall", "door", "opening", "window"), surfaces, strict=True):
        for k, surface in enumerate(things):
            line = LineString(place(surface.line))
            features.append(Feature(kind, f"{kind}s[{k}]", line, {}))
    floor_m = min((wall.low_m for wall in scan.walls), default=0.0)
    for k, thing in enumerate(scan.objects):
        front_x, front_y = (thing.front @ turn).tolist()
        piece = {
            "type": thing.kind,
            "heading": round(math.atan2(front_y, front_x), 6) % math.tau,
            "height": thing.height(floor_m),
        }
        features.append(Feature("object", f"objects[{k}]", Polygon(place(thing.box)), piece))
    return [f for f in features if f.kind != "object" or shapely.is_valid(f.shape)]
