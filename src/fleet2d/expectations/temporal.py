"""When something must hold: always, never, eventually, at the end, until, after an occasion."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta

import numpy as np

from fleet2d.expectations.expectation import (
    INFINITE,
    Expectation,
    Known,
    OfOne,
    common_unit,
)
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.trace import I64, Trace, combine, constant, pulses, spells
from fleet2d.expectations.violation import Violation, violations_of
from fleet2d.expectations.words import call_text


@dataclass(frozen=True, eq=False)
class Temporal(Expectation):
    """What says when something must hold, so that a run can be judged by it."""

    @property
    def is_judged(self) -> bool:
        """It does."""
        return True

    def violations(self, known: Known) -> list[Violation]:
        """Return when it is violated, from the first step on: the longest stretches, in order."""
        value = self.robustness(known, True).at(known.first)
        last = self.last(known)
        return [] if value > 0 else [Violation(known.first, last, value, last)]

    def last(self, known: Known) -> int:
        """Return the last step that it is about, as far as is known."""
        return known.end - 1

    def slack(self, known: Known) -> int | None:
        """Return how many steps were left when it came about, below 0 if late; None: no limit."""
        return None


@dataclass(frozen=True, eq=False)
class Window(Temporal, OfOne):
    """Something about the time from a step on, up to so long after it, or to the run's end."""

    within: timedelta | None = None

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.within, self)
        super().check(scene)

    def last(self, known: Known) -> int:
        """Return the last step of the time, as far as is known."""
        steps = _steps(self.within, known)
        return min(known.first + steps, known.end - 1)


class Always(Window):
    """That something holds at every step."""

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return the least that is yet to come."""
        bounded, steps = self.within is not None, _steps(self.within, known)
        after = known.beyond(INFINITE, high=high, bounded=bounded)
        return self.part.robustness(known, high).sliding_min(0, steps, INFINITE, after)

    def violations(self, known: Known) -> list[Violation]:
        """Return when it doesn't hold."""
        part = self.part.robustness(known, True)
        return violations_of(part.until(self.last(known) + 1))

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("always", self.part, within=self.within)


class Never(Window):
    """That something holds at no step."""

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return the opposite of the most that is yet to come."""
        return Always(~self.part, self.within).robustness(known, high)

    def violations(self, known: Known) -> list[Violation]:
        """Return when it holds."""
        return Always(~self.part, self.within).violations(known)

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("never", self.part, within=self.within)


class Eventually(Window):
    """That something holds at some step."""

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return the most that is yet to come."""
        bounded, steps = self.within is not None, _steps(self.within, known)
        after = known.beyond(-INFINITE, high=high, bounded=bounded)
        return self.part.robustness(known, high).sliding_max(0, steps, -INFINITE, after)

    def slack(self, known: Known) -> int | None:
        """Return how many steps before its time it came about."""
        if self.within is None:
            return None
        return _slack(self.spans(known), known.first, known.steps_in(self.within), known)

    def spans(self, known: Known) -> I64:
        """Return the stretches in which it has come about: first and last step, (n, 2)."""
        return np.array(spells(self.part.robustness(known, False)), np.int64).reshape(-1, 2)

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("eventually", self.part, within=self.within)


@dataclass(frozen=True, eq=False)
class AtEnd(Temporal, OfOne):
    """That something holds at the last step of the run."""

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return what it is at the last step."""
        value = self.part.robustness(known, high).at(known.end - 1)
        if not known.ended:
            value = INFINITE if high else -INFINITE
        return constant(value, known.first, known.end)

    def violations(self, known: Known) -> list[Violation]:
        """Return the last step, if it doesn't hold there."""
        value = self.robustness(known, True).at(known.first)
        return [] if value > 0 else [Violation(known.end - 1, known.end - 1, value, known.end - 1)]

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("at_end", self.part)


