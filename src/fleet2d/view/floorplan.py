"""Draw a floor plan: rooms in soft colours with name and area, dark walls, a scale bar."""

import io
import re
from collections.abc import Sequence
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

import matplotlib as mpl
import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from fleet2d.errors import InputError
from fleet2d.floorplan.geometry.lattice import UNITS_PER_CELL
from fleet2d.floorplan.home.standing import grown_cells
from fleet2d.floorplan.plan import FloorPlan, Room, rings
from fleet2d.floorplan.rooms.room import NO_ROOM
from fleet2d.kernels.fields import squared_distance
from fleet2d.palette import (
    ACCENT_COLOR,
    BORDER_COLOR,
    OTHER_COLOR,
    ROOM_COLORS,
    TEXT_COLOR,
    WALL_COLOR,
)
from fleet2d.view.objects import draw_objects, label_objects
from fleet2d.view.theme import finished

# Kinds of pictures, and what each would say of when or by what it was made.
STAMPS = MappingProxyType({".png": "Software", ".svg": "Date", ".pdf": "CreationDate"})
ENDINGS = tuple(STAMPS)

WALL_M = 0.15  # drawn round the outline; a file says nothing of how thick the outer walls are
LONG_SIDE_IN = 10.0
SHORT_SIDE_IN = 3.2
DPI = 150
MAX_FONT_PT = 9.0
MIN_FONT_PT = 3.5
# Width of a letter of the font in parts of its size, and of the room that a name may fill.
LETTER = 0.62
FILL = 0.9
# Cells of at least this part of a room's greatest squared depth make up its middle.
DEEP = 0.9


def draw_floorplan(plan: FloorPlan, path: Path) -> None:
    """Draw a floor plan to a PNG or SVG file; the same plan gives the same bytes.

    Args:
        plan: What to draw.
        path: Where to; the name ends with `.png` or `.svg`. A file there is replaced.

    Raises:
        InputError: The name ends otherwise, the file can't be written.
    """
    check_picture(path)
    with drawing_style():
        figure = Figure(figsize=figure_size(plan), dpi=DPI)
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, 1, 1))
        floorplan_axes(plan, axes)
        save_figure(figure, path)


def check_picture(path: Path) -> None:
    """Raise InputError unless a file's name ends as that of a picture that we write."""
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise InputError(
            f"{path}: a picture is written as .png, .svg or .pdf, not as {ending or 'no ending'!r}"
        )


