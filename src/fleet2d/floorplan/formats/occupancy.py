"""Grey pictures of floors, and the free space in them: read, cleaned of noise, traced."""

import io
import math
import re
import warnings
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field
from shapely import Polygon

from fleet2d.bounds import PICTURE_BYTES, PIXELS, read_bytes
from fleet2d.configuration.units import InputPath, Length
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.lattice import MIN_CELL_M
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.floorplan.source import PixelSource
from fleet2d.kernels import F64, Bool
from fleet2d.kernels.space import count_steps, label_parts, squared_distance, trace_rings

MAX_SIDE = 2**15
"""Pixels along a side of a picture: each step in cleaning it needs further rows round it."""

_PNG = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {2: 3, 4: 2, 6: 4}  # by colour type; 1 for the others
# Three numbers, each after white space and comments; then one white space.
_PGM_HEADER = re.compile(
    rb"P([25])" + rb"(?:\s|#[^\r\n]*[\r\n])+(\d{1,9})" * 3 + rb"(?:#[^\r\n]*)?\s"
)
_SPACE = re.compile(rb"\s")
_PIECE = 1 << 18  # bytes that are split into words at once
_PGM_COMMENT = re.compile(rb"#[^\r\n]*")


@dataclass(frozen=True)
class GreyPicture:
    """A picture in shades of grey.

    Attributes:
        values: Shades, uint8 or uint16 (rows, columns), the first row on top.
        white: The value of white; black is 0.
        clear: Pixels that are not fully opaque, bool (rows, columns), or None if all are.
    """

    values: NDArray[np.integer[Any]]
    white: int
    clear: Bool | None = None


def read_grey(path: Path) -> GreyPicture:
    """Read a PGM (P2 or P5, 8 or 16 bits) or PNG file, by its content.

    Raises:
        FloorPlanError: It can't be read, is damaged, too large or of another kind, or is a PNG and
            Pillow is not installed.
    """
    try:
        content = read_bytes(path, PICTURE_BYTES, FloorPlanError)
    except OSError as error:
        raise FloorPlanError(f"the image {path} can't be read: {error.strerror}") from None
    try:
        if content.startswith((b"P2", b"P5")):
            return _read_pgm(content)
        if content.startswith(_PNG):
            return _read_png(content)
    except FloorPlanError as error:
        raise FloorPlanError(f"the image {path} {error}") from error
    raise FloorPlanError(
        f"the image {path} is neither PGM (P2, P5) nor PNG: convert it to one of them"
    )


# --- PGM ---------------------------------------------------------------------------------------


def _read_pgm(content: bytes) -> GreyPicture:
    header = _PGM_HEADER.match(content)
    if header is None:
        raise FloorPlanError("has no PGM header: width, height and white are missing")
    columns, rows, white = (int(number) for number in header.groups()[1:])
    _check_size(columns, rows)
    if not 0 < white < 65536:
        raise FloorPlanError(f"has {white} for white: PGM allows 1 to 65535")
    body = content[header.end() :]
    if header[1] == b"2":
        values = _plain_values(body, columns, rows)
    else:
        values = _packed_values(body, columns, rows, 1 if white < 256 else 2)
    if values.max() > white:
        raise FloorPlanError(f"has a pixel of {values.max()}, above its white, {white}")
    picture = values.reshape(rows, columns)
    return GreyPicture(picture.astype(np.uint8 if white < 256 else np.uint16), white)


def _packed_values(body: bytes, columns: int, rows: int, depth: int) -> NDArray[np.integer[Any]]:
    expected = columns * rows * depth
    # Some writers end the file with a line break; anything more means that the size is wrong.
    if len(body) < expected or body[expected:].strip():
        _refuse_count(len(body) / depth, columns, rows)
    return np.frombuffer(body[:expected], np.uint8 if depth == 1 else ">u2")


def _plain_values(body: bytes, columns: int, rows: int) -> NDArray[np.integer[Any]]:
    values, count = np.empty(columns * rows, np.int64), 0
    for words in _in_pieces(_PGM_COMMENT.sub(b"", body)):
        wrong = next((word for word in words if not word.isdigit() or len(word) > 9), None)
        if wrong is not None:
            text = wrong[:20].decode("latin-1")
            raise FloorPlanError(f"has the pixel {text!r}: not a whole number")
        fitting = words[: len(values) - count]
        values[count : count + len(fitting)] = np.array(fitting, "S9").astype(np.int64)
        count += len(words)
    if count != len(values):
        _refuse_count(count, columns, rows)
    return values


