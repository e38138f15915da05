"""Pictures of floor plans, with their furniture and the findings about them."""

import io
import math
import re
import textwrap
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import matplotlib as mpl
import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font, get_font_names
from matplotlib.image import AxesImage
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path as Outline
from matplotlib.text import Text
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from fleet2d.configuration.problems import counted
from fleet2d.errors import InputError, os_errors_as
from fleet2d.floorplan.checkup import Finding
from fleet2d.floorplan.lattice import UNITS_PER_CELL
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.floorplan.plan import FloorPlan, Room
from fleet2d.floorplan.rooms.doorways import Doorway
from fleet2d.floorplan.rooms.room import NO_ROOM
from fleet2d.floorplan.space import grown_cells
from fleet2d.kernels import F64, I16, Bool, squared_distance
from fleet2d.palette import (
    ACCENT_COLOR,
    BORDER_COLOR,
    DOOR_COLOR,
    ROOM_COLORS,
    TEXT_COLOR,
)
from fleet2d.storage.files import write_atomically
from fleet2d.viewing.contract import ShapeFacts
from fleet2d.viewing.home_facts import placed_symbol
from fleet2d.viewing.look import (
    JOINT_M,
    OUTLINE_EDGE,
    OUTLINE_FILL,
    WALL_EDGE,
    WALL_M,
    WALL_TOP,
    WOOD,
    floor_of,
    room_labels,
    symbol_names,
    symbol_of,
)

EDGE_COLOR = "#6d737c"
LABEL_COLOR = "#6d737c"
NO_GO_COLOR = "#c8452f"
GLASS_COLOR = "#a9d5ea"

CENTERED: dict[str, Any] = {"ha": "center", "va": "center"}
LABEL_PT = (2.6, 5.0)
# Width of a letter of the font, as a share of its size.
LETTER_WIDTH = 0.62
SWING = 12  # corners of the swing of a door
ROUND = 5  # corners of a quarter of a circle
CIRCLE = 24  # corners of an ellipse


def draw_objects(plan: FloorPlan, axes: Axes) -> None:
    """Draw furniture with its symbols, doorways, and no-go areas of robots, in metres."""
    shapes = [shape for item in plan.objects for shape in _shapes(item)]
    symbols = PolyCollection(
        [corners for corners, _, _ in shapes],
        facecolors=[fill or "none" for _, fill, _ in shapes],
        edgecolors=[edge or "none" for _, _, edge in shapes],
        linewidths=0.4,
        zorder=1.6,
    )
    axes.add_collection(symbols, autolim=False)
    _draw_glass(plan, axes)
    no_go: dict[str, Any] = {"facecolor": "none", "edgecolor": NO_GO_COLOR, "hatch": "////"}
    _fill(plan.no_go, axes, **no_go, linewidths=0.5, zorder=1.75)
    _draw_doorways(plan, axes)
    for number, portal in enumerate(plan.portals, 1):
        sign = {"stairs": "\N{UPWARDS ARROW FROM BAR}", "lift": "\N{UP DOWN ARROW}"}[portal.type]
        box = {"boxstyle": "square,pad=0.2", "fc": "white", "ec": DOOR_COLOR, "lw": 0.6}
        for at in (portal.start, portal.end):
            axes.text(*at, f"{sign}{number}", size=5, bbox=box, **CENTERED)


def _draw_glass(plan: FloorPlan, axes: Axes) -> None:
    """Draw the parts of walls that block bodies but not sight as glass."""
    panes = shapely.difference(list(plan.glass), shapely.MultiPolygon(plan.polygons))
    glass = areas_of(shapely.transform(panes, plan.lattice.to_metres))
    _fill(glass, axes, facecolor=GLASS_COLOR, linewidths=0.5, zorder=1.7)


def areas_of(geometry: Any) -> list[shapely.Polygon]:
    """Return the polygons among the parts of geometries, without lines and points."""
    return [part for part in shapely.get_parts(geometry) if part.geom_type == "Polygon"]