def drawing_style() -> AbstractContextManager[Any]:
    """Return the context to draw in: the project's style, whatever the user's own settings are."""
    style = {**mpl.rcParamsDefault, "svg.hashsalt": "fleet2d", "font.family": "DejaVu Sans"}
    style.pop("backend")
    context: AbstractContextManager[Any] = mpl.rc_context(style)
    return context


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure in the theme of the moment, without a date in it, whole or not at all.

    Raises:
        InputError: The file can't be written.
    """
    unstamped = {STAMPS[path.suffix.lower()]: None}
    picture = io.BytesIO()
    finished(figure).savefig(picture, format=path.suffix[1:].lower(), metadata=unstamped)
    unfinished = path.with_name(f".{path.name}.unfinished")
    try:
        unfinished.write_bytes(picture.getvalue())
        unfinished.replace(path)
    except OSError as error:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
        raise InputError(f"can't write the picture {path}: {error.strerror}") from error


def figure_size(plan: FloorPlan) -> tuple[float, float]:
    """Return the width and height [in] at which the plan fills its figure."""
    x0, x1, y0, y1 = _limits(plan)
    width, height = x1 - x0, y1 - y0
    scale = LONG_SIDE_IN / max(width, height)
    return max(width * scale, SHORT_SIDE_IN), max(height * scale, SHORT_SIDE_IN)


def floorplan_axes(plan: FloorPlan, axes: Axes, *, names: bool = True, title: bool = True) -> None:
    """Draw a floor plan on axes, in metres, for others to draw over.

    What is drawn here stays below `zorder` 2, except the words, at 5.

    Args:
        plan: What to draw.
        axes: Where to draw; its limits are set.
        names: Whether to write the rooms' names and areas.
        title: Whether to write the plan's name and area above it.
    """
    x0, x1, y0, y1 = _limits(plan)
    axes.set_axis_off()
    axes.set(xlim=(x0, x1), ylim=(y0, y1))
    axes.set_aspect("equal")
    _draw_walls(plan, axes)
    _draw_rooms(plan, axes)
    _draw_borders(plan, axes)
    draw_objects(plan, axes)
    _draw_scale(plan, axes)
    if plan.entrance is not None:
        _draw_entrance(plan.entrance, axes)
    if names:
        bare = _bare_floor(plan)
        for room in plan.rooms:
            _write_room(plan, room, bare, axes)
        label_objects(plan, axes)
    if title:
        words = f"{len(plan.rooms)} room{'s' * (len(plan.rooms) != 1)}"
        height = 0.65 * _margin(plan)
        left, _, _, top = plan.bounds
        style: dict[str, Any] = {"va": "center", "color": TEXT_COLOR, "zorder": 5}
        text = f"{short_name(plan.name)}\n{plan.area_m2:,.1f} m² · {words}"
        axes.text(left - WALL_M, top + height, text, fontsize=11, linespacing=1.4, **style)


def short_name(name: str) -> str:
    """Return a plan's name as pictures show it: of a long hash, only the first digits.

    Example:
        >>> short_name("2deaa98e9acd1293d5224e25715c1393"), short_name("family_home")
        ('2deaa98e…', 'family_home')
    """
    return f"{name[:8]}…" if re.fullmatch("[0-9a-fA-F]{24,}", name) else name


def _margin(plan: FloorPlan) -> float:
    """Return the space around the plan [m]: room for a title of two lines at any scale."""
    x0, y0, x1, y1 = plan.bounds
    return 0.35 + 0.085 * max(x1 - x0, y1 - y0)


def scale_depth(plan: FloorPlan) -> float:
    """Return how far below the plan [m] the words under its scale begin."""
    return 0.58 * _margin(plan)


def _limits(plan: FloorPlan) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = plan.bounds
    margin = _margin(plan)
    return x0 - margin / 2, x1 + margin / 2, y0 - margin, y1 + 1.3 * margin


def _draw_walls(plan: FloorPlan, axes: Axes) -> None:
    """Draw the walls: the free space grown by a wall, under the free space."""
    thickness = WALL_M * plan.lattice.units_per_m
    # Steps of a few centimetres in a traced outline would show as notches in its outer walls.
    even = shapely.simplify(shapely.union_all(plan.polygons), thickness / 5)
    solid = shapely.buffer(even, thickness, join_style="mitre")
    walls = _outline(plan, shapely.get_parts(solid).tolist())
    axes.add_patch(PathPatch(walls, facecolor=WALL_COLOR, edgecolor="none", zorder=0))


def _draw_rooms(plan: FloorPlan, axes: Axes) -> None:
    """Draw the rooms' cells as an image, cut along the walls."""
    colors = [to_rgb(ROOM_COLORS.get(room.type, OTHER_COLOR)) for room in plan.rooms]
    table = np.array([*colors, to_rgb(ROOM_COLORS["unknown"])])
    image = table[_spread(plan.room_of_cell)]  # the last colour serves -1
    inside = PathPatch(_outline(plan, plan.polygons), transform=axes.transData)
    low = plan.lattice.origin
    size = np.array([plan.lattice.columns, plan.lattice.rows]) * plan.lattice.cell
    shown = axes.imshow(
        image,
        extent=(low[0], low[0] + float(size[0]), low[1], low[1] + float(size[1])),
        origin="lower",
        interpolation="nearest",
        zorder=1,
    )
    shown.set_clip_path(inside)


def _draw_borders(plan: FloorPlan, axes: Axes) -> None:
    """Draw a thin line where two rooms meet without a wall."""
    rooms = plan.room_of_cell
    lines = []
    for flip, grid in ((False, rooms), (True, rooms.T)):
        low, high = grid[:-1], grid[1:]
        meets = (low != high) & (low != NO_ROOM) & (high != NO_ROOM)
        line, first = np.nonzero(np.diff(np.pad(meets, ((0, 0), (1, 0))).astype(np.int8)) == 1)
        _, end = np.nonzero(np.diff(np.pad(meets, ((0, 0), (0, 1))).astype(np.int8)) == -1)
        runs = np.stack([np.stack([first, line + 1], 1), np.stack([end + 1, line + 1], 1)], 1)
        lines.append(runs[..., ::-1] if flip else runs)
    corners = plan.lattice.to_metres(np.concatenate(lines) * UNITS_PER_CELL)
    color, dashes = BORDER_COLOR, (0, (4, 3))
    axes.add_collection(LineCollection(list(corners), lw=0.6, color=color, ls=dashes, zorder=1.5))


def _spread(room_of_cell: NDArray[np.int16]) -> NDArray[np.int16]:
    """Let rooms grow by a cell into what isn't free, so that their colour reaches slanted walls."""
    grown = np.pad(room_of_cell, 1, constant_values=NO_ROOM)
    for _ in range(2):
        around = [np.roll(grown, shift, axis) for axis in (0, 1) for shift in (1, -1)]
        nearby = np.maximum.reduce(around)
        grown = np.where(grown == NO_ROOM, nearby, grown)
    return grown[1:-1, 1:-1]


