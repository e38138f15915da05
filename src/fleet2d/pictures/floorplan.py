"""Draw a floor plan: rooms in soft colours with name and area, dark walls, a scale bar."""

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
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

from fleet2d.errors import InputError
from fleet2d.floorplan.lattice import UNITS_PER_CELL
from fleet2d.floorplan.plan import FloorPlan, Room, rings
from fleet2d.floorplan.rooms.room import NO_ROOM
from fleet2d.floorplan.space import grown_cells
from fleet2d.kernels import I16, Bool
from fleet2d.kernels.space import squared_distance
from fleet2d.palette import (
    ACCENT_COLOR,
    BORDER_COLOR,
    OTHER_COLOR,
    ROOM_COLORS,
    TEXT_COLOR,
    WALL_COLOR,
)
from fleet2d.pictures.objects import draw_objects, label_objects
from fleet2d.pictures.theme import apply_theme
from fleet2d.storage.files import write_atomically

# Formats of pictures, each with the metadata that would differ from time to time.
STAMPS = MappingProxyType({".png": "Software", ".svg": "Date", ".pdf": "CreationDate"})
ENDINGS = tuple(STAMPS)

WALL_M = 0.15  # thickness of outer walls, which files don't contain
LONG_SIDE_IN = 10.0
SHORT_SIDE_IN = 3.2
DPI = 150
MAX_FONT_PT = 9.0
MIN_FONT_PT = 3.5
# Width of a letter of the font as a share of its size; share of a room that its name may fill.
LETTER = 0.62
FILL = 0.9
# The middle of a room consists of cells with at least this share of its greatest squared depth.
DEEP = 0.9


def draw_floorplan(plan: FloorPlan, path: Path) -> None:
    """Draw a floor plan to a PNG, SVG or PDF file; the same plan gives the same bytes.

    Args:
        plan: The floor plan.
        path: The file, whose name ends with `.png`, `.svg` or `.pdf`. An existing file is replaced.

    Raises:
        InputError: The file name has another suffix, or the file can't be written.
    """
    check_picture(path)
    with picture(path, *figure_size(plan)) as figure:
        floorplan_axes(plan, figure.add_axes((0, 0, 1, 1)))


@contextmanager
def picture(path: Path, width: float, height: float) -> Iterator[Figure]:
    """Yield a figure of a size [in] to draw on; it is written to a file when the block ends.

    Raises:
        InputError: The file can't be written.
    """
    with drawing_style():
        figure = Figure(figsize=(width, height), dpi=DPI)
        FigureCanvasAgg(figure)
        yield figure
        save_figure(figure, path)


def check_picture(path: Path) -> None:
    """Check that a file has the suffix of a picture.

    Raises:
        InputError: It has another suffix.
    """
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise InputError(
            f"{path}: a picture is written as .png, .svg or .pdf, not as {ending or 'no ending'!r}"
        )


def drawing_style() -> AbstractContextManager[Any]:
    """Return the context for drawing in the style of Fleet2D, whatever the user's settings."""
    style = {**mpl.rcParamsDefault, "svg.hashsalt": "fleet2d", "font.family": "DejaVu Sans"}
    style.pop("backend")
    return mpl.rc_context(style)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure in the current theme, without a date; readers see all of the file, or none.

    Raises:
        InputError: The file can't be written.
    """
    unstamped = {STAMPS[path.suffix.lower()]: None}
    content = io.BytesIO()
    apply_theme(figure).savefig(content, format=path.suffix[1:].lower(), metadata=unstamped)
    try:
        write_atomically(path, content.getvalue())
    except OSError as error:
        raise InputError(f"can't write the picture {path}: {error.strerror}") from error


def figure_size(plan: FloorPlan) -> tuple[float, float]:
    """Return the width and height of a figure that the plan fills [in]."""
    x0, x1, y0, y1 = _limits(plan)
    width, height = x1 - x0, y1 - y0
    scale = LONG_SIDE_IN / max(width, height)
    return max(width * scale, SHORT_SIDE_IN), max(height * scale, SHORT_SIDE_IN)


def floorplan_axes(plan: FloorPlan, axes: Axes, *, names: bool = True, title: bool = True) -> None:
    """Draw a floor plan on axes, in metres, as the background of other artists.

    All of it has a `zorder` below 2, except text, which has 5.

    Args:
        plan: The floor plan.
        axes: The axes to draw on; their limits are set.
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
        empty = _empty_floor(plan)
        for room in plan.rooms:
            _write_room(plan, room, empty, axes)
        label_objects(plan, axes)
    if title:
        rooms = f"{len(plan.rooms)} room{'s' * (len(plan.rooms) != 1)}"
        height = 0.65 * _margin(plan)
        left, _, _, top = plan.bounds
        style: dict[str, Any] = {"va": "center", "color": TEXT_COLOR, "zorder": 5}
        text = f"{short_name(plan.name)}\n{plan.area_m2:,.1f} m² · {rooms}"
        axes.text(left - WALL_M, top + height, text, fontsize=11, linespacing=1.4, **style)


def short_name(name: str) -> str:
    """Return the name of a plan for pictures: of a long hash, only the first digits.

    Example:
        >>> short_name("2deaa98e9acd1293d5224e25715c1393"), short_name("family_home")
        ('2deaa98e…', 'family_home')
    """
    return f"{name[:8]}…" if re.fullmatch("[0-9a-fA-F]{24,}", name) else name


def _margin(plan: FloorPlan) -> float:
    """Return the space around the plan [m]: enough for a title of two lines at any scale."""
    x0, y0, x1, y1 = plan.bounds
    return 0.35 + 0.085 * max(x1 - x0, y1 - y0)


