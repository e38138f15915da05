"""Building models in IFC: the spaces, walls, doors, windows and furniture of one storey."""

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
from fleet2d.homes.formats.features import Draft, Feature, choose_level
from fleet2d.homes.formats.sweethome import furniture_type

# What each class of IFC is in a plan; classes that a version of IFC lacks are left out.
KINDS = {
    "IfcSpace": "room",
    "IfcWall": "wall",
    "IfcColumn": "wall",
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
# Objects whose lowest point is higher above the storey hang on a wall; through windows whose sill
# is higher nobody is seen [m].
RAISED_M = 0.5
SILL_M = 1.3


class Ifc(FileSource):
    """A building model in IFC; needs the extra `ifc`.

    Attributes:
        path: The IFC file.
        level: The storey, by name or GlobalId; left out: the lowest that is not below the ground.
    """

    suffixes = (".ifc",)

    path: InputPath
    level: str | None = Field(default=None, coerce_numbers_to_str=True)

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read a storey of the model, as seen from above.

        Free space is the spaces (`IfcSpace`) without the walls or, without spaces, what the walls
        enclose. Doors lead through walls, and one sees through windows between rooms. Their
        geometry is computed by ifcopenshell, in metres whatever the units of the model.

        Raises:
            FloorPlanError: The file can't be read, or its storey has no spaces and no closed walls.
            InputError: ifcopenshell is not installed.
        """
        model = _read(files[self.path], self.path)
        with in_file(self.path):
            notes: list[str] = []
            storeys = {str(s.GlobalId): s for s in model.by_type("IfcBuildingStorey")}
            levels = [(k, s.Name or k, float(s.Elevation or 0.0)) for k, s in storeys.items()]
            level = choose_level(levels, self.level, notes)
            features = list(_features(model, None if level is None else storeys[level], notes))
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


def _elements(model: Any, storey: Any) -> Iterator[tuple[str, Any]]:
    """Yield kind and element of what is on a storey; all that the model has without storeys."""
    from ifcopenshell.util.element import get_aggregate, get_container

    for name, kind in KINDS.items():
        try:
            elements = model.by_type(name)
        except RuntimeError:  # this version of IFC has no such class
            continue
        for element in elements:
            place = get_aggregate(element) if kind == "room" else get_container(element)
            if storey is None or place is None or place == storey:
                yield kind, element


def _features(model: Any, storey: Any, notes: list[str]) -> Iterator[Feature]:
    """Yield what is on a storey as features [m]; what hangs on walls is left out."""
    from ifcopenshell import geom

    settings = geom.settings()
    settings.set("use-world-coords", True)
    highest = {"object": RAISED_M, "window": SILL_M}
    lost = 0
    for kind, element in _elements(model, storey):
        try:
            shape, low, high = _seen_from_above(geom.create_shape(settings, element))
        except RuntimeError:  # it has no geometry, or a damaged one
            shape = shapely.Polygon()
            low = 0.0
            high = 0.0
        lost += shape.is_empty
        if shape.is_empty or low - _height(storey) > highest.get(kind, np.inf):
            continue
        label = getattr(element, "LongName", None) or element.Name
        properties = {"name": label} if label else {}
        if kind in ("door", "window"):
            shape = shape.minimum_rotated_rectangle
        elif kind == "object":
            words = [label, getattr(element, "PredefinedType", None)]
            own = [str(word) for word in words if word not in UNDEFINED]
            type_name = furniture_type(" ".join(own) or "object")
            height = measured_height(type_name, high - _height(storey))
            properties = {"type": type_name, "height": height}
        yield Feature(kind, f"{element.is_a()} {element.GlobalId}", shape, properties)
    if lost:
        notes.append(f"elements without a geometry, which are left out: {lost}")


def _height(storey: Any) -> float:
    """Return how high a storey is [m]."""
    if storey is None or storey.ObjectPlacement is None:
        return 0.0
    from ifcopenshell.util.placement import get_local_placement
    from ifcopenshell.util.unit import calculate_unit_scale

    return float(get_local_placement(storey.ObjectPlacement)[2, 3]) * float(
        calculate_unit_scale(storey.file)
    )


def _seen_from_above(element: Any) -> tuple[BaseGeometry, float, float]:
    """Return what an element covers of the floor, and where it begins and ends in height [m]."""
    points = np.asarray(element.geometry.verts, np.float64).reshape(-1, 3)
    faces = np.asarray(element.geometry.faces, np.int64).reshape(-1, 3)
    if not len(faces) or not np.isfinite(points).all():
        return shapely.Polygon(), 0.0, 0.0
    flat = np.round(points[:, :2] / ROUNDED_M) * ROUNDED_M
    triangles = np.asarray(shapely.polygons(flat[faces]))
    area = shapely.union_all(triangles[shapely.area(triangles) > 0], grid_size=ROUNDED_M)
    return area, float(points[:, 2].min()), float(points[:, 2].max())
