"""Keeping a run while it goes on: commits of its rows, and checkpoints of its state."""

import io
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any, BinaryIO, Self

from fleet2d.artifacts.journal import Commit
from fleet2d.artifacts.manifest import Manifest
from fleet2d.artifacts.settings import ArtifactSettings
from fleet2d.artifacts.store import RunStore
from fleet2d.clock import Clock
from fleet2d.engine.snapshot import Constants, open_snapshot, read_state, write_snapshot
from fleet2d.engine.state import State
from fleet2d.errors import ArtifactError, RunDirectoryError
from fleet2d.units import micros

DAY_US = 86_400_000_000
# Rows are committed at least this often [s of wall time], and every simulated day.
COMMIT_S = 2.0
# `auto`: a checkpoint is written after so much computing [s], or so much time [s] where a run is
# held at a pace, and so rarely that it takes a fortieth of the computing.
COMPUTING_S = 10.0
WAITING_S = 60.0
SHARE = 40


class UnusableCheckpointError(ArtifactError):
    """A checkpoint can't be gone on from: the run begins anew."""


@dataclass
class Checkpoint:
    """A checkpoint as it was read from its file, but for the state.

    Attributes:
        commit: The rows that belong to it.
        manifest: As it was then.
        wall_s: Time spent until then on setup, simulate, save [s].
        body: The state.
    """

    commit: Commit
    manifest: Manifest
    wall_s: tuple[float, float, float]
    body: BinaryIO

    @classmethod
    def open(cls, path: Path, manifest: Manifest) -> Self:
        """Open a checkpoint of the run that a manifest describes.

        Raises:
            UnusableCheckpointError: There is none, it is damaged, or of another run.
        """
        if not path.is_file():
            raise UnusableCheckpointError("there is no checkpoint yet")
        try:
            header, body = open_snapshot(path)
            commit, then = Commit(**header["commit"]), Manifest.of_content(path, header["manifest"])
            setup_s, simulate_s, save_s = map(float, header["wall_s"])
        except ArtifactError as error:
            raise UnusableCheckpointError(str(error)) from error
        except (KeyError, TypeError, ValueError, RunDirectoryError) as error:
            raise UnusableCheckpointError(f"{path} is no checkpoint of a run") from error
        if (then.scenario, then.seed) != (manifest.scenario, manifest.seed):
            raise UnusableCheckpointError(f"{path} is of another scenario or seed")
        return cls(commit, then, (setup_s, simulate_s, save_s), body)

    def read(self, constants: Constants) -> State:
        """Return the state.

        Raises:
            UnusableCheckpointError: It can't be read.
        """
        try:
            return read_state(self.body, constants)
        except ArtifactError as error:
            raise UnusableCheckpointError(str(error)) from error


class Keeper:
    """Commits the rows of a run in a directory, and keeps its state to go on from.

    Attributes:
        is_able: Whether the state can be written; False once a component's own could not.
    """

    def __init__(
        self,
        store: RunStore,
        settings: ArtifactSettings,
        clock: Clock,
        describe: Callable[[], tuple[Constants, Mapping[str, Any]]],
    ) -> None:
        """Prepare to keep a run.

        Args:
            store: Its tables.
            settings: How often a checkpoint is wanted.
            clock: Of the run.
            describe: Returns what never changes in the run, by name, and what to write before its
                state.
        """
        self._store, self._describe = store, describe
        self._day = max(1, DAY_US // clock.step_us)
        every = settings.checkpoint
        self._every = max(1, micros(every) // clock.step_us) if isinstance(every, timedelta) else 0
        self.is_able = every != "off"
        self.resume(0)

    def resume(self, step: int) -> None:
        """Count from a step on."""
        now = time.monotonic()
        self._next_day = (step // self._day + 1) * self._day
        self._next_commit = now + COMMIT_S
        self._next_checkpoint = (time.process_time() + COMPUTING_S, now + WAITING_S)
        self._next_step = (step // self._every + 1) * self._every if self._every else 0
        self._check_at = min(self._next_day, self._next_step) if self._every else self._next_day

    def after_span(self, state: State) -> None:
        """Commit, and write a checkpoint, if it is time.

        Raises:
            ArtifactError: The disk is full or failed; the run is marked as failed.
        """
        step = state.bodies.step
        if step < self._check_at and time.monotonic() < self._next_commit:
            return
        wanted = step >= self._next_step
        if not self._every:
            computing, waiting = self._next_checkpoint
            wanted = time.process_time() >= computing or time.monotonic() >= waiting
        if wanted and self.is_able:
            self.checkpoint(state)
        else:
            self.commit(state)

    def commit(self, state: State, *, sync: bool = False) -> Mapping[str, Any] | None:
        """Let everything before the present step survive the end of this process.

        Returns:
            What was committed; None for a run in memory.
        """
        step = state.bodies.step
        state.settle(step)
        state.recorder.drain()
        began = time.perf_counter()
        self._keep_interventions(state)
        commit = self._store.commit(step, sync=sync)
        state.recorder.wall_s += time.perf_counter() - began
        self._next_commit = time.monotonic() + COMMIT_S
        while self._next_day <= step:
            self._next_day += self._day
        self._check_at = min(self._next_day, self._next_step) if self._every else self._next_day
        return None if commit is None else commit._asdict()

    def checkpoint(self, state: State) -> None:
        """Write the state of the run, and the rows until then, so that it can be gone on with."""
        computed = time.process_time()
        if self._every:
            self._next_step = (state.bodies.step // self._every + 1) * self._every
        commit = self.commit(state, sync=self.is_able)
        began = time.perf_counter()
        if self.is_able:
            constants, header = self._describe()
            content = io.BytesIO()
            try:
                write_snapshot(content, state, constants, {**header, "commit": commit})
            except ArtifactError as error:
                self.is_able = False
                self._store.manifest.notes.append(
                    f"no checkpoint from step {state.bodies.step} on: {error}"
                )
            else:
                self._store.keep_checkpoint(content.getvalue())
        state.recorder.wall_s += time.perf_counter() - began
        now = time.process_time()
        self._next_checkpoint = (
            now + max(COMPUTING_S, SHARE * (now - computed)),
            time.monotonic() + WAITING_S,
        )

    def _keep_interventions(self, state: State) -> None:
        """Let the manifest name what was done to the run so far."""
        manifest = self._store.manifest
        records = state.interventions.records
        if len(records) != len(manifest.interventions):
            manifest.interventions = records
            self._store.keep("manifest.json", manifest.to_json())
