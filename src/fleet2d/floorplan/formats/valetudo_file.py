"""The content of a Valetudo map file (JSON, version 2): its layers of pixels and its entities.

The file numbers pixels from the top and has lengths in centimetres. A place (x, y) [cm] of the file
is (x / 100, -y / 100) [m] here, so that y points up and nothing is mirrored.
"""

import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.formats.fields import MAX_COORDINATE_M, Listed, shown_value, validate
from fleet2d.kernels import F64, I64, Bool

MAP_CLASS = "ValetudoMap"
VERSION = 2

MAX_PIXELS = 2**22
"""A map of 2048 x 2048 pixels: 102 m a side at 5 cm."""

MIN_PIXEL_CM, MAX_PIXEL_CM = 1, 100
MAX_PIXEL_NUMBER = 2**20
CM_PER_M = 100


_LIMIT_CM = MAX_COORDINATE_M * CM_PER_M
_OBJECTS = TypeAdapter(Listed[dict[str, Any]])
_PIXELS = TypeAdapter(
    Listed[Annotated[int, Field(strict=True, ge=-MAX_PIXEL_NUMBER, le=MAX_PIXEL_NUMBER)]]
)
_POINTS = TypeAdapter(Listed[Annotated[float, Field(strict=True, ge=-_LIMIT_CM, le=_LIMIT_CM)]])


@dataclass(frozen=True)
class PixelLayer:
    """Pixels of one kind.

    Attributes:
        kind: `floor`, `segment` or `wall`.
        name: The name that people gave to a segment, or `segment_` and its id.
        is_named: Whether people gave it the name.
        runs: Horizontal runs of pixels: first column, row and length, int64 (n, 3). Rows count
            upwards from the map's upper edge, so they are negative.
    """

    kind: str
    name: str
    is_named: bool
    runs: I64


@dataclass(frozen=True)
class PixelBox:
    """A window of pixels: its lowest column and row, and its numbers of columns and rows."""

    column: int
    row: int
    columns: int
    rows: int

    @classmethod
    def around(cls, runs: I64) -> "PixelBox":
        """Return the smallest box that holds all runs of pixels.

        Raises:
            FloorPlanError: It is too large for a home.
        """
        column, row, end = int(runs[:, 0].min()), int(runs[:, 1].min()), runs[:, 0] + runs[:, 2]
        box = cls(column, row, int(end.max()) - column, int(runs[:, 1].max()) + 1 - row)
        if box.columns * box.rows > MAX_PIXELS:
            raise FloorPlanError(
                f"its pixels spread over {box.columns} x {box.rows}: at most"
                f" {MAX_PIXELS // 2**20} million are read; is a layer damaged?"
            )
        return box

    def window(self, part: "PixelBox") -> tuple[slice, slice]:
        """Return the slices of `part` in an array over this box."""
        row, column = part.row - self.row, part.column - self.column
        return slice(row, row + part.rows), slice(column, column + part.columns)

    def paint(self, runs: I64) -> Bool:
        """Return the pixels that the runs cover, bool (rows, columns), first row at the bottom."""
        steps = np.zeros((self.rows, self.columns + 1), np.int32)
        row, column = runs[:, 1] - self.row, runs[:, 0] - self.column
        np.add.at(steps, (row, column), 1)
        np.add.at(steps, (row, column + runs[:, 2]), -1)
        return np.cumsum(steps, axis=1)[:, :-1] > 0


def check_map(content: dict[str, Any]) -> dict[str, Any]:
    """Return the content, after checking that it is a map of the known version."""
    if content.get("__class") != MAP_CLASS:
        raise FloorPlanError(f'no Valetudo map: "__class" is not "{MAP_CLASS}"')
    version = _meta(content).get("version")
    if version != VERSION:
        raise FloorPlanError(
            f"version {shown_value(version)} of Valetudo's map format is not known: this Fleet2D"
            f" reads {VERSION}; save the map with a Valetudo that writes it"
        )
    return content


def _meta(thing: dict[str, Any]) -> dict[str, Any]:
    meta = thing.get("metaData")
    return meta if isinstance(meta, dict) else {}


def pixel_side(content: dict[str, Any]) -> float:
    """Return the side of the map's pixels [m]."""
    size = content.get("pixelSize")
    if isinstance(size, bool) or not isinstance(size, int | float):
        raise FloorPlanError(
            f"pixelSize is {shown_value(size)}: a number of centimetres is expected"
        )
    if not MIN_PIXEL_CM <= size <= MAX_PIXEL_CM:
        raise FloorPlanError(
            f"pixelSize is {shown_value(size)}: {MIN_PIXEL_CM} to {MAX_PIXEL_CM} cm is expected"
            " (5 is usual)"
        )
    return size / CM_PER_M


