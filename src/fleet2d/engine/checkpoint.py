"""Commits of the rows of a run, and checkpoints of its state, while it is running."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import timedelta
from functools import partial
from typing import Any, BinaryIO, Self

from fleet2d.artifacts.manifest import Manifest
from fleet2d.artifacts.store import ArtifactSettings, RunStore
from fleet2d.artifacts.unfinished import Commit, UnfinishedRun
from fleet2d.configuration.units import micros
from fleet2d.engine.intervention_queue import is_from_outside
from fleet2d.engine.snapshot import (
    Constants,
    UnstorableStateError,
    open_snapshot,
    read_state,
    write_snapshot,
)
from fleet2d.engine.state import State
from fleet2d.entities.body import NEVER
from fleet2d.errors import ArtifactError, errors_as, os_errors_as
from fleet2d.runtime.clock import DAY_US, Clock
from fleet2d.runtime.memory import release_memory
from fleet2d.storage import files
from fleet2d.storage.secret_files import UnusableSecretError, signature

NO_CHECKPOINT = "no checkpoint from step"
"""Beginning of the note that a run can't be continued from a later step."""

# Longest wall time between commits of rows [s]; they are also committed every simulated day.
COMMIT_S = 2.0
# With `auto`, a checkpoint is written after this much computing [s], or this much wall time [s] in
# a run that is slowed down, and so rarely that checkpoints take at most 1/40 of the computing.
COMPUTING_S = 10.0
WAITING_S = 60.0
SHARE = 40
# The purpose of the signature of a checkpoint.
PURPOSE = "checkpoint of a run"


class UnusableCheckpointError(ArtifactError):
    """A checkpoint can't be used, so the run starts again from its first step."""


@dataclass
class Checkpoint:
    """A checkpoint that was read from its file, without the state.

    Attributes:
        commit: The commit of the rows before it.
        manifest: The manifest at that time.
        wall_s: Wall time until then of setup, simulate, save [s].
        body: The file, at the beginning of the state.
    """

    commit: Commit
    manifest: Manifest
    wall_s: tuple[float, float, float]
    body: BinaryIO

    @classmethod
    def open(cls, unfinished: UnfinishedRun, manifest: Manifest) -> Self:
        """Open the checkpoint of a run if this user wrote it for this run.

        The signature covers the whole file: the state, the manifest of that time, and the digest of
        the journal up to it. The present manifest must equal that one in all that doesn't change
        while a run goes on, and the present journal must have that digest.

        Raises:
            UnusableCheckpointError: There is no checkpoint, or it is another user's, damaged, or of
                another run.
        """
        path = unfinished.checkpoint
        if not path.is_file():
            raise UnusableCheckpointError("there is no checkpoint yet")
        with errors_as(UnusableCheckpointError, of=ArtifactError):
            header, body = open_snapshot(path, PURPOSE)
        commit = Commit(**header["commit"])
        stored = Manifest.of_content(path, header["manifest"])
        if _fixed_part(stored) != _fixed_part(manifest, like=stored):
            raise UnusableCheckpointError(f"{path} was written by another run than this manifest's")
        with os_errors_as(UnusableCheckpointError, "the journal can't be read"):
            journal = unfinished.journal_digest(commit.end)
        if journal != header["journal"]:
            raise UnusableCheckpointError("the journal has changed since the checkpoint")
        setup_s, simulate_s, save_s = header["wall_s"]
        return cls(commit, stored, (setup_s, simulate_s, save_s), body)

    def read(self, constants: Constants) -> State:
        """Return the state.

        Raises:
            UnusableCheckpointError: The state can't be read.
        """
        with errors_as(UnusableCheckpointError, of=ArtifactError):
            return read_state(self.body, constants)


def _fixed_part(manifest: Manifest, like: Manifest | None = None) -> tuple[object, ...]:
    """Return the fields of the manifest that don't change while a run goes on.

    Args:
        manifest: The manifest.
        like: An earlier manifest, to whose length growing fields are cut; None: no cut.
    """
    earlier = like or manifest
    outside = [record for record in manifest.interventions if is_from_outside(record)]
    count = sum(map(is_from_outside, earlier.interventions))
    return (
        manifest.scenario,
        manifest.seed,
        (manifest.step_us, manifest.start),
        manifest.entities,
        manifest.versions,
        manifest.inputs[: len(earlier.inputs)],
        outside[:count],
    )


