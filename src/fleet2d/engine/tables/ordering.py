"""The order of rows, which doesn't depend on the spans of a run."""

import numpy as np

from fleet2d.kernels import I64


def in_order(blocks: list[I64]) -> I64:
    """Join blocks of rows (step, entity, …) and sort them; equal rows keep their order.

    Example:
        >>> in_order([np.array([[1, 1, 5]]), np.array([[1, 0, 6], [0, 1, 7]])]).tolist()
        [[0, 1, 7], [1, 0, 6], [1, 1, 5]]
    """
    rows = np.concatenate(blocks)
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))]
