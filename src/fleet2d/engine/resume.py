"""Continue a run that was interrupted, killed or failed from its last checkpoint."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from fleet2d.artifacts.manifest import FILE_NAME, LEARNED_NAME, Manifest
from fleet2d.artifacts.store import RunStore, cannot_write
from fleet2d.artifacts.unfinished import (
    FOLDER,
    JOURNAL_NAME,
    UnfinishedRun,
    last_commit,
    remove_leftovers,
)
from fleet2d.configuration.trust import Trust, refuse_untrusted, restrict
from fleet2d.engine.checkpoint import Checkpoint, UnusableCheckpointError
from fleet2d.engine.inputs import changed_inputs
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import RunDirectoryError
from fleet2d.runs.run import Run
from fleet2d.scenario.model import load_scenario
from fleet2d.storage.files import refuse_links


def resume(directory: str | Path, trust: Iterable[str | Path] = ()) -> Run:
    """Continue an unfinished run to its end; its digest is that of an uninterrupted run.

    Args:
        directory: The run directory.
        trust: Files and folders of code that may run, if the scenario has components of its own
            that aren't loaded yet.

    Raises:
        RunDirectoryError: There is no run, it is complete, another process writes it, an input
            file has changed, or code isn't trusted.
        ArtifactError: Its journal is damaged, or it can't be written.

    Example:
        >>> import fleet2d, tempfile
        >>> folder = f"{tempfile.mkdtemp()}/run"
        >>> simulation = fleet2d.Simulation(None, "simulation.duration=2 h", seed=4, out=folder)
        >>> simulation.advance(3600)
        >>> simulation.finish().status
        'interrupted'
        >>> resume(folder).digest == fleet2d.run(None, "simulation.duration=2 h", seed=4).digest
        True
    """
    return reopen(directory, Trust.of(trust))[0].run()


def reopen(directory: str | Path, trust: Trust) -> tuple[Simulation, str]:
    """Return an unfinished run at its last checkpoint or its first step, and a remark about it.

    Raises:
        RunDirectoryError: See `resume`.
        ArtifactError: See `resume`.
    """
    root = Path(directory)
    Manifest.read(root)  # before anything is written there
    unfinished = UnfinishedRun(root)
    try:
        refuse_links(root, (FOLDER, LEARNED_NAME))
        unfinished.lock()
    except OSError as error:
        raise cannot_write(root, error) from error
    try:
        return _reopen(root, unfinished, trust)
    except BaseException:
        unfinished.release()
        raise


def _reopen(root: Path, unfinished: UnfinishedRun, trust: Trust) -> tuple[Simulation, str]:
    manifest = Manifest.read(root)
    if manifest.status == "complete":
        remove_leftovers(root)
        raise RunDirectoryError(f"{root} holds a complete run: there is nothing to resume")
    if not manifest.scenario:
        raise RunDirectoryError(f"{root}/{FILE_NAME} has no scenario: run the scenario again")
    if paths := changed_inputs(manifest):
        raise RunDirectoryError(
            f"{paths[0]} has changed since the run began: put it back as it was, or run the"
            " scenario again"
        )
    refuse_untrusted(root, manifest.scenario, manifest.interventions, trust)
    with restrict(trust):
        scenario = load_scenario(manifest.scenario)
        try:
            checkpoint = _checkpoint(unfinished, manifest)
            run = Simulation.reopened(scenario, RunStore(root), unfinished, checkpoint)
        except UnusableCheckpointError as error:
            remark = f"starting again from the first step: {error}"
            run = Simulation.reopened(scenario, RunStore(root), unfinished, None)
        else:
            remark = f"continuing from {run.time:%Y-%m-%d %H:%M:%S}, step {run.step}"
    run.catch_up(manifest.interventions)
    return run, remark


def _checkpoint(unfinished: UnfinishedRun, manifest: Manifest) -> Checkpoint:
    """Return the last checkpoint, after checking that the journal has all of its rows.

    Raises:
        UnusableCheckpointError: There is none, or it can't be used.
    """
    checkpoint = Checkpoint.open(unfinished.checkpoint, manifest)
    last = last_commit(unfinished.folder / JOURNAL_NAME)
    if last is None or last.end < checkpoint.commit.end:
        raise UnusableCheckpointError("the journal is shorter than the checkpoint says")
    return checkpoint
