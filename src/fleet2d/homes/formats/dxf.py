"""Drawings of CAD programs as DXF: their walls as lines, on layers."""

import re
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import Field
from shapely import LineString, MultiPolygon
from shapely.geometry.base import BaseGeometry

from fleet2d.bounds import CORNERS
from fleet2d.configuration.units import InputPath
from fleet2d.errors import FloorPlanError, extra
from fleet2d.floorplan.file_source import FileSource
from fleet2d.floorplan.files import in_file, reading
from fleet2d.floorplan.lattice import SIDE_M
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.homes.formats.features import Draft, Feature, enclosed_space
from fleet2d.kernels import F64

# Metres to a unit, by the header variable $INSUNITS, and what is tried if it says nothing.
UNITS_M = {1: 0.0254, 2: 0.3048, 4: 0.001, 5: 0.01, 6: 1.0}
TRIED_M = (1.0, 0.001, 0.01, 0.0254, 0.3048)
# Words in the names of layers, in several languages.
WALLS = re.compile("wall|wand|mauer|mur|pared|paret|muur", re.IGNORECASE)
WINDOWS = re.compile("window|fenster|fen[eê]tre|ventana|finestra|raam|glas", re.IGNORECASE)
OTHERS = re.compile(
    "dim|text|hatch|furn|m[öo]bel|mobil|door|t[üu]e?r|porte|puerta|axis|grid|defpoints|anno|title",
    re.IGNORECASE,
)
DRAWN = ("LINE", "LWPOLYLINE", "POLYLINE")
# Width of a line, and of the narrowest space: what is narrower is the inside of a wall that is
# drawn by its two sides [m].
LINE_M = 0.02
NARROW_M = 0.5
MIN_PART_M2 = 1.0
# Largest distance between two lines of one window [m].
WINDOW_LINES_M = 0.3


class Dxf(FileSource):
    """A drawing in DXF; needs the extra `cad`.

    Attributes:
        path: The DXF file.
        scale: Metres to a unit of the drawing; left out: as the file says, or by its extent.
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
            if not lines:
                raise FloorPlanError(
                    "it has no lines of walls: name their layers by floorplan.walls"
                )
            bounds = np.concatenate(lines)
            low, high = bounds.min(axis=0), bounds.max(axis=0)
            scale = self.scale or _scale(int(drawing.units), float((high - low).max()), notes)
            metres = [LineString(np.round((line - low) * scale, 4)) for line in lines]
            free = _inside(metres, notes)
            panes = _panes([(line - low) * scale for line in _lines(drawing, windows)])
            draft = Draft([Feature("free", "walls", free, {}), *panes], 0.0, notes)
            return draft.build(self.path.stem, self.cell, f"DXF, {self.path.name}")

    def _layers(self, drawing: Any, notes: list[str]) -> set[str]:
        """Return the names of the layers with walls."""
        names = {str(entity.dxf.layer) for entity in drawing.modelspace()}
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

    for entity in drawing.modelspace():
        parts = [entity]
        if entity.dxftype() == "INSERT":
            parts = list(entity.virtual_entities())
        for part in parts:
            on_layer = {str(part.dxf.layer), str(entity.dxf.layer)} & layers
            if on_layer and part.dxftype() in DRAWN:
                points = [(p.x, p.y) for p in make_path(part).flattening(distance=0.01)]
                corners = np.array(points, np.float64).reshape(-1, 2)
                if len(corners) > 1 and np.isfinite(corners).all():
                    yield corners


def _panes(lines: Sequence[F64]) -> list[Feature]:
    """Return the windows that lines [m] draw: a box round those that are near each other."""
    shapes = np.array([LineString(line) for line in lines], np.object_)
    near = shapely.union_all(shapely.buffer(shapes, WINDOW_LINES_M / 2))
    windows = []
    for k, place in enumerate(shapely.get_parts(near), 1):
        window = shapely.union_all(shapes[shapely.intersects(place, shapes)])
        windows.append(Feature("window", f"window {k}", window.minimum_rotated_rectangle, {}))
    return windows


def _scale(units: int, extent: float, notes: list[str]) -> float:
    """Return the metres to a unit: as the file says, else by the extent of the drawing."""
    for scale in (UNITS_M.get(units, 0.0), *TRIED_M):
        if SIDE_M[0] <= extent * scale <= SIDE_M[1]:
            if scale != UNITS_M.get(units):
                notes.append(f"a unit is taken for {scale:g} m, by the extent; scale: sets another")
            return scale
    raise FloorPlanError(
        f"its walls extend over {extent:.4g} units, which is not a home in metres, centimetres,"
        " millimetres, inches or feet: set floorplan.scale to the metres to a unit"
    )


def _inside(lines: list[LineString], notes: list[str]) -> MultiPolygon:
    """Return the space that lines enclose [m], without the inside of walls."""
    walls: BaseGeometry = shapely.union_all(lines).buffer(LINE_M / 2, join_style="mitre")
    space = enclosed_space(walls, [], notes).difference(walls)
    half = NARROW_M / 2
    roomy = space.buffer(-half, join_style="mitre").buffer(half, join_style="mitre")
    parts = shapely.get_parts(roomy.intersection(space)).tolist()
    kept = [p for p in parts if p.geom_type == "Polygon" and p.area >= MIN_PART_M2]
    if not kept:
        raise FloorPlanError("its lines enclose no space that a person fits into")
    return MultiPolygon(kept)
