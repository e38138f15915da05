"""Expectations: conditions on a run, with the margin by which they hold or fail.

An expectation has a robustness at each step, as in signal temporal logic (Donzé and Maler, 2010):
above 0 it holds there, below 0 it doesn't, and the absolute value is the margin. It is never 0: for
a signal exactly at its limit it is plus or minus the smallest normal float64, as the comparison
holds there or not.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, ClassVar

import numpy as np

from fleet2d.configuration.units import micros
from fleet2d.errors import InputError
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.trace import Trace, combine, spells
from fleet2d.kernels import F64, I64
from fleet2d.runtime.clock import Clock

INFINITE = float("inf")
TINY = float(np.finfo(np.float64).tiny)


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

    def check(self, scene: Scene) -> None:
        """Refuse what a run doesn't have, part by part.

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
        """Return minus the robustness of the part, whose worst case is this one's best."""
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