def _fill(polygons: Iterable[shapely.Polygon], axes: Axes, **style: Any) -> None:
    """Draw polygons without their holes, in metres."""
    outlines = [Outline(shapely.get_coordinates(each.exterior), closed=True) for each in polygons]
    axes.add_collection(PathCollection(outlines, **{"edgecolor": EDGE_COLOR, **style}))


def label_objects(plan: FloorPlan, axes: Axes) -> None:
    """Write the type of each object without a symbol on it, where it is large enough."""
    metre_pt = points_per_m(axes)
    drawn = symbol_names()
    for item in plan.objects:
        x0, y0, x1, y1 = item.footprint.bounds
        label = item.type.replace("_", " ")
        space = (x1 - x0) * metre_pt, (y1 - y0) * metre_pt
        size, rotation = _fit(space, LETTER_WIDTH * len(label), 1.2, LABEL_PT[1])
        if size < LABEL_PT[0] or item.type in drawn:
            continue
        middle = item.footprint.centroid
        style = {**CENTERED, "color": LABEL_COLOR, "rotation": rotation, "zorder": 4}
        axes.text(middle.x, middle.y, label, fontsize=size, **style)


def points_per_m(axes: Axes) -> float:
    """Return the size of a metre on axes [points]."""
    axes.apply_aspect()  # needed for the transform to pixels
    pixels = axes.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    return float(pixels[1, 0] - pixels[0, 0]) * 72 / axes.figure.dpi


def _fit(space: tuple[float, float], width: float, height: float, most: float) -> tuple[float, int]:
    """Return the size of a text that fits into a space [points], and its rotation [degrees].

    `width` and `height` are multiples of the size. The text is upright if it would be too small.
    """
    across, up = space
    flat = min(across / width, up / height)
    upright = min(up / width, across / height)
    is_upright = flat < min(upright, SMALL_PT)
    return min(upright if is_upright else flat, most), 90 * is_upright


def _shapes(item: PlacedObject) -> list[tuple[F64, str | None, str | None]]:
    """Return corners [m], fill and edge of the shapes of a piece, from the bottom to the top."""
    place = placed_symbol(item)
    if not place.is_box:
        return [(shapely.get_coordinates(item.footprint), OUTLINE_FILL, OUTLINE_EDGE)]
    shapes = []
    for shape in symbol_of(item.type, place.wide, place.deep):
        across, along = np.hsplit(_corners(shape), 2)
        corners = place.middle + across * place.right + along * place.forward
        shapes.append((corners, shape["fill"], shape["edge"]))
    return shapes


def _corners(shape: ShapeFacts) -> F64:
    """Return the corners of a shape of a symbol [m]: float64 (n, 2)."""
    x0, y0, x1, y1 = shape["at"]
    low = np.array([x0, y0])
    high = np.array([x1, y1])
    half = (high - low) / 2
    if shape["kind"] == "line":
        return np.stack([low, high])
    if shape["kind"] == "ellipse":
        turns = np.linspace(0, math.tau, CIRCLE, endpoint=False)
        return (low + high) / 2 + directions(turns) * half
    radius = min(shape["radius"], *half.tolist())
    turns = np.linspace(0, math.pi / 2, ROUND)
    centres = (
        (x1 - radius, y1 - radius),
        (x0 + radius, y1 - radius),
        (x0 + radius, y0 + radius),
        (x1 - radius, y0 + radius),
    )
    corners = [
        np.array(centre) + radius * directions(turns + quarter * math.pi / 2)
        for quarter, centre in enumerate(centres)
    ]
    return np.concatenate(corners)


