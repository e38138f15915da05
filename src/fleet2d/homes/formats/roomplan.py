"""Scans of rooms and homes by Apple's RoomPlan, as its JSON has them.

The surfaces of walls are those that the scan saw: the inner faces of rooms. So a wall between two
rooms is the space between their surfaces or, where one surface serves both, is added.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import shapely
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, TypeAdapter
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.configuration.units import InputPath, Length
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.files import Listed, in_file, parse_json, validate
from fleet2d.floorplan.furniture import measured_height
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.homes.formats.enclosure import (
    LEAST_M2,
    NARROW_M,
    enclosed_space,
    grown,
    opened,
    parts_of,
)
from fleet2d.homes.formats.features import Draft, Feature
from fleet2d.homes.formats.storeys import Storey, arrange
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
# Half the thickness of a surface [m], and the angle between two corners of a curved one [rad].
SURFACE_M = 0.005
CURVE_STEP = math.radians(5)
# The part of a floor that walls enclose, if they close.
ENCLOSED_SHARE = 0.8

Number = Annotated[float, Field(ge=-1e4, le=1e4)]  # metres, none of them infinite or NaN
Extent = Annotated[list[Number], Field(min_length=3, max_length=3)]
Matrix = Annotated[list[Number], Field(min_length=16, max_length=16)]


def _radians(angle: object) -> object:
    """Return an angle of Apple's `Measurement`, written as its value and unit."""
    if not isinstance(angle, dict):
        return angle
    value = angle.get("value")
    unit = angle.get("unit")
    symbol = unit.get("symbol") if isinstance(unit, dict) else unit
    if symbol in ("°", "deg") and isinstance(value, int | float):
        return math.radians(value)
    return value


Angle = Annotated[float, BeforeValidator(_radians), Field(ge=-100, le=100)]


def _name_of(category: object) -> object:
    """Return the name of a category, which is written as `{"sofa": {}}`."""
    return next(iter(category), "object") if isinstance(category, dict) else category


class _SurfaceCurve(BaseModel):
    """How a surface is curved, in its own x and z [m]."""

    model_config = ConfigDict(defer_build=True)

    center: Annotated[list[Number], Field(min_length=2, max_length=2)]
    radius: Number
    startAngle: Angle  # noqa: N815 - as in the file
    endAngle: Angle  # noqa: N815


class _Surface(BaseModel):
    """A wall, door, opening, window or piece of furniture.

    Attributes:
        dimensions: Its width, height and depth [m].
        transform: Its place, a matrix of 4 x 4 by columns; y points up.
        category: What it is.
        curve: How it is curved.
        corners: The corners of a floor, in its own axes [m].
        story: The number of its storey.
    """

    model_config = ConfigDict(defer_build=True)

    dimensions: Extent
    transform: Matrix
    category: Annotated[str, BeforeValidator(_name_of)] = "object"
    curve: _SurfaceCurve | None = None
    corners: Listed[Extent] = Field(default=[], alias="polygonCorners")
    story: int = 0

    @property
    def line(self) -> F64:
        """Its two ends on the floor (x, y), float64 (2, 2) [m]; seen from above."""
        matrix = np.array(self.transform).reshape(4, 4)
        along = matrix[0, [0, 2]] * self.dimensions[0] / 2
        at = matrix[3, [0, 2]]
        return np.stack([at - along, at + along]) * (1, -1)

    @property
    def path(self) -> F64:
        """Its corners on the floor (x, y), float64 (n, 2) [m]: two ends unless it is curved."""
        if self.curve is None:
            return self.line
        first = self.curve.startAngle
        last = self.curve.endAngle
        count = max(math.ceil(abs(last - first) / CURVE_STEP), 2)
        angles = [first + (last - first) * k / count for k in range(count + 1)]
        x, z = self.curve.center
        radius = self.curve.radius
        own = [(x + radius * math.cos(a), 0.0, z + radius * math.sin(a)) for a in angles]
        return self._on_floor(own)

    @property
    def floor(self) -> BaseGeometry:
        """The area of a floor, seen from above [m]."""
        if len(self.corners) < 3:
            return Polygon()
        outline = Polygon(self._on_floor(self.corners))
        return shapely.make_valid(outline, method="structure", keep_collapsed=False)

    def _on_floor(self, own: Sequence[Sequence[float]]) -> F64:
        """Return places in its own axes (n, 3) as places (x, y) on the floor, float64 (n, 2)."""
        matrix = np.array(self.transform).reshape(4, 4)
        places = np.array(own, np.float64) @ matrix[:3, :3] + matrix[3, :3]
        return places[:, [0, 2]] * (1, -1)

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


class _Section(BaseModel):
    """A part of the home that the scan recognized.

    Attributes:
        label: What it is, such as livingRoom.
        center: A place in it (x, y, z) [m]; y points up.
        story: The number of its storey.
    """

    model_config = ConfigDict(defer_build=True)

    label: str = "unidentified"
    center: Extent
    story: int = 0


class _Scan(BaseModel):
    model_config = ConfigDict(defer_build=True)

    walls: Listed[_Surface]
    doors: Listed[_Surface] = []
    openings: Listed[_Surface] = []
    windows: Listed[_Surface] = []
    objects: Listed[_Surface] = []
    floors: Listed[_Surface] = []
    sections: Listed[_Section] = []

    @property
    def stories(self) -> list[int]:
        """The numbers of its storeys, from the lowest."""
        return sorted({surface.story for surface in (*self.walls, *self.floors)})


