"""Random streams: one for each component and purpose, addressed by step.

A draw is a function of (seed, component's path in the scenario, purpose, step, number of the draw).
It doesn't depend on the order in which components run, on other components, or on their draws.
"""

import hashlib
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from fleet2d.kernels.numbers import StepDraws

T = TypeVar("T")


def stream_key(seed: int, path: str, purpose: str) -> np.uint64:
    """Return the key of a stream, e.g. ``stream_key(4, "users.ana", "spot")``.

    Example:
        >>> hex(stream_key(4, "users.ana", "spot"))
        '0xb2018c82ee74584f'
    """
    text = f"{seed}\0{path}\0{purpose}".encode()
    return np.uint64(int.from_bytes(hashlib.blake2b(text, digest_size=8).digest(), "little"))


class Draws(StepDraws):
    """Random draws of one component, for one purpose, at one step.

    Example:
        >>> draws = Draws(stream_key(4, "users.ana", "spot"), step=0)
        >>> [draws.below(6) for _ in range(5)]
        [3, 4, 4, 3, 4]
        >>> draws.shuffled(["kitchen", "hall", "office"])
        ['office', 'hall', 'kitchen']
    """

    __slots__ = ()

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