def directions(angles: F64) -> F64:
    """Return the unit vectors of angles [rad]: float64 (..., 2)."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def _draw_doorways(plan: FloorPlan, axes: Axes) -> None:
    """Draw doors with their swing, as plans do, and openings without a door as dotted lines."""
    leaves = []
    swings = []
    openings = []
    for door in plan.doorways:
        if not door.leaf:
            openings.append(np.array([door.start, door.end]))
            continue
        corners = _swing_of(door)
        swings.append(corners[1:])
        leaves.append(corners[[0, -1]])
    style: dict[str, Any] = {"color": DOOR_COLOR, "zorder": 1.7}
    axes.add_collection(LineCollection(leaves, lw=1.2, **style))
    axes.add_collection(LineCollection(swings, lw=0.4, **style))
    axes.add_collection(LineCollection(openings, lw=0.9, ls=(0, (1, 2)), **style))


def _swing_of(door: Doorway) -> F64:
    """Return the floor over which a door swings: its hinge, then the arc, float64 (n, 2) [m]."""
    hinge, end = np.array([door.start, door.end])
    across = end - hinge
    left = np.array([-across[1], across[0]])
    angles = np.linspace(0, np.pi / 2, SWING)[:, None]
    arc = hinge + across * np.cos(angles) + left * np.sin(angles)
    return np.concatenate([[hinge], arc])


# Formats of pictures, each with the metadata that would differ from time to time.
DATE_METADATA = MappingProxyType({".png": "Software", ".svg": "Date", ".pdf": "CreationDate"})
SUFFIXES = tuple(DATE_METADATA)

# The offset of the shadow of walls to the right and down [m].
SHADOW_M = (0.07, 0.1)
SHADOW_COLOR = "#3c2d1938"
JOINT_COLOR = "#6b7680"
PLANK_LENGTH_M = 1.45
FINER = 4
MOST_PATTERNED_M2 = 2_500
LONG_SIDE_IN = 10.0
SHORT_SIDE_IN = 3.2
DPI = 150
MAX_FONT_PT = 9.0
MIN_FONT_PT = 3.5
SMALL_PT = 5.0
# The share of a room that its name may fill.
FILL = 0.9
# The middle of a room consists of cells with at least this share of its greatest squared depth.
MIDDLE_DEPTH = 0.9


def draw_floorplan(plan: FloorPlan, path: Path) -> None:
    """Draw a floor plan to a PNG, SVG or PDF file; the same plan gives the same bytes.

    Args:
        plan: The floor plan.
        path: The file, whose name ends with `.png`, `.svg` or `.pdf`. An existing file is replaced.

    Raises:
        InputError: The file name has another suffix, or the file can't be written.
    """
    with picture(path, *figure_size(plan)) as figure:
        floorplan_axes(plan, figure.add_axes((0, 0, 1, 1)))


def write_picture(path: Path, draw: Callable[[], Figure]) -> None:
    """Write the figure that a function draws in the style of Fleet2D to a file.

    Raises:
        InputError: The file name has another suffix, or the file can't be written.
    """
    check_picture(path)
    with drawing_style():
        save_figure(draw(), path)


@contextmanager
def picture(path: Path, width: float, height: float) -> Iterator[Figure]:
    """Yield a figure of a size [in] to draw on; it is written to a file when the block ends.

    Raises:
        InputError: The file name has another suffix, or the file can't be written.
    """
    check_picture(path)
    with drawing_style():
        figure = Figure(figsize=(width, height), dpi=DPI)
        yield figure
        save_figure(figure, path)


def check_picture(path: Path) -> None:
    """Check that a file has the suffix of a picture.

    Raises:
        InputError: The file has another suffix.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(
            f"{path}: a picture is written as .png, .svg or .pdf, not as {suffix or 'no suffix'!r}"
        )


@contextmanager
def drawing_style() -> Iterator[None]:
    """Draw in the style of Fleet2D, whatever the user's settings."""
    style = {**mpl.rcParamsDefault, "svg.hashsalt": "fleet2d", "font.family": _fonts()}
    style.pop("backend")
    with mpl.rc_context(style), _without_letter_warnings():
        yield


