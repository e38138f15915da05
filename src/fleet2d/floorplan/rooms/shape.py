"""Divide space by its shape: a room ends where the space narrows.

The distance to the nearest wall is a landscape. Each of its hills is the middle of a part of the
space, and the pass between two hills is the higher, the wider the space is between them. Hills that
a high pass connects are one room.

This is the segmentation by distance transform of Bormann, Jordan, Li, Hampp and Hägele, "Room
Segmentation: Survey, Implementation, and Analysis" (ICRA 2016). Parts are joined by the ratio of
their widths, as in Mielle, Magnusson and Lilienthal, "A Method to Segment Maps from Different
Modalities Using Free Space Layout — MAORIS" (ICRA 2018).
"""

from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from typing import NamedTuple

import numpy as np

from fleet2d.kernels import (
    I32,
    I64,
    box_sums,
    climb,
    label_frames,
    label_parts,
    spread_labels,
    squared_distance,
)


class Limits(NamedTuple):
    """Where space is divided.

    Attributes:
        neck: A place divides space if it is at most this share as wide as the narrower side …
        mouth: … or, at the end of a corridor, as the wider side, the hall that it leads to.
        least_m2: A part smaller than this belongs to the one that it is most open to [m²].
    """

    neck: float
    mouth: float
    least_m2: float


IN_STRAIGHT_WALLS = Limits(0.75, 0.3, 4.0)
IN_RAGGED_WALLS = Limits(0.75, 0.35, 4.0)
OF_VACUUMS = IN_RAGGED_WALLS._replace(least_m2=1.2)
"""Necks and mouths are those at which rooms agree best with what people see, by
`benchmarks/maps.py held-out`; between straight walls, passages have divided space before. A vacuum
knows of a small room only what is free in it."""
ARM_SHARE = 0.5
ARM_M2 = 1.2
"""An arm of a space is at most this share as wide, and at least this large [m²]."""
LONG = 3
"""A corridor is at least this many times as long as wide."""
ACROSS_SHARE = 0.85
"""A place that is at least this share as wide as the space on both sides lies across a corridor,
which goes on there, around a block too."""
FURNITURE_M2 = 0.4
WALL_M = 1.2
"""Free-standing obstacles up to this size and shorter than this, such as chairs or a small table,
narrow no space. Longer ones may be walls, which a vacuum draws as thin lines."""
SMOOTHED_M = 0.2
"""Heights are averaged twice over squares that reach this far to all sides."""
FINE = 64
"""Distances are rounded down to this fraction of a cell's side."""


def divide_by_shape(room_of_cell: I64, cell: float, limits: Limits) -> I64:
    """Divide rooms where they narrow.

    Args:
        room_of_cell: The room of each cell, -1 where not free, (rows, columns).
        cell: Side of a cell [m].
        limits: Where they are divided.

    Returns:
        The room of each cell, by decreasing size; -1 where not free. int64 (rows, columns).

    >>> wide = [-1, 0, 0, 0, 0, -1, -1, 0, 0, 0, 0, 0, -1]
    >>> narrow = [-1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    >>> limits = Limits(neck=0.7, mouth=0.3, least_m2=4)
    >>> divide_by_shape(np.array([wide, narrow, wide, wide]), 1.0, limits)[1].tolist()
    [-1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0]
    """
    hill, hills = find_hills(room_of_cell, cell)
    return by_size(join_hills(hills, cell, limits)[hill])


def find_hills(room_of_cell: I64, cell: float) -> tuple[I32, "Hills"]:
    """Return the hill of each cell, -1 where not free, and the hills; see `divide_by_shape`."""
    rooms = room_of_cell.astype(np.int32)
    reach = round(SMOOTHED_M / cell)
    height = _heights(without_furniture(rooms, cell), reach)
    scale = FINE * (2 * reach + 1) ** 2
    hill = _with_arms(climb(rooms, height), height, cell, scale)
    hills = Hills.of(hill, rooms, height, scale)
    # These are joined before any becomes part of a hall, beside which the others would seem narrow.
    hill = hills.joined_across()[hill]
    return hill, Hills.of(hill, rooms, height, scale)


