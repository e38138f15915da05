"""The phases of a span, in the order that every step has (Fig. 5 of the paper).

In each step: floor plan, users, robots, objects, algorithms, metrics. Between two steps with
decisions the poses follow from the plans, so a run is simulated in spans from decision to decision.
Spans never change a result: draws are addressed by step, and plans by time.
"""

from collections.abc import Callable
from dataclasses import dataclass

from fleet2d.algorithms.log import Log
from fleet2d.engine.script import EngineWorld
from fleet2d.engine.state import State
from fleet2d.entities.behavior import Situation
from fleet2d.errors import InputError, blame
from fleet2d.floorplan.home.change import HomeChanges


@dataclass
class Span:
    """The steps from `first` to `end` - 1; each phase may end it earlier.

    Attributes:
        first: The step at which decisions are due.
        end: The step before which it ends at the latest.
        settles: Whether all watchers process it now, or later with other spans.
    """

    first: int
    end: int
    settles: bool = False


def intervene(state: State, span: Span) -> None:
    """Apply the interventions that are due at this step.

    One that has become impossible since it was requested is left out, with a note in the manifest.
    """
    due = state.interventions.next_due()
    if due is None or due > span.first:
        return
    world = EngineWorld(state, span.first)
    for item in state.interventions.take(span.first):
        if item.ends:
            item.act.end(world)
            continue
        try:
            item.act.check(world)
            item.act.begin(world)
        except InputError as error:
            state.interventions.leave_out(item.act)
            source = item.by or f"the intervention {item.act.type_name}"
            state.store.manifest.notes.append(f"step {span.first}: {source} was left out: {error}")
    if state.interventions.waiting:  # maybe for fewer events now
        state.wait_for(state.requested)


def change_home(state: State, span: Span) -> None:
    """Make the changes of the home that are due."""
    due = state.changes.next_due()
    if due is not None and due <= span.first:
        state.settle(span.first)
        with blame("changes", span.first):
            state.events.emit(state.changes.make(span.first, state.actors))


def decide(state: State, span: Span) -> None:
    """Let bodies decide whose plan is over, and robots that would drive at a person."""
    step, clearance, blocking = span.first, state.clearance, state.blocking
    rows = {*state.bodies.due(step), *clearance.robots, *blocking.rows}
    for row in sorted(rows):
        actor = state.actors[row]
        if clearance.looks(row, step):
            state.bodies.ask_at[row] = step
        due, in_way = bool(state.bodies.ask_at[row] <= step), None
        if due:
            situation = Situation(
                actor, step, state.take_pending(row), state.learners.readable_outputs
            )
            due = not actor.goes_on(situation)
            state.interruptions.expect(row)  # for other events, if other behaviors listen now
        if due:
            state.end_plan(row, step)
            actor.decide(situation)
            state.bodies.follow(row, actor.plan)
        if row in clearance.robots:
            in_way = clearance.in_way(state.bodies, row)
        if in_way is not None:
            if not due:
                state.end_plan(row, step)
            situation = Situation(actor, step, (), state.learners.readable_outputs)
            actor.give_way(situation, in_way.name, clearance.surroundings(actor))
            state.bodies.follow(row, actor.plan)
        begins = due or in_way is not None
        if row in blocking.rows:
            begins |= _yield_to_bodies(state, row, step, begins=begins)
        if begins:
            state.changes.expect(row, actor)
            state.begin_plan(row, step)


def _yield_to_bodies(state: State, row: int, step: int, *, begins: bool) -> bool:
    """Let a body wait for another one in its way, or go round it; return whether it does.

    Args:
        state: The state.
        row: The row of the body.
        step: The present step.
        begins: Whether it begins a new plan at this step.
    """
    actor, blocking = state.actors[row], state.blocking
    other = blocking.in_way(state.bodies, row)
    if other is None:
        return False
    situation = Situation(actor, step, (), state.learners.readable_outputs)
    plan = blocking.plan(situation, other)
    if plan is None:
        return False
    if not begins:
        state.end_plan(row, step)
    actor.follow_instead(plan, situation)
    state.bodies.follow(row, actor.plan)
    return True


def move(state: State, span: Span) -> None:
    """End the span at the next step at which a body decides or something is due."""
    end = min(span.end, state.bodies.next_decision(), state.settled + state.capacity)
    if state.max_span is not None:
        end = min(end, span.first + state.max_span)
    dues = (
        state.learners.next_due(),
        state.changes.next_due(),
        state.layers.next_due(span.first),
        state.interventions.next_due(),
    )
    for due in dues:
        if due is not None:
            end = min(end, max(due, span.first + 1))
    awaited = state.learners.awaited | state.awaited
    if awaited:
        noted = state.next_note(span.first, awaited)
        end = end if noted is None else min(end, noted + 1)
    span.end = end


def watch(state: State, span: Span) -> None:
    """Let watchers look ahead that may end the span, and interrupt plans by their events."""
    watchers = [watcher for watcher in state.watchers if watcher.waits]
    for watcher in watchers:
        state.take(watcher, span.first)
        span.end = watcher.limit(state.bodies, span.end)
    state.bodies.step = span.end
    for watcher in watchers:
        state.interrupt(watcher, state.take(watcher, span.end))


def record(state: State, span: Span) -> None:
    """Let watchers process the spans so far, if an algorithm or layer needs them at this end."""
    due = (state.learners.next_due(), state.layers.next_due(span.first))
    span.settles = (
        state.max_span is not None
        or span.end in due
        or span.end >= state.settled + state.capacity
        or bool(state.learners.awaited | state.awaited)
    )
    if span.settles:
        state.settle(span.end)


def learn(state: State, span: Span) -> None:
    """Update the algorithms and metrics that are due, and store the layers that are due."""
    if not span.settles:
        return
    if state.log is not None:
        _update(state, state.log, span.end)
    state.layers.keep(span.end)


def _update(state: State, log: Log, end: int) -> None:
    learners, awaited = state.learners, state.learners.awaited
    events = log.happened(end - 1) if awaited else []
    if learners.next_due() == end or any(event.event in awaited for event in events):
        state.count_looks()
        learners.update(end, log, events)
        if state.expectations is not None:
            state.expectations.learned(end, learners)
        for name, output in learners.fresh.items():
            if isinstance(output, HomeChanges) and name not in learners.replaced:
                for change in output.changes:
                    state.changes.ask(change, end, f"algorithms.{name}")
        state.forget(learners.earliest_needed())


Phase = Callable[[State, Span], None]

PHASES: tuple[Phase, ...] = (intervene, change_home, decide, move, watch, record, learn)
"""The phases of a span, in order."""