class CheckpointWriter:
    """Commits the rows of a run in a directory, and writes checkpoints of its state.

    Attributes:
        is_storable: Whether the state can be written; False once writing the state of a component
            has failed.
    """

    def __init__(
        self,
        store: RunStore,
        settings: ArtifactSettings,
        clock: Clock,
        describe: Callable[[], tuple[Constants, Mapping[str, Any]]],
    ) -> None:
        """Prepare the commits and checkpoints of a run.

        Args:
            store: The tables of the run.
            settings: How often checkpoints are written.
            clock: The clock of the run.
            describe: A function that returns the constants of the run by name, and the header of a
                checkpoint.
        """
        self._store = store
        self._describe = describe
        self._day = max(1, DAY_US // clock.step_us)
        every = settings.checkpoint
        self._every = max(1, micros(every) // clock.step_us) if isinstance(every, timedelta) else 0
        self.is_storable = every != "off"
        self.resume(0)

    def resume(self, step: int) -> None:
        """Count the time to the next commit and checkpoint from a step on."""
        now = time.monotonic()
        self._next_day = (step // self._day + 1) * self._day
        self._next_commit = now + COMMIT_S
        self._next_checkpoint = (time.process_time() + COMPUTING_S, now + WAITING_S)
        self._next_step = (step // self._every + 1) * self._every if self._every else NEVER

    def after_span(self, state: State) -> None:
        """Write a commit or a checkpoint if one is due.

        Raises:
            ArtifactError: The disk is full or failed; the run is marked as failed.
        """
        step = state.bodies.step
        if step < min(self._next_day, self._next_step) and time.monotonic() < self._next_commit:
            return
        is_due = step >= self._next_step
        if not self._every:
            computing_s, waiting_s = self._next_checkpoint
            is_due = time.process_time() >= computing_s or time.monotonic() >= waiting_s
        if is_due and self.is_storable:
            self.checkpoint(state)
        else:
            self.commit(state)

    def commit(self, state: State, *, sync: bool = False) -> Mapping[str, Any] | None:
        """Write all rows before the present step to the journal.

        Returns:
            The commit as a mapping; None for a run in memory.
        """
        step = state.bodies.step
        state.settle(step)
        state.recorder.drain()
        began = time.perf_counter()
        self.update_manifest(state)
        commit = self._store.commit(step, sync=sync)
        state.recorder.wall_s += time.perf_counter() - began
        self._next_commit = time.monotonic() + COMMIT_S
        self._next_day = (step // self._day + 1) * self._day
        return None if commit is None else commit._asdict()

    def checkpoint(self, state: State) -> None:
        """Write the state of the run and its rows, so that it can be resumed."""
        computed = time.process_time()
        if self._every:
            self._next_step = (state.bodies.step // self._every + 1) * self._every
        commit = self.commit(state, sync=self.is_storable)
        began = time.perf_counter()
        if self.is_storable:
            constants, header = self._describe()
            journal = self._store.journal_digest()
            header = {**header, "commit": commit, "journal": journal}
            try:
                seal = signature(PURPOSE)  # this may fail, so it comes before the file

                def write(handle: int) -> None:
                    write_snapshot(partial(files.write_all, handle), state, constants, header, seal)

                self._store.keep_checkpoint(write)
            except (UnstorableStateError, UnusableSecretError) as error:
                self.is_storable = False
                self._store.manifest.notes.append(
                    f"{NO_CHECKPOINT} {state.bodies.step} on: {error}"
                )
        if not self._every:  # with `auto`, checkpoints are rare
            release_memory()
        state.recorder.wall_s += time.perf_counter() - began
        now = time.process_time()
        computing_s = max(COMPUTING_S, SHARE * (now - computed))
        self._next_checkpoint = now + computing_s, time.monotonic() + WAITING_S

    def update_manifest(self, state: State) -> None:
        """Update the interventions and the inputs in the manifest."""
        manifest = self._store.manifest
        has_inputs = manifest.add_inputs([file for each in state.watchers for file in each.files])
        records = state.interventions.records
        if has_inputs or len(records) != len(manifest.interventions):
            manifest.interventions = records
            self._store.keep("manifest.json", manifest.to_json())
