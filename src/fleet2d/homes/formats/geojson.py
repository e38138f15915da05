"""Vector floor plans as GeoJSON (RFC 7946): rooms, walls, doors and furniture as features.

Three dialects are read, also mixed: our own, which names the kind of a feature by its property
`kind`, IMDF (Indoor Mapping Data Format), which names it by its member `feature_type`, and indoor
maps of OpenStreetMap, which have the tag `indoor`.
"""

import json
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely
import shapely.geometry
from pydantic import Field
from shapely import LineString, MultiPolygon, Point
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

from fleet2d.bounds import CORNERS, POLYGONS
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import InputPath, Length
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.files import (
    MAX_COORDINATE_M,
    clean_coordinate,
    in_file,
    parse_json,
    shown_value,
)
from fleet2d.floorplan.mesh import repair
from fleet2d.floorplan.native import object_document
from fleet2d.floorplan.plan import FloorPlan, cell_polygons
from fleet2d.floorplan.rooms.room import room_type
from fleet2d.homes.formats.features import GEOMETRIES, SURFACES, Draft, Feature, Move
from fleet2d.homes.formats.storeys import Storey, arrange
from fleet2d.kernels import F64

COLLECTION = "FeatureCollection"

Units = Literal["auto", "m", "degrees"]

# WGS 84: half the larger axis [m], and the square of the eccentricity.
SEMI_MAJOR_M = 6378137.0
ECCENTRICITY_2 = 0.00669437999014
# Names of Web Mercator in the member `crs` of older GeoJSON.
_WEB_MERCATOR = re.compile(r"EPSG:{1,2}(3857|900913|3785)\b")
# Minimum width of a home [m], and largest [degrees], about 5 km.
SMALLEST_M = 0.5
LARGEST_DEGREES = 0.05
# The largest coordinate that is read; UTM's northings reach ten million.
FARTHEST = 1e8

_DEPTHS = {"Point": 0, "LineString": 1, "MultiLineString": 2, "Polygon": 2, "MultiPolygon": 3}
_IMDF_KINDS = {"unit": "room", "opening": "opening", "fixture": "object", "kiosk": "object"}
_IMDF_SOLID = ("brick", "column", "concrete", "drywall", "glass", "structure", "wall")
_IMDF_NO_FLOOR = ("opentobelow", "road", "vegetation")
# Kinds of features by OpenStreetMap's tag `indoor`; None for those without an effect.
_OSM_KINDS = {
    "room": "room",
    "area": "room",
    "corridor": "room",
    "wall": "wall",
    "door": "door",
    "level": None,
    "yes": None,
}
# Tags that only outdoor features, or outlines of whole buildings, have.
_OSM_OUTSIDE = ("building", "building:part", "landuse", "natural", "barrier")
# What a room of IMDF or OpenStreetMap is if it joins storeys.
_LINKS = {
    "stairs": "stairs",
    "steps": "stairs",
    "escalator": "stairs",
    "ramp": "stairs",
    "elevator": "lift",
    "lift": "lift",
}
# The part of stairs on a storey that those on the next cover, if they are the same.
SAME_SHARE = 0.3
MAX_LEVELS = 100
_RANGE = re.compile(r"\s*(-?\d+)\s*-\s*(-?\d+)\s*")
_KIND_WORDS = {"furniture": "object", "no_go_area": "no_go"} | {kind: kind for kind in GEOMETRIES}


