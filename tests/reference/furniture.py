"""Slow, obvious twins of the kernels in `fleet2d.kernels`."""

import numpy as np


def corner_sums(mask):
    """Count the cells above and left of every corner."""
    rows, columns = mask.shape
    sums = np.zeros((rows + 1, columns + 1), np.int32)
    for row, column in np.ndindex(sums.shape):
        sums[row, column] = np.count_nonzero(mask[:row, :column])
    return sums


def mask_of(sums):
    """Return the mask whose `corner_sums` are given."""
    return np.diff(np.diff(sums, axis=0), axis=1).astype(bool)


def group_places(floor, occupied, group):
    """Turn the window for each wall, and look at the cells of the group at every place."""
    before_walls = [mask_of(sums) for sums in floor.before_walls]
    places = []
    for turn in range(4):
        holds, whole, distance = (
            np.rot90(each, turn)
            for each in (floor.holds & ~occupied, floor.whole & ~occupied, floor.from_doors)
        )
        back, left_wall, right_wall = (
            np.rot90(before_walls[(turn + side) % 4], turn) for side in (0, 1, 3)
        )
        for row, column in np.ndindex(holds.shape):
            across = slice(column, column + group.width)
            deep = slice(row, row + group.depth)
            ahead = slice(row + group.depth, row + group.depth + group.front)
            if ahead.stop > holds.shape[0] or across.stop > holds.shape[1]:
                continue
            is_free = holds[deep, across].all() and whole[ahead, across].all()
            if not is_free or np.count_nonzero(back[row, across]) < group.backed:
                continue
            left = np.count_nonzero(left_wall[deep, across.stop - 1])
            right = np.count_nonzero(right_wall[deep, column])
            points = group.corner * max(left, right) // group.depth
            middle = distance[row + group.depth // 2, column + group.width // 2]
            most = group.far**2
            points += int(np.clip(middle, 0, most)) * group.away // most
            places.append((turn, row, column, points))
    return np.array(places, np.int64).reshape(-1, 4)
