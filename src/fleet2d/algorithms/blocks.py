"""Blocks: arrays that follow on each other in time, kept for as long as somebody may ask."""

from bisect import bisect_left, bisect_right
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Blocks:
    """Arrays of rows, of one shape but for their length, each of a stretch of time.

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
        """Begin without any."""
        self._begins: list[int] = []
        self._ends: list[int] = []
        self._rows: list[NDArray[Any]] = []

    def append(self, begin: int, end: int, rows: NDArray[Any]) -> None:
        """Keep what lies from `begin` up to before `end`, after all that is kept."""
        self._begins.append(begin)
        self._ends.append(end)
        self._rows.append(rows)

    def touching(self, begin: int, end: int) -> tuple[int, NDArray[Any] | None]:
        """Return all blocks with a part in a stretch of time as one, and where they begin."""
        here = self._touching(begin, end)
        found = self._rows[here]
        if not found:
            return begin, None
        return self._begins[here.start], found[0] if len(found) == 1 else np.concatenate(found)

    def each_touching(self, begin: int, end: int) -> list[NDArray[Any]]:
        """Return each block with a part in a stretch of time."""
        return self._rows[self._touching(begin, end)]

    def _touching(self, begin: int, end: int) -> slice:
        return slice(bisect_right(self._ends, begin), bisect_left(self._begins, end))

    def forget(self, before: int) -> None:
        """Drop the blocks that end by then."""
        past = slice(bisect_right(self._ends, before))
        del self._begins[past], self._ends[past], self._rows[past]