def _in_pieces(text: bytes) -> Iterator[list[bytes]]:
    """Yield the words of a text in pieces, since all of them could fill the memory."""
    begin = 0
    while begin < len(text):
        space = _SPACE.search(text, begin + _PIECE)
        end = space.start() if space else len(text)
        yield text[begin:end].split()
        begin = end


def _refuse_count(count: float, columns: int, rows: int) -> None:
    what = "it is cut off" if count < columns * rows else "its header is wrong"
    raise FloorPlanError(
        f"holds {count:.0f} pixels, but its header says {columns} x {rows} = {columns * rows}:"
        f" {what}"
    )


def _check_size(columns: int, rows: int) -> None:
    if columns * rows == 0:
        raise FloorPlanError(f"is {columns} x {rows} pixels: it is empty")
    PIXELS.check(columns * rows, f"is {columns} x {rows}: it", FloorPlanError)
    if max(columns, rows) > MAX_SIDE:
        raise FloorPlanError(f"is {columns} x {rows} pixels: at most {MAX_SIDE} a side are read")


# --- PNG ---------------------------------------------------------------------------------------


def _read_png(content: bytes) -> GreyPicture:
    try:
        from PIL import Image
    except ImportError:
        raise FloorPlanError(
            'is PNG, which only Pillow can read: pip install "fleet2d[viz]", or convert the'
            " image to PGM"
        ) from None
    if len(content) >= 24:  # else it is cut off, as Pillow says
        _check_size(*(int.from_bytes(content[at : at + 4], "big") for at in (16, 20)))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # see _check_size
            picture = Image.open(io.BytesIO(content), formats=["PNG"])
        _check_size(*picture.size)
        _check_rows(content)
        if picture.mode.startswith("I"):  # 16 bits, grey only
            return GreyPicture(np.asarray(picture).astype(np.uint16), 65535)
        channels = np.asarray(picture.convert("RGBA"))
    except Image.DecompressionBombError as error:
        raise FloorPlanError(f"is too large: {error}") from error
    except (OSError, SyntaxError, ValueError, zlib.error) as error:
        raise FloorPlanError(f"is a damaged PNG: {error}") from error
    # The mean of the colours, times three to keep it whole.
    shades = channels[..., :3].sum(axis=-1, dtype=np.uint16)
    clear = channels[..., 3] < 255
    return GreyPicture(shades, 3 * 255, clear if clear.any() else None)


def _check_rows(content: bytes) -> None:
    """Refuse a PNG with fewer rows than its header says, which Pillow would fill with black.

    Raises:
        FloorPlanError: There are too few rows.
        zlib.error: The data can't be unpacked.
    """
    width, height = (int.from_bytes(content[at : at + 4], "big") for at in (16, 20))
    bits, colours, interlaced = content[24], content[25], content[28]
    if interlaced:
        return
    row = 1 + (width * bits * _CHANNELS.get(colours, 1) + 7) // 8
    packed, at = [], len(_PNG)
    while at + 8 <= len(content):
        length = int.from_bytes(content[at : at + 4], "big")
        if content[at + 4 : at + 8] == b"IDAT":
            packed.append(content[at + 8 : at + 8 + length])
        at += 12 + length
    rows = len(zlib.decompressobj().decompress(b"".join(packed), height * row)) // row
    if rows < height:
        raise FloorPlanError(f"holds {rows} rows, but its header says {height}: it is cut off")


# Tolerance of decimal lengths in pixels: 0.3 m are six pixels of 0.05 m, and not 5.999….
TINY = 1e-9


