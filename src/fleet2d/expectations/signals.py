"""Signals: measurements of a run at each step, as numbers, words or truth values.

A signal is one class: its word, the names that it may use (of a `Scene`), and its measurement over
a block of steps. The signals themselves are in `fleet2d.expectations.vocabulary`.
"""

import operator
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, fields
from datetime import timedelta
from functools import reduce
from itertools import product
from typing import Any, ClassVar, Protocol

import numpy as np
from pydantic_core import PydanticCustomError

from fleet2d.algorithms.observations import Activities, SightingTable
from fleet2d.configuration.components import components
from fleet2d.configuration.problems import check_known
from fleet2d.configuration.units import LENGTH, SHARE, SPEED, format_duration
from fleet2d.entities.behavior import Actor, Behavior
from fleet2d.entities.body import Bodies
from fleet2d.errors import InputError, ScenarioError
from fleet2d.expectations.expectation import (
    INFINITE,
    MIXED,
    TINY,
    Expectation,
    RunSignals,
    Term,
    Trace,
    Window,
    Word,
    argument_text,
    combine,
    constant,
    joined,
    number_text,
    stepwise,
    truth,
)
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.rooms.room import PRIORITY, usual_type
from fleet2d.interactions.interaction import Interaction
from fleet2d.kernels import F64
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import KINDS, Event, EventKind

ANY_KIND = "any "
"""The beginning of a kind of rooms: `any bathroom`."""
QUANTIFIERS: Mapping[str, Callable[[Any, Any], Any]] = {
    "anyone": operator.or_,
    "everyone": operator.and_,
}
"""Words for one or all of the users, and the operators that combine conditions about each."""
QUANTITIES = {"m": LENGTH, "m/s": SPEED, "share": SHARE}
"""The quantities in which limits are written, by the unit of the signal; others are plain."""

Limits = tuple[float, float]
"""The least and the largest value that a signal can have."""
ANY_NUMBER: Limits = (-INFINITE, INFINITE)


