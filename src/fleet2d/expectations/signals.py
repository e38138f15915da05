"""Signals: what is measured of a run at each step, as numbers, words or truth values."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from pydantic_core import PydanticCustomError

from fleet2d.configuration.units import Quantity
from fleet2d.errors import InputError
from fleet2d.expectations.expectation import INFINITE, TINY, Expectation, RunSignals, truth
from fleet2d.expectations.formatting import argument_text, call_text, number_text
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.trace import Trace
from fleet2d.kernels import F64

BODY = ("user or robot", "bodies")


@dataclass(frozen=True, eq=False)
class Measurement:
    """Base of what is measured during a run; signals of the same text are the same signal.

    Attributes:
        word: Its word in texts. Its first field is its first argument there.
        of: What the first field names, as a noun for messages, and as an attribute of `Scene`.
    """

    word: ClassVar[str]
    of: ClassVar[tuple[str, str]]

    def trace(self, run: RunSignals) -> Trace:
        """Return its values from the first judged step on."""
        return run.traces[str(self)].since(run.first)

    def check(self, scene: Scene) -> None:
        """Refuse a signal that this run doesn't have.

        Raises:
            ScenarioError: A name is unknown, or the signal can never be measured.
        """
        noun, known = self.of
        scene.check_name(noun, self._arguments()[0], getattr(scene, known), self)

    def _arguments(self) -> tuple[Any, ...]:
        return tuple(getattr(self, field.name) for field in fields(self))

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return call_text(self.word, *self._arguments())


@dataclass(frozen=True, eq=False)
class Signal(Measurement):
    """A number at each step; compare it by `>`, `>=`, `<`, `<=`, `==`, `!=`.

    Where it is missing (an algorithm without an output so far), no comparison holds.
    """

    unit: ClassVar[str] = ""
    quantity: ClassVar[Quantity | None] = None

    def __gt__(self, limit: float | str) -> Expectation:
        """Expect the signal above a limit."""
        return SignalComparison(self, ">", _limit(self, limit))

    def __ge__(self, limit: float | str) -> Expectation:
        """Expect the signal at a limit or above it."""
        return SignalComparison(self, ">=", _limit(self, limit))

    def __lt__(self, limit: float | str) -> Expectation:
        """Expect the signal below a limit."""
        return SignalComparison(self, "<", _limit(self, limit))

    def __le__(self, limit: float | str) -> Expectation:
        """Expect the signal at a limit or below it."""
        return SignalComparison(self, "<=", _limit(self, limit))

    def __eq__(self, limit: object) -> Expectation:  # type: ignore[override]
        """Expect the signal to equal a limit."""
        return SignalComparison(self, "==", _limit(self, limit))

    def __ne__(self, limit: object) -> Expectation:  # type: ignore[override]
        """Expect the signal to differ from a limit."""
        return SignalComparison(self, "!=", _limit(self, limit))

    __hash__ = object.__hash__


def _limit(signal: Signal, limit: object) -> float:
    try:
        if signal.quantity is not None:
            return float(signal.quantity.parse(limit))
        if isinstance(limit, int | float | np.number) and not isinstance(limit, bool):
            return float(limit)
    except PydanticCustomError as error:
        raise InputError(f"{signal} is compared with {limit!r}: {error}") from None
    raise InputError(f"{signal} is compared with {limit!r}, expected a number")


@dataclass(frozen=True, eq=False)
class SignalComparison(Expectation):
    """A comparison of a signal with a limit; its robustness is the distance from the limit."""

    signal: Signal
    sign: str
    limit: float

    is_call = False

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit of the signal; 1 if it has none."""
        return self.signal.unit or "1"

    def measures(self) -> Iterator[Measurement]:
        """Yield the signal."""
        yield from measured_in(self.signal)

    def parts(self) -> Iterator[Expectation]:
        """Yield the expectations that the signal is made of, if any."""
        yield from getattr(self.signal, "parts", tuple)()

    def check(self, scene: Scene) -> None:
        """Refuse a signal that this run doesn't have."""
        self.signal.check(scene)

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the distance of the signal from the limit, below 0 on the wrong side."""
        return self.signal.trace(run).map(self._margin)

    def _margin(self, value: F64) -> F64:
        excess = value - self.limit
        if self.sign in ("==", "!="):
            margin = -np.abs(excess) if self.sign == "==" else np.abs(excess)
        else:
            margin = excess if self.sign.startswith(">") else -excess
        on_limit = TINY if self.sign.endswith("=") and self.sign != "!=" else 0.0
        margin = np.where(margin == 0, on_limit or -TINY, margin)
        return np.where(np.isnan(margin), -INFINITE, margin)

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return f"{self.signal} {self.sign} {number_text(self.limit, self.signal.unit)}"


def measured_in(signal: Measurement) -> Iterator[Measurement]:
    """Yield the signals to measure for a signal: itself, or for a count those of its part."""
    measures: Callable[[], Iterator[Measurement]] | None = getattr(signal, "measures", None)
    if measures is None:
        yield signal
    else:
        yield from measures()


@dataclass(frozen=True, eq=False)
class WordSignal(Measurement):
    """A word at each step, such as a room; compare it by `==`, `!=` and `is_in`."""

    def __eq__(self, word: object) -> Expectation:  # type: ignore[override]
        """Expect the signal to be a word."""
        return self.is_in(word)

    def __ne__(self, word: object) -> Expectation:  # type: ignore[override]
        """Expect the signal to be another word, or none."""
        return ~self.is_in(word)

    __hash__ = object.__hash__

    def is_in(self, *words: object) -> Expectation:
        """Expect the signal to be one of several words."""
        for word in words:
            if not isinstance(word, str):
                raise InputError(f"{self} is compared with {word!r}, expected a name")
        return WordComparison(self, tuple(map(str, words)))

    def check_word(self, word: str, scene: Scene) -> None:
        """Refuse a word that the signal can never have."""


@dataclass(frozen=True, eq=False)
class WordComparison(Expectation):
    """The condition that a signal has one of several words."""

    signal: WordSignal
    words: tuple[str, ...]

    is_call = False

    def measures(self) -> Iterator[Measurement]:
        """Yield the signal."""
        yield self.signal

    def check(self, scene: Scene) -> None:
        """Refuse a signal or a word that this run doesn't have."""
        self.signal.check(scene)
        for word in self.words:
            self.signal.check_word(word, scene)

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return infinity where the signal has one of the words, minus infinity elsewhere."""
        words_by_code = run.words[str(self.signal)]
        codes = [float(code) for code, words in words_by_code.items() if words & set(self.words)]
        return self.signal.trace(run).map(
            lambda value: truth(np.isin(value, codes).astype(np.float64))
        )

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        if len(self.words) == 1:
            return f'{self.signal} == "{self.words[0]}"'
        return f"{self.signal} in [{', '.join(map(argument_text, self.words))}]"


@dataclass(frozen=True, eq=False)
class Condition(Measurement, Expectation):
    """A signal that is true or false at each step; it is an expectation itself."""

    def measures(self) -> Iterator[Measurement]:
        """Yield itself."""
        yield self

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return infinity where it is true, minus infinity where it is false."""
        return self.trace(run).map(truth)
