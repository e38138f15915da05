"""What the search for rooms asks often: which places see each other, which label is nearest."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.mesh import Mesh, locate
from fleet2d.kernels.sight import line_of_sight

NO_LABEL = -1
"""The label of a cell that has none."""


@kernel
def see_each(mesh: Mesh, eyes: NDArray[np.int64], places: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return for each pair whether the two see each other: what is on a wall sees nothing.

    Args:
        mesh: Free space.
        eyes: Lattice points (n, 2).
        places: Lattice points (n, 2), one for each eye.

    Returns:
        bool (n,).
    """
    seen = np.zeros(eyes.shape[0], np.bool_)
    triangle = -1
    for i in range(eyes.shape[0]):
        x, y = eyes[i, 0], eyes[i, 1]
        if i == 0 or x != eyes[i - 1, 0] or y != eyes[i - 1, 1]:
            triangle = locate(mesh, x, y)
        seen[i] = line_of_sight(mesh, x, y, triangle, places[i, 0], places[i, 1])
    return seen


@kernel
def label_frames(labels: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    """Return the smallest box of cells around each label.

    Args:
        labels: int32 (rows, columns), below `count`, -1 for none.
        count: How many labels there are.

    Returns:
        First row, first column, last row and last column, plus one, int64 (count, 4); of a label
        without cells first ones beyond the last.
    """
    rows, columns = labels.shape
    frames = np.zeros((count, 4), np.int64)
    frames[:, :2] = max(rows, columns)
    for row in range(rows):
        for column in range(columns):
            label = labels[row, column]
            if label >= 0:
                frames[label, 0] = min(frames[label, 0], row)
                frames[label, 1] = min(frames[label, 1], column)
                frames[label, 2] = row + 1
                frames[label, 3] = max(frames[label, 3], column + 1)
    return frames


@kernel
def fill_beside(labels: NDArray[np.int16]) -> NDArray[np.int16]:
    """Give cells without a label that of a cell that touches them.

    First of one across a side, then of one across a corner; west before east, south before north.

    Args:
        labels: int16 (rows, columns), -1 for none.

    Returns:
        Labels, int16 (rows, columns).
    """
    rows, columns = labels.shape
    filled = labels.copy()
    for row in range(rows):
        for column in range(columns):
            if labels[row, column] != NO_LABEL:
                continue
            best = 8
            for near in range(max(row - 1, 0), min(row + 2, rows)):
                for beside in range(max(column - 1, 0), min(column + 2, columns)):
                    if labels[near, beside] == NO_LABEL:
                        continue
                    up, east = near - row, beside - column
                    if up == 0:
                        rank = 0 if east < 0 else 1
                    elif east == 0:
                        rank = 2 if up < 0 else 3
                    else:
                        rank = 5 + up + (1 if east > 0 else 0)
                    if rank < best:
                        best = rank
                        filled[row, column] = labels[near, beside]
    return filled


@kernel
def spread_labels(labels: NDArray[np.int32], mask: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Give every cell of a mask that has no label the nearest one, in steps across sides.

    Of labels that are equally near the lowest is taken.

    Args:
        labels: int32 (rows, columns), -1 for none; those outside the mask count for nothing.
        mask: Where labels may spread, bool (rows, columns).

    Returns:
        Labels, int32 (rows, columns); -1 outside the mask and where no way leads from a label.
    """
    rows, columns = labels.shape
    out = np.full((rows, columns), NO_LABEL, np.int32)
    queue = np.empty(rows * columns, np.int64)
    steps = np.zeros((rows, columns), np.int32)
    end = 0
    for row in range(rows):
        for column in range(columns):
            if mask[row, column] and labels[row, column] != NO_LABEL:
                out[row, column] = labels[row, column]
                queue[end] = row * columns + column
                end += 1
    first = 0
    while first < end:
        row, column = queue[first] // columns, queue[first] % columns
        first += 1
        for side in range(4):
            near = row + (1 if side == 0 else (-1 if side == 1 else 0))
            beside = column + (1 if side == 2 else (-1 if side == 3 else 0))
            if not (0 <= near < rows and 0 <= beside < columns) or not mask[near, beside]:
                continue
            if out[near, beside] == NO_LABEL:
                out[near, beside] = out[row, column]
                steps[near, beside] = steps[row, column] + 1
                queue[end] = near * columns + beside
                end += 1
            elif steps[near, beside] == steps[row, column] + 1:
                # It waits in the queue still: nothing has spread from it.
                out[near, beside] = min(out[near, beside], out[row, column])
    return out
