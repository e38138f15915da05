"""Repeat a stored run and compare both, or continue an unfinished one."""

from __future__ import annotations

import filecmp
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.artifacts.manifest import (
    FILE_NAME,
    FLOORPLAN_NAME,
    LEARNED_NAME,
    SLOW,
    Manifest,
    input_record,
    learned_files,
)
from fleet2d.artifacts.store import RunStore, cannot_write
from fleet2d.artifacts.unfinished import FOLDER, UnfinishedRun, remove_leftovers
from fleet2d.artifacts.verification import verify_run
from fleet2d.configuration.trust import content_of_run, stored_code
from fleet2d.engine.checkpoint import NO_CHECKPOINT, Checkpoint, UnusableCheckpointError
from fleet2d.engine.expectations import TABLE
from fleet2d.engine.intervention_queue import is_from_outside
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import ArtifactError, InputError, RunDirectoryError
from fleet2d.expectations.expectation import Expectation
from fleet2d.expectations.verdict import Verdict
from fleet2d.runs.run import Run, open_run
from fleet2d.scenario.load import load_scenario
from fleet2d.scenario.model import Scenario
from fleet2d.storage.files import path_in, refuse_links

# A live run has a note on its messages that begins so; its repetition has none.
LIVE = "live: "
# These fields are compared otherwise, or are the same for all runs.
_COMPARED_APART = frozenset({"digest", "format", "scenario", "seal", "status", "tables", "notes"})

ONLY_DECISIONS = {  # trajectories stay: they check the repetition
    **dict.fromkeys(("key_frames", "observations", "events", "outputs", "learned"), False),
    "decisions": True,
}
# An expectation has this name while a run is judged; names in scenarios have no spaces.
JUDGED_NAME = "what is judged"


@dataclass(frozen=True)
class Reproduction:
    """The result of repeating a stored run.

    Attributes:
        stored: The digest in the manifest of the stored run.
        digest: The digest of the repeated run.
        differing: Tables, files and fields of the manifest that differ, or have been changed since
            they were stored; empty if the run was reproduced.
        causes: Possible causes of differences, in sentences.
        not_compared: Fields of the manifest that were not compared.
    """

    stored: str | None
    digest: str | None
    differing: list[str]
    causes: list[str]
    not_compared: list[str] = field(default_factory=Manifest.varying)

    @property
    def same(self) -> bool:
        """Whether everything compared is unchanged and the same in both runs."""
        return self.stored == self.digest and not self.differing


def reproduce(directory: str | Path, *, trust: bool = False) -> Reproduction:
    """Repeat a stored run from its manifest, and compare the stored results of both.

    Args:
        directory: The run directory.
        trust: Whether code and programs of the run may run.

    Raises:
        RunDirectoryError: There is no such run, it was not completed, or it has code of its own and
            isn't trusted.
    """
    old = open_run(directory, trust=trust)
    if old.status != "complete":
        raise RunDirectoryError(
            f"{directory} holds a run that is {old.status}: only a complete run can be compared"
        )
    with old.running_code():
        return _reproduce(old, Path(directory))


def _reproduce(old: Run, root: Path) -> Reproduction:
    content = old.manifest
    manifest = Manifest.read(root)
    causes = [f"{path} has changed since" for path in changed_inputs(manifest)]
    refuse_links(path_in(root, LEARNED_NAME))
    seal = verify_run(root)
    changes = seal.differing.items()
    causes += [f"{name} in {root} {change} after the run" for name, change in changes]
    causes += [f"{name} in {root} is not part of the run" for name in seal.foreign]
    with tempfile.TemporaryDirectory() as folder:
        new = _simulation(content, Path(folder) / "run").run()
        causes += _other_versions(content["versions"], new.manifest["versions"])
        differing = {_short(name) for name in seal.differing}
        differing |= set(_tables(content["tables"], new.manifest["tables"]))
        differing |= set(_fields(content, new.manifest))
        differing |= set(_files(root, Path(folder) / "run"))
    return Reproduction(old.digest, new.digest, sorted(differing), causes)


