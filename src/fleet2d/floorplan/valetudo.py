"""Maps of robot vacuums with Valetudo: JSON, format version 2.

Their pixels are numbered from the top and their lengths are in centimetres. Here the place
(x, y) [cm] of a map is (x / 100, -y / 100) [m], so that y points up and nothing is mirrored; the
plan and the recorded path share this frame.
"""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely
import shapely.affinity
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError, model_validator
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.component import register
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.occupancy import outline
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.source import FloorPlanSource, read_json
from fleet2d.floorplan.valetudo_file import (
    Box,
    Layer,
    Mask,
    checked_map,
    entities_of,
    note_size,
    objects_in,
    pixel_side,
    read_charger,
    read_layers,
    read_points,
)
from fleet2d.floorplan.vocabulary import PRIORITY, UNKNOWN, room_type
from fleet2d.kernels.masks import label_parts
from fleet2d.paths import InputPath
from fleet2d.units import Length

NoGo = Literal["keep_out", "ignore"]

MAX_PARTS = 10_000

# What touches a pixel by no more than this [pixels] only shares its side.
TINY = 1e-6

# What people and vacuum apps call rooms, where the vocabulary has another word for them.
_ALSO_CALLED = {
    "child_room": ("children_s_room", "kids_room", "nursery", "kinderzimmer"),
    "guest_room": ("gästezimmer",),
    "bedroom": ("schlafzimmer",),
    "living_room": ("lounge", "wohnzimmer"),
    "kitchen": ("küche",),
    "bathroom": ("bath", "bad", "badezimmer"),
    "dining_room": ("dining_area", "esszimmer", "essbereich"),
    "office": ("study", "home_office", "büro", "arbeitszimmer"),
    "toilet": ("wc", "restroom", "gäste_wc"),
    "laundry": ("laundry_room", "utility_room", "waschküche"),
    "wardrobe": ("closet", "walk_in_closet", "cloakroom", "ankleide", "garderobe"),
    "storage": ("storage_room", "pantry", "abstellraum", "vorratskammer"),
    "entryway": ("entrance", "entry", "eingang"),
    "hallway": ("corridor", "flur", "diele"),
    "balcony": ("balkon",),
    "terrace": ("terrasse",),
}
_TYPE_OF = {kind: kind for kind in PRIORITY} | {
    name: kind for kind, names in _ALSO_CALLED.items() for name in names
}


@register("floorplan", "valetudo")
class Valetudo(FloorPlanSource):
    """A map of a robot vacuum that runs Valetudo.

    Attributes:
        path: The map's JSON file.
        cell: Side of a grid cell, 0.01 m to 1 m; None for the map's pixels.
        no_go: Whether no-go areas and virtual walls are obstacles.
    """

    path: InputPath = Field(description="the map's JSON file")
    cell: Length | None = Field(  # type: ignore[assignment]
        default=None,
        description="side of a grid cell, 0.01 m to 1 m; left out: the side of the map's pixels",
    )
    no_go: NoGo = Field(
        default="keep_out",
        description="no-go areas and virtual walls: keep_out makes them obstacles, ignore floor",
    )

    @model_validator(mode="before")
    @classmethod
    def _take_pixel(cls, data: Any) -> Any:
        """Fill in the cell, so that a stored scenario has it; `load` says what is wrong."""
        if not isinstance(data, Mapping) or data.get("cell") is not None or "path" not in data:
            return data
        try:
            path = TypeAdapter(InputPath).validate_python(data["path"])
            return {**data, "cell": pixel_side(checked_map(read_json(path)))}
        except (ValidationError, FloorPlanError):
            return data

    def load(self) -> FloorPlan:
        """Read the map."""
        return read_valetudo(self.path, self.cell, no_go=self.no_go)


