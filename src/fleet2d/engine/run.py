"""Whole runs: run a scenario, and run a stored run again."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fleet2d.artifacts.manifest import file_record
from fleet2d.artifacts.reader import Run, open_run
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import RunDirectoryError
from fleet2d.scenario.model import Scenario, load_scenario


def run(
    scenario: str | Path | Mapping[str, Any] | Scenario | None = None,
    *overrides: str,
    out: str | Path | None = None,
    **settings: Any,
) -> Run:
    """Run a scenario to its end.

    Args:
        scenario: A YAML file, 'bundled:NAME', a mapping or a Scenario; None: the bundled base
            scenario.
        overrides: Texts like 'simulation.duration.days=60'.
        out: Directory to store the run in; None keeps it in memory.
        settings: Keys of `simulation` or of the scenario, such as seed=4.

    Raises:
        InputError: Something that was given is wrong; nothing is written then.
        ComponentError: A component failed; what was stored until then is readable.

    Example:
        >>> import fleet2d
        >>> run = fleet2d.run(None, "simulation.duration=2 h", seed=4)
        >>> run.manifest["steps"], run.tables["trajectories"].num_rows
        (7200, 4)
    """
    return Simulation(scenario, *overrides, out=out, **settings).run()


@dataclass(frozen=True)
class Reproduction:
    """What running a stored run again showed.

    Attributes:
        differing: Tables that came out otherwise, or aren't as they were stored; empty if the run
            was reproduced.
        causes: What is different about this attempt, in plain words.
    """

    stored: str | None
    digest: str | None
    differing: list[str]
    causes: list[str]

    @property
    def same(self) -> bool:
        """Whether every table is as it was stored, and came out the same."""
        return self.stored == self.digest and not self.differing


def reproduce(directory: str | Path) -> Reproduction:
    """Run a stored run again from its manifest, and compare the digests.

    Raises:
        RunDirectoryError: There is no such run, or it was not completed.
    """
    stored = open_run(directory)
    if stored.status != "complete":
        raise RunDirectoryError(
            f"{directory} holds a run that is {stored.status}: only a complete run can be compared"
        )
    causes = _differences(stored)
    damaged = stored.verify()
    causes += [f"{name} in {directory} was changed after the run" for name in damaged]
    content = stored.manifest["scenario"]
    # Running it at a pace of its own would only take longer.
    scenario = load_scenario({**content, "simulation": {**content["simulation"], "speedup": None}})
    with tempfile.TemporaryDirectory() as folder:
        interventions = stored.manifest["interventions"]
        again = Simulation(scenario, out=Path(folder) / "run", interventions=interventions).run()
        before, after = stored.manifest["tables"], again.manifest["tables"]
    names = sorted(before.keys() | after.keys())
    differing = [
        n
        for n in names
        if n in damaged or before.get(n, {}).get("digest") != after.get(n, {}).get("digest")
    ]
    return Reproduction(stored.digest, again.digest, differing, causes)


def _differences(stored: Run) -> list[str]:
    causes = []
    for record in stored.manifest["inputs"]:
        path = Path(record["path"])
        if not path.exists():
            raise RunDirectoryError(
                f"the run read {path}, which is gone: put it back to reproduce the run"
            )
        if file_record(path)["sha256"] != record["sha256"]:
            causes.append(f"{path} has changed since")
    return causes
