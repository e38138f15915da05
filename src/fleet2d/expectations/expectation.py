"""Expectations: conditions on a run, with the margin by which they hold or fail.

An expectation has a robustness at each step, as in signal temporal logic (Donzé and Maler, 2010):
above 0 it holds there, below 0 it doesn't, and the absolute value is the margin. It is never 0: for
a signal exactly at its limit it is plus or minus the smallest normal float64, as the comparison
holds there or not. Robustness and signals are traces: stretches of steps with equal values.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import timedelta
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, dataclass_transform

import numpy as np
from pydantic_core import PydanticCustomError

from fleet2d.configuration.units import format_duration, micros, parse_duration
from fleet2d.errors import InputError, errors_as
from fleet2d.kernels import F64, I64, Bool, sliding_max, until
from fleet2d.runtime.clock import Clock

if TYPE_CHECKING:
    from fleet2d.expectations.signals import Scene


INFINITE = float("inf")
TINY = float(np.finfo(np.float64).tiny)

Time = str | float | timedelta
"""A duration: text such as "2 min", seconds, or a timedelta."""
MIXED = "mixed"
WORDS: dict[str, Callable[..., Any]] = {}
"""The classes that a text may call, by name: those derived from `Word` in small letters."""


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


def stepwise(first: int, value: float, changes: Iterable[tuple[int, float]], end: int) -> Trace:
    """Return the trace of a value at the first step that only changes at some steps, in order.

    Example:
        >>> stepwise(0, 1.0, [(3, 2.0), (3, 4.0)], 9).value.tolist()
        [1.0, 4.0]
    """
    starts = [first]
    values = [value]
    for step, now in changes:
        if step > starts[-1]:
            starts.append(step)
            values.append(now)
        else:
            values[-1] = now
    return shortest(np.array(starts, np.int64), np.array(values, np.float64), end)


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


class Window(NamedTuple):
    """A time limit with a begin and an end, both included: 1 min..2 min later."""

    begin: timedelta
    end: timedelta


@dataclass(frozen=True)
class RunSignals:
    """The measured signals of a run, as far as they are known.

    Attributes:
        traces: The measured values, by the text of each signal.
        words: For each signal of words, the words of each of its values, the name first.
        first: The first judged step.
        end: One past the last step that is known.
        ended: Whether the run is over.
        clock: The clock of the run.
    """

    traces: Mapping[str, Trace]
    words: Mapping[str, Mapping[int, Sequence[str]]]
    first: int
    end: int
    ended: bool
    clock: Clock

    def beyond(self, neutral: float, *, high: bool, bounded: bool) -> float:
        """Return the robustness assumed after the last known step.

        Args:
            neutral: The neutral value of the operator.
            high: Whether the best case is assumed for steps still to come, or the worst.
            bounded: Whether the operator has a time limit, which may lie beyond the run's end.
        """
        if self.ended and not bounded:
            return neutral
        return INFINITE if high else -INFINITE

    def steps_in(self, duration: timedelta) -> int:
        """Return the number of whole steps in a duration."""
        return micros(duration) // self.clock.step_us

    def reach(self, within: timedelta | Window | None) -> tuple[int, int]:
        """Return how many steps later a time limit begins and ends; None ends with the run."""
        if within is None:
            return 0, self.end - self.first
        if isinstance(within, Window):
            return -self.steps_in(-within.begin), self.steps_in(within.end)
        return 0, self.steps_in(within)


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
class Term:
    """A part of an expectation: a signal or a condition, whose fields hold further terms.

    Each class derived from it is a frozen dataclass.
    """

    unit: str = ""
    """Unit of its values; empty for conditions that are only true or false."""

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, eq=False)(cls)

    def parts(self) -> "Iterator[Term]":
        """Yield the terms that it consists of."""
        for each in fields(self):  # type: ignore[arg-type]
            if isinstance(value := getattr(self, each.name), Term):
                yield value

    def named(self) -> "Iterator[str | Term]":
        """Yield the names in its signals, but not those in its conditions."""
        for part in self.parts():
            if not isinstance(part, Expectation):
                yield from part.named()

    def with_name(self, old: "str | Term", new: str) -> Self:
        """Return a copy about another name."""

        def renamed(value: Any) -> Any:
            are_names = isinstance(value, str) and isinstance(old, str)
            if value is old or (are_names and value == old):
                return new
            return value.with_name(old, new) if isinstance(value, Term) else value

        return self._rebuilt(renamed)

    def resolved(self, scene: "Scene") -> Any:
        """Return a copy about names of the run, in place of `anyone` and the like.

        A condition about `anyone` holds if it does for one person, one about `everyone` if it does
        for all; one about `nearest(ana)` is about the nearest body at each step.

        Raises:
            ScenarioError: There is nobody.
        """
        return self._rebuilt(lambda part: part.resolved(scene) if isinstance(part, Term) else part)

    def _rebuilt(self, change: Callable[[Any], Any]) -> Self:
        """Return a copy with changed fields, itself if none changes."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]
        changes = {name: new for name, old in values.items() if (new := change(old)) is not old}
        return replace(self, **changes) if changes else self  # type: ignore[type-var]

    def check(self, scene: "Scene") -> None:
        """Refuse names and signals that the run doesn't have, part by part.

        Raises:
            ScenarioError: A name is unknown, or the condition can never happen.
        """
        for part in self.parts():
            part.check(scene)

    def measures(self) -> Iterator[Any]:
        """Yield the signals that have to be measured."""
        for part in self.parts():
            yield from part.measures()


