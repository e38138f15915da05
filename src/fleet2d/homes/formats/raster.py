"""Pictures of floors in shades of grey: PGM, PNG and JPEG files."""

import io
import re
import warnings
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fleet2d.bounds import PIXELS
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.foreign import foreign_file
from fleet2d.floorplan.source import UnclearPlaceError
from fleet2d.kernels import U8, Bool

MAX_SIDE = 2**15
"""Pixels along a side of a picture: each step in cleaning it needs further rows round it."""
# A shade of at least this share of the light pixels, this many times as frequent as those two
# shades beside it, and by this much darker than the floor is that of furniture or of walls.
FILLED_SHARE = 0.02
FILLED_PEAK = 4
FILLED_CONTRAST = 12

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8\xff"
_CHANNELS = {2: 3, 4: 2, 6: 4}  # by colour type; 1 for the others
# Three numbers, each after white space and comments; then one white space.
_PGM_HEADER = re.compile(
    rb"P([25])" + rb"(?:\s|#[^\r\n]*[\r\n])+(\d{1,9})" * 3 + rb"(?:#[^\r\n]*)?\s"
)
_SPACE = re.compile(rb"\s")
_PIECE = 1 << 18  # bytes that are split into words at once
_PGM_COMMENT = re.compile(rb"#[^\r\n]*")


@dataclass(frozen=True, eq=False)
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

    @cached_property
    def greys(self) -> U8:
        """The shades from 0, black, to 255, white, uint8 (rows, columns)."""
        shades = (np.arange(self.white + 1) * 255 + self.white // 2) // self.white
        return shades.astype(np.uint8)[self.values]

    def edge_grey(self, spread: int = 0) -> tuple[int, float]:
        """Return the most frequent shade along the edge of the picture, and its share of it.

        Args:
            spread: Shades that differ by at most so much count for the share, too.
        """
        greys = self.greys
        edge = np.concatenate([greys[0], greys[-1], greys[1:-1, 0], greys[1:-1, -1]])
        grey = int(np.bincount(edge, minlength=256).argmax())
        return grey, float(np.mean((edge >= grey - spread) & (edge <= grey + spread)))

    def share(self, grey: int) -> float:
        """Return the share of the picture that has a shade."""
        return float(np.count_nonzero(self.greys == grey) / self.greys.size)

    def filled_greys(self, light: Bool) -> list[int]:
        """Return shades of light pixels that something else than the floor is filled with.

        A map of probabilities has all shades below that of the floor.
        """
        counts = np.bincount(self.greys[light], minlength=256)
        beside = np.maximum(np.roll(counts, 2), np.roll(counts, -2))
        is_filled = (counts >= FILLED_SHARE * counts.sum()) & (counts > FILLED_PEAK * beside)
        return np.flatnonzero(is_filled[: counts.argmax() - FILLED_CONTRAST]).tolist()


class UnclearPixelError(UnclearPlaceError):
    """A picture is no home because of one place in it.

    Attributes:
        place: The place (column, row) [pixels].
        radius: Radius of what is unclear [pixels].
    """

    def __init__(self, message: str, place: tuple[int, int], radius: float) -> None:
        super().__init__(message)
        self.place, self.radius = place, radius

    def mark(self, picture: Path, out: Path) -> None:
        """Write a copy of a picture with a red circle round the place; needs Pillow."""
        from PIL import Image, ImageDraw

        with Image.open(picture) as image:
            copy = image.convert("RGB")
        (column, row), radius = self.place, max(self.radius, max(copy.size) / 30)
        box = (column - radius, row - radius, column + radius, row + radius)
        ImageDraw.Draw(copy).ellipse(box, outline="red", width=max(max(copy.size) // 200, 2))
        copy.save(out)


def grey_picture(content: bytes, path: Path) -> GreyPicture:
    """Return the picture in a PGM (P2 or P5, 8 or 16 bits), PNG or JPEG file, by its content.

    Raises:
        FloorPlanError: It can't be read, is damaged, too large or of another kind, or is PNG or
            JPEG and Pillow is not installed.
    """
    try:
        if content.startswith((b"P2", b"P5")):
            return _read_pgm(content)
        if content.startswith(_PNG):
            return _read_by_pillow(content, "PNG")
        if content.startswith(_JPEG):
            return _read_by_pillow(content, "JPEG")
    except FloorPlanError as error:
        raise FloorPlanError(f"the image {path} {error}") from error
    said = foreign_file(content[:65536])
    if said is not None:
        raise FloorPlanError(f"the image {path} {said}")
    raise FloorPlanError(
        f"the image {path} is neither PGM (P2, P5), PNG nor JPEG: convert it to one of them"
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
    values = np.empty(columns * rows, np.int64)
    count = 0
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


def _read_by_pillow(content: bytes, kind: str) -> GreyPicture:
    """Read a PNG or JPEG picture, the mean of its colours."""
    try:
        from PIL import Image, ImageOps
    except ImportError:
        raise FloorPlanError(
            f'is {kind}, which only Pillow can read: pip install "fleet2d[viz]", or convert the'
            " image to PGM"
        ) from None
    try:
        if kind == "PNG" and len(content) >= 24:  # else it is cut off, as Pillow says
            _check_size(*_png_size(content))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # see _check_size
            picture = Image.open(io.BytesIO(content), formats=[kind])
        _check_size(*picture.size)
        if kind == "PNG":
            _check_rows(content)
        if picture.mode.startswith("I"):  # 16 bits, grey only
            return GreyPicture(np.asarray(picture).astype(np.uint16), 65535)
        channels = np.asarray(ImageOps.exif_transpose(picture).convert("RGBA"))
    except Image.DecompressionBombError as error:
        raise FloorPlanError(f"is too large: {error}") from error
    except (OSError, SyntaxError, ValueError, zlib.error) as error:
        raise FloorPlanError(f"is a damaged {kind}: {error}") from error
    # The mean of the colours, times three to keep it whole.
    shades = channels[..., :3].sum(axis=-1, dtype=np.uint16)
    clear = channels[..., 3] < 255
    return GreyPicture(shades, 3 * 255, clear if clear.any() else None)


def _png_size(content: bytes) -> tuple[int, int]:
    return int.from_bytes(content[16:20], "big"), int.from_bytes(content[20:24], "big")


def _check_rows(content: bytes) -> None:
    """Refuse a PNG with fewer rows than its header says, which Pillow would fill with black.

    Raises:
        FloorPlanError: There are too few rows.
        zlib.error: The data can't be unpacked.
    """
    width, height = _png_size(content)
    bits = content[24]
    colours = content[25]
    interlaced = content[28]
    if interlaced:
        return
    row = 1 + (width * bits * _CHANNELS.get(colours, 1) + 7) // 8
    packed = []
    at = len(_PNG)
    while at + 8 <= len(content):
        length = int.from_bytes(content[at : at + 4], "big")
        if content[at + 4 : at + 8] == b"IDAT":
            packed.append(content[at + 8 : at + 8 + length])
        at += 12 + length
    rows = len(zlib.decompressobj().decompress(b"".join(packed), height * row)) // row
    if rows < height:
        raise FloorPlanError(f"holds {rows} rows, but its header says {height}: it is cut off")