class OccupancySource(PixelSource):
    """A source of a floor plan made of free, occupied and unknown pixels; see `free_space`.

    Attributes:
        speck_area_m2: Groups of pixels smaller than this with free ones all round, such as the legs
            of a chair or lettering, become free; 0 keeps all.
        ray_width: Free space narrower than this doesn't lead on: it cuts off rays through windows
            and gaps in walls; 0 keeps all that is connected.
        path: The file.
    """

    speck_area_m2: float = Field(default=0.02, ge=0)
    ray_width: Length = Field(default=0.3, ge=0)

    path: InputPath

    def free_space(self, raw: "OccupancyMap", notes: list[str]) -> Polygon:
        """Return the home in a map [m], and add a note for each change; see `free_space`."""
        free, changes = free_space(raw, speck_area_m2=self.speck_area_m2, ray_width=self.ray_width)
        notes += changes
        return free

    def build(self, free: Polygon, pixel: float, source: str, notes: list[str]) -> FloorPlan:
        """Return the floor plan of free space [m] whose rooms and doorways the walls determine."""
        return FloorPlan.build(
            self.path.stem,
            free,
            cell=max(pixel, MIN_CELL_M) if self.cell is None else self.cell,
            source=source,
            doorways=None,
            regions_are="none",
            notes=notes,
        )


@dataclass(frozen=True)
class OccupancyMap:
    """A robot's map of a floor in pixels; pixels in neither mask are unknown.

    Attributes:
        free: Pixels known to be free, bool (rows, columns), the first row at the bottom.
        occupied: Pixels known to be occupied, of the same shape.
        pixel: Side of a pixel [m].
        origin: Where the lower left corner of the first pixel is (x, y) [m].
        turn: Cosine and sine of the angle from the x axis to the rows, counter-clockwise.
    """

    free: Bool
    occupied: Bool
    pixel: float
    origin: tuple[float, float] = (0.0, 0.0)
    turn: tuple[float, float] = (1.0, 0.0)

    def to_metres(self, xy: F64) -> F64:
        """Return places (column, row) from the lower left corner in metres (…, 2)."""
        cosine, sine = self.turn
        x, y = xy[..., 0] * self.pixel, xy[..., 1] * self.pixel
        turned = np.stack([x * cosine - y * sine, x * sine + y * cosine], axis=-1)
        return turned + np.array(self.origin)

    def crop(self) -> "OccupancyMap":
        """Return the part around the free pixels, with a margin of one pixel if the map has it."""
        rows, columns = (np.flatnonzero(self.free.any(axis=axis)) for axis in (1, 0))
        low = (max(int(columns[0]) - 1, 0), max(int(rows[0]) - 1, 0))
        window = (slice(low[1], int(rows[-1]) + 2), slice(low[0], int(columns[-1]) + 2))
        x, y = self.to_metres(np.array(low, np.float64)).tolist()
        # The kernels are compiled for this memory order.
        free, occupied = (np.ascontiguousarray(m[window]) for m in (self.free, self.occupied))
        return replace(self, free=free, occupied=occupied, origin=(x, y))


def free_space(
    raw: OccupancyMap, *, speck_area_m2: float, ray_width: float
) -> tuple[Polygon, list[str]]:
    """Return the home in an occupancy map, without noise, specks and rays.

    1. A group of pixels that are not free, surrounded by free ones and smaller than
       `speck_area_m2`, becomes free.
    2. Of the space that a disc of diameter `ray_width` reaches, the largest connected part is the
       home.
    3. Narrower space around it belongs to the home if all of it is within `ray_width` of the space
       that the disc reaches; if it leads further, only the part within half of that.

    Everything else is wall. The diameter of the disc is an odd number of pixels, so that all sides
    are treated alike: `ray_width` is rounded down to that.

    Args:
        raw: The map.
        speck_area_m2: Groups smaller than this are specks [m²]; 0 keeps all.
        ray_width: Diameter of the disc [m]; up to a pixel cuts nothing that is connected.

    Returns:
        The free space [m], with all walls on sides of pixels, and a note for each change.

    Raises:
        FloorPlanError: No space is free, or none is wide enough.
    """
    if not raw.free.any():
        raise FloorPlanError("no pixel is free: check negate, free_thresh and occupied_thresh")
    raw = raw.crop()
    specks, notes = _specks(raw, speck_area_m2)
    free = raw.free | specks
    home = _home(free, raw.pixel, ray_width)
    notes += _left_out(raw, free, home, ray_width)
    notes += _open_border(raw, home)
    return shapely.transform(outline(home), raw.to_metres), notes


def outline(free: Bool) -> Polygon:
    """Return the exact outline of pixels that are connected across sides.

    Args:
        free: bool (rows, columns).

    Returns:
        A polygon with holes; x in columns and y in rows, whole numbers.

    >>> outline(np.array([[True, True], [True, False]])).wkt
    'POLYGON ((0 0, 2 0, 2 1, 1 1, 1 2, 0 2, 0 0))'
    """
    corners, starts = trace_rings(free)
    ring_of_corner = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    rings = np.asarray(shapely.linearrings(corners.astype(np.float64), indices=ring_of_corner))
    outer = np.asarray(shapely.is_ccw(rings))
    (shell,) = rings[outer]
    return Polygon(shell, rings[~outer].tolist())


