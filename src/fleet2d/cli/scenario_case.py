"""Cases of `fleet2d test`: a scenario with a seed, and its results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from fleet2d.options import file_name

if TYPE_CHECKING:
    from fleet2d.expectations.verdict import Verdict
    from fleet2d.scenario.model import Scenario


@dataclass
class ScenarioCase:
    """A scenario with a seed, and its results.

    Attributes:
        source: The file of the scenario, as on the command line.
        scenario: The scenario, with the seed.
        overrides: Changes of the scenario, as on the command line.
        verdicts: The verdicts on expectations, by name.
        error: The error that ended the run; empty if there is none.
        wall_s: The wall time of the run [s].
        files: The run directory and pictures of a failure.
    """

    source: str
    scenario: "Scenario"
    overrides: Sequence[str]
    verdicts: "Mapping[str, Verdict]" = field(default_factory=dict)
    error: str = ""
    wall_s: float = 0.0
    files: list[Path] = field(default_factory=list)

    @property
    def seed(self) -> int:
        """The seed."""
        assert self.scenario.simulation.seed is not None
        return self.scenario.simulation.seed

    @property
    def fails(self) -> bool:
        """Whether the run failed or violates an expectation."""
        return bool(self.error) or not all(v.holds for v in self.verdicts.values())

    @property
    def name(self) -> str:
        """The name of its run directory and pictures."""
        return f"{file_name(Path(self.source).stem) or 'run'}-seed-{self.seed}"

    def commands(self, verdict: "Verdict") -> str:
        """Return the commands that run it and show the worst moment of a verdict."""
        changes = " ".join(f"'{override}'" for override in self.overrides)
        run = f"fleet2d run {self.source} {changes}".rstrip()
        worst = verdict.worst
        moment = f" --at 'step {worst.worst}'" if worst is not None else ""
        return f"{run} --seed {self.seed} --out {self.name} && fleet2d show {self.name}{moment}"