def judge(expectation: Expectation | str, run: Run | Simulation, name: str = "") -> Verdict:
    """Return the verdict on an expectation in a run.

    Args:
        expectation: The expectation.
        run: A finished run, which is repeated exactly from its manifest; or a simulation: then the
            expectation counts from the first call on, and the verdict is about the time until now.
        name: Name of the expectation, for messages.

    Raises:
        InputError: See `Simulation.expect`; or the run isn't complete, or its code isn't trusted.
        ArtifactError: The run can't be reproduced: its tables differ from the stored ones.

    Example:
        >>> import fleet2d
        >>> run = fleet2d.run(None, "simulation.duration=2 h", seed=4)
        >>> judge("always(distance(ana, astro) > 0.1)", run).holds
        True
    """
    if isinstance(run, Simulation):
        return run.judge(expectation, name)
    if run.status != "complete":
        raise RunDirectoryError(
            f"the run is {run.status}: only a complete run can be judged; the verdicts on its own"
            " expectations are in manifest['expectations']"
        )
    content = run.manifest
    with run.running_code():
        simulation = _simulation(content, None)
        label = simulation.expect(expectation, JUDGED_NAME)
        new = simulation.run()
    tables = set(_tables(content["tables"], new.manifest["tables"])) - {TABLE}
    if tables:
        raise ArtifactError(
            f"the run can't be reproduced ({', '.join(sorted(tables))} differ), so it can't be"
            " judged: `fleet2d verify --again` says what has changed"
        )
    verdict = simulation.verdicts()[label]
    return replace(verdict, name=name or verdict.expectation)


def branch(run: Run, step: int, out: Path | None = None) -> Simulation:
    """Return a simulation that has repeated a stored run up to a step, to continue it otherwise.

    Interventions from outside at that step and later are left out.

    Args:
        run: The run, complete or not.
        step: The next step to simulate.
        out: Directory to store it in; None keeps it in memory.

    Raises:
        InputError: The run has no such step, or its scenario or an input file is wrong by now.
        RunDirectoryError: An input file has changed, or code isn't trusted.
        ArtifactError: The run can't be repeated: bodies would be elsewhere at that step.

    Example:
        >>> import fleet2d
        >>> run = fleet2d.run("bundled:paper", "simulation.duration=8 h", seed=4)
        >>> future = branch(run, step=3600)
        >>> future.do({"put": "ana", "to": "kitchen"})
        >>> future.run().digest == run.digest
        False
    """
    steps = int(run.manifest["steps"])
    if not 0 <= step < steps:
        raise InputError(f"the run can't be continued from step {step}: its last is {steps - 1}")
    if run.directory is not None:
        _refuse_changed_inputs(run.directory)
    with run.running_code():
        simulation = repeat_until(run.manifest, step, out)
    interval = timedelta(microseconds=step * run.manifest["step_us"])
    for name in simulation.actors if step and "key_frames" in run.tables else ():
        path = run.path(name, interval)
        state = simulation.state[name]
        was_at = path.x[1], path.y[1]
        if not np.allclose(was_at, (state["x"], state["y"]), atol=1e-6):
            simulation.finish("failed")
            raise ArtifactError(
                f"the run can't be repeated: at step {step} {name} would be elsewhere than it was;"
                " `fleet2d verify --again` says what has changed"
            )
    return simulation


def repeat_until(content: Mapping[str, Any], step: int, out: Path | None) -> Simulation:
    """Return a simulation that has repeated the run of a manifest up to a step; see `branch`."""
    earlier = [record for record in content["interventions"] if record["step"] < step]
    simulation = _simulation({**content, "interventions": earlier}, out)
    simulation.advance(step)
    return simulation


