"""Blocks: consecutive arrays of rows, dropped when no component can look back to them."""

from bisect import bisect_left, bisect_right
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Blocks:
    """Consecutive arrays, each for an interval of steps; only their first dimension differs.

    Example:
        >>> blocks = Blocks()
        >>> blocks.append(0, 2, np.array([1, 2]))
        >>> blocks.append(2, 5, np.array([3, 4, 5]))
        >>> blocks.touching(1, 3)[0], blocks.touching(2, 4)[1].tolist()
        (0, [3, 4, 5])
        >>> blocks.forget(2)
        >>> blocks.touching(0, 9)
        (2, array([3, 4, 5]))
    """

    def __init__(self) -> None:
        """Begin without blocks."""
        self._begins: list[int] = []
        self._ends: list[int] = []
        self._rows: list[NDArray[Any]] = []

    def append(self, begin: int, end: int, rows: NDArray[Any]) -> None:
        """Append the rows of the stretch from `begin` up to before `end`, the latest so far."""
        self._begins.append(begin)
        self._ends.append(end)
        self._rows.append(rows)

    def touching(self, begin: int, end: int) -> tuple[int, NDArray[Any] | None]:
        """Return all blocks that overlap a stretch of time, joined, and their begin."""
        overlap = self._touching(begin, end)
        blocks = self._rows[overlap]
        if not blocks:
            return begin, None
        rows = blocks[0] if len(blocks) == 1 else np.concatenate(blocks)
        return self._begins[overlap.start], rows

    def each_touching(self, begin: int, end: int) -> list[NDArray[Any]]:
        """Return each block that overlaps a stretch of time."""
        return self._rows[self._touching(begin, end)]

    def _touching(self, begin: int, end: int) -> slice:
        return slice(bisect_right(self._ends, begin), bisect_left(self._begins, end))

    def forget(self, before: int) -> None:
        """Drop the blocks that end by `before`."""
        past = slice(bisect_right(self._ends, before))
        del self._begins[past], self._ends[past], self._rows[past]
