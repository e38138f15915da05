"""Drawings of CAD programs as DXF: their walls as lines, on layers."""

import re
from base64 import b64encode
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import Field
from shapely import LineString, MultiPolygon, Point

from fleet2d.bounds import CORNERS
from fleet2d.configuration.units import InputPath
from fleet2d.errors import FloorPlanError, extra
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.files import in_file, reading
from fleet2d.floorplan.lattice import SIDE_M
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.homes.formats.enclosure import enclosed_space, grown, opened, outer_gaps, parts_of
from fleet2d.homes.formats.features import Draft, Feature
from fleet2d.kernels import F64

# Metres to a unit, by the header variable $INSUNITS, and what is tried if that makes no home.
UNITS_M = {1: 0.0254, 2: 0.3048, 4: 0.001, 5: 0.01, 6: 1.0, 10: 0.9144, 14: 0.1, 21: 1200 / 3937}
TRIED_M = (1.0, 0.001, 0.01, 0.0254, 0.3048)
# Words in the names of layers, in several languages.
WALLS = re.compile("wall|wand|mauer|mur|pared|paret|muur", re.IGNORECASE)
WINDOWS = re.compile("window|fenster|fen[eê]tre|ventana|finestra|raam|glas", re.IGNORECASE)
OTHERS = re.compile(
    "dim|text|hatch|furn|m[öo]bel|mobil|door|t[üu]e?r|porte|puerta|axis|grid|defpoints|anno|title",
    re.IGNORECASE,
)
DRAWN = (
    "LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "SOLID", "TRACE",
)  # fmt: skip
# Areas and bodies, which may be walls, but aren't read.
UNREAD = ("HATCH", "MPOLYGON", "REGION", "3DSOLID", "3DFACE", "MESH", "BODY", "SURFACE")
# What consists of other entities, and how deeply it may be nested.
COMPOUND = ("INSERT", "MLINE")
MAX_NESTED = 8
# Width of a line, and of the narrowest space: what is narrower is the inside of a wall that is
# drawn by its two sides [m].
LINE_M = 0.02
NARROW_M = 0.5
MIN_PART_M2 = 1.0
# What is nearer to each other is one point [m].
ROUNDED_M = 0.001
# Largest distance between two lines of one window [m].
WINDOW_LINES_M = 0.3
# Doors are so wide [m]: less apart than any two units are, so that doors decide between these. They
# are drawn by an arc of about a quarter turn [deg].
DOOR_M = (0.55, 1.3)
DOOR_ARC_DEG = (60.0, 110.0)
USUAL_DOOR_M = 0.95
# A home has such an area [m2]; so much less floor than its frame has the widest home round a yard.
HOME_M2 = (12.0, 2000.0)
# How far inside a front door its entrance is, and how far off its arc may be [m].
INSIDE_M = 0.3
AT_DOOR_M = 0.4


class Dxf(FileSource):
    """A drawing in DXF; needs the extra `cad`.

    Attributes:
        path: The DXF file.
        scale: Metres to a unit of the drawing; left out: by the widths of doors,
            as the file says, or by a likely area.
        walls: Layers with walls, by name, `*` for any text; left out: those named like walls and
            windows, or all lines if there are none.
    """

    suffixes = (".dxf",)

    path: InputPath
    scale: float | None = Field(default=None, gt=0)
    walls: str | None = None

    def read(self, files: Mapping[Path, bytes]) -> FloorPlan:
        """Read the drawing.

        Lines on the layers of walls bound the home, and the space between the two lines of a wall
        is wall; through windows between two rooms one sees. Gaps in the outer walls are closed.
        Rooms are found from the walls.

        Raises:
            FloorPlanError: The file can't be read, or its lines enclose no home.
            InputError: ezdxf is not installed.
        """
        drawing = _read(files[self.path], self.path)
        with in_file(self.path):
            notes: list[str] = []
            layers = self._layers(drawing, notes)
            windows = {name for name in layers if WINDOWS.search(name)}
            lines = list(_lines(drawing, layers))
            CORNERS.check(sum(map(len, lines)), "it", FloorPlanError)
            unread = _unread(drawing, layers)
            if not lines:
                found = f" but {unread}: explode them, or" if unread else ":"
                raise FloorPlanError(
                    f"it has no lines of walls{found} name their layers by floorplan.walls"
                )
            if unread:
                notes.append(f"left out on the layers of walls: {unread}; exploded, they are lines")
            arcs = _door_arcs(drawing)
            scales = [self.scale] if self.scale else _scales(drawing, lines, arcs)
            plans: list[tuple[float, FloorPlan]] = []
            problems: list[FloorPlanError] = []
            for scale in scales:
                panes = [line * scale for line in _lines(drawing, windows)]
                doors = arcs * scale
                try:
                    plan = self._home([line * scale for line in lines], panes, doors, notes)
                except FloorPlanError as error:
                    problems.append(error)
                    continue
                plans.append((scale, plan))
            if not plans:
                raise problems[0]
            return _likeliest(plans, drawing, self.scale is not None)

    def _home(
        self, walls: list[F64], windows: list[F64], doors: F64, notes: list[str]
    ) -> FloorPlan:
        """Return the home between lines of walls and windows, with the arcs of doors [m]."""
        corner = np.concatenate(walls).min(axis=0)
        said = list(notes)
        free, entrances = _inside([np.round(line - corner, 4) for line in walls], said)
        centres = doors[:, :2] - corner

        def unlikely(entrance: tuple[float, Point]) -> tuple[bool, float]:
            width, at = entrance
            away = np.hypot(*(centres - np.array([at.x, at.y])).T)
            return not (away <= width + AT_DOOR_M).any(), abs(width - USUAL_DOOR_M)

        fronts = [Feature("entrance", "gap", at, {}) for _, at in sorted(entrances, key=unlikely)]
        panes = _panes([line - corner for line in windows])
        draft = Draft([Feature("free", "walls", free, {}), *panes, *fronts], 0.0, said)
        return draft.build(self.path.stem, self.cell, f"DXF, {self.path.name}")

    def _layers(self, drawing: Any, notes: list[str]) -> set[str]:
        """Return the names of the layers with walls."""
        entities = _parts(drawing, drawing.modelspace(), frozenset())
        names = {name for _, layers in entities for name in layers}
        if self.walls is not None:
            pattern = re.compile(re.escape(self.walls).replace(r"\*", ".*"), re.IGNORECASE)
            chosen = {name for name in names if pattern.fullmatch(name)}
            if not chosen:
                known = ", ".join(sorted(names)[:20])
                raise FloorPlanError(f"no layer is named {self.walls!r}; its layers are: {known}")
            return chosen
        walls = {name for name in names if WALLS.search(name)}
        if not walls:
            walls = {name for name in names if not OTHERS.search(name)}
        walls |= {name for name in names if WINDOWS.search(name)}
        notes.append(
            f"walls are on the layers {', '.join(sorted(walls)[:20])}; walls: names others"
        )
        return walls


