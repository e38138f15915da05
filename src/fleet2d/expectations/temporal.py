"""Temporal operators: always, never, eventually, at the end, until, after a trigger."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from typing import ClassVar

import numpy as np

from fleet2d.expectations.expectation import (
    INFINITE,
    Expectation,
    RunSignals,
    UnaryExpectation,
    common_unit,
)
from fleet2d.expectations.formatting import call_text
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.trace import Trace, combine, constant, pulses, spells
from fleet2d.expectations.violation import Violation, violations_of
from fleet2d.kernels import I64


@dataclass(frozen=True, eq=False)
class Temporal(Expectation):
    """Base of expectations that say when something must hold, so that a run can be judged."""

    @property
    def is_judged(self) -> bool:
        """True: it has a time operator."""
        return True

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the violations from the first judged step on: maximal stretches, in order."""
        value = self.robustness(run, True).at(run.first)
        last = self.last(run)
        return [] if value > 0 else [Violation(run.first, last, value, last)]

    def last(self, run: RunSignals) -> int:
        """Return the last step that the judgement depends on and that has been simulated."""
        return run.end - 1

    def slack(self, run: RunSignals) -> int | None:
        """Return the steps to spare when it was fulfilled, below 0 if late; None: no limit."""
        return None


@dataclass(frozen=True, eq=False)
class WindowedExpectation(Temporal, UnaryExpectation):
    """Base of expectations about the time from a step on: for `within`, or to the run's end."""

    within: timedelta | None = None

    word: ClassVar[str]

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return call_text(self.word, self.part, within=self.within)

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.within, self)
        super().check(scene)

    def last(self, run: RunSignals) -> int:
        """Return the last step of the window that is known."""
        steps = _steps(self.within, run)
        return min(run.first + steps, run.end - 1)


class Always(WindowedExpectation):
    """The expectation that `part` holds at every step."""

    word = "always"

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the least robustness of the part over the window from each step on."""
        bounded, steps = self.within is not None, _steps(self.within, run)
        after = run.beyond(INFINITE, high=high, bounded=bounded)
        return self.part.robustness(run, high).sliding_min(0, steps, INFINITE, after)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the stretches in which the part doesn't hold."""
        part = self.part.robustness(run, True)
        return violations_of(part.until(self.last(run) + 1))


class Never(WindowedExpectation):
    """The expectation that `part` holds at no step."""

    word = "never"

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return minus the greatest robustness of the part over the window from each step on."""
        return Always(~self.part, self.within).robustness(run, high)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the stretches in which the part holds."""
        return Always(~self.part, self.within).violations(run)


class Eventually(WindowedExpectation):
    """The expectation that `part` holds at some step."""

    word = "eventually"

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the greatest robustness of the part over the window from each step on."""
        bounded, steps = self.within is not None, _steps(self.within, run)
        after = run.beyond(-INFINITE, high=high, bounded=bounded)
        return self.part.robustness(run, high).sliding_max(0, steps, -INFINITE, after)

    def slack(self, run: RunSignals) -> int | None:
        """Return how many steps before the time limit it was fulfilled."""
        if self.within is None:
            return None
        return _slack(self.spans(run), run.first, run.steps_in(self.within), run)

    def spans(self, run: RunSignals) -> I64:
        """Return the stretches in which the part holds: int64 (n, 2), first and last step."""
        return np.array(spells(self.part.robustness(run, False)), np.int64).reshape(-1, 2)


@dataclass(frozen=True, eq=False)
class AtEnd(Temporal, UnaryExpectation):
    """The expectation that `part` holds at the last step of the run."""

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the robustness of the part at the last step."""
        value = self.part.robustness(run, high).at(run.end - 1)
        if not run.ended:
            value = INFINITE if high else -INFINITE
        return constant(value, run.first, run.end)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the last step, if the part doesn't hold there."""
        value = self.robustness(run, True).at(run.first)
        return [] if value > 0 else [Violation(run.end - 1, run.end - 1, value, run.end - 1)]

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return call_text("at_end", self.part)