def decisions_of(run: Run) -> Any:
    """Return the table of decisions of a run that didn't store them: the run is repeated for them.

    Raises:
        InputError: Its scenario or an input file is wrong by now.
        RunDirectoryError: An input file has changed, or code isn't trusted.
        ArtifactError: The run can't be repeated: its poses would differ.
    """
    if run.directory is not None:
        _refuse_changed_inputs(run.directory)
    with run.running_code():
        simulation = _simulation(run.manifest, None, ONLY_DECISIONS)
    simulation.advance(int(run.manifest["steps"]))
    new = simulation.finish()
    old = run.manifest["tables"]
    poses = "trajectories"
    if poses in old and old[poses] != new.manifest["tables"][poses]:
        raise ArtifactError(
            "the run can't be repeated: its poses would differ; `fleet2d verify --again` says what"
            " has changed"
        )
    return new.tables["decisions"]


def _refuse_changed_inputs(directory: Path) -> None:
    if paths := changed_inputs(Manifest.read(directory)):
        raise RunDirectoryError(f"{paths[0]} has changed since the run: put it back as it was")


def _simulation(
    content: Mapping[str, Any], out: Path | None, artifacts: Mapping[str, Any] | None = None
) -> Simulation:
    # Speedup and checkpoints would only cost time.
    stored = content["scenario"]
    if not isinstance(stored.get("simulation"), dict):
        raise RunDirectoryError(f"{FILE_NAME}: scenario.simulation is missing: it can't be run")
    fast = {
        **stored,
        "simulation": {**stored["simulation"], "speedup": None},
        "artifacts": {**stored.get("artifacts", {}), **(artifacts or {})},
    }
    try:
        scenario = load_scenario(fast, "artifacts.checkpoint=off")
        simulation = Simulation(scenario, out=out, interventions=content["interventions"])
        simulation._expect_again(content["expectations"])
        return simulation
    except RecursionError as error:
        raise InputError(f"{FILE_NAME}: the scenario is nested too deeply") from error


def _short(name: str) -> str:
    """Return the short name of a table, without suffix, or of a field, without the manifest."""
    return name.removesuffix(".parquet").removeprefix(f"{FILE_NAME}: ")