def read_features(content: dict[str, Any], notes: list[str]) -> tuple[list[Feature], list[Storey]]:
    """Return the features of known kinds in the units of the file, and its storeys.

    Args:
        content: The content of the file.
        notes: Sentences on anomalies are added.

    Raises:
        FloorPlanError: It isn't such a file, or a feature is damaged.
    """
    items = content.get("features")
    if content.get("type") != COLLECTION or not isinstance(items, list):
        raise FloorPlanError(f'no GeoJSON plan: "type": "{COLLECTION}" with features is expected')
    POLYGONS.check(len(items), "it", FloorPlanError)
    features: list[Feature] = []
    floors: list[dict[str, Any]] = []
    ignored: Counter[str] = Counter()
    parts = corners = 0
    tags = (item.get("properties") for item in items if isinstance(item, dict))
    is_osm = any(isinstance(own, dict) and "indoor" in own for own in tags)
    for number, item in enumerate(items):
        where = f"features[{number}]"
        if not isinstance(item, dict):
            raise FloorPlanError(f"{where} is {shown_value(item)}: a Feature is expected")
        properties = item.get("properties") or {}
        if not isinstance(properties, dict):
            raise FloorPlanError(f"{where}.properties is {shown_value(properties)}: no object")
        kind, name = _kind(item, properties, where, is_osm)
        if name == "level":
            floors.append({**properties, "id": item.get("id")})
        elif kind is None:
            ignored[name] += 1
        else:
            shape = _shape(item.get("geometry"), kind, where, notes)
            parts += int(shapely.get_num_geometries(shape))
            POLYGONS.check(parts, "it", FloorPlanError, prefix="at least ")
            corners += int(shapely.get_num_coordinates(shape))
            CORNERS.check(corners, "it", FloorPlanError, prefix="at least ")
            levels: list[str | None] = [*_levels(properties)]
            for level in levels or [None]:
                features.append(Feature(kind, where, shape, properties, level))
                if kind == "wall" and properties.get("category") == "glass":
                    features.append(replace(features[-1], kind="window"))
            POLYGONS.check(len(features), "it", FloorPlanError, prefix="at least ")
    if ignored:
        names = ", ".join(f"{name} ({count})" for name, count in ignored.items())
        notes.append(f"also in the file, without effect on the plan: {names}")
    storeys = _storeys(features, floors)
    return [*features, *_links(features, storeys)], storeys


def in_metres(
    features: Sequence[Feature], content: dict[str, Any], units: Units, notes: list[str]
) -> tuple[list[Feature], Move]:
    """Return the features in metres, and the function that converts coordinates.

    Raises:
        FloorPlanError: The units of the file are unclear.
    """
    if not features:
        return [], lambda xy: xy
    bounds = shapely.total_bounds([feature.shape for feature in features])
    units = _units(content, bounds, units)
    move = _projection(bounds, notes) if units == "degrees" else _shift(bounds, notes)
    moved = []
    for feature in features:
        shape = shapely.transform(feature.shape, move)
        if not shape.is_valid:  # rounding may close a narrow place
            shape = repair(shape)
        if shape.is_empty:
            notes.append(f"{feature.where}, {feature.kind}, has no extent: ignored")
        else:
            moved.append(replace(feature, shape=shape))
    return moved, move


# --- Kinds and floors --------------------------------------------------------------------------


def _kind(
    item: dict[str, Any], properties: dict[str, Any], where: str, is_osm: bool
) -> tuple[str | None, str]:
    """Return a feature's kind, None for an unknown one, and its name for a note."""
    geometry = item.get("geometry")
    form = geometry.get("type") if isinstance(geometry, dict) else None
    kind = properties.get("kind")
    if kind is not None:
        if not isinstance(kind, str) or kind not in GEOMETRIES:
            known = suggest(kind, GEOMETRIES, "Known")
            raise FloorPlanError(f"{where}: unknown kind {shown_value(kind)}{known}")
        return kind, kind
    imdf = item.get("feature_type", properties.get("feature_type"))
    category = str(properties.get("category")).partition(".")[0]
    if isinstance(imdf, str):
        if imdf in ("unit", "fixture") and category in _IMDF_SOLID:
            return "wall", imdf
        if imdf == "unit" and category in _IMDF_NO_FLOOR:
            return None, category
        door = properties.get("door")
        if imdf == "opening" and isinstance(door, dict) and door.get("type") != "open":
            return "door", imdf  # a leaf hangs in it
        return _IMDF_KINDS.get(imdf), imdf
    tagged = _osm_kind(properties, form) if is_osm else None
    if tagged is not None:
        return tagged
    for key in ("type", "category"):
        text = properties.get(key)
        if isinstance(text, str) and room_type(text) in _KIND_WORDS:
            return _KIND_WORDS[room_type(text)], text
    return ("room", "room") if form in SURFACES else (None, f"{form or 'feature'} without a kind")


