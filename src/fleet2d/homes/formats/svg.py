"""Vector drawings in SVG: shapes in groups or layers that are named like walls, rooms and doors.

The published layout of CubiCasa5K is one of them: groups of the classes `Wall`, `Space Bedroom`,
`Door` and `Window`, each with a polygon.
"""

import re
from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import Field
from shapely import LineString, Polygon

from fleet2d.bounds import CORNERS
from fleet2d.configuration.units import InputPath, PositiveLength
from fleet2d.errors import FloorPlanError, extra
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.files import in_file, reading
from fleet2d.floorplan.plan import FloorPlan
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
USUAL_DOOR_M = 0.85
CURVE_STEPS = 16
WALL_M = 0.1  # of walls that are drawn as lines


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
        Bedroom`), those like doors open walls. Others don't count.

        Raises:
            FloorPlanError: The file can't be read, or has no such shapes.
            InputError: svgelements is not installed.
        """
        content = _read(files[self.path], self.path)
        with in_file(self.path):
            notes: list[str] = []
            shapes = list(_shapes(content))
            CORNERS.check(sum(len(corners) for *_, corners, _ in shapes), "it", FloorPlanError)
            kinds = {kind for kind, *_ in shapes}
            if not kinds & {"wall", "room"}:
                raise FloorPlanError(
                    "no group, layer or shape in it is named like walls or rooms: name the layer of"
                    " the walls 'walls', and the group of each room like 'room kitchen'"
                )
            scale = self.scale or _scale([c for kind, _, c, _ in shapes if kind == "door"], notes)
            features = [
                _feature(f"{kind} {number}", kind, name, corners * (scale, -scale), closed)
                for number, (kind, name, corners, closed) in enumerate(shapes, 1)
            ]
            sound = [f for f in features if not f.shape.is_empty]
            windows = [f for f in sound if f.properties.get("is_window")]
            boxes = [f.shape.minimum_rotated_rectangle for f in windows]
            panes = [Feature("window", f.where, b, {}) for f, b in zip(windows, boxes, strict=True)]
            draft = Draft([*sound, *panes], self.wall_m, notes)
            return draft.build(self.path.stem, self.cell, f"SVG, {self.path.name}")


def _read(content: bytes, path: Path) -> Any:
    """Return the groups of an SVG file."""
    with extra("svg", "reading SVG needs svgelements"):
        import svgelements
    with reading(path, "SVG"):
        return svgelements.SVG.parse(BytesIO(content), reify=True, ppi=96)


def _shapes(group: Any, name: str = "") -> Iterator[tuple[str, str, F64, bool]]:
    """Yield the kind, name and corners (n, 2) of each shape that counts, and if it is an area."""
    from svgelements import Group, Path, Shape

    for element in group:
        own = element.values.get("attributes") or {}
        named = next((str(own[key]) for key in NAMES if own.get(key)), "")
        if isinstance(element, Group):
            yield from _shapes(element, named or name)
        elif isinstance(element, Shape):
            kind = _kind(named) or _kind(name)
            is_line = kind == "wall" and element.fill.value is None
            for part in Path(element).as_subpaths() if kind else ():
                corners = _corners(Path(part))
                if len(corners) > 1 and np.isfinite(corners).all():
                    closed = len(corners) > 3 and bool((corners[0] == corners[-1]).all())
                    yield kind, named if _kind(named) else name, corners, closed and not is_line


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


def _feature(where: str, kind: str, name: str, corners: F64, closed: bool) -> Feature:
    """Return a shape as a feature [m]."""
    outline = np.round(corners, 4)
    shape: Any = LineString(outline)
    if closed or (kind == "room" and len(outline) > 2):
        shape = shapely.make_valid(Polygon(outline), method="structure", keep_collapsed=False)
    if kind != "room":
        is_window = kind == "wall" and WINDOWS.search(name) is not None
        return Feature(kind, where, shape, {"is_window": is_window})
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", ROOMS.sub(" ", name)).split()
    use = "_".join(words).lower() if words else None
    return Feature(kind, where, shape, {"type": use} if use else {})
