"""Random streams: one for each component and purpose, addressed by step.

A draw is a function of (seed, component's path in the scenario, purpose, step, number of the draw).
It depends neither on the order in which components run, nor on which others there are, nor on how
often they drew.
"""

import hashlib
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from fleet2d.kernels.random import random_below, random_bits, random_uniform

T = TypeVar("T")


def stream_key(seed: int, path: str, purpose: str) -> np.uint64:
    """Return the key of a stream, e.g. of ``stream_key(4, "users.ana", "spot")``.

    Example:
        >>> hex(stream_key(4, "users.ana", "spot"))
        '0xb2018c82ee74584f'
    """
    text = f"{seed}\0{path}\0{purpose}".encode()
    return np.uint64(int.from_bytes(hashlib.blake2b(text, digest_size=8).digest(), "little"))


class Draws:
    """Random draws of one component, for one purpose, at one step.

    Example:
        >>> draws = Draws(stream_key(4, "users.ana", "spot"), step=0)
        >>> [draws.below(6) for _ in range(5)]
        [3, 4, 4, 3, 4]
        >>> draws.shuffled(["kitchen", "hall", "office"])
        ['office', 'hall', 'kitchen']
    """

    def __init__(self, key: np.uint64, step: int) -> None:
        self._key = np.uint64(random_bits(key, step))
        self._count = 0

    def _next(self) -> int:
        self._count += 1
        return self._count - 1

    def below(self, bound: int) -> int:
        """Return an integer from 0 to bound - 1; `bound` is below 2**31."""
        if not 0 < bound < 2**31:
            raise ValueError(f"bound is {bound}: it must be from 1 to 2**31 - 1")
        return int(random_below(self._key, self._next(), bound))

    def uniform(self) -> float:
        """Return a float64 in [0, 1)."""
        return float(random_uniform(self._key, self._next()))

    def choice(self, items: Sequence[T]) -> T:
        """Return one of `items`, all equally likely."""
        return items[self.below(len(items))]

    def shuffled(self, items: Sequence[T]) -> list[T]:
        """Return `items` in random order (Fisher and Yates)."""
        order = list(items)
        for i in range(len(order) - 1, 0, -1):
            j = self.below(i + 1)
            order[i], order[j] = order[j], order[i]
        return order
