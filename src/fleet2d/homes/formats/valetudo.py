"""Maps of robot vacuums with Valetudo (JSON, format versions 1 and 2) or rand256's firmware.

The file numbers pixels from the top and has lengths in centimetres. A place (x, y) [cm] of the file
is (x / 100, -y / 100) [m] here, so that y points up and nothing is mirrored.
"""

import math
import unicodedata
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import shapely
import shapely.affinity
from pydantic import Field, TypeAdapter
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.configuration.units import InputPath, Length
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.files import (
    MAX_COORDINATE_M,
    Listed,
    in_file,
    parse_json,
    read_json,
    shown_value,
    validate,
)
from fleet2d.floorplan.mesh import repair
from fleet2d.floorplan.placed_objects import PlacedObject, UsePlace, distinct_names
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.rooms.room import UNKNOWN, usual_type
from fleet2d.homes.formats.cleaning import OccupancyMap, bridge_gaps, drop_rays, drop_scraps
from fleet2d.homes.formats.enclosure import parts_of
from fleet2d.homes.formats.occupancy import outline
from fleet2d.homes.formats.pixels import PixelSource
from fleet2d.homes.formats.rand256 import (
    MAP_CLASS,
    MAX_PIXEL_NUMBER,
    WRAPPERS,
    as_valetudo,
    raw_map,
)
from fleet2d.kernels import F64, I64, Bool, label_parts, spread_labels, squared_distance

VERSIONS = (1, 2)

MAX_PIXELS = 2**22
"""A map of 2048 x 2048 pixels: 102 m a side at 5 cm."""

MIN_PIXEL_CM = 1
MAX_PIXEL_CM = 100
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
        column = int(runs[:, 0].min())
        row = int(runs[:, 1].min())
        end = runs[:, 0] + runs[:, 2]
        box = cls(column, row, int(end.max()) - column, int(runs[:, 1].max()) + 1 - row)
        if box.columns * box.rows > MAX_PIXELS:
            raise FloorPlanError(
                f"its pixels spread over {box.columns} x {box.rows}: at most"
                f" {MAX_PIXELS // 2**20} million are read; is a layer damaged?"
            )
        return box

    def window(self, part: "PixelBox") -> tuple[slice, slice]:
        """Return the slices of `part` in an array over this box."""
        row = part.row - self.row
        column = part.column - self.column
        return slice(row, row + part.rows), slice(column, column + part.columns)

    def paint(self, runs: I64) -> Bool:
        """Return the pixels that the runs cover, bool (rows, columns), first row at the bottom."""
        steps = np.zeros((self.rows, self.columns + 1), np.int32)
        row = runs[:, 1] - self.row
        column = runs[:, 0] - self.column
        np.add.at(steps, (row, column), 1)
        np.add.at(steps, (row, column + runs[:, 2]), -1)
        return np.cumsum(steps, axis=1)[:, :-1] > 0


