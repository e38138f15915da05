"""Conditions on how long a condition has held, and on how often it has begun."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from itertools import pairwise

import numpy as np

from fleet2d.expectations.expectation import INFINITE, Expectation, RunSignals, UnaryExpectation
from fleet2d.expectations.formatting import call_text
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.signals import Measurement, Signal, SignalComparison
from fleet2d.expectations.temporal import Always
from fleet2d.expectations.trace import Trace, joined
from fleet2d.kernels import I64
from fleet2d.runtime.clock import Clock


@dataclass(frozen=True, eq=False)
class HoldsFor(UnaryExpectation):
    """The condition that `part` has held for at least `duration` up to this step."""

    duration: timedelta

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.duration, self)
        super().check(scene)

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the least robustness of the part over the steps of the duration."""
        steps = max(1, -(-self.duration // timedelta(microseconds=run.clock.step_us)))
        part = self.part.robustness(run, high)
        return part.sliding_min(1 - steps, 0, -INFINITE, INFINITE)

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return call_text("holds_for", self.part, self.duration)


PERIODS = {"hour": timedelta(hours=1), "day": timedelta(days=1), "week": timedelta(weeks=1)}


@dataclass(frozen=True, eq=False)
class Count(Signal):
    """The number of times that `part` has begun in the present hour, day or week, or in the run."""

    part: Expectation
    per: str | None = None

    unit = "times"

    def parts(self) -> Iterator[Expectation]:
        """Yield the expectation that is counted."""
        yield self.part

    def measures(self) -> Iterator[Measurement]:
        """Yield the signals that the counted expectation needs."""
        yield from self.part.measures()

    def check(self, scene: Scene) -> None:
        """Refuse a counted expectation that can't be in this run."""
        self.part.check(scene)

    def trace(self, run: RunSignals) -> Trace:
        """Return the count at each step."""
        steps = self.part.occasions(run)
        edges = [run.first, *_periods(run, self.per), run.end]
        return joined([_counts(steps, a, b) for a, b in pairwise(edges)])

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return call_text("count", self.part, per=self.per)


class AtMost(Always):
    """The expectation that `part` begins at most `times` times: each hour, day, week, or in all."""

    def __init__(self, times: int, part: Expectation, per: str | None) -> None:
        super().__init__(SignalComparison(Count(part, per), "<=", float(times)))
        object.__setattr__(self, "_text", call_text("at_most", times, part, per=per))

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return str(self._text)  # type: ignore[attr-defined]


def _counts(steps: I64, first: int, end: int) -> Trace:
    """Return how many of `steps` have passed at each step from `first` on."""
    at, count = np.unique(steps[(steps >= first) & (steps < end)], return_counts=True)
    start, value = np.append(first, at), np.append(0, np.cumsum(count)).astype(np.float64)
    if len(at) and at[0] == first:
        start, value = start[1:], value[1:]
    return Trace(start.astype(np.int64), value, end)


def _periods(run: RunSignals, per: str | None) -> list[int]:
    """Return the steps at which new hours, days or weeks begin, after the first step."""
    if per is None:
        return []
    clock, length = run.clock, PERIODS[per]
    start = clock.time(run.first)
    boundary = start.replace(minute=0, second=0, microsecond=0)
    if per != "hour":
        boundary = boundary.replace(hour=0)
    if per == "week":
        boundary -= timedelta(days=boundary.weekday())
    steps = []
    while (step := _step_of(clock, boundary := boundary + length)) < run.end:
        if step > run.first:
            steps.append(step)
    return steps


def _step_of(clock: Clock, time: object) -> int:
    return clock.step_at_or_after(clock.elapsed(time))  # type: ignore[arg-type]
