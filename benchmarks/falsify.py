"""How many of five planted faults a guided search finds, and how many random search does.

python benchmarks/falsify.py [BUDGET] [SEED]
"""

import sys
from pathlib import Path
from typing import Any

from fleet2d.scenario.compose import compose
from fleet2d.studies.executors import Crew, SerialExecutor
from fleet2d.testing.search import FailureSearch, TryJob, read_space

FOLDER = Path(__file__).parent
SHARE = {"low": 0, "high": 1}
LOAD, SLOPE, LIGHT = (f"algorithms.clearance.{name}" for name in ("load", "slope", "light"))
MINUTES = {"low": 3, "high": 1439, "integer": True, "unit": "min"}
OVER: dict[str, dict[str, Any]] = {
    "hour": {"simulation.duration": MINUTES},
    "corridor": {"home": {"synthetic": 12}, LOAD: SHARE},
    "load and slope": {LOAD: SHARE, SLOPE: SHARE},
    "load and light": {LOAD: SHARE, LIGHT: SHARE},
    "three": {LOAD: SHARE, SLOPE: SHARE, LIGHT: SHARE},
}


def job(fault: str) -> TryJob:
    """The search for a fault: four minutes of a home, and what is expected of it."""
    scenario = {
        "simulation": {"start": "2026-01-05", "duration": "4 min", "step": "1 min"},
        "floorplan": "bundled",
        "algorithms": {
            "clearance": {"type": f"{FOLDER}/faults:Clearance", "fault": fault, "period": "1 min"}
        },
        "expect": {"keeps_off": EXPECTED},
    }
    return TryJob(compose(scenario), FOLDER, read_space(OVER[fault]))


EXPECTED = "at_end(output(clearance.metres) > 0)"


def found(fault: str, budget: int, seed: int, *, is_guided: bool) -> int | None:
    """Return at which try a fault is found; None within the budget."""
    search = FailureSearch(job(fault), budget, seed=seed, is_guided=is_guided)
    failure = search.run(Crew(SerialExecutor()))
    assert not search.errors, search.errors
    return None if failure is None else failure.number


def main() -> None:
    """Print a table."""
    budget, seed = (int(v) for v in (sys.argv[1:] + ["150", "0"][len(sys.argv) - 1 :])[:2])
    print(f"tries until a fault is found, of {budget} at most (- is never)\n")
    print(f"{'fault':16} {'guided':>8} {'random':>8}")
    counts = [0, 0]
    for fault in OVER:
        tries = [found(fault, budget, seed, is_guided=guided) for guided in (True, False)]
        counts = [count + (one is not None) for count, one in zip(counts, tries, strict=True)]
        print(f"{fault:16} {tries[0] or '-':>8} {tries[1] or '-':>8}", flush=True)
    print(f"{'found':16} {counts[0]:>8} {counts[1]:>8}")


if __name__ == "__main__":
    main()