def note_size(content: dict[str, Any], box: PixelBox, notes: list[str]) -> None:
    """Add a note if the pixels in `box` reach beyond the size that the map states."""
    size = content.get("size")
    if size is None:
        return
    sides: list[Any] = [size.get("x"), size.get("y")] if isinstance(size, dict) else []
    if not sides or any(type(n) not in (int, float) or not 0 < n < 1e9 for n in sides):
        raise FloorPlanError(f"size is {shown_value(size)}: x and y in centimetres are expected")
    columns, rows = (n / CM_PER_M / pixel_side(content) for n in sides)
    right, bottom = box.column + box.columns, -box.row
    if min(box.column, -(box.row + box.rows)) < 0 or right > columns + 1 or bottom > rows + 1:
        notes.append(
            f"its pixels reach beyond its size of {sides[0]:g} x {sides[1]:g} cm: is a layer"
            " damaged?"
        )


def objects_in(content: dict[str, Any], key: str) -> list[tuple[dict[str, Any], str]]:
    """Return the objects in one of the map's lists, each with its place in the file."""
    items = validate(_OBJECTS, content.get(key, []), key)
    return [(item, f"{key}[{number}]") for number, item in enumerate(items)]


def read_layers(content: dict[str, Any], notes: list[str]) -> list[PixelLayer]:
    """Return the layers with pixels, in the file's order; what is odd is added to the notes."""
    layers: list[PixelLayer] = []
    for layer, where in objects_in(content, "layers"):
        kind = layer.get("type")
        if kind not in ("floor", "segment", "wall"):
            notes.append(f"{where} is of the unknown type {shown_value(kind)}: ignored")
            continue
        runs = _runs(layer, where)
        name, is_named = _segment_name(layer, len(layers))
        subject = f"the segment {name}" if kind == "segment" else f"the layer {where}, {kind},"
        if not len(runs):
            notes.append(f"{subject} has no pixels: ignored")
            continue
        dimensions = layer.get("dimensions")
        stated = dimensions.get("pixelCount") if isinstance(dimensions, dict) else None
        pixels = int(np.count_nonzero(PixelBox.around(runs).paint(runs)))
        if stated is not None and stated != pixels:
            notes.append(
                f"{subject} has {pixels} pixels, though its pixelCount says {shown_value(stated)}"
            )
        layers.append(PixelLayer(kind, name, is_named, runs))
    if all(layer.kind == "wall" for layer in layers):
        raise FloorPlanError("it has no floor: no layer of type floor or segment has any pixel")
    return layers


def _segment_name(layer: dict[str, Any], number: int) -> tuple[str, bool]:
    name = _meta(layer).get("name")
    if isinstance(name, str) and name.strip():
        return unicodedata.normalize("NFC", " ".join(name.split())), True
    return f"segment_{_meta(layer).get('segmentId', number)}", False


def _runs(layer: dict[str, Any], where: str) -> I64:
    """Return the runs of pixels of a layer, int64 (n, 3), with rows that count upwards."""
    packed = _whole_numbers(layer, "compressedPixels", 3, "runs x, y, length", where)
    single = _whole_numbers(layer, "pixels", 2, "pixels x, y", where)
    if (packed[:, 2] < 0).any():
        first = int(np.flatnonzero(packed[:, 2] < 0)[0])
        raise FloorPlanError(
            f"{where}.compressedPixels has a run of negative length: {packed[first].tolist()}"
        )
    runs = np.concatenate([packed, np.insert(single, 2, 1, axis=1)])
    runs[:, 1] = -1 - runs[:, 1]
    return runs[runs[:, 2] > 0]


def _whole_numbers(layer: dict[str, Any], key: str, group: int, meaning: str, where: str) -> I64:
    """Return a flat list of whole numbers in groups, int64 (n, group)."""
    values = validate(_PIXELS, layer.get(key) or [], f"{where}.{key}")
    if len(values) % group:
        raise FloorPlanError(
            f"{where}.{key} has {len(values)} numbers, which is not a multiple of {group}"
            f" ({meaning}): it is cut off"
        )
    return np.array(values, np.int64).reshape(-1, group)


# --- Entities --------------------------------------------------------------------------------


def entities_of(content: dict[str, Any], kind: str) -> Iterator[tuple[dict[str, Any], str]]:
    """Return the entities of a type, each with its place in the file."""
    return ((e, where) for e, where in objects_in(content, "entities") if e.get("type") == kind)


def read_points(entity: dict[str, Any], where: str) -> F64:
    """Return an entity's points, float64 (n, 2) [m]."""
    values = validate(_POINTS, entity.get("points"), f"{where}.points")
    if len(values) % 2:
        raise FloorPlanError(
            f"{where}.points is {shown_value(values)}: a list x, y, x, y, … is expected"
        )
    places = np.array(values, np.float64).reshape(-1, 2) / CM_PER_M
    places[:, 1] *= -1
    return places


def read_charger(content: dict[str, Any]) -> tuple[float, float] | None:
    """Return the place of the first charger (x, y) [m], if the map has one."""
    for entity, where in entities_of(content, "charger_location"):
        for x, y in read_points(entity, where)[:1].tolist():
            return x, y
    return None
