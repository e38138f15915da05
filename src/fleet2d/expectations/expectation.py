"""Expectations: conditions on a run, with the margin by which they hold or fail.

An expectation has a robustness at each step, as in signal temporal logic (Donzé and Maler, 2010):
above 0 it holds there, below 0 it doesn't, and the absolute value is the margin. It is never 0: for
a signal exactly at its limit it is plus or minus the smallest normal float64, as the comparison
holds there or not. Robustness and signals are traces: stretches of steps with equal values.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, fields
from datetime import timedelta
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from pydantic_core import PydanticCustomError

from fleet2d.configuration.units import format_duration, micros, parse_duration
from fleet2d.errors import InputError
from fleet2d.kernels import F64, I64
from fleet2d.kernels.motion import sliding_max, until
from fleet2d.runtime.clock import Clock

if TYPE_CHECKING:
    from fleet2d.expectations.signals import Scene

INFINITE = float("inf")
TINY = float(np.finfo(np.float64).tiny)

Time = str | float | timedelta
"""How long: text such as "2 min", seconds, or a timedelta."""


# Traces


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

    def at(self, step: int) -> float:
        """Return the value at a step."""
        return float(self.value[np.searchsorted(self.start, step, side="right") - 1])

    def since(self, first: int) -> "Trace":
        """Return the trace from the step `first` on."""
        if first <= self.first:
            return self
        index = int(np.searchsorted(self.start, first, side="right")) - 1
        start = self.start[index:].copy()
        start[0] = first
        return Trace(start, self.value[index:], self.end)

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
        negative = Trace(self.start, -self.value, self.end)
        return negative.sliding_max(low, high, -before, -after).map(np.negative)

    def until_goal(self, goal: "Trace", after: float) -> "Trace":
        """Return the robustness of "this holds until `goal` holds" from each step on.

        Args:
            goal: A trace over the same steps.
            after: Value that is assumed from the end of both on.
        """
        start = np.union1d(self.start, goal.start)
        hold, reached = (
            t.value[np.searchsorted(t.start, start, side="right") - 1] for t in (self, goal)
        )
        return Trace(*until(start, hold, reached, after), self.end)


def constant(value: float, first: int, end: int) -> Trace:
    """Return a trace that never changes."""
    return Trace(np.array([first], np.int64), np.array([value]), end)


def shortest(start: I64, value: F64, end: int) -> Trace:
    """Return a trace with neighbouring stretches of equal value joined; NaN equals NaN."""
    missing = np.isnan(value)
    differs = (value[1:] != value[:-1]) & ~(missing[1:] & missing[:-1])
    differs_from_last = np.append(True, differs)
    return (
        Trace(start, value, end)
        if differs_from_last.all()
        else Trace(start[differs_from_last], value[differs_from_last], end)
    )


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
    values = [t.value[np.searchsorted(t.start, start, side="right") - 1] for t in traces]
    return shortest(start, function(*values), traces[0].end)


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
    steps = steps[(steps >= first) & (steps < end)]
    at, count = np.unique(steps, return_counts=True)
    start = np.concatenate([[first], at, at + 1])
    value = np.concatenate([[0.0], count, np.zeros(len(at))])
    # A step may have both a count and the zero after its neighbour: the count sorts last and stays.
    order = np.lexsort((value, start))
    start, value = start[order], value[order]
    last = np.append(start[1:] != start[:-1], True) & (start < end)
    return shortest(start[last].astype(np.int64), value[last].astype(np.float64), end)


def spells(trace: Trace) -> list[tuple[int, int]]:
    """Return the maximal stretches in which a signal is above 0, as first and last step."""
    above = np.concatenate([[False], trace.value > 0, [False]])
    edges = np.flatnonzero(above[1:] != above[:-1])
    steps = np.append(trace.start, trace.end)[edges]
    return [(int(a), int(b) - 1) for a, b in zip(steps[::2], steps[1::2], strict=True)]


# Words

WORDS: dict[str, type["Word"]] = {}
"""What a text may call, by name: every class derived from `Word` with a name in small letters."""


class Word:
    """Base of the terms of expectations, in text and in Python.

    Its class has the name of the word, like `range` or `map`; its fields are the arguments. Fields
    that may only be given by name are also written by name.
    """

    word: ClassVar[str]

    def __init_subclass__(cls) -> None:
        if cls.__name__.islower():
            cls.word = cls.__dict__.get("word", cls.__name__)
            WORDS[cls.__name__] = cls

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        arguments, options = [], {}
        for each in fields(self):  # type: ignore[arg-type]
            if each.kw_only or each.metadata.get("named"):
                options[each.name] = getattr(self, each.name)
            else:
                arguments.append(getattr(self, each.name))
        return call_text(self.word, *arguments, **options)

    def _set(self, **values: Any) -> None:
        """Set fields of a frozen dataclass, while it is made."""
        for name, value in values.items():
            object.__setattr__(self, name, value)


def argument_text(value: Any) -> str:
    """Write an argument of a call.

    >>> argument_text("ana"), argument_text((1.0, 2.5)), argument_text(timedelta(minutes=2))
    ('"ana"', '(1, 2.5)', '"2 min"')
    """
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, timedelta):
        return f'"{format_duration(value)}"'
    if isinstance(value, tuple):
        return f"({', '.join(map(argument_text, value))})"
    if isinstance(value, float):
        return number_text(value, "")
    return str(value)


def call_text(name: str, *arguments: Any, **options: Any) -> str:
    """Write a call; arguments and options that are None are left out.

    >>> call_text("seen", "ana", by="astro")
    'seen("ana", by="astro")'
    """
    listed = [argument_text(value) for value in arguments if value is not None]
    listed += [f"{k}={argument_text(v)}" for k, v in options.items() if v is not None]
    return f"{name}({', '.join(listed)})"


def number_text(value: float, unit: str) -> str:
    """Write a number with its unit; shares in percent.

    >>> number_text(0.5, "m"), number_text(0.1, "share"), number_text(3.0, "")
    ('0.5 m', '10 %', '3')
    """
    if unit == "share":
        return f"{_plain(round(100 * value, 10))} %"
    return f"{_plain(value)} {unit}" if unit else _plain(value)


def _plain(value: float) -> str:
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)


# Expectations


@dataclass(frozen=True)
class RunSignals:
    """The measured signals of a run, as far as they are known.

    Attributes:
        traces: The measured values, by the text of each signal.
        words: For each signal with words: the words that each of its values stands for.
        first: The first judged step.
        end: One past the last step that is known.
        ended: Whether the run is over.
        clock: The clock of the run.
    """

    traces: Mapping[str, Trace]
    words: Mapping[str, Mapping[int, Set[str]]]
    first: int
    end: int
    ended: bool
    clock: Clock

    def beyond(self, neutral: float, *, high: bool, bounded: bool) -> float:
        """Return the robustness that is assumed after the last known step.

        Args:
            neutral: The neutral value of the operator.
            high: Whether the best case is assumed for steps that aren't run, or the worst.
            bounded: Whether the operator has a time limit, which may lie beyond the run's end.
        """
        if self.ended and not bounded:
            return neutral
        return INFINITE if high else -INFINITE

    def steps_in(self, duration: timedelta) -> int:
        """Return the number of whole steps in a duration."""
        return micros(duration) // self.clock.step_us


class Expectation(ABC):
    """A condition that holds or doesn't at each step of a run.

    Combine them by `&`, `|` and `~`.
    """

    unit: str = ""
    """Unit of the robustness; empty for conditions that are only true or false."""
    is_call: ClassVar[bool] = True
    """Whether its text is a call, which needs no brackets."""

    @abstractmethod
    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the margin by which it holds from each step on.

        Args:
            run: The measured signals of the run.
            high: Whether the best case is assumed for steps that aren't known yet, or the worst.
        """

    def parts(self) -> Iterator["Expectation"]:
        """Yield the expectations that it is made of."""
        yield from ()

    def check(self, scene: "Scene") -> None:
        """Refuse names that the run doesn't have, part by part.

        Raises:
            ScenarioError: A name is unknown, or the condition can never happen.
        """
        for part in self.parts():
            part.check(scene)

    def measures(self) -> Iterator[Any]:
        """Yield the signals that have to be measured."""
        for part in self.parts():
            yield from part.measures()

    def occasions(self, run: RunSignals) -> I64:
        """Return the steps at which it certainly begins to hold."""
        return np.array([first for first, _ in spells(self.robustness(run, False))], np.int64)

    @property
    def is_judged(self) -> bool:
        """Whether it has a time operator, so that a run as a whole can be judged by it."""
        return any(part.is_judged for part in self.parts())

    def __and__(self, other: "Expectation") -> "Expectation":
        """Expect both."""
        return And(self, _checked(other, "&"))

    def __or__(self, other: "Expectation") -> "Expectation":
        """Expect one of the two, or both."""
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