def scale_depth(plan: FloorPlan) -> float:
    """Return the distance from the plan to the text under its scale bar [m]."""
    return 0.58 * _margin(plan)


def _limits(plan: FloorPlan) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = plan.bounds
    margin = _margin(plan)
    return x0 - margin / 2, x1 + margin / 2, y0 - margin, y1 + 1.3 * margin


def _draw_walls(plan: FloorPlan, axes: Axes) -> None:
    """Draw the walls: the free space enlarged by the thickness of a wall, under the free space."""
    thickness = WALL_M * plan.lattice.units_per_m
    # Without steps of a few centimetres in traced outlines, which look like notches in outer walls.
    smooth = shapely.simplify(shapely.union_all(plan.polygons), thickness / 5)
    solid = shapely.buffer(smooth, thickness, join_style="mitre")
    walls = _outline(plan, shapely.get_parts(solid).tolist())
    axes.add_patch(PathPatch(walls, facecolor=WALL_COLOR, edgecolor="none", zorder=0))


def _draw_rooms(plan: FloorPlan, axes: Axes) -> None:
    """Draw the cells of rooms as an image, clipped at the walls."""
    colors = [to_rgb(ROOM_COLORS.get(room.type, OTHER_COLOR)) for room in plan.rooms]
    table = np.array([*colors, to_rgb(ROOM_COLORS["unknown"])])
    image = table[_spread(plan.room_of_cell)]  # index -1 is the last colour
    free_space = PathPatch(_outline(plan, plan.polygons), transform=axes.transData)
    low = plan.lattice.origin
    size = np.array([plan.lattice.columns, plan.lattice.rows]) * plan.lattice.cell
    artist = axes.imshow(
        image,
        extent=(low[0], low[0] + float(size[0]), low[1], low[1] + float(size[1])),
        origin="lower",
        interpolation="nearest",
        zorder=1,
    )
    artist.set_clip_path(free_space)


def _draw_borders(plan: FloorPlan, axes: Axes) -> None:
    """Draw a thin line where two rooms touch without a wall."""
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


def _spread(room_of_cell: I16) -> I16:
    """Enlarge rooms by two cells into walls, so that their colour reaches slanted walls."""
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
        # Holes need the opposite orientation.
        for ring in rings(shapely.orient_polygons(polygon)):
            corners = plan.lattice.to_metres(shapely.get_coordinates(ring))
            parts.append(Outline(corners, closed=True))
    return Outline.make_compound_path(*parts)


def _draw_scale(plan: FloorPlan, axes: Axes) -> None:
    """Draw a scale bar of a round length below the left corner of the plan."""
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


def _empty_floor(plan: FloorPlan) -> I16:
    """Return the room of each cell without an object, else -1: int16 (rows, columns)."""
    empty = plan.room_of_cell.copy()
    for item in plan.objects:
        window, covered = grown_cells(plan.lattice, item.footprint, 0.0)
        empty[window][covered] = NO_ROOM
    return empty


def _write_room(plan: FloorPlan, room: Room, empty: I16, axes: Axes) -> None:
    """Write the name and area of a room in the middle of its empty floor.

    The text is as large as fits, and upright in narrow rooms.
    """
    inside = empty == room.index
    if not inside.any():
        inside = plan.room_of_cell == room.index
    row, column = _middle(inside)
    across, up = _clear_lengths(plan.lattice.cell, inside, row, column)
    axes.apply_aspect()  # needed for the transform to pixels
    pixels = axes.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    points_per_m = float(pixels[1, 0] - pixels[0, 0]) * 72 / axes.figure.dpi
    name_and_area = f"{room.name}\n{room.area_m2:,.1f} m²"
    for text in (name_and_area, room.name.rpartition("_")[2]):
        # Widths and heights in multiples of the font size.
        lines = text.split("\n")
        width, height = LETTER * max(map(len, lines)), 1.5 * len(lines)
        flat = FILL * points_per_m * min(across / width, up / height)
        upright = FILL * points_per_m * min(up / width, across / height)
        is_upright = flat < min(upright, 5.0)
        size = min(upright if is_upright else flat, MAX_FONT_PT)
        if size >= MIN_FONT_PT:
            x, y = plan.lattice.to_metres(plan.lattice.cell_centre(row, column)).tolist()
            style: dict[str, Any] = {"ha": "center", "va": "center", "color": TEXT_COLOR}
            axes.text(x, y, text, fontsize=size, rotation=90 * is_upright, zorder=5, **style)
            return


def _middle(cells: Bool) -> tuple[int, int]:
    """Return the (row, column) in the middle of the cells that are deepest inside."""
    rows, columns = np.nonzero(cells)
    top, left = int(rows.min()), int(columns.min())
    inside = np.zeros((int(rows.max()) - top + 3, int(columns.max()) - left + 3), np.bool_)
    inside[rows - top + 1, columns - left + 1] = True
    depth = squared_distance(inside)[rows - top + 1, columns - left + 1]
    deep = np.flatnonzero(depth >= DEEP * depth.max())
    rows, columns = rows[deep], columns[deep]
    distance = (rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2
    nearest = int(np.argmin(distance))
    return int(rows[nearest]), int(columns[nearest])


def _clear_lengths(cell: float, inside: Bool, row: int, column: int) -> tuple[float, float]:
    """Return the lengths along x and y that are free on both sides of a cell [m]."""
    lengths = []
    for line, index in ((inside[row], column), (inside[:, column], row)):
        gaps = np.abs(np.flatnonzero(~line) - index)
        lengths.append(float(2 * gaps.min() - 1) * cell)
    return lengths[0], lengths[1]