def _read(content: bytes, path: Path) -> Any:
    """Return the document of a DXF file."""
    with extra("cad", "reading DXF needs ezdxf"):
        import ezdxf
        from ezdxf.document import Drawing
        from ezdxf.lldxf.tagger import binary_tags_loader
    with reading(path, "DXF"):
        if content.startswith(b"AutoCAD Binary DXF"):
            return Drawing.load(binary_tags_loader(content, errors="surrogateescape"))
        return ezdxf.decode_base64(b64encode(content))  # it determines the encoding


def _lines(drawing: Any, layers: set[str]) -> Iterator[F64]:
    """Yield the corners of each line on some layers, float64 (n, 2), in units of the drawing."""
    from ezdxf.path import make_path

    for part, of_part in _parts(drawing, drawing.modelspace(), frozenset()):
        if of_part & layers and part.dxftype() in DRAWN and not _is_door(part):
            points = [(p.x, p.y) for p in make_path(part).flattening(distance=0.01)]
            corners = np.array(points, np.float64).reshape(-1, 2)
            if len(corners) > 1 and np.isfinite(corners).all():
                yield corners


def _unread(drawing: Any, layers: set[str]) -> str:
    """Return the number of each kind of entity on some layers that isn't read, as text."""
    parts = _parts(drawing, drawing.modelspace(), frozenset())
    kinds = Counter(part.dxftype() for part, of_part in parts if of_part & layers)
    return ", ".join(f"{kinds[kind]} {kind}" for kind in UNREAD if kinds[kind])


def _parts(
    drawing: Any, entities: Iterable[Any], of_blocks: frozenset[str], depth: int = 0
) -> Iterator[tuple[Any, frozenset[str]]]:
    """Yield what is visible of entities and of their blocks, each with the layers that it is on."""
    for entity in entities:
        name = str(entity.dxf.layer)
        layer = drawing.layers.get(name) if name in drawing.layers else None
        if layer is not None and (layer.is_off() or layer.is_frozen()):
            continue
        layers = of_blocks | {name}
        if entity.dxftype() in COMPOUND and depth < MAX_NESTED:
            yield from _parts(drawing, entity.virtual_entities(), layers, depth + 1)
        else:
            yield entity, layers


def _is_door(entity: Any) -> bool:
    """Return whether an entity is an arc of about a quarter turn, as of a door."""
    if entity.dxftype() != "ARC":
        return False
    sweep = (float(entity.dxf.end_angle) - float(entity.dxf.start_angle)) % 360
    return DOOR_ARC_DEG[0] <= sweep <= DOOR_ARC_DEG[1]


def _panes(lines: Sequence[F64]) -> list[Feature]:
    """Return the windows that lines [m] draw: a box round those that are near each other."""
    shapes = np.array([LineString(line) for line in lines], np.object_)
    near = shapely.union_all(shapely.buffer(shapes, WINDOW_LINES_M / 2))
    windows = []
    for k, place in enumerate(shapely.get_parts(near), 1):
        window = shapely.union_all(shapes[shapely.intersects(place, shapes)])
        windows.append(Feature("window", f"window {k}", window.minimum_rotated_rectangle, {}))
    return windows


