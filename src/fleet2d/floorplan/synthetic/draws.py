"""Random choices of a generator: integers from a counter, the same on every machine."""

import hashlib
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from fleet2d.kernels.numbers import random_below

T = TypeVar("T")


class Choices:
    """A stream of random choices, addressed by a seed and a purpose.

    Example:
        >>> choices = Choices(7, "example")
        >>> [choices.below(6) for _ in range(5)] == [Choices(7, "example").below(6)] * 5
        False
        >>> Choices(7, "a").between(2, 2)
        2
    """

    def __init__(self, seed: int, purpose: str) -> None:
        digest = hashlib.blake2b(f"{seed}\0synthetic home\0{purpose}".encode(), digest_size=8)
        self._key = np.uint64(int.from_bytes(digest.digest(), "little"))
        self._count = 0

    def below(self, bound: int) -> int:
        """Return an integer from 0 to bound - 1."""
        self._count += 1
        return int(random_below(self._key, self._count - 1, bound))

    def between(self, low: int, high: int) -> int:
        """Return an integer from low to high, both possible; `low` where high is less."""
        return low + self.below(max(high - low, 0) + 1)

    def chance(self, percent: int) -> bool:
        """Return True with a probability of `percent` in a hundred."""
        return self.below(100) < percent

    def pick(self, items: Sequence[T]) -> T:
        """Return one of `items`, all equally likely."""
        return items[self.below(len(items))]

    def weighted(self, items: Sequence[tuple[T, int]]) -> T:
        """Return an item with probability in proportion to its weight."""
        rest = self.below(sum(weight for _, weight in items))
        for item, weight in items:
            if rest < weight:
                return item
            rest -= weight
        raise AssertionError("the draw is below the sum of the weights")

    def shuffled(self, items: Sequence[T]) -> list[T]:
        """Return `items` in random order (Fisher and Yates)."""
        order = list(items)
        for i in range(len(order) - 1, 0, -1):
            j = self.below(i + 1)
            order[i], order[j] = order[j], order[i]
        return order
