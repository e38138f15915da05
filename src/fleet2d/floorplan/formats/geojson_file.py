"""The content of a GeoJSON floor plan: its features in metres, each of a kind that we know.

Two dialects are read, also mixed: our own, where the property `kind` says what a feature is, and
that of IMDF (Indoor Mapping Data Format), where the member `feature_type` does.
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, MultiLineString, MultiPolygon, Point, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.bounds import POLYGONS
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.rooms.vocabulary import room_type
from fleet2d.floorplan.source import MAX_COORDINATE_M, clean_coordinate, shown_value
from fleet2d.problems import did_you_mean

COLLECTION = "FeatureCollection"

Units = Literal["auto", "m", "degrees"]
Move = Callable[[NDArray[np.float64]], NDArray[np.float64]]

# WGS 84: half the larger axis [m], and the square of the eccentricity.
SEMI_MAJOR_M, ECCENTRICITY_2 = 6378137.0, 0.00669437999014
# A home is at least half a metre wide, and none reaches over a twentieth of a degree (5 km).
SMALLEST_M, LARGEST_DEGREES = 0.5, 0.05
# Beyond this no coordinate is read at all: UTM's northings reach ten million.
FARTHEST = 1e8

_SURFACES, _LINES = ("Polygon", "MultiPolygon"), ("LineString", "MultiLineString")
GEOMETRIES = {
    "room": _SURFACES,
    "free": _SURFACES,
    "no_go": _SURFACES,
    "object": (*_SURFACES, "Point"),
    "door": (*_LINES, *_SURFACES),
    "opening": (*_LINES, *_SURFACES),
    "wall": (*_LINES, *_SURFACES),
    "entrance": ("Point", "LineString"),
}
"""What each kind of feature may be."""

_IMDF_KINDS = {"unit": "room", "opening": "opening", "fixture": "object", "kiosk": "object"}
_IMDF_SOLID = ("brick", "column", "concrete", "drywall", "glass", "structure", "wall")
_IMDF_NO_FLOOR = ("opentobelow", "road", "vegetation")
_KIND_WORDS = {"furniture": "object", "no_go_area": "no_go"} | {kind: kind for kind in GEOMETRIES}


@dataclass(frozen=True)
class Feature:
    """A thing in the file.

    Attributes:
        kind: One of `GEOMETRIES`.
        where: How a message names its place in the file.
        shape: Where it is; in the units of the file until `in_metres`.
        properties: What the file says of it.
        level: The floor that it is on, or None.
    """

    kind: str
    where: str
    shape: BaseGeometry
    properties: dict[str, Any]
    level: str | None = None

    def text(self, *keys: str) -> str | None:
        """Return the first of some properties that is a text, in one line; in any language."""
        for key in keys:
            value = self.properties.get(key)
            if isinstance(value, dict):  # of IMDF: by language
                texts = [v for v in (value.get("en"), *value.values()) if isinstance(v, str)]
                value = texts[0] if texts else None
            if isinstance(value, str) and value.strip():
                return " ".join(value.split())
        return None


def read_features(content: dict[str, Any], level: str | None, notes: list[str]) -> list[Feature]:
    """Return the features that a plan is made of, in the units of the file.

    Args:
        content: The file.
        level: Which floor, where there are several; None for the one of ordinal 0, or the first.
        notes: To which is added what is odd.

    Raises:
        FloorPlanError: It isn't such a file, a feature is damaged, or there is no such floor.
    """
    found = content.get("features")
    if content.get("type") != COLLECTION or not isinstance(found, list):
        raise FloorPlanError(f'no GeoJSON plan: "type": "{COLLECTION}" with features is expected')
    POLYGONS.check(len(found), "it", FloorPlanError)
    features: list[Feature] = []
    floors: list[dict[str, Any]] = []
    unread: Counter[str] = Counter()
    for number, item in enumerate(found):
        where = f"features[{number}]"
        if not isinstance(item, dict):
            raise FloorPlanError(f"{where} is {shown_value(item)}: a Feature is expected")
        properties = item.get("properties") or {}
        if not isinstance(properties, dict):
            raise FloorPlanError(f"{where}.properties is {shown_value(properties)}: no object")
        kind, name = _kind(item, properties, where)
        if name == "level":
            floors.append({**properties, "id": item.get("id")})
        elif kind is None:
            unread[name] += 1
        else:
            shape = _shape(item.get("geometry"), kind, where, notes)
            features.append(Feature(kind, where, shape, properties, _level(properties)))
    if unread:
        names = ", ".join(f"{name} ({count})" for name, count in unread.items())
        notes.append(f"also in the file, without effect on the plan: {names}")
    return _on_one_floor(features, floors, level, notes)


def in_metres(
    features: Sequence[Feature], content: dict[str, Any], units: Units, notes: list[str]
) -> tuple[list[Feature], Move]:
    """Return the features in metres, and what moves a place of the file there.

    Raises:
        FloorPlanError: Nothing tells whether the file has metres or degrees.
    """
    if not features:
        return [], lambda xy: xy
    bounds = shapely.total_bounds([feature.shape for feature in features])
    units = _units(content, bounds, units)
    move = _projection(bounds, notes) if units == "degrees" else _nearer(bounds, notes)
    moved = []
    for feature in features:
        shape = shapely.transform(feature.shape, move)
        if not shape.is_valid:  # rounding may have closed a narrow place
            shape = shapely.make_valid(shape, method="structure", keep_collapsed=False)
        if shape.is_empty:
            notes.append(f"{feature.where}, {feature.kind}, has no extent: ignored")
        else:
            moved.append(replace(feature, shape=shape))
    return moved, move


# --- Kinds and floors --------------------------------------------------------------------------


def _kind(item: dict[str, Any], properties: dict[str, Any], where: str) -> tuple[str | None, str]:
    """Return a feature's kind, or None and what to call it in a note."""
    own = properties.get("kind")
    if own is not None:
        if not isinstance(own, str) or own not in GEOMETRIES:
            known = ", ".join(GEOMETRIES)
            hint = did_you_mean(own, GEOMETRIES)
            raise FloorPlanError(f"{where}: unknown kind {shown_value(own)}{hint} Known: {known}")
        return own, own
    imdf = item.get("feature_type", properties.get("feature_type"))
    category = str(properties.get("category")).partition(".")[0]
    if isinstance(imdf, str):
        if imdf in ("unit", "fixture") and category in _IMDF_SOLID:
            return "wall", imdf
        if imdf == "unit" and category in _IMDF_NO_FLOOR:
            return None, category
        if imdf == "opening" and _hung(properties.get("door")):
            return "door", imdf
        return _IMDF_KINDS.get(imdf), imdf
    for key in ("type", "category"):
        word = properties.get(key)
        if isinstance(word, str) and room_type(word) in _KIND_WORDS:
            return _KIND_WORDS[room_type(word)], word
    geometry = item.get("geometry")
    form = geometry.get("type") if isinstance(geometry, dict) else None
    return ("room", "room") if form in _SURFACES else (None, f"{form or 'feature'} without a kind")


