"""The events that can happen in a run: those that scripts may wait for."""

from collections.abc import Iterable

from fleet2d.configuration.problems import did_you_mean, suggest
from fleet2d.entities.behavior import Actor
from fleet2d.errors import ScenarioError
from fleet2d.interventions.when import Trigger
from fleet2d.interventions.world import World
from fleet2d.runtime.events import KINDS, EventKind

# Events of every person: an order can cause them if no behavior does.
OF_PEOPLE = frozenset(
    {EventKind.ACTIVITY, EventKind.CAME_HOME, EventKind.LEFT_HOME, EventKind.USES}
)
OF_DOORS = frozenset({EventKind.OPENED, EventKind.SHUT, EventKind.LOCKED, EventKind.UNLOCKED})
OF_HOME = frozenset({EventKind.MOVED, EventKind.ROOM_CHANGED})


def possible_events(world: World) -> dict[str, frozenset[str]]:
    """Return the kinds of events that can happen to each entity, by name; "" is the home."""
    robot_events = {EventKind.CALLED}
    kinds = {name: _kinds_of(user, world, OF_PEOPLE) for name, user in world.users.items()}
    kinds |= {name: _kinds_of(robot, world, robot_events) for name, robot in world.robots.items()}
    kinds |= dict.fromkeys(world.doors, OF_DOORS)
    kinds |= dict.fromkeys(world.sensors, frozenset({EventKind.SENSOR}))
    return {"": OF_HOME} | kinds


def check_trigger(world: World, trigger: Trigger) -> None:
    """Refuse an event that can never happen.

    Raises:
        ScenarioError: It can't happen; the message lists the events that can.
    """
    possible = possible_events(world)
    if trigger.entity is not None and (not trigger.entity or trigger.entity not in possible):
        names = [name for name in possible if name]
        raise ScenarioError(
            f"there is nobody and nothing named {trigger.entity!r}{suggest(trigger.entity, names)}"
        )
    kinds = sorted(frozenset().union(*possible.values()))
    if trigger.event not in {*KINDS, *kinds}:
        raise ScenarioError(
            f"there is no event {trigger.event!r}{did_you_mean(trigger.event, [*kinds, *KINDS])}"
            f" What can happen in this run: {', '.join(kinds)}"
        )
    if trigger.entity is not None:
        kinds = sorted(possible[trigger.entity])
    if trigger.event not in kinds:
        place = "in this run" if trigger.entity is None else f"to {trigger.entity}"
        raise ScenarioError(
            f"{trigger.event!r} can never happen {place}{suggest(trigger.event, kinds, 'What can')}"
        )
    if trigger.event in (EventKind.USER_SEEN, EventKind.USER_LOST):
        _check_detail(trigger, world.users, "user")
    if trigger.event in (EventKind.ROBOT_SEEN, EventKind.ROBOT_LOST):
        _check_detail(trigger, world.robots, "robot")


def _check_detail(trigger: Trigger, names: Iterable[str], noun: str) -> None:
    """Refuse an unknown body to come into view; the empty name is one that isn't recognized."""
    names = list(names)
    if trigger.detail and trigger.detail not in names:
        raise ScenarioError(
            f"there is no {noun} {trigger.detail!r}{suggest(trigger.detail, names)}"
        )


def _kinds_of(actor: Actor, world: World, always: Iterable[str]) -> frozenset[str]:
    """Return the kinds of events that can happen to a body."""
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
            kinds |= KINDS  # it may record any of them
    return frozenset(kinds)
