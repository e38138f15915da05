"""Expectations: what must hold over a run, and by how much it holds or fails.

An expectation has a robustness at each step, as in signal temporal logic (Donzé and Maler, 2010):
above 0 it holds there, below 0 it doesn't, and how far from 0 says by how much. It is never 0: a
signal that lies on its limit is off by next to nothing, on the side on which the comparison is.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from datetime import timedelta
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from fleet2d.clock import Clock
from fleet2d.errors import InputError
from fleet2d.expectations.trace import F64, I64, Trace, combine, spells
from fleet2d.units import micros

if TYPE_CHECKING:
    from fleet2d.expectations.scene import Scene

INFINITE = float("inf")
NEXT_TO_NOTHING = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True)
class Known:
    """What is known of a run.

    Attributes:
        traces: What was measured, by the text of each signal.
        words: What a value of a signal of words stands for: all words that it answers to.
        first: The step from which on something is expected.
        end: The step before which what is known ends.
        ended: Whether nothing comes after it.
        clock: Of the run.
    """

    traces: Mapping[str, Trace]
    words: Mapping[str, Mapping[int, Set[str]]]
    first: int
    end: int
    ended: bool
    clock: Clock

    def beyond(self, neutral: float, *, high: bool, bounded: bool) -> float:
        """Return what a signal counts as after all that is known.

        Args:
            neutral: What doesn't count in the operator that asks.
            high: Whether the best is assumed of what isn't known, or the worst.
            bounded: Whether the operator waits for a time, which may lie beyond the run's end.
        """
        if self.ended and not bounded:
            return neutral
        return INFINITE if high else -INFINITE

    def steps_in(self, duration: timedelta) -> int:
        """Return how many whole steps a duration has."""
        return micros(duration) // self.clock.step_us


class Expectation(ABC):
    """Something that holds, or doesn't, at each step of a run.

    Combine them by `&`, `|` and `~`.
    """

    unit: str = ""
    """Of the robustness; empty for what merely is so or not."""
    is_call: ClassVar[bool] = True
    """Whether it is written as a call, which needs no brackets around it."""

    @abstractmethod
    def robustness(self, known: Known, high: bool) -> Trace:
        """Return by how much it holds from each step on.

        Args:
            known: What is known of the run.
            high: Whether the best is assumed of what isn't known yet, or the worst.
        """

    def parts(self) -> Iterator["Expectation"]:
        """Yield the expectations that it is made of."""
        yield from ()

    def check(self, scene: "Scene") -> None:
        """Refuse what can't be in a run, part by part.

        Raises:
            ScenarioError: There is nothing of a name, or it can never happen.
        """
        for part in self.parts():
            part.check(scene)

    def measures(self) -> Iterator[Any]:
        """Yield the signals that have to be measured."""
        for part in self.parts():
            yield from part.measures()

    def occasions(self, known: Known) -> I64:
        """Return the steps at which it begins to hold, for certain."""
        return np.array([first for first, _ in spells(self.robustness(known, False))], np.int64)

    @property
    def is_judged(self) -> bool:
        """Whether it says when it must hold, so that a run as a whole can be judged by it."""
        return any(part.is_judged for part in self.parts())

    def __and__(self, other: "Expectation") -> "Expectation":
        """Return that both hold."""
        return And(self, _checked(other, "&"))

    def __or__(self, other: "Expectation") -> "Expectation":
        """Return that either holds, or both."""
        return Or(self, _checked(other, "|"))

    def __invert__(self) -> "Expectation":
        """Return that it doesn't hold."""
        return Not(self)

    def __bool__(self) -> bool:
        """Refuse `and`, `or` and `not`, which Python keeps to itself."""
        raise InputError(
            "an expectation has no truth before the run: write & | ~ instead of and, or, not (and"
            " put comparisons in brackets), and two comparisons instead of a < x < b"
        )


@dataclass(frozen=True, eq=False)
class OfOne(Expectation):
    """What is expected of one other thing, in its unit."""

    part: Expectation

    @property
    def unit(self) -> str:  # type: ignore[override]
        """That of the part."""
        return self.part.unit

    def parts(self) -> Iterator[Expectation]:
        """Yield the part."""
        yield self.part


@dataclass(frozen=True, eq=False)
class Not(OfOne):
    """That something doesn't hold."""

    is_call = False

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return the opposite; what is best for it is worst for its part."""
        return self.part.robustness(known, not high).map(np.negative)

    def __str__(self) -> str:
        """Write it as it is read."""
        return f"not {bracketed(self.part)}"


@dataclass(frozen=True, eq=False)
class _Both(Expectation):
    one: Expectation
    other: Expectation

    is_call = False
    word: ClassVar[str]

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit that the parts have in common."""
        return common_unit(self.one, self.other)

    def parts(self) -> Iterator[Expectation]:
        """Yield both."""
        yield self.one
        yield self.other

    def __str__(self) -> str:
        """Write it as it is read."""
        return f"{bracketed(self.one)} {self.word} {bracketed(self.other)}"


class And(_Both):
    """That two things hold."""

    word = "and"

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return the lesser one."""
        parts = (part.robustness(known, high) for part in self.parts())
        return combine(np.minimum, *parts)


class Or(_Both):
    """That one of two things holds, or both."""

    word = "or"

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return the greater one."""
        parts = (part.robustness(known, high) for part in self.parts())
        return combine(np.maximum, *parts)


MIXED = "mixed"


def common_unit(*parts: Expectation) -> str:
    """Return the unit of those that have one, `MIXED` if they differ."""
    units = {part.unit for part in parts} - {""}
    return "" if not units else units.pop() if len(units) == 1 else MIXED


def bracketed(part: Expectation) -> str:
    """Write a part of an expectation, in brackets unless it is a call."""
    return str(part) if part.is_call else f"({part})"


def truth(value: F64) -> F64:
    """Return the robustness of what merely is so, above 0, or not."""
    return np.where(value > 0, INFINITE, -INFINITE)


def _checked(other: object, sign: str) -> Expectation:
    if not isinstance(other, Expectation):
        raise InputError(
            f"{sign} {other!r}: an expectation is wanted; put comparisons in brackets, as in"
            ' (distance("ana", "astro") > 0.5) & moving("astro")'
        )
    return other
