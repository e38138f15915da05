"""Vector drawings in SVG: shapes in groups or layers that are named like walls, rooms and doors.

The published layout of CubiCasa5K is one of them: groups of the classes `Wall`, `Space Bedroom`,
`Door` and `Window`, each with a polygon.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import reduce
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import Field
from shapely import LineString, Point, Polygon

from fleet2d.bounds import CORNERS
from fleet2d.configuration.units import InputPath, PositiveLength
from fleet2d.errors import FloorPlanError, extra
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.files import in_file, reading
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.rooms.room import PRIORITY, usual_type
from fleet2d.homes.formats.dxf import WALLS, WINDOWS
from fleet2d.homes.formats.features import Draft, Feature
from fleet2d.kernels import F64

# Words in the names of groups and layers, in several languages.
ROOMS = re.compile(
    r"\b(space|rooms?|zimmer|raum|r[äa]ume|pi[eè]ces?|habitaci[oó]n)\b", re.IGNORECASE
)
DOORS = re.compile(r"\b(doors?|t[üu]e?re?n?|portes?|puertas?|porta|porte|deur)\b", re.IGNORECASE)
# Attributes that name a group or a shape, the first that it has.
NAMES = ("class", "{http://www.inkscape.org/namespaces/inkscape}label", "data-name", "id")
# Names that drawing programs give to shapes themselves.
OF_PROGRAMS = re.compile(
    r"(rect|path|poly\w*|line|circle|ellipse|g|svg|layer|ebene|calque|shape|group|use|text|tspan)?"
    r"[-_ .]*\d*([-_ .]\d+)*",
    re.IGNORECASE,
)
USUAL_DOOR_M = 0.85
CURVE_STEPS = 16
# The thickness of walls that are drawn as lines [m].
WALL_M = 0.1


class Svg(FileSource):
    """A drawing in SVG; needs the extra `svg`.

    Attributes:
        path: The SVG file.
        scale: Metres to a unit of the drawing; left out: so that half of its doors are narrower
            than 0.85 m.
        wall_m: Thickness of walls that are drawn as lines.
    """

    suffixes = (".svg",)

    path: InputPath
    scale: float | None = Field(default=None, gt=0)
    wall_m: PositiveLength = WALL_M

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the drawing.

        Shapes count by the class, label or id of the group or layer that they are in, or by their
        own: those named like walls and windows are wall (without a fill: their lines), through
        windows between rooms one sees, those like rooms are rooms with the rest of the name (`Space
        Bedroom`) or the name of the shape in the group, those like doors open walls. Without any
        such rooms, shapes that have names of rooms are. Others don't count. A text in a room names
        it if nothing else does.

        Raises:
            FloorPlanError: The file can't be read, or has no such shapes.
            InputError: svgelements is not installed.
        """
        content = _read(files[self.path], self.path)
        with in_file(self.path):
            notes: list[str] = []
            shapes = list(_shapes(content))
            if all(kind != "room" for kind, *_ in shapes):
                shapes += list(_shapes(content, only_rooms=True))
            corners = sum(len(ring) for *_, rings, _ in shapes for ring in rings)
            CORNERS.check(corners, "it", FloorPlanError)
            kinds = {kind for kind, *_ in shapes}
            if not kinds & {"wall", "room"}:
                raise FloorPlanError(
                    "no group, layer or shape in it is named like walls or rooms: name the layer of"
                    " the walls 'walls', and the group of each room like 'room kitchen'"
                )
            doors = [ring for kind, _, rings, _ in shapes if kind == "door" for ring in rings]
            scale = self.scale or _scale(doors, notes)
            metres = np.array([scale, -scale])
            features = [_feature(number, *shape, metres) for number, shape in enumerate(shapes, 1)]
            texts = [(text, at * metres) for text, at in _texts(content)]
            sound = [_named(f, texts) for f in features if not f.shape.is_empty]
            windows = [f for f in sound if f.properties.get("is_window")]
            boxes = [f.shape.minimum_rotated_rectangle for f in windows]
            panes = [Feature("window", f.where, b, {}) for f, b in zip(windows, boxes, strict=True)]
            draft = Draft([*sound, *panes], self.wall_m, notes)
            return draft.build(self.path.stem, self.cell, f"SVG, {self.path.name}")


def _read(content: bytes, path: Path) -> Any:
    """Return the groups of an SVG file, in the units of its viewBox."""
    with extra("svg", "reading SVG needs svgelements"):
        import svgelements
    with reading(path, "SVG"):
        drawing = svgelements.SVG.parse(BytesIO(content), reify=True, ppi=96)
        to_units = ~svgelements.Matrix(drawing.viewbox_transform)
        for element in drawing.elements():
            if isinstance(element, svgelements.Shape | svgelements.Text):
                element *= to_units
        return drawing