@contextmanager
def _without_letter_warnings() -> Iterator[None]:
    """Silence Matplotlib's warnings of single missing letters: `save_figure` warns of all."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        yield


# Fonts of systems with letters that DejaVu Sans lacks, for names in Chinese, Japanese and others.
OTHER_FONTS = (
    "Noto Sans CJK JP",
    "Noto Sans",
    "Arial Unicode MS",
    "Microsoft YaHei",
    "Malgun Gothic",
)


@cache
def _fonts() -> list[str]:
    """Return the fonts of pictures: letters that the first lacks are taken from the next."""
    installed = get_font_names()
    return ["DejaVu Sans", *(name for name in OTHER_FONTS if name in installed)]


def _letters_without_font(figure: Figure) -> str:
    """Return the letters of a figure's texts that none of the fonts has."""
    fonts = [get_font(findfont(name)) for name in _fonts()]
    texts = [text.get_text() for text in figure.findobj(Text)]
    letters = set("".join(texts)) - {"\n"}
    for font in fonts:
        letters -= {letter for letter in letters if font.get_char_index(ord(letter))}
    return "".join(sorted(letters))


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure without a date; readers see all of the file, or none.

    Raises:
        InputError: The file can't be written.
    """
    unstamped = {DATE_METADATA[path.suffix.lower()]: None}
    content = io.BytesIO()
    with _without_letter_warnings():
        figure.savefig(content, format=path.suffix[1:].lower(), metadata=unstamped)
    if letters := _letters_without_font(figure):
        warnings.warn(
            f"the fonts of this machine lack the letters {letters}, which {path} shows as boxes:"
            " install one that has them, such as Debian's fonts-noto-cjk",
            stacklevel=2,
        )
    with os_errors_as(InputError, f"can't write the picture {path}"):
        write_atomically(path, content.getvalue())


def figure_size(plan: FloorPlan) -> tuple[float, float]:
    """Return the width and height of a figure that the plan fills [in]."""
    x0, x1, y0, y1 = _limits(plan)
    width = x1 - x0
    height = y1 - y0
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
        for room, label in zip(plan.rooms, room_labels(plan.rooms), strict=True):
            _write_room(plan, room, label, empty, axes)
        label_objects(plan, axes)
    if title:
        rooms = counted(len(plan.rooms), "room")
        left, _, _, top = plan.bounds
        at = (left - WALL_M, top + 0.65 * _margin(plan))
        style: dict[str, Any] = {"va": "center", "color": TEXT_COLOR, "zorder": 5}
        text = f"{short_name(plan.name)}\n{plan.area_m2:,.1f} m² · {rooms}"
        axes.text(*at, text, fontsize=11, linespacing=1.4, **style)


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
    """Draw the walls: the free space enlarged by the thickness of a wall, under the free space.

    Their shadow falls into the rooms.
    """
    units = plan.lattice.units_per_m
    free = shapely.union_all(plan.polygons)
    solid = _with_walls(plan)
    walls = _outline(plan, shapely.get_parts(solid).tolist())
    style: dict[str, Any] = {"edgecolor": WALL_EDGE, "lw": 0.6}
    axes.add_patch(PathPatch(walls, facecolor=WALL_TOP, **style, zorder=0))
    right, down = SHADOW_M
    fallen = translate(shapely.difference(solid, free), right * units, -down * units)
    shade = areas_of(shapely.intersection(fallen, free))
    if shade:
        shadow = _outline(plan, shade)
        axes.add_patch(PathPatch(shadow, facecolor=SHADOW_COLOR, edgecolor="none", zorder=1.68))
    axes.add_patch(PathPatch(outline_of(plan), facecolor="none", **style, zorder=1.69))


def _with_walls(plan: FloorPlan) -> BaseGeometry:
    """Return the free space and the walls around it [lattice]."""
    thickness = WALL_M * plan.lattice.units_per_m
    # Steps of a few centimetres in traced outlines would look like notches in outer walls.
    smooth = shapely.simplify(shapely.union_all(plan.polygons), thickness / 5)
    return shapely.buffer(smooth, thickness, join_style="mitre")


def outline_of(plan: FloorPlan) -> Outline:
    """Return the outline of the free space [m]."""
    return _outline(plan, plan.polygons)


def walls_of(plan: FloorPlan) -> Outline:
    """Return the outline of the walls [m]."""
    walls = shapely.difference(_with_walls(plan), shapely.union_all(plan.polygons))
    return _outline(plan, shapely.get_parts(walls).tolist())


def _draw_rooms(plan: FloorPlan, axes: Axes) -> None:
    """Draw the floors of rooms as an image, clipped at the walls."""
    free_space = PathPatch(outline_of(plan), transform=axes.transData)
    image = draw_cells(plan, floor_image(plan), axes, interpolation="nearest", zorder=1)
    image.set_clip_path(free_space)


def floor_image(plan: FloorPlan) -> F64:
    """Return the floors of rooms, each of the material of its type: float64 (rows, columns, 3).

    Each cell has several pixels, or one in homes so large that patterns would be finer than a
    pixel.
    """
    finer = FINER if plan.area_m2 <= MOST_PATTERNED_M2 else 1
    rooms = np.kron(_spread(plan.room_of_cell), np.ones((finer, finer), np.int16))
    image = np.empty((*rooms.shape, 3))
    image[:] = to_rgb(ROOM_COLORS["unknown"])
    pixel = plan.lattice.cell / finer
    for room in plan.rooms:
        rows, columns = np.nonzero(rooms == room.index)
        if len(rows):
            x = (columns - columns.min() + 0.5) * pixel
            y = (rows - rows.min() + 0.5) * pixel
            image[rows, columns] = _floor_colors(room, x, y, patterned=finer > 1)
    return image


def _floor_colors(room: Room, x: F64, y: F64, *, patterned: bool) -> F64:
    """Return the colours of a floor at places [m] from its corner: float64 (n, 3)."""
    material, color, pitch = floor_of(room.type, room.index)
    colors = np.tile(to_rgb(color), (len(x), 1))
    if material in ("carpet", "plain") or not patterned:
        return colors
    if material == "tiles":
        column = x // pitch
        row = y // pitch
        paler = 0.45 * _noise(column, row)[:, None]
        colors += (1 - colors) * paler
        is_joint = (x % pitch < JOINT_M) | (y % pitch < JOINT_M)
        tile = np.array(to_rgb(color))
        joint = np.array(to_rgb(JOINT_COLOR))
        colors[is_joint] = 0.86 * tile + 0.14 * joint
        return colors
    along, across = (x, y) if np.ptp(x) > np.ptp(y) else (y, x)
    row = across // pitch
    begun = along + PLANK_LENGTH_M * _noise(row, np.full_like(row, 7.0))
    number = (len(WOOD) * _noise(row, begun // PLANK_LENGTH_M)).astype(np.int64)
    wood: F64 = np.array([to_rgb(each) for each in WOOD])[number]
    is_joint = (across % pitch < JOINT_M) | (begun % PLANK_LENGTH_M < JOINT_M)
    wood[is_joint] *= 0.96
    return wood


def _noise(one: F64, other: F64) -> F64:
    """Return numbers from 0 to below 1 that are the same for the same pair of whole numbers."""
    mixed = one.astype(np.int64) * 73_856_093 ^ other.astype(np.int64) * 19_349_663
    scattered: F64 = (mixed * 2_654_435_761 >> 7) % 1024 / 1024
    return scattered


def draw_cells(plan: FloorPlan, image: Any, axes: Axes, **style: Any) -> AxesImage:
    """Draw an image that has a pixel for each cell of a plan on axes in metres."""
    lattice = plan.lattice
    left, bottom = lattice.origin
    right = left + lattice.columns * lattice.cell
    top = bottom + lattice.rows * lattice.cell
    return axes.imshow(image, extent=(left, right, bottom, top), origin="lower", **style)


def _draw_borders(plan: FloorPlan, axes: Axes) -> None:
    """Draw a thin line where two rooms touch without a wall."""
    rooms = plan.room_of_cell
    lines = []
    for flip, grid in ((False, rooms), (True, rooms.T)):
        low = grid[:-1]
        high = grid[1:]
        meets = (low != high) & (low != NO_ROOM) & (high != NO_ROOM)
        changes = np.diff(meets.astype(np.int8), prepend=0, append=0)
        line, first = np.nonzero(changes == 1)
        _, end = np.nonzero(changes == -1)
        starts = np.stack([first, line + 1], axis=1)
        ends = np.stack([end, line + 1], axis=1)
        runs = np.stack([starts, ends], axis=1)
        lines.append(runs[..., ::-1] if flip else runs)
    corners = plan.lattice.to_metres(np.concatenate(lines) * UNITS_PER_CELL)
    style: dict[str, Any] = {"color": BORDER_COLOR, "ls": (0, (4, 3))}
    axes.add_collection(LineCollection(list(corners), lw=0.6, zorder=1.5, **style))


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
    rings = shapely.get_rings(shapely.orient_polygons(polygons))  # holes must turn the other way
    corners = [plan.lattice.to_metres(shapely.get_coordinates(ring)) for ring in rings]
    return Outline.make_compound_path(*(Outline(ring, closed=True) for ring in corners))


def _draw_scale(plan: FloorPlan, axes: Axes) -> None:
    """Draw a scale bar of a round length below the left corner of the plan."""
    x0, y0, x1, _ = plan.bounds
    length = next((m for m in (50, 20, 10, 5, 2) if m <= (x1 - x0) / 3), 1)
    margin = _margin(plan)
    half = length / 2
    bottom = y0 - 0.5 * margin
    for left, color in ((x0, TEXT_COLOR), (x0 + half, "white")):
        bar = Rectangle((left, bottom), half, 0.05 * margin, facecolor=color)
        bar.set(edgecolor=TEXT_COLOR, linewidth=0.8)
        axes.add_patch(bar)
    style: dict[str, Any] = {"ha": "center", "va": "top", "color": TEXT_COLOR, "zorder": 5}
    for metres, text in ((0.0, "0"), (half, f"{half:g}"), (length, f"{length} m")):
        axes.text(x0 + metres, y0 - scale_depth(plan), text, fontsize=8, **style)


def _draw_entrance(entrance: tuple[float, float], axes: Axes) -> None:
    axes.plot(*entrance, marker="^", markersize=9, color=ACCENT_COLOR, mec="white", zorder=1.9)
    style: dict[str, Any] = {"ha": "center", "va": "top", "color": ACCENT_COLOR, "fontsize": 6.5}
    axes.annotate("entrance", entrance, (0, -7), textcoords="offset points", zorder=5, **style)


def _empty_floor(plan: FloorPlan) -> I16:
    """Return the room of each cell without an object or the swing of a door, else -1.

    int16 (rows, columns).
    """
    empty = plan.room_of_cell.copy()
    areas = [item.footprint for item in plan.objects]
    areas += [shapely.Polygon(_swing_of(door)) for door in plan.doorways if door.leaf]
    for area in areas:
        window, covered = grown_cells(plan.lattice, area, 0.0)
        empty[window][covered] = NO_ROOM
    return empty


def _write_room(plan: FloorPlan, room: Room, label: str, empty: I16, axes: Axes) -> None:
    """Write the name and area of a room in the middle of its empty floor.

    The text is as large as fits, and upright in narrow rooms.
    """
    inside = empty == room.index
    if not inside.any():
        inside = plan.room_of_cell == room.index
    row, column = _middle(inside)
    across, up = _clear_lengths(plan.lattice.cell, inside, row, column)
    metre_pt = FILL * points_per_m(axes)
    space = across * metre_pt, up * metre_pt
    name_and_area = f"{label}\n{room.area_m2:,.1f} m²"
    for text in (name_and_area, label.replace(" ", "\n", 1), label.rpartition(" ")[2]):
        lines = text.split("\n")
        width = LETTER_WIDTH * max(map(len, lines))
        size, rotation = _fit(space, width, 1.5 * len(lines), MAX_FONT_PT)
        if size >= MIN_FONT_PT:
            x, y = plan.lattice.to_metres(plan.lattice.cell_centre(row, column)).tolist()
            style = {**CENTERED, "color": TEXT_COLOR, "rotation": rotation, "zorder": 5}
            axes.text(x, y, text, fontsize=size, **style)
            return


def _middle(cells: Bool) -> tuple[int, int]:
    """Return the (row, column) in the middle of the cells that are deepest inside."""
    rows, columns = np.nonzero(cells)
    top = int(rows.min())
    left = int(columns.min())
    window = cells[top : rows.max() + 1, left : columns.max() + 1]  # the rest costs time
    depth = squared_distance(np.pad(window, 1))[rows - top + 1, columns - left + 1]
    is_deep = depth >= MIDDLE_DEPTH * depth.max()
    rows = rows[is_deep]
    columns = columns[is_deep]
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


COLORS = MappingProxyType({"unlivable": "#8b1a1a", "wrong": "#c8452f", "odd": "#d08a1d"})
LINE_IN = 0.17
LETTERS_PER_IN = 13


def draw_checkup(plan: FloorPlan, findings: Sequence[Finding], path: Path) -> None:
    """Draw a floor plan with its findings to a PNG or SVG file.

    Args:
        plan: The home.
        findings: Its findings, which are numbered from 1.
        path: The file, whose name ends with `.png`, `.svg` or `.pdf`. An existing file is replaced.

    Raises:
        InputError: The file name has another suffix, or the file can't be written.
    """
    width, height = figure_size(plan)
    lines = _lines(findings, int(width * LETTERS_PER_IN))
    below = LINE_IN * (len(lines) + 2)
    whole = height + below
    with picture(path, width, whole) as figure:
        axes = figure.add_axes((0, below / whole, 1, height / whole))
        floorplan_axes(plan, axes)
        for number, finding in enumerate(findings, start=1):
            _mark(axes, number, finding)
        for row, (text, color) in enumerate(lines):
            y = (below - LINE_IN * (row + 1)) / whole
            figure.text(0.03, y, text, fontsize=8, color=color, va="center")


def _lines(findings: Sequence[Finding], letters: int) -> list[tuple[str, str]]:
    """Return the findings as numbered lines of text, each with its colour."""
    if not findings:
        return [("nothing wrong or odd was found", TEXT_COLOR)]
    lines = []
    for number, finding in enumerate(findings, start=1):
        first, *others = textwrap.wrap(finding.text, letters)
        texts = [f"{number:>3}  {first}", *(f"     {line}" for line in others)]
        lines += [(text, COLORS[finding.severity]) for text in texts]
    return lines


def _mark(axes: Axes, number: int, finding: Finding) -> None:
    color = COLORS[finding.severity]
    for line in _outlines(finding.shape):
        axes.plot(line[:, 0], line[:, 1], color=color, lw=1.2, zorder=5.5)
    if finding.at is not None:
        box = {"boxstyle": "circle,pad=0.25", "facecolor": color, "edgecolor": "white", "lw": 0.8}
        style = {**CENTERED, "color": "white", "zorder": 6}
        axes.text(*finding.at, str(number), fontsize=7, bbox=box, **style)


def _outlines(shape: BaseGeometry | None) -> list[F64]:
    parts = shapely.get_parts(shape)
    is_area = shapely.get_dimensions(parts) == 2
    lines = [*shapely.get_rings(parts[is_area]), *parts[~is_area]]
    return [shapely.get_coordinates(line) for line in lines]
