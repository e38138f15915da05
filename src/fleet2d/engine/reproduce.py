"""Running a stored run again, and comparing all that it stored."""

import tempfile
from collections.abc import Iterable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from fleet2d.artifacts.manifest import FILE_NAME, Manifest
from fleet2d.artifacts.seal import verify_run
from fleet2d.engine.expecting import TABLE
from fleet2d.engine.inputs import changed_inputs
from fleet2d.engine.keeping import SLOW
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import ArtifactError, InputError, RunDirectoryError
from fleet2d.expectations.expectation import Expectation
from fleet2d.expectations.verdict import Verdict
from fleet2d.runs.run import FLOORPLAN_NAME, LEARNED_NAME, Run, open_run
from fleet2d.scenario.model import load_scenario
from fleet2d.trust import Trust, refuse_untrusted, restrict

# Fields of the manifest that running again says nothing about.
NOT_COMPARED = ("inputs", "resumed", "versions", "wall_s")
# Compared by itself, or for every run the same.
_APART = frozenset({"digest", "format", "scenario", "seal", "status", "tables", "notes"})

# What an expectation is called while a run is judged by it; no name in a scenario has a space.
JUDGED = "what is judged"


@dataclass(frozen=True)
class Reproduction:
    """What running a stored run again showed.

    Attributes:
        differing: Tables, files and fields of the manifest that came out otherwise, or aren't as
            they were stored; empty if the run was reproduced.
        causes: What is different about this attempt, in plain words.
        not_compared: What running it again says nothing about.
    """

    stored: str | None
    digest: str | None
    differing: list[str]
    causes: list[str]
    not_compared: list[str] = field(default_factory=lambda: list(NOT_COMPARED))

    @property
    def same(self) -> bool:
        """Whether all that was compared is as it was stored, and came out the same."""
        return self.stored == self.digest and not self.differing


def reproduce(directory: str | Path, trust: Iterable[str | Path] = ()) -> Reproduction:
    """Run a stored run again from its manifest, and compare all that both stored.

    Args:
        directory: Of the run.
        trust: Files and folders of code that may be run, if the scenario has components of its
            own that aren't loaded yet.

    Raises:
        RunDirectoryError: There is no such run, it was not completed, or its code isn't trusted.
    """
    return reproduce_trusting(directory, Trust.of(trust))


def reproduce_trusting(directory: str | Path, trust: Trust) -> Reproduction:
    """See `reproduce`."""
    stored = open_run(directory)
    if stored.status != "complete":
        raise RunDirectoryError(
            f"{directory} holds a run that is {stored.status}: only a complete run can be compared"
        )
    root, content = Path(directory), stored.manifest
    causes = [f"{path} has changed since" for path in changed_inputs(Manifest.read(root))]
    refuse_untrusted(root, content["scenario"], trust)
    seal = verify_run(root)
    damaged = [_short(name) for name in seal.differing]
    causes += [f"{name} in {directory} {how} after the run" for name, how in seal.differing.items()]
    causes += seal.notes
    causes += [f"{name} in {directory} is no part of the run" for name in seal.foreign]
    with tempfile.TemporaryDirectory() as folder:
        with restrict(trust):
            again = _run_again(content, Path(folder) / "run")
        after = again.manifest
        causes += _other_versions(content["versions"], after["versions"])
        differing = {*damaged, *_tables(content["tables"], after["tables"])}
        differing |= set(_fields(content, after)) | set(_files(root, Path(folder) / "run"))
    return Reproduction(stored.digest, again.digest, sorted(differing), causes)


def judge_again(run: Run, expectation: Expectation | str, name: str = "") -> Verdict:
    """Judge a finished run: it is run again from its manifest, and what is expected is measured.

    Raises:
        InputError: See `Simulation.expect`; or the run isn't complete, or its code isn't trusted.
        ArtifactError: The run comes out otherwise now.
    """
    if run.status != "complete":
        raise RunDirectoryError(
            f"the run is {run.status}: only a complete run can be judged; what was expected while"
            " it went on is in manifest['expectations']"
        )
    content, trust = run.manifest, Trust.of(())
    if run.directory is not None:
        refuse_untrusted(run.directory, content["scenario"], trust)
    with restrict(trust) if run.directory is not None else nullcontext():
        simulation = _simulation(content, None)
        label = simulation.expect(expectation, JUDGED)
        again = simulation.run()
    differing = set(_tables(content["tables"], again.manifest["tables"])) - {TABLE}
    if differing:
        raise ArtifactError(
            f"the run comes out otherwise now ({', '.join(sorted(differing))}), so it can't be"
            " judged: `fleet2d reproduce` says what has changed"
        )
    verdict = simulation.verdicts()[label]
    return replace(verdict, name=name or verdict.expectation)


def _run_again(content: Mapping[str, Any], out: Path) -> Run:
    return _simulation(content, out).run()


def _simulation(content: Mapping[str, Any], out: Path | None) -> Simulation:
    # Running it at a pace of its own would only take longer; checkpoints would only cost time.
    scenario = content["scenario"]
    if not isinstance(scenario.get("simulation"), dict):
        raise RunDirectoryError(f"{FILE_NAME}: scenario.simulation is missing: it can't be run")
    changed = {**scenario, "simulation": {**scenario["simulation"], "speedup": None}}
    try:
        loaded = load_scenario(changed, "artifacts.checkpoint=off")
        simulation = Simulation(loaded, out=out, interventions=content["interventions"])
        simulation._expect_again(content["expectations"])
        return simulation
    except RecursionError as error:
        raise InputError(f"{FILE_NAME}: the scenario is nested too deeply") from error


def _short(name: str) -> str:
    """Name a table by its name, and a field of the manifest by its path."""
    return name.removesuffix(".parquet").removeprefix(f"{FILE_NAME}: ")


def _tables(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Return the tables that differ in content, rows or columns."""
    return [name for name in before.keys() | after.keys() if before.get(name) != after.get(name)]


def _fields(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Return the fields of two manifests that differ and shouldn't."""
    differing = []
    for name in sorted((before.keys() | after.keys()) - _APART - set(NOT_COMPARED)):
        old, new = before.get(name), after.get(name)
        if old == new:
            continue
        if isinstance(old, dict) and isinstance(new, dict):
            keys = sorted(old.keys() | new.keys())
            differing += [f"{name}.{key}" for key in keys if old.get(key) != new.get(key)]
        else:
            differing.append(name)
    if _lasting(before["notes"]) != _lasting(after["notes"]):
        differing.append("notes")
    return differing


def _lasting(notes: list[str]) -> list[str]:
    """Return the notes that don't depend on how fast a machine is."""
    return [note for note in notes if not note.startswith(SLOW)]


def _files(before: Path, after: Path) -> list[str]:
    """Return the files beside the tables whose bytes differ: the plan, and what was learned."""
    names = {FLOORPLAN_NAME}
    for root in (before, after):
        names |= {f"{LEARNED_NAME}/{path.name}" for path in (root / LEARNED_NAME).glob("*.npz")}
    return [name for name in sorted(names) if not _alike(before / name, after / name)]


def _alike(one: Path, other: Path) -> bool:
    if not (one.is_file() and other.is_file()):
        return False
    return one.stat().st_size == other.stat().st_size and one.read_bytes() == other.read_bytes()


def _other_versions(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    return [
        f"it was run with {name} {before.get(name, 'unknown')}, and this is {now[name]}"
        for name in sorted(now)
        if before.get(name) != now[name]
    ]
