"""The operators of expectations: when something must hold, for how long, and how often."""

from dataclasses import dataclass, field, replace
from datetime import timedelta
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from fleet2d.configuration.problems import did_you_mean
from fleet2d.errors import InputError
from fleet2d.expectations.expectation import Expectation, RunSignals, Word
from fleet2d.expectations.signals import Scene, Signal
from fleet2d.expectations.traces import (
    INFINITE,
    Trace,
    combine,
    constant,
    joined,
    pulses,
)
from fleet2d.kernels import I64

PERIODS = {"hour": timedelta(hours=1), "day": timedelta(days=1), "week": timedelta(weeks=1)}


class Violation(NamedTuple):
    """A stretch of steps in which an expectation is violated.

    Attributes:
        first: The first step.
        last: The last step.
        robustness: The lowest robustness in the stretch, below 0.
        worst: The first step with that robustness; for a missed time limit, the last step by which
            it was due.
    """

    first: int
    last: int
    robustness: float
    worst: int


def violations_of(robustness: Trace) -> list[Violation]:
    """Return the maximal stretches in which a robustness is below 0, in order."""
    start, value, _ = robustness
    violations = []
    for first, last in robustness.map(lambda value: (value < 0).astype(np.float64)).spells.tolist():
        begin, end = np.searchsorted(start, [first, last + 1])
        worst = begin + int(np.argmin(value[begin:end]))
        violations.append(Violation(first, last, float(value[worst]), int(start[worst])))
    return violations


class Temporal(Expectation):
    """Base of expectations that say when something must hold, so that a run can be judged."""

    is_judged = True

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
class Windowed(Word, Temporal):
    """Base of expectations about the time from a step on: for `within`, or to the run's end."""

    within: Any = field(default=None, kw_only=True)  # of type Time, then a timedelta

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.within, self)
        super().check(scene)

    def last(self, run: RunSignals) -> int:
        """Return the last step of the window that is known."""
        return min(run.first + self._steps(run), run.end - 1)

    def _steps(self, run: RunSignals) -> int:
        return run.end - run.first if self.within is None else run.steps_in(self.within)

    def _beyond(self, run: RunSignals, neutral: float, high: bool) -> float:
        return run.beyond(neutral, high=high, bounded=self.within is not None)


class Invariant(Windowed):
    """Base of expectations that something holds at every step."""

    @property
    def operand(self) -> Expectation:
        """What must hold at every step."""
        raise NotImplementedError

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit of the operand."""
        return self.operand.unit

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the minimum robustness of the operand over the window starting at each step."""
        after = self._beyond(run, INFINITE, high)
        return self.operand.robustness(run, high).sliding_min(0, self._steps(run), INFINITE, after)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the stretches in which the operand doesn't hold."""
        return violations_of(self.operand.robustness(run, True).until(self.last(run) + 1))


@dataclass(frozen=True, eq=False)
class always(Invariant):
    """Expect a condition at every step, until the end of the run or for `within`."""

    part: Expectation

    @property
    def operand(self) -> Expectation:
        """The condition."""
        return self.part


class never(always):
    """Expect a condition at no step, until the end of the run or for `within`."""

    @property
    def operand(self) -> Expectation:
        """The opposite of the condition."""
        return ~self.part


@dataclass(frozen=True, eq=False)
class eventually(Windowed):
    """Expect a condition at some step, before the end of the run or `within` some time."""

    part: Expectation

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the maximum robustness of the operand over the window starting at each step."""
        after = self._beyond(run, -INFINITE, high)
        return self.part.robustness(run, high).sliding_max(0, self._steps(run), -INFINITE, after)

    def slack(self, run: RunSignals) -> int | None:
        """Return how many steps before the time limit it was fulfilled."""
        if self.within is None:
            return None
        return self.slack_at(run.first, self.spans(run), run)

    def spans(self, run: RunSignals) -> I64:
        """Return the stretches in which the operand holds: int64 (n, 2), first and last step."""
        return self.part.robustness(run, False).spells

    def slack_at(self, first: int, spans: I64, run: RunSignals) -> int | None:
        """Return how many steps before the deadline the first of some spans begins.

        Args:
            first: The step from which the time counts.
            spans: What `spans` returns.
            run: The measured signals.

        Returns:
            The steps; None while a span may still begin in time.
        """
        deadline, index = first + self._steps(run), int(np.searchsorted(spans[:, 1], first))
        if index == len(spans) and deadline >= run.end:
            return None
        begin = max(int(spans[index, 0]), first) if index < len(spans) else run.end
        return deadline - begin


@dataclass(frozen=True, eq=False)
class at_end(Word, Temporal):
    """Expect a condition at the last step of the run."""

    part: Expectation

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the robustness of the operand at the last step."""
        value = self.part.robustness(run, high).at(run.end - 1)
        if not run.ended:
            value = INFINITE if high else -INFINITE
        return constant(value, run.first, run.end)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the last step, if the operand doesn't hold there."""
        return [v._replace(first=v.last) for v in super().violations(run)]