def _with_arms(hill: I32, height: I64, cell: float, scale: int) -> I32:
    """Return the hills, with the narrow arms of each, such as a corridor, as hills of their own.

    A corridor of one width that opens into a hall has no top of its own.

    Args:
        hill: The hill of each cell.
        height: Its height.
        cell: Side of a cell [m].
        scale: Height at a distance of one cell from a wall.
    """
    tops = np.zeros(int(hill.max()) + 1, np.int64)
    np.maximum.at(tops, hill[hill >= 0], height[hill >= 0])
    frames = label_frames(hill, len(tops))
    count = len(tops)
    out = hill.copy()
    for number, (row, column, end_row, end_column) in enumerate(frames.tolist()):
        if (end_row - row) * (end_column - column) * cell**2 < ARM_M2:
            continue
        window = np.s_[row:end_row, column:end_column]
        inside = hill[window] == number
        least = int(ARM_SHARE * tops[number])
        wide = inside & (height[window] >= least)
        arms = inside & (squared_distance(~wide) * scale**2 >= least**2)
        part = label_parts(arms, False)
        sizes = np.bincount(part[arms])
        for arm in np.flatnonzero(sizes * cell**2 >= ARM_M2).tolist():
            out[window][part == arm] = count
            count += 1
    return out


def without_furniture(room_of_cell: I32, cell: float) -> I32:
    """Return the room of each cell, of small free-standing obstacles too."""
    # A margin around the plan joins all that reaches its edge.
    part = label_parts(np.pad(room_of_cell, 1, constant_values=-1) < 0, True)
    frames = label_frames(part, int(part.max()) + 1)
    spans = frames[:, 2:] - frames[:, :2] - 1  # between the centres of the outermost cells
    is_small = (spans * spans).sum(axis=1) * cell**2 < WALL_M**2
    is_small &= np.bincount(part[part >= 0]) * cell**2 <= FURNITURE_M2
    is_small[part[0, 0]] = False
    if not is_small.any():
        return room_of_cell
    is_small = np.append(is_small, False)  # its last entry serves -1
    return spread_labels(room_of_cell, (room_of_cell >= 0) | is_small[part[1:-1, 1:-1]])


