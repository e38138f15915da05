"""Maps of robot vacuums with Valetudo, format version 2.

The plan and the recorded path share the frame of `valetudo_file`.
"""

import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import shapely
import shapely.affinity
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.configuration.components import register
from fleet2d.configuration.units import InputPath
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.formats.occupancy import outline
from fleet2d.floorplan.formats.valetudo_file import (
    MAP_CLASS,
    PixelBox,
    PixelLayer,
    check_map,
    entities_of,
    note_size,
    objects_in,
    pixel_side,
    read_charger,
    read_layers,
    read_points,
)
from fleet2d.floorplan.geometry.repair import repair
from fleet2d.floorplan.names import distinct_names
from fleet2d.floorplan.objects import PlacedObject, UsePlace
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.rooms.vocabulary import UNKNOWN, usual_type
from fleet2d.floorplan.source import PixelSource, in_file, read_json
from fleet2d.kernels import F64, Bool
from fleet2d.kernels.space import label_parts, squared_distance

NoGo = Literal["keep_out", "wall", "ignore"]

# Side of a charger, radius of a person in front of it, and how far off that person may be [m].
CHARGER_M, STAND_RADIUS_M, STAND_REACH_M = 0.2, 0.2, 1.0

MAX_PARTS = 10_000

# An overlap of at most this is only a common side [pixels].
TINY = 1e-6


@register("floorplan", "valetudo")
class Valetudo(PixelSource):
    """A map of a robot vacuum that runs Valetudo.

    Attributes:
        path: The map's JSON file.
        no_go: Meaning of no-go areas and virtual walls: areas that robots keep out of
            (`keep_out`), walls (`wall`), or nothing (`ignore`).
    """

    mark: ClassVar = ("__class", MAP_CLASS)

    path: InputPath
    no_go: NoGo = "keep_out"

    @classmethod
    def usual_cell(cls, settings: Mapping[str, Any]) -> float:
        """Return the side of the map's pixels."""
        return pixel_side(check_map(read_json(settings["path"])))

    def load(self) -> FloorPlan:
        """Read the map."""
        return read_valetudo(self.path, self.cell, no_go=self.no_go)


def read_valetudo(path: Path, cell: float | None = None, *, no_go: NoGo = "keep_out") -> FloorPlan:
    """Read the map of a robot vacuum.

    Free space is the pixels of floors and segments without those of walls. Every segment is a room
    under the name that it has in the vacuum's app.

    Args:
        path: The JSON file.
        cell: Side of a grid cell [m]; None for the side of the map's pixels.
        no_go: Meaning of no-go areas and virtual walls: `FloorPlan.no_go` (`keep_out`), walls
            at the pixels that they touch (`wall`), or nothing (`ignore`).

    Raises:
        FloorPlanError: The file can't be read, isn't such a map, or has no floor.
    """
    content = read_json(path)
    with in_file(path):
        content = check_map(content)
        pixel_m = pixel_side(content)
        notes: list[str] = []
        layers = read_layers(content, notes)
        box = PixelBox.around(np.concatenate([layer.runs for layer in layers]))
        note_size(content, box, notes)
        free = _free_pixels(layers, box, notes)
        areas = _no_go_areas(content, free, box, no_go, notes)
        if not free.any():
            raise FloorPlanError("no floor is left: all of it is wall or in no-go areas")
        _note_entities(content, notes)
        regions = _regions(layers, pixel_m, notes)
        return FloorPlan.build(
            path.stem,
            _in_metres(free, box, pixel_m),
            regions,
            pixel_m if cell is None else cell,
            source=f"Valetudo map, {path.name}",
            doorways=None,
            regions_are="exact" if regions else "none",
            objects=_charger(content, free, box),
            no_go=areas,
            notes=notes,
        )


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


def _free_pixels(layers: list[PixelLayer], box: PixelBox, notes: list[str]) -> Bool:
    """Return the pixels that are floor and not wall, bool (rows, columns)."""
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
    return floor & ~wall


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


def _regions(layers: list[PixelLayer], pixel_m: float, notes: list[str]) -> list[LabelledRegion]:
    """Return the segments in the file's order, each under a name of its own."""
    regions: list[LabelledRegion] = []
    segments = [layer for layer in layers if layer.kind == "segment"]
    names = distinct_names([segment.name for segment in segments], "segments", notes)
    for layer, name in zip(segments, names, strict=True):
        box = PixelBox.around(layer.runs)
        shape = _in_metres(box.paint(layer.runs), box, pixel_m)
        kind = usual_type(layer.name) if layer.is_named else UNKNOWN
        regions.append(LabelledRegion((layer.name,), shape, name, kind))
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
    return [part for part in shapely.get_parts(metres).tolist() if part.geom_type == "Polygon"]


def _remove_pixels(shape: BaseGeometry, free: Bool, box: PixelBox) -> None:
    """Remove from the free pixels those that a shape [pixels] overlaps."""
    shape = shape.buffer(-TINY, join_style="mitre")
    x0, y0, x1, y1 = shape.bounds
    first, last = (int(np.clip(y - box.row, 0, box.rows - 1)) for y in (y0, y1))
    left, right = (int(np.clip(x - box.column, 0, box.columns - 1)) for x in (x0, x1))
    shapely.prepare(shape)
    for row in range(first, last + 1):  # by rows, to save memory
        columns = left + np.flatnonzero(free[row, left : right + 1])
        x, y = columns + float(box.column), np.full(len(columns), float(box.row + row))
        pixels = shapely.box(*np.stack([x, y, x + 1, y + 1]))
        free[row, columns] = ~shapely.intersects(shape, pixels)


def _charger(content: dict[str, Any], free: Bool, box: PixelBox) -> list[PlacedObject]:
    """Return the vacuum's charger, with a place to stand in front of it."""
    at = read_charger(content)
    if at is None:
        return []
    (x, y), pixel_m, half = at, pixel_side(content), CHARGER_M / 2
    roomy = squared_distance(np.pad(free, 1))[1:-1, 1:-1] >= (STAND_RADIUS_M / pixel_m) ** 2
    rows, columns = np.nonzero(roomy)
    stand_x, stand_y = ((n + 0.5) * pixel_m for n in (columns + box.column, rows + box.row))
    away = (stand_x - x) ** 2 + (stand_y - y) ** 2
    nearest = int(np.argmin(away)) if len(away) else None
    front, uses = 0.0, tuple[UsePlace, ...]()
    if nearest is not None and away[nearest] <= STAND_REACH_M**2:
        to_x, to_y = round(float(stand_x[nearest]), 6), round(float(stand_y[nearest]), 6)
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
        metres = sum(float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in pieces)
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
