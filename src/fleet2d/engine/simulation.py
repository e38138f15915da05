"""The simulation: a run in progress, which can be stepped, changed, read and copied."""

import io
import secrets
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Self

from fleet2d.artifacts.manifest import LEARNED_NAME, Status
from fleet2d.artifacts.store import RunStore
from fleet2d.artifacts.unfinished import UnfinishedRun
from fleet2d.configuration.trust import current_trust, restrict
from fleet2d.engine.checkpoint import Checkpoint, CheckpointWriter
from fleet2d.engine.control.steering import Steering
from fleet2d.engine.interventions import is_from_outside
from fleet2d.engine.lifecycle import (
    EngineFacts,
    deferred_interrupt,
    open_store,
    store_plan,
)
from fleet2d.engine.pace import Pace
from fleet2d.engine.phases import PHASES, Span
from fleet2d.engine.script import repeat
from fleet2d.engine.setup import set_up
from fleet2d.engine.snapshot import (
    Constants,
    copy_state,
    open_snapshot,
    read_state,
    save_snapshot,
)
from fleet2d.engine.state import State
from fleet2d.errors import ArtifactError, InputError
from fleet2d.memory import rare_collections
from fleet2d.runs.run import Run, run_of
from fleet2d.runtime.clock import Clock
from fleet2d.scenario.model import Scenario, load_scenario

if TYPE_CHECKING:
    from fleet2d.expectations.expectation import Expectation
    from fleet2d.expectations.verdict import Verdict

# Fewer steps are simulated without a handler for Ctrl-C.
SHORT = 100