def _osm_kind(properties: dict[str, Any], form: str | None) -> tuple[str | None, str] | None:
    """Return the kind of a feature with tags of OpenStreetMap, and its name for a note."""
    indoor = properties.get("indoor")
    if form == "Point" and ("door" in properties or "entrance" in properties):
        return ("opening" if properties.get("door") == "no" else "door"), "door"
    if isinstance(indoor, str):
        return _OSM_KINDS.get(indoor), f"indoor={indoor}"
    if properties.get("highway") == "elevator" and form in SURFACES:
        return "room", "elevator"
    outside = next((key for key in _OSM_OUTSIDE if key in properties), None)
    return None if outside is None else (None, outside)


def _levels(properties: dict[str, Any]) -> list[str]:
    """Return the storeys that a feature is on: OpenStreetMap also writes `0;1` and `0-2`.

    >>> _levels({"level": "0;1-3"}), _levels({"level_id": "a-1"}), _levels({"level": [0, 1.5]})
    (['0', '1', '2', '3'], ['a-1'], ['0', '1.5'])
    """
    values = properties.get("level_id", properties.get("level"))
    levels: list[str] = []
    for value in values if isinstance(values, list) else [values]:
        if isinstance(value, str) and "level_id" not in properties:
            for part in value.split(";"):
                limits = _RANGE.fullmatch(part)
                if limits is not None and int(limits[1]) < int(limits[2]):
                    last = min(int(limits[2]), int(limits[1]) + MAX_LEVELS)
                    levels += [str(level) for level in range(int(limits[1]), last + 1)]
                elif part.strip():
                    levels.append(part.strip())
        elif isinstance(value, str | int | float) and not isinstance(value, bool):
            levels.append(f"{value:g}" if isinstance(value, float) else str(value))
    return list(dict.fromkeys(levels))[:MAX_LEVELS]


def _storeys(features: Sequence[Feature], floors: Sequence[dict[str, Any]]) -> list[Storey]:
    """Return the storeys that features are on; without ordinals, levels that are numbers rank."""
    storeys = []
    levels = dict.fromkeys(f.level for f in features if f.level is not None)
    for number, key in enumerate(levels):
        floor = next((floor for floor in floors if str(floor.get("id")) == key), {})
        feature = Feature("level", "", Point(), floor)
        rank = floor.get("ordinal", key)
        try:
            elevation = float(rank)
        except (TypeError, ValueError):
            elevation = float(number)
        words = (floor.get("ordinal"), feature.text("short_name"), feature.text("name"))
        also = (key, *(str(word) for word in words if word is not None))
        elevation = elevation if math.isfinite(elevation) else float(number)
        storeys.append(Storey(key, also[-1], elevation, also))
    return storeys


def _links(features: Sequence[Feature], storeys: Sequence[Storey]) -> Iterator[Feature]:
    """Yield the stairs and lifts: rooms of such a use that lie above one another on two storeys."""
    in_order = sorted(storeys, key=lambda storey: storey.elevation)
    for lower, upper in pairwise(in_order):
        ways: list[list[tuple[Feature, str]]] = []
        for storey in (lower, upper):
            here = [f for f in features if f.kind == "room" and f.level == storey.key]
            ways.append([(f, use) for f in here if (use := _link(f.properties)) is not None])
        for way, use in ways[0]:
            shapes = [other.shape for other, kind in ways[1] if kind == use]
            covered = way.shape.intersection(shapely.union_all(shapes)).area
            if covered >= SAME_SHARE * way.shape.area:
                yield Feature(use, way.where, way.shape, {"upper": upper.key}, lower.key)


def _link(properties: dict[str, Any]) -> str | None:
    """Return `stairs` or `lift` for a room that joins storeys."""
    if properties.get("stairs", "no") != "no":
        return "stairs"
    words = (properties.get(k) for k in ("category", "highway", "room", "type"))
    return next((_LINKS[str(word)] for word in words if str(word) in _LINKS), None)


# --- Geometries --------------------------------------------------------------------------------


def _coordinates(value: object, depth: int, least: int, where: str) -> Any:
    """Return a position, or nested lists of them.

    Args:
        value: The coordinates in the file.
        depth: Levels of lists above positions: 0 for a position itself.
        least: Minimum number of distinct positions of a line or ring.
        where: Their place in the file, for messages.
    """
    if depth == 0:
        return _position(value, where)
    if not isinstance(value, list):
        raise FloorPlanError(f"{where} is {shown_value(value)}: a list is expected")
    items = [_coordinates(v, depth - 1, least, f"{where}[{k}]") for k, v in enumerate(value)]
    if depth == 1 and len(set(items)) < least:
        raise FloorPlanError(
            f"{where} has {len(set(items))} different points: at least {least} are expected"
        )
    if not items:
        raise FloorPlanError(f"{where} is empty: an outline or a line is expected")
    return items