def _specks(raw: OccupancyMap, speck_area_m2: float) -> tuple[Bool, list[str]]:
    """Return the pixels of small groups that are surrounded by free ones, and a note."""
    # A margin around the map joins all groups that reach its edge.
    part = label_parts(~np.pad(raw.free, 1), True)[1:-1, 1:-1]
    sizes = np.bincount(part[~raw.free], minlength=1)
    small = (sizes > 0) & (sizes * raw.pixel**2 < speck_area_m2 - TINY)
    small[0] = False  # the part of the margin, which comes first
    area = float(sizes[small].sum()) * raw.pixel**2
    specks: Bool = ~raw.free & small[part]
    if not small.any():
        return specks, []
    return specks, [
        f"specks removed: {np.count_nonzero(small)} groups of pixels that are not free, each under"
        f" {speck_area_m2:g} m2 and with free space all round, are free now ({area:.2f} m2 in all)"
    ]


def _home(free: Bool, pixel: float, ray_width: float) -> Bool:
    """Return the pixels of the largest part that a disc reaches, and of what belongs to it."""
    across = math.floor(ray_width / pixel + TINY)
    reach = max((across + 1) // 2, 1)  # the disc covers what is nearer than this to its centre
    core = squared_distance(np.pad(free, 1))[1:-1, 1:-1] >= reach**2
    if not core.any():
        raise FloorPlanError(
            f"the free space is nowhere {ray_width:g} m wide: check the resolution, or set"
            " floorplan.ray_width lower"
        )
    part = label_parts(core, False)
    opened = squared_distance(part != np.argmax(np.bincount(part[core]))) < reach**2
    steps = count_steps(opened, free)
    narrow = steps > 0
    part = label_parts(narrow, False)
    depth = np.zeros(int(part.max()) + 2, np.int32)  # its last entry serves -1
    np.maximum.at(depth, part[narrow], steps[narrow])
    leads_on = depth > across
    return (steps >= 0) & (~leads_on[part] | (steps < reach))


def _left_out(raw: OccupancyMap, free: Bool, home: Bool, ray_width: float) -> list[str]:
    """Return notes on free space outside the home: joined by narrow passages, or not at all."""
    notes = []
    joined = count_steps(home, free) >= 0
    for mask, reason in (
        (joined & ~home, f"only passages narrower than {ray_width:g} m join"),
        (free & ~joined, "nothing joins"),
    ):
        if mask.any():
            part = label_parts(mask, False)
            sizes = np.bincount(part[mask])
            largest = part == np.argmax(sizes)
            middle = np.argwhere(largest)[:, ::-1].mean(axis=0) + 0.5
            x, y = raw.to_metres(middle).tolist()
            area, most = (float(n) * raw.pixel**2 for n in (sizes.sum(), sizes.max()))
            notes.append(
                f"left out: {area:.2f} m2 of free space, in pieces: {len(sizes)}, that {reason} to"
                f" the rest; the largest, {most:.2f} m2, is round ({x:.2f}, {y:.2f}) m"
            )
    return notes


def _open_border(raw: OccupancyMap, home: Bool) -> list[str]:
    """Return notes on the parts of the outline where the map ends without an obstacle."""
    notes = []
    inside, unknown = np.pad(home, 1), np.pad(~raw.free & ~raw.occupied, 1)
    neighbors = [np.roll(unknown, shift, axis) for axis in (0, 1) for shift in (1, -1)]
    sides = sum(int(np.count_nonzero(inside & beside)) for beside in neighbors)
    if sides:
        notes.append(
            f"{sides * raw.pixel:.2f} m of the walls are where free space meets unknown, without an"
            " obstacle"
        )
    edges = (home[0], home[-1], home[:, 0], home[:, -1])
    at_edge = sum(int(np.count_nonzero(edge)) for edge in edges)
    if at_edge:
        notes.append(
            f"the free space reaches the edge of the image along {at_edge * raw.pixel:.2f} m, which"
            " is taken for a wall"
        )
    return notes