@dataclass(frozen=True, eq=False)
class until(Windowed):
    """Expect `hold` at every step until `goal` holds, and `goal` in time."""

    hold: Expectation
    goal: Expectation

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the maximum over later steps t of min(goal at t, minimum of `hold` before t)."""
        hold, goal = self.hold.robustness(run, high), self.goal.robustness(run, high)
        whole = hold.until_goal(goal, self._beyond(run, -INFINITE, high))
        if self.within is None:
            return whole
        in_time = eventually(self.goal, within=self.within)
        return combine(np.minimum, whole, in_time.robustness(run, high))

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return one violation, up to where `hold` failed or the goal was due."""
        failures = self.hold.robustness(run, True).map(np.negative).spells[:, 0]
        last = min([self.last(run), *failures.tolist()])
        return [v._replace(last=last, worst=last) for v in super().violations(run)]


@dataclass(frozen=True, eq=False)
class after(Windowed):
    """Expect a condition each time that `trigger` begins: immediately, or `within` some time.

    Each event counts by itself; conditions that last, such as being in a room, count each time that
    they begin. Occasions whose time isn't over when the run ends don't count.
    """

    trigger: Expectation
    part: Expectation

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit of the expected condition."""
        return self.part.unit

    @property
    def consequence(self) -> Expectation:
        """The expectation that must hold at each step at which the trigger begins."""
        return self.part if self.within is None else eventually(self.part, within=self.within)

    def last(self, run: RunSignals) -> int:
        """Return the last step that has been simulated: the trigger may begin at any."""
        return run.end - 1

    def triggered(self, run: RunSignals) -> I64:
        """Return the steps at which the trigger begins: int64 (n,), ascending."""
        return np.unique(self.trigger.occasions(run))

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the minimum robustness over the occasions from each step on."""
        is_occasion = pulses(self.triggered(run), run.first, run.end)
        value = self.consequence.robustness(run, high)
        value = combine(lambda on, v: np.where(on > 0, v, INFINITE), is_occasion, value)
        later = run.beyond(INFINITE, high=high, bounded=False)
        return value.sliding_min(0, run.end - run.first, INFINITE, later)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the violations of each missed occasion, from the trigger to the deadline."""
        steps, expected = self.triggered(run), self.consequence
        values = expected.robustness(run, True).values(steps)
        violations = []
        for step, value in zip(steps[values < 0].tolist(), values[values < 0], strict=True):
            rest = replace(run, first=step)
            if isinstance(expected, Temporal) and not isinstance(expected, eventually):
                violations += expected.violations(rest)
                continue
            last = expected.last(rest) if isinstance(expected, eventually) else step
            violations.append(Violation(step, last, float(value), last))
        return violations

    def slack(self, run: RunSignals) -> int | None:
        """Return how many steps before the time limit it was fulfilled, on the worst occasion."""
        expected = self.consequence
        if not isinstance(expected, eventually) or expected.within is None:
            return None
        spans = expected.spans(run)
        slacks = (expected.slack_at(at, spans, run) for at in self.triggered(run).tolist())
        return min((slack for slack in slacks if slack is not None), default=None)


@dataclass(frozen=True, eq=False)
class holds_for(Word, Expectation):
    """The condition that a condition has held for at least `duration` up to this step."""

    part: Expectation
    duration: Any  # of type Time, then a timedelta

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.duration, self)
        super().check(scene)

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the minimum robustness of the operand over the steps of the duration."""
        steps = max(1, -(-self.duration // timedelta(microseconds=run.clock.step_us)))
        part = self.part.robustness(run, high)
        return part.sliding_min(1 - steps, 0, -INFINITE, INFINITE)


@dataclass(frozen=True, eq=False)
class count(Word, Signal):
    """How often a condition has begun: in the present hour, day or week, or in the run so far."""

    part: Expectation
    per: str | None = field(default=None, kw_only=True)

    unit = "times"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.per is not None and self.per not in PERIODS:
            raise InputError(
                f"count: per is {self.per!r}{did_you_mean(self.per, PERIODS)} There are: hour, day,"
                " week"
            )

    def trace(self, run: RunSignals) -> Trace:
        """Return the count at each step."""
        steps = self.part.occasions(run)
        edges = [run.first, *_period_begins(run, self.per), run.end]
        return joined([_counts(steps, a, b) for a, b in pairwise(edges)])


@dataclass(frozen=True, eq=False)
class at_most(Invariant):
    """Expect a condition to begin at most `times` times: each hour, day or week, or in the run."""

    times: int
    part: Expectation
    per: str | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if type(self.times) is not int or self.times < 0:
            raise InputError(
                "at_most: the number of times must be a whole number, 0 or more, not"
                f" {self.times!r}"
            )
        _ = self.operand  # which checks `per`

    @property
    def operand(self) -> Expectation:
        """The condition that it hasn't begun more often."""
        return count(self.part, per=self.per) <= self.times


def _counts(steps: I64, first: int, end: int) -> Trace:
    """Return how many of `steps` have passed at each step from `first` on."""
    steps = np.sort(steps[(steps >= first) & (steps < end)])
    start = np.union1d([first], steps).astype(np.int64)
    return Trace(start, np.searchsorted(steps, start, side="right").astype(np.float64), end)


def _period_begins(run: RunSignals, per: str | None) -> list[int]:
    """Return the steps at which new hours, days or weeks begin, after the first step."""
    if per is None:
        return []
    clock, length = run.clock, PERIODS[per]
    boundary = clock.time(run.first).replace(minute=0, second=0, microsecond=0)
    if per != "hour":
        boundary = boundary.replace(hour=0)
    if per == "week":
        boundary -= timedelta(days=boundary.weekday())
    steps = []
    while (step := clock.step_at_or_after(clock.elapsed(boundary := boundary + length))) < run.end:
        if step > run.first:
            steps.append(step)
    return steps
