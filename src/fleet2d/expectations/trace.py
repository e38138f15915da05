"""Traces: what a signal is at each step, as stretches of equal value."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels import signals

I64 = NDArray[np.int64]
F64 = NDArray[np.float64]


class Trace(NamedTuple):
    """A signal over the steps from `start[0]` to `end` - 1.

    Attributes:
        start: int64 (n,), ascending: where its stretches begin.
        value: float64 (n,), what it is from there on; neighbours differ.
        end: The step before which the last stretch ends.
    """

    start: I64
    value: F64
    end: int

    @property
    def first(self) -> int:
        """The first step."""
        return int(self.start[0])

    def at(self, step: int) -> float:
        """Return what it is at a step."""
        return float(self.value[np.searchsorted(self.start, step, side="right") - 1])

    def since(self, first: int) -> "Trace":
        """Return the same from a later step on."""
        if first <= self.first:
            return self
        kept = int(np.searchsorted(self.start, first, side="right")) - 1
        start = self.start[kept:].copy()
        start[0] = first
        return Trace(start, self.value[kept:], self.end)

    def until(self, end: int) -> "Trace":
        """Return the same up to an earlier end."""
        if end >= self.end:
            return self
        kept = int(np.searchsorted(self.start, end))
        return Trace(self.start[:kept], self.value[:kept], end)

    def map(self, function: Callable[[F64], F64]) -> "Trace":
        """Return a function of it, step by step."""
        return shortest(self.start, function(self.value), self.end)

    def sliding_max(self, low: int, high: int, before: float, after: float) -> "Trace":
        """Return its greatest value from `low` to `high` steps after each step.

        Args:
            low: First step of the window, counted from the step asked about.
            high: Last step of the window.
            before: What it counts as before its first step.
            after: What it counts as from its end on.
        """
        found = signals.sliding_max(self.start, self.value, self.end, low, high, before, after)
        return Trace(*found, self.end)

    def sliding_min(self, low: int, high: int, before: float, after: float) -> "Trace":
        """Return its least value from `low` to `high` steps after each step; as `sliding_max`."""
        negative = Trace(self.start, -self.value, self.end)
        return negative.sliding_max(low, high, -before, -after).map(np.negative)

    def until_goal(self, goal: "Trace", after: float) -> "Trace":
        """Return how well it holds until another signal does, over the same steps.

        Args:
            goal: The other signal.
            after: What comes after the end of both.
        """
        start = np.union1d(self.start, goal.start)
        hold, reached = (
            t.value[np.searchsorted(t.start, start, side="right") - 1] for t in (self, goal)
        )
        return Trace(*signals.until(start, hold, reached, after), self.end)


def constant(value: float, first: int, end: int) -> Trace:
    """Return a signal that never changes."""
    return Trace(np.array([first], np.int64), np.array([value]), end)


def shortest(start: I64, value: F64, end: int) -> Trace:
    """Return a signal with stretches of equal value joined; one that is missing equals itself."""
    missing = np.isnan(value)
    differs = (value[1:] != value[:-1]) & ~(missing[1:] & missing[:-1])
    kept = np.append(True, differs)
    return Trace(start, value, end) if kept.all() else Trace(start[kept], value[kept], end)


def combine(function: Callable[..., F64], *traces: Trace) -> Trace:
    """Return a function of several signals over the same steps, step by step.

    Example:
        >>> one, two = constant(1.0, 0, 9), constant(4.0, 0, 9)
        >>> combine(np.maximum, one, two).at(5)
        4.0
    """
    start = traces[0].start
    for trace in traces[1:]:
        start = np.union1d(start, trace.start)
    values = [t.value[np.searchsorted(t.start, start, side="right") - 1] for t in traces]
    return shortest(start, function(*values), traces[0].end)


def joined(parts: Sequence[Trace]) -> Trace:
    """Return signals that follow each other as one."""
    if len(parts) == 1:
        return parts[0]
    start = np.concatenate([part.start for part in parts])
    return shortest(start, np.concatenate([part.value for part in parts]), parts[-1].end)


def pulses(steps: I64, first: int, end: int) -> Trace:
    """Return how often a step is among some steps, which needn't be in order.

    Example:
        >>> pulses(np.array([3, 3, 5]), 0, 9).value.tolist()
        [0.0, 2.0, 0.0, 1.0, 0.0]
    """
    steps = steps[(steps >= first) & (steps < end)]
    at, count = np.unique(steps, return_counts=True)
    start = np.concatenate([[first], at, at + 1])
    value = np.concatenate([[0.0], count, np.zeros(len(at))])
    # Of entries for one step the one that says how often counts: it sorts behind the zeros.
    order = np.lexsort((value, start))
    start, value = start[order], value[order]
    last = np.append(start[1:] != start[:-1], True) & (start < end)
    return shortest(start[last].astype(np.int64), value[last].astype(np.float64), end)


def spells(trace: Trace) -> list[tuple[int, int]]:
    """Return the longest stretches in which a signal is above 0, as first and last step."""
    above = np.concatenate([[False], trace.value > 0, [False]])
    edges = np.flatnonzero(above[1:] != above[:-1])
    steps = np.append(trace.start, trace.end)[edges]
    return [(int(a), int(b) - 1) for a, b in zip(steps[::2], steps[1::2], strict=True)]
