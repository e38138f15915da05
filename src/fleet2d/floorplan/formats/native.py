"""This project's own floor plan format: outlines, rooms, doors and objects, as JSON or YAML.

A plan written by `native_document` and read again at the same cell size is equal to the first::

    {"format": "fleet2d-floorplan", "version": 1, "name": "flat",
     "free": [{"outline": [[0, 0], [5, 0], [5, 3], [0, 3]], "holes": []}],
     "rooms": [{"type": "kitchen", "polygon": [[0, 0], [2, 0], [2, 3], [0, 3]]}],
     "entrance": [4.5, 0.5]}

`native_schema` has all of it.
"""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field
from shapely import MultiPolygon, Polygon

from fleet2d.component import register
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL, Lattice
from fleet2d.floorplan.objects import Blocks, PlacedObject, Posture, UsePlace
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.rooms.doorways import DoorLine
from fleet2d.floorplan.rooms.vocabulary import UNKNOWN, room_type
from fleet2d.floorplan.source import (
    FloorPlanSource,
    read_document,
    read_numbers,
    read_ring,
    shown_value,
)
from fleet2d.paths import InputPath
from fleet2d.problems import did_you_mean

FORMAT = "fleet2d-floorplan"
VERSION = 1

_KEYS = (
    *("format", "version", "name", "free", "rooms"),
    *("doorways", "objects", "no_go", "entrance"),
)
_ROOM_KEYS = ("name", "type", "labels", "polygon", "region")
_PART_KEYS = ("outline", "holes")
_DOORWAY_KEYS = ("name", "start", "end", "leaf")
_OBJECT_KEYS = ("name", "type", "footprint", "blocks", "heading", "uses")
_USE_KEYS = ("x", "y", "heading", "posture", "approach")

T = TypeVar("T")
Shape = TypeVar("Shape", Polygon, MultiPolygon)


@register("floorplan", "native")
class Native(FloorPlanSource):
    """A plan in Fleet2D's own format.

    Attributes:
        path: The plan's JSON or YAML file.
    """

    path: InputPath = Field(description="the plan's JSON or YAML file")

    def load(self) -> FloorPlan:
        """Read the plan."""
        return read_native(self.path, self.cell)


def read_native(path: Path, cell: float = 0.05) -> FloorPlan:
    """Read a floor plan in Fleet2D's own format.

    Args:
        path: The file: YAML if its name ends in .yaml or .yml, else JSON.
        cell: Side of a grid cell [m].

    Raises:
        FloorPlanError: It can't be read, isn't in this format, or has no free space.
    """
    return native_plan(read_document(path), path, cell)


def native_plan(content: dict[str, Any], path: Path, cell: float = 0.05) -> FloorPlan:
    """Return the floor plan of a file's content.

    Raises:
        FloorPlanError: It isn't in this format, or has no free space.
    """
    try:
        return _plan(content, path, cell)
    except FloorPlanError as error:
        raise FloorPlanError(f"{path}: {error}") from error


def native_document(plan: FloorPlan) -> dict[str, Any]:
    """Return a plan as the mapping that `read_native` reads, of what JSON knows."""
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
                    for polygon in cell_polygons(plan.room_of_cell == room.index)
                ],
            }
            for room in plan.rooms
        ],
    }
    document["doorways"] = [
        {"name": d.name, "start": list(d.start), "end": list(d.end), "leaf": d.leaf}
        for d in plan.doorways
    ]
    if plan.objects:
        document["objects"] = [written_object(thing) for thing in plan.objects]
    if plan.no_go:
        document["no_go"] = [_written_shape(area) for area in plan.no_go]
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
            f"version {shown_value(found)} of the format is not known: this Fleet2D reads {VERSION}"
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
        doorways=_listed(content["doorways"], "doorways", _doorway)
        if "doorways" in content
        else None,
        regions_are="exact" if "rooms" in content else "none",
        objects=_listed(content.get("objects", []), "objects", _object),
        no_go=_listed(content.get("no_go", []), "no_go", _shape),
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
        shape = _shape(room["polygon"], f"{where}.polygon")
    return LabelledRegion(tuple(labels), shape, name, room_type(kind))


def _doorway(value: object, where: str) -> DoorLine:
    door = _checked(value, _DOORWAY_KEYS, where, required=("start", "end"))
    start, end = (_point(door[key], f"{where}.{key}") for key in ("start", "end"))
    leaf = door.get("leaf", True)
    if not isinstance(leaf, bool):
        raise FloorPlanError(f"{where}.leaf is {shown_value(leaf)}: true or false is expected")
    return DoorLine(start, end, _name(door, where) or None, leaf)


