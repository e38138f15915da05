"""Scripts in a run: entries of a scenario's script, or from outside, are checked and scheduled."""

from datetime import datetime

from fleet2d.configuration.units import format_duration, micros
from fleet2d.engine.control.world import EngineWorld
from fleet2d.engine.interventions import OUTSIDE, SCRIPT, PendingIntervention
from fleet2d.engine.state import State
from fleet2d.errors import ScenarioError
from fleet2d.interventions.possible_events import check_trigger
from fleet2d.interventions.script import Entry
from fleet2d.interventions.when import ClockTime
from fleet2d.runtime.clock import Clock


def schedule(state: State, entry: Entry, first: int, index: int | None = None) -> None:
    """Schedule an entry of a script at its time or event.

    Args:
        state: The run.
        entry: The entry.
        first: The present step.
        index: Its place in the scenario's script; None: it comes from outside.

    Raises:
        ScenarioError: It names something unknown, its event can never happen, or its time isn't
            within the run.
        PlacementError: There is no such place, or it can't be reached.
    """
    interventions, world = state.interventions, EngineWorld(state, first)
    entry.act.check(world)
    rank, by = (OUTSIDE, "") if index is None else (SCRIPT, f"script.{index}")
    number = interventions.next_number() if index is None else index
    if entry.on is None:
        for step in steps_of(entry, world.clock, first):
            interventions.add(entry.act, step, rank, number, by)
        return
    check_trigger(world, entry.on)
    interventions.waiting.append(
        PendingIntervention(entry.on, entry.each, micros(entry.delay), entry.act, rank, number, by)
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
