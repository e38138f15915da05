"""This project's own floor plan format: outlines with holes, and rooms, in metres, as JSON.

A plan written by `FloorPlan.to_native` and read again at the same cell size is equal to the first::

    {"format": "fleet2d-floorplan", "version": 1, "name": "flat",
     "free": [{"outline": [[0, 0], [5, 0], [5, 3], [0, 3]], "holes": []}],
     "rooms": [{"type": "kitchen", "polygon": [[0, 0], [2, 0], [2, 3], [0, 3]]}],
     "entrance": [4.5, 0.5]}
"""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field
from shapely import MultiPolygon, Polygon

from fleet2d.component import register
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.source import FloorPlanSource, read_json, read_numbers, read_ring
from fleet2d.floorplan.vocabulary import UNKNOWN, room_type
from fleet2d.paths import InputPath
from fleet2d.problems import did_you_mean

FORMAT = "fleet2d-floorplan"
VERSION = 1

_KEYS = ("format", "version", "name", "free", "rooms", "entrance")
_ROOM_KEYS = ("name", "type", "labels", "polygon", "region")
_PART_KEYS = ("outline", "holes")

T = TypeVar("T")
Shape = TypeVar("Shape", Polygon, MultiPolygon)


@register("floorplan", "native")
class Native(FloorPlanSource):
    """A plan in Fleet2D's own format.

    Attributes:
        path: The plan's JSON file.
    """

    path: InputPath = Field(description="the plan's JSON file")

    def load(self) -> FloorPlan:
        """Read the plan."""
        return read_native(self.path, self.cell)


def read_native(path: Path, cell: float = 0.05) -> FloorPlan:
    """Read a floor plan in Fleet2D's own format.

    Args:
        path: The JSON file.
        cell: Side of a grid cell [m].

    Raises:
        FloorPlanError: It can't be read, isn't in this format, or has no free space.
    """
    content = read_json(path)
    try:
        return _plan(content, path, cell)
    except FloorPlanError as error:
        raise FloorPlanError(f"{path}: {error}") from error


def native_document(plan: FloorPlan) -> dict[str, Any]:
    """Return a plan as the JSON object that `read_native` reads."""
    lattice = plan.lattice
    document: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "name": plan.name,
        "free": [_written_part(lattice, polygon) for polygon in plan.polygons],
        "rooms": [
            {
                "name": room.name,
                "type": room.type,
                "labels": list(room.labels),
                "region": [
                    _written_part(lattice, polygon)
                    for polygon in _cell_polygons(plan.room_of_cell == room.index)
                ],
            }
            for room in plan.rooms
        ],
    }
    if plan.entrance is not None:
        document["entrance"] = list(plan.entrance)
    return document


# --- Reading -----------------------------------------------------------------------------------


def _plan(content: dict[str, Any], path: Path, cell: float) -> FloorPlan:
    if content.get("format") != FORMAT:
        hint = " (it looks like HouseExpo: use type houseexpo)" if "verts" in content else ""
        raise FloorPlanError(f'no Fleet2D floor plan: "format" is not "{FORMAT}"{hint}')
    if content.get("version") != VERSION:
        found = content.get("version")
        raise FloorPlanError(
            f"version {found!r} of the format is not known: this Fleet2D reads {VERSION}"
        )
    _check_keys(content, _KEYS, required=("free",), where="the plan")
    name = content.get("name", path.stem)
    if not isinstance(name, str) or not name:
        raise FloorPlanError("name is not a text")
    entrance = content.get("entrance")
    return FloorPlan.build(
        name,
        _space(content["free"], "free"),
        _listed(content.get("rooms", []), "rooms", _room),
        cell,
        source=f"Fleet2D floor plan, {path.name}",
        entrance=None if entrance is None else _point(entrance, "entrance"),
    )


def _room(value: object, where: str) -> LabelledRegion:
    room = _checked(value, _ROOM_KEYS, where, required=("type",))
    name, kind, labels = room.get("name"), room["type"], room.get("labels")
    if not isinstance(kind, str) or not (name is None or (isinstance(name, str) and name)):
        raise FloorPlanError(f"{where}: name and type must be texts")
    if labels is None:
        labels = [kind] if room_type(kind) != UNKNOWN else []
    if not isinstance(labels, list) or not all(isinstance(label, str) for label in labels):
        raise FloorPlanError(f"{where}.labels is not a list of room types")
    if ("polygon" in room) == ("region" in room):
        raise FloorPlanError(
            f"{where} needs either polygon (its corners) or region (outlines with holes)"
        )
    if "region" in room:
        shape = _space(room["region"], f"{where}.region")
    else:
        shape = _valid(Polygon(read_ring(room["polygon"], f"{where}.polygon")), f"{where}.polygon")
    return LabelledRegion(tuple(labels), shape, name, room_type(kind))


def _space(value: object, where: str) -> Polygon | MultiPolygon:
    parts = _listed(value, where, _part)
    if len(parts) == 1:
        return parts[0]
    return _valid(MultiPolygon(parts), where)


def _part(value: object, where: str) -> Polygon:
    part = _checked(value, _PART_KEYS, where, required=("outline",))
    outline = read_ring(part["outline"], f"{where}.outline")
    holes = _listed(part.get("holes", []), f"{where}.holes", read_ring)
    return _valid(Polygon(outline, holes), where)


def _valid(shape: Shape, where: str) -> Shape:
    """Return the shape; unlike a traced outline, one in our own format must be sound."""
    if not shape.is_valid:
        reason, _, at = shapely.is_valid_reason(shape).partition("[")
        place = f" at ({at.rstrip(']').replace(' ', ', ')}) m" if at else ""
        raise FloorPlanError(f"{where} is no sound outline: {reason.lower()}{place}")
    return shape


def _point(value: object, where: str) -> tuple[float, float]:
    x, y = read_numbers(value, 2, where)
    return x, y


def _listed(value: object, where: str, read: Callable[[object, str], T]) -> list[T]:
    if not isinstance(value, list):
        raise FloorPlanError(f"{where} is not a list")
    return [read(item, f"{where}[{number}]") for number, item in enumerate(value)]


def _checked(
    value: object, known: Collection[str], where: str, required: Collection[str]
) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise FloorPlanError(f"{where} is not an object with the keys {', '.join(known)}")
    _check_keys(value, known, required, where)
    return value


def _check_keys(
    value: Mapping[str, Any], known: Collection[str], required: Collection[str], where: str
) -> None:
    for key in value:
        if key not in known:
            hint = did_you_mean(key, known)
            raise FloorPlanError(
                f"{where} has an unknown key {key!r}{hint} Known: {', '.join(known)}"
            )
    for key in required:
        if key not in value:
            raise FloorPlanError(f"{where} has no key {key!r}")


# --- Writing -----------------------------------------------------------------------------------


def _written_part(lattice: Lattice, polygon: Polygon) -> dict[str, Any]:
    def written(ring: shapely.LinearRing) -> Any:
        return lattice.to_metres(shapely.get_coordinates(ring)[:-1]).tolist()

    part = {"outline": written(polygon.exterior)}
    if polygon.interiors:
        part["holes"] = [written(hole) for hole in polygon.interiors]
    return part


def _cell_polygons(mask: NDArray[np.bool_]) -> list[Polygon]:
    """Return the area of cells as polygons [lattice]: the union of their runs along the rows."""
    edges = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, first = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)
    corners = np.stack([first, row, end, row + 1]).astype(np.float64) * UNITS_PER_CELL
    polygons: list[Polygon] = shapely.get_parts(shapely.union_all(shapely.box(*corners))).tolist()
    return polygons
