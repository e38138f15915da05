"""Fields over the cells of a grid: distances to walls and to places."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel


@kernel
def squared_distance(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return each cell's exact squared distance to the nearest cell that is not in `mask`.

    The two-pass algorithm of Meijster, Roerdink and Hesselink, "A general algorithm for computing
    distance transforms in linear time" (2000), in integers. What lies outside the array counts for
    nothing: surround the mask by one line of False where the border is a wall.

    Args:
        mask: Cells to measure, bool (rows, columns).

    Returns:
        Squared distances in cells, int64 (rows, columns); 0 outside the mask, and
        (rows + columns)² everywhere in a mask that has no outside.
    """
    rows, columns = mask.shape
    endless = rows + columns
    column_gap = _column_gaps(mask, endless)
    out = np.empty((rows, columns), np.int64)
    apex = np.empty(columns, np.int64)  # columns whose parabolas form the lower envelope
    start = np.empty(columns, np.int64)  # first column at which each of them is the lowest
    for row in range(rows):
        gap = column_gap[row]
        top = 0
        apex[0] = 0
        start[0] = 0
        for u in range(1, columns):
            height = gap[u] * gap[u]
            while top >= 0:
                at, i = start[top], apex[top]
                if (at - i) * (at - i) + gap[i] * gap[i] <= (at - u) * (at - u) + height:
                    break
                top -= 1
            if top < 0:
                top = 0
                apex[0] = u
                start[0] = 0
                continue
            i = apex[top]
            crossing = 1 + (u * u - i * i + height - gap[i] * gap[i]) // (2 * (u - i))
            if crossing < columns:
                top += 1
                apex[top] = u
                start[top] = crossing
        for u in range(columns - 1, -1, -1):
            i = apex[top]
            out[row, u] = min((u - i) * (u - i) + gap[i] * gap[i], endless * endless)
            if u == start[top]:
                top -= 1
    return out


@kernel
def _column_gaps(mask: NDArray[np.bool_], endless: int) -> NDArray[np.int64]:
    """Return each cell's distance to the nearest False cell of its column, `endless` for none."""
    rows, columns = mask.shape
    gap = np.empty((rows, columns), np.int64)
    for column in range(columns):
        gap[0, column] = endless if mask[0, column] else 0
    for row in range(1, rows):
        for column in range(columns):
            above = gap[row - 1, column]
            gap[row, column] = min(above + 1, endless) if mask[row, column] else 0
    for row in range(rows - 2, -1, -1):
        for column in range(columns):
            below = gap[row + 1, column]
            if below + 1 < gap[row, column]:
                gap[row, column] = below + 1
    return gap
