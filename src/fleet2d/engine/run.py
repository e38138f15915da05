"""Run a scenario to its end."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fleet2d.engine.simulation import Simulation
from fleet2d.memory import free_bodies
from fleet2d.runs.run import Run
from fleet2d.scenario.model import Scenario


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
        InputError: An argument or the scenario is wrong; nothing is written then.
        ComponentError: A component failed; the run up to that step can be read.

    Example:
        >>> import fleet2d
        >>> run = fleet2d.run(None, "simulation.duration=2 h", seed=4)
        >>> run.manifest["steps"], run.tables["trajectories"].num_rows
        (7200, 4)
    """
    simulation = Simulation(scenario, *overrides, out=out, **settings)
    finished = simulation.run()
    free_bodies(simulation._state.actors)
    return finished
