"""The operators of expectations: when something must hold, for how long, and how often."""

import operator
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from datetime import datetime, timedelta
from functools import reduce
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from fleet2d.configuration.problems import check_known, did_you_mean
from fleet2d.errors import InputError
from fleet2d.expectations.expectation import (
    INFINITE,
    WORDS,
    Expectation,
    RunSignals,
    Term,
    Trace,
    Word,
    combine,
    constant,
    joined,
    pulses,
    shortest,
)
from fleet2d.expectations.signals import Scene, Signal
from fleet2d.expectations.vocabulary import during, events, in_view, seen
from fleet2d.interactions.interaction import Outcome
from fleet2d.kernels import I64, Bool
from fleet2d.runtime.clock import midnight_of
from fleet2d.runtime.events import EventKind
from fleet2d.runtime.local_time import next_reading, written

ANSWERS = (*Outcome, EventKind.DELIVERED)
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
        """Return the last simulated step on which the judgement depends."""
        return run.end - 1

    def slack(self, run: RunSignals) -> int | None:
        """Return the steps to spare at fulfilment, below 0 if late; None without a limit."""
        return None


class Windowed(Word, Expectation):
    """Base of expectations about a window before or after each step: `within`, or all time."""

    within: Any = field(default=None, kw_only=True)  # text at first, then a timedelta or Window

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.within, self)
        super().check(scene)

    def _value_beyond(self, run: RunSignals, neutral: float, high: bool) -> float:
        return run.beyond(neutral, high=high, bounded=self.within is not None)


class Limited(Windowed, Temporal):
    """Base of expectations about the time from a step on: for `within`, or to the run's end."""

    def last(self, run: RunSignals) -> int:
        """Return the last step of the window that is known."""
        return min(run.first + run.reach(self.within)[1], run.end - 1)


class Invariant(Limited):
    """Base of expectations that something holds at every step."""

    @property
    def operand(self) -> Expectation:
        """The condition that must hold at every step."""
        raise NotImplementedError

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit of the operand."""
        return self.operand.unit

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the minimum robustness of the operand over the window starting at each step."""
        low, high_end = run.reach(self.within)
        after = self._value_beyond(run, INFINITE, high)
        return self.operand.robustness(run, high).sliding_min(low, high_end, INFINITE, after)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the stretches in which the operand doesn't hold."""
        first = run.first + run.reach(self.within)[0]
        end = self.last(run) + 1
        if first >= end:
            return []
        return violations_of(self.operand.robustness(run, True).until(end).since(first))

    def untested(self, run: RunSignals) -> str:
        """Return why nothing was tested, such as that its hours or its condition never came."""
        texts = []
        first = run.first + run.reach(self.within)[0]
        for premise in premises(self.operand):
            came = premise.robustness(run, False).since(first).until(self.last(run) + 1)
            if len(came.spells):
                return ""
            texts.append(str(premise))
        return f"{' and '.join(texts)} never came" if texts else ""


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