class Expectation(Term, ABC):
    """A condition that holds or doesn't at each step of a run.

    Combine them by `&`, `|` and `~`.
    """

    is_call: ClassVar[bool] = True
    """Whether its text is a call, which needs no brackets."""
    is_instant = False
    """Whether it is about events, each of which counts by itself."""

    @property
    def unit(self) -> str:  # type: ignore[override]
        """Unit of its robustness: that of its parts, `MIXED` if they differ."""
        units = {part.unit for part in self.parts()} - {""}
        return MIXED if len(units) > 1 else "".join(units)

    @abstractmethod
    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the margin by which it holds from each step on.

        Args:
            run: The measured signals of the run.
            high: Whether the best case is assumed for steps that aren't known yet, or the worst.
        """

    def resolved(self, scene: "Scene") -> "Expectation":
        """Return a copy about names of the run; see `Term.resolved`."""
        for name in self.named():
            if (meant := scene.meant(name, self)) is not None:
                return meant.resolved(scene)
        return super().resolved(scene)

    def untested(self, run: RunSignals) -> str:
        """Return why the run didn't test it, for a message; empty if the run did."""
        return ""

    def occasions(self, run: RunSignals) -> I64:
        """Return the steps at which it certainly begins to hold."""
        return self.robustness(run, False).spells[:, 0]

    @property
    def is_judged(self) -> bool:
        """Whether it has a time operator, so that a run as a whole can be judged by it."""
        return any(getattr(part, "is_judged", False) for part in self.parts())

    def __and__(self, other: "Expectation") -> "Expectation":
        """Expect both."""
        return And(self, _checked(other, "&"))

    def __or__(self, other: "Expectation") -> "Expectation":
        """Expect at least one of both."""
        return Or(self, _checked(other, "|"))

    def __invert__(self) -> "Expectation":
        """Expect the opposite."""
        return Not(self)

    def __bool__(self) -> bool:
        """Refuse `and`, `or` and `not`, which can't be overloaded in Python."""
        raise InputError(
            "an expectation is neither true nor false before the run: write & | ~ instead of and,"
            " or, not (and put comparisons in brackets), and two comparisons instead of a < x < b"
        )


class Not(Expectation):
    """The negation of a condition."""

    part: Expectation
    is_call = False

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the negated robustness of the operand, whose worst case is its best case."""
        return self.part.robustness(run, not high).map(np.negative)

    def untested(self, run: RunSignals) -> str:
        """Return why the operand was not tested."""
        return self.part.untested(run)

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return f"not {bracketed(self.part)}"


class And(Expectation):
    """The conjunction of two parts: both hold."""

    one: Expectation
    other: Expectation
    is_call = False
    word: ClassVar[str] = "and"
    choose: ClassVar[Callable[..., F64]] = np.minimum

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the minimum of both parts, or the maximum for `Or`."""
        parts = (part.robustness(run, high) for part in (self.one, self.other))
        return combine(type(self).choose, *parts)

    @property
    def is_instant(self) -> bool:  # type: ignore[override]
        """Whether one of the parts is about events; of `Or`, whether both are."""
        return self.one.is_instant or self.other.is_instant

    def occasions(self, run: RunSignals) -> I64:
        """Return the steps at which it begins to hold, or those of its events."""
        if not self.is_instant:
            return super().occasions(run)
        steps = (self.one if self.one.is_instant else self.other).occasions(run)
        return steps[self.robustness(run, False).values(steps) > 0]

    def untested(self, run: RunSignals) -> str:
        """Return why one of the parts was not tested, or for `Or`, why none was."""
        reasons = [part.untested(run) for part in (self.one, self.other)]
        return "" if self.word == "or" and "" in reasons else "".join(reasons[:1]) or reasons[1]

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return f"{bracketed(self.one)} {self.word} {bracketed(self.other)}"