def _outline(plan: FloorPlan, polygons: Sequence[shapely.Polygon]) -> Outline:
    """Return polygons [lattice] as one path [m]."""
    parts = []
    for polygon in polygons:
        # Holes have to run the other way round to be holes.
        for ring in rings(shapely.orient_polygons(polygon)):
            corners = plan.lattice.to_metres(shapely.get_coordinates(ring))
            parts.append(Outline(corners, closed=True))
    return Outline.make_compound_path(*parts)


def _draw_scale(plan: FloorPlan, axes: Axes) -> None:
    """Draw a bar of a round length, a black and a white half, below the plan's left corner."""
    x0, y0, x1, _ = plan.bounds
    length = next((m for m in (50, 20, 10, 5, 2) if m <= (x1 - x0) / 3), 1)
    margin = _margin(plan)
    bottom, height = y0 - 0.5 * margin, 0.05 * margin
    for part, color in enumerate((TEXT_COLOR, "white")):
        corner = (x0 + part * length / 2, bottom)
        bar = Rectangle(corner, length / 2, height, facecolor=color, edgecolor=TEXT_COLOR, lw=0.8)
        axes.add_patch(bar)
    for metres, text in ((0.0, "0"), (length / 2, f"{length / 2:g}"), (length, f"{length} m")):
        y = y0 - scale_depth(plan)
        axes.text(
            x0 + metres, y, text, fontsize=8, ha="center", va="top", color=TEXT_COLOR, zorder=5
        )


def _draw_entrance(entrance: tuple[float, float], axes: Axes) -> None:
    axes.plot(*entrance, marker="^", markersize=9, color=ACCENT_COLOR, mec="white", zorder=1.9)
    axes.annotate(
        "entrance",
        entrance,
        xytext=(0, -7),
        textcoords="offset points",
        fontsize=6.5,
        ha="center",
        va="top",
        color=ACCENT_COLOR,
        zorder=5,
    )


def _bare_floor(plan: FloorPlan) -> NDArray[np.int16]:
    """Return the room of each cell that no object stands on, -1 elsewhere, (rows, columns)."""
    bare = plan.room_of_cell.copy()
    for thing in plan.objects:
        window, covered = grown_cells(plan.lattice, thing.footprint, 0.0)
        bare[window][covered] = NO_ROOM
    return bare


def _write_room(plan: FloorPlan, room: Room, bare: NDArray[np.int16], axes: Axes) -> None:
    """Write a room's name and area in the middle of its floor that is bare.

    As large as fits, and upright in narrow rooms.
    """
    inside = bare == room.index
    if not inside.any():
        inside = plan.room_of_cell == room.index
    row, column = _middle(inside)
    across, up = _clear_lengths(plan.lattice.cell, inside, row, column)
    axes.apply_aspect()  # only now does the transform to pixels hold
    pixels = axes.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    points_per_m = float(pixels[1, 0] - pixels[0, 0]) * 72 / axes.figure.dpi
    text = f"{room.name}\n{room.area_m2:,.1f} m²"
    for words in (text, room.name.rpartition("_")[2]):
        # A line is as wide as its letters, and the lines are as high as one and a half of them.
        lines = words.split("\n")
        width, height = LETTER * max(map(len, lines)), 1.5 * len(lines)
        flat = FILL * points_per_m * min(across / width, up / height)
        upright = FILL * points_per_m * min(up / width, across / height)
        turn = flat < min(upright, 5.0)
        size = min(upright if turn else flat, MAX_FONT_PT)
        if size >= MIN_FONT_PT:
            x, y = plan.lattice.to_metres(plan.lattice.cell_centre(row, column)).tolist()
            style: dict[str, Any] = {"ha": "center", "va": "center", "color": TEXT_COLOR}
            axes.text(x, y, words, fontsize=size, rotation=90 * turn, zorder=5, **style)
            return


def _middle(cells: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the (row, column) in the middle of those that are about as deep inside as any."""
    rows, columns = np.nonzero(cells)
    top, left = int(rows.min()), int(columns.min())
    inside = np.zeros((int(rows.max()) - top + 3, int(columns.max()) - left + 3), np.bool_)
    inside[rows - top + 1, columns - left + 1] = True
    depth = squared_distance(inside)[rows - top + 1, columns - left + 1]
    deep = np.flatnonzero(depth >= DEEP * depth.max())
    rows, columns = rows[deep], columns[deep]
    away = (rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2
    nearest = int(np.argmin(away))
    return int(rows[nearest]), int(columns[nearest])


def _clear_lengths(
    cell: float, inside: NDArray[np.bool_], row: int, column: int
) -> tuple[float, float]:
    """Return how far cells extend from one along x and y, as far to either side [m]."""
    lengths = []
    for line, here in ((inside[row], column), (inside[:, column], row)):
        gaps = np.abs(np.flatnonzero(~line) - here)
        lengths.append(float(2 * gaps.min() - 1) * cell)
    return lengths[0], lengths[1]
