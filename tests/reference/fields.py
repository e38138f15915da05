"""Slow, obvious twins of the kernels in `fleet2d.kernels.fields`."""

import numpy as np
from numpy.typing import NDArray


def squared_distance(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Compare every cell with every cell outside the mask."""
    rows, columns = mask.shape
    outside = np.argwhere(~mask)
    out = np.empty(mask.shape, np.int64)
    for row in range(rows):
        for column in range(columns):
            squares = ((outside - (row, column)) ** 2).sum(axis=1)
            out[row, column] = squares.min() if len(squares) else (rows + columns) ** 2
    return out
