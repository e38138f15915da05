"""Violations: when an expectation doesn't hold, and how badly."""

from typing import NamedTuple

import numpy as np

from fleet2d.expectations.trace import Trace


class Violation(NamedTuple):
    """Steps in which an expectation is violated.

    Attributes:
        first: The first of them.
        last: The last of them.
        robustness: The least in them, below 0.
        worst: The first step at which it is that; of what didn't come about in time, that by which
            it was due.
    """

    first: int
    last: int
    robustness: float
    worst: int


def violations_of(robustness: Trace) -> list[Violation]:
    """Return the longest stretches in which a robustness is below 0, in order."""
    value = robustness.value
    below = np.concatenate([[False], value < 0, [False]])
    edges = np.flatnonzero(below[1:] != below[:-1])
    steps = np.append(robustness.start, robustness.end)
    found = []
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        worst = begin + int(np.argmin(value[begin:end]))
        found.append(
            Violation(
                int(steps[begin]), int(steps[end]) - 1, float(value[worst]), int(steps[worst])
            )
        )
    return found
