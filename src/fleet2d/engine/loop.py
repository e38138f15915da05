"""The loop of a run: the phases of a span, in the order that every step has (Fig. 5 of the paper).

In each step: floor plan, users, robots, objects, algorithms, metrics. Between two steps with
decisions the poses follow from the plans, so a run is simulated in spans from decision to decision.
Spans never change a result: draws are addressed by step, and plans by time.
"""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any

from fleet2d.algorithms.history import Log
from fleet2d.configuration.trust import may_run_code, running_code
from fleet2d.engine.basis import Watcher
from fleet2d.engine.state import State
from fleet2d.entities.behavior import Situation
from fleet2d.errors import InputError, blame
from fleet2d.floorplan.home import HomeChanges
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.memory import rare_collections

if TYPE_CHECKING:
    from fleet2d.engine.checkpoint import CheckpointWriter

# Fewer steps end before a user could press Ctrl-C, so they are simulated without a handler.
SHORT = 100
# Wall time between two reports of progress [s].
REPORT_S = 0.1

# The messages of Ctrl-C, and of the signal that systemd, Docker and Slurm send before they kill.
_MESSAGES = {
    signal.SIGINT: b"interrupted: storing what was simulated; Ctrl-C again stops at once\n",
    signal.SIGTERM: b"terminated: storing what was simulated\n",
}


@dataclass
class Span:
    """The steps from `first` to `end` - 1; each phase may end it earlier.

    Attributes:
        first: The step at which decisions are due.
        end: The step before which it ends at the latest.
        settles: Whether all watchers process it now instead of later with other spans.
    """

    first: int
    end: int
    settles: bool = False


def intervene(state: State, span: Span) -> None:
    """Apply the interventions that are due at this step.

    An intervention that has become impossible since its request is left out, with a note in the
    manifest.
    """
    due = state.interventions.next_due()
    if due is None or due > span.first:
        return
    from fleet2d.engine.world import EngineWorld  # few runs need it

    world = EngineWorld(state, span.first)
    for item in state.interventions.take(span.first):
        try:
            if item.ends:
                item.act.end(world)
            else:
                item.act.check(world)
                item.act.begin(world)
        except InputError as error:
            state.interventions.forget(item.act)
            source = item.by or f"the intervention {item.act.type_name}"
            what = f"the end of {source}" if item.ends else source
            state.store.manifest.notes.append(f"step {span.first}: {what} was left out: {error}")
    if state.interventions.waiting:  # fewer events may be awaited now
        state.wait_for(state.requested)


def change_home(state: State, span: Span) -> None:
    """Make the changes of the home that are due."""
    due = state.changes.next_due()
    if due is not None and due <= span.first:
        state.settle(span.first)
        with blame("changes", span.first):
            state.events.emit(state.changes.make(span.first))


def decide(state: State, span: Span) -> None:
    """Ask bodies that have no plan left, and those about to hit another one, for a decision."""
    step = span.first
    yielding = state.yielding
    rows = () if yielding is None else yielding.rows
    begun: set[int] = set()  # robots whose plans may still be replaced
    for row in _asked(state, step):
        begins = _decide(state, row, step)
        if begins and row in rows:
            begun.add(row)
        elif begins:
            _begin_plan(state, row, step)
    if yielding is not None:
        yielding.answer(step, state.learners.readable_outputs, begun, state.end_plan)
    for row in sorted(begun):
        _begin_plan(state, row, step)


def _decide(state: State, row: int, step: int) -> bool:
    """Ask a body for a decision, if it has no plan left or is about to hit another one.

    Returns:
        Whether it begins a plan.
    """
    actor = state.actors[row]
    if any(watcher.looks(row, step) for watcher in state.steering):
        state.bodies.ask_at[row] = step
    begins = bool(state.bodies.ask_at[row] <= step)
    if begins:
        situation = state.situation(row, step)
        state.pending.pop(row, None)
        begins = not actor.keeps_plan(situation)
        for watcher in state.listening:
            watcher.listen(row)  # other behaviors may listen for other events now
    if begins:
        state.end_plan(row, step)
        actor.decide(situation)
        _follow_plan(state, row)
    if actor.charge is not None:
        from fleet2d.engine.power import follow_charge  # few robots have a battery

        follow_charge(state.interventions, actor, step)
    for watcher in state.steering:
        if row in watcher.steered:
            begins |= _evade(state, watcher, row, step, begins=begins)
    return begins


def _begin_plan(state: State, row: int, step: int) -> None:
    state.changes.expect(row, state.actors[row])
    state.begin_plan(row, step)


def _asked(state: State, step: int) -> Sequence[int]:
    """Return the rows of the bodies that may begin a plan at a step, in order."""
    rows = state.bodies.due(step)
    if not state.steering:
        return rows
    steered = (watcher.steered for watcher in state.steering)
    return sorted({*rows}.union(*steered))


def _follow_plan(state: State, row: int) -> None:
    """Let a body follow its plan from the present step on."""
    actor = state.actors[row]
    plan = actor.plan
    state.bodies.follow(row, actor.motion, plan.began[1], plan.posture_times())