@dataclass(frozen=True, eq=False)
class UnaryExpectation(Expectation):
    """Base of expectations about one other expectation, with its unit."""

    part: Expectation

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit of the part."""
        return self.part.unit

    def parts(self) -> Iterator[Expectation]:
        """Yield the part."""
        yield self.part


@dataclass(frozen=True, eq=False)
class Not(UnaryExpectation):
    """The negation of a condition."""

    is_call = False

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the negated robustness of the operand, whose worst case is its best case."""
        return self.part.robustness(run, not high).map(np.negative)

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return f"not {bracketed(self.part)}"


@dataclass(frozen=True, eq=False)
class _BinaryExpectation(Expectation):
    one: Expectation
    other: Expectation

    is_call = False
    word: ClassVar[str]

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit that the parts have in common."""
        return common_unit(self.one, self.other)

    def parts(self) -> Iterator[Expectation]:
        """Yield both parts."""
        yield self.one
        yield self.other

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return f"{bracketed(self.one)} {self.word} {bracketed(self.other)}"


class And(_BinaryExpectation):
    """The conjunction of two parts: both hold."""

    word = "and"

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the minimum of both parts."""
        parts = (part.robustness(run, high) for part in self.parts())
        return combine(np.minimum, *parts)


class Or(_BinaryExpectation):
    """The disjunction of two parts: one holds, or both."""

    word = "or"

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the maximum of both parts."""
        parts = (part.robustness(run, high) for part in self.parts())
        return combine(np.maximum, *parts)


MIXED = "mixed"


def common_unit(*parts: Expectation) -> str:
    """Return the unit that the parts have in common; `MIXED` if they differ, empty if none has."""
    units = {part.unit for part in parts} - {""}
    return "" if not units else units.pop() if len(units) == 1 else MIXED


def bracketed(part: Expectation) -> str:
    """Return the text of a part, in brackets unless it is a call."""
    return str(part) if part.is_call else f"({part})"


def truth(value: F64) -> F64:
    """Return the robustness of a condition that is true where `value` is above 0."""
    return np.where(value > 0, INFINITE, -INFINITE)


def _checked(other: object, sign: str) -> Expectation:
    if not isinstance(other, Expectation):
        raise InputError(
            f"{sign}: expected an expectation, got {other!r}; put comparisons in brackets, as in"
            ' (distance("ana", "astro") > 0.5) & moving("astro")'
        )
    return other


def condition(value: object, word: str) -> "Expectation":
    """Return an argument of a word that must hold or not.

    Raises:
        InputError: It is no expectation.
    """
    if isinstance(value, Expectation):
        return value
    raise InputError(
        f"{word}: {value} is not a condition, which holds or doesn't: compare it, as in"
        ' distance("ana", "astro") > 0.5, or room("ana") == "kitchen"'
    )


def duration(value: Any, word: str) -> Any:
    """Return an argument that says how long, as a timedelta; None for None.

    Raises:
        InputError: It is no duration.
    """
    try:
        return None if value is None else parse_duration(value)
    except PydanticCustomError as error:
        raise InputError(f"{word}: {error}") from None
