"""The simulation: steps taken a span at a time, in the order that the design fixes.

In each step: floor plan, users, robots, objects, algorithms, metrics. Between two steps at which
somebody must decide, nothing but arithmetic happens, so the engine takes the whole *span* between
them at once. What a span is never shows in a result: every draw is addressed by step, and every
plan by time.
"""

import operator
import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
from pydantic import ValidationError

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.algorithms.history import Log, Piece
from fleet2d.artifacts.manifest import Status
from fleet2d.artifacts.reader import LEARNED_NAME, Run
from fleet2d.artifacts.store import RunStore
from fleet2d.blame import blame
from fleet2d.clock import Clock
from fleet2d.engine.buckets import Eye, PoseBlock, look_together, open_eyes
from fleet2d.engine.changes import Changes
from fleet2d.engine.clearance import Clearance
from fleet2d.engine.encounters import Encounters
from fleet2d.engine.keeping import (
    deferred_interrupt,
    describe_end,
    describe_start,
    open_store,
)
from fleet2d.engine.layers import LayerBook, lay_layers
from fleet2d.engine.learners import Learners
from fleet2d.engine.pace import Pace
from fleet2d.engine.recorder import Recorder, activities_of, sensor_table, table_specs, told_cameras
from fleet2d.engine.sensors import Sensors
from fleet2d.entities.actor import Actor
from fleet2d.entities.behavior import SightEvent, Situation
from fleet2d.entities.objects.door import Door
from fleet2d.errors import InputError, PlacementError, ScenarioError
from fleet2d.floorplan.change import HomeChange, HomeChanges
from fleet2d.floorplan.home import Home
from fleet2d.kernels.headings import in_radians
from fleet2d.problems import did_you_mean
from fleet2d.scenario.model import Scenario, load_scenario