class Or(And):
    """The disjunction of two parts: one holds, or both."""

    word = "or"
    choose = np.maximum

    @property
    def is_instant(self) -> bool:  # type: ignore[override]
        """Whether both parts are about events."""
        return self.one.is_instant and self.other.is_instant

    def occasions(self, run: RunSignals) -> I64:
        """Return the steps at which it begins to hold, or those of all its events."""
        if not self.is_instant:
            return super().occasions(run)
        return np.concatenate([part.occasions(run) for part in (self.one, self.other)])


def bracketed(part: Expectation) -> str:
    """Return the text of a part, in brackets unless it is a call."""
    return str(part) if part.is_call else f"({part})"


def truth(value: F64 | Bool) -> F64:
    """Return the robustness of a condition that is true where `value` is above 0."""
    return np.where(value > 0, INFINITE, -INFINITE)


def _checked(other: object, sign: str) -> Expectation:
    if not isinstance(other, Expectation):
        raise InputError(
            f"{sign}: expected an expectation, got {other!r}; put comparisons in brackets, as in"
            ' (distance("ana", "astro") > 0.5) & moving("astro")'
        )
    return other


class Word:
    """Base of the terms of expectations, in text and in Python.

    Its class has the name of the word, like `range` or `map`; its fields are the arguments. Fields
    that may only be given by name are also written by name.
    """

    word: ClassVar[str]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if cls.__name__.islower():
            cls.word = cls.__dict__.get("word", cls.__name__)
            WORDS[cls.__name__] = cls

    def __post_init__(self) -> None:
        """Check that conditions are conditions, and read durations."""
        for each in fields(self):  # type: ignore[arg-type]
            value = getattr(self, each.name)
            if each.type is Expectation and not isinstance(value, Expectation):
                raise InputError(
                    f"{self.word}: {value} is not a condition, which holds or doesn't: compare it,"
                    ' as in distance("ana", "astro") > 0.5, or room("ana") == "kitchen"'
                )
            if each.name == "duration":
                self._set(duration=_duration(value, self.word))
            elif each.name == "within" and value is not None:
                self._set(within=_window(value))

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        arguments = []
        for each in sorted(fields(self), key=lambda each: bool(each.kw_only)):  # type: ignore[arg-type]
            if (value := getattr(self, each.name)) is not None:
                name = f"{each.name}=" if each.kw_only or each.metadata.get("named") else ""
                arguments.append(f"{name}{argument_text(value)}")
        return f"{self.word}({', '.join(arguments)})"

    def _set(self, **values: Any) -> None:
        """Set fields of a frozen dataclass, while it is made."""
        for name, value in values.items():
            object.__setattr__(self, name, value)


def _duration(value: Any, label: str) -> timedelta:
    with errors_as(InputError, label, of=PydanticCustomError):
        return parse_duration(value)


def _window(value: Any) -> timedelta | Window:
    """Read a time limit: a duration, or two, as "1..2 min" or a pair.

    Raises:
        InputError: It can't be read, or ends before it begins.
    """
    ends = value.split("..") if isinstance(value, str) else value
    if not isinstance(ends, tuple | list) or len(ends) == 1:
        return _duration(value, "within")
    if len(ends) != 2:
        raise InputError(f"within: expected a time like 2 min, or two like 1..2 min, got {value!r}")
    begin, end = ends
    if isinstance(value, str) and not begin.strip()[-1:].isalpha():
        begin += end.strip().lstrip("0123456789. ")  # 1..2 min
    window = Window(_duration(begin, "within"), _duration(end, "within"))
    if window.begin > window.end:
        raise InputError(f"within: {value} ends before it begins")
    return window


def argument_text(value: Any) -> str:
    """Write an argument of a call.

    >>> argument_text("ana"), argument_text((1.0, 2.5)), argument_text(timedelta(minutes=2))
    ('"ana"', '(1, 2.5)', '"2 min"')
    """
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, timedelta):
        return f'"{format_duration(value)}"'
    if isinstance(value, Window):
        return f'"{format_duration(value.begin)}..{format_duration(value.end)}"'
    if isinstance(value, tuple):
        return f"({', '.join(map(argument_text, value))})"
    return number_text(value, "") if isinstance(value, float) else str(value)


def number_text(value: float, unit: str) -> str:
    """Write a number with its unit; shares in percent.

    >>> number_text(0.5, "m"), number_text(0.1, "share"), number_text(3.0, "")
    ('0.5 m', '10 %', '3')
    """
    if unit == "share":
        value = round(100 * value, 10)
        unit = "%"
    is_whole = value == int(value) and abs(value) < 1e15
    return f"{int(value) if is_whole else repr(value)} {unit}".rstrip()
