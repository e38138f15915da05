"""Cells in which a body's centre may be, and which of them hang together."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel


@kernel
def label_triangles(neighbors: NDArray[np.int32]) -> NDArray[np.int32]:
    """Number the connected parts of a mesh; returns each triangle's part (triangles,)."""
    count = neighbors.shape[0]
    part = np.full(count, -1, np.int32)
    stack = np.empty(count, np.int32)
    parts = 0
    for seed in range(count):
        if part[seed] >= 0:
            continue
        part[seed] = parts
        stack[0] = seed
        height = 1
        while height > 0:
            height -= 1
            triangle = stack[height]
            for k in range(3):
                other = neighbors[triangle, k]
                if other >= 0 and part[other] < 0:
                    part[other] = parts
                    stack[height] = other
                    height += 1
        parts += 1
    return part
