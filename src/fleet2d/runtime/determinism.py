"""Reproducible arithmetic: random streams addressed by step, and sums in a fixed order.

Each component has a random stream for each purpose. A draw is a function of (seed, component's path
in the scenario, purpose, step, number of the draw). It doesn't depend on the order in which
components run, on other components, or on their draws.
"""

import hashlib
import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import TypeVar

import numpy as np

from fleet2d.kernels import StepDraws

T = TypeVar("T")

_LN2 = 0.6931471805599453


@lru_cache(maxsize=1000)
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


def sum_in_order(values: Iterable[float]) -> float:
    """Return the sum of some floats, added from the first to the last.

    The built-in `sum` does this up to Python 3.11; later versions compensate for rounding, so that
    the last digits of a stored value would depend on the version.

    Example:
        >>> sum_in_order([0.1] * 10)
        0.9999999999999999
    """
    total = 0.0
    for value in values:
        total += value
    return total


def exp2(x: float) -> float:
    """Return 2 to the power x, with the same bits on every machine, unlike libm.

    The relative error is below 1e-15: Taylor's series of 18 terms after splitting off the integer.

    Example:
        >>> exp2(10.0), exp2(-0.5)
        (1024.0, 0.7071067811865475)
    """
    whole = math.floor(min(max(x, -1000.0), 1000.0))
    rest = (min(max(x, -1000.0), 1000.0) - whole) * _LN2
    total = 1.0
    for k in range(18, 0, -1):
        total = 1.0 + total * rest / k
    return math.ldexp(total, whole)


def logistic(x: float) -> float:
    """Return 1 / (1 + e**-x), with the same bits on every machine.

    Example:
        >>> logistic(0.0), round(logistic(2.0), 6)
        (0.5, 0.880797)
    """
    return 1.0 / (1.0 + exp2(-x / _LN2))