def _position(value: object, where: str) -> tuple[float, float]:
    """Return a position; a third number, its height, is ignored."""
    if not isinstance(value, list) or len(value) < 2:
        raise FloorPlanError(f"{where} is {shown_value(value)}: a list of 2 numbers is expected")
    for number in value[:2]:
        is_number = isinstance(number, int | float) and not isinstance(number, bool)
        if not is_number or not abs(number) <= FARTHEST:
            wrong = shown_value(number)
            raise FloorPlanError(f"{where} is {shown_value(value)}: {wrong} is not a coordinate")
    return clean_coordinate(value[0]), clean_coordinate(value[1])


def _shape(geometry: object, kind: str, where: str, notes: list[str]) -> BaseGeometry:
    where = f"{where}.geometry"
    if not isinstance(geometry, dict):
        raise FloorPlanError(f"{where} is {shown_value(geometry)}: a geometry is expected")
    form = geometry.get("type")
    if form not in GEOMETRIES[kind]:
        known = ", ".join(GEOMETRIES[kind])
        raise FloorPlanError(f"{where} of a {kind} is {shown_value(form)}: {known} is expected")
    where = f"{where}.coordinates"
    least = 3 if form in SURFACES else 2
    coordinates = _coordinates(geometry.get("coordinates"), _DEPTHS[form], least, where)
    shape: BaseGeometry = shapely.geometry.shape({"type": form, "coordinates": coordinates})
    if shape.is_valid or form not in SURFACES:
        return shape
    at = shapely.is_valid_reason(shape).rpartition("[")[2].rstrip("]").replace(" ", ", ")
    notes.append(f"{where} touches or crosses itself at ({at}): everything inside it is used")
    return repair(shape)


# --- Units -------------------------------------------------------------------------------------


def _refuse_mercator(content: dict[str, Any]) -> None:
    """Refuse coordinates of Web Mercator, whose metres are longer than those on the ground."""
    match = _WEB_MERCATOR.search(json.dumps(content.get("crs")))
    if match is not None:
        raise FloorPlanError(
            f"its crs is Web Mercator (EPSG:{match[1]}), in which a home is too large, twice as"
            " wide at a latitude of 60: export it in EPSG:4326 (longitude and latitude), or set"
            " floorplan.units=m if it is in true metres"
        )


def _units(content: dict[str, Any], bounds: F64, units: Units) -> Units:
    """Return the units: of the setting, else those that the file declares, else by its extent."""
    declared = content.get("units", "auto") if units == "auto" else units
    if declared not in ("auto", "m", "degrees"):
        raise FloorPlanError(f"units is {shown_value(declared)}: m, degrees or auto is expected")
    x0, y0, x1, y1 = bounds.tolist()
    on_earth = max(abs(x0), abs(x1)) <= 180 and max(abs(y0), abs(y1)) <= 90
    if declared == "degrees" and not on_earth:
        raise FloorPlanError(f"units is degrees, but no longitude and latitude is ({x1:g}, {y1:g})")
    if declared != "auto":
        return "m" if declared == "m" else "degrees"
    extent = max(x1 - x0, y1 - y0)
    is_swapped = max(abs(x0), abs(x1)) <= 90 < max(abs(y0), abs(y1)) <= 180
    if is_swapped and extent <= LARGEST_DEGREES:
        raise FloorPlanError(
            f"no latitude is {y1:g}: a position is [longitude, latitude] in GeoJSON; swap them"
        )
    if extent >= SMALLEST_M or not on_earth:
        return "m"
    if extent <= LARGEST_DEGREES:
        return "degrees"
    raise FloorPlanError(
        f"it is {extent:.3g} wide, which is small in metres and large in degrees: say which, by"
        ' "units": "m" or "degrees" in the file, or floorplan.units'
    )