def _object(value: object, where: str) -> PlacedObject:
    thing = _checked(value, _OBJECT_KEYS, where, required=("type", "footprint"))
    kind = thing["type"]
    if not isinstance(kind, str) or not kind:
        raise FloorPlanError(f"{where}.type is {shown_value(kind)}: a text is expected")
    return PlacedObject(
        name=_name(thing, where),
        type=kind,
        footprint=_shape(thing["footprint"], f"{where}.footprint"),
        blocks=read_blocks(thing.get("blocks", "path"), f"{where}.blocks"),
        uses=tuple(read_uses(thing.get("uses", []), f"{where}.uses")),
        heading=read_numbers([thing.get("heading", 0.0)], 1, f"{where}.heading")[0],
    )


def read_blocks(value: object, where: str) -> Blocks:
    """Return what can't pass an object.

    Raises:
        FloorPlanError: The value is none of the words for that.
    """
    blocks: Blocks = _one_of(value, get_args(Blocks), where)
    return blocks


def read_uses(value: object, where: str) -> list[UsePlace]:
    """Return the places to use an object from.

    Raises:
        FloorPlanError: The value is no list of such places.
    """
    return _listed(value, where, _use)


def _use(value: object, where: str) -> UsePlace:
    use = _checked(value, _USE_KEYS, where, required=("x", "y", "heading"))
    x, y, heading = read_numbers([use[key] for key in ("x", "y", "heading")], 3, where)
    posture = _one_of(use.get("posture", "stand"), get_args(Posture), f"{where}.posture")
    approach = use.get("approach")
    if approach is not None:
        approach = _point(approach, f"{where}.approach")
    return UsePlace(x, y, heading, posture, approach)


def _name(thing: dict[str, Any], where: str) -> str:
    """Return the name, empty where there is none."""
    name = thing.get("name", "")
    if not isinstance(name, str) or ("name" in thing and not name):
        raise FloorPlanError(f"{where}.name is {shown_value(name)}: a text is expected")
    return name


def _one_of(value: object, choices: tuple[Any, ...], where: str) -> Any:
    if value not in choices:
        known = ", ".join(choices)
        raise FloorPlanError(f"{where} is {shown_value(value)}: one of {known} is expected")
    return value


def _shape(value: object, where: str) -> Polygon:
    """Return a polygon that is written as its corners, or as an outline with holes."""
    if isinstance(value, dict):
        return _part(value, where)
    return _valid(Polygon(read_ring(value, where)), where)


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


def written_object(thing: PlacedObject) -> dict[str, Any]:
    """Return an object as the format has it."""
    written: dict[str, Any] = {
        "name": thing.name,
        "type": thing.type,
        "footprint": _written_shape(thing.footprint),
        "blocks": thing.blocks,
    }
    if thing.heading:
        written["heading"] = thing.heading
    if thing.uses:
        written["uses"] = [_written_use(use) for use in thing.uses]
    return written


def _written_use(use: UsePlace) -> dict[str, Any]:
    written = {"x": use.x, "y": use.y, "heading": use.heading, "posture": use.posture}
    return written if use.approach is None else {**written, "approach": list(use.approach)}


def _written_shape(polygon: Polygon) -> Any:
    outline, *holes = (
        shapely.get_coordinates(ring)[:-1].tolist()
        for ring in (polygon.exterior, *polygon.interiors)
    )
    return {"outline": outline, "holes": holes} if holes else outline


def _written_part(lattice: Lattice, polygon: Polygon) -> dict[str, Any]:
    def written(ring: shapely.LinearRing) -> Any:
        return lattice.to_metres(shapely.get_coordinates(ring)[:-1]).tolist()

    part = {"outline": written(polygon.exterior)}
    if polygon.interiors:
        part["holes"] = [written(hole) for hole in polygon.interiors]
    return part


def cell_polygons(mask: NDArray[np.bool_]) -> list[Polygon]:
    """Return the area of cells as polygons [lattice]: the union of their runs along the rows."""
    edges = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, first = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)
    corners = np.stack([first, row, end, row + 1]).astype(np.float64) * UNITS_PER_CELL
    polygons: list[Polygon] = shapely.get_parts(shapely.union_all(shapely.box(*corners))).tolist()
    return polygons