_SCAN = TypeAdapter(_Scan)


class RoomPlan(FileSource):
    """A scan by Apple's RoomPlan, exported as JSON.

    Attributes:
        path: The scan's JSON file.
        wall_m: Thickness of walls between rooms that share a surface.
        level: The number of the storey; left out: all of them, side by side.
    """

    marks = (("openings", None),)

    path: InputPath
    wall_m: Length = Field(default=0.1, ge=0.01, le=1)
    level: str | None = Field(default=None, coerce_numbers_to_str=True)

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the scan; its longest wall is turned along x.

        Rooms are what surfaces of walls enclose or, where these don't close, the floors. The
        sections that the scan recognized name them.

        Raises:
            FloorPlanError: The file can't be read, isn't such a scan, or its walls enclose nothing.
        """
        content = parse_json(files[self.path], self.path)
        with in_file(self.path):
            notes: list[str] = []
            scan = validate(_SCAN, content)
            drawn = _features(scan, notes)
            storeys = [Storey(str(s), str(s), _floor_m(scan, s)) for s in scan.stories]
            metre = 1 / (self.scale or 1)
            features = arrange(drawn, storeys, self.level, notes, metre=metre)
            draft = Draft(features, self.wall_m, notes, scale=self.scale)
            return draft.build(self.path.stem, self.cell, f"RoomPlan scan, {self.path.name}")


def _floor_m(scan: _Scan, story: int) -> float:
    """Return how high the floor of a storey is, in the frame of the scan [m]."""
    walls = [wall.low_m for wall in scan.walls if wall.story == story]
    return min(walls, default=float(story))


def _features(scan: _Scan, notes: list[str]) -> list[Feature]:
    """Return what a scan has as features [m]."""
    spans = [np.diff(wall.line, axis=0)[0] for wall in scan.walls]
    longest = max(spans, key=lambda span: float(span @ span), default=np.array([1.0, 0.0]))
    x, y = longest / max(float(np.sqrt(longest @ longest)), 1e-9)
    turn = np.array([[x, -y], [y, x]])

    def place(points: F64) -> F64:
        return np.round(points @ turn / ROUNDED_M) * ROUNDED_M

    features = list(_rooms(scan, place, notes))
    surfaces = (scan.doors, scan.openings, scan.windows)
    for kind, things in zip(("door", "opening", "window"), surfaces, strict=True):
        for k, surface in enumerate(things):
            line = LineString(place(surface.line))
            features.append(Feature(kind, f"{kind}s[{k}]", line, {}, str(surface.story)))
    for k, thing in enumerate(scan.objects):
        front_x, front_y = (thing.front @ turn).tolist()
        piece = {
            "type": thing.kind,
            "heading": round(math.atan2(front_y, front_x), 6) % math.tau,
            "height": thing.height(_floor_m(scan, thing.story)),
        }
        kind = "stairs" if thing.kind == "stairs" else "object"
        box = Polygon(place(thing.box))
        features.append(Feature(kind, f"objects[{k}]", box, piece, str(thing.story)))
    return [f for f in features if f.kind not in ("object", "stairs") or shapely.is_valid(f.shape)]


def _rooms(scan: _Scan, place: Any, notes: list[str]) -> Iterator[Feature]:
    """Yield the rooms of a scan [m]."""
    for story in scan.stories:
        lines = [LineString(place(w.path)) for w in scan.walls if w.story == story]
        floors = [shapely.transform(f.floor, place) for f in scan.floors if f.story == story]
        spaces = _spaces([line for line in lines if line.length > 0], floors, notes)
        labels: list[list[str]] = [[] for _ in spaces]
        for section in scan.sections:
            x, _, z = section.center
            at = shapely.Point(place(np.array([[x, -z]]))[0])
            inside = [k for k, space in enumerate(spaces) if space.intersects(at)]
            if section.story == story and inside and section.label != "unidentified":
                words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", section.label)
                labels[inside[0]].append(words)
        for k, (space, names) in enumerate(zip(spaces, labels, strict=True)):
            properties = {"labels": names, "type": names[0]} if names else {}
            yield Feature("room", f"room {k} of story {story}", space, properties, str(story))


def _spaces(
    walls: Sequence[LineString], floors: Sequence[BaseGeometry], notes: list[str]
) -> list[Polygon]:
    """Return the rooms between surfaces, and the floors on which these don't close [m]."""
    surfaces = grown(shapely.union_all(walls), SURFACE_M)
    rooms: list[Polygon] = []
    if walls:
        inside = enclosed_space(surfaces, [], notes).difference(surfaces)
        large = [part for part in parts_of(inside) if part.area >= LEAST_M2]
        wide = [part for part in large if not opened(part, NARROW_M).is_empty]
        rooms = [part for room in wide for part in parts_of(grown(room, SURFACE_M))]
    known = shapely.union_all([*rooms, surfaces])
    for floor in floors:
        if floor.intersection(known).area < ENCLOSED_SHARE * floor.area:
            rest = opened(floor.difference(known), NARROW_M)
            large = [part for part in parts_of(rest) if part.area >= LEAST_M2]
            whole = [grown(part, SURFACE_M).intersection(floor) for part in large]
            more = [part for shape in whole for part in parts_of(shape)]
            rooms += more
            if more:
                notes.append("where walls don't close, the floor of the scan bounds the room")
    return rooms
