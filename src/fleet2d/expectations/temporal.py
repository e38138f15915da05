"""The operators of expectations: when something must hold, for how long, and how often."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from datetime import timedelta
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from fleet2d.configuration.problems import did_you_mean
from fleet2d.errors import InputError
from fleet2d.expectations.expectation import (
    INFINITE,
    Expectation,
    RunSignals,
    Trace,
    UnaryExpectation,
    Word,
    call_text,
    combine,
    common_unit,
    condition,
    constant,
    duration,
    joined,
    pulses,
    spells,
)
from fleet2d.expectations.signals import Measurement, Scene, Signal, SignalComparison
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
class Windowed(Temporal, Word):
    """Base of expectations about the time from a step on: for `within`, or to the run's end."""

    within: Any = field(default=None, kw_only=True)  # of type Time, then a timedelta

    def __post_init__(self) -> None:
        self._set(within=duration(self.within, "within"))
        for part in self.parts():
            condition(part, self.word)

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.within, self)
        super().check(scene)

    def last(self, run: RunSignals) -> int:
        """Return the last step of the window that is known."""
        return min(run.first + self._steps(run), run.end - 1)

    def _steps(self, run: RunSignals) -> int:
        return run.end - run.first if self.within is None else run.steps_in(self.within)


@dataclass(frozen=True, eq=False)
class always(Windowed, UnaryExpectation):
    """Expect a condition at every step, until the end of the run or for `within`."""

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the minimum robustness of the operand over the window starting at each step."""
        after = run.beyond(INFINITE, high=high, bounded=self.within is not None)
        return self.part.robustness(run, high).sliding_min(0, self._steps(run), INFINITE, after)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the stretches in which the operand doesn't hold."""
        part = self.part.robustness(run, True)
        return violations_of(part.until(self.last(run) + 1))


@dataclass(frozen=True, eq=False)
class never(Windowed, UnaryExpectation):
    """Expect a condition at no step, until the end of the run or for `within`."""

    @property
    def _opposite(self) -> always:
        return always(~self.part, within=self.within)

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the negated maximum robustness of the operand over the window of each step."""
        return self._opposite.robustness(run, high)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the stretches in which the operand holds."""
        return self._opposite.violations(run)


@dataclass(frozen=True, eq=False)
class eventually(Windowed, UnaryExpectation):
    """Expect a condition at some step, before the end of the run or `within` some time."""

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the maximum robustness of the operand over the window starting at each step."""
        after = run.beyond(-INFINITE, high=high, bounded=self.within is not None)
        return self.part.robustness(run, high).sliding_max(0, self._steps(run), -INFINITE, after)

    def slack(self, run: RunSignals) -> int | None:
        """Return how many steps before the time limit it was fulfilled."""
        if self.within is None:
            return None
        return self.slack_at(run.first, self.spans(run), run)

    def spans(self, run: RunSignals) -> I64:
        """Return the stretches in which the operand holds: int64 (n, 2), first and last step."""
        return np.array(spells(self.part.robustness(run, False)), np.int64).reshape(-1, 2)

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
class at_end(Temporal, UnaryExpectation, Word):
    """Expect a condition at the last step of the run."""

    def __post_init__(self) -> None:
        condition(self.part, self.word)

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the robustness of the operand at the last step."""
        value = self.part.robustness(run, high).at(run.end - 1)
        if not run.ended:
            value = INFINITE if high else -INFINITE
        return constant(value, run.first, run.end)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the last step, if the operand doesn't hold there."""
        value = self.robustness(run, True).at(run.first)
        return [] if value > 0 else [Violation(run.end - 1, run.end - 1, value, run.end - 1)]


