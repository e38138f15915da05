"""The events that can happen in a run, for scripts and expectations that name one."""

from collections.abc import Iterable, Sequence

from fleet2d.entities.behavior import Actor
from fleet2d.floorplan.home import Home
from fleet2d.runtime.events import KINDS, EventKind

# Events of every person: an order can cause them if no behavior does.
PERSON_EVENTS = frozenset(
    {EventKind.ACTIVITY, EventKind.CAME_HOME, EventKind.LEFT_HOME, EventKind.USES}
)
DOOR_EVENTS = frozenset({EventKind.OPENED, EventKind.SHUT, EventKind.LOCKED, EventKind.UNLOCKED})
HOME_EVENTS = frozenset({EventKind.MOVED, EventKind.ROOM_CHANGED})
SENSOR_EVENTS = frozenset({EventKind.SENSOR})


def possible_events(
    users: Iterable[Actor],
    robots: Iterable[Actor],
    home: Home,
    doors: Sequence[str],
    sensors: Iterable[str],
) -> dict[str, frozenset[str]]:
    """Return the kinds of events that can happen to each entity, by name; "" is the home."""
    users, robots = list(users), list(robots)
    may_block = bool(doors or home.costs_version)
    kinds: dict[str, frozenset[str]] = {"": frozenset(HOME_EVENTS)}
    kinds |= {u.name: _kinds_of(u, PERSON_EVENTS, bool(robots), may_block) for u in users}
    kinds |= {r.name: _kinds_of(r, {EventKind.CALLED}, bool(users), may_block) for r in robots}
    return kinds | dict.fromkeys(doors, DOOR_EVENTS) | dict.fromkeys(sensors, SENSOR_EVENTS)


def _kinds_of(
    actor: Actor, always: Iterable[str], sees_somebody: bool, may_block: bool
) -> frozenset[str]:
    """Return the kinds of events that can happen to a body."""
    kinds = {str(kind) for kind in always}
    if actor.entity.eyes and sees_somebody:
        kinds |= set(actor.entity.sight_events)
    if getattr(actor.entity, "battery", None) is not None:
        kinds.add(EventKind.BATTERY)
    if getattr(actor.entity, "gives_way", None) is not None:
        kinds |= {EventKind.GIVES_WAY, EventKind.GIVES_UP}
    if may_block:
        kinds.add(EventKind.WAY_BLOCKED)
    for behavior in actor.behaviors:
        kinds |= behavior.records
        if not type(behavior).__module__.startswith("fleet2d."):
            kinds |= KINDS  # it may record any of them
    return frozenset(kinds)