def _evade(state: State, watcher: Watcher, row: int, step: int, *, begins: bool) -> bool:
    """Let a body keep clear of another one in its way; return whether it does.

    Args:
        state: The state.
        watcher: The watcher that steers the body.
        row: The row of the body.
        step: The present step.
        begins: Whether it begins a new plan at this step.
    """
    now = Situation(state.actors[row], step, (), state.learners.readable_outputs)
    evade = watcher.evasion(state.bodies, now)
    if evade is None:
        return False
    if not begins:
        state.end_plan(row, step)
    evade()
    _follow_plan(state, row)
    return True


def move(state: State, span: Span) -> None:
    """End the span at the next step at which a body decides or something is due."""
    end = min(span.end, state.bodies.next_decision(), state.settled + state.capacity)
    if state.max_span is not None:
        end = min(end, span.first + state.max_span)
    dues = (
        state.layers.next_due(span.first),
        state.learners.next_due(),
        state.changes.next_due(),
        state.interventions.next_due(),
        state.changes.clock.next_change(span.first),
    )
    for due in dues:
        if due is not None:
            end = min(end, max(due, span.first + 1))
    awaited = state.learners.awaited | state.awaited
    if awaited:
        noted = state.next_note(span.first, awaited)
        emitted = state.events.next_awaited(span.first)
        for step in (noted, emitted):
            if step is not None:
                end = min(end, step + 1)
    span.end = end


def watch(state: State, span: Span) -> None:
    """Let the watchers that may end the span look ahead; interrupt plans by their events."""
    watchers = [watcher for watcher in state.watchers if watcher.waits]
    for watcher in watchers:
        state.take(watcher, span.first)
        span.end = watcher.limit(state.bodies, span.end)
    state.bodies.step = span.end
    for watcher in watchers:
        state.interrupt(watcher, state.take(watcher, span.end))


def record(state: State, span: Span) -> None:
    """Let watchers process the spans so far, if an algorithm or layer needs them at this end."""
    clock_change = state.changes.clock.next_change(span.first)
    due = (state.learners.next_due(), state.layers.next_due(span.first), clock_change)
    span.settles = (
        state.max_span is not None
        or span.end in due
        or span.end >= state.settled + state.capacity
        or bool(state.learners.awaited | state.awaited)
    )
    if span.settles:
        state.settle(span.end)
        state.events.deliver(span.end)


def learn(state: State, span: Span) -> None:
    """Update the algorithms and metrics, and store the layers, that are due."""
    if not span.settles:
        return
    if state.log is not None:
        _update(state, state.log, span.end)
    state.layers.keep(span.end)


def _update(state: State, log: Log, end: int) -> None:
    learners = state.learners
    awaited = learners.awaited
    events = log.happened(end - 1) if awaited else []
    if learners.next_due() == end or any(event.event in awaited for event in events):
        state.count_looks()
        learners.update(end, log, events)
        results = learners.results_at(end)
        for watcher in state.watchers:
            watcher.learn(learners.fresh, results)
        for name, output in learners.fresh.items():
            if isinstance(output, HomeChanges) and name not in learners.replaced:
                for change in output.changes:
                    state.changes.ask(change, end, f"algorithms.{name}")
        state.forget(min(learner.oldest for learner in learners.all))


Phase = Callable[[State, Span], None]
Progress = Callable[[], None] | None

PHASES: tuple[Phase, ...] = (intervene, change_home, decide, move, watch, record, learn)
"""The phases of a span, in order."""
AT_DECISIONS = PHASES.index(decide)


