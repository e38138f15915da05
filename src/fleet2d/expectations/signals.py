"""Signals: what a run is at each step, in numbers, in words, or merely so or not."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic_core import PydanticCustomError

from fleet2d.errors import InputError
from fleet2d.expectations.expectation import (
    INFINITE,
    NEXT_TO_NOTHING,
    Expectation,
    Known,
    truth,
)
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.trace import F64, Trace
from fleet2d.expectations.words import argument_text, number_text
from fleet2d.units import Quantity


class Measured:
    """What is measured during a run; its text says what, and two of one text are the same."""

    def trace(self, known: Known) -> Trace:
        """Return what it was."""
        return known.traces[str(self)].since(known.first)

    def check(self, scene: Scene) -> None:
        """Refuse what isn't in a run.

        Raises:
            ScenarioError: There is nothing of a name, or it can never be measured.
        """


@dataclass(frozen=True, eq=False)
class Signal(Measured):
    """A number at each step; compare it by `>`, `>=`, `<`, `<=`, `==`, `!=`.

    Where it is missing (an algorithm that has put out nothing so far), no comparison holds.
    """

    unit: ClassVar[str] = ""
    quantity: ClassVar[Quantity | None] = None

    def __gt__(self, limit: float | str) -> Expectation:
        """Return that it is above a limit."""
        return Comparison(self, ">", _limit(self, limit))

    def __ge__(self, limit: float | str) -> Expectation:
        """Return that it is a limit or above it."""
        return Comparison(self, ">=", _limit(self, limit))

    def __lt__(self, limit: float | str) -> Expectation:
        """Return that it is below a limit."""
        return Comparison(self, "<", _limit(self, limit))

    def __le__(self, limit: float | str) -> Expectation:
        """Return that it is a limit or below it."""
        return Comparison(self, "<=", _limit(self, limit))

    def __eq__(self, limit: object) -> Expectation:  # type: ignore[override]
        """Return that it is exactly so."""
        return Comparison(self, "==", _limit(self, limit))

    def __ne__(self, limit: object) -> Expectation:  # type: ignore[override]
        """Return that it is anything else."""
        return Comparison(self, "!=", _limit(self, limit))

    __hash__ = object.__hash__


def _limit(signal: Signal, limit: object) -> float:
    try:
        if signal.quantity is not None:
            return float(signal.quantity.parse(limit))
        if isinstance(limit, int | float | np.number) and not isinstance(limit, bool):
            return float(limit)
    except PydanticCustomError as error:
        raise InputError(f"{signal} is compared: {error}") from None
    raise InputError(f"{signal} is compared with {limit!r}: a number is wanted")


@dataclass(frozen=True, eq=False)
class Comparison(Expectation):
    """That a signal is on one side of a limit; its robustness is how far it is from there."""

    signal: Signal
    sign: str
    limit: float

    is_call = False

    @property
    def unit(self) -> str:  # type: ignore[override]
        """That of the signal, or none in particular."""
        return self.signal.unit or "1"

    def measures(self) -> Iterator[Measured]:
        """Yield the signal."""
        yield from measured_in(self.signal)

    def parts(self) -> Iterator[Expectation]:
        """Yield what the signal itself is made of."""
        yield from getattr(self.signal, "parts", tuple)()

    def check(self, scene: Scene) -> None:
        """Refuse a signal that isn't there."""
        self.signal.check(scene)

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return how far the signal is from the limit, on the right side of it."""
        return self.signal.trace(known).map(self._margin)

    def _margin(self, value: F64) -> F64:
        above = value - self.limit
        if self.sign in ("==", "!="):
            margin = -np.abs(above) if self.sign == "==" else np.abs(above)
        else:
            margin = above if self.sign.startswith(">") else -above
        on_limit = NEXT_TO_NOTHING if self.sign.endswith("=") and self.sign != "!=" else 0.0
        margin = np.where(margin == 0, on_limit or -NEXT_TO_NOTHING, margin)
        return np.where(np.isnan(margin), -INFINITE, margin)

    def __str__(self) -> str:
        """Write it as it is read."""
        return f"{self.signal} {self.sign} {number_text(self.limit, self.signal.unit)}"


def measured_in(signal: Measured) -> Iterator[Measured]:
    """Yield what has to be measured for a signal: itself, or what it counts."""
    measures: Callable[[], Iterator[Measured]] | None = getattr(signal, "measures", None)
    if measures is None:
        yield signal
    else:
        yield from measures()


@dataclass(frozen=True, eq=False)
class WordSignal(Measured):
    """A word at each step, such as a room; compare it by `==`, `!=` and `is_in`."""

    def __eq__(self, word: object) -> Expectation:  # type: ignore[override]
        """Return that it is a word."""
        return self.is_in(word)

    def __ne__(self, word: object) -> Expectation:  # type: ignore[override]
        """Return that it is another word, or none."""
        return ~self.is_in(word)

    __hash__ = object.__hash__

    def is_in(self, *words: object) -> Expectation:
        """Return that it is one of several words."""
        for word in words:
            if not isinstance(word, str):
                raise InputError(f"{self} is compared with {word!r}: a name is wanted")
        return Matches(self, tuple(map(str, words)))

    def check_word(self, word: str, scene: Scene) -> None:
        """Refuse a word that it can never be."""


@dataclass(frozen=True, eq=False)
class Matches(Expectation):
    """That a signal of words is one of some."""

    signal: WordSignal
    words: tuple[str, ...]

    is_call = False

    def measures(self) -> Iterator[Measured]:
        """Yield the signal."""
        yield self.signal

    def check(self, scene: Scene) -> None:
        """Refuse a signal or a word that isn't there."""
        self.signal.check(scene)
        for word in self.words:
            self.signal.check_word(word, scene)

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return whether it is: infinitely so, or not at all."""
        answers = known.words[str(self.signal)]
        codes = [float(code) for code, words in answers.items() if words & set(self.words)]
        return self.signal.trace(known).map(
            lambda value: truth(np.isin(value, codes).astype(np.float64))
        )

    def __str__(self) -> str:
        """Write it as it is read."""
        if len(self.words) == 1:
            return f'{self.signal} == "{self.words[0]}"'
        return f"{self.signal} in [{', '.join(map(argument_text, self.words))}]"


@dataclass(frozen=True, eq=False)
class State(Measured, Expectation):
    """Something that is so at a step, or not."""

    def measures(self) -> Iterator[Measured]:
        """Yield itself."""
        yield self

    def robustness(self, known: Known, high: bool) -> Trace:
        """Return whether it is so: infinitely, or not at all."""
        return self.trace(known).map(truth)