def by_size(room_of_cell: I64) -> I64:
    """Return the rooms numbered by decreasing size, those of one size in the order they have."""
    sizes = np.bincount(room_of_cell[room_of_cell >= 0])
    number = np.full(len(sizes) + 1, -1)  # its last entry serves -1
    number[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
    return number[room_of_cell]


def _heights(space: I32, reach: int) -> I64:
    """Return the distance of cells to walls and other rooms, averaged over their surroundings."""
    inside = np.pad(space >= 0, 1)
    inside[1:-1, 1:-2] &= (space[:, :-1] == space[:, 1:]) | (space[:, 1:] < 0)
    inside[1:-2, 1:-1] &= (space[:-1] == space[1:]) | (space[1:] < 0)
    distance = np.sqrt(squared_distance(inside))[1:-1, 1:-1]
    height = np.pad(np.floor(FINE * distance).astype(np.int64), reach)
    height = box_sums(box_sums(height, reach), reach)
    rows, columns = space.shape
    return height[reach : reach + rows, reach : reach + columns] // (2 * reach + 1) ** 2


@dataclass
class Hills:
    """Hills and the passes between them.

    Attributes:
        scale: Height at a distance of one cell from a wall.
        tops: Height of each.
        sizes: Cells of each.
        passes: For each hill, the hills beside it and how high the pass to each is.
    """

    scale: int
    tops: list[int]
    sizes: list[int]
    passes: list[dict[int, int]]

    @classmethod
    def of(cls, hill: I32, rooms: I32, height: I64, scale: int) -> "Hills":
        """Return the hills of cells; there are passes only within rooms."""
        free = hill >= 0
        sizes = np.bincount(hill[free])
        count = len(sizes)
        tops = np.ones(count, np.int64)
        np.maximum.at(tops, hill[free], height[free])
        hills = cls(scale, tops.tolist(), sizes.tolist(), [{} for _ in range(count)])
        for low, high in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
            meet = (hill[low] != hill[high]) & (rooms[low] == rooms[high])
            pairs = hill[low][meet].astype(np.int64) * count + hill[high][meet]
            unique, at = np.unique(pairs, return_inverse=True)
            heights = np.zeros(len(unique), np.int64)
            np.maximum.at(heights, at, np.minimum(height[low], height[high])[meet])
            for pair, top in zip(unique.tolist(), heights.tolist(), strict=True):
                hills.connect(pair // count, pair % count, top)
        return hills

    def connect(self, one: int, other: int, height: int) -> None:
        """Note a pass between two hills; the highest counts."""
        highest = max(height, self.passes[one].get(other, 0))
        self.passes[one][other] = self.passes[other][one] = highest

    def joined_across(self) -> I32:
        """Return the first of the hills that are one corridor with each, and -1 for -1."""
        first = np.arange(len(self.tops) + 1, dtype=np.int32)
        first[-1] = -1
        for one, others in enumerate(self.passes):
            for other, height in others.items():
                highest = max(self.tops[one], self.tops[other])
                if one < other and height >= ACROSS_SHARE * highest:
                    low, high = sorted((first[one], first[other]))
                    first[first == high] = low
        return first

    def is_long(self, hill: int) -> bool:
        """Return whether a hill is several times as long as wide, like a corridor."""
        return self.sizes[hill] * self.scale**2 >= LONG * (2 * self.tops[hill]) ** 2

    def openness(self, one: int, other: int, limits: Limits) -> float:
        """Return how high the pass between two hills is, as a share of what would divide them."""
        low, high = sorted((one, other), key=self.tops.__getitem__)
        least = limits.neck * self.tops[low]
        if self.is_long(low):
            least = max(least, limits.mouth * self.tops[high])
        return self.passes[one][other] / least

    def join(self, one: int, other: int) -> None:
        """Make one hill of two."""
        self.tops[one] = max(self.tops[one], self.tops[other])
        self.sizes[one] += self.sizes[other]
        for third, height in self.passes[other].items():
            del self.passes[third][other]
            if third != one:
                self.connect(one, third, height)
        self.passes[other] = {}


def join_hills(hills: Hills, cell: float, limits: Limits) -> I64:
    """Make parts of hills, those with the highest pass first, and change these.

    Returns:
        The part of each hill, and -1 for -1.
    """
    least_cells = limits.least_m2 / cell**2
    part = np.arange(len(hills.tops) + 1)
    part[-1] = -1
    waiting = [
        (-hills.openness(one, other, limits), one, other)
        for one, others in enumerate(hills.passes)
        for other in others
        if one < other
    ]
    heapify(waiting)
    while waiting:
        openness, one, other = heappop(waiting)
        if other not in hills.passes[one] or -openness != hills.openness(one, other, limits):
            continue  # one of the two has become part of another since
        is_small = min(hills.sizes[one], hills.sizes[other]) < least_cells
        if -openness > 1 or is_small:
            # Other passes are as open as before; a hill may have thousands.
            changed = set(hills.passes[other])
            was_long = hills.is_long(one)
            is_lower = hills.tops[other] > hills.tops[one]
            hills.join(one, other)
            if is_lower or hills.is_long(one) != was_long:
                changed.update(hills.passes[one])
            part[other] = one
            for third in changed - {one, other}:
                low, high = sorted((one, third))
                heappush(waiting, (-hills.openness(low, high, limits), low, high))
    while ((further := part[part]) != part).any():
        part = further
    return part
