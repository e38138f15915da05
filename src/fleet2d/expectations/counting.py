"""How long something has held, and how often it has begun."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from itertools import pairwise

import numpy as np

from fleet2d.clock import Clock
from fleet2d.expectations.expectation import INFINITE, Expectation, Known, OfOne
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.signals import Comparison, Measured, Signal
from fleet2d.expectations.temporal import Always
from fleet2d.expectations.trace import I64, Trace, joined
from fleet2d.expectations.words import call_text


@dataclass(frozen=True, eq=False)
class HoldsFor(OfOne):
    """That something has held for at least so long, at this step and those before."""

    duration: timedelta

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.duration, self)
        super().check(scene)

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return the least of the time that it has taken."""
        steps = max(1, -(-self.duration // timedelta(microseconds=known.clock.step_us)))
        part = self.part.robustness(known, high)
        return part.sliding_min(1 - steps, 0, -INFINITE, INFINITE)

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("holds_for", self.part, self.duration)


PERIODS = {"hour": timedelta(hours=1), "day": timedelta(days=1), "week": timedelta(weeks=1)}


@dataclass(frozen=True, eq=False)
class Count(Signal):
    """How often something has begun so far: in this hour, day or week by the clock, or at all."""

    part: Expectation
    per: str | None = None

    unit = "times"
    __hash__ = object.__hash__

    def parts(self) -> Iterator[Expectation]:
        """Yield what is counted."""
        yield self.part

    def measures(self) -> Iterator[Measured]:
        """Yield what has to be measured for it."""
        yield from self.part.measures()

    def check(self, scene: Scene) -> None:
        """Refuse what can't be."""
        self.part.check(scene)

    def trace(self, known: Known) -> Trace:
        """Return the count."""
        steps = self.part.occasions(known)
        edges = [known.first, *_periods(known, self.per), known.end]
        return joined([_counts(steps, a, b) for a, b in pairwise(edges)])

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("count", self.part, per=self.per)


class AtMost(Always):
    """That something begins at most so many times, in each hour, day or week, or at all."""

    def __init__(self, times: int, part: Expectation, per: str | None) -> None:
        super().__init__(Comparison(Count(part, per), "<=", float(times)))
        object.__setattr__(self, "_text", call_text("at_most", times, part, per=per))

    def __str__(self) -> str:
        """Write it as it is read."""
        return str(self._text)  # type: ignore[attr-defined]


def _counts(steps: I64, first: int, end: int) -> Trace:
    """Return how many of some steps have been, from `first` on."""
    at, count = np.unique(steps[(steps >= first) & (steps < end)], return_counts=True)
    start, value = np.append(first, at), np.append(0, np.cumsum(count)).astype(np.float64)
    if len(at) and at[0] == first:
        start, value = start[1:], value[1:]
    return Trace(start.astype(np.int64), value, end)


def _periods(known: Known, per: str | None) -> list[int]:
    """Return the steps at which new hours, days or weeks begin, after the first step."""
    if per is None:
        return []
    clock, length = known.clock, PERIODS[per]
    now = clock.time(known.first)
    begin = now.replace(minute=0, second=0, microsecond=0)
    if per != "hour":
        begin = begin.replace(hour=0)
    if per == "week":
        begin -= timedelta(days=begin.weekday())
    steps = []
    while (step := _step_of(clock, begin := begin + length)) < known.end:
        if step > known.first:
            steps.append(step)
    return steps


def _step_of(clock: Clock, moment: object) -> int:
    return clock.step_at_or_after(clock.elapsed(moment))  # type: ignore[arg-type]