@dataclass(frozen=True, eq=False)
class Until(Temporal):
    """The expectation that `hold` holds until `goal` holds, and that `goal` does hold."""

    hold: Expectation
    goal: Expectation
    within: timedelta | None = None

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit that both have in common."""
        return common_unit(self.hold, self.goal)

    def parts(self) -> Iterator[Expectation]:
        """Yield `hold` and `goal`."""
        yield self.hold
        yield self.goal

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.within, self)
        super().check(scene)

    def last(self, run: RunSignals) -> int:
        """Return the last step of the time limit that is known."""
        return min(run.first + _steps(self.within, run), run.end - 1)

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the maximum over later steps t of min(goal at t, least `hold` before t)."""
        hold, goal = self.hold.robustness(run, high), self.goal.robustness(run, high)
        after = run.beyond(-INFINITE, high=high, bounded=self.within is not None)
        whole = hold.until_goal(goal, after)
        if self.within is None:
            return whole
        return combine(np.minimum, whole, Eventually(self.goal, self.within).robustness(run, high))

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return one violation, up to where `hold` failed or the goal was due."""
        value = self.robustness(run, True).at(run.first)
        if value > 0:
            return []
        failures = spells(self.hold.robustness(run, True).map(np.negative))
        last = min([self.last(run), *(first for first, _ in failures)])
        return [Violation(run.first, last, value, last)]

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return call_text("until", self.hold, self.goal, within=self.within)


@dataclass(frozen=True, eq=False)
class After(Temporal):
    """The expectation that whenever `trigger` begins, `part` holds at once, or in time."""

    trigger: Expectation
    part: Expectation
    within: timedelta | None = None

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit of `part`."""
        return self.part.unit

    @property
    def consequence(self) -> Expectation:
        """The expectation that must hold at each step at which the trigger begins."""
        return self.part if self.within is None else Eventually(self.part, self.within)

    def parts(self) -> Iterator[Expectation]:
        """Yield `trigger` and `part`."""
        yield self.trigger
        yield self.part

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.within, self)
        super().check(scene)

    def triggered(self, run: RunSignals) -> I64:
        """Return the steps at which the trigger begins: int64 (n,), ascending."""
        return np.unique(self.trigger.occasions(run))

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the least robustness over the occasions from each step on."""
        value = self._on_occasions(run, high)
        after = run.beyond(INFINITE, high=high, bounded=False)
        return value.sliding_min(0, run.end - run.first, INFINITE, after)

    def _on_occasions(self, run: RunSignals, high: bool) -> Trace:
        """Return the robustness at each occasion, and infinity between occasions."""
        is_occasion = pulses(self.triggered(run), run.first, run.end)
        value = self.consequence.robustness(run, high)
        return combine(lambda on, v: np.where(on > 0, v, INFINITE), is_occasion, value)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the violations of each missed occasion, from the trigger to the deadline."""
        value = self._on_occasions(run, True)
        missed = value.start[value.value < 0]
        ends = np.append(value.start[1:], value.end)[value.value < 0]
        steps = [
            s for a, b in zip(missed.tolist(), ends.tolist(), strict=True) for s in range(a, b)
        ]
        violations = []
        for step in steps:
            rest = _from(run, step)
            expected = self.consequence
            if isinstance(expected, Eventually) or not isinstance(expected, Temporal):
                last = expected.last(rest) if isinstance(expected, Eventually) else step
                violations.append(Violation(step, last, value.at(step), last))
            else:
                violations += expected.violations(rest)
        return violations

    def slack(self, run: RunSignals) -> int | None:
        """Return how many steps before the time limit it was fulfilled, on the worst occasion."""
        expected = self.consequence
        if not isinstance(expected, Eventually) or expected.within is None:
            return None
        spans, steps = expected.spans(run), run.steps_in(expected.within)
        slacks = (_slack(spans, at, steps, run) for at in self.triggered(run).tolist())
        return min((slack for slack in slacks if slack is not None), default=None)

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return call_text("after", self.trigger, self.part, within=self.within)


def _steps(within: timedelta | None, run: RunSignals) -> int:
    return run.end - run.first if within is None else run.steps_in(within)


def _slack(spans: I64, first: int, steps: int, run: RunSignals) -> int | None:
    """Return how many steps before the deadline the first of some spans begins.

    None while it may still begin in time.
    """
    index = int(np.searchsorted(spans[:, 1], first))
    if index == len(spans) and first + steps >= run.end:
        return None
    begin = max(int(spans[index, 0]), first) if index < len(spans) else run.end
    return first + steps - begin


def _from(run: RunSignals, step: int) -> RunSignals:
    return RunSignals(run.traces, run.words, step, run.end, run.ended, run.clock)