def _projection(bounds: F64, notes: list[str]) -> Move:
    """Return the function from longitude and latitude to metres east and north of their centre.

    The plane touches the ellipsoid in the centre: over 1 km the error is below 0.1 m.
    """
    longitude, latitude = (bounds[:2] + bounds[2:]) / 2
    sine, cosine = (f(math.radians(latitude)) for f in (math.sin, math.cos))
    square = 1 - ECCENTRICITY_2 * sine * sine
    to_east = SEMI_MAJOR_M / math.sqrt(square) * cosine
    to_north = SEMI_MAJOR_M * (1 - ECCENTRICITY_2) / (square * math.sqrt(square))
    # Rounded, here and below, so that the last bit of a machine's cosine doesn't matter.
    scale = np.array([round(math.radians(1) * metres, 6) for metres in (to_east, to_north)])
    centre = np.array([longitude, latitude])
    notes.append(
        f"longitude and latitude became metres east and north of {latitude:.6f}, {longitude:.6f}"
    )
    return lambda xy: np.round((xy - centre) * scale, 3)


def _shift(bounds: F64, notes: list[str]) -> Move:
    """Return the function that moves far coordinates, such as UTM's, near the origin."""
    if np.abs(bounds).max() <= MAX_COORDINATE_M / 10:
        return lambda xy: xy
    corner = np.floor(bounds[:2])
    notes.append(
        f"its coordinates count from ({corner[0]:.0f}, {corner[1]:.0f}) here; they are in metres,"
        " unless scale: says another unit, such as 0.3048 for feet"
    )
    return lambda xy: np.round(xy - corner, 6)


class GeoJson(FileSource):
    """A vector plan in GeoJSON: our own dialect, or IMDF.

    Attributes:
        path: The plan's GeoJSON file.
        units: Units of its coordinates; auto determines them from the file.
        wall_m: Thickness of walls drawn as lines, and of those between rooms that touch.
        level: The storey, by id, name or ordinal; left out: all of them, side by side.
    """

    marks = (("type", COLLECTION),)

    path: InputPath
    units: Units = "auto"
    wall_m: Length = Field(default=0.1, ge=0, le=1)
    level: str | None = Field(default=None, coerce_numbers_to_str=True)

    @classmethod
    def document(cls, plan: FloorPlan) -> dict[str, Any]:
        """Return a plan as a FeatureCollection; see `geojson_document`."""
        return geojson_document(plan)

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the plan.

        Free space is the areas of kind `free` or, if there are none, the rooms, without the walls.
        A file with neither free areas nor walls gets walls where rooms touch. Doors lead through
        walls.

        Raises:
            FloorPlanError: The file can't be read, isn't such a plan, or has no free space.
        """
        content = parse_json(files[self.path], self.path)
        with in_file(self.path):
            notes: list[str] = []
            raw, storeys = read_features(content, notes)
            if self.scale is None and self.units == "auto":
                _refuse_mercator(content)
            units = "m" if self.scale and self.units == "auto" else self.units
            measured, move = in_metres(raw, content, units, notes)
            metre = 1 / (self.scale or 1)
            features = arrange(measured, storeys, self.level, notes, metre=metre)
            name = content.get("name")
            return Draft(features, self.wall_m, notes, move=move, scale=self.scale).build(
                name if isinstance(name, str) and name else self.path.stem,
                self.cell,
                f"GeoJSON, {self.path.name}",
            )


# --- Writing ---------------------------------------------------------------------------------


def geojson_document(plan: FloorPlan) -> dict[str, Any]:
    """Return a plan as a GeoJSON FeatureCollection, in metres; `GeoJson` reads it."""
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
    features += [_feature(shapely.transform(pane, to_metres), "window") for pane in plan.glass]
    for portal in plan.portals:
        way = LineString([portal.start, portal.end])
        features.append(_feature(way, "portal", type=portal.type, takes=portal.takes_us / 1e6))
    if plan.entrance is not None:
        features.append(_feature(Point(plan.entrance), "entrance"))
    return {"type": COLLECTION, "name": plan.name, "units": "m", "features": features}


def _feature(shape: BaseGeometry, kind: str, **properties: Any) -> dict[str, Any]:
    if isinstance(shape, MultiPolygon) and len(shape.geoms) == 1:
        shape = shape.geoms[0]
    all_properties = {"kind": kind, **properties}
    return {"type": "Feature", "properties": all_properties, "geometry": mapping(shape)}
