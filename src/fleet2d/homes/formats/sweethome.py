"""Homes of Sweet Home 3D, as the Home.xml in their file has them."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET
from zipfile import ZipFile

import numpy as np
from shapely import LineString, Polygon

from fleet2d.bounds import FILE_BYTES
from fleet2d.configuration.units import InputPath
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.files import MAX_COORDINATE_M, in_file, reading
from fleet2d.floorplan.furniture import FURNITURE, measured_height
from fleet2d.floorplan.mesh import repair
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.room import room_type
from fleet2d.homes.formats.features import Draft, Feature
from fleet2d.homes.formats.storeys import Storey, arrange

CM_PER_M = 100
# What begins higher above the floor is a window or hangs on a wall [cm].
RAISED_CM = 20
# Through what begins higher above the floor nobody is seen [cm].
SILL_CM = 130
# Words in names and catalogues of furniture, and the type in Fleet2D's catalogue.
FURNITURE_WORDS = {
    "refrigerator": "fridge",
    "cooker": "stove",
    "oven": "stove",
    "television": "tv",
    "washbasin": "washbasin",
    "bath": "bathtub",
    "couch": "sofa",
    "closet": "wardrobe",
    "bookcase": "bookshelf",
    "bedsidetable": "nightstand",
}
MIN_SIDE_CM = 1.0
# Words in the names of stairs, in several languages.
STAIRS = re.compile("stair|trepp|escali|escaler|scala|scale\\b|trap\\b", re.IGNORECASE)
# The angle between two corners of a round wall [rad].
ARC_STEP = math.radians(5)


class SweetHome(FileSource):
    """A home of Sweet Home 3D: its .sh3d file, or the Home.xml in that.

    Attributes:
        path: The file.
        level: The storey, by name or id; left out: all of them, side by side.
    """

    suffixes = (".xml", ".sh3d")

    path: InputPath
    level: str | None = None

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the home.

        Free space is the rooms without the walls or, without rooms, what the walls enclose. Doors
        lead through walls, one sees through windows between rooms, and stairs join storeys.

        Raises:
            FloorPlanError: The file can't be read, isn't such a home, or has no free space.
        """
        root = _parse(files[self.path], self.path)
        with in_file(self.path):
            if root.tag != "home":
                raise FloorPlanError(f"no home of Sweet Home 3D: it begins with <{root.tag}>")
            notes: list[str] = []
            storeys = [
                Storey(str(e.get("id")), _name(e), _number(e, "elevation") / CM_PER_M)
                for e in root.findall("level")
            ]
            drawn = [feature for element in root.iter() for feature in _features(element)]
            features = arrange(drawn, storeys, self.level, notes, metre=1 / (self.scale or 1))
            return Draft(features, 0.1, notes, scale=self.scale).build(
                root.get("name") or self.path.stem, self.cell, f"Sweet Home 3D, {self.path.name}"
            )


def _parse(content: bytes, path: Path) -> ET.Element:
    """Return the root of an XML file, or of the one in a ZIP file."""
    if content.startswith(b"PK"):
        content = _unpacked(content, path)
    try:
        return ET.fromstring(content)  # noqa: S314 - within the child's limits
    except (ET.ParseError, ValueError, LookupError) as error:
        raise FloorPlanError(f"{path} is not XML: {error}") from None


def _unpacked(content: bytes, path: Path) -> bytes:
    """Return the Home.xml in a .sh3d file."""
    with reading(path, "a home of Sweet Home 3D"), ZipFile(BytesIO(content)) as archive:
        if "Home.xml" not in archive.namelist():
            raise FloorPlanError(
                f"{path} has no Home.xml in it: save it with Sweet Home 3D 5.0 or later"
            )
        with archive.open("Home.xml") as file:
            inner = file.read(FILE_BYTES.limit + 1)  # whatever size the archive claims
        FILE_BYTES.check(len(inner), f"{path}: Home.xml", FloorPlanError, prefix="at least ")
        return inner


def _name(level: ET.Element) -> str:
    return level.get("name") or str(level.get("id"))


def _number(element: ET.Element, key: str, default: float = 0.0) -> float:
    """Return an attribute as a number [cm or rad]."""
    text = element.get(key)
    try:
        value = default if text is None else float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= MAX_COORDINATE_M * CM_PER_M:
        raise FloorPlanError(f"<{element.tag}> has {key}={text!r}: a number is expected")
    return value