def read_valetudo(path: Path, cell: float | None = None, *, no_go: NoGo = "keep_out") -> FloorPlan:
    """Read the map of a robot vacuum.

    Free is what is floor or segment and not wall, along the sides of the pixels. Every segment is a
    room under the name that it has in the vacuum's app.

    Args:
        path: The JSON file.
        cell: Side of a grid cell [m]; None for the side of the map's pixels.
        no_go: What becomes of no-go areas and virtual walls: the pixels that they touch are
            obstacles, or they are ignored.

    Raises:
        FloorPlanError: The file can't be read, isn't such a map, or has no floor.
    """
    content = read_json(path)
    try:
        content = checked_map(content)
        pixel_m = pixel_side(content)
        notes: list[str] = []
        layers = read_layers(content, notes)
        box = Box.around(np.concatenate([layer.runs for layer in layers]))
        note_size(content, box, notes)
        free = _free_pixels(layers, box, notes)
        _keep_out(content, free, box, no_go, notes)
        if not free.any():
            raise FloorPlanError("no floor is left: all of it is wall or in no-go areas")
        _note_entities(content, notes)
        return FloorPlan.build(
            path.stem,
            _in_metres(free, box, pixel_m),
            _regions(layers, pixel_m, notes),
            pixel_m if cell is None else cell,
            source=f"Valetudo map, {path.name}",
            notes=notes,
        )
    except FloorPlanError as error:
        raise FloorPlanError(f"{path}: {error}") from error


def read_valetudo_paths(path: Path) -> list[NDArray[np.float64]]:
    """Read where the vacuum drove.

    Returns:
        The pieces of its path in the file's order, each float64 (n, 2) [m] in the plan's frame, as
        recorded: at unknown times, and points may repeat. An empty list if the map has no path.

    Raises:
        FloorPlanError: The file can't be read, or isn't such a map.
    """
    content = read_json(path)
    try:
        pieces = [
            read_points(entity, where)
            for entity, where in entities_of(checked_map(content), "path")
        ]
    except FloorPlanError as error:
        raise FloorPlanError(f"{path}: {error}") from error
    return [piece for piece in pieces if len(piece)]


def read_valetudo_path(path: Path) -> NDArray[np.float64]:
    """Read where the vacuum drove, float64 (n, 2) [m]: all pieces of the path, one after another.

    Raises:
        FloorPlanError: The file can't be read, or isn't such a map.
    """
    return np.concatenate([np.empty((0, 2)), *read_valetudo_paths(path)])


def read_valetudo_charger(path: Path) -> tuple[float, float] | None:
    """Read where the vacuum's charger is (x, y) [m] in the plan's frame, if the map says so.

    Raises:
        FloorPlanError: The file can't be read, or isn't such a map.
    """
    content = read_json(path)
    try:
        return read_charger(checked_map(content))
    except FloorPlanError as error:
        raise FloorPlanError(f"{path}: {error}") from error


def segment_type(name: str) -> str:
    """Return the room type for a segment's name: of the vocabulary if its last words are there.

    >>> segment_type("Master Bedroom"), segment_type("Küche"), segment_type("Bedroom 2")
    ('bedroom', 'kitchen', 'bedroom')
    >>> segment_type("Yoga Studio")
    'yoga_studio'
    """
    own = room_type(name)
    words = own.split("_")
    while len(words) > 1 and words[-1].isdigit():
        words.pop()
    endings = ("_".join(words[first:]) for first in range(len(words)))
    return next((_TYPE_OF[ending] for ending in endings if ending in _TYPE_OF), own)


# --- Free space and rooms ----------------------------------------------------------------------


def _free_pixels(layers: list[Layer], box: Box, notes: list[str]) -> Mask:
    """Return which pixels are floor and not wall, bool (rows, columns)."""
    segments_at = np.zeros((box.rows, box.columns), np.uint16)
    floor, wall = (np.zeros(segments_at.shape, np.bool_) for _ in range(2))
    for layer in layers:
        part = Box.around(layer.runs)
        window = box.window(part)
        if layer.kind == "wall":
            wall[window] |= part.painted(layer.runs)
        else:
            floor[window] |= part.painted(layer.runs)
        if layer.kind == "segment":
            segments_at[window] += part.painted(layer.runs)
    for both, what in (
        (floor & wall, "floor and wall: they are taken for wall"),
        (segments_at > 1, "in several segments: they belong to the smallest of those"),
    ):
        if both.any():
            notes.append(f"{np.count_nonzero(both)} pixels are {what}")
    return floor & ~wall


def _in_metres(mask: Mask, box: Box, pixel_m: float) -> MultiPolygon:
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


