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