class eventually(Limited):
    """Expect a condition at some step, before the end of the run or `within` some time."""

    part: Expectation

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the maximum robustness of the operand over the window starting at each step."""
        low, high_end = run.reach(self.within)
        after = self._value_beyond(run, -INFINITE, high)
        return self.part.robustness(run, high).sliding_max(low, high_end, -INFINITE, after)

    def slack(self, run: RunSignals) -> int | None:
        """Return the number of steps between fulfilment and time limit."""
        return self.least_slack([run.first], run)

    def least_slack(self, steps: Sequence[int], run: RunSignals) -> int | None:
        """Return the steps between fulfilment and time limit on the worst occasion.

        Args:
            steps: The steps from which the time counts.
            run: The measured signals.

        Returns:
            The steps; None without a limit, or while all may still be fulfilled in time.
        """
        if self.within is None:
            return None
        slacks: list[int] = []
        low, high_end = run.reach(self.within)
        spans = self.part.robustness(run, False).spells  # first and last steps
        for step in steps:
            first = step + low
            deadline = step + high_end
            index = int(np.searchsorted(spans[:, 1], first))
            if index < len(spans):
                slacks.append(deadline - max(int(spans[index, 0]), first))
            elif deadline < run.end:
                slacks.append(deadline - run.end)
        return min(slacks, default=None)


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


class until(Limited):
    """Expect `hold` at every step until `goal` holds, and `goal` in time."""

    hold: Expectation
    goal: Expectation

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the maximum over later steps t of min(goal at t, minimum of `hold` before t)."""
        hold = self.hold.robustness(run, high)
        goal = self.goal.robustness(run, high)
        after = self._value_beyond(run, -INFINITE, high)
        return _until(hold, goal, None if self.within is None else run.reach(self.within), after)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return one violation, up to where `hold` failed or the goal was due."""
        failures = self.hold.robustness(run, True).map(np.negative).spells[:, 0]
        last = min([self.last(run), *failures.tolist()])
        return [v._replace(last=last, worst=last) for v in super().violations(run)]


def _until(hold: Trace, goal: Trace, reach: tuple[int, int] | None, after: float) -> Trace:
    """Return the robustness of "`hold` until `goal`" from each step on.

    Args:
        hold: The condition before the goal.
        goal: The goal, over the same steps.
        reach: The first and the last number of steps after which the goal is due; None: any.
        after: Value that is assumed from the end on.
    """
    whole = hold.until_goal(goal, after)
    if reach is None:
        return whole
    low, high = reach
    in_time = goal.sliding_max(low, high, -INFINITE, after)
    if low == 0:
        return combine(np.minimum, whole, in_time)
    before = hold.sliding_min(0, low - 1, INFINITE, INFINITE)
    later = whole.sliding_max(low, low, -INFINITE, after)
    return combine(np.minimum, before, combine(np.minimum, later, in_time))


class since(Windowed):
    """The condition that `goal` has held, by `within` ago, and `hold` at every step after it."""

    hold: Expectation
    goal: Expectation

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the robustness of `until` in reversed time."""
        hold, goal = (part.robustness(run, high).reversed for part in (self.hold, self.goal))
        reach = None if self.within is None else run.reach(self.within)
        return _until(hold, goal, reach, -INFINITE).reversed


def found(body: str, by: str) -> Expectation:
    """Return the expectation that a robot finds a person, rather than mistakes somebody for them.

    The search may end some steps after the sighting, when the robot has turned away already: so the
    person must truly have been in its view since it began to count the person as seen. What the
    robot itself believes is the event alone, `events("found", by, detail=body)`.

    >>> print(found("ana", by="astro"))
    events("found", "astro", detail="ana") and since(seen("ana", by="astro"), in_view("ana", \
by="astro"))
    """
    return events(EventKind.FOUND, by, detail=body) & since(seen(body, by=by), in_view(body, by=by))


WORDS[found.__name__] = found


class once(Windowed):
    """The condition that `part` has held at some step up to this one, or `within` the last."""

    part: Expectation

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the maximum robustness of the operand over the window that ends at each step."""
        low, high_end = run.reach(self.within)
        return self.part.robustness(run, high).sliding_max(-high_end, -low, -INFINITE, -INFINITE)


class implies(Word, Expectation):
    """The condition that `part` holds wherever `premise` does."""

    premise: Expectation
    part: Expectation

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the maximum of the negated premise and the part."""
        return (~self.premise | self.part).robustness(run, high)


def premises(operand: Term) -> list[Expectation]:
    """Return the conditions that must come true for an expectation of `operand` to be tested."""
    if isinstance(operand, implies):
        return [operand.premise]
    if isinstance(operand, during):
        return [operand]
    return [premise for part in operand.parts() for premise in premises(part)]


