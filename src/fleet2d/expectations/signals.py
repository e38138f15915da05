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

from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import Quantity, format_duration
from fleet2d.entities.behavior import Actor
from fleet2d.entities.body import Pose
from fleet2d.errors import InputError, ScenarioError
from fleet2d.expectations.expectation import (
    INFINITE,
    TINY,
    Expectation,
    RunSignals,
    Trace,
    Word,
    argument_text,
    constant,
    joined,
    number_text,
    shortest,
    truth,
)
from fleet2d.floorplan.home import Home
from fleet2d.kernels import F64, I64
from fleet2d.kernels.motion import Window
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.events import KINDS, SIGHTS, Event, EventKind

# Names

# Kinds of events that only one type of behavior records.
_OF_BEHAVIORS = {
    "dock": {EventKind.DOCKS, EventKind.CHARGED},
    "explore": {EventKind.EXPLORED},
    "find": {
        EventKind.FIND_BEGINS, EventKind.FOUND, EventKind.GAVE_UP, EventKind.NOT_AT_HOME
    },
    "follow": {EventKind.FOLLOWS, EventKind.LOST},
    "hangout": {EventKind.RELOCATES},
    "opportunistic": {
        EventKind.APPROACHES, EventKind.INTERACTS, EventKind.INTERACTION_OVER
    },
    "retrace": {EventKind.RETRACES, EventKind.RETRACED},
    "scheduled": {EventKind.VISITS},
}  # fmt: skip
_OF_DOORS = {EventKind.OPENED, EventKind.SHUT, EventKind.LOCKED, EventKind.UNLOCKED}


@dataclass(frozen=True)
class Scene:
    """The names of a run that expectations may use, to check them before the run.

    Attributes:
        users: Names of users.
        robots: Names of robots.
        rooms: Names and types of rooms.
        things: Names of objects of the home.
        doors: Names of doors.
        sensors: Names of sensors.
        algorithms: Names of algorithms.
        metrics: Names of metrics.
        batteries: Names of robots that have a battery.
        cameras: For each body with cameras, the names of the bodies that they look at.
        behaviors: The types of behaviors of each body; "own" stands for a user's own classes.
        records: Kinds of events that a user's own behaviors record.
        remaining: Time from now to the end of the run.
    """

    users: Collection[str]
    robots: Collection[str]
    rooms: Collection[str]
    things: Collection[str]
    doors: Collection[str]
    sensors: Collection[str]
    algorithms: Collection[str]
    metrics: Collection[str]
    batteries: Collection[str]
    cameras: Mapping[str, Collection[str]]
    behaviors: Mapping[str, Collection[str]]
    records: Collection[str]
    remaining: timedelta

    @property
    def bodies(self) -> list[str]:
        """Names of users and robots."""
        return [*self.users, *self.robots]

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
        self.check_name("event", kind, sorted({*KINDS, *self.records}), of)
        candidates = list(self._candidates(kind))
        if entity is not None:
            self.check_name("body or object", entity, [*self.bodies, *self.doors], of)
        is_possible = bool(candidates) and (entity in (None, *candidates) or candidates == [""])
        if not is_possible:
            raise ScenarioError(
                f"{of}: no such event is possible: {kind!r} happens only to {_entities_of(kind)}"
                f" (here: {', '.join(candidates) or 'none'})"
            )
        if kind in SIGHTS and detail is not None:
            self.check_name("user or robot", detail, self.bodies, of)

    def _candidates(self, kind: str) -> Iterable[str]:
        """Return the names of the entities an event can happen to; an empty name is the home."""
        if kind in (EventKind.MOVED, EventKind.ROOM_CHANGED):
            return [""]
        if kind in _OF_DOORS:
            return self.doors
        if kind in (EventKind.USER_SEEN, EventKind.USER_LOST):
            return [name for name in self.robots if self.cameras.get(name)]
        if kind in (EventKind.ROBOT_SEEN, EventKind.ROBOT_LOST):
            return [name for name in self.users if self.cameras.get(name)]
        if kind == EventKind.BATTERY:
            return self.batteries
        if kind == EventKind.ACTIVITY:
            return self.users
        for behavior, kinds in _OF_BEHAVIORS.items():
            if kind in kinds:
                return [n for n in self.robots if {behavior, "own"} & set(self.behaviors[n])]
        return self.bodies


def _entities_of(kind: str) -> str:
    """Describe the entities to which an event can happen."""
    if kind in _OF_DOORS:
        return "doors"
    if kind in SIGHTS:
        return "robots and users with a camera and somebody to see"
    if kind == EventKind.BATTERY:
        return "robots with a battery"
    if kind == EventKind.ACTIVITY:
        return "users"
    behaviors = [name for name, kinds in _OF_BEHAVIORS.items() if kind in kinds]
    return f"robots with the behavior {' or '.join(behaviors)}" if behaviors else "users and robots"


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

    def number_of(self, name: str) -> int:
        """Return the number of a body among those that they look at."""

    def perfect(self) -> "ErrorFreeCameras":
        """Return cameras that notice all bodies in view at each step, from the present one on."""


class ErrorFreeCameras(Protocol):
    """Cameras that make no errors."""

    def look(self, end: int) -> Iterable[Event]:
        """Look in the steps up to `end` - 1; return the events of seeing and losing."""


class MeasuredRun(Protocol):
    """The run in which signals are measured."""

    @property
    def actors(self) -> Sequence[Actor]:
        """Users, then robots; their numbers are the rows of poses."""

    @property
    def bodies(self) -> MeasuredBodies:
        """The bodies and their poses."""

    @property
    def home(self) -> Home:
        """The home."""

    @property
    def clock(self) -> Clock:
        """The steps of the run."""

    @property
    def first(self) -> int:
        """The first step that will be measured."""

    @property
    def doors(self) -> Sequence[str]:
        """The names of doors in the order of their numbers."""

    @property
    def sensors_on(self) -> Mapping[str, bool]:
        """Whether each sensor is on at present, by name."""

    def row(self, name: str) -> int:
        """Return the row of a body."""

    def cameras_of(self, name: str) -> MeasuredCameras:
        """Return the cameras of a body."""

    def activity_of(self, row: int) -> str | None:
        """Return the present activity of a user; None if none is known."""


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
        self.words: dict[int, Set[str]] = {}
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
        trace = joined(self._traces)
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
class Measurement(Word):
    """Base of what is measured during a run; signals of the same text are the same signal.

    Attributes:
        of: What the first field names, as a noun for messages, and as an attribute of `Scene`.
    """

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
        scene.check_name(noun, getattr(self, fields(self)[0].name), getattr(scene, known), self)

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
