"""Slow, obvious twin of `fleet2d.floorplan.rooms.shape`."""

import math

import numpy as np
from scipy.ndimage import distance_transform_edt, label
from scipy.signal import convolve2d

from fleet2d.floorplan.rooms.shape import (
    ACROSS_SHARE,
    ARM_M2,
    ARM_SHARE,
    FINE,
    LONG,
    SMOOTHED_M,
    without_furniture,
)


def parts_by_shape(room_of_cell, cell, limits):
    """Walk up from every cell, then join the parts most open to each other, pair by pair."""
    rooms = cells_of(room_of_cell)
    reach = round(SMOOTHED_M / cell)
    height = heights(without_furniture(room_of_cell.astype(np.int32), cell), reach)
    part = {at: top_above(at, rooms, height) for at in rooms}
    scale = FINE * (2 * reach + 1) ** 2
    part |= arms(part, height, cell, scale)
    level = []
    for pair, highest in highest_passes(part, rooms, height).items():
        tops = [max(1, *(height[at] for at in part if part[at] == top)) for top in pair]
        if highest >= ACROSS_SHARE * max(tops):
            level.append(pair)
    joined_to = {top: top for top in part.values()}
    for one, other in level:
        kept, lost = sorted((joined_to[one], joined_to[other]))
        joined_to = {top: kept if to == lost else to for top, to in joined_to.items()}
    part = {at: joined_to[top] for at, top in part.items()}
    while True:
        joined = []
        for pair, highest in highest_passes(part, rooms, height).items():
            sides = [[at for at in part if part[at] == top] for top in pair]
            tops = [max(1, *(height[at] for at in side)) for side in sides]
            low, high = sorted((0, 1), key=tops.__getitem__)
            least = limits.neck * tops[low]
            if len(sides[low]) * scale**2 >= LONG * (2 * tops[low]) ** 2:
                least = max(least, limits.mouth * tops[high])
            openness = highest / least
            if openness > 1 or min(map(len, sides)) < limits.least_m2 / cell**2:
                joined.append((-openness, *pair))
        if not joined:
            return {frozenset(at for at in part if part[at] == top) for top in part.values()}
        _, kept, lost = min(joined)
        part = {at: kept if top == lost else top for at, top in part.items()}


def highest_passes(part, rooms, height):
    """Return the height of the highest pass between any two parts that meet within a room."""
    passes = {}
    for (row, column), top in part.items():
        for beside in ((row, column + 1), (row + 1, column)):
            if part.get(beside, top) != top and rooms[beside] == rooms[row, column]:
                pair = (min(top, part[beside]), max(top, part[beside]))
                lower = min(height[row, column], height[beside])
                passes[pair] = max(passes.get(pair, 0), lower)
    return passes


def arms(part, height, cell, scale):
    """Return the arms of the parts, numbered after all other parts."""
    found, count = {}, 0
    for top in sorted(set(part.values())):
        inside = [at for at in part if part[at] == top]
        least = int(ARM_SHARE * max(1, *(height[at] for at in inside)))
        wide = [at for at in inside if height[at] >= least] or [top]
        is_far = np.zeros(np.max(list(part), axis=0) + 1, bool)
        for at in inside:
            is_far[at] = min(math.dist(at, w) for w in wide) * scale >= least
        pieces, _ = label(is_far)
        for piece in range(1, pieces.max() + 1):
            cells = list(map(tuple, np.argwhere(pieces == piece).tolist()))
            if len(cells) * cell**2 >= ARM_M2:
                found |= dict.fromkeys(cells, (max(part)[0] + 1, count))
                count += 1
    return found


def cells_of(labels):
    return {
        (row, column): int(label) for (row, column), label in np.ndenumerate(labels) if label >= 0
    }


def heights(space, reach):
    """Measure the distance to each place outside, and weigh what lies around each cell."""
    inside = np.pad(space >= 0, 1)
    for axis in (0, 1):
        after = np.roll(np.pad(space, 1, constant_values=-1), -1, axis)[1:-1, 1:-1]
        inside[1:-1, 1:-1] &= (after < 0) | (after == space)
    distance = np.floor(FINE * distance_transform_edt(inside)).astype(np.int64)
    width = 2 * reach + 1
    weight = width - np.abs(np.arange(1 - width, width))
    return convolve2d(distance, np.outer(weight, weight), "same")[1:-1, 1:-1] // width**2


def top_above(at, rooms, height):
    while True:
        row, column = at
        sides = ((row, column + 1), (row + 1, column), (row, column - 1), (row - 1, column))
        near = [at, *(side for side in sides if rooms.get(side) == rooms[at])]
        higher = max(near, key=lambda cell: (height[cell], cell))
        if higher == at:
            return at
        at = higher
