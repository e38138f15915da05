"""Events: what happens in a run, for its tables, algorithms and scripts."""

from array import array
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Sequence, Set
from enum import StrEnum
from functools import partial
from itertools import chain, islice
from operator import itemgetter
from typing import Any, NamedTuple, Protocol

from fleet2d.errors import InputError

HOME = ""
"""The entity of an event that happens to the home as a whole."""


class EventKind(StrEnum):
    """Every kind of event that Fleet2D itself records.

    A behavior that records others declares them by `records` in its class.
    """

    # Cameras
    USER_LOST = "user_lost"
    USER_SEEN = "user_seen"
    ROBOT_LOST = "robot_lost"
    ROBOT_SEEN = "robot_seen"
    # People
    ACTIVITY = "activity"
    CAME_HOME = "came_home"
    KNOWN = "known"
    LEFT_HOME = "left_home"
    REACTS = "reacts"
    UNKNOWN = "unknown"
    USES = "uses"
    # Robots
    ACCEPTED = "accepted"
    ALLOWED = "allowed"
    APPROACHES = "approaches"
    ASKS = "asks"
    BANNED = "banned"
    BATTERY = "battery"
    CALLED = "called"
    CALLS = "calls"
    CHARGED = "charged"
    COLLECTS = "collects"
    DECLINED = "declined"
    DEFERRED = "deferred"
    DELIVERED = "delivered"
    DOCKS = "docks"
    DUE = "due"
    EXPIRED = "expired"
    EXPLORED = "explored"
    EXPLORES = "explores"
    FIND_BEGINS = "find_begins"
    FOLLOWS = "follows"
    FOUND = "found"
    GAVE_UP = "gave_up"
    GIVES_UP = "gives_up"
    GIVES_WAY = "gives_way"
    IGNORED = "ignored"
    INTERACTION_OVER = "interaction_over"
    INTERACTS = "interacts"
    LOCALIZATION_LOST = "localization_lost"
    LOST = "lost"
    MISTAKEN = "mistaken"
    NOT_AT_HOME = "not_at_home"
    OPPORTUNITY = "opportunity"
    QUESTION = "question"
    RELOCALIZED = "relocalized"
    RELOCATES = "relocates"
    REPLAY = "replay"
    REPLIES = "replies"
    RETRACED = "retraced"
    RETRACES = "retraces"
    SENT_AWAY = "sent_away"
    SWITCHED_OFF = "switched_off"
    VISITS = "visits"
    WAY_BLOCKED = "way_blocked"
    WITHDRAWS = "withdraws"
    # The home
    LIGHT_OFF = "light_off"
    LIGHT_ON = "light_on"
    LOCKED = "locked"
    MOVED = "moved"
    OPENED = "opened"
    ROOM_CHANGED = "room_changed"
    SENSOR = "sensor"
    SHUT = "shut"
    UNLOCKED = "unlocked"


KINDS = frozenset(kind.value for kind in EventKind)
SIGHTS = frozenset(
    {EventKind.USER_LOST, EventKind.USER_SEEN, EventKind.ROBOT_LOST, EventKind.ROBOT_SEEN}
)
CHANGES = frozenset(
    {
        EventKind.LIGHT_OFF, EventKind.LIGHT_ON, EventKind.LOCKED, EventKind.MOVED,
        EventKind.OPENED, EventKind.ROOM_CHANGED, EventKind.SHUT, EventKind.UNLOCKED,
    }
)  # fmt: skip

RANKS = {kind.value: 1 for kind in SIGHTS} | {kind.value: 2 for kind in CHANGES}
"""The order among the events of one entity at one step: plans, 0, come before the others."""


class Event(NamedTuple):
    """An event.

    Attributes:
        step: The step at which it happened.
        entity: Name of the body or object that it happened to; empty for the home.
        event: Its kind: one of EventKind, or one that a behavior declares.
        detail: Details by kind; for a camera's event, the person or robot seen or lost.
    """

    step: int
    entity: str
    event: str
    detail: str

    @property
    def rank(self) -> int:
        """The order among the events of one entity at one step: plans, cameras, the home."""
        return RANKS.get(self.event, 0)


STEP = itemgetter(0)
# Makes an event from a tuple of its fields without calling Python code, as a run has many.
new_event: Callable[[tuple[int, str, str, str]], Event] = partial(tuple.__new__, Event)


class EventSink(Protocol):
    """A receiver of the events of a run: its tables, the history of algorithms, a script."""

    def take_events(self, events: Sequence[Event]) -> None:
        """Receive events, in the order in which they became known, not by step."""