class after(Limited):
    """Expect a condition each time that `trigger` begins: immediately, or `within` some time.

    Each event counts by itself; lasting conditions, such as being in a room, count each time that
    they begin. Occasions whose time limit is beyond the run don't count.
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

    last = Temporal.last  # the trigger may begin at any step

    def triggered(self, run: RunSignals) -> I64:
        """Return the steps at which the trigger begins: int64 (n,), ascending."""
        return np.unique(self.trigger.occasions(run))

    def judged(self, run: RunSignals) -> I64:
        """Return the steps of occasions whose outcome the rest of the run can't change."""
        steps = self.triggered(run)
        best, worst = (self.consequence.robustness(run, high) for high in (True, False))
        return steps[(best.values(steps) < 0) | (worst.values(steps) > 0)]

    def untested(self, run: RunSignals) -> str:
        """Return why no occasion was judged."""
        if len(self.judged(run)):
            return ""
        cut = len(self.triggered(run))
        return "its trigger came only too near to the end" if cut else "its trigger never happened"

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the minimum robustness over the occasions from each step on."""
        is_occasion = pulses(self.triggered(run), run.first, run.end)
        value = self.consequence.robustness(run, high)
        value = combine(lambda on, v: np.where(on > 0, v, INFINITE), is_occasion, value)
        later = run.beyond(INFINITE, high=high, bounded=False)
        return value.sliding_min(0, run.end - run.first, INFINITE, later)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the violations of each missed occasion, from the trigger to the deadline."""
        steps = self.triggered(run)
        expected = self.consequence
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
        """Return the steps between fulfilment and time limit on the worst occasion."""
        expected = self.consequence
        if not isinstance(expected, eventually):
            return None
        return expected.least_slack(self.triggered(run).tolist(), run)


class answered(Limited):
    """Expect an answer to each request that comes up: `remind(ana) accepted within 30 min`.

    Without `within`, there is time for an answer as long as the request is open.

    Attributes:
        interaction: An interaction by its name, or all of a kind, such as `remind`.
        person: The person who is asked.
        outcome: The answer, or `delivered`.
    """

    interaction: str
    person: str
    outcome: str = EventKind.ACCEPTED

    def __post_init__(self) -> None:
        super().__post_init__()
        check_known(self.outcome, "answer", ANSWERS, InputError, "answered: ")

    def resolved(self, scene: Scene) -> Expectation:
        """Return the expectations for each of the interactions, combined.

        Raises:
            ScenarioError: There is no such interaction, or none with that person.
        """
        wanted = scene.interactions
        kinds = {each.do for each in wanted.values()}
        scene.check_name("interaction", self.interaction, [*wanted, *sorted(kinds)], self)
        names = [n for n, each in wanted.items() if self.interaction in (n, each.do)]
        people = dict.fromkeys(wanted[name].to for name in names)
        scene.check_name(f"{self.interaction} to", self.person, people, self)
        expected = (
            after(
                events(EventKind.DUE, detail=f"{name} {self.person}"),
                events(self.outcome, detail=f"{name} {self.person}"),
                within=wanted[name].within if self.within is None else self.within,
            )
            for name in names
            if wanted[name].to == self.person
        )
        return reduce(operator.and_, expected)

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Not defined, as `resolved` replaces this expectation by those for interactions."""
        raise NotImplementedError(f"{self} is judged as `resolved` returns it")


class holds_for(Word, Expectation):
    """True at steps up to which a condition has held for at least `duration`."""

    part: Expectation
    duration: Any  # a Time at first, then a timedelta

    def check(self, scene: Scene) -> None:
        """Refuse a time beyond the run."""
        scene.check_within(self.duration, self)
        super().check(scene)

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the minimum robustness of the operand over the duration that ends at each step."""
        steps = -run.steps_in(-self.duration)
        return self.part.robustness(run, high).sliding_min(-steps, 0, -INFINITE, INFINITE)