class Simulation(Steering):
    """A run in progress: step it, run it until a time or event, read its state, copy it.

    Attributes:
        scenario: The scenario.
        seed: The seed of the scenario, or the one that was drawn.
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
        interventions: Sequence[Mapping[str, Any]] = (),
        **settings: Any,
    ) -> None:
        """Set up the run; with `out` it is stored in that directory, else in memory.

        Args:
            scenario: A YAML file, 'bundled:NAME', a mapping or a Scenario; None: the bundled base
                scenario.
            overrides: Texts like 'simulation.duration.days=60'.
            out: Directory to store the run in; None keeps it in memory.
            interventions: Interventions from outside, as in a manifest.
            settings: Keys of `simulation` or of the scenario, such as seed=4.

        Raises:
            InputError: The scenario, its floor plan, a place in it or the directory is wrong.
                Nothing is written then.
        """
        began = time.perf_counter()
        with rare_collections():
            checked_scenario = load_scenario(scenario, *overrides, **settings)
            store = RunStore(out)
            store.check()
            self._prepare(checked_scenario, store, interventions)
        open_store(self._store, self.home)
        self._setup_s = time.perf_counter() - began

    def _prepare(
        self, scenario: Scenario, store: RunStore, interventions: Sequence[Mapping[str, Any]] = ()
    ) -> None:
        """Set up all but the directory."""
        self.scenario, simulation = scenario, scenario.simulation
        self.seed = secrets.randbelow(2**53) if simulation.seed is None else simulation.seed
        self.clock = Clock(simulation.start, simulation.step_us, simulation.steps)
        self._trust = current_trust()  # a plan may name code that is imported only when it begins
        self._store = store
        self._state = set_up(self.scenario, self.clock, self.seed, self._store)
        # The scenario's own script repeats its interventions itself.
        outside = [dict(record) for record in interventions if is_from_outside(record)]
        repeat(self._state, outside)
        self._pace: Pace | None = None
        self._is_stopping = self._has_failed = False
        self._run: Run | None = None  # set when it is finished
        self._keeper: CheckpointWriter | None = None
        if store.directory is not None:
            settings = scenario.artifacts
            self._keeper = CheckpointWriter(store, settings, self.clock, self._checkpoint_header)
        self._setup_s = self._simulate_s = self._save_s = 0.0
        store.manifest.describe_start(self._facts())
        store.manifest.interventions = outside
        self._began: float | None = None  # set while it simulates

    @classmethod
    def reopened(
        cls,
        scenario: Scenario,
        store: RunStore,
        unfinished: UnfinishedRun,
        checkpoint: Checkpoint | None,
    ) -> Self:
        """Return an unfinished run in its directory, at its checkpoint; see `fleet2d.resume`.

        Args:
            scenario: The scenario of the run.
            store: The store of its directory, not opened.
            unfinished: The journal and checkpoint of the run, locked.
            checkpoint: Where to continue; None: start from the first step.

        Raises:
            UnusableCheckpointError: The checkpoint can't be read; nothing is written then.
            ArtifactError: The journal is damaged, or the directory can't be written.
        """
        began = time.perf_counter()
        run = cls.__new__(cls)
        run._prepare(scenario, store)
        if checkpoint is None:
            store.reopen(unfinished, None)
            store_plan(store, run.home)
            run._setup_s = time.perf_counter() - began
            return run
        state = checkpoint.read(run._constants)
        store.manifest = checkpoint.manifest
        store.manifest.resumed.append(checkpoint.commit.step)
        store.reopen(unfinished, checkpoint.commit)
        run._take(state)
        run._setup_s, run._simulate_s, run._save_s = checkpoint.wall_s
        assert run._keeper is not None
        run._keeper.resume(run.step)
        return run

    def catch_up(self, interventions: Sequence[Mapping[str, Any]]) -> None:
        """Repeat the interventions that were requested after the checkpoint of the run."""
        outside = [record for record in interventions if is_from_outside(record)]
        repeat(self._state, outside[len(self._state.interventions.requests) :])

    def _keep_requests(self) -> None:
        if self._keeper is not None:
            self._keeper.update_manifest(self._state)

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        """Return an independent copy of the simulation.

        Raises:
            ArtifactError: The run is stored in a directory, which can't be in two states.
        """
        if self.directory is not None:
            raise ArtifactError(
                f"a simulation that stores in {self.directory} can't be copied, because both would"
                " write there: copy a simulation that stores in memory"
            )
        twin = self.__class__.__new__(self.__class__)
        twin.__dict__.update(self.__dict__)
        memo[id(self)] = twin
        twin._take(copy_state(self._state, self._constants))
        return twin

    def __getstate__(self) -> dict[str, Any]:
        """Return the content of a file that `load` reads."""
        file = io.BytesIO()
        self.save(file)
        return {"saved": file.getvalue()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the simulation of another process."""
        self.__dict__.update(self.load(io.BytesIO(state["saved"])).__dict__)

    def save(self, path: str | Path | BinaryIO) -> None:
        """Write the simulation to a file that `load` reads.

        Raises:
            ArtifactError: The run is stored in a directory, or a component holds something that
                can't be written, such as an open file.
            InputError: The run is finished or has failed.

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
                f"a simulation that stores in {self.directory} can't be saved as a file, too: it"
                " keeps checkpoints there if artifacts.checkpoint is set; continue it by"
                " `fleet2d resume`"
            )
        self._check_not_over()
        save_snapshot(path, self._state, self._constants, self._header())

    @classmethod
    def load(cls, path: str | Path | BinaryIO) -> Self:
        """Return the simulation that `save` wrote, at its step.

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
        running_s = 0.0 if self._began is None else time.perf_counter() - self._began
        return {
            "scenario": self.scenario.resolved(),
            "seed": self.seed,
            "wall_s": [self._setup_s, self._simulate_s + running_s, self._save_s],
        }

    def _checkpoint_header(self) -> tuple[Constants, dict[str, Any]]:
        return self._constants, {**self._header(), "manifest": self._store.manifest.content()}

    @property
    def _constants(self) -> dict[str, object]:
        """Objects that never change during the run, by name."""
        entities = {**self.scenario.users, **self.scenario.robots}
        constants: dict[str, object] = {f"entity {name}": e for name, e in entities.items()}
        constants |= {"clock": self.clock, "scenario": self.scenario, **self.home.constants}
        constants |= {f"sight of {c.owner.name}": c.method for c in self._state.cameras if c.method}
        if self.directory is not None:
            constants["store"] = self._store
        return constants

    @property
    def directory(self) -> Path | None:
        """The run directory; None: the run is in memory."""
        return self._store.directory

    def run(self, on_progress: Callable[[Self], None] | None = None) -> Run:
        """Simulate to the end, store, and return the run.

        Args:
            on_progress: Called about every 0.1 s with the simulation.

        Raises:
            KeyboardInterrupt: Ctrl-C; the run up to that step is stored and can be read.
        """
        try:
            self._run_to(self.clock.steps, on_progress)
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt) and not self._has_failed:
                self.finish("interrupted")
            else:
                self._fail(error)
            raise
        return self.finish()

    def finish(self, status: Status = "complete") -> Run:
        """Close the run at the present step and return it for reading."""
        if self._run is not None:
            return self._run
        if status == "complete" and (self._has_failed or not self.done):
            status = "failed" if self._has_failed else "interrupted"
        began = time.perf_counter()
        if status == "interrupted" and self._keeper is not None:
            self._keeper.checkpoint(self._state)
        # After a failure the metrics are not computed: they could fail, too, and lose the tables.
        results: dict[str, Any] = {}
        state = self._state
        with suppress(Exception) if status == "failed" else nullcontext():
            state.settle(self.step)
        if state.log and status != "failed":
            state.count_looks()
            try:
                results = state.learners.finish(self.step, state.log)
                self._store.manifest.notes += self._state.learners.idle_notes()
            except BaseException as error:
                self._fail(error)
                raise
        self._store_verdicts(results, status)
        self._simulate_s += time.perf_counter() - began
        began = time.perf_counter()
        state.recorder.end(self.step, len(state.actors))
        if status != "failed":
            self._state.layers.finish(self.step)
            self._store_learned()
        self._store.close_tables()
        self._save_s += time.perf_counter() - began
        self._store.manifest.describe_end(self._facts(results))
        self._store.close(status)
        self._run = run_of(self._store)
        self._run.plan = self.home.plan
        return self._run

    def _facts(self, results: Mapping[str, Any] | None = None) -> EngineFacts:
        wall_s = {"setup": self._setup_s, "simulate": self._simulate_s, "save": self._save_s}
        results = results or {}
        return EngineFacts(
            self.scenario, self.seed, self.clock, self._state, wall_s, self._pace, results
        )

    def _store_learned(self) -> None:
        """Store what algorithms have learned; failures are noted in the manifest."""
        root = self._store.root
        if root is not None and self.scenario.artifacts.learned:
            notes = self._state.learners.remember(root / LEARNED_NAME)
            self._store.manifest.notes += notes

    def _run_to(
        self, end: int, on_progress: Callable[[Self], None] | None = None, spans: int | None = None
    ) -> None:
        self._check_not_over()
        began, save_s = time.perf_counter(), self._state.recorder.wall_s
        self._began = began
        self._set_pace()
        with ExitStack() as stack:
            stack.enter_context(restrict(self._trust))
            if end - self.step >= SHORT:  # fewer end before a user could press Ctrl-C
                stack.enter_context(rare_collections())
                stack.enter_context(deferred_interrupt(self._stop))
            try:
                self._spans(end, on_progress, spans)
            except BaseException:
                self._has_failed = True
                raise
            finally:
                save_s = self._state.recorder.wall_s - save_s
                self._simulate_s += time.perf_counter() - began - save_s
                self._save_s += save_s
                self._began = None
        if self._is_stopping:
            self._is_stopping = False
            raise KeyboardInterrupt

    def _check_not_over(self) -> None:
        if self._run is not None:
            raise InputError("the run is finished: set up a new Simulation")
        if self._has_failed:
            raise InputError("the run failed in the middle of a span and can't be continued")

    def _spans(
        self, end: int, on_progress: Callable[[Self], None] | None, spans: int | None
    ) -> None:
        reported, state = time.perf_counter(), self._state
        while self.step < end and not self._is_stopping and spans != 0:
            most = self._pace.steps(self.clock.step_us) if self._pace else end
            span = Span(self.step, min(end, self.step + most))
            for phase in PHASES:
                phase(state, span)
            if self._keeper is not None:
                self._keeper.after_span(state)
            if self._pace:
                self._pace.hold(self.step * self.clock.step_us / 1e6, lambda: self._is_stopping)
            if on_progress and time.perf_counter() - reported > 0.1:
                on_progress(self)
                reported = time.perf_counter()
            spans = None if spans is None else spans - 1

    def _set_pace(self) -> None:
        speedup = self.scenario.simulation.speedup
        if speedup:
            self._pace = self._pace or Pace(speedup)
            self._pace.resume(self.step * self.clock.step_us / 1e6)

    def _stop(self) -> None:
        """End the run after the present span, so that all tables end at the same step."""
        self._is_stopping = True

    def _fail(self, error: BaseException) -> None:
        """Close the run as failed, so that it can be read up to the failure."""
        reason = str(error) or type(error).__name__
        self._store.manifest.notes.append(f"failed at step {self.step}: {reason}")
        with suppress(Exception):
            self.finish("failed")
        if self.directory is not None and self._run is not None:
            error.add_note(f"the run until then, {self.time}, is in {self.directory}")

    # Expectations

    def expect(self, expectation: "Expectation | str", name: str = "") -> str:
        """Expect something from the next step on; the verdict is in the run's manifest.

        Args:
            expectation: The expectation, or its text as in a scenario.
            name: Its name; empty: its text.

        Returns:
            The name.

        Raises:
            InputError: It names something unknown or an impossible event, or its time is beyond
                the run.

        Example:
            >>> import fleet2d
            >>> simulation = fleet2d.Simulation(None, "simulation.duration=4 h", seed=4)
            >>> simulation.expect("eventually(room(ana) == kitchen, within=2 h)", name="eats")
            'eats'
            >>> simulation.run_until("02:01")
            >>> simulation.verdicts()["eats"].decided
            True
        """
        if self._run is not None or self.done:
            raise InputError(
                "the run is finished: add expectations before its end, or call judge(…) on the run"
            )
        expectation = _parsed(expectation)
        self._state.settle(self.step)
        name = name or str(expectation)
        self._state.expect(self.scenario, name, expectation, self.step)
        return name

    def verdicts(self) -> "dict[str, Verdict]":
        """Return the present verdicts on all expectations, by name.

        A verdict that can't change any more is `decided`; a test may end then.
        """
        if self._state.expectations is None:
            return {}
        if self._run is None:
            self._state.settle(self.step)
        return self._state.expectations.verdicts(ended=self.done)

    def judge(self, expectation: "Expectation | str", name: str = "") -> "Verdict":
        """Return the verdict on an expectation from the step on at which it was first requested.

        Raises:
            InputError: See `expect`; or no step has been simulated since.
        """
        expectation = _parsed(expectation)
        name = name or str(expectation)
        expectations = self._state.expectations
        if expectations is None or name not in expectations.entries:
            self.expect(expectation, name)
        verdict = self.verdicts().get(name)
        if verdict is None:
            raise InputError(
                f"{name} was added after the last step, so there is nothing to judge: simulate at"
                " least one step, and call judge() again"
            )
        return verdict

    def _store_verdicts(self, results: Mapping[str, Any], status: Status) -> None:
        """Store the verdicts on all expectations."""
        expectations = self._state.expectations
        if expectations is not None and status != "failed":
            store = self._state.store
            ended = status == "complete"
            store.manifest.expectations = expectations.finish(results, store, ended=ended)

    def _expect_again(self, expectations: Mapping[str, Mapping[str, Any]]) -> None:
        """Add the expectations of a stored run that are not in its scenario."""
        for name, content in expectations.items():
            if name not in self.scenario.expect:
                expectation = _parsed(content["expectation"])
                self._state.expect(self.scenario, name, expectation, content["first"])


def _parsed(expectation: "Expectation | str") -> "Expectation":
    from fleet2d.expectations.parse import parse_expectation

    return parse_expectation(expectation) if isinstance(expectation, str) else expectation