class Listener(NamedTuple):
    """A function that receives the events of a run in order.

    Attributes:
        function: The function.
        kinds: The kinds of events that it receives.
    """

    function: Callable[[Sequence[Event]], None]
    kinds: Set[str]


class EventStream:
    """The events of a run, passed on to all sinks.

    Sinks receive events as they become known, listeners all events of a stretch of steps in order,
    also readings of sensors, which have a table of their own.

    Attributes:
        sinks: The receivers.
        listeners: The functions of callers.
        awaited: Kinds of events that end a span.
        CAPACITY: Number of the newest events that `since` can return.
    """

    CAPACITY = 1 << 16

    def __init__(self, sinks: Iterable[EventSink] = (), entities: Iterable[str] = ()) -> None:
        """Begin without events.

        Args:
            sinks: The receivers.
            entities: The bodies and objects of the run, in the order of its tables.
        """
        self.sinks = list(sinks)
        self.listeners: list[Listener] = []
        self.awaited: Set[str] = frozenset()
        self._row = {name: row for row, name in enumerate([HOME, *entities])}
        self._unheard: list[Event] = []  # by the listeners
        self._awaited_steps: list[int] = []  # of awaited events since the last span began
        self._recent: deque[Event] = deque(maxlen=self.CAPACITY)
        self._first_step = 0  # all events from this step on are in `_recent`

    def __getstate__(self) -> dict[str, object]:
        """Leave out the functions: they belong to the caller, not to the run."""
        recent = _packed(self._recent)
        return {**self.__dict__, "listeners": [], "_unheard": [], "_recent": recent}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the events."""
        events = _unpacked(*state["_recent"])
        self.__dict__ |= {**state, "_recent": deque(events, maxlen=self.CAPACITY)}

    def emit(self, events: Sequence[Event]) -> None:
        """Pass events on to all sinks."""
        if not events:
            return
        self._keep(events)
        for sink in self.sinks:
            sink.take_events(events)

    def emit_readings(self, events: Sequence[Event]) -> None:
        """Pass readings of sensors on to listeners, as events."""
        if events:
            self._keep(events)

    def next_awaited(self, step: int) -> int | None:
        """Return the first step from `step` on with an awaited event that was emitted already."""
        steps, self._awaited_steps = self._awaited_steps, []
        return min((s for s in steps if s >= step), default=None)

    def deliver(self, end: int) -> None:
        """Call the listeners with the events of the steps before `end`, in the order of tables."""
        row = self._row
        due = [event for event in self._unheard if event.step < end]
        self._unheard = [event for event in self._unheard if event.step >= end]
        due.sort(key=lambda e: (e.step, row.get(e.entity, len(row)), e.rank))
        for function, kinds in self.listeners:
            if events := [event for event in due if event.event in kinds]:
                function(events)

    def _keep(self, events: Sequence[Event]) -> None:
        excess = len(self._recent) + len(events) - self.CAPACITY
        if excess > 0:
            oldest = islice(chain(self._recent, events), excess)
            self._first_step = max(self._first_step, max(map(STEP, oldest)) + 1)
        self._recent.extend(events)
        if self.listeners:
            self._unheard += events
        if self.awaited:
            self._awaited_steps += [e.step for e in events if e.event in self.awaited]

    def since(self, step: int) -> list[Event]:
        """Return the events from a step on, in the order of their steps.

        Raises:
            InputError: Too many events have happened since that step.
        """
        if step < self._first_step:
            raise InputError(
                f"events from step {self._first_step} on are kept, not from step {step}: ask"
                " more often, or read the table 'events'"
            )
        return sorted((e for e in self._recent if e.step >= step), key=lambda e: (e.step, e.rank))


def _packed(events: Iterable[Event]) -> tuple[bytes, list[str]]:
    """Return the steps and texts of events as numbers, and the texts: a checkpoint has many."""
    index: defaultdict[str, int] = defaultdict()
    index.default_factory = index.__len__
    steps, *texts = list(zip(*events, strict=True)) or [()]
    columns = [steps, *(map(index.__getitem__, column) for column in texts)]
    return array("q", chain.from_iterable(columns)).tobytes(), list(index)


def _unpacked(numbers: bytes, texts: list[str]) -> Iterator[Event]:
    """Return events from what `_packed` returned."""
    values = array("q", numbers)
    count = len(values) // len(Event._fields)
    steps, *columns = (values[k * count : (k + 1) * count] for k in range(len(Event._fields)))
    codes = (map(texts.__getitem__, column) for column in columns)
    return map(new_event, zip(steps, *codes, strict=True))
