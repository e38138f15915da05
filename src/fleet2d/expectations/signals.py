"""Signals: what is measured in a run at each step, as numbers, words or truth values.

A signal is one class: its word, the names that it may use (of a `Scene`), and its measurement over
a block of steps. Those that there are stand in `fleet2d.expectations.vocabulary`.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, fields
from datetime import timedelta
from typing import Any, ClassVar, Protocol

import numpy as np
from pydantic_core import PydanticCustomError

from fleet2d.algorithms.observations import Activities
from fleet2d.configuration.components import components
from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import LENGTH, SHARE, SPEED, format_duration
from fleet2d.entities.behavior import Actor, Behavior
from fleet2d.entities.body import Pose
from fleet2d.errors import InputError, ScenarioError
from fleet2d.expectations.expectation import (
    Expectation,
    RunSignals,
    Term,
    Word,
    argument_text,
    number_text,
    truth,
)
from fleet2d.expectations.traces import INFINITE, TINY, Trace, constant, joined, shortest
from fleet2d.floorplan.home import Home
from fleet2d.kernels import F64, I64
from fleet2d.kernels.motion import Window
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import KINDS, SIGHTS, Event, EventKind

QUANTITIES = {"m": LENGTH, "m/s": SPEED, "share": SHARE}
"""How the limits of a signal are written, by its unit; limits of others are plain numbers."""


# Names


@dataclass(frozen=True)
class Scene:
    """The names of a run that expectations may use, to check them before the run.

    Attributes:
        names: The names, by what they name: users, robots, rooms (also their types), things of the
            home, doors, sensors, algorithms, metrics, batteries (the robots that have one), and
            bodies (users and robots).
        cameras: For each body with cameras, the names of the bodies that they look at.
        events: The kinds of events that can happen to each entity; an empty name is the home.
        remaining: Time from now to the end of the run.
    """

    names: Mapping[str, Collection[str]]
    cameras: Mapping[str, Collection[str]]
    events: Mapping[str, Set[str]]
    remaining: timedelta

    def check_name(self, noun: str, name: str, known: Iterable[str], of: object) -> None:
        """Refuse an unknown name.

        Raises:
            ScenarioError: The name is unknown; the message has the nearest name, and all of them.
        """
        names = list(dict.fromkeys(known))
        if name not in names:
            raise ScenarioError(f"{of}: there is no {noun} {name!r}{suggest(name, names)}")

    def check_within(self, within: timedelta | None, of: object) -> None:
        """Refuse a time that is longer than the run.

        Raises:
            ScenarioError: The time is longer than what remains of the run.
        """
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
            behaviors = _behaviors_with(kind)
            to = f"robots with the behavior {' or '.join(behaviors)} " if behaviors else ""
            here = ", ".join(names) or "none"
            raise ScenarioError(
                f"{of}: no such event is possible: {kind!r} happens only to {to}(here: {here})"
            )
        if kind in SIGHTS and detail is not None:
            self.check_name("user or robot", detail, self.names["bodies"], of)


def _behaviors_with(kind: str) -> list[str]:
    """Return the types of behaviors that record a kind of event."""
    return [
        name
        for name, cls in components("behavior").items()
        if issubclass(cls, Behavior) and kind in cls.records
    ]


# Measuring


class MeasuredBodies(Protocol):
    """The bodies of a run and their poses, each by its row."""

    def window(self, first: int, end: int) -> Window:
        """Return the runs of equal pose of all bodies in the steps from `first` to `end` - 1."""

    def runs(self, row: int, first: int, end: int) -> Window:
        """Return the runs of equal pose of one body in these steps."""

    def pose_at(self, row: int, step: int) -> Pose:
        """Return the pose of a body at a step."""


class MeasuredCameras(Protocol):
    """The cameras of a body, as signals are measured by them."""

    @property
    def index(self) -> int:
        """The number of the owner among the robots, or among the users."""

    @property
    def in_view(self) -> Mapping[str, object]:
        """The bodies that count as seen at present, by name."""

    @property
    def names(self) -> list[str]:
        """The bodies that they look at, by their numbers."""

    def perfect(self) -> "ErrorFreeCameras":
        """Return cameras that notice all bodies in view at each step, from the present one on."""


class ErrorFreeCameras(Protocol):
    """Cameras that make no errors."""

    def look(self, end: int) -> Iterable[Event]:
        """Look in the steps up to `end` - 1; return the events of seeing and losing."""


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
    bodies: MeasuredBodies
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
        observations: The observations of robots, int64 (n, OBSERVATION).
        readings: The readings of sensors: step, name and whether it is on.
        events: The events, in order of step.
    """

    first: int
    end: int
    bodies: MeasuredBodies
    home: Home
    observations: I64
    readings: Sequence[tuple[int, str, bool]]
    events: Sequence[Event] = ()


