"""From an occupancy map to free space: clean the pixels, then follow their sides."""

import math
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from fleet2d.errors import FloorPlanError
from fleet2d.kernels.fields import squared_distance
from fleet2d.kernels.masks import count_steps, label_parts, trace_rings

Mask = NDArray[np.bool_]
Parts = NDArray[np.int32]

# Rounding of decimal lengths to pixels: 0.3 m are six pixels of 0.05 m, and not 5.999….
TINY = 1e-9


@dataclass(frozen=True)
class OccupancyMap:
    """What a robot knows of a floor, pixel by pixel; what is in neither mask is unknown.

    Attributes:
        free: Pixels known to be free, bool (rows, columns), the first row at the bottom.
        occupied: Pixels known to be occupied, of the same shape.
        pixel: Side of a pixel [m].
        origin: Where the lower left corner of the first pixel is (x, y) [m].
        turn: Cosine and sine of the angle from the x axis to the rows, counter-clockwise.
    """

    free: Mask
    occupied: Mask
    pixel: float
    origin: tuple[float, float] = (0.0, 0.0)
    turn: tuple[float, float] = (1.0, 0.0)

    def to_metres(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return places (…, 2) [m] that are given as (column, row), from the lower left corner."""
        cosine, sine = self.turn
        x, y = xy[..., 0] * self.pixel, xy[..., 1] * self.pixel
        turned = np.stack([x * cosine - y * sine, x * sine + y * cosine], axis=-1)
        places: NDArray[np.float64] = turned + np.array(self.origin)
        return places

    def cropped(self) -> "OccupancyMap":
        """Return the part round the free pixels, with a pixel to spare where the map has one."""
        rows, columns = (np.flatnonzero(self.free.any(axis=axis)) for axis in (1, 0))
        low = (max(int(columns[0]) - 1, 0), max(int(rows[0]) - 1, 0))
        window = (slice(low[1], int(rows[-1]) + 2), slice(low[0], int(columns[-1]) + 2))
        x, y = self.to_metres(np.array(low, np.float64)).tolist()
        # In one memory order, whatever the maker's: the kernels are compiled for that.
        free, occupied = (np.ascontiguousarray(m[window]) for m in (self.free, self.occupied))
        return replace(self, free=free, occupied=occupied, origin=(x, y))


def free_space(
    raw: OccupancyMap, *, speck_area_m2: float, ray_width: float
) -> tuple[Polygon, list[str]]:
    """Take the one home out of an occupancy map, and leave out noise, specks and rays.

    1. A group of pixels that are not free, surrounded by free ones and smaller in all than
       `speck_area_m2`, becomes free.
    2. Space through which no disc of `ray_width` passes separates: of what a disc reaches, the
       largest connected part is the home.
    3. Around it, narrower space belongs to the home if all of it is within `ray_width` of where
       the disc reaches; if it leads further, only what is within half of that does.

    Everything else is wall. The disc is a number of whole pixels across, and odd, so that all
    sides are treated alike: `ray_width` is rounded down to that.

    Args:
        raw: The map.
        speck_area_m2: Groups smaller than this are specks [m²]; 0 keeps all.
        ray_width: Diameter of the disc [m]; up to a pixel cuts nothing that is connected.

    Returns:
        The free space [m], every wall on the sides of pixels, and a sentence for each thing done.

    Raises:
        FloorPlanError: No space is free, or none is wide enough.
    """
    if not raw.free.any():
        raise FloorPlanError("no pixel is free: check negate, free_thresh and occupied_thresh")
    raw = raw.cropped()
    specks, notes = _specks(raw, speck_area_m2)
    free = raw.free | specks
    home = _home(free, raw.pixel, ray_width)
    notes += _left_out(raw, free, home, ray_width)
    notes += _open_border(raw, home)
    return shapely.transform(outline(home), raw.to_metres), notes


def outline(free: Mask) -> Polygon:
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


def _specks(raw: OccupancyMap, speck_area_m2: float) -> tuple[Mask, list[str]]:
    """Return the pixels of small groups that only free ones surround."""
    # One line of unknown round the map: what reaches its edge is surrounded by nothing.
    part = label_parts(~np.pad(raw.free, 1), True)[1:-1, 1:-1]
    sizes = np.bincount(part[~raw.free], minlength=1)
    small = (sizes > 0) & (sizes * raw.pixel**2 < speck_area_m2 - TINY)
    small[0] = False  # the part of the surrounding line, which comes first
    area = float(sizes[small].sum()) * raw.pixel**2
    specks: Mask = ~raw.free & small[part]
    if not small.any():
        return specks, []
    return specks, [
        f"specks removed: {np.count_nonzero(small)} groups of pixels that are not free, each under"
        f" {speck_area_m2:g} m2 and with free space all round, are free now ({area:.2f} m2 in all)"
    ]


def _home(free: Mask, pixel: float, ray_width: float) -> Mask:
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
    home: Mask = (steps >= 0) & (~leads_on[part] | (steps < reach))
    return home


def _left_out(raw: OccupancyMap, free: Mask, home: Mask, ray_width: float) -> list[str]:
    """Say what free space isn't the home's: what is narrow and hangs on, and what is apart."""
    notes = []
    joined = count_steps(home, free) >= 0
    for where, how in (
        (joined & ~home, f"only passages narrower than {ray_width:g} m join"),
        (free & ~joined, "nothing joins"),
    ):
        if where.any():
            part = label_parts(where, False)
            sizes = np.bincount(part[where])
            largest = part == np.argmax(sizes)
            middle = np.argwhere(largest)[:, ::-1].mean(axis=0) + 0.5
            x, y = raw.to_metres(middle).tolist()
            area, most = (float(n) * raw.pixel**2 for n in (sizes.sum(), sizes.max()))
            notes.append(
                f"left out: {area:.2f} m2 of free space, in pieces: {len(sizes)}, that {how} to the"
                f" rest; the largest, {most:.2f} m2, is round ({x:.2f}, {y:.2f}) m"
            )
    return notes


def _open_border(raw: OccupancyMap, home: Mask) -> list[str]:
    """Say how much of the outline is no obstacle in the map, but where its knowledge ends."""
    notes = []
    inside, unknown = np.pad(home, 1), np.pad(~raw.free & ~raw.occupied, 1)
    around = [np.roll(unknown, shift, axis) for axis in (0, 1) for shift in (1, -1)]
    sides = sum(int(np.count_nonzero(inside & beside)) for beside in around)
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