def _hung(door: object) -> bool:
    """Whether IMDF says that a door hangs in an opening."""
    return isinstance(door, dict) and door.get("type") != "open"


def _level(properties: dict[str, Any]) -> str | None:
    for key in ("level_id", "level"):
        value = properties.get(key)
        if isinstance(value, str | int | float):
            return str(value)
    return None


def _on_one_floor(
    features: list[Feature], floors: list[dict[str, Any]], level: str | None, notes: list[str]
) -> list[Feature]:
    """Return the features of one floor, and those of none."""
    present = list(dict.fromkeys(f.level for f in features if f.level is not None))
    called: dict[str, list[str]] = {}
    for name in present:
        floor = next((floor for floor in floors if str(floor.get("id")) == name), {})
        words = Feature("level", "", Point(), floor)
        more = (floor.get("ordinal"), words.text("short_name"), words.text("name"))
        called[name] = [name, *(str(word) for word in more if word is not None)]
    if level is None:
        if len(present) < 2:
            return features
        ground = (name for name in present if "0" in called[name])
        chosen = next(ground, present[0])
    else:
        fitting = [name for name in present if level in called[name]]
        if not fitting:
            known = ", ".join(" or ".join(words) for words in called.values()) or "none"
            raise FloorPlanError(f"there is no level {level!r}; its levels are: {known}")
        chosen = fitting[0]
    others = ", ".join(called[name][-1] for name in present if name != chosen)
    if others:
        notes.append(f"of its levels, {called[chosen][-1]} was taken, and not {others}")
    return [feature for feature in features if feature.level in (None, chosen)]


# --- Geometries --------------------------------------------------------------------------------