class Loop:
    """Takes a run from span to span.

    Attributes:
        pace: Slows the run down; None: it runs as fast as it can.
        has_failed: Whether a span failed in the middle, so that the run can't be continued.
        runs_code: Whether code and programs that the scenario names may run.
        simulate_s: Wall time of simulating so far [s].
        save_s: Wall time of storing so far [s].
    """

    def __init__(
        self, clock: Clock, speedup: float | None, keeper: "CheckpointWriter | None"
    ) -> None:
        self.pace = Pace(speedup) if speedup else None
        self.has_failed = self._is_stopping = False
        self.simulate_s = self.save_s = 0.0
        self._step_us = clock.step_us
        self._keeper = keeper
        self.runs_code = may_run_code()  # plans that begin may import code, too
        self._began: float | None = None  # set during `run`

    @property
    def running_s(self) -> float:
        """Wall time since `run` was called [s]; 0 if it isn't running."""
        return 0.0 if self._began is None else perf_counter() - self._began

    def run(
        self, state: State, end: int, on_progress: Progress = None, spans: int | None = None
    ) -> None:
        """Simulate up to a step, or a number of spans.

        Args:
            state: The run.
            end: The step.
            on_progress: Called about every 0.1 s.
            spans: The maximum number of spans; None: all.

        Raises:
            KeyboardInterrupt: Ctrl-C, after the present span.
        """
        self._is_stopping = False
        if self.pace is not None:
            self.pace.resume(self._simulated_s(state))
        with ExitStack() as stack:
            stack.enter_context(running_code(allowed=self.runs_code))
            if end - state.bodies.step >= SHORT:
                stack.enter_context(rare_collections())
                stack.enter_context(deferred_interrupt(self.stop))
            stack.enter_context(self._timed(state))
            self._simulate(state, end, on_progress, spans)
        if self._is_stopping:
            self._is_stopping = False
            raise KeyboardInterrupt

    def run_until_asked(self, state: State, end: int, asks: Callable[[State, int], bool]) -> bool:
        """Simulate up to a step, or until a condition holds when bodies are about to decide.

        Args:
            state: The run.
            end: The step.
            asks: Called with the state and the step, before each decision.

        Returns:
            Whether the condition holds. The present step has begun then: its interventions and
            changes of the home are made, and the next call continues with its decisions.
        """
        with self._timed(state), running_code(allowed=self.runs_code):
            while state.bodies.step < end:
                span = Span(state.bodies.step, end)
                intervene(state, span)
                change_home(state, span)
                if asks(state, span.first):
                    return True
                for phase in PHASES[AT_DECISIONS:]:
                    phase(state, span)
        return False

    @contextmanager
    def _timed(self, state: State) -> Iterator[None]:
        """Measure the time of simulating and storing, and note a failure in between."""
        stored_s = state.recorder.wall_s
        self._began = perf_counter()
        try:
            yield
        except BaseException:
            self.has_failed = True
            raise
        finally:
            stored_s = state.recorder.wall_s - stored_s
            self.simulate_s += self.running_s - stored_s
            self.save_s += stored_s
            self._began = None

    def _simulate(self, state: State, end: int, on_progress: Progress, spans: int | None) -> None:
        reported = perf_counter()
        bodies = state.bodies
        while bodies.step < end and not self._is_stopping and spans != 0:
            most = self.pace.steps(self._step_us) if self.pace else end
            span = Span(bodies.step, min(end, bodies.step + most))
            for phase in PHASES:
                phase(state, span)
            if self._keeper is not None:
                self._keeper.after_span(state)
            if self.pace is not None:
                self.pace.hold(self._simulated_s(state), lambda: self._is_stopping)
            if on_progress is not None and perf_counter() - reported > REPORT_S:
                on_progress()
                reported = perf_counter()
            spans = None if spans is None else spans - 1

    def _simulated_s(self, state: State) -> float:
        return state.bodies.step * self._step_us / 1e6

    def stop(self) -> None:
        """End the present call of `run` after its span, so that all tables end at the same step."""
        self._is_stopping = True


class Pace:
    """Slows a run down to `speedup` times real time, by sleeping when it is ahead.

    Example:
        >>> pace = Pace(speedup=1000.0)
        >>> pace.slice_s  # simulated seconds between two looks at the clock
        50.0
    """

    # Wall time between two looks at the clock: short for a viewer, long enough to cost nothing [s].
    LOOK_S = 0.05
    # The longest single sleep: Ctrl-C takes effect after it [s].
    NAP_S = 0.1

    def __init__(self, speedup: float) -> None:
        self.speedup = speedup
        self.slice_s = speedup * self.LOOK_S
        self._began = time.perf_counter()

    def steps(self, step_us: int) -> int:
        """Return the number of steps that may be simulated between two looks at the clock."""
        return max(1, int(self.slice_s * 1e6 / step_us))

    def resume(self, simulated_s: float) -> None:
        """Continue after a pause, as if no time had passed since `simulated_s`."""
        self._began = max(self._began, time.perf_counter() - simulated_s / self.speedup)

    def hold(self, simulated_s: float, stop: Callable[[], bool] = lambda: False) -> None:
        """Sleep until `simulated_s` of simulated time are due, or until `stop` returns True."""
        due = self._began + simulated_s / self.speedup
        while (ahead := due - time.perf_counter()) > 0 and not stop():
            time.sleep(min(ahead, self.NAP_S))

    def speedup_until(self, simulated_s: float) -> float:
        """Return the real speedup of the run so far."""
        return simulated_s / max(1e-9, time.perf_counter() - self._began)


@contextmanager
def deferred_interrupt(stop: Callable[[], None]) -> Iterator[None]:
    """Call `stop` on the first Ctrl-C or SIGTERM, so that no row is stored partially.

    A message on stderr confirms the signal; a second signal has its usual effect.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: signal.getsignal(number) for number in _MESSAGES}

    def restore() -> None:
        blame.interrupts = True
        for number, handler in handlers.items():
            signal.signal(number, handler)

    def on_signal(number: int, _: Any) -> None:
        stop()
        restore()
        # The signal may have interrupted a method of sys.stderr. If stderr was closed, its number
        # may be that of another file.
        if sys.__stderr__ is not None:
            with suppress(OSError):
                os.write(2, _MESSAGES[signal.Signals(number)])

    for number in _MESSAGES:
        signal.signal(number, on_signal)
    blame.interrupts = False
    try:
        yield
    finally:
        restore()
