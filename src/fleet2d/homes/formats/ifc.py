"""Building models in IFC: the spaces, walls, doors, windows, furniture and stairs."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry.base import BaseGeometry

from fleet2d.bounds import CORNERS
from fleet2d.configuration.units import InputPath
from fleet2d.errors import FloorPlanError, extra
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.files import in_file, reading
from fleet2d.floorplan.furniture import measured_height
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.homes.formats.features import Draft, Feature
from fleet2d.homes.formats.storeys import Storey, arrange
from fleet2d.homes.formats.sweethome import furniture_type
from fleet2d.kernels import F64, I64

# What each class of IFC is in a plan; classes that a version of IFC lacks are left out.
KINDS = {
    "IfcSpace": "room",
    "IfcWall": "wall",
    "IfcCurtainWall": "wall",
    "IfcColumn": "wall",
    "IfcOpeningElement": "opening",
    "IfcStair": "stairs",
    "IfcRamp": "stairs",
    "IfcTransportElement": "lift",
    "IfcDoor": "door",
    "IfcWindow": "window",
    "IfcFurnishingElement": "object",
    "IfcSanitaryTerminal": "object",
    "IfcElectricAppliance": "object",
}
# What stands for no word in the model's vocabulary of furniture and appliances.
UNDEFINED = (None, "", "NOTDEFINED", "USERDEFINED")
# Coordinates are rounded to this, so that faces of one wall meet [m].
ROUNDED_M = 1e-4
# An opening without a door is a way if it begins below the first height above the storey, and ends
# above the second [m].
WAY_M = (0.3, 1.6)
# The first and the last steps of stairs are in such a slice of their height [m].
STEP_M = 0.4
# Objects whose lowest point is higher above the storey hang on a wall; through windows whose sill
# is higher nobody is seen [m].
HIGHEST = {"object": 0.5, "window": 1.3}
# How many elements may contain one another, and be the parts of one.
MAX_PARENTS = 8
MAX_PARTS = 500


class Ifc(FileSource):
    """A building model in IFC; needs the extra `ifc`.

    Attributes:
        path: The IFC file.
        level: The storey, by name or GlobalId; left out: all of them, side by side.
    """

    suffixes = (".ifc",)

    path: InputPath
    level: str | None = Field(default=None, coerce_numbers_to_str=True)

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the storeys of the model, as seen from above.

        Free space is the spaces (`IfcSpace`) without the walls or, without spaces, what the walls
        enclose. Doors, openings and gaps lead through walls, one sees through windows between
        rooms, and stairs join storeys. Their geometry is computed by ifcopenshell, in metres
        whatever the units of the model.

        Raises:
            FloorPlanError: The file can't be read, or its storey has no spaces and no closed walls.
            InputError: ifcopenshell is not installed.
        """
        model = _read(files[self.path], self.path)
        with in_file(self.path):
            notes: list[str] = []
            storeys = {str(s.GlobalId): s for s in model.by_type("IfcBuildingStorey")}
            heights = {key: _height(storey) for key, storey in storeys.items()}
            levels = [Storey(k, s.Name or k, heights[k]) for k, s in storeys.items()]
            drawn = list(_features(model, heights, notes))
            metre = 1 / (self.scale or 1)
            features = arrange(drawn, levels, self.level, notes, metre=metre)
            corners = shapely.get_num_coordinates([feature.shape for feature in features]).sum()
            CORNERS.check(int(corners), "it", FloorPlanError)
            draft = Draft(features, 0.1, notes, scale=self.scale)
            return draft.build(self.path.stem, self.cell, f"IFC, {self.path.name}")


def _read(content: bytes, path: Path) -> Any:
    """Return the model in a file."""
    with extra("ifc", "reading IFC needs ifcopenshell"):
        import ifcopenshell
    with reading(path, "IFC"):
        if not content[:64].lstrip().startswith(b"ISO-10303-21"):
            raise ValueError("it has no header ISO-10303-21")
        return ifcopenshell.file.from_string(content.decode("latin-1"))


def _elements(model: Any) -> Iterator[tuple[str, Any]]:
    """Yield kind and element of what a plan shows."""
    for name, kind in KINDS.items():
        try:
            elements = model.by_type(name)
        except RuntimeError:  # this version of IFC has no such class
            continue
        yield from ((kind, element) for element in elements)


