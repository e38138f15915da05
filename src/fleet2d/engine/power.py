"""Power of robots in a run: going off, being on again, and the times of both."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from fleet2d.configuration.problems import check_known
from fleet2d.engine.intervention_queue import InterventionQueue
from fleet2d.engine.state import State
from fleet2d.entities.decisions import DecidingActor
from fleet2d.entities.power import EMPTY, KEPT, MAP, Power, Updates, power_of
from fleet2d.entities.sensor import Sensor
from fleet2d.errors import ScenarioError, errors_as
from fleet2d.interventions.intervention import Intervention
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.determinism import stream_key
from fleet2d.runtime.events import Event, EventKind
from fleet2d.scenario.model import Scenario
from fleet2d.sight.failures import Failures

if TYPE_CHECKING:
    from fleet2d.interventions.robots import SetPower

BY_BATTERY = "its battery"
"""The origin, in the manifest, of a robot's being off and on because of its charge."""


def switch_off(state: State, actor: DecidingActor, step: int) -> None:
    """Let a robot lose its power at a step: it sees nobody and drops its requests."""
    from fleet2d.engine.conversations import Conversations  # few runs need them

    state.settle(step)
    actor.off_at = actor.state
    _set_charge_off(actor, step, is_off=True)
    events = [Event(step, actor.name, EventKind.POWER_OFF, actor.off_for or "")]
    conversations = state.find(Conversations)
    if conversations is not None:
        events += conversations.break_off(actor.row, step)
    kind = EventKind.USER_LOST
    for cameras in state.cameras:
        if cameras.row == actor.row:
            events += [Event(step, actor.name, kind, name) for name in cameras.forget()]
    state.events.emit(events)


def switch_on(state: State, actor: DecidingActor, step: int) -> bool:
    """Let a robot begin anew at a step, where it is; return whether it was carried elsewhere."""
    state.settle(step)
    _set_charge_off(actor, step, is_off=False)
    power = power_of(actor.entity)
    if all(robot.is_off for robot in state.robots if robot is not actor):
        state.learners.reboot(step, power.keeps)
    for area in state.layers.areas:
        if area.row == actor.row and not power.keeps(MAP):
            area.forget()
    state.renew_memory(actor)
    actor.reboot(step)
    return _was_carried(actor, step)


def _set_charge_off(actor: DecidingActor, step: int, *, is_off: bool) -> None:
    """Stop or restart the discharge of a robot's battery."""
    if actor.charge is not None:
        actor.charge.follow(actor.motion, step * actor.clock.step_us)
        actor.charge.is_off = is_off


def _was_carried(actor: DecidingActor, step: int) -> bool:
    """Return whether a robot was carried from where it went off; then it believes itself there."""
    before = actor.off_at
    after = actor.state
    if before == after:
        return False
    if getattr(actor.entity, "localization", None) is not None:
        from fleet2d.interventions.robots import displaced  # few robots are carried

        actor.displacements.append(displaced(step, before, after))
    return True


def follow_charge(queue: InterventionQueue, actor: DecidingActor, step: int) -> None:
    """Switch a robot off in the next step if its battery is empty, or on again if charged.

    Args:
        queue: The interventions of the run.
        actor: A robot with a battery, which decides at a step.
        step: The step.
    """
    charge = actor.charge
    assert charge is not None
    goes_off = charge.is_empty and not actor.is_off
    if not goes_off and not (actor.off_for == EMPTY and charge.level >= charge.wakes_at):
        return
    from fleet2d.interventions.robots import SetPower  # few batteries are ever empty

    act = SetPower(entity=actor.name, state=EMPTY)
    if not goes_off:
        act = SetPower(entity=actor.name, state="on", ends=EMPTY)
    queue.follow(act, step + 1, BY_BATTERY)


def schedule_failures(state: State, scenario: Scenario, clock: Clock, seed: int) -> None:
    """Schedule crashes and updates of robots, and failures of cameras and sensors.

    Raises:
        ScenarioError: A failure isn't within the run, or a robot is to keep something unknown.
    """
    for name, robot in scenario.robots.items():
        path = f"robots.{name}"
        if robot.power is not None:
            known = [*KEPT, *scenario.algorithms]
            for kept in robot.power.persists or ():
                check_known(kept, "such state", known, where=f"{path}.power.persists: ")
            for act, due in _power_acts(name, robot.power):
                _schedule(state, act, due, clock, seed, f"{path}.power.{act.state}")
        for eye, camera in robot.eyes.items():
            if camera.fails is not None:
                from fleet2d.interventions.robots import Fault  # few cameras fail

                dark = Fault(entity=name, dark=eye, duration=camera.fails.lasts)
                _schedule(state, dark, camera.fails, clock, seed, f"{path}.{eye}.fails")
    for name, item in scenario.objects.items():
        if isinstance(item, Sensor) and item.fails is not None:
            from fleet2d.interventions.home import StickSensor  # few sensors fail

            stick = StickSensor(sensor=name, says=item.fails.says, duration=item.fails.lasts)
            _schedule(state, stick, item.fails, clock, seed, f"objects.{name}.fails")


def _power_acts(name: str, power: Power) -> "Iterator[tuple[SetPower, Failures | Updates]]":
    """Yield the interventions that switch a robot off by itself, and their times."""
    from fleet2d.interventions.robots import SetPower  # few robots crash

    if power.crashes is not None:
        yield SetPower(entity=name, state="crash", duration=power.crashes.lasts), power.crashes
    if power.updates is not None:
        yield SetPower(entity=name, state="update", duration=power.updates.lasts), power.updates


def _schedule(
    state: State, act: Intervention, due: Failures | Updates, clock: Clock, seed: int, path: str
) -> None:
    """Schedule an intervention at all of its times, by the random stream of its owner."""
    owner, _, purpose = path.rpartition(".")
    with errors_as(ScenarioError, path, of=ScenarioError):
        steps = due.steps(clock, stream_key(seed, owner, purpose))
    for step in steps:
        state.interventions.follow(act, step, path)
