"""Remarks on settings, behaviors, requests and households that have no effect in a run."""

import math
from collections.abc import Iterator, Sequence

from fleet2d.entities.behavior import Actor, is_own
from fleet2d.floorplan.home import Home
from fleet2d.runtime.events import EventKind
from fleet2d.scenario.model import Scenario
from fleet2d.sight.perception import ALWAYS, Perception


def idle_behaviors(actors: Sequence[Actor], scenario: Scenario) -> Iterator[str]:
    """Yield a remark on each behavior of Fleet2D's that never gets a turn.

    Args:
        actors: The bodies.
        scenario: The scenario, whose script may switch a behavior off.
    """
    switched = _switched_by(scenario)
    for actor in actors:
        if actor.name in switched or is_own(actor):
            continue
        for number, behavior in enumerate(actor.behaviors[:-1]):
            if not behavior.leaves_turns():
                first = behavior.type_name
                later = " and ".join(each.type_name for each in actor.behaviors[number + 1 :])
                never = "gets" if number + 2 == len(actor.behaviors) else "get"
                yield (
                    f"{actor.path}: {later} never {never} a turn, as {first} before always has a"
                    f" plan: put {first} last, or give it hours (when) or a cooldown"
                )
                break


def _switched_by(scenario: Scenario) -> set[str]:
    """Return the bodies of which a script switches a behavior off."""
    if not scenario.script:
        return set()
    from fleet2d.interventions.robots import SwitchOff  # few scenarios have a script

    return {
        entry.act.entity
        for entry in scenario.script
        if isinstance(entry.act, SwitchOff) and entry.act.behavior is not None
    }


def unasked_interactions(actors: Sequence[Actor]) -> Iterator[str]:
    """Yield a remark on each robot with requests to people and no behavior that asks."""
    for actor in actors:
        if actor.requests is None or not actor.behaviors or is_own(actor):
            continue
        if not actor.may_record(EventKind.ASKS):
            names = ", ".join(actor.requests.interactions)
            yield (
                f"{actor.path}: none of its behaviors asks for what it wants by interactions,"
                f" {names}: add interact or opportunistic, or its requests only expire"
            )


def split_households(users: Sequence[Actor]) -> Iterator[str]:
    """Yield a remark on each member of a household who doesn't live in it."""
    households = {
        user.name: household
        for user in users
        for behavior in user.behaviors
        if (household := getattr(behavior, "household", None)) is not None
    }
    names = {user.name for user in users}
    told = list[object]()
    for user in users:
        household = households.get(user.name)
        if household is None or household in told:
            continue
        told.append(household)
        for member in household.members:
            where = f"{user.path}.household: {member} is a member"
            if member not in names:
                yield f"{where} and no user: add users.{member}, or leave {member} out"
            elif households.get(member) != household:
                yield (
                    f"{where}, but lives apart: give users.{member} the same household, with the"
                    " same settings"
                )


def unused_settings(actors: Sequence[Actor], home: Home, *, heights: bool) -> Iterator[str]:
    """Yield a remark on each setting of sight that has no effect in a run.

    Args:
        actors: The bodies.
        home: The home.
        heights: Whether heights matter.
    """
    x0, y0, x1, y1 = home.plan.bounds
    across_m = math.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)
    for actor in actors:
        entity = actor.entity
        eyes = entity.eyes
        common: Perception | None = getattr(entity, "perception", None)
        if common is not None and not eyes:
            yield f"{actor.path}.perception has no effect without a camera"
        if actor.rules is not None and actor.rules.minds_sleep and not eyes:
            yield f"{actor.path}.keep_out: while: asleep has no effect without a camera"
        for name, camera in eyes.items():
            where = f"{actor.path}.camera" if name == "camera" else f"{actor.path}.cameras.{name}"
            perception = camera.perception or common
            if camera.height is not None and not heights:
                yield f"{where}.height has no effect without sight.heights: true"
            if camera.range[0] > across_m:
                yield (
                    f"{where}.range begins at {camera.range[0]:g} m, and the home is"
                    f" {across_m:.1f} m across: it never sees anybody"
                )
            has_shares = perception and perception.detection.visible_share != ALWAYS
            if has_shares and not camera.body_points:
                yield f"{where}: perception.detection.visible_share needs body_points"
