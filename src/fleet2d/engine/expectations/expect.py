"""Adds expectations to a run."""

from datetime import timedelta
from typing import Any

from fleet2d.configuration.units import MICROSECOND
from fleet2d.engine.expectations.signal_gauges import gauge_of
from fleet2d.engine.gauges.gauges import Gauge
from fleet2d.engine.gauges.run_expectations import RunExpectations
from fleet2d.engine.state import State
from fleet2d.errors import InputError
from fleet2d.expectations.expectation import Expectation
from fleet2d.expectations.scene import Scene
from fleet2d.expectations.signals import Measurement
from fleet2d.expectations.verdict import check_judged
from fleet2d.runtime.clock import Clock
from fleet2d.scenario.model import Scenario


def expect(
    state: State, scenario: Scenario, clock: Clock, name: str, expectation: Expectation, since: int
) -> None:
    """Add an expectation to a run, from a step on.

    Raises:
        ScenarioError: It names something unknown or an impossible event, or lasts too long.
        InputError: It has no time, or there is another one of that name.
    """
    check_judged(expectation)
    expectation.check(
        scene_of(state, scenario, (clock.steps - since) * clock.step_us * MICROSECOND)
    )
    if state.expectations is None:
        state.expectations = RunExpectations(clock)
        state.events.sinks.append(state.expectations)
    if name in state.expectations.entries:
        raise InputError(f"{name!r} is expected already: give this another name")

    def gauge(signal: Measurement) -> Gauge:
        return gauge_of(signal, state, clock.step_us)

    state.expectations.add(name, expectation, since, state.settled, gauge)


def scene_of(state: State, scenario: Scenario, remaining: timedelta) -> Scene:
    """Return the names of a run that expectations may use."""
    users = state.bodies.users
    behaviors = {
        actor.name: [_type_of(behavior) for behavior in actor.behaviors] or ["own"]
        for actor in state.actors
    }
    return Scene(
        users=[actor.name for actor in state.actors[:users]],
        robots=[actor.name for actor in state.actors[users:]],
        rooms=[name for room in state.home.rooms for name in (room.name, room.type)],
        things=[item.name for item in state.home.plan.objects],
        doors=state.changes.names,
        sensors=state.sensors.names,
        algorithms=list(scenario.algorithms),
        metrics=list(scenario.metrics),
        batteries=[actor.name for actor in state.actors if actor.charge is not None],
        cameras={
            c.owner.name: [other.name for other in c.others]
            for c in [*state.user_cameras, *state.cameras]
        },
        behaviors=behaviors,
        records=[kind for a in state.actors for b in a.behaviors for kind in b.records],
        remaining=remaining,
    )


def _type_of(behavior: Any) -> str:
    """Return the type of a built-in behavior, "own" of any other."""
    name = str(behavior.type_name)
    return "own" if ":" in name or "." in name else name
