"""Scenes: the names of a run that expectations may use."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from datetime import timedelta

from fleet2d.configuration.problems import suggest
from fleet2d.configuration.units import format_duration
from fleet2d.errors import ScenarioError
from fleet2d.runtime.events import KINDS, SIGHTS, EventKind

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

    def error(self, message: str) -> ScenarioError:
        """Return an error with a message."""
        return ScenarioError(message)

    def check_name(self, noun: str, name: str, known: Iterable[str], of: object) -> None:
        """Refuse an unknown name.

        Raises:
            ScenarioError: The name is unknown; the message has the nearest name, and all of them.
        """
        names = list(dict.fromkeys(known))
        if name not in names:
            raise self.error(f"{of}: there is no {noun} {name!r}{suggest(name, names)}")

    def check_body(self, name: str, of: object) -> None:
        """Refuse a name that is neither a user's nor a robot's.

        Raises:
            ScenarioError: The name is unknown.
        """
        self.check_name("user or robot", name, self.bodies, of)

    def check_within(self, within: timedelta | None, of: object) -> None:
        """Refuse a time that is longer than the run.

        Raises:
            ScenarioError: The time is longer than what remains of the run.
        """
        if within is not None and within > self.remaining:
            raise self.error(
                f"{of}: {format_duration(within)} is beyond the run, which goes on for"
                f" {format_duration(self.remaining)}"
            )

    def check_event(self, kind: str, entity: str | None, detail: str | None, of: object) -> None:
        """Refuse an event that can never happen.

        Raises:
            ScenarioError: The kind is unknown, or there is no entity to which it could happen.
        """
        if kind == EventKind.SENSOR:
            raise self.error(f"{of}: sensor readings are not events: write sensor(NAME)")
        self.check_name("event", kind, sorted({*KINDS, *self.records}), of)
        candidates = list(self._candidates(kind))
        if entity is not None:
            self.check_name("body or object", entity, [*self.bodies, *self.doors], of)
        is_possible = bool(candidates) and (entity in (None, *candidates) or candidates == [""])
        if not is_possible:
            raise self.error(
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
