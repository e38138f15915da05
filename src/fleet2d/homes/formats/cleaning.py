"""Cleaning of maps that robots made: specks, rays, scraps, and gaps at thresholds.

Each step has a setting that switches it off, and adds notes on what it changed.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fleet2d.errors import FloorPlanError
from fleet2d.kernels import (
    F64,
    I32,
    I64,
    Bool,
    count_steps,
    label_parts,
    spread_labels,
    squared_distance,
)

# Tolerance of decimal lengths in pixels: 0.3 m are six pixels of 0.05 m, and not 5.999….
TINY = 1e-9
# Widths of what is opened at a threshold or a shut door [m].
DOOR_M = (0.4, 1.4)
USUAL_DOOR_M = 0.8
# A part of a map in which this can't stand is not part of a home: its area and width [m², m].
SCRAP_M2 = 1.0
SCRAP_WIDTH_M = 0.3
# A part that nothing joins is a room of the home from this area on [m²].
ROOM_M2 = 4.0


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
        x = xy[..., 0] * self.pixel
        y = xy[..., 1] * self.pixel
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


def turn_by(angle: float) -> tuple[float, float]:
    """Return cosine and sine of an angle [rad].

    Rounded, so that the last bit of a machine's cosine doesn't matter, and for quarter turns.
    """
    return round(math.cos(angle), 12), round(math.sin(angle), 12)


def bridge_gaps(
    raw: OccupancyMap, widest: int, evidence: Bool | None = None, ray_width: float = 0.0
) -> tuple[Bool, str]:
    """Return the pixels of gaps between parts of the free space that belong together, and a note.

    Two parts belong together if a strip of at most `widest` pixels lies between them that is as
    long as a doorway, that nobody knows to be wall, or that a robot drove across. Of several
    strips between two parts the first in this order is opened: driven across, unknown, thinnest,
    as long as a door. A part as large as a room that is behind a longer strip of wall, such as a
    curtain or a sliding door, gets a door in the middle of that.

    Args:
        raw: The map.
        widest: Largest width of a gap [pixels]; 0 opens none.
        evidence: Pixels that a robot drove across, bool (rows, columns).
        ray_width: Parts that only narrower space joins are apart [m].

    Returns:
        The pixels to open, bool (rows, columns), and a note, empty without any.
    """
    opened = np.zeros(raw.free.shape, np.bool_)
    part, areas = _parts(raw, ray_width)
    roomy = areas >= SCRAP_M2
    if widest == 0 or np.count_nonzero(roomy) < 2:
        return opened, ""
    gap, first, second = _find_gaps(part, roomy, raw.free, widest)
    places = []
    owner = np.arange(len(roomy))

    def area_with(part: int) -> float:
        return float(areas[owner == owner[part]].sum())

    for strip, least_m2 in _candidates(raw, gap, evidence):
        pixels = tuple(strip.T)
        pairs = np.unique(np.stack([first[pixels], second[pixels]], axis=1), axis=0)
        joins = [
            (a, b)
            for a, b in pairs.tolist()
            if owner[a] != owner[b] and min(area_with(a), area_with(b)) >= least_m2
        ]
        for a, b in joins:
            owner[owner == owner[b]] = owner[a]
        if joins:
            opened[pixels] = True
            places.append(strip[:, ::-1].mean(axis=0) + 0.5)
    if not places:
        return opened, ""
    x, y = raw.to_metres(places[0]).tolist()
    return opened, (
        f"gaps of at most {widest} pixels between parts of the home are open: {len(places)}, the"
        f" first at ({x:.2f}, {y:.2f}) m; bridge_pixels: 0 leaves them shut"
    )


def _candidates(
    raw: OccupancyMap, gap: NDArray[np.int8], evidence: Bool | None
) -> list[tuple[I64, float]]:
    """Return what may open, the likeliest first.

    Returns:
        The pixels of each strip, int64 (n, 2), and the least area of both parts that it joins [m²].
    """
    strips = [(strip, 0) for strip in _strips((gap > 0) & ~raw.occupied)]
    for width in range(1, int(gap.max()) + 1):  # a shut door is thinner than the wall that it is in
        strips += [(strip, width) for strip in _strips((gap > 0) & (gap <= width) & raw.occupied)]
    candidates: list[tuple[tuple[int, int, float, int], I64, float]] = []
    for index, (strip, wall) in enumerate(strips):
        length = float((np.ptp(strip, axis=0).max() + 1) * raw.pixel)
        driven = evidence is not None and bool(evidence[tuple(strip.T)].any())
        if driven or (length >= DOOR_M[0] and (wall == 0 or length <= DOOR_M[1])):
            rank = 0 if driven else 1, wall, abs(length - USUAL_DOOR_M), index
            candidates.append((rank, strip, 0.0))
        elif length > DOOR_M[1]:
            nearest = np.abs(strip - strip.mean(axis=0)).max(axis=1).argmin()
            away = np.abs(strip - strip[nearest]).max(axis=1) * raw.pixel
            candidates.append(((2, wall, length, index), strip[away <= USUAL_DOOR_M / 2], ROOM_M2))
    return [(strip, area) for _, strip, area in sorted(candidates, key=lambda c: c[0])]


def _strips(gap: Bool) -> list[I64]:
    """Return the (row, column) of the pixels of each connected strip, int64 (n, 2)."""
    number = label_parts(gap, True)[gap]
    order = np.argsort(number, kind="stable")
    ends = np.cumsum(np.bincount(number[order]))[:-1]
    return np.split(np.argwhere(gap)[order], ends) if len(number) else []


def _parts(raw: OccupancyMap, ray_width: float) -> tuple[I32, F64]:
    """Return the parts of the free space that a disc can move about in, and their areas.

    Args:
        raw: The map.
        ray_width: Diameter of the disc [m]; 0: all that is connected is one part.

    Returns:
        The part of each pixel, -1 for others, and the area of each [m²], 0 where no person stands.
    """
    distance2 = squared_distance(np.pad(raw.free, 1))[1:-1, 1:-1]
    part = label_parts(raw.free, False)
    if ray_width > 0:
        core = label_parts(distance2 >= _reach(raw.pixel, ray_width) ** 2, False)
        part = spread_labels(core, raw.free)
    count = int(part.max(initial=-1)) + 1
    sizes = np.bincount(part[part >= 0], minlength=count)
    areas = sizes.astype(np.float64) * raw.pixel**2
    stand = distance2 >= max(SCRAP_WIDTH_M / 2 / raw.pixel, 1) ** 2
    areas[np.bincount(part[stand & (part >= 0)], minlength=count) == 0] = 0
    return part, areas


def _reach(pixel: float, width: float) -> int:
    """Return the radius of a disc [pixels], which covers what is nearer than this to its centre."""
    return max((math.floor(width / pixel + TINY) + 1) // 2, 1)


def _find_gaps(
    part: I32, roomy: Bool, free: Bool, widest: int
) -> tuple[NDArray[np.int8], I32, I32]:
    """Return the width of the gap that each pixel is in, 0 for none, and the parts beside it.

    Along an axis a slanted gap is longer than it is wide, and its pixels are nearer to its sides.
    """
    gap = np.zeros(part.shape, np.int8)
    first, second = (np.full(part.shape, -1, np.int32) for _ in range(2))
    to_side2: I64 | None = None
    for length in range(1, math.ceil(widest * math.sqrt(2)) + 1):
        for axis in (0, 1):
            along = np.moveaxis(part, axis, 0)
            before = along[: -length - 1]
            after = along[length + 1 :]
            between = [slice(k, k + len(before)) for k in range(1, length + 1)]
            is_gap = (before >= 0) & (after >= 0) & (before != after)
            is_gap[is_gap] = roomy[before[is_gap]] & roomy[after[is_gap]]
            if not is_gap.any():
                continue
            for window in between:
                is_gap &= ~np.moveaxis(free, axis, 0)[window]
                if length > widest:
                    to_side2 = squared_distance(~free) if to_side2 is None else to_side2
                    is_gap &= np.moveaxis(to_side2, axis, 0)[window] < ((length + 1) // 2) ** 2
            low = np.minimum(before, after)
            high = np.maximum(before, after)
            for window in between:
                new = is_gap & (np.moveaxis(gap, axis, 0)[window] == 0)
                np.moveaxis(gap, axis, 0)[window][new] = min(length, widest)
                np.moveaxis(first, axis, 0)[window][new] = low[new]
                np.moveaxis(second, axis, 0)[window][new] = high[new]
    return gap, first, second


def drop_scraps(raw: OccupancyMap, scrap_area_m2: float) -> tuple[Bool, str]:
    """Return the pixels of parts of the free space that are smaller than a room, and a note.

    The largest part is none of them, and neither is a part that is as large as `scrap_area_m2`.

    Args:
        raw: The map.
        scrap_area_m2: Area from which on a part belongs to the home [m²]; 0 drops none.
    """
    part = label_parts(raw.free, False)
    sizes = np.bincount(part[raw.free], minlength=1)
    small = sizes * raw.pixel**2 < scrap_area_m2 - TINY
    small[np.argmax(sizes)] = False
    if not small.any():
        return np.zeros(raw.free.shape, np.bool_), ""
    area = float(sizes[small].sum()) * raw.pixel**2
    return raw.free & small[part], (
        f"scraps left out: {np.count_nonzero(small)} parts of the floor, each under"
        f" {scrap_area_m2:g} m2 and joined to nothing ({area:.2f} m2 in all); scrap_area_m2: 0"
        " keeps them"
    )


def drop_rays(raw: OccupancyMap, ray_width: float, visited: Bool) -> tuple[Bool, str]:
    """Return the pixels of what was only seen from the home, as through a window, and a note.

    A room ends at walls, and a ray where nothing is known. So these are parts of at least a scrap's
    area, joined to others by passages narrower than `ray_width` at most, where nobody was, and
    whose border is wall for less than half. In a map without walls there are none.

    Args:
        raw: The map.
        ray_width: Diameter of the disc that parts are wide enough for [m]; 0 drops none.
        visited: Pixels of rooms, or where a robot drove, bool (rows, columns).
    """
    part, areas = _parts(raw, ray_width)
    own = np.pad(part, 1, constant_values=-1)
    beside_wall = np.pad(squared_distance(~raw.occupied) <= 1, 1)
    border, walled = np.zeros((2, len(areas)), np.int64)
    for axis in (0, 1):
        for shift in (1, -1):
            ends = (own >= 0) & (np.roll(own, shift, axis) != own)
            border += np.bincount(own[ends], minlength=len(areas))
            ends &= np.roll(beside_wall, shift, axis)
            walled += np.bincount(own[ends], minlength=len(areas))
    rays = (2 * walled < border) & (areas >= SCRAP_M2)
    rays[part[visited & (part >= 0)]] = False
    if ray_width == 0 or not rays.any() or rays[np.argmax(areas)]:
        return np.zeros(raw.free.shape, np.bool_), ""
    dropped: Bool = np.append(rays, False)[part]  # -1, of no part, is the last
    x, y = raw.to_metres(np.argwhere(dropped)[:, ::-1].mean(axis=0) + 0.5).tolist()
    area = float(np.count_nonzero(dropped)) * raw.pixel**2
    return dropped, (
        f"rays left out: {area:.2f} m2 round ({x:.2f}, {y:.2f}) m, most of whose border isn't wall,"
        " and where no room or path is; ray_width: 0 keeps them"
    )


def remove_specks(raw: OccupancyMap, speck_area_m2: float) -> tuple[Bool, list[str]]:
    """Return the pixels of small groups that are surrounded by free ones, and a note.

    Args:
        raw: The map.
        speck_area_m2: Groups smaller than this are specks [m²].
    """
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


def home_pixels(free: Bool, pixel: float, ray_width: float) -> Bool:
    """Return the pixels of the largest part that a disc reaches, and of what belongs to it."""
    across = math.floor(ray_width / pixel + TINY)
    reach = _reach(pixel, ray_width)
    core = squared_distance(np.pad(free, 1))[1:-1, 1:-1] >= reach**2
    if not core.any():
        raise FloorPlanError(
            f"the free space is nowhere {ray_width:g} m wide: check the resolution, and whether"
            " light and dark are exchanged (negate), or set floorplan.ray_width lower"
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


def note_left_out(raw: OccupancyMap, free: Bool, home: Bool, ray_width: float) -> list[str]:
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
