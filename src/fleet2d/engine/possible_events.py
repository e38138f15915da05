"""The events that can happen in a run: their kinds by entity, and their details."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from fleet2d.entities.behavior import Actor, is_own
from fleet2d.floorplan.home import Home
from fleet2d.interactions.interaction import REQUEST_EVENTS
from fleet2d.runtime.events import KINDS, EventKind

# Every person has these events: an order can cause them if no behavior does.
PERSON_EVENTS = frozenset(
    {EventKind.ACTIVITY, EventKind.CAME_HOME, EventKind.LEFT_HOME, EventKind.USES}
)
# Every robot has these events, which interventions cause.
ROBOT_EVENTS = frozenset(
    {
        EventKind.ALLOWED, EventKind.BANNED, EventKind.CALLED, EventKind.DEADLOCK,
        EventKind.GIVES_UP, EventKind.GIVES_WAY, EventKind.LOCALIZATION_LOST, EventKind.OVERLAPS,
        EventKind.POWER_OFF, EventKind.POWER_ON, EventKind.RELOCALIZED, EventKind.WITHDRAWS,
    }
)  # fmt: skip
DOOR_EVENTS = frozenset({EventKind.OPENED, EventKind.SHUT, EventKind.LOCKED, EventKind.UNLOCKED})
HOME_EVENTS = frozenset(
    {EventKind.MOVED, EventKind.ROOM_CHANGED, EventKind.LIGHT_ON, EventKind.LIGHT_OFF}
)
SENSOR_EVENTS = frozenset({EventKind.SENSOR})
# Events with the name of a user, or of a robot, as their detail.
ABOUT_USERS = (
    EventKind.USER_SEEN, EventKind.USER_LOST, EventKind.FIND_BEGINS, EventKind.FOUND,
    EventKind.GAVE_UP, EventKind.NOT_AT_HOME, EventKind.FOLLOWS, EventKind.LOST,
    EventKind.APPROACHES, EventKind.INTERACTS, EventKind.INTERACTION_OVER,
)  # fmt: skip
ABOUT_ROBOTS = (EventKind.ROBOT_SEEN, EventKind.ROBOT_LOST)
# Events with an interaction and a person as their detail.
OF_REQUESTS = (
    EventKind.DUE, EventKind.EXPIRED, EventKind.ASKS, EventKind.ACCEPTED, EventKind.DECLINED,
    EventKind.DEFERRED, EventKind.IGNORED, EventKind.MISTAKEN, EventKind.DELIVERED,
    EventKind.BROKEN_OFF,
)  # fmt: skip


def possible_events(
    users: Iterable[Actor],
    robots: Iterable[Actor],
    home: Home,
    doors: Sequence[str],
    sensors: Iterable[str],
) -> dict[str, frozenset[str]]:
    """Return the kinds of events that can happen to each entity, by name; "" is the home."""
    users = list(users)
    robots = list(robots)
    may_block = bool(doors or home.costs_version)
    kinds: dict[str, frozenset[str]] = {"": frozenset(HOME_EVENTS)}
    kinds |= {u.name: _kinds_of(u, PERSON_EVENTS, bool(robots), may_block) for u in users}
    kinds |= {r.name: _kinds_of(r, ROBOT_EVENTS, bool(users), may_block) for r in robots}
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
    if may_block:
        kinds.add(EventKind.WAY_BLOCKED)
    if actor.requests is not None:
        kinds |= {*REQUEST_EVENTS, EventKind.BROKEN_OFF}
    for behavior in actor.behaviors:
        kinds |= behavior.records
    if is_own(actor):
        kinds |= KINDS  # a class of the user may record any kind
    return frozenset(kinds)


def possible_details(
    users: Iterable[Actor], robots: Iterable[Actor], acts: Iterable[Mapping[str, Any]]
) -> dict[str, list[str]]:
    """Return the possible details of events, where all are known, by kind or kind and entity.

    Args:
        users: The users.
        robots: The robots.
        acts: The interventions that are scheduled or done: `fleet2d.interventions` as data.
    """
    users = list(users)
    robots = list(robots)
    acts = list(acts)
    people = [user.name for user in users]
    names = [robot.name for robot in robots]
    details: dict[str, list[str]] = {}
    if not any(is_own(robot) for robot in robots):
        details |= dict.fromkeys(ABOUT_USERS, people)
        calls = [f"{do} {name}" for do in ("come", "find") for name in people]
        details[EventKind.CALLED] = ["dock", *calls]
    details |= dict.fromkeys(ABOUT_ROBOTS, names)
    for robot in robots:
        if robot.requests is None or is_own(robot):
            continue
        for name, interaction in robot.requests.interactions.items():
            texts = [f"{name} {person}" for person in interaction.people]
            for kind in OF_REQUESTS:
                key = f"{kind} {robot.name}"
                details.setdefault(key, []).extend(texts)
    for user in users:
        # A log may hold any activities, and so may a class of the user's own.
        types = [behavior.type_name for behavior in user.behaviors]
        if not is_own(user) and "replay" not in types:
            told = [a["what"] for a in acts if a["do"] == "activity" and a["entity"] == user.name]
            known = [name for behavior in user.behaviors for name in behavior.activities()]
            details[f"{EventKind.ACTIVITY} {user.name}"] = [*known, *told]
    own = [details.get(f"{EventKind.ACTIVITY} {name}") for name in people]
    if all(activities is not None for activities in own):
        details[EventKind.ACTIVITY] = [name for activities in own for name in activities or ()]
    return details
