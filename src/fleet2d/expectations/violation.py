"""Violations: when an expectation doesn't hold, and by how much."""

from typing import NamedTuple

import numpy as np

from fleet2d.expectations.trace import Trace


class Violation(NamedTuple):
    """A stretch of steps in which an expectation is violated.

    Attributes:
        first: The first step.
        last: The last step.
        robustness: The least robustness in the stretch, below 0.
        worst: The first step with that robustness; for a missed time limit, the last step by which
            it was due.
    """

    first: int
    last: int
    robustness: float
    worst: int


def violations_of(robustness: Trace) -> list[Violation]:
    """Return the maximal stretches in which a robustness is below 0, in order."""
    value = robustness.value
    below = np.concatenate([[False], value < 0, [False]])
    edges = np.flatnonzero(below[1:] != below[:-1])
    steps = np.append(robustness.start, robustness.end)
    violations = []
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        worst = begin + int(np.argmin(value[begin:end]))
        violations.append(
            Violation(
                int(steps[begin]), int(steps[end]) - 1, float(value[worst]), int(steps[worst])
            )
        )
    return violations
