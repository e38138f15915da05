"""Scripts in a run: entries of a scenario's script, or from outside, are checked and scheduled."""

from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any

from fleet2d.configuration.units import format_duration, micros
from fleet2d.engine.control.world import EngineWorld
from fleet2d.engine.interventions import (
    OUTSIDE,
    SCRIPT,
    DueIntervention,
    PendingIntervention,
    read_record,
)
from fleet2d.engine.state import State
from fleet2d.errors import ScenarioError
from fleet2d.interventions.intervention import Intervention, parse_intervention
from fleet2d.interventions.possible_events import check_trigger
from fleet2d.interventions.script import WHEN, Entry, parse_entry
from fleet2d.interventions.when import ClockTime
from fleet2d.runtime.clock import Clock


def request(state: State, act: Mapping[str, Any] | Intervention, step: int) -> bool:
    """Schedule an intervention from outside, at a step or as its entry of a script says.

    Args:
        state: The run.
        act: The intervention, or a mapping as in a scenario's script.
        step: The present step.

    Returns:
        Whether it is for a later time or an event.

    Raises:
        ScenarioError: It is not valid, names something unknown, or can never happen.
        PlacementError: There is no such place, or it can't be reached.
    """
    world = EngineWorld(state, step)
    if isinstance(act, Mapping) and not WHEN.isdisjoint(act):
        entry = parse_entry(act)
        _check(entry, world)
        _schedule(state, entry, world)
        return True
    if isinstance(act, Mapping):
        act = parse_intervention(act)
    act.check(world)
    state.interventions.request(act, step)
    return False


def repeat(state: State, records: Iterable[Mapping[str, Any]]) -> None:
    """Schedule the requests of another run, by their records in its manifest."""
    for record in records:
        step, content = read_record(record)
        if WHEN.isdisjoint(content):
            state.interventions.request(parse_intervention(content), step)
        else:
            _schedule(state, parse_entry(content), EngineWorld(state, step))


def schedule_script(state: State, entry: Entry, index: int) -> None:
    """Schedule an entry of the scenario's script, before the first step.

    Args:
        state: The run.
        entry: The entry.
        index: Its place in the script.

    Raises:
        ScenarioError: It names something unknown, its event can never happen, or its time isn't
            within the run.
        PlacementError: There is no such place, or it can't be reached.
    """
    world = EngineWorld(state, 0)
    _check(entry, world)
    _schedule(state, entry, world, index)


def _check(entry: Entry, world: EngineWorld) -> None:
    entry.act.check(world)
    if entry.on is not None:
        check_trigger(world, entry.on)


def _schedule(state: State, entry: Entry, world: EngineWorld, index: int | None = None) -> None:
    """Schedule an entry at its time or event, from the step of `world` on."""
    interventions, first = state.interventions, world.step
    steps = steps_of(entry, world.clock, first) if entry.on is None else []
    rank, number, by = SCRIPT, index, f"script.{index}"
    if number is None:
        rank, number, by = OUTSIDE, len(interventions.requests), ""
        content = entry.model_dump(mode="json", exclude_defaults=True)
        interventions.requests.append({"do": content.pop("do"), "step": first, **content})
    for step in steps:
        interventions.add(DueIntervention(step, rank, number, entry.act, by))
    if entry.on is None:
        return
    delay_us = micros(entry.delay)
    interventions.waiting.append(
        PendingIntervention(entry.on, entry.each, delay_us, first, entry.act, rank, number, by)
    )
    if interventions not in state.events.sinks:
        state.events.sinks.append(interventions)
    state.wait_for(state.requested)


def steps_of(entry: Entry, clock: Clock, first: int) -> list[int]:
    """Return the steps at which an entry is applied: from `first` on, within the run.

    Raises:
        ScenarioError: There are none.
    """
    time = entry.at
    if isinstance(time, ClockTime):
        moments = [clock.elapsed(moment) for moment in time.moments(clock)]
        steps = [clock.step_at_or_after(moment) for moment in moments]
        steps = [step for step in steps if first <= step < clock.steps]
        steps, text = steps if entry.each else steps[:1], time.text
    elif isinstance(time, datetime):
        steps, text = [clock.step_at_or_after(clock.elapsed(time))], f"{time:%Y-%m-%d %H:%M:%S}"
    else:
        assert time is not None
        steps, text = [clock.step_at_or_after(micros(time))], format_duration(time)
    if not steps or not first <= steps[0] < clock.steps:
        begins, ends = clock.time(first), clock.time(clock.steps)
        raise ScenarioError(
            f"at: {text} is not within the run, which goes from {begins:%A %Y-%m-%d %H:%M:%S}"
            f" to {ends:%Y-%m-%d %H:%M:%S}"
        )
    return steps
