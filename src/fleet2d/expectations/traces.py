"""Traces: signals over the steps of a run, as stretches of steps with equal values."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from fleet2d.kernels import F64, I64, sliding_max, until

INFINITE = float("inf")
TINY = float(np.finfo(np.float64).tiny)


class Trace(NamedTuple):
    """A signal over the steps from `start[0]` to `end` - 1.

    Attributes:
        start: int64 (n,), ascending: the first step of each stretch.
        value: float64 (n,), the value over each stretch; neighbours differ.
        end: One past the last step of the last stretch.
    """

    start: I64
    value: F64
    end: int

    @property
    def first(self) -> int:
        """The first step."""
        return int(self.start[0])

    @property
    def ends(self) -> I64:
        """One past the last step of each stretch: int64 (n,)."""
        return np.append(self.start[1:], self.end)

    def values(self, steps: I64) -> F64:
        """Return the values at some steps."""
        return self.value[np.searchsorted(self.start, steps, side="right") - 1]

    def at(self, step: int) -> float:
        """Return the value at a step."""
        return float(self.values(np.array(step)))

    def since(self, first: int) -> "Trace":
        """Return the trace from the step `first` on."""
        if first <= self.first:
            return self
        index = int(np.searchsorted(self.start, first, side="right")) - 1
        return Trace(np.append(first, self.start[index + 1 :]), self.value[index:], self.end)

    def until(self, end: int) -> "Trace":
        """Return the trace up to before the step `end`."""
        if end >= self.end:
            return self
        count = int(np.searchsorted(self.start, end))
        return Trace(self.start[:count], self.value[:count], end)

    def map(self, function: Callable[[F64], F64]) -> "Trace":
        """Return the trace of `function(value)` at each step."""
        return shortest(self.start, function(self.value), self.end)

    def sliding_max(self, low: int, high: int, before: float, after: float) -> "Trace":
        """Return the maximum from `low` to `high` steps after each step.

        Args:
            low: First step of the window, relative to each step.
            high: Last step of the window, relative to each step.
            before: Value that is assumed before the first step.
            after: Value that is assumed from the end on.
        """
        maxima = sliding_max(self.start, self.value, self.end, low, high, before, after)
        return Trace(*maxima, self.end)

    def sliding_min(self, low: int, high: int, before: float, after: float) -> "Trace":
        """Return the minimum from `low` to `high` steps after each step; see `sliding_max`."""
        return self.map(np.negative).sliding_max(low, high, -before, -after).map(np.negative)

    def until_goal(self, goal: "Trace", after: float) -> "Trace":
        """Return the robustness of "this holds until `goal` holds" from each step on.

        Args:
            goal: A trace over the same steps.
            after: Value that is assumed from the end of both on.
        """
        start = np.union1d(self.start, goal.start)
        return Trace(*until(start, self.values(start), goal.values(start), after), self.end)

    @property
    def reversed(self) -> "Trace":
        """The same values in the opposite order, over the same steps."""
        start = self.first + self.end - self.ends[::-1]
        return Trace(start, self.value[::-1].copy(), self.end)

    @property
    def spells(self) -> I64:
        """The maximal stretches in which it is above 0: int64 (n, 2), first and last step."""
        above = np.concatenate([[False], self.value > 0, [False]])
        edges = np.flatnonzero(above[1:] != above[:-1])
        return np.append(self.start, self.end)[edges].reshape(-1, 2) - [0, 1]


def constant(value: float, first: int, end: int) -> Trace:
    """Return a trace that never changes."""
    return Trace(np.array([first], np.int64), np.array([value]), end)


def shortest(start: I64, value: F64, end: int) -> Trace:
    """Return a trace with neighbouring stretches of equal value joined; NaN equals NaN."""
    missing = np.isnan(value)
    differs = np.append(True, (value[1:] != value[:-1]) & ~(missing[1:] & missing[:-1]))
    return Trace(start, value, end) if differs.all() else Trace(start[differs], value[differs], end)


def combine(function: Callable[..., F64], *traces: Trace) -> Trace:
    """Return the trace of a function of several signals over the same steps.

    Example:
        >>> one, two = constant(1.0, 0, 9), constant(4.0, 0, 9)
        >>> combine(np.maximum, one, two).at(5)
        4.0
    """
    start = traces[0].start
    for trace in traces[1:]:
        start = np.union1d(start, trace.start)
    return shortest(start, function(*(trace.values(start) for trace in traces)), traces[0].end)


def joined(parts: Sequence[Trace]) -> Trace:
    """Return traces that follow each other in time as one."""
    if len(parts) == 1:
        return parts[0]
    start = np.concatenate([part.start for part in parts])
    return shortest(start, np.concatenate([part.value for part in parts]), parts[-1].end)


def pulses(steps: I64, first: int, end: int) -> Trace:
    """Return how often each step is among `steps`, which needn't be in order.

    Example:
        >>> pulses(np.array([3, 3, 5]), 0, 9).value.tolist()
        [0.0, 2.0, 0.0, 1.0, 0.0]
    """
    at, count = np.unique(steps[(steps >= first) & (steps < end)], return_counts=True)
    start = np.unique(np.concatenate([[first], at, at + 1])).astype(np.int64)
    start = start[start < end]
    value = np.zeros(len(start))
    value[np.searchsorted(start, at)] = count
    return shortest(start, value, end)