def _shape(geometry: object, kind: str, where: str, notes: list[str]) -> BaseGeometry:
    where = f"{where}.geometry"
    if not isinstance(geometry, dict):
        raise FloorPlanError(f"{where} is {shown_value(geometry)}: a geometry is expected")
    form, places = geometry.get("type"), geometry.get("coordinates")
    if form not in GEOMETRIES[kind]:
        known = ", ".join(GEOMETRIES[kind])
        raise FloorPlanError(f"{where} of a {kind} is {shown_value(form)}: {known} is expected")
    where = f"{where}.coordinates"
    if form == "Point":
        return Point(_place(places, where))
    if form == "LineString":
        return _line(places, where)
    if form == "MultiLineString":
        return MultiLineString([_line(p, w) for p, w in _listed(places, where)])
    if form == "Polygon":
        return _sound(_polygon(places, where), where, notes)
    return _sound(MultiPolygon([_polygon(p, w) for p, w in _listed(places, where)]), where, notes)


def _polygon(value: object, where: str) -> Polygon:
    rings = [_ring(ring, place) for ring, place in _listed(value, where)]
    if not rings:
        raise FloorPlanError(f"{where} is empty: a polygon has an outline")
    return Polygon(rings[0], rings[1:])


def _ring(value: object, where: str) -> list[tuple[float, float]]:
    places = [_place(place, at) for place, at in _listed(value, where)]
    if len(set(places)) < 3:
        raise FloorPlanError(
            f"{where} has {len(set(places))} different points: an outline has at least 3"
        )
    return places


def _line(value: object, where: str) -> LineString:
    places = [_place(place, at) for place, at in _listed(value, where)]
    if len(set(places)) < 2:
        raise FloorPlanError(f"{where} has {len(set(places))} different points: a line has 2")
    return LineString(places)


def _place(value: object, where: str) -> tuple[float, float]:
    """Return a position; the height that may follow is not read."""
    if not isinstance(value, list) or len(value) < 2:
        raise FloorPlanError(f"{where} is {shown_value(value)}: a list of 2 numbers is expected")
    for number in value[:2]:
        sensible = isinstance(number, int | float) and not isinstance(number, bool)
        if not sensible or not abs(number) <= FARTHEST:
            found = shown_value(number)
            raise FloorPlanError(f"{where} is {shown_value(value)}: {found} is no coordinate")
    return clean_coordinate(value[0]), clean_coordinate(value[1])


def _listed(value: object, where: str) -> list[tuple[object, str]]:
    if not isinstance(value, list):
        raise FloorPlanError(f"{where} is {shown_value(value)}: a list is expected")
    return [(item, f"{where}[{number}]") for number, item in enumerate(value)]


def _sound(shape: Polygon | MultiPolygon, where: str, notes: list[str]) -> BaseGeometry:
    """Return an area; one that touches or crosses itself is all that it goes round."""
    if shape.is_valid:
        return shape
    at = shapely.is_valid_reason(shape).rpartition("[")[2].rstrip("]").replace(" ", ", ")
    repaired = shapely.make_valid(shape, method="structure", keep_collapsed=False)
    notes.append(f"{where} touches or crosses itself at ({at}): all that it goes round was taken")
    return repaired


# --- Units -------------------------------------------------------------------------------------


def _units(content: dict[str, Any], bounds: NDArray[np.float64], units: Units) -> Units:
    """Tell metres from degrees: by the setting, the file's word, its kind, or its extent."""
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
    if extent >= SMALLEST_M or not on_earth:
        return "m"
    if extent <= LARGEST_DEGREES:
        return "degrees"
    raise FloorPlanError(
        f"it is {extent:.3g} wide, which is small in metres and large in degrees: say which, by"
        ' "units": "m" or "degrees" in the file, or floorplan.units'
    )


def _projection(bounds: NDArray[np.float64], notes: list[str]) -> Move:
    """Return what moves longitude and latitude to metres east and north of their centre.

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


def _nearer(bounds: NDArray[np.float64], notes: list[str]) -> Move:
    """Return what brings far metres, such as UTM's, near the origin."""
    if np.abs(bounds).max() <= MAX_COORDINATE_M / 10:
        return lambda xy: xy
    corner = np.floor(bounds[:2])
    notes.append(f"its coordinates count from ({corner[0]:.0f}, {corner[1]:.0f}) m here")
    return lambda xy: np.round(xy - corner, 6)