@dataclass(frozen=True, eq=False)
class until(Windowed):
    """Expect `hold` at every step until `goal` holds, and `goal` in time."""

    hold: Expectation
    goal: Expectation

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit that both have in common."""
        return common_unit(self.hold, self.goal)

    def parts(self) -> Iterator[Expectation]:
        """Yield `hold` and `goal`."""
        yield self.hold
        yield self.goal

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the maximum over later steps t of min(goal at t, minimum of `hold` before t)."""
        hold, goal = self.hold.robustness(run, high), self.goal.robustness(run, high)
        after = run.beyond(-INFINITE, high=high, bounded=self.within is not None)
        whole = hold.until_goal(goal, after)
        if self.within is None:
            return whole
        in_time = eventually(self.goal, within=self.within)
        return combine(np.minimum, whole, in_time.robustness(run, high))

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return one violation, up to where `hold` failed or the goal was due."""
        value = self.robustness(run, True).at(run.first)
        if value > 0:
            return []
        failures = spells(self.hold.robustness(run, True).map(np.negative))
        last = min([self.last(run), *(first for first, _ in failures)])
        return [Violation(run.first, last, value, last)]


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

    def parts(self) -> Iterator[Expectation]:
        """Yield the trigger and the expected condition."""
        yield self.trigger
        yield self.part

    def last(self, run: RunSignals) -> int:
        """Return the last step that has been simulated: the trigger may begin at any."""
        return run.end - 1

    def triggered(self, run: RunSignals) -> I64:
        """Return the steps at which the trigger begins: int64 (n,), ascending."""
        return np.unique(self.trigger.occasions(run))

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the minimum robustness over the occasions from each step on."""
        value = self._on_occasions(run, high)
        later = run.beyond(INFINITE, high=high, bounded=False)
        return value.sliding_min(0, run.end - run.first, INFINITE, later)

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
        violations, expected = [], self.consequence
        for begin, end in zip(missed.tolist(), ends.tolist(), strict=True):
            for step in range(begin, end):
                rest = replace(run, first=step)
                if isinstance(expected, eventually) or not isinstance(expected, Temporal):
                    last = expected.last(rest) if isinstance(expected, eventually) else step
                    violations.append(Violation(step, last, value.at(step), last))
                else:
                    violations += expected.violations(rest)
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
class holds_for(UnaryExpectation, Word):
    """The condition that a condition has held for at least `duration` up to this step."""

    duration: Any  # of type Time, then a timedelta

    def __post_init__(self) -> None:
        condition(self.part, self.word)
        self._set(duration=duration(self.duration, self.word))

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
class count(Signal):
    """How often a condition has begun: in the present hour, day or week, or in the run so far."""

    part: Expectation
    per: str | None = field(default=None, kw_only=True)

    unit = "times"

    def __post_init__(self) -> None:
        if self.per is not None and self.per not in PERIODS:
            raise InputError(
                f"count: per is {self.per!r}{did_you_mean(self.per, PERIODS)} There are: hour, day,"
                " week"
            )
        condition(self.part, "count")

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
        edges = [run.first, *_period_begins(run, self.per), run.end]
        return joined([_counts(steps, a, b) for a, b in pairwise(edges)])


class at_most(always):
    """Expect a condition to begin at most `times` times: each hour, day or week, or in the run."""

    def __init__(self, times: int, part: Expectation, *, per: str | None = None) -> None:
        if type(times) is not int or times < 0:
            raise InputError(
                f"at_most: the number of times must be a whole number, 0 or more, not {times!r}"
            )
        super().__init__(SignalComparison(count(part, per=per), "<=", float(times)))
        self._set(_text=call_text("at_most", times, part, per=per))

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return str(self._text)  # type: ignore[attr-defined]


def _counts(steps: I64, first: int, end: int) -> Trace:
    """Return how many of `steps` have passed at each step from `first` on."""
    at, passed = np.unique(steps[(steps >= first) & (steps < end)], return_counts=True)
    start, value = np.append(first, at), np.append(0, np.cumsum(passed)).astype(np.float64)
    if len(at) and at[0] == first:
        start, value = start[1:], value[1:]
    return Trace(start.astype(np.int64), value, end)


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
