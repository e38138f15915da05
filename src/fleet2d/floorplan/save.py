"""Write a floor plan to a file: Fleet2D's own format as JSON or YAML, or GeoJSON."""

import json
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import shapely
import yaml
from shapely import LineString, MultiPolygon, Point
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.formats.geojson_file import COLLECTION
from fleet2d.floorplan.formats.native import cell_polygons, native_document, object_document
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.source import YAML

_NUMBER = r"[-+.\deE]+"
_POINT = re.compile(rf"\[\s+({_NUMBER}),\s+({_NUMBER})\s+\]")


def save_floorplan(plan: FloorPlan, path: str | Path) -> None:
    """Write a plan to a new file, in the format of its suffix.

    `.json`, `.yaml` and `.yml` are Fleet2D's own format; reading it at the same cell size gives an
    equal plan. `.geojson` is for other programs.

    Raises:
        FloorPlanError: The file exists, can't be written, or has another suffix.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".geojson":
        text = _json(geojson_document(plan))
    elif suffix == ".json":
        text = _json(native_document(plan))
    elif suffix in YAML:
        text = _yaml(native_document(plan), path)
    else:
        raise FloorPlanError(f"{path}: a floor plan is written as .json, .yaml or .geojson")
    _write_new(path, text)


def geojson_document(plan: FloorPlan) -> dict[str, Any]:
    """Return a plan as a GeoJSON FeatureCollection, in metres; `read_geojson` reads it."""
    to_metres = plan.lattice.to_metres
    features = [_feature(shapely.transform(p, to_metres), "free") for p in plan.polygons]
    for room in plan.rooms:
        cells = MultiPolygon(cell_polygons(plan.room_of_cell == room.index))
        properties = {"name": room.name, "type": room.type, "labels": list(room.labels)}
        features.append(_feature(shapely.transform(cells, to_metres), "room", **properties))
    for door in plan.doorways:
        kind = "door" if door.leaf else "opening"
        features.append(_feature(LineString([door.start, door.end]), kind, name=door.name))
    for thing in plan.objects:
        properties = object_document(thing)
        del properties["footprint"]
        features.append(_feature(thing.footprint, "object", **properties))
    features += [_feature(area, "no_go") for area in plan.no_go]
    if plan.entrance is not None:
        features.append(_feature(Point(plan.entrance), "entrance"))
    return {"type": COLLECTION, "name": plan.name, "units": "m", "features": features}


def _feature(shape: BaseGeometry, kind: str, **properties: Any) -> dict[str, Any]:
    if isinstance(shape, MultiPolygon) and len(shape.geoms) == 1:
        shape = shape.geoms[0]
    all_properties = {"kind": kind, **properties}
    return {"type": "Feature", "properties": all_properties, "geometry": mapping(shape)}


def _json(document: dict[str, Any]) -> str:
    """Return JSON with one point to a line."""
    return _POINT.sub(r"[\1, \2]", json.dumps(document, indent=1)) + "\n"


def _yaml(document: dict[str, Any], path: Path) -> str:
    """Return YAML with one point to a line."""
    dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    style: dict[str, Any] = {"default_flow_style": None, "sort_keys": False, "width": 100}
    try:
        text: str = yaml.dump(document, Dumper=dumper, **style)
    except UnicodeEncodeError as error:
        raise FloorPlanError(f"{path} can't be written: {error}; choose .json") from error
    return text


def _write_new(path: Path, text: str) -> None:
    try:
        with path.open("x", encoding="utf-8", newline="\n") as file:
            try:
                file.write(text)
                file.flush()
            except BaseException:
                with suppress(OSError):
                    path.unlink()
                raise
    except FileExistsError:
        raise FloorPlanError(f"{path} exists already: remove it, or name another file") from None
    except OSError as error:
        raise FloorPlanError(f"{path} can't be written: {error.strerror or error}") from error