@dataclass(frozen=True)
class Scene:
    """The names of a run that expectations may use, to check them before the run.

    Attributes:
        names: The names of each kind: users, robots, rooms (also their types), things of the home,
            doors, sensors, algorithms, metrics, batteries (the robots that have one), and bodies
            (users and robots).
        cameras: For each body with cameras, the names of the bodies that they look at.
        events: The kinds of events that can happen to each entity; an empty name is the home.
        details: The details that events of a kind can have, where they are known, by the kind; of
            activities for each user.
        bounds: The least and the greatest coordinates of the home (x, y, x, y) [m].
        remaining: Time from now to the end of the run.
        interactions: The interactions of robots with people, by name.
        limits: For each metric, a function that returns the limits of one of its numbers.
        notes: Notes for readers: kinds of rooms that the home doesn't have, and comparisons whose
            outcome is certain.
    """

    names: Mapping[str, Collection[str]]
    cameras: Mapping[str, Collection[str]]
    events: Mapping[str, Set[str]]
    details: Mapping[str, Collection[str]]
    bounds: tuple[float, float, float, float]
    remaining: timedelta
    interactions: Mapping[str, Interaction] = field(default_factory=dict)
    limits: Mapping[str, Callable[[str], Limits]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def meant(self, name: "str | Term", of: Expectation) -> Expectation | None:
        """Return a condition about the bodies that a name stands for; None for one body.

        Raises:
            ScenarioError: There is nobody.
        """
        if isinstance(name, str):
            if name not in QUANTIFIERS or name in self.names["bodies"]:
                return None
            others = [user for user in self.names["users"] if user not in of.named()]
            if not others:
                raise ScenarioError(f"{of}: there is no {name}: the scenario has no other user")
            return reduce(QUANTIFIERS[name], (of.with_name(name, user) for user in others))
        assert isinstance(name, WordSignal)
        name.check(self)
        cases = ((name == other) & of.with_name(name, other) for other in name.choices(self))
        return reduce(operator.or_, cases)

    def check_room(self, name: str, of: object, others: Iterable[str] = ()) -> None:
        """Refuse an unknown room; note a kind of room that this home lacks.

        Raises:
            ScenarioError: The name is neither a room nor a kind of rooms, nor among the others.
        """
        known = [*others, *self.names["rooms"]]
        kind = name.removeprefix(ANY_KIND)
        if kind in known or usual_type(kind) not in PRIORITY or kind[-1:].isdigit():
            self.check_name("body, room or object" if others else "room", kind, known, of)
        elif (note := f"{of}: this home has no {kind}") not in self.notes:
            self.notes.append(note)

    def check_name(self, noun: str, name: str, known: Iterable[str], of: object) -> None:
        """Refuse an unknown name.

        Raises:
            ScenarioError: The name is unknown; the message has the nearest name, and all of them.
        """
        check_known(name, noun, dict.fromkeys(known), where=f"{of}: ")

    def check_within(self, within: timedelta | Window | None, of: object) -> None:
        """Refuse a time that is longer than the run.

        Raises:
            ScenarioError: The time is longer than what remains of the run.
        """
        within = within.end if isinstance(within, Window) else within
        if within is not None and within > self.remaining:
            raise ScenarioError(
                f"{of}: {format_duration(within)} is beyond the run, which goes on for"
                f" {format_duration(self.remaining)}"
            )

    def check_event(self, kind: str, entity: str | None, detail: str | None, of: object) -> None:
        """Refuse an event that can never happen.

        Raises:
            ScenarioError: The kind is unknown, or there is no entity to which it could happen.
        """
        if kind == EventKind.SENSOR:
            raise ScenarioError(f"{of}: sensor readings are not events: write sensor(NAME)")
        self.check_name("event", kind, sorted(KINDS.union(*self.events.values())), of)
        if entity is not None:
            self.check_name("body or object", entity, filter(None, self.events), of)
        names = [name for name, kinds in self.events.items() if kind in kinds]
        if not names or entity not in (None, *names):
            types = components("behavior").items()
            behaviors = [n for n, c in types if issubclass(c, Behavior) and kind in c.records]
            to = f"robots with the behavior {' or '.join(behaviors)} " if behaviors else ""
            here = ", ".join(names) or "none"
            raise ScenarioError(
                f"{of}: no such event is possible: {kind!r} happens only to {to}(here: {here})"
            )
        if detail is None or detail.startswith("come "):
            return
        own = f"{kind} {entity}"  # activities differ between users
        known = self.details.get(own if own in self.details else kind)
        if known is not None and detail:
            self.check_name(f"{kind} with the detail", detail, known, of)


class MeasuredCameras(Protocol):
    """The cameras of a body, by which signals are measured."""

    index: int
    """The number of the owner among the robots, or among the users."""

    @property
    def other_names(self) -> Sequence[str]:
        """The names of the bodies in view of the cameras, by number."""

    @property
    def in_view(self) -> Mapping[str, object]:
        """The bodies that count as seen at present, by name."""

    def perfect(self, first: int) -> Any:
        """Return cameras that notice all bodies in view at each step, from `first` on.

        Their method `look` takes the bodies of the run and the step up to which they look, and
        returns the events of seeing and losing.
        """


@dataclass
class MeasuredRun:
    """The run in which signals are measured.

    Attributes:
        actors: Users, then robots; their numbers are the rows of poses.
        bodies: The bodies and their poses.
        home: The home.
        clock: The steps of the run.
        doors: The names of doors in the order of their numbers.
        sensors_on: Whether each sensor is on at present, by name.
        cameras: The cameras of each body that has some, by its name.
        activities: The present activities of users.
        first: The first step that will be measured.
    """

    actors: Sequence[Actor]
    bodies: Bodies
    home: Home
    clock: Clock
    doors: Sequence[str]
    sensors_on: Mapping[str, bool]
    cameras: Mapping[str, MeasuredCameras]
    activities: Activities
    first: int = 0

    def row(self, name: str) -> int:
        """Return the row of a body."""
        return next(row for row, actor in enumerate(self.actors) if actor.name == name)


@dataclass
class SignalBlock:
    """The steps from `first` to `end` - 1, in which the home doesn't change.

    Attributes:
        first: The first step.
        end: The step after the last one.
        bodies: The bodies and their poses.
        home: The home in these steps.
        observations: The observations of robots.
        readings: The readings of sensors: step, name and whether it is on.
        events: The events, in order of step.
    """

    first: int
    end: int
    bodies: Bodies
    home: Home
    observations: SightingTable
    readings: Sequence[tuple[int, str, bool]]
    events: Sequence[Event] = ()


Outputs = Mapping[str, Any]
"""New outputs of algorithms, by name."""
Results = Mapping[str, Callable[[], Any]]
"""Functions that return the new results of metrics, by name."""


class Gauge:
    """The measurement of a signal during a run, block by block.

    Attributes:
        signal: The signal.
        memory: The state of its `measure` from block to block; see `Measurement.start`.
        now: The latest value of a signal that rarely changes; NaN: it is missing.
        words: The words that each value stands for, if the signal consists of words.
    """

    def __init__(self, signal: "Measurement", run: MeasuredRun) -> None:
        self.signal = signal
        self.words: dict[int, tuple[str, ...]] = {}
        self.now = float("nan")
        self._traces: list[Trace] = []
        self.memory: Any = signal.start(run, self)

    def take(self, block: SignalBlock) -> None:
        """Measure the signal over a block of steps, and append it."""
        self._traces.append(self.signal.measure(block, self))

    def trace(self) -> Trace:
        """Return the signal at all steps that were measured."""
        self._traces = [joined(self._traces)]
        return self._traces[0]

    def replace_last(self, value: float) -> None:
        """Set the value at the last step that was measured."""
        trace = self.trace()
        before = [trace.until(trace.end - 1)] if trace.first < trace.end - 1 else []
        self._traces = [*before, constant(value, trace.end - 1, trace.end)]

    def switched(self, block: SignalBlock, changes: Iterable[tuple[int, float]]) -> Trace:
        """Return a value that only changes at some steps, in order; `now` is the last one."""
        trace = stepwise(block.first, self.now, changes, block.end)
        self.now = float(trace.value[-1])
        return trace


class Measurement(Word, Term):
    """Base of signals that are measured during a run; those with equal texts are the same.

    Attributes:
        of: The noun for the first field in messages, and its key in `Scene.names`; or nothing.
    """

    of: ClassVar[tuple[str, str] | None] = None

    def trace(self, run: RunSignals) -> Trace:
        """Return its values from the first judged step on."""
        return run.traces[str(self)].since(run.first)

    def measures(self) -> Iterator["Measurement"]:
        """Yield itself."""
        yield self

    def named(self) -> Iterator[str | Term]:
        """Yield its arguments that are names, or signals that stand for names."""
        for each in fields(self):
            if isinstance(value := getattr(self, each.name), str | WordSignal):
                yield value

    def check(self, scene: Scene) -> None:
        """Refuse a signal that this run doesn't have.

        Raises:
            ScenarioError: A name is unknown, or the signal can never be measured.
        """
        if self.of is not None:
            noun, known = self.of
            scene.check_name(noun, getattr(self, fields(self)[0].name), scene.names[known], self)

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return the initial state of `measure`."""

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the values over a block of steps."""
        raise NotImplementedError

    def begin_plan(self, actor: Actor, gauge: Gauge) -> None:
        """Note that a body begins a plan."""

    def learn(self, outputs: Outputs, results: Results, gauge: Gauge) -> None:
        """Note new outputs of algorithms and results of metrics, by name, before the next block."""

    def finish(self, results: Mapping[str, Any], gauge: Gauge) -> None:
        """Note the results of metrics over the whole run, which count at its last step."""


def _comparison(sign: str) -> Callable[["Signal", Any], Expectation]:
    """Return the method that compares a signal with a number, a text like "5 cm", or a signal."""
    return lambda signal, limit: SignalComparison(signal, sign, limit)


def _arithmetic(sign: str, *, is_mirrored: bool = False) -> Callable[["Signal", Any], "Signal"]:
    """Return the method that computes with a signal and a number, a text or another signal."""
    if is_mirrored:
        return lambda signal, other: Arithmetic(other, sign, signal)
    return lambda signal, other: Arithmetic(signal, sign, other)


class Signal(Term):
    """A number at each step; compare it by `>`, `>=`, `<`, `<=`, `==`, `!=`.

    Where it is missing (an algorithm without an output so far), no comparison holds.
    """

    between: ClassVar[Limits] = ANY_NUMBER
    """Its least and its largest possible value."""

    def trace(self, run: RunSignals) -> Trace:
        """Return its values from the first judged step on."""
        raise NotImplementedError

    def limits(self, scene: Scene) -> Limits:
        """Return its least and its largest possible value in a run."""
        return self.between

    __gt__ = _comparison(">")
    __ge__ = _comparison(">=")
    __lt__ = _comparison("<")
    __le__ = _comparison("<=")
    __eq__ = _comparison("==")  # type: ignore[assignment]
    __ne__ = _comparison("!=")  # type: ignore[assignment]
    __hash__ = object.__hash__

    __add__ = _arithmetic("+")
    __radd__ = _arithmetic("+", is_mirrored=True)
    __sub__ = _arithmetic("-")
    __rsub__ = _arithmetic("-", is_mirrored=True)
    __mul__ = _arithmetic("*")
    __rmul__ = _arithmetic("*", is_mirrored=True)
    __truediv__ = _arithmetic("/")
    __rtruediv__ = _arithmetic("/", is_mirrored=True)

    def __neg__(self) -> "Signal":
        """Return the negated signal."""
        return Arithmetic(-1.0, "*", self)


class NumberSignal(Measurement, Signal):
    """A number that is measured."""


def operand_text(value: "float | Signal", unit: str) -> str:
    """Return the text of a number or a signal within an expression."""
    return str(value) if isinstance(value, Signal) else number_text(value, unit)


def _limits_of(value: "float | Signal", scene: Scene) -> Limits:
    return value.limits(scene) if isinstance(value, Signal) else (value, value)


def _range_text(signal: "Signal", limits: Limits) -> str:
    """Return the limits of a signal in words, for messages."""
    low, high = limits
    if high == INFINITE:
        return f"{signal} is {number_text(low, signal.unit)} or more"
    if low == -INFINITE:
        return f"{signal} is {number_text(high, signal.unit)} or less"
    return f"{signal} is {number_text(low, signal.unit)} to {number_text(high, signal.unit)}"


def values_of(value: "float | Signal", run: RunSignals) -> Trace:
    """Return a number or a signal at each step."""
    if isinstance(value, Signal):
        return value.trace(run)
    return constant(value, run.first, run.end)


class Arithmetic(Signal):
    """The sum, difference, product or quotient of signals and numbers."""

    one: Any  # a signal or a number
    sign: str
    other: Any

    def __post_init__(self) -> None:
        for name, value, signal in (("one", self.one, self.other), ("other", self.other, self.one)):
            if not isinstance(value, Signal):
                unit = signal.unit if self.sign in "+-" else ""
                object.__setattr__(self, name, _number(value, unit, signal))
        if self.sign in "+-":
            _check_units(self.one, self.other, self)

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit of the result: that of the operands if it is clear, else `MIXED`."""
        units = [each.unit for each in (self.one, self.other) if isinstance(each, Signal)]
        is_scaled = len(units) == 1 and (self.sign != "/" or isinstance(self.one, Signal))
        if is_scaled or self.sign in "+-":
            return units[0]
        return "" if self.sign == "/" and len(set(units)) == 1 and len(units) == 2 else MIXED

    def limits(self, scene: Scene) -> Limits:
        """Return the least and the largest result; quotients are unlimited."""
        if self.sign == "/":
            return ANY_NUMBER
        ends = product(_limits_of(self.one, scene), _limits_of(self.other, scene))
        one, other = np.array(list(ends)).T
        with np.errstate(invalid="ignore"):
            results = _SIGNS[self.sign](one, other)
        if np.isnan(results).any():
            return ANY_NUMBER
        return float(results.min()), float(results.max())

    def trace(self, run: RunSignals) -> Trace:
        """Return the result at each step; missing where an operand is, and for 0 / 0."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return combine(_SIGNS[self.sign], values_of(self.one, run), values_of(self.other, run))

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        unit = self.unit if self.sign in "+-" else ""
        return f"({operand_text(self.one, unit)} {self.sign} {operand_text(self.other, unit)})"


_SIGNS: Mapping[str, Callable[[F64, F64], F64]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide,
}  # fmt: skip


class SignalComparison(Expectation):
    """A comparison of a signal with a limit, or with another signal.

    Its robustness is the distance from the limit.
    """

    signal: Signal
    sign: str
    limit: Any  # text at first, then a number or a signal

    is_call = False

    def __post_init__(self) -> None:
        if isinstance(self.limit, Signal):
            _check_units(self.signal, self.limit, self)
        else:
            limit = _number(self.limit, self.signal.unit, self.signal)
            object.__setattr__(self, "limit", limit)

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit of the signal; 1 if it has none."""
        return self.signal.unit or "1"

    def check(self, scene: Scene) -> None:
        """Refuse signals that the run lacks; note a comparison that always or never holds."""
        super().check(scene)
        low, high = self.signal.limits(scene)
        least, largest = _limits_of(self.limit, scene)
        is_above = low > largest
        is_below = high < least
        is_never = {
            ">": high <= least, ">=": is_below, "<": low >= largest, "<=": is_above,
            "==": is_above or is_below, "!=": False,
        }  # fmt: skip
        is_always = {
            ">": is_above, ">=": is_above, "<": is_below, "<=": is_below,
            "==": False, "!=": is_above or is_below,
        }  # fmt: skip
        if is_never[self.sign] or is_always[self.sign]:
            outcome = "can't hold" if is_never[self.sign] else "always holds"
            facts = [_range_text(self.signal, (low, high))]
            if isinstance(self.limit, Signal):
                facts.append(_range_text(self.limit, (least, largest)))
            elif (low, high) == (0, 1) and 1 < self.limit <= 100:
                facts.append(f"write {self.limit / 100:g} for {self.limit:g} %")
            scene.notes.append(f"{self} {outcome}: {'; '.join(facts)}")

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the distance of the signal from the limit, below 0 on the wrong side."""
        return combine(self._margin, self.signal.trace(run), values_of(self.limit, run))

    def _margin(self, value: F64, limit: F64) -> F64:
        with np.errstate(invalid="ignore"):  # both may be infinite
            excess = value - limit
        margin = np.abs(excess) if self.sign in ("==", "!=") else excess
        margin = -margin if self.sign in ("==", "<", "<=") else margin
        margin = np.where(margin == 0, TINY if self.sign in ("==", "<=", ">=") else -TINY, margin)
        return np.where(np.isnan(margin), -INFINITE, margin)

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return f"{self.signal} {self.sign} {operand_text(self.limit, self.signal.unit)}"


def _number(value: object, unit: str, signal: object) -> float:
    """Return a number in the unit of the signal beside it.

    Raises:
        InputError: The number can't be read, or isn't a share from 0 to 1.
    """
    try:
        if unit in QUANTITIES:
            number = float(QUANTITIES[unit].parse(value))
            if unit == "share" and not 0 <= number <= 1:
                raise InputError(
                    f"{signal} is compared with {value}: a share is a number from 0 to 1, or from"
                    f" 0 % to 100 %{f', such as {value} %' if 1 < number <= 100 else ''}"
                )
            return number
        if isinstance(value, int | float | np.number) and not isinstance(value, bool):
            return float(value)
    except PydanticCustomError as error:
        raise InputError(f"{signal} is compared with {value!r}: {error}") from None
    raise InputError(f"{signal} is compared with {value!r}, expected a number")


def _check_units(one: object, other: object, of: object) -> None:
    units = {signal.unit for signal in (one, other) if isinstance(signal, Signal)} - {MIXED}
    if len(units) > 1:
        names = " and ".join(sorted(unit or "a plain number" for unit in units))
        raise InputError(f"{of}: the signals have different units: {names}")


class WordSignal(Measurement):
    """A word at each step, such as a room; compare it by `==`, `!=` and `is_in`.

    Attributes:
        noun: The noun for its words, such as "room".
    """

    noun: ClassVar[str]

    def __eq__(self, word: object) -> Expectation:  # type: ignore[override]
        """Expect the signal to be a word, or the word of another signal."""
        return SameWord(self, word) if isinstance(word, WordSignal) else self.is_in(word)

    def __ne__(self, word: object) -> Expectation:  # type: ignore[override]
        """Expect the signal to be another word, or none."""
        return ~(self == word)

    __hash__ = object.__hash__

    def is_in(self, *words: object) -> Expectation:
        """Expect the signal to be one of several words."""
        for word in words:
            if not isinstance(word, str):
                raise InputError(f"{self} is compared with {word!r}, expected a name")
        return WordComparison(self, tuple(map(str, words)))

    def check_word(self, word: str, scene: Scene) -> None:
        """Refuse a word that the signal can never have."""

    def choices(self, scene: Scene) -> Collection[str]:
        """Return the bodies that it can stand for.

        Raises:
            ScenarioError: The signal doesn't stand for a body.
        """
        raise ScenarioError(f"{self} is not a body: expected a name, or nearest(…)")


class WordComparison(Expectation):
    """The condition that a signal has one of several words."""

    signal: WordSignal
    words: tuple[str, ...]

    is_call = False

    def check(self, scene: Scene) -> None:
        """Refuse a signal or a word that this run doesn't have."""
        super().check(scene)
        for word in self.words:
            self.signal.check_word(word, scene)

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return infinity where the signal has one of the words, minus infinity elsewhere."""
        expected = {word.removeprefix(ANY_KIND) for word in self.words}
        words_by_code = run.words[str(self.signal)].items()
        codes = [float(code) for code, words in words_by_code if expected & set(words)]
        return self.signal.trace(run).map(lambda value: truth(np.isin(value, codes)))

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        if len(self.words) == 1:
            return f'{self.signal} == "{self.words[0]}"'
        return f"{self.signal} in [{', '.join(map(argument_text, self.words))}]"


class SameWord(Expectation):
    """The condition that two signals have the same word; two missing words don't count."""

    one: WordSignal
    other: WordSignal

    is_call = False

    def __post_init__(self) -> None:
        if self.one.noun != self.other.noun:
            nouns = f"{self.one.noun} and {self.other.noun} are"
            raise InputError(f"{self}: {nouns} compared, which are never the same")

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return infinity where the words are the same, minus infinity elsewhere."""
        names: dict[str, float] = {}
        one, other = (self._numbers(signal, run, names) for signal in (self.one, self.other))
        return combine(lambda a, b: truth((a == b) & (a >= 0)), one, other)

    @staticmethod
    def _numbers(signal: WordSignal, run: RunSignals, names: dict[str, float]) -> Trace:
        """Return a number at each step that is the same for the same name; -1 for none."""
        numbers = {
            float(code): names.setdefault(words[0], float(len(names)))
            for code, words in run.words[str(signal)].items()
        }
        number_of = np.vectorize(lambda code: numbers.get(code, -1.0), otypes=[np.float64])
        return signal.trace(run).map(number_of)

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return f"{self.one} == {self.other}"


class Condition(Measurement, Expectation):
    """A signal that is true or false at each step; it is an expectation itself."""

    unit = ""

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return infinity where it is true, minus infinity where it is false."""
        return self.trace(run).map(truth)
