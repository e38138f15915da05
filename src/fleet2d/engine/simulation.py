"""The simulation: a run that scripts and the command line step, steer, look at and branch."""

import io
import operator
import secrets
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, BinaryIO, Self

from pydantic import ValidationError

from fleet2d.algorithms.algorithm import Algorithm
from fleet2d.artifacts.manifest import Status
from fleet2d.artifacts.reader import LEARNED_NAME, Run
from fleet2d.artifacts.store import RunStore
from fleet2d.clock import Clock
from fleet2d.engine.keeping import (
    deferred_interrupt,
    describe_end,
    describe_start,
    open_store,
)
from fleet2d.engine.pace import Pace
from fleet2d.engine.phases import PHASES, Span
from fleet2d.engine.setup import set_up
from fleet2d.engine.snapshot import copy_state, open_snapshot, read_state, write_snapshot
from fleet2d.engine.state import State
from fleet2d.entities.actor import Actor
from fleet2d.errors import ArtifactError, InputError, ScenarioError
from fleet2d.floorplan.change import HomeChange
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
        self._state = set_up(self.scenario, self.clock, self.seed, self._store)
        self._pace: Pace | None = None
        self._stopping = self._broken = False
        self._run: Run | None = None  # once it is finished
        describe_start(self._store.manifest, self.scenario, self.seed, self.clock, self.home.plan)
        open_store(self._store, self.home.plan)
        self._setup_s = time.perf_counter() - began
        self._simulate_s = self._save_s = 0.0

    # Copies

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """Return a simulation that goes on by itself.

        Raises:
            ArtifactError: The run is stored in a directory, which can't be in two states.
        """
        if self.directory is not None:
            raise ArtifactError(
                f"a simulation that stores in {self.directory} can't be copied, for both would"
                " write there: branch a simulation that stores in memory"
            )
        twin = self.__class__.__new__(self.__class__)
        twin.__dict__.update(self.__dict__)
        memo[id(self)] = twin
        twin._take(copy_state(self._state, self._constants))
        return twin

    def __getstate__(self) -> dict[str, Any]:
        """Return what a file or another process needs to go on."""
        file = io.BytesIO()
        self.save(file)
        return {"saved": file.getvalue()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Go on where another process left off."""
        self.__dict__.update(self.load(io.BytesIO(state["saved"])).__dict__)

    def save(self, path: str | Path | BinaryIO) -> None:
        """Write the simulation to a file, to be gone on with by `load`.

        Raises:
            ArtifactError: The run is stored in a directory, or a component keeps what can't be
                written, such as an open file.

        Example:
            >>> import io
            >>> simulation = Simulation(None, "simulation.duration=2 h", seed=4)
            >>> simulation.advance(3600)
            >>> file = io.BytesIO()
            >>> simulation.save(file)
            >>> _ = file.seek(0)
            >>> Simulation.load(file).run().digest == simulation.run().digest
            True
        """
        if self.directory is not None:
            raise ArtifactError(
                f"the simulation stores in {self.directory}: set artifacts.checkpoint, and go on"
                " by `fleet2d resume`"
            )
        write_snapshot(path, self._state, self._constants, self._header())

    @classmethod
    def load(cls, path: str | Path | BinaryIO) -> Self:
        """Return the simulation that `save` wrote, at the step where it was.

        Raises:
            ArtifactError: The file is damaged, or of another version of Fleet2D.
        """
        header, body = open_snapshot(path)
        simulation = cls(header["scenario"], seed=header["seed"])
        simulation._take(read_state(body, simulation._constants))
        simulation._store.hash_again()
        simulation._setup_s, simulation._simulate_s, simulation._save_s = header["wall_s"]
        return simulation

    def _take(self, state: State) -> None:
        self._state, self._store = state, state.store

    def _header(self) -> dict[str, Any]:
        return {
            "scenario": self.scenario.resolved(),
            "seed": self.seed,
            "wall_s": [self._setup_s, self._simulate_s, self._save_s],
        }

    @property
    def _constants(self) -> dict[str, object]:
        """What never changes during the run, by name."""
        entities = {**self.scenario.users, **self.scenario.robots}
        constants: dict[str, object] = {f"entity {name}": e for name, e in entities.items()}
        constants |= {"clock": self.clock, "scenario": self.scenario, **self.home.constants}
        constants |= {f"sight of {c.owner.name}": c.method for c in self._state.cameras if c.method}
        if self.directory is not None:
            constants["store"] = self._store
        return constants

    # State

    @property
    def step(self) -> int:
        """The next step to simulate; 0 at first."""
        return self._state.bodies.step

    @property
    def home(self) -> Home:
        """The home, as it is at present."""
        return self._state.home

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
        bodies = {actor.name: self._state_of(actor) for actor in self._state.actors}
        doors = {
            name: {"open": i not in self.home.shut, "locked": i in self.home.locked}
            for i, name in enumerate(self._state.changes.names)
        }
        self._state.settle(self.step)
        return bodies | doors | {name: {"on": on} for name, on in self._state.sensors.on.items()}

    @property
    def actors(self) -> dict[str, Actor]:
        """Everybody in the run, by name: configuration, behaviors and plan."""
        return {actor.name: actor for actor in self._state.actors}

    @property
    def directory(self) -> Path | None:
        """Where the run is stored; None in memory."""
        return self._store.directory

    @property
    def outputs(self) -> dict[str, Any]:
        """The newest output of each algorithm, by name."""
        return dict(self._state.learners.outputs)

    @property
    def algorithms(self) -> dict[str, Algorithm]:
        """The algorithms in the run, by name: configuration, and what they have learned."""
        return {
            learner.name: learner.component
            for learner in self._state.learners.all
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
        actors[name].ask(self.step)
        actors[name].arbiter.wake_step = None
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
        self._state.changes.ask(asked, self.step, "a script")
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
        state = self._state
        if status != "failed":
            state.settle(self.step)
        if state.log and status != "failed":
            state.count_looks()
            try:
                results = state.learners.finish(self.step, state.log)
                self._store.manifest.notes += self._state.learners.unheard()
            except BaseException as error:
                self._fail(error)
                raise
        self._simulate_s += time.perf_counter() - began
        began = time.perf_counter()
        state.recorder.end(self.step, len(state.actors))
        if status != "failed":
            self._state.layers.finish(self.step)
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
            notes = self._state.learners.remember(self._store.directory / LEARNED_NAME)
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
        began, stored = time.perf_counter(), self._state.recorder.wall_s
        self._set_pace()
        with deferred_interrupt(self._stop):
            try:
                self._spans(end, on_progress)
            except BaseException:
                self._broken = True
                raise
            finally:
                stored = self._state.recorder.wall_s - stored
                self._simulate_s += time.perf_counter() - began - stored
                self._save_s += stored
        if self._stopping:
            self._stopping = False
            raise KeyboardInterrupt

    def _spans(self, end: int, on_progress: Callable[[Self], None] | None) -> None:
        told = time.perf_counter()
        while self.step < end and not self._stopping:
            span = Span(self.step, self._slice(end))
            for phase in PHASES:
                phase(self._state, span)
            if self._pace:
                self._pace.hold(self.step * self.clock.step_us / 1e6, lambda: self._stopping)
            if on_progress and time.perf_counter() - told > 0.1:
                on_progress(self)
                told = time.perf_counter()

    def _slice(self, end: int) -> int:
        """Return the step before which the next span ends at the latest, to keep the pace."""
        if self._pace:
            steps = int(self._pace.slice_s * 1e6 / self.clock.step_us)
            end = min(end, self.step + max(1, steps))
        return end

    def _set_pace(self) -> None:
        speedup = self.scenario.simulation.speedup
        if speedup:
            self._pace = self._pace or Pace(speedup)
            self._pace.resume(self.step * self.clock.step_us / 1e6)

    # Closing

    def _stop(self) -> None:
        """Let the run end after the present span, where everything stored fits together."""
        self._stopping = True

    def _fail(self, error: BaseException) -> None:
        """Leave what was stored before the failure readable; the first error is reported."""
        why = str(error) or type(error).__name__
        self._store.manifest.notes.append(f"failed at step {self.step}: {why}")
        with suppress(Exception):
            self.finish("failed")
        if self.directory is not None and self._run is not None:
            error.add_note(f"the run until then, {self.time}, is in {self.directory}")

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
