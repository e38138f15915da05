"""The walls in a drawing, told from thin lines: text, dimensions, doors, windows and furniture.

Walls are what is drawn thick, what is filled with grey, or what thin lines enclose narrowly, as
hatched walls are. Between two ends of walls is a doorway or, where a line joins them, a window.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fleet2d.homes.formats.raster import GreyPicture
from fleet2d.kernels import I32, I64, Bool, label_frames, label_parts, squared_distance

LINE_M = 0.06
"""What is drawn thinner than this is no wall [m]."""

# Width of the widest wall, and of the widest gap without and with a line through it [m].
WALL_M = 0.6
DOOR_M = 1.4
WINDOW_M = 5.0
# Walls drawn by lines are at most so wide inside; a group of lines that is smaller, and joined to
# no wall, is lettering or furniture [m].
HOLLOW_M = 0.45
LONE_M = 3.0
# At least half of the walls is this many times as thick as a line.
TYPICAL_WALL = 2
# A frame lies within this share of the sides of what is drawn.
FRAME_SHARE = 0.03
# Sides of a gap in two rows may differ by this [m].
RAGGED_M = 0.03
# Share of a row in a gap that is drawn if a line joins both sides.
JOINED_SHARE = 0.9
# Walls are darker than the paper by this much, and a grey that fills something is spread over so
# many shades on each side, which together have this share of what is light.
CONTRAST = 24
SPREAD = 4
FILLED_SHARE = 0.01


@dataclass(frozen=True)
class WallGap:
    """A gap between two ends of walls: (first row, first column, row after, column after)."""

    box: tuple[int, int, int, int]
    is_window: bool

    @property
    def window(self) -> tuple[slice, slice]:
        """The pixels of it as an index."""
        top, left, bottom, right = self.box
        return slice(top, bottom), slice(left, right)

    @property
    def surrounding(self) -> tuple[slice, slice]:
        """Its pixels and those beside it as an index."""
        top, left, bottom, right = self.box
        return slice(max(top - 1, 0), bottom + 1), slice(max(left - 1, 0), right + 1)


def wall_candidates(
    picture: GreyPicture, dark: Bool, line: float, pixel: float
) -> Iterator[tuple[str, Bool]]:
    """Yield what may be the walls of a drawing, the likeliest first, each with what they are.

    Args:
        picture: The drawing.
        dark: Pixels that are dark, bool (rows, columns).
        line: Width of the widest line that is no wall [m].
        pixel: Side of a pixel [m].
    """
    least = max(round(line / pixel), 2)
    thick = _thick(dark, least)
    inner = without_frame(thick)
    if inner is not None:
        yield "are drawn thick, in a frame", inner
    yield "are drawn thick", thick
    for grey, lightest in _fills(picture, ~dark):
        walls = dark | (picture.greys <= lightest)
        yield f"are filled with grey {grey}", _thick(walls, least)
    hollow = _thick(dark | _narrow(~dark, HOLLOW_M / pixel), least)
    part = label_parts(hollow, True)
    yield "are drawn by lines", hollow & ~_small_parts(part, LONE_M / pixel)[part]


def without_frame(walls: Bool) -> Bool | None:
    """Return the walls without a thick frame around all others; None if there is no frame."""
    rows, columns = (np.flatnonzero(walls.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return None
    box = walls[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    part = label_parts(np.ascontiguousarray(box), True)
    frame = part == part[0].max()  # of the first row
    high, wide = (max(round(FRAME_SHARE * side), 1) for side in box.shape)
    sides = (frame[0], frame[-1], frame[:, 0], frame[:, -1])
    is_around = all(side.any() for side in sides)
    if not is_around or frame[high:-high, wide:-wide].any() or frame[box].all():
        return None
    inner = walls.copy()
    inner[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] &= ~frame
    return inner


def told_apart(walls: Bool, line: float, pixel: float) -> bool:
    """Return whether walls are clearly thicker than lines [m], other than in a scan."""
    thicker = _thick(walls, math.ceil(TYPICAL_WALL * line / pixel))
    return bool(np.count_nonzero(thicker) >= max(np.count_nonzero(walls) / 2, 1))


def find_gaps(walls: Bool, dark: Bool, pixel: float) -> list[WallGap]:
    """Return the doorways and windows in walls that run along the sides of the picture.

    Args:
        walls: Pixels of walls, bool (rows, columns).
        dark: All pixels that are drawn, of the same shape.
        pixel: Side of a pixel [m].
    """
    turned = _row_gaps(np.ascontiguousarray(walls.T), np.ascontiguousarray(dark.T), pixel)
    return [
        *(WallGap(box, is_window) for box, is_window in _row_gaps(walls, dark, pixel)),
        *(WallGap((x0, y0, x1, y1), is_window) for (y0, x0, y1, x1), is_window in turned),
    ]


def _row_gaps(
    walls: Bool, dark: Bool, pixel: float
) -> Iterator[tuple[tuple[int, int, int, int], bool]]:
    """Yield the gaps along rows: rows with the same two sides, as many as a wall is thick."""
    rows, starts, ends = _runs(walls, WINDOW_M / pixel)
    drawn = np.pad(dark.cumsum(axis=1), ((0, 0), (1, 0)))
    joined = drawn[rows, ends] - drawn[rows, starts] >= JOINED_SHARE * (ends - starts)
    ragged = max(round(RAGGED_M / pixel), 1)
    thickest = WALL_M / pixel
    door = DOOR_M / pixel
    groups: list[list[int]] = []  # first row, start, end, last row, is joined
    recent: list[list[int]] = []  # those that the present row may continue
    row_before = -1
    runs = zip(rows.tolist(), starts.tolist(), ends.tolist(), joined.tolist(), strict=True)
    for row, start, end, is_joined in runs:
        if row != row_before:
            recent = [group for group in recent if group[3] >= row - 1]
            row_before = row
        for group in recent:
            is_beside = abs(group[1] - start) <= ragged and abs(group[2] - end) <= ragged
            if group[3] == row - 1 and is_beside:
                group[3], group[4] = row, group[4] | is_joined
                break
        else:
            recent.append([row, start, end, row, is_joined])
            groups.append(recent[-1])
    for top, left, right, last, is_window in groups:
        height = last + 1 - top
        width = right - left
        if 2 <= height <= thickest and (is_window or width <= door) and width > ragged:
            yield (top, left, last + 1, right), bool(is_window)


def _runs(walls: Bool, longest: float) -> tuple[I64, I64, I64]:
    """Return the row, first column and column after of the runs between walls, in order."""
    change = np.diff(walls.astype(np.int8), axis=1)
    rows, columns = np.nonzero(change)
    opens = change[rows, columns] < 0
    follows = opens[:-1] & ~opens[1:] & (rows[:-1] == rows[1:])
    index = np.flatnonzero(follows)
    starts = columns[index] + 1
    ends = columns[index + 1] + 1
    short = ends - starts <= longest
    return rows[index][short], starts[short], ends[short]


def _fills(picture: GreyPicture, light: Bool) -> Iterator[tuple[int, int]]:
    """Yield the greys that something light is filled with, and the lightest shade of each."""
    counts = np.bincount(picture.greys[light], minlength=256)
    paper = int(counts.argmax())
    sums = np.convolve(counts, np.ones(2 * SPREAD + 1, np.int64), "same")
    for grey in range(max(paper - CONTRAST, 0)):
        around = sums[max(grey - SPREAD, 0) : grey + SPREAD + 1]
        if sums[grey] >= FILLED_SHARE * counts.sum() and sums[grey] == around.max():
            yield grey, (grey + paper) // 2


def _thick(mask: Bool, least: int) -> Bool:
    """Return the pixels that a square of some pixels covers which fits into the mask."""
    for axis in (0, 1):
        mask = _erode(mask, least, axis)
    for axis in (0, 1):
        padding = [(least - 1,) * 2 if a == axis else (0, 0) for a in (0, 1)]
        mask = ~_erode(~np.pad(mask, padding), least, axis)
    return np.ascontiguousarray(mask)


def _erode(mask: Bool, length: int, axis: int) -> Bool:
    """Return where a run of some pixels along an axis begins; it has `length` - 1 fewer places."""
    done = 1
    while done < length:
        step = min(done, length - done)
        along = np.moveaxis(mask, axis, 0)
        mask = np.moveaxis(along[:-step] & along[step:], 0, axis)
        done += step
    return mask


def _narrow(light: Bool, widest: float) -> Bool:
    """Return the pixels of enclosed light parts that are nowhere wider than some pixels."""
    part = label_parts(np.pad(light, 1, constant_values=True), False)
    to_side2 = squared_distance(part >= 0)
    count = int(part.max()) + 2  # the last entry serves -1
    deepest = np.zeros(count, np.int64)
    np.maximum.at(deepest, part.ravel(), to_side2.ravel())
    is_narrow = deepest < (widest / 2) ** 2
    is_narrow[0] = is_narrow[-1] = False
    return is_narrow[part][1:-1, 1:-1]


def _small_parts(part: I32, longest: float) -> Bool:
    """Return for each part whether it is shorter than some pixels, with an entry for -1."""
    frames = label_frames(part, int(part.max(initial=-1)) + 1)
    extents = (frames[:, 2:] - frames[:, :2]).max(axis=1)
    return np.append(extents < longest, False)