class Gauge:
    """The measurement of a signal during a run, block by block.

    Attributes:
        signal: The signal.
        memory: What its `measure` needs from block to block; see `Measurement.start`.
        now: The latest value, of signals that only change now and then; NaN: it is missing.
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
        start, value = [block.first], [self.now]
        for step, now in changes:
            if step > start[-1]:
                start.append(step)
                value.append(now)
            else:
                value[-1] = now
        self.now = value[-1]
        return shortest(np.array(start, np.int64), np.array(value, np.float64), block.end)


@dataclass(frozen=True, eq=False)
class Measurement(Word, Term):
    """Base of what is measured during a run; signals of the same text are the same signal.

    Attributes:
        of: What the first field names: as a noun for messages, and in `Scene.names`; or nothing.
    """

    of: ClassVar[tuple[str, str] | None] = None

    def trace(self, run: RunSignals) -> Trace:
        """Return its values from the first judged step on."""
        return run.traces[str(self)].since(run.first)

    def measures(self) -> Iterator["Measurement"]:
        """Yield itself."""
        yield self

    def check(self, scene: Scene) -> None:
        """Refuse a signal that this run doesn't have.

        Raises:
            ScenarioError: A name is unknown, or the signal can never be measured.
        """
        if self.of is not None:
            noun, known = self.of
            scene.check_name(noun, getattr(self, fields(self)[0].name), scene.names[known], self)

    def start(self, run: MeasuredRun, gauge: Gauge) -> Any:
        """Return what `measure` needs from block to block, before the first one."""

    def measure(self, block: SignalBlock, gauge: Gauge) -> Trace:
        """Return the values over a block of steps."""
        raise NotImplementedError

    def begin_plan(self, actor: Actor, gauge: Gauge) -> None:
        """Note that a body begins a plan."""

    def learn(
        self, outputs: Mapping[str, Any], results: Mapping[str, Callable[[], Any]], gauge: Gauge
    ) -> None:
        """Note new outputs of algorithms and results of metrics, by name, before the next block."""

    def finish(self, results: Mapping[str, Any], gauge: Gauge) -> None:
        """Note the results of metrics over the whole run, which count at its last step."""


# Kinds of signals


class Signal(Term):
    """A number at each step; compare it by `>`, `>=`, `<`, `<=`, `==`, `!=`.

    Where it is missing (an algorithm without an output so far), no comparison holds.
    """

    def trace(self, run: RunSignals) -> Trace:
        """Return its values from the first judged step on."""
        raise NotImplementedError

    def __gt__(self, limit: float | str) -> Expectation:
        """Expect the signal above a limit."""
        return SignalComparison(self, ">", limit)

    def __ge__(self, limit: float | str) -> Expectation:
        """Expect the signal at a limit or above it."""
        return SignalComparison(self, ">=", limit)

    def __lt__(self, limit: float | str) -> Expectation:
        """Expect the signal below a limit."""
        return SignalComparison(self, "<", limit)

    def __le__(self, limit: float | str) -> Expectation:
        """Expect the signal at a limit or below it."""
        return SignalComparison(self, "<=", limit)

    def __eq__(self, limit: object) -> Expectation:  # type: ignore[override]
        """Expect the signal to equal a limit."""
        return SignalComparison(self, "==", limit)

    def __ne__(self, limit: object) -> Expectation:  # type: ignore[override]
        """Expect the signal to differ from a limit."""
        return SignalComparison(self, "!=", limit)

    __hash__ = object.__hash__


class NumberSignal(Measurement, Signal):
    """A number that is measured."""


@dataclass(frozen=True, eq=False)
class SignalComparison(Expectation):
    """A comparison of a signal with a limit; its robustness is the distance from the limit."""

    signal: Signal
    sign: str
    limit: Any  # as it is written, then a number

    is_call = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "limit", _limit(self.signal, self.limit))

    @property
    def unit(self) -> str:  # type: ignore[override]
        """The unit of the signal; 1 if it has none."""
        return self.signal.unit or "1"

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return the distance of the signal from the limit, below 0 on the wrong side."""
        return self.signal.trace(run).map(self._margin)

    def _margin(self, value: F64) -> F64:
        excess = value - self.limit
        margin = np.abs(excess) if self.sign in ("==", "!=") else excess
        margin = -margin if self.sign in ("==", "<", "<=") else margin
        margin = np.where(margin == 0, TINY if self.sign in ("==", "<=", ">=") else -TINY, margin)
        return np.where(np.isnan(margin), -INFINITE, margin)

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        return f"{self.signal} {self.sign} {number_text(self.limit, self.signal.unit)}"


def _limit(signal: Signal, limit: object) -> float:
    try:
        if signal.unit in QUANTITIES:
            return float(QUANTITIES[signal.unit].parse(limit))
        if isinstance(limit, int | float | np.number) and not isinstance(limit, bool):
            return float(limit)
    except PydanticCustomError as error:
        raise InputError(f"{signal} is compared with {limit!r}: {error}") from None
    raise InputError(f"{signal} is compared with {limit!r}, expected a number")


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

    def check(self, scene: Scene) -> None:
        """Refuse a signal or a word that this run doesn't have."""
        super().check(scene)
        for word in self.words:
            self.signal.check_word(word, scene)

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return infinity where the signal has one of the words, minus infinity elsewhere."""
        words_by_code = run.words[str(self.signal)].items()
        codes = [float(code) for code, words in words_by_code if set(words) & set(self.words)]
        return self.signal.trace(run).map(lambda value: truth(np.isin(value, codes)))

    def __str__(self) -> str:
        """Return the text that `parse_expectation` reads back."""
        if len(self.words) == 1:
            return f'{self.signal} == "{self.words[0]}"'
        return f"{self.signal} in [{', '.join(map(argument_text, self.words))}]"


@dataclass(frozen=True, eq=False)
class Condition(Measurement, Expectation):
    """A signal that is true or false at each step; it is an expectation itself."""

    unit = ""

    def robustness(self, run: RunSignals, high: bool) -> Trace:
        """Return infinity where it is true, minus infinity where it is false."""
        return self.trace(run).map(truth)