def check_map(content: dict[str, Any]) -> dict[str, Any]:
    """Return the content as a map of Valetudo, after checking its version."""
    raw = raw_map(content)
    if raw is not None:
        return as_valetudo(raw)
    if content.get("__class") != MAP_CLASS:
        raise FloorPlanError(f'not a Valetudo map: "__class" is not "{MAP_CLASS}"')
    version = _meta(content).get("version")
    if version not in VERSIONS:
        raise FloorPlanError(
            f"version {shown_value(version)} of Valetudo's map format is not known: this Fleet2D"
            f" reads {VERSIONS[0]} and {VERSIONS[1]}; save the map with a Valetudo that writes one"
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
    right = box.column + box.columns
    bottom = -box.row
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
    """Return the layers with pixels, in the file's order; anomalies are added to the notes."""
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


NoGo = Literal["keep_out", "wall", "ignore"]

# Side of a charger, radius of a person in front of it, and how far off that person may be [m].
CHARGER_M = 0.2
STAND_RADIUS_M = 0.2
STAND_REACH_M = 1.0

MAX_PARTS = 10_000

# An overlap of at most this is only a common side [pixels].
TINY = 1e-6


class Valetudo(PixelSource, FileSource):
    """A map of a robot vacuum that runs Valetudo.

    Attributes:
        path: The map's JSON file.
        no_go: Meaning of no-go areas and virtual walls: areas that robots keep out of
            (`keep_out`), walls (`wall`), or nothing (`ignore`).
        bridge_pixels: Width of the widest gap between two parts of the home that opens, as at a
            threshold or where the vacuum drove; 0 opens none.
        ray_width: Floor that at most passages narrower than this join is left out if its border is
            mostly no wall, and neither a segment nor the path is there: it was seen through a
            window [m]; 0 keeps it.
        scrap_area_m2: Floor smaller than this is no room: alone it is left out, beside a segment it
            belongs to that; 0 keeps it.
        borders: Doorways: also where segments meet at a narrow place (`segments`), or only between
            walls (`exact`).
    """

    marks = (
        ("__class", MAP_CLASS),
        *((key, None) for key in WRAPPERS),
        ("image.pixels.floor", None),
        ("image.pixels.walls", None),
    )

    path: InputPath
    no_go: NoGo = "keep_out"
    bridge_pixels: int = Field(default=2, ge=0, le=10)
    ray_width: Length = Field(default=0.3, ge=0)
    scrap_area_m2: float = Field(default=1.0, ge=0)
    borders: Literal["segments", "exact"] = "segments"

    @classmethod
    def usual_cell(cls, settings: Mapping[str, Any]) -> float:
        """Return the side of the map's pixels."""
        return pixel_side(check_map(read_json(settings["path"]))) * settings["scale"]

    def driven_ways(self) -> list[F64]:
        """Return the path that the vacuum drove, in pieces; see `read_valetudo_paths`."""
        return read_valetudo_paths(self.path)

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the map.

        Free space is the pixels of floors and segments without those of walls, gaps at thresholds
        included, rays and scraps left out. Every segment is a room under the name that it has in
        the vacuum's app.

        Raises:
            FloorPlanError: The file can't be read, isn't such a map, or has no floor.
        """
        content = parse_json(files[self.path], self.path)
        with in_file(self.path):
            content = check_map(content)
            pixel_m = pixel_side(content)
            notes: list[str] = []
            layers = read_layers(content, notes)
            box = PixelBox.around(np.concatenate([layer.runs for layer in layers]))
            note_size(content, box, notes)
            free, wall = _free_pixels(layers, box, notes)
            if free.any():
                corner = (box.column * pixel_m, box.row * pixel_m)
                raw = OccupancyMap(free, wall, pixel_m, corner)
                free = self._clean(raw, _driven(content, box), _in_segments(layers, box), notes)
            areas = _no_go_areas(content, free, box, self.no_go, notes)
            if not free.any():
                raise FloorPlanError("no floor is left: all of it is wall or in no-go areas")
            _note_entities(content, notes)
            regions = _regions(layers, free, box, (pixel_m, self.scrap_area_m2), notes)
            return FloorPlan.build(
                name=self.path.stem,
                free=_in_metres(free, box, pixel_m),
                regions=tuple(regions),
                cell=pixel_m * (self.scale or 1.0) if self.cell is None else self.cell,
                source=f"Valetudo map, {self.path.name}",
                doorways=None,
                regions_are=self.borders if regions else "vacuum",
                objects=tuple(_charger(content, free, box)),
                no_go=tuple(areas),
                scale=self.scale,
                notes=tuple(notes),
            )

    def _clean(self, raw: OccupancyMap, driven: Bool, rooms: Bool, notes: list[str]) -> Bool:
        """Return the free pixels with gaps open, and without rays and scraps."""
        gaps, gap_note = bridge_gaps(raw, self.bridge_pixels, driven)
        raw = replace(raw, free=raw.free | gaps)
        rays, ray_note = drop_rays(raw, self.ray_width, driven | rooms)
        raw = replace(raw, free=raw.free & ~rays)
        scraps, scrap_note = drop_scraps(raw, self.scrap_area_m2)
        notes += [note for note in (gap_note, ray_note, scrap_note) if note]
        return raw.free & ~scraps


def read_valetudo_paths(path: Path) -> list[F64]:
    """Read the path that the vacuum drove, in pieces.

    Returns:
        The pieces in the file's order, each float64 (n, 2) [m] in the plan's frame, as recorded:
        times are unknown, and points may repeat. An empty list if the map has no path.

    Raises:
        FloorPlanError: The file can't be read, or isn't such a map.
    """
    content = read_json(path)
    with in_file(path):
        pieces = [
            read_points(entity, where) for entity, where in entities_of(check_map(content), "path")
        ]
    return [piece for piece in pieces if len(piece)]


def read_valetudo_path(path: Path) -> F64:
    """Read the path that the vacuum drove, float64 (n, 2) [m], with all pieces joined.

    Raises:
        FloorPlanError: The file can't be read, or isn't such a map.
    """
    return np.concatenate([np.empty((0, 2)), *read_valetudo_paths(path)])


def read_valetudo_charger(path: Path) -> tuple[float, float] | None:
    """Read the place of the vacuum's charger (x, y) [m] in the plan's frame, if the map has it.

    Raises:
        FloorPlanError: The file can't be read, or isn't such a map.
    """
    content = read_json(path)
    with in_file(path):
        return read_charger(check_map(content))


# --- Free space and rooms ----------------------------------------------------------------------


def _free_pixels(layers: list[PixelLayer], box: PixelBox, notes: list[str]) -> tuple[Bool, Bool]:
    """Return the pixels that are floor and not wall, and those of walls, bool (rows, columns)."""
    segments_at = np.zeros((box.rows, box.columns), np.uint16)
    floor, wall = (np.zeros(segments_at.shape, np.bool_) for _ in range(2))
    for layer in layers:
        part = PixelBox.around(layer.runs)
        window = box.window(part)
        if layer.kind == "wall":
            wall[window] |= part.paint(layer.runs)
        else:
            floor[window] |= part.paint(layer.runs)
        if layer.kind == "segment":
            segments_at[window] += part.paint(layer.runs)
    for both, reason in (
        (floor & wall, "floor and wall: they count as wall"),
        (segments_at > 1, "in several segments: they belong to the smallest of those"),
    ):
        if both.any():
            notes.append(f"{np.count_nonzero(both)} pixels are {reason}")
    return floor & ~wall, wall


def _in_segments(layers: list[PixelLayer], box: PixelBox) -> Bool:
    """Return the pixels of all segments, bool (rows, columns)."""
    inside = np.zeros((box.rows, box.columns), np.bool_)
    for layer in layers:
        if layer.kind == "segment":
            part = PixelBox.around(layer.runs)
            inside[box.window(part)] |= part.paint(layer.runs)
    return inside


def _driven(content: dict[str, Any], box: PixelBox) -> Bool:
    """Return the pixels that the vacuum drove across, bool (rows, columns)."""
    driven = np.zeros((box.rows, box.columns), np.bool_)
    for entity, where in entities_of(content, "path"):
        corners = read_points(entity, where) / pixel_side(content) - (box.column, box.row)
        for (x0, y0), (x1, y1) in pairwise(corners.tolist()):
            steps = int(2 * max(abs(x1 - x0), abs(y1 - y0))) + 2
            rows, columns = np.linspace((y0, x0), (y1, x1), min(steps, MAX_PIXELS)).astype(int).T
            inside = (rows >= 0) & (rows < box.rows) & (columns >= 0) & (columns < box.columns)
            driven[rows[inside], columns[inside]] = True
    return driven


def _in_metres(mask: Bool, box: PixelBox, pixel_m: float) -> MultiPolygon:
    """Return the exact outlines of pixels [m]."""
    part = label_parts(mask, False)
    if part.max(initial=-1) >= MAX_PARTS:
        raise FloorPlanError(
            f"its pixels are in {part.max() + 1} separate groups, more than {MAX_PARTS}: that is"
            " noise, not a home"
        )
    rows, columns = np.nonzero(mask)
    parts = part[rows, columns]
    low = np.full((int(part.max(initial=-1)) + 1, 2), np.iinfo(np.int64).max)
    high = np.zeros_like(low)
    for axis, values in enumerate((rows, columns)):
        np.minimum.at(low[:, axis], parts, values)
        np.maximum.at(high[:, axis], parts, values + 1)
    polygons = []
    for index, ((row, column), (row1, column1)) in enumerate(zip(low, high, strict=True)):
        polygon = outline(part[row:row1, column:column1] == index)
        polygons.append(shapely.affinity.translate(polygon, box.column + column, box.row + row))
    return shapely.transform(MultiPolygon(polygons), lambda xy: xy * pixel_m)


def _regions(
    layers: list[PixelLayer],
    free: Bool,
    box: PixelBox,
    limits: tuple[float, float],
    notes: list[str],
) -> list[LabelledRegion]:
    """Return the segments in the file's order, each under a name of its own.

    Floor without a segment that is no room belongs to the segment beside it. So does a segment
    without a name that is no room.

    Args:
        layers: The layers of the map.
        free: The floor, bool (rows, columns).
        box: The window of these pixels.
        limits: Side of a pixel [m], and the area from which on floor is a room [m²].
        notes: Notes are added.
    """
    pixel_m, scrap_m2 = limits
    segments = [layer for layer in layers if layer.kind == "segment"]
    if not segments:
        return []
    names = distinct_names([segment.name for segment in segments], "segments", notes)
    masks = []
    for layer in segments:
        window = PixelBox.around(layer.runs)
        mask = np.zeros(free.shape, np.bool_)
        mask[box.window(window)] = window.paint(layer.runs)
        masks.append(mask)
    labels = np.full(free.shape, -1, np.int32)
    for index in sorted(range(len(masks)), key=lambda k: -np.count_nonzero(masks[k])):
        labels[masks[index] & free] = index
    sizes = np.bincount(labels[labels >= 0], minlength=len(segments)) * pixel_m**2
    is_scrap = (sizes < scrap_m2) & [not segment.is_named for segment in segments]
    if not is_scrap.all():
        labels[np.append(is_scrap, False)[labels]] = -1
    else:
        is_scrap[:] = False
    part = label_parts(free & (labels < 0), False)
    areas = np.bincount(part[part >= 0], minlength=1) * pixel_m**2
    small = (part >= 0) & np.append(areas < scrap_m2, False)[part]
    spread = spread_labels(labels, small | (labels >= 0)) if (labels >= 0).any() else labels
    added = np.where(small, spread, -1)
    if (added >= 0).any():
        area = np.count_nonzero(added >= 0) * pixel_m**2
        notes.append(
            f"floor of {area:.2f} m2 in pieces under {scrap_m2:g} m2 belongs to the segments beside"
            " it; scrap_area_m2: 0 makes it rooms"
        )
    regions: list[LabelledRegion] = []
    for index, (layer, name) in enumerate(zip(segments, names, strict=True)):
        if is_scrap[index]:
            continue
        window = PixelBox.around(layer.runs)
        shape: BaseGeometry = _in_metres(window.paint(layer.runs), window, pixel_m)
        if (added == index).any():
            shape = shapely.union(shape, _in_metres(added == index, box, pixel_m))
        kind = usual_type(layer.name) if layer.is_named else UNKNOWN
        regions.append(LabelledRegion((layer.name,), MultiPolygon(parts_of(shape)), name, kind))
    return regions


# --- No-go areas and the charger ----------------------------------------------------------------


def _no_go_areas(
    content: dict[str, Any], free: Bool, box: PixelBox, no_go: NoGo, notes: list[str]
) -> list[Polygon]:
    """Return the areas that robots keep out of [m]; no-go areas as walls change `free` instead."""
    pixel_m = pixel_side(content)
    areas: list[Polygon] = []
    for kind, noun in (("no_go_area", "no-go areas"), ("virtual_wall", "virtual walls")):
        shapes = []
        for entity, where in entities_of(content, kind):
            shape = _no_go_shape(read_points(entity, where) / pixel_m, kind)
            if shape.is_empty:
                notes.append(f"{where}, {kind}, has no extent: ignored")
            else:
                shapes.append(shape)
        if not shapes:
            continue
        effect = {"keep_out": "robots keep out of them", "ignore": "ignored"}.get(no_go)
        if no_go == "keep_out":
            areas += [part for shape in shapes for part in _parts_in_metres(shape, pixel_m)]
        if no_go == "wall":
            before = np.count_nonzero(free)
            for shape in shapes:
                _remove_pixels(shape, free, box)
            area = (before - np.count_nonzero(free)) * pixel_m**2
            effect = f"obstacles on {area:.2f} m2 of floor"
        notes.append(f"{noun} in the map: {len(shapes)}, {effect}")
    return areas


def _no_go_shape(corners: F64, kind: str) -> BaseGeometry:
    """Return the shape of a no-go area, or a band a pixel wide along a virtual wall [pixels]."""
    if kind == "virtual_wall":
        if len(corners) < 2:
            return Polygon()
        return LineString(corners).buffer(0.5, cap_style="flat", join_style="mitre")
    if len(corners) < 3:
        return Polygon()
    return repair(Polygon(corners))


def _parts_in_metres(shape: BaseGeometry, pixel_m: float) -> list[Polygon]:
    # Rounded, so that the last bits of a machine's arithmetic don't matter.
    metres = shapely.transform(shape, lambda xy: np.round(xy * pixel_m, 6))
    return parts_of(metres)


def _remove_pixels(shape: BaseGeometry, free: Bool, box: PixelBox) -> None:
    """Remove from the free pixels those that a shape [pixels] overlaps."""
    shape = shape.buffer(-TINY, join_style="mitre")
    x0, y0, x1, y1 = shape.bounds
    first, last = (int(np.clip(y - box.row, 0, box.rows - 1)) for y in (y0, y1))
    left, right = (int(np.clip(x - box.column, 0, box.columns - 1)) for x in (x0, x1))
    shapely.prepare(shape)
    for row in range(first, last + 1):  # by rows, to save memory
        columns = left + np.flatnonzero(free[row, left : right + 1])
        x = columns + float(box.column)
        y = np.full(len(columns), float(box.row + row))
        pixels = shapely.box(*np.stack([x, y, x + 1, y + 1]))
        free[row, columns] = ~shapely.intersects(shape, pixels)


def _charger(content: dict[str, Any], free: Bool, box: PixelBox) -> list[PlacedObject]:
    """Return the vacuum's charger, with a place to stand in front of it."""
    at = read_charger(content)
    if at is None:
        return []
    x, y = at
    pixel_m = pixel_side(content)
    half = CHARGER_M / 2
    roomy = squared_distance(np.pad(free, 1))[1:-1, 1:-1] >= (STAND_RADIUS_M / pixel_m) ** 2
    rows, columns = np.nonzero(roomy)
    stand_x, stand_y = ((n + 0.5) * pixel_m for n in (columns + box.column, rows + box.row))
    away = (stand_x - x) ** 2 + (stand_y - y) ** 2
    nearest = int(np.argmin(away)) if len(away) else None
    front = 0.0
    uses = tuple[UsePlace, ...]()
    if nearest is not None and away[nearest] <= STAND_REACH_M**2:
        to_x = round(float(stand_x[nearest]), 6)
        to_y = round(float(stand_y[nearest]), 6)
        # Rounded, so that the last bit of a machine's arctangent doesn't matter.
        front = round(math.atan2(to_y - y, to_x - x), 6)
        uses = (UsePlace(to_x, to_y, round(math.atan2(y - to_y, x - to_x), 6)),)
    footprint = shapely.box(x - half, y - half, x + half, y + half)
    return [PlacedObject("charger", "charger", footprint, "nothing", uses, front)]


def _note_entities(content: dict[str, Any], notes: list[str]) -> None:
    """Add notes on what the map has in addition to the plan."""
    charger = read_charger(content)
    if charger is not None:
        notes.append(f"the vacuum's charger is at ({charger[0]:.2f}, {charger[1]:.2f}) m")
    pieces = [read_points(entity, where) for entity, where in entities_of(content, "path")]
    points = sum(len(piece) for piece in pieces)
    if points:
        steps = [np.linalg.norm(np.diff(piece, axis=0), axis=1) for piece in pieces]
        metres = sum(float(lengths.sum()) for lengths in steps)
        notes.append(
            f"the vacuum's recorded path is {metres:.1f} m long, {points} points, in pieces:"
            f" {len(pieces)}; it is not part of the plan"
        )
    counts = Counter(str(entity.get("type")) for entity, _ in objects_in(content, "entities"))
    for kind in ("path", "charger_location", "robot_position", "no_go_area", "virtual_wall"):
        counts.pop(kind, None)
    if counts:
        listed = ", ".join(f"{kind} ({count})" for kind, count in counts.items())
        notes.append(f"also in the map, without effect on the plan: {listed}")
