"""Slow, obvious twins of the kernels in `fleet2d.kernels`."""

from itertools import product

import numpy as np

from fleet2d.kernels import I32, I64, Bool


def squared_distance(mask: Bool) -> I64:
    """Compare every cell with every cell outside the mask."""
    rows, columns = mask.shape
    outside = np.argwhere(~mask)
    out = np.empty(mask.shape, np.int64)
    for row in range(rows):
        for column in range(columns):
            squares = ((outside - (row, column)) ** 2).sum(axis=1)
            out[row, column] = squares.min() if len(squares) else (rows + columns) ** 2
    return out


def box_sums(values: I64, reach: int) -> I64:
    """Add up the square around every cell."""
    out = np.empty_like(values)
    for row, column in np.ndindex(values.shape):
        around = values[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) :]
        out[row, column] = around[:, : min(column, reach) + reach + 1].sum()
    return out


def climb(labels: I32, height: I64) -> I32:
    """Walk up from every cell."""
    cells = {(int(row), int(column)) for row, column in np.argwhere(labels >= 0)}

    def higher(cell: tuple[int, int]) -> tuple[int, int]:
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


def walking_distance(mask: np.ndarray, goals: np.ndarray) -> np.ndarray:
    """Return the 5-7 distance of every cell to the nearest goal, by trying all steps until none helps."""
    rows, columns = mask.shape
    far = 10**6
    found = np.full(mask.shape, far)
    for row, column in goals:
        if 0 <= row < rows and 0 <= column < columns and mask[row, column]:
            found[row, column] = 0
    changed = True
    while changed:
        changed = False
        for row, column in np.argwhere(mask):
            for dr, dc in product((-1, 0, 1), repeat=2):
                r, c = row + dr, column + dc
                if not (0 <= r < rows and 0 <= c < columns) or not (
                    mask[r, c] and mask[row, c] and mask[r, column]
                ):
                    continue
                way = found[r, c] + (7 if dr and dc else 5 if dr or dc else 0)
                if way < found[row, column]:
                    found[row, column], changed = way, True
    return np.where(found == far, -1, found)