class Simulation:
    """A scenario under way: step it, run it until a time, look at it, branch it.

    Attributes:
        scenario: What is simulated.
        seed: The seed, given or drawn.
        clock: Its steps.
        home: Its home.
        step: The next step to simulate; 0 at first.

    Example:
        >>> import copy
        >>> from datetime import timedelta
        >>> simulation = Simulation("bundled:base", "simulation.duration=1 d", seed=4)
        >>> simulation.run_until(timedelta(hours=12))
        >>> futures = [copy.deepcopy(simulation).run() for _ in range(2)]
        >>> futures[0].digest == futures[1].digest
        True
    """

    def __init__(
        self,
        scenario: str | Path | Mapping[str, Any] | Scenario | None = None,
        *overrides: str,
        out: str | Path | None = None,
        **settings: Any,
    ) -> None:
        """Set everything up; with `out`, store in that directory, else in memory.

        Raises:
            InputError: The scenario, its floor plan, a place in it or the directory is wrong.
                Nothing is written then.
        """
        began = time.perf_counter()
        self.scenario = load_scenario(scenario, *overrides, **settings)
        simulation = self.scenario.simulation
        self.seed = secrets.randbelow(2**53) if simulation.seed is None else simulation.seed
        self.clock = Clock(simulation.start, simulation.step_us, simulation.steps)
        self._store = RunStore(out)
        self._store.check()
        self.home = self._furnish_home()
        self._users = self._actors("users", self.scenario.users)
        self._robots = self._actors("robots", self.scenario.robots)
        self._all = [*self._users, *self._robots]
        self._block = PoseBlock(self._all)
        sight = self.scenario.sight.method.model_copy()
        self._gazes, self._eyes = open_eyes(self._users, self._robots, self._block, sight)
        for eye in [*self._gazes, *self._eyes]:
            eye.owner.in_view = partial(_in_view, eye)
        self._check_reads()
        self._encounters = Encounters(self._users, self._robots)
        self._clearance = Clearance(self._users, self._robots)
        changes = self.scenario.changes
        self._changes = Changes(self.scenario.objects, changes, self.home, self.clock)
        with self._placing("objects"):
            doors, users = self._changes.names, len(self._users)
            self._sensors = Sensors(self.scenario.objects, doors, self.home, self.clock, users)
        self._add_tables()
        settings_ = self.scenario.artifacts
        self._recorder = Recorder(
            self._store,
            settings_,
            self.clock,
            self.home,
            self._all,
            list(self.scenario.objects),
            changes=self._may_change,
            eyes=self._eyes,
            sensors=self._sensors,
        )
        self._layers = LayerBook(self.scenario, self.home, self._all, self._store, self.clock)
        self._learners = self._start_learners()
        self._log = Log(self.home, self._all) if self._learners.all else None
        if self._log:
            self._log.activities = self._recorder.activities
            self._log.cameras = [(eye.index, name) for eye in self._eyes for name in eye.cameras]
        self._pending: dict[int, list[SightEvent]] = {}  # events that interrupted a robot's plan
        self._max_span = min(simulation.max_span or self._block.capacity, self._block.capacity)
        self._pace: Pace | None = None
        self.step = 0
        self._stopping = self._broken = False
        self._run: Run | None = None  # once it is finished
        describe_start(self._store.manifest, self.scenario, self.seed, self.clock, self.home.plan)
        open_store(self._store, self.home.plan)
        self._setup_s = time.perf_counter() - began
        self._simulate_s = self._save_s = 0.0

    # State

    @property
    def time(self) -> datetime:
        """The local time of the next step."""
        return self.clock.time(self.step)

    @property
    def done(self) -> bool:
        """Whether all steps are simulated."""
        return self.step >= self.clock.steps

    @property
    def state(self) -> dict[str, dict[str, Any]]:
        """Where everybody is at the next step: x, y [m], heading [rad], room, away.

        And of doors whether they are open and locked, of sensors whether they are on.
        """
        bodies = {actor.name: self._state_of(actor) for actor in self._all}
        doors = {
            name: {"open": i not in self.home.shut, "locked": i in self.home.locked}
            for i, name in enumerate(self._changes.names)
        }
        return bodies | doors | {name: {"on": on} for name, on in self._sensors.on.items()}

    @property
    def actors(self) -> dict[str, Actor]:
        """Everybody in the run, by name: configuration, behaviors and plan."""
        return {actor.name: actor for actor in self._all}

    @property
    def directory(self) -> Path | None:
        """Where the run is stored; None in memory."""
        return self._store.directory

    @property
    def outputs(self) -> dict[str, Any]:
        """The newest output of each algorithm, by name."""
        return dict(self._learners.outputs)

    @property
    def algorithms(self) -> dict[str, Algorithm]:
        """The algorithms in the run, by name: configuration, and what they have learned."""
        return {
            learner.name: learner.component
            for learner in self._learners.all
            if isinstance(learner.component, Algorithm)
        }

    # Running

    def advance(self, steps: int = 1) -> None:
        """Simulate so many steps, or up to the end of the run.

        Raises:
            InputError: The number is negative, or the run is finished.
            KeyboardInterrupt: Ctrl-C, after the present span; the simulation can go on.
        """
        steps = operator.index(steps)
        if steps < 0:
            raise InputError(f"advance({steps}): time only goes forward; branch a copy instead")
        self._run_to(min(self.clock.steps, self.step + steps))

    def run_until(self, when: int | datetime | timedelta) -> None:
        """Simulate up to a step, a local time or a time since the start; that step is next then.

        Raises:
            InputError: It is past, or the run is finished.
            KeyboardInterrupt: Ctrl-C, after the present span; the simulation can go on.
        """
        if isinstance(when, datetime):
            when = when - self.clock.start
        if isinstance(when, timedelta):
            when = self.clock.step_at_or_after(when // timedelta(microseconds=1))
        step = operator.index(when)
        if step < self.step:
            raise InputError(
                f"run_until(step {step}): it is step {self.step} already, {self.time}; branch a"
                " copy before that"
            )
        self._run_to(min(self.clock.steps, step))

    def replan(self, name: str) -> None:
        """Let a body's behaviors decide anew at the next step, whatever it is doing.

        For scripts that changed something that its behaviors go by. The run can't be reproduced
        from its manifest then, which says so.

        Raises:
            ScenarioError: There is nobody of that name.
        """
        actors = self.actors
        if name not in actors:
            hint = did_you_mean(name, actors)
            raise ScenarioError(
                f"there is nobody named {name!r}{hint} There are: {', '.join(actors)}"
            )
        actors[name].ask_at, actors[name].arbiter.wake_step = self.step, None
        self._steered()

    def change(self, change: HomeChange | None = None, /, **what: Any) -> None:
        """Change the home at the next step: ``simulation.change(shut="bath_door")``.

        The run can't be reproduced from its manifest then, which says so.

        Args:
            change: The change; or
            what: its keys, as in the scenario's `changes`.

        Raises:
            ScenarioError: The keys are no change.
            ComponentError: There is nothing of that name.
        """
        try:
            asked = HomeChange(**what) if change is None else change
        except ValidationError as error:
            raise ScenarioError(f"change(): {error.errors()[0]['msg']}") from None
        self._changes.ask(asked, self.step, "a script")
        self._steered()

    def run(self, on_progress: Callable[[Self], None] | None = None) -> Run:
        """Simulate to the end, store, and return the run.

        Args:
            on_progress: Called now and then with the simulation.

        Raises:
            KeyboardInterrupt: Ctrl-C; what was simulated until then is stored and readable.
        """
        try:
            self._run_to(self.clock.steps, on_progress)
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt) and not self._broken:
                self.finish("interrupted")
            else:
                self._fail(error)
            raise
        return self.finish()

    def finish(self, status: Status = "complete") -> Run:
        """Close the run at the present step and return it for reading."""
        if self._run is not None:
            return self._run
        if status == "complete" and (self._broken or not self.done):
            status = "failed" if self._broken else "interrupted"
        began = time.perf_counter()
        # Where a component failed, asking the metrics could fail again, and lose what is stored.
        results: dict[str, Any] = {}
        if self._log and status != "failed":
            self._count_looks(self._log)
            results = self._learners.finish(self.step, self._log)
        self._simulate_s += time.perf_counter() - began
        began = time.perf_counter()
        self._recorder.end(self.step)
        if status != "failed":
            self._layers.finish(self.step)
            self._keep_learned()
        self._store.close_tables()
        self._save_s += time.perf_counter() - began
        wall_s = {"setup": self._setup_s, "simulate": self._simulate_s, "save": self._save_s}
        describe_end(self._store.manifest, self.clock, self.step, results, wall_s, self._pace)
        self._store.close(status)
        self._run = self._store.run()
        self._run.plan = self.home.plan
        return self._run

    def _keep_learned(self) -> None:
        """Store what algorithms have learned; of one that can't be kept, the run says so."""
        if self._store.directory is not None and self.scenario.artifacts.learned:
            notes = self._learners.remember(self._store.directory / LEARNED_NAME)
            self._store.manifest.notes += notes

    def _steered(self) -> None:
        notes, text = self._store.manifest.notes, "steered by a script: reproduce it by that script"
        if text not in notes:
            notes.append(text)

    # The loop

    def _run_to(self, end: int, on_progress: Callable[[Self], None] | None = None) -> None:
        if self._run is not None:
            raise InputError("the run is finished: set up a new Simulation to go on")
        if self._broken:
            raise InputError("the run broke off in the middle of a span and can't go on")
        began, stored = time.perf_counter(), self._recorder.wall_s
        self._set_pace()
        with deferred_interrupt(self._stop):
            try:
                self._spans(end, on_progress)
            except BaseException:
                self._broken = True
                raise
            finally:
                stored = self._recorder.wall_s - stored
                self._simulate_s += time.perf_counter() - began - stored
                self._save_s += stored
        if self._stopping:
            self._stopping = False
            raise KeyboardInterrupt

    def _spans(self, end: int, on_progress: Callable[[Self], None] | None) -> None:
        told = time.perf_counter()
        while self.step < end and not self._stopping:
            self._span(end)
            if self._pace:
                self._pace.hold(self.step * self.clock.step_us / 1e6, lambda: self._stopping)
            if on_progress and time.perf_counter() - told > 0.1:
                on_progress(self)
                told = time.perf_counter()

    def _set_pace(self) -> None:
        speedup = self.scenario.simulation.speedup
        if speedup:
            self._pace = self._pace or Pace(speedup)
            self._pace.resume(self.step * self.clock.step_us / 1e6)

    def _span(self, limit: int) -> None:
        """Simulate one span: up to the next decision, and not beyond step `limit`."""
        first = self.step
        self._change(first)
        self._decide(first)
        count = self._span_end(limit) - first
        for row, actor in enumerate(self._all):
            if self._log:
                self._log.pieces[row].append(Piece(first, actor.state, actor.motion))
            actor.motion.trace(first, actor.state, self._block.row(row, count + 1))
            self._block.take_postures(row, first, count, actor.plan, self.clock.step_us)
        count = self._clearance.limit(self._block, first, count)
        count = self._encounters.limit(self._block, first, count)
        if self._eyes or self._gazes:
            count = look_together([*self._eyes, *self._gazes], self._block, first, count)
        observations = self._recorder.span(self._block, first, count, self._eyes, self._gazes)
        self._sense(first, count)
        self._layers.span(self._block, first, count)
        for row, actor in enumerate(self._all):
            actor.state = self._block.state(row, count)
        self._interrupt(first + count - 1)
        for row, user, event in self._encounters.take(self._block, first, count):
            self._pending.setdefault(row, []).append(event)
            user.ask_at = first + count
        self.step = first + count
        if self._log:
            if observations is not None and len(observations):
                self._log.observations.append(observations)
            if self._learners.next_due() == self.step:
                self._count_looks(self._log)
                self._learners.update(self.step, self._log)
                self._take_up_changes()
                self._log.forget(self._learners.earliest_needed())
        self._layers.keep(self.step)

    def _sense(self, first: int, count: int) -> None:
        """Let the sensors read the span."""
        if self._sensors.names:
            with blame("objects", first):
                rows = self._sensors.span(self._block, first, count, self.home, self._all)
            self._recorder.sensed(rows)
            if self._log:
                self._log.readings += rows

    def _change(self, step: int) -> None:
        """Let the home change as it is due: the floor plan comes first in a step."""
        due = self._changes.next_due()
        if due is not None and due <= step:
            with blame("changes", step):
                self._recorder.changed(self._changes.make(step, self._all))

    def _decide(self, step: int) -> None:
        """Ask everybody whose plan is over, or who would drive at somebody: users, then robots."""
        for row, actor in enumerate(self._all):
            due = actor.ask_at is not None and actor.ask_at <= step
            whom = None
            if due:
                events = tuple(self._pending.pop(row, ()))
                now = Situation(actor, step, events, self._learners.readable)
                due = not actor.goes_on(now)
            if due:
                self._end_plan(row, step)
                actor.decide(now)
            if self._clearance.robots:
                whom = self._clearance.in_way(row, step)
            if whom is not None:
                if not due:
                    self._end_plan(row, step)
                now = Situation(actor, step, (), self._learners.readable)
                actor.give_way(now, whom.name, self._clearance.people(actor))
            if due or whom is not None:
                self._changes.expect(row, actor)
                self._recorder.after_plan(row, step)

    def _end_plan(self, row: int, step: int) -> None:
        """Tell of a plan what happened up to the step at which it is replaced."""
        actor = self._all[row]
        self._recorder.before_plan(row, step)
        if self._log:
            self._log.tell(actor, step)
        self._encounters.before_plan(row, actor, step)

    def _take_up_changes(self) -> None:
        """Let what algorithms just put out to change the home happen at the next step."""
        for name, output in self._learners.fresh.items():
            if isinstance(output, HomeChanges):
                for change in output.changes:
                    self._changes.ask(change, self.step, f"algorithms.{name}")

    def _span_end(self, limit: int) -> int:
        """Return the step before which the present span ends at the latest."""
        end = min(limit, self.step + self._max_span)
        for actor in self._all:
            if actor.ask_at is not None and actor.ask_at < end:
                end = actor.ask_at
        dues = (
            self._learners.next_due(),
            self._changes.next_due(),
            self._layers.next_due(self.step),
        )
        for due in dues:
            if due is not None:
                end = min(end, max(due, self.step + 1))
        if self._pace:
            end = min(end, self.step + max(1, int(self._pace.slice_s * 1e6 / self.clock.step_us)))
        return end

    def _count_looks(self, log: Log) -> None:
        """Keep for metrics what the cameras have counted up to the present step."""
        log.count_looks(self.step, [eye.counts for eye in self._eyes])
        self._layers.expose(self.step, log)

    def _interrupt(self, step: int) -> None:
        """End the plans of bodies that a sight of the span's last step interrupts."""
        lattice = self.home.plan.lattice
        for eye in [*self._gazes, *self._eyes]:
            eye.remember()
            stops = eye.stops
            events = eye.events
            for i in range(eye.happened):
                if events.step[i] == step and stops[events.kind[i]]:
                    who = int(events.user[i])
                    x, y = lattice.to_metres(eye.perceived[who]).tolist()
                    event = SightEvent(eye.event_names[events.kind[i]], eye.name_of(who), x, y)
                    self._pending.setdefault(eye.row, []).append(event)
                    eye.owner.ask_at = step + 1

    # Set-up and closing

    def _furnish_home(self) -> Home:
        """Return the home, with a door in every doorway that the scenario names."""
        plan = self.scenario.floorplan.plan()
        doors, taken = [], dict[int, str]()
        for name, door in self.scenario.objects.items():
            if isinstance(door, Door):
                with self._placing(f"objects.{name}"):
                    doorway = door.find(plan)
                    if doorway.index in taken:
                        raise PlacementError(
                            f"objects.{name}: {taken[doorway.index]} hangs in the doorway"
                            f" {doorway.name} already"
                        )
                taken[doorway.index] = name
                doors.append(doorway)
        home = Home(plan, doors)
        lay_layers(home, self.scenario.floorplan)
        return home

    @contextmanager
    def _placing(self, path: str) -> Iterator[None]:
        """Say where in the scenario somebody was put that can't be there."""
        try:
            yield
        except PlacementError as error:
            where = self.scenario.where(path)
            raise PlacementError(f"{where}: {error}" if where else str(error)) from error

    def _actors(self, bucket: str, entities: Mapping[str, Any]) -> list[Actor]:
        actors = []
        for name, entity in entities.items():
            path = f"{bucket}.{name}"
            with self._placing(path):
                actors.append(Actor(name, path, entity, self.home, self.clock, self.seed))
        return actors

    def _check_reads(self) -> None:
        """Refuse behaviors that go by an algorithm that there isn't."""
        known = self.scenario.algorithms
        for actor in self._all:
            for read in (read for behavior in actor.behaviors for read in behavior.reads()):
                if read not in known:
                    raise ScenarioError(
                        f"{actor.path} goes by {read!r}, which is no algorithm of the scenario"
                        f"{did_you_mean(read, known)} There are: {', '.join(known) or 'none'}"
                    )

    @property
    def _may_change(self) -> bool:
        """Whether the home may change during the run."""
        return bool(self.scenario.objects or self.scenario.changes)

    def _add_tables(self) -> None:
        users, robots = list(self.scenario.users), list(self.scenario.robots)
        rooms = [room.name for room in self.home.rooms]
        specs = table_specs(
            users,
            robots,
            rooms,
            self.scenario.artifacts,
            list(self.scenario.objects),
            changes=self._may_change,
            cameras=told_cameras(self._eyes),
            activities=activities_of(self._eyes, len(users)).are_told,
        )
        if self._sensors.names:
            specs.append(sensor_table(self._sensors))
        for spec in specs:
            self._store.add_table(spec)

    def _start_learners(self) -> Learners:
        return Learners(
            self.scenario.algorithms,
            self.scenario.metrics,
            self.home,
            self.clock,
            self.seed,
            (list(self.scenario.users), list(self.scenario.robots)),
            self._store if self.scenario.artifacts.outputs else None,
        )

    def _stop(self) -> None:
        """Let the run end after the present span, where everything stored fits together."""
        self._stopping = True

    def _fail(self, error: BaseException) -> None:
        """Leave what was stored before the failure readable; the first error is reported."""
        why = str(error) or type(error).__name__
        self._store.manifest.notes.append(f"failed at step {self.step}: {why}")
        with suppress(Exception):
            self.finish("failed")

    def _state_of(self, actor: Actor) -> dict[str, Any]:
        state = actor.state
        x, y = self.home.plan.lattice.to_metres([state.x, state.y]).tolist()
        room = None if state.away else self.home.plan.room_at(x, y)
        return {
            "x": x,
            "y": y,
            "heading": in_radians(state.heading),
            "room": room.name if room else None,
            "away": bool(state.away),
        }


def _in_view(eye: Eye) -> dict[str, tuple[float, float]]:
    """Return whom the cameras of a body have in view, and where each was perceived last [m]."""
    lattice, found = eye.owner.home.plan.lattice, {}
    for who in np.flatnonzero(eye.memory.seen).tolist():
        x, y = lattice.to_metres(eye.perceived[who]).tolist()
        found[eye.name_of(who)] = (x, y)
    return found