def _shapes(
    group: Any, name: str = "", *, only_rooms: bool = False
) -> Iterator[tuple[str, str, list[F64], bool]]:
    """Yield the kind, name and outlines (n, 2) of each shape that counts, and if it is an area.

    Areas of walls may have holes: further outlines. Other shapes have one outline each.

    Args:
        group: The group of shapes.
        name: The name of the nearest group that has one.
        only_rooms: Whether shapes count that have the name of a room, and no others.
    """
    from svgelements import Group, Path, Shape, Use

    for element in group:
        named = _name(element)
        if isinstance(element, Group | Use):
            yield from _shapes(element, named or name, only_rooms=only_rooms)
        elif isinstance(element, Shape):
            kind = _kind(named) or _kind(name)
            own = named if _kind(named) else name
            if kind == "room" and own is name and named and not OF_PROGRAMS.fullmatch(named):
                own = named
            if only_rooms:
                own = next((word for word in (named, name) if _is_room(word)), "")
                kind = "room" if own and not kind else ""
            is_line = kind == "wall" and element.fill.value is None
            parts = abs(Path(element)).as_subpaths() if kind else ()
            drawn = [_corners(Path(part)) for part in parts]
            rings = [ring for ring in drawn if len(ring) > 1 and np.isfinite(ring).all()]
            closed = [len(r) > 3 and bool((r[0] == r[-1]).all()) and not is_line for r in rings]
            if kind == "wall" and len(rings) > 1 and all(closed):
                yield kind, own, rings, True
            else:
                for ring, is_closed in zip(rings, closed, strict=True):
                    yield kind, own, [ring], is_closed


def _name(element: Any) -> str:
    own = element.values.get("attributes") or {}
    return next((str(own[key]) for key in NAMES if own.get(key)), "")


def _is_room(name: str) -> bool:
    """Return whether a name means a type of room.

    >>> _is_room("living-room"), _is_room("Bathtub")
    (True, False)
    """
    return bool(name) and usual_type(name) in PRIORITY


def _texts(group: Any) -> Iterator[tuple[str, F64]]:
    """Yield each text with its place, float64 (2,)."""
    from svgelements import Group, Matrix, Text, Use

    for element in group:
        if isinstance(element, Group | Use):
            yield from _texts(element)
        elif isinstance(element, Text) and element.text:
            x, y = Matrix(element.transform).point_in_matrix_space((element.x, element.y))
            if np.isfinite([x, y]).all():
                yield " ".join(str(element.text).split()), np.array([float(x), float(y)])


def _named(room: Feature, texts: list[tuple[str, F64]]) -> Feature:
    """Return a room with the name that a text in it gives, unless it has one."""
    if room.kind != "room" or room.properties:
        return room
    inside = [text for text, at in texts if room.shape.intersects(Point(at))]
    uses = [text for text in inside if _is_room(text)]
    if uses:
        return replace(room, properties={"type": uses[0], "labels": uses})
    words = [text for text in inside if re.search(r"[^\W\d_]{3}", text)]
    return replace(room, properties={"name": words[0]} if len(words) == 1 else {})


def _kind(name: str) -> str:
    """Return the kind of feature that a name stands for; "" for none.

    >>> _kind("Space LivingRoom"), _kind("Wall External"), _kind("Panel")
    ('room', 'wall', '')
    """
    kinds = (("door", DOORS), ("wall", WINDOWS), ("wall", WALLS), ("room", ROOMS))
    return next((kind for kind, words in kinds if words.search(name)), "")


def _corners(path: Any) -> F64:
    """Return the corners of a path, with points along its curves, float64 (n, 2)."""
    from svgelements import Arc, CubicBezier, Move, QuadraticBezier

    points: list[tuple[float, float]] = []
    for segment in path:
        if isinstance(segment, Arc | CubicBezier | QuadraticBezier):
            steps = [segment.point(k / CURVE_STEPS) for k in range(1, CURVE_STEPS + 1)]
        else:
            steps = [segment.end]
        if isinstance(segment, Move):
            points = []
        points += [(float(at.x), float(at.y)) for at in steps if at is not None]
    return np.array(points, np.float64).reshape(-1, 2)


def _scale(doors: list[F64], notes: list[str]) -> float:
    """Return the metres to a unit by which doors are as wide as usual."""
    widths = sorted(float(np.ptp(corners, axis=0).max()) for corners in doors)
    if not widths or not widths[len(widths) // 2] > 0:
        raise FloorPlanError(
            "it has no doors that would tell its scale: set floorplan.scale to the metres to a unit"
        )
    scale = USUAL_DOOR_M / widths[len(widths) // 2]
    notes.append(
        f"a unit is taken for {scale:.4g} m, by the width of {len(widths)} doors; scale: sets"
        " another"
    )
    return scale


def _feature(
    number: int, kind: str, name: str, rings: list[F64], closed: bool, metres: F64
) -> Feature:
    """Return a shape as a feature [m]; `metres` are those to a unit of x and of y."""
    where = f"{kind} {number}"
    outlines = [np.round(ring * metres, 4) for ring in rings]
    shape: Any = LineString(outlines[0])
    if closed or (kind == "room" and len(outlines[0]) > 2):
        areas = [
            shapely.make_valid(Polygon(outline), method="structure", keep_collapsed=False)
            for outline in outlines
        ]
        shape = reduce(shapely.symmetric_difference, areas)  # by the rule even-odd
    if kind != "room":
        is_window = kind == "wall" and WINDOWS.search(name) is not None
        return Feature(kind, where, shape, {"is_window": is_window})
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", ROOMS.sub(" ", name)).split()
    own = " ".join(words)
    is_use = _is_room(own) or ROOMS.search(name) is not None
    key = "type" if is_use else "name"
    properties = {key: own} if own else {}
    return Feature(kind, where, shape, properties)
