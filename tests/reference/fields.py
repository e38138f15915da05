"""Slow, obvious twins of the kernels of fields over cells."""

import numpy as np
from scipy.ndimage import distance_transform_edt
from tests.reference.costs import cost_distance


def squared_distance(mask):
    """Return how far each cell is from those outside the mask, by SciPy."""
    if mask.all():
        return np.full(mask.shape, sum(mask.shape) ** 2)
    return np.rint(distance_transform_edt(mask) ** 2).astype(np.int64)


def box_sums(values, reach):
    """Add up the square around every cell."""
    out = np.empty_like(values)
    for row, column in np.ndindex(values.shape):
        around = values[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) :]
        out[row, column] = around[:, : min(column, reach) + reach + 1].sum()
    return out


def climb(labels, height):
    """Walk up from every cell."""
    cells = {tuple(cell) for cell in np.argwhere(labels >= 0).tolist()}

    def higher(cell):
        row, column = cell
        sides = [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)]
        near = [cell, *(side for side in sides if side in cells and labels[side] == labels[cell])]
        return max(near, key=lambda each: (height[each], each))

    number = {peak: k for k, peak in enumerate(sorted(c for c in cells if higher(c) == c))}
    out = np.full(labels.shape, -1, np.int32)
    for start in cells:
        cell = start
        while higher(cell) != cell:
            cell = higher(cell)
        out[start] = number[cell]
    return out


def walking_distance(mask, goals):
    """Return the 5-7 distance of every cell to the nearest goal."""
    within = (goals >= 0).all(axis=1) & (goals < mask.shape).all(axis=1)
    return cost_distance(np.where(mask, 0, -1), goals[within]) // 200