def _storey_of(element: Any, heights: Mapping[str, float]) -> str | None:
    """Return the GlobalId of the storey that an element is on, if it is on any."""
    from ifcopenshell.util.element import get_aggregate, get_container

    place = element
    if element.is_a("IfcOpeningElement"):
        place = next((rel.RelatingBuildingElement for rel in element.VoidsElements), None)
    for _ in range(MAX_PARENTS):
        if place is None or str(place.GlobalId) in heights:
            break
        place = get_aggregate(place) if place.is_a("IfcSpace") else get_container(place)
    return None if place is None else str(place.GlobalId)


def _features(model: Any, heights: Mapping[str, float], notes: list[str]) -> Iterator[Feature]:
    """Yield the elements of each storey as features [m], without those that hang on walls."""
    lost = 0
    for kind, element in _elements(model):
        if kind == "opening" and element.HasFillings:
            continue  # the door or window in it is an element itself
        points, faces = _geometry(element)
        shape = _seen_from_above(points, faces)
        lost += shape.is_empty
        if shape.is_empty:
            continue
        key = _storey_of(element, heights)
        floor = heights.get(key or "", 0.0)
        low = float(points[:, 2].min()) - floor
        high = float(points[:, 2].max()) - floor
        if low > HIGHEST.get(kind, np.inf):
            continue
        if kind == "opening" and (low > WAY_M[0] or high < WAY_M[1]):
            continue
        label = getattr(element, "LongName", None) or element.Name
        properties = {"name": label} if label else {}
        if kind in ("door", "window", "opening"):
            shape = shape.minimum_rotated_rectangle
            properties = properties if kind == "door" else {}
        elif kind == "object":
            words = [label, getattr(element, "PredefinedType", None)]
            own = [str(word) for word in words if word not in UNDEFINED]
            type_name = furniture_type(" ".join(own) or "object")
            properties = {"type": type_name, "height": measured_height(type_name, high)}
        elif kind in ("stairs", "lift"):
            properties = _way_up(points, heights)
        yield Feature(kind, f"{element.is_a()} {element.GlobalId}", shape, properties, key)
    if lost:
        notes.append(f"elements without a geometry, which are left out: {lost}")


def _geometry(element: Any) -> tuple[F64, I64]:
    """Return the corners (n, 3) [m] and triangles (m, 3) of an element, or of its parts."""
    from ifcopenshell import geom
    from ifcopenshell.util.element import get_parts

    settings = geom.settings()
    settings.set("use-world-coords", True)
    own = [element] if element.Representation else get_parts(element)
    points = [np.empty((0, 3))]
    faces = [np.empty((0, 3), np.int64)]
    count = 0
    for part in own[:MAX_PARTS]:
        try:
            made = geom.create_shape(settings, part).geometry
        except RuntimeError:  # it has no geometry, or a damaged one
            continue
        corners = np.asarray(made.verts, np.float64).reshape(-1, 3)
        points.append(corners)
        faces.append(np.asarray(made.faces, np.int64).reshape(-1, 3) + count)
        count += len(corners)
    return np.concatenate(points), np.concatenate(faces)


def _way_up(points: F64, heights: Mapping[str, float]) -> dict[str, Any]:
    """Return the storey that stairs lead to, and the middle of their first and last steps."""
    low = float(points[:, 2].min())
    high = float(points[:, 2].max())
    above = {key: height for key, height in heights.items() if height > low + WAY_M[1]}
    foot = _middle(points[points[:, 2] <= low + STEP_M])
    head = _middle(points[points[:, 2] >= high - STEP_M])
    upper = min(above, key=lambda key: abs(above[key] - high), default=None)
    return {"foot": foot, "head": head, "upper": upper}


def _middle(points: F64) -> tuple[float, ...]:
    """Return the middle (x, y) of the box around points."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return tuple(middle[:2].tolist())


def _height(storey: Any) -> float:
    """Return how high a storey is [m]."""
    from ifcopenshell.util.placement import get_local_placement
    from ifcopenshell.util.unit import calculate_unit_scale

    height = 0.0
    if storey.ObjectPlacement is not None:
        height = float(get_local_placement(storey.ObjectPlacement)[2, 3])
    return (height or float(storey.Elevation or 0.0)) * float(calculate_unit_scale(storey.file))


def _seen_from_above(points: F64, faces: I64) -> BaseGeometry:
    """Return what a body of corners [m] and triangles covers of the floor."""
    if not len(faces) or not np.isfinite(points).all():
        return shapely.Polygon()
    flat = np.round(points[:, :2] / ROUNDED_M) * ROUNDED_M
    triangles = np.asarray(shapely.polygons(flat[faces]))
    return shapely.union_all(triangles[shapely.area(triangles) > 0], grid_size=ROUNDED_M)