class Total(Word, Signal):
    """Base of sums over the present hour, day or week, or over the run so far.

    Outside of any time operator, a sum counts at the end of the run.
    """

    part: Expectation
    per: str | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.per is not None and self.per not in PERIODS:
            raise InputError(
                f"{self.word}: per is {self.per!r}{did_you_mean(self.per, PERIODS)} There are:"
                " hour, day, week"
            )

    def trace(self, run: RunSignals) -> Trace:
        """Return the sum at each step."""
        sum_in = self.sums(run)
        edges = [run.first, *_period_begins(run, self.per), run.end]
        return joined([sum_in(a, b) for a, b in pairwise(edges)])

    def sums(self, run: RunSignals) -> Callable[[int, int], Trace]:
        """Return a function that sums over the steps from `first` to `end` - 1."""
        raise NotImplementedError


class count(Total):
    """The number of times a condition has begun: in the present hour, day or week, or so far."""

    unit = "times"
    between = (0.0, INFINITE)

    def sums(self, run: RunSignals) -> Callable[[int, int], Trace]:
        """Return a function that counts occasions."""
        steps = np.sort(self.part.occasions(run))

        def count_in(first: int, end: int) -> Trace:
            inside = steps[(steps >= first) & (steps < end)]
            start = np.union1d([first], inside).astype(np.int64)
            return Trace(start, np.searchsorted(inside, start, side="right").astype(float), end)

        return count_in


class share(Total):
    """The share of the time in which a condition holds: in the present period, or so far.

    With `of`, only the time in which that condition holds counts; missing before its first step.
    """

    of: Expectation | None = field(default=None, kw_only=True)

    unit = "share"
    between = (0.0, 1.0)

    def sums(self, run: RunSignals) -> Callable[[int, int], Trace]:
        """Return a function that returns shares of steps."""
        part = self.part if self.of is None else self.part & self.of
        steps = np.arange(run.first, run.end, dtype=np.int64)
        holds = part.robustness(run, False).values(steps) > 0
        counts: Bool = np.ones(len(steps), np.bool_)
        if self.of is not None:
            counts = self.of.robustness(run, True).values(steps) > 0

        def share_in(first: int, end: int) -> Trace:
            inside = slice(first - run.first, end - run.first)
            with np.errstate(invalid="ignore"):
                value = np.cumsum(holds[inside]) / np.cumsum(counts[inside])
            return shortest(steps[inside], value, end)

        return share_in


class may_be_untested(Word, Temporal):
    """An expectation that may end without a test, such as `after` without its trigger."""

    part: Temporal

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.part, Temporal):
            raise InputError(f"{self.word}: expected an operator like after(…), got {self.part}")

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the robustness of the expectation."""
        return self.part.robustness(run, high)

    def violations(self, run: RunSignals) -> list[Violation]:
        """Return the violations of the expectation."""
        return self.part.violations(run)

    def slack(self, run: RunSignals) -> int | None:
        """Return the slack of the expectation."""
        return self.part.slack(run)

    def untested(self, run: RunSignals) -> str:
        """Return why the expectation was not tested."""
        return self.part.untested(run)


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
        _ = self.operand  # checks `per`

    @property
    def operand(self) -> Expectation:
        """The condition that `part` hasn't begun more often."""
        return count(self.part, per=self.per) <= self.times


def _period_begins(run: RunSignals, per: str | None) -> list[int]:
    """Return the steps at which new hours, days or weeks begin, after the first step."""
    if per is None:
        return []
    clock = run.clock
    moment = clock.time(run.first)
    latest = _period_of(moment, per)
    steps: list[int] = []
    while True:
        moment = next_reading(moment, _period_of(moment, per) + PERIODS[per])
        if (step := clock.step_at_or_after(clock.elapsed(moment))) >= run.end:
            return steps
        # The clock may have been changed before, back into a period or on into the next one.
        period = _period_of(moment, per)
        is_new = period > latest or (per == "hour" and not moment.minute)
        latest = max(latest, period)
        if is_new and step > run.first:
            steps.append(step)


def _period_of(moment: datetime, per: str) -> datetime:
    """Return the local time at which the hour, day or week of a moment began."""
    if per == "hour":
        return written(moment).replace(minute=0, second=0, microsecond=0)
    midnight = midnight_of(moment)
    return midnight - timedelta(days=midnight.weekday()) if per == "week" else midnight
