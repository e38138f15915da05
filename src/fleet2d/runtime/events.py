"""Events of a run, for its tables, algorithms and scripts."""

from collections.abc import Callable
from enum import StrEnum
from functools import partial
from typing import NamedTuple

HOME = ""
"""The entity of an event that happens to the home as a whole."""


class EventKind(StrEnum):
    """Every kind of event that Fleet2D itself records.

    A behavior that records other kinds declares them in `records`.
    """

    __repr__ = str.__repr__

    # These are events of cameras.
    USER_LOST = "user_lost"
    USER_SEEN = "user_seen"
    ROBOT_LOST = "robot_lost"
    ROBOT_SEEN = "robot_seen"
    # These happen to people.
    ACTIVITY = "activity"
    CAME_HOME = "came_home"
    KNOWN = "known"
    LEFT_HOME = "left_home"
    REACTS = "reacts"
    UNKNOWN = "unknown"
    USES = "uses"
    # These happen to robots.
    ACCEPTED = "accepted"
    ALLOWED = "allowed"
    APPROACHES = "approaches"
    ASKS = "asks"
    BANNED = "banned"
    BATTERY = "battery"
    BROKEN_OFF = "broken_off"
    CALLED = "called"
    CALLS = "calls"
    CHARGED = "charged"
    COLLECTS = "collects"
    DEADLOCK = "deadlock"
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
    GIVEN_UP = "given_up"
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
    OVERLAPS = "overlaps"
    POWER_OFF = "power_off"
    POWER_ON = "power_on"
    QUESTION = "question"
    RELOCALIZED = "relocalized"
    RELOCATES = "relocates"
    REPLAY = "replay"
    REPLIES = "replies"
    RETRACED = "retraced"
    RETRACES = "retraces"
    SENT_AWAY = "sent_away"
    SWITCHED_OFF = "switched_off"
    TOLD = "told"
    VISITS = "visits"
    WAY_BLOCKED = "way_blocked"
    WITHDRAWS = "withdraws"
    # These happen to the home, its doors and sensors.
    LIGHT_OFF = "light_off"
    LIGHT_ON = "light_on"
    LOCKED = "locked"
    MOVED = "moved"
    OPENED = "opened"
    ROOM_CHANGED = "room_changed"
    SENSOR = "sensor"
    SHUT = "shut"
    UNLOCKED = "unlocked"


KINDS = frozenset(EventKind)
SIGHTS: frozenset[str] = frozenset(
    {EventKind.USER_LOST, EventKind.USER_SEEN, EventKind.ROBOT_LOST, EventKind.ROBOT_SEEN}
)
CHANGES: frozenset[str] = frozenset(
    {
        EventKind.LIGHT_OFF, EventKind.LIGHT_ON, EventKind.LOCKED, EventKind.MOVED,
        EventKind.OPENED, EventKind.ROOM_CHANGED, EventKind.SHUT, EventKind.UNLOCKED,
    }
)  # fmt: skip

RANKS = dict.fromkeys(SIGHTS, 1) | dict.fromkeys(CHANGES, 2)
"""The order among the events of one entity at one step: plans, 0, come before the others."""


class Event(NamedTuple):
    """An event.

    Attributes:
        step: The step at which it happened.
        entity: Name of the body or object concerned; empty for the home.
        event: The kind: one of EventKind, or one that a behavior declares.
        detail: Details by kind; for a camera's event, the person or robot seen or lost.
    """

    step: int
    entity: str
    event: str
    detail: str

    @property
    def rank(self) -> int:
        """The rank among events of one entity at one step: plans, cameras, the home."""
        return RANKS.get(self.event, 0)


# A run has many events: this makes one from a tuple of its fields without calling Python code.
new_event: Callable[[tuple[int, str, str, str]], Event] = partial(tuple.__new__, Event)