def _regions(layers: list[Layer], pixel_m: float, notes: list[str]) -> list[LabelledRegion]:
    """Return the segments in the file's order, each under a name of its own."""
    regions: list[LabelledRegion] = []
    wanted = {layer.name for layer in layers if layer.kind == "segment"}
    used: set[str] = set()
    for layer in layers:
        if layer.kind != "segment":
            continue
        name, number = layer.name, 2
        while name in used or (number > 2 and name in wanted):
            name, number = f"{layer.name} {number}", number + 1
        if name != layer.name:
            notes.append(f"several segments are called {layer.name}: one of them is {name} here")
        used.add(name)
        box = Box.around(layer.runs)
        shape = _in_metres(box.painted(layer.runs), box, pixel_m)
        kind = segment_type(layer.name) if layer.named else UNKNOWN
        regions.append(LabelledRegion((layer.name,), shape, name, kind))
    return regions


# --- What lies on the floor ---------------------------------------------------------------------


def _keep_out(content: dict[str, Any], free: Mask, box: Box, no_go: NoGo, notes: list[str]) -> None:
    """Take out of the free pixels those that no-go areas and virtual walls touch."""
    pixel_m = pixel_side(content)
    for kind, what in (("no_go_area", "no-go areas"), ("virtual_wall", "virtual walls")):
        shapes = []
        for entity, where in entities_of(content, kind):
            shape = _forbidden(read_points(entity, where) / pixel_m, kind)
            if shape.is_empty:
                notes.append(f"{where}, {kind}, has no extent: ignored")
            else:
                shapes.append(shape)
        if shapes and no_go == "ignore":
            notes.append(f"{what} in the map: {len(shapes)}, ignored")
        elif shapes:
            before = np.count_nonzero(free)
            for shape in shapes:
                _take_out(shape, free, box)
            area = (before - np.count_nonzero(free)) * pixel_m**2
            notes.append(f"{what} in the map: {len(shapes)}, obstacles on {area:.2f} m2 of floor")


def _forbidden(corners: NDArray[np.float64], kind: str) -> BaseGeometry:
    """Return where a no-go area is, or the band a pixel wide round a virtual wall [pixels]."""
    if kind == "virtual_wall":
        if len(corners) < 2:
            return Polygon()
        return LineString(corners).buffer(0.5 - TINY, cap_style="flat")
    if len(corners) < 3:
        return Polygon()
    return shapely.make_valid(Polygon(corners)).buffer(-TINY, join_style="mitre")


def _take_out(shape: BaseGeometry, free: Mask, box: Box) -> None:
    """Take out of the free pixels those that a shape [pixels] reaches into."""
    x0, y0, x1, y1 = shape.bounds
    first, last = (int(np.clip(y - box.row, 0, box.rows - 1)) for y in (y0, y1))
    left, right = (int(np.clip(x - box.column, 0, box.columns - 1)) for x in (x0, x1))
    shapely.prepare(shape)
    for row in range(first, last + 1):  # by rows, to be modest in memory
        columns = left + np.flatnonzero(free[row, left : right + 1])
        x, y = columns + float(box.column), np.full(len(columns), float(box.row + row))
        pixels = shapely.box(*np.stack([x, y, x + 1, y + 1]))
        free[row, columns] = ~shapely.intersects(shape, pixels)


def _note_entities(content: dict[str, Any], notes: list[str]) -> None:
    """Say what the map has that the plan hasn't."""
    charger = read_charger(content)
    if charger is not None:
        notes.append(f"the vacuum's charger is at ({charger[0]:.2f}, {charger[1]:.2f}) m")
    pieces = [read_points(entity, where) for entity, where in entities_of(content, "path")]
    points = sum(len(piece) for piece in pieces)
    if points:
        metres = sum(float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()) for p in pieces)
        notes.append(
            f"the vacuum's recorded path is {metres:.1f} m long, {points} points, in pieces:"
            f" {len(pieces)}; it is no part of the plan"
        )
    counts = Counter(str(entity.get("type")) for entity, _ in objects_in(content, "entities"))
    for kind in ("path", "charger_location", "robot_position", "no_go_area", "virtual_wall"):
        counts.pop(kind, None)
    if counts:
        found = ", ".join(f"{kind} ({count})" for kind, count in counts.items())
        notes.append(f"also in the map, without effect on the plan: {found}")