@dataclass(frozen=True, eq=False)
class Until(Temporal):
    """That something holds at every step until something else does, which it must."""

    hold: Expectation
    goal: Expectation
    within: timedelta | None = None

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit that both have in common."""
        return common_unit(self.hold, self.goal)

    def parts(self) -> Iterator[Expectation]:
        """Yield what holds, and until when."""
        yield self.hold
        yield self.goal

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.within, self)
        super().check(scene)

    def last(self, known: Known) -> int:
        """Return the last step of the time, as far as is known."""
        return min(known.first + _steps(self.within, known), known.end - 1)

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return the best way to wait for the goal: its worst moment."""
        hold, goal = self.hold.robustness(known, high), self.goal.robustness(known, high)
        after = known.beyond(-INFINITE, high=high, bounded=self.within is not None)
        whole = hold.until_goal(goal, after)
        if self.within is None:
            return whole
        return combine(
            np.minimum, whole, Eventually(self.goal, self.within).robustness(known, high)
        )

    def violations(self, known: Known) -> list[Violation]:
        """Return the step at which it stopped to hold too early, or by which the goal was due."""
        value = self.robustness(known, True).at(known.first)
        if value > 0:
            return []
        broken = spells(self.hold.robustness(known, True).map(np.negative))
        last = min([self.last(known), *(first for first, _ in broken)])
        return [Violation(known.first, last, value, last)]

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("until", self.hold, self.goal, within=self.within)


@dataclass(frozen=True, eq=False)
class After(Temporal):
    """That each time something begins, something else holds then, or comes about in time."""

    trigger: Expectation
    part: Expectation
    within: timedelta | None = None

    @property
    def unit(self) -> str:  # type: ignore[override]
        """That of what must hold."""
        return self.part.unit

    @property
    def consequence(self) -> Expectation:
        """What must hold when the trigger begins."""
        return self.part if self.within is None else Eventually(self.part, self.within)

    def parts(self) -> Iterator[Expectation]:
        """Yield the trigger, and what must hold."""
        yield self.trigger
        yield self.part

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.within, self)
        super().check(scene)

    def triggered(self, known: Known) -> I64:
        """Return when the trigger begins."""
        return np.unique(self.trigger.occasions(known))

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return what it is on the worst occasion yet to come."""
        value = self._on_occasions(known, high)
        after = known.beyond(INFINITE, high=high, bounded=False)
        return value.sliding_min(0, known.end - known.first, INFINITE, after)

    def _on_occasions(self, known: Known, high: bool) -> Trace:
        """Return what it is on each occasion, and infinite in between."""
        is_occasion = pulses(self.triggered(known), known.first, known.end)
        value = self.consequence.robustness(known, high)
        return combine(lambda on, v: np.where(on > 0, v, INFINITE), is_occasion, value)

    def violations(self, known: Known) -> list[Violation]:
        """Return from when to when it was waited for in vain, or not so, occasion by occasion."""
        value = self._on_occasions(known, True)
        missed = value.start[value.value < 0]
        ends = np.append(value.start[1:], value.end)[value.value < 0]
        steps = [
            s for a, b in zip(missed.tolist(), ends.tolist(), strict=True) for s in range(a, b)
        ]
        found = []
        for step in steps:
            later = _from(known, step)
            inner = self.consequence
            if isinstance(inner, Eventually) or not isinstance(inner, Temporal):
                last = inner.last(later) if isinstance(inner, Eventually) else step
                found.append(Violation(step, last, value.at(step), last))
            else:
                found += inner.violations(later)
        return found

    def slack(self, known: Known) -> int | None:
        """Return how many steps before its time it came about, on the worst occasion."""
        inner = self.consequence
        if not isinstance(inner, Eventually) or inner.within is None:
            return None
        came, steps = inner.spans(known), known.steps_in(inner.within)
        slacks = (_slack(came, at, steps, known) for at in self.triggered(known).tolist())
        return min((slack for slack in slacks if slack is not None), default=None)

    def __str__(self) -> str:
        """Write it as it is read."""
        return call_text("after", self.trigger, self.part, within=self.within)


def _steps(within: timedelta | None, known: Known) -> int:
    return known.end - known.first if within is None else known.steps_in(within)


def _slack(spans: I64, first: int, steps: int, known: Known) -> int | None:
    """Return how many steps are left of the time when the first of some spans has come.

    None as long as it may still come in time.
    """
    at = int(np.searchsorted(spans[:, 1], first))
    if at == len(spans) and first + steps >= known.end:
        return None
    came = max(int(spans[at, 0]), first) if at < len(spans) else known.end
    return first + steps - came


def _from(known: Known, step: int) -> Known:
    return Known(known.traces, known.words, step, known.end, known.ended, known.clock)