def _tables(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Return the tables that differ in content, rows or columns."""
    return [name for name in old.keys() | new.keys() if old.get(name) != new.get(name)]


def _fields(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Return the fields of two manifests that differ and shouldn't."""
    fields = []
    for name in sorted(old.keys() - _COMPARED_APART - set(Manifest.varying())):
        before = old.get(name)
        after = new.get(name)
        if before == after:
            continue
        if isinstance(before, dict) and isinstance(after, dict):
            keys = sorted(before.keys() | after.keys())
            fields += [f"{name}.{key}" for key in keys if before.get(key) != after.get(key)]
        else:
            fields.append(name)
    if _repeatable(old["notes"]) != _repeatable(new["notes"]):
        fields.append("notes")
    return fields


def _repeatable(notes: list[str]) -> list[str]:
    """Return the notes that depend neither on the speed of a machine nor on live messages."""
    return [note for note in notes if not note.startswith((SLOW, LIVE, NO_CHECKPOINT))]


def _files(old: Path, new: Path) -> list[str]:
    """Return the files beside the tables whose bytes differ: the plan, and learned states."""
    differing = []
    for name in sorted({FLOORPLAN_NAME, *learned_files(old), *learned_files(new)}):
        before = path_in(old, name)
        after = new / name
        are_there = before.is_file() and after.is_file()
        if not are_there or not filecmp.cmp(before, after, shallow=False):
            differing.append(name)
    return differing


def _other_versions(old: Mapping[str, str], new: Mapping[str, str]) -> list[str]:
    return [
        f"it was run with {name} {old.get(name, 'unknown')}, and this is {new[name]}"
        for name in sorted(new)
        if old.get(name) != new[name]
    ]


def resume(directory: str | Path, *, trust: bool = False) -> Run:
    """Continue an unfinished run to its end; its digest is that of an uninterrupted run.

    The run continues from its last checkpoint if this user wrote it, else from its first step.

    Args:
        directory: The run directory.
        trust: Whether its own code and programs may run, if it has some.

    Raises:
        RunDirectoryError: There is no run, it is complete, another process writes it, an input
            file has changed, or it has code of its own and isn't trusted.
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
    return reopen(directory, trust=trust)[0].run()


def reopen(directory: str | Path, *, trust: bool = False) -> tuple[Simulation, str]:
    """Return an unfinished run at its last checkpoint or its first step, and a remark about it.

    Raises:
        RunDirectoryError: See `resume`.
        ArtifactError: See `resume`.
    """
    root = Path(directory)
    Manifest.read(root)  # a damaged run must stay as it is
    unfinished = UnfinishedRun(root)
    try:
        refuse_links(root, (FOLDER, LEARNED_NAME))
        unfinished.lock()
    except OSError as error:
        raise cannot_write(root, error) from error
    try:
        return _reopen(root, unfinished, trust=trust)
    except BaseException:
        unfinished.release()
        raise


def _reopen(root: Path, unfinished: UnfinishedRun, *, trust: bool) -> tuple[Simulation, str]:
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
    with stored_code(root, content_of_run(manifest.content()), trust=trust):
        scenario = load_scenario(manifest.scenario)
        try:
            checkpoint = Checkpoint.open(unfinished, manifest)
            run = reopened(scenario, RunStore(root), unfinished, checkpoint)
        except UnusableCheckpointError as error:
            remark = f"starting again from the first step: {error}"
            run = reopened(scenario, RunStore(root), unfinished, None)
        else:
            remark = f"continuing from {run.time:%Y-%m-%d %H:%M:%S}, step {run.step}"
    catch_up(run, manifest.interventions)
    return run, remark


def reopened(
    scenario: Scenario,
    store: RunStore,
    unfinished: UnfinishedRun,
    checkpoint: Checkpoint | None,
) -> Simulation:
    """Return an unfinished run in its directory, at its checkpoint; see `fleet2d.resume`.

    Args:
        scenario: The scenario of the run.
        store: The store of its directory, not opened.
        unfinished: The journal and checkpoint of the run, locked.
        checkpoint: The checkpoint to continue from; None: start from the first step.

    Raises:
        UnusableCheckpointError: The checkpoint can't be read; nothing is written then.
        ArtifactError: The journal is damaged, or the directory can't be written.
    """
    began = time.perf_counter()
    run = Simulation.__new__(Simulation)
    run._prepare(scenario, store)
    if checkpoint is None:
        store.reopen(unfinished, None)
        run._store_plan()
        run._setup_s = time.perf_counter() - began
        return run
    state = checkpoint.read(run._constants)
    store.manifest = checkpoint.manifest
    store.manifest.resumed.append(checkpoint.commit.step)
    store.reopen(unfinished, checkpoint.commit)
    run._take(state)
    run._setup_s, run._loop.simulate_s, run._loop.save_s = checkpoint.wall_s
    assert run._keeper is not None
    run._keeper.resume(run.step)
    return run


def catch_up(simulation: Simulation, interventions: Sequence[Mapping[str, Any]]) -> None:
    """Repeat the interventions that were requested after the checkpoint of the run."""
    outside = [record for record in interventions if is_from_outside(record)]
    simulation._repeat(outside[len(simulation._state.interventions.requests) :])


def changed_inputs(manifest: Manifest) -> list[str]:
    """Return the input files of a run that have changed since.

    Raises:
        RunDirectoryError: An input file is missing, or is not a file.
    """
    changed_paths = []
    for record in manifest.inputs:
        path = Path(record.path)
        try:
            if path.exists() and not path.is_file():
                raise RunDirectoryError(
                    f"the run read {path}, which is not a file any more: restore it"
                )
            if input_record(path).sha256 != record.sha256:
                changed_paths.append(record.path)
        except (OSError, ValueError) as error:
            raise RunDirectoryError(
                f"the run read {path}, which is missing or can't be read: restore it"
            ) from error
    return changed_paths
