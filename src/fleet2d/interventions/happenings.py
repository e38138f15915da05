"""Which events can happen in a run at all: what scripts may wait for."""

from collections.abc import Iterable

from fleet2d.entities.actor import Actor
from fleet2d.errors import ScenarioError
from fleet2d.events import KINDS, EventKind
from fleet2d.interventions.when import Trigger
from fleet2d.interventions.world import World
from fleet2d.problems import did_you_mean

# What any person may do, by an order if not by a behavior.
OF_PEOPLE = frozenset(
    {EventKind.ACTIVITY, EventKind.CAME_HOME, EventKind.LEFT_HOME, EventKind.USES}
)
OF_DOORS = frozenset({EventKind.OPENED, EventKind.SHUT, EventKind.LOCKED, EventKind.UNLOCKED})
OF_HOME = frozenset({EventKind.MOVED, EventKind.ROOM_CHANGED})


def possible_events(world: World) -> dict[str, frozenset[str]]:
    """Return which kinds of events can happen to whom, by name; the empty name is the home."""
    kinds = {name: _of(user, world, OF_PEOPLE) for name, user in world.users.items()}
    kinds |= {name: _of(robot, world, {EventKind.CALLED}) for name, robot in world.robots.items()}
    kinds |= dict.fromkeys(world.doors, OF_DOORS)
    kinds |= dict.fromkeys(world.sensors, frozenset({EventKind.SENSOR}))
    return {"": OF_HOME} | kinds


def check_trigger(world: World, trigger: Trigger) -> None:
    """Refuse an event that can never happen.

    Raises:
        ScenarioError: Says what can.
    """
    possible = possible_events(world)
    if trigger.entity is not None and (not trigger.entity or trigger.entity not in possible):
        names = [name for name in possible if name]
        raise ScenarioError(
            f"there is nobody and nothing named {trigger.entity!r}"
            f"{did_you_mean(trigger.entity, names)} There are: {', '.join(names)}"
        )
    kinds = sorted(frozenset().union(*possible.values()))
    if trigger.event not in {*KINDS, *kinds}:
        raise ScenarioError(
            f"there is no event {trigger.event!r}{did_you_mean(trigger.event, [*kinds, *KINDS])}"
            f" What can happen in this run: {', '.join(kinds)}"
        )
    of_whom = "in this run" if trigger.entity is None else f"to {trigger.entity}"
    can = kinds if trigger.entity is None else sorted(possible[trigger.entity])
    if trigger.event not in can:
        raise ScenarioError(
            f"{trigger.event!r} can never happen {of_whom}{did_you_mean(trigger.event, can)}"
            f" What can: {', '.join(can)}"
        )
    if trigger.event in (EventKind.USER_SEEN, EventKind.USER_LOST):
        _check_detail(trigger, world.users, "user")
    if trigger.event in (EventKind.ROBOT_SEEN, EventKind.ROBOT_LOST):
        _check_detail(trigger, world.robots, "robot")


def _check_detail(trigger: Trigger, names: Iterable[str], noun: str) -> None:
    """Refuse somebody who can't come into view; the empty name is somebody not recognized."""
    known = list(names)
    if trigger.detail and trigger.detail not in known:
        raise ScenarioError(
            f"there is no {noun} {trigger.detail!r}{did_you_mean(trigger.detail, known)}"
            f" There are: {', '.join(known)}"
        )


def _of(actor: Actor, world: World, always: Iterable[str]) -> frozenset[str]:
    """Return what can happen to a body."""
    kinds = {str(kind) for kind in always}
    is_robot = actor.name in world.robots
    if actor.entity.eyes and (world.users if is_robot else world.robots):
        kinds |= set(actor.entity.sight_events)
    if getattr(actor.entity, "battery", None) is not None:
        kinds.add(EventKind.BATTERY)
    if getattr(actor.entity, "gives_way", None) is not None:
        kinds |= {EventKind.GIVES_WAY, EventKind.GIVES_UP}
    if world.doors or world.home.costs_version:
        kinds.add(EventKind.WAY_BLOCKED)
    for behavior in actor.behaviors:
        kinds |= behavior.records
        if not type(behavior).__module__.startswith("fleet2d."):
            kinds |= KINDS  # it may note any of them
    return frozenset(kinds)