def _clean(line: F64) -> F64:
    """Return a line without steps of less than a millimetre [m], and shut if its ends meet."""
    kept = np.concatenate([[True], np.hypot(*np.diff(line, axis=0).T) > ROUNDED_M])
    if not kept[1:].any():
        return line
    line = line[kept]
    if len(line) > 2 and np.hypot(*(line[-1] - line[0])) <= ROUNDED_M:
        line[-1] = line[0]
    return line


def _door_arcs(drawing: Any) -> F64:
    """Return the arcs of doors as their middle (x, y) and radius, float64 (n, 3), in units."""
    arcs = []
    for part, _ in _parts(drawing, drawing.modelspace(), frozenset()):
        if _is_door(part) and not WINDOWS.search(str(part.dxf.layer)):
            centre = part.ocs().to_wcs(part.dxf.center)
            arcs.append((float(centre.x), float(centre.y), float(part.dxf.radius)))
    found = np.array(arcs, np.float64).reshape(-1, 3)
    return found[np.isfinite(found).all(axis=1)]


def _scales(drawing: Any, lines: list[F64], arcs: F64) -> list[float]:
    """Return the metres that a unit may be, the likeliest first: what the file says, or others.

    If doors have arcs, their width decides.
    """
    corners = np.concatenate(lines)
    frame = np.ptp(corners, axis=0)
    said = UNITS_M.get(int(drawing.units), 0.0)
    likely = [said, *(scale for scale in TRIED_M if scale != said)]
    homes = [
        scale
        for scale in likely
        if SIDE_M[0] <= frame.max() * scale <= SIDE_M[1]
        and HOME_M2[0] <= frame[0] * frame[1] * scale**2
    ]
    if len(arcs):
        door = float(np.median(arcs[:, 2]))
        fitting = [scale for scale in homes if DOOR_M[0] <= door * scale <= DOOR_M[1]]
        if fitting:
            return fitting[:1]
    if not homes:
        raise FloorPlanError(
            f"its walls extend over {frame.max():.4g} units, which is not a home in metres,"
            " centimetres, millimetres, inches or feet: set floorplan.scale to the metres to a unit"
        )
    return homes


def _likeliest(plans: list[tuple[float, FloorPlan]], drawing: Any, is_given: bool) -> FloorPlan:
    """Return the home in the likeliest of some scales, which have no doors with arcs to decide.

    That is the one that the file says, unless in it far fewer gaps are as wide as doors.

    Raises:
        FloorPlanError: Several are as likely.
    """
    said = UNITS_M.get(int(drawing.units), 0.0)

    def doors(plan: FloorPlan) -> int:
        return sum(DOOR_M[0] <= door.width_m <= DOOR_M[1] for door in plan.doorways)

    most = max(doors(plan) for _, plan in plans)
    least = max(most / 2, min(most, 1))
    best = [entry for entry in plans if doors(entry[1]) == most]
    likely = (entry for entry in plans if entry[0] == said and doors(entry[1]) >= least)
    scale, plan = next(likely, best[0])
    if len(best) > 1 and scale != said:
        sizes = ", ".join(f"{scale:g} makes it {plan.area_m2:.0f} m2" for scale, plan in best)
        raise FloorPlanError(
            f"it doesn't say its unit, and no door tells it: set floorplan.scale; {sizes}"
        )
    if is_given or scale == said:
        return plan
    others = "" if not said else f", though the file says {said:g} m"
    note = f"a unit is taken for {scale:g} m, by its doors and area{others}; scale: sets another"
    return replace(plan, notes=(note, *plan.notes))


def _inside(lines: list[F64], notes: list[str]) -> tuple[MultiPolygon, list[tuple[float, Point]]]:
    """Return the space that lines enclose, and the ways out, with the width of each [m].

    What is narrower than a person is the inside of a wall, and gaps in outer walls are shut.
    """
    drawn = shapely.union_all([LineString(_clean(line)) for line in lines])
    thick = drawn.buffer(NARROW_M / 2, cap_style="square", join_style="mitre")
    solid = opened(grown(thick, -NARROW_M / 2), LINE_M / 2)  # not the rounding of curves
    alone = drawn.difference(solid.buffer(LINE_M / 2))
    walls = shapely.union_all([solid, grown(alone, LINE_M / 2)])
    whole = enclosed_space(walls, [], notes)
    gaps = outer_gaps(walls, whole)
    space = whole.difference(shapely.union_all([walls, *gaps]))
    kept = [
        part
        for part in parts_of(space)
        if part.area >= MIN_PART_M2 and not opened(part, NARROW_M).is_empty
    ]
    if not kept:
        raise FloorPlanError("its lines enclose no space that a person fits into")
    free = MultiPolygon(kept)
    ways = []
    for gap in gaps:
        corners = shapely.get_coordinates(gap)
        outer = corners[:2].mean(axis=0)
        inner = corners[2:4].mean(axis=0)
        inward = (inner - outer) / max(float(np.hypot(*(inner - outer))), 1e-9)
        at = Point(inner + INSIDE_M * inward)
        if free.contains(at):
            ways.append((float(np.hypot(*(corners[1] - corners[0]))), at))
    return free, ways