def _features(element: ET.Element) -> Iterator[Feature]:
    """Yield what an element draws: a room, a wall, a door or a piece of furniture [m]."""
    name = element.get("name")
    where = f"<{element.tag}{f' {name}' if name else ''}>"
    properties: dict[str, Any] = {"name": name} if name else {}
    level = element.get("level")
    if element.tag in ("doorOrWindow", "pieceOfFurniture") and _is_stairs(element):
        yield Feature("stairs", where, _box(element), {}, level)
    elif element.tag == "room":
        corners = _metres((_number(p, "x"), _number(p, "y")) for p in element.iter("point"))
        area = repair(Polygon(corners)) if len(corners) > 2 else Polygon()
        if not area.is_empty:
            yield Feature("room", where, area, properties, level)
    elif element.tag == "wall":
        ends = _metres(
            (_number(element, f"x{end}"), _number(element, f"y{end}")) for end in ("Start", "End")
        )
        thickness = max(_number(element, "thickness", 10.0), MIN_SIDE_CM) / CM_PER_M
        if ends[0] != ends[1]:
            line = _arc(ends, _number(element, "arcExtent"))
            wall = line.buffer(thickness / 2, cap_style="square", join_style="mitre")
            yield Feature("wall", where, wall, properties, level)
    elif element.tag == "doorOrWindow":
        elevation = _number(element, "elevation")
        if elevation < SILL_CM:
            kind = "door" if elevation < RAISED_CM else "window"
            yield Feature(kind, where, _box(element), {}, level)
    elif element.tag == "pieceOfFurniture" and _number(element, "elevation") < RAISED_CM:
        kind = furniture_type(f"{element.get('catalogId', '')} {name or ''}")
        top = _number(element, "elevation") + _number(element, "height")
        heading = -math.pi / 2 - _number(element, "angle")
        height = measured_height(kind, top / CM_PER_M)
        piece = {"type": kind, "heading": round(heading, 6) % math.tau, "height": height}
        yield Feature("object", where, _box(element), piece, level)


def _is_stairs(element: ET.Element) -> bool:
    words = f"{element.get('catalogId', '')} {element.get('name', '')}"
    return element.get("staircaseCutOutShape") is not None or STAIRS.search(words) is not None


def _arc(ends: list[tuple[float, float]], extent: float) -> LineString:
    """Return the middle line of a wall, which is an arc over an angle [rad] unless that is 0.

    A positive angle bends it to the left, seen from its start in the file, whose y points down.
    """
    if abs(math.sin(extent / 2)) < 1e-6:
        return LineString(ends)
    start, end = np.array(ends)
    chord = end - start
    left = np.array([-chord[1], chord[0]])
    centre = (start + end) / 2 - left / (2 * math.tan(extent / 2))
    count = max(math.ceil(abs(extent) / ARC_STEP), 2)
    arm = start - centre
    corners = [start]
    for k in range(1, count):
        turn = -extent * k / count
        cosine = math.cos(turn)
        sine = math.sin(turn)
        turned = np.array([[cosine, -sine], [sine, cosine]]) @ arm
        corners.append(centre + turned)
    return LineString(np.round([*corners, end], 4))


def _box(element: ET.Element) -> Polygon:
    """Return the box that a door or a piece of furniture covers [m]."""
    sides = (max(_number(element, key), MIN_SIDE_CM) for key in ("width", "depth"))
    half = np.array([side / CM_PER_M / 2 for side in sides])
    corners = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    turn = -_number(element, "angle")
    cosine = math.cos(turn)
    sine = math.sin(turn)
    centre = _metres([(_number(element, "x"), _number(element, "y"))])[0]
    return Polygon(np.round(corners @ np.array([[cosine, sine], [-sine, cosine]]) + centre, 4))


def _metres(points: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return places of the file, in centimetres with y downwards, in metres with y upwards."""
    return [(round(x / CM_PER_M, 4), round(-y / CM_PER_M, 4)) for x, y in points]


def furniture_type(words: str) -> str:
    """Return the type in the catalogue that a name means, else the name as a type."""
    kind = room_type(words.rpartition("#")[2])
    flat = kind.replace("_", "")
    for word, known in (*FURNITURE_WORDS.items(), *((name, name) for name in FURNITURE)):
        if word.replace("_", "") in flat:
            return known
    return kind
