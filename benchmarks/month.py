"""How long a month takes: whole processes and their phases, on one core, median of several runs.

    python benchmarks/month.py --plan PLAN.json [--runs 5] [--peers PEERS_PYTHON] [--json FILE]

Every case is a process of its own (`fleet2d run … --json`) that stores the run on disk. Bounds are
those that the project set itself. `--peers` names a Python with benchmarks/peers_requirements.txt
installed; then navground and IR-SIM run on the same walls, in the same call.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

DAY = {
    "items": [
        {"at": "06:45", "place": ["bathroom", "any"], "dwell": "25 min"},
        {"place": ["kitchen", "any"], "dwell": "35 min"},
        {"at": "08:00", "away": True},
        {"at": "17:30", "place": ["kitchen", "any"], "dwell": "50 min"},
        {"place": ["dining_room", "any"], "dwell": "40 min"},
        {"at": "19:15", "place": ["living_room", "any"]},
        {"at": "22:15", "place": ["bathroom", "any"], "dwell": "15 min"},
        {"place": ["bedroom", "any"]},
    ]
}
SCHEDULE = {"type": "schedule", "days": [DAY]}
ROUTINE = {"type": "routine", "persona": "works_outside"}
PATROL = {"behaviors": [{"type": "patrol", "dwell": "10 min"}]}
MEANDER = {"behaviors": [{"type": "meander"}]}
PHASES = ("setup", "simulate", "save")


@dataclass(frozen=True)
class Row:
    """One line of the table: seconds, as median (minimum to maximum)."""

    case: str
    median_s: float
    min_s: float
    max_s: float
    must_s: float | None = None
    aim_s: float | None = None
    peak_mb: float | None = None
    note: str = ""

    def __str__(self) -> str:
        """Write the line."""
        bounds = f"{_shown(self.must_s):>7} {_shown(self.aim_s):>7}"
        memory = f"{self.peak_mb:5.0f} MB" if self.peak_mb else " " * 8
        spread = f"({self.min_s:.3f} to {self.max_s:.3f})"
        return f"{self.case:<52}{self.median_s:9.3f} {spread:<18}{bounds} {memory}  {self.note}"


def _shown(bound: float | None) -> str:
    return "" if bound is None else f"{bound:g}"


def scenario(plan: Path, users: dict[str, Any], robot: dict[str, Any], days: int) -> dict[str, Any]:
    """Return a scenario with 1 s steps and 5 cm cells."""
    return {
        "simulation": {"start": "2026-01-05", "duration": {"days": days}, "step": "1 s", "seed": 4},
        "floorplan": {"type": "houseexpo", "path": str(plan)},
        "users": users,
        "robots": {"astro": robot},
    }


def run_once(content: dict[str, Any], environment: dict[str, str] | None = None) -> dict[str, Any]:
    """Run a scenario in a process of its own; return what it prints, and its time."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scenario.yaml"
        path.write_text(json.dumps(content))  # JSON is YAML
        command = [sys.executable, "-m", "fleet2d.cli", "run", str(path)]
        command += ["--json", "--quiet", "--out", str(Path(folder) / "run")]
        began = time.perf_counter()
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, **(environment or {})},
        )
        result: dict[str, Any] = json.loads(done.stdout)
        result["process_s"] = time.perf_counter() - began
    return result


def work_s(result: dict[str, Any]) -> float:
    """Return set-up + simulate + save [s]."""
    return sum(result["wall_s"][phase] for phase in PHASES)


def measure(
    case: str,
    content: dict[str, Any],
    runs: int,
    must: float | None = None,
    aim: float | None = None,
) -> Row:
    """Measure set-up + simulate + save of a scenario."""
    results = [run_once(content) for _ in range(runs)]
    times = [work_s(result) for result in results]
    phases = " + ".join(
        f"{phase} {statistics.median(r['wall_s'][phase] for r in results):.3f}" for phase in PHASES
    )
    row = Row(
        case, statistics.median(times), min(times), max(times), must, aim,
        max(r["peak_rss_mb"] for r in results), phases,
    )  # fmt: skip
    print(row, flush=True)
    return row


def measure_process(plan: Path, runs: int) -> Row:
    """Measure `fleet2d run` from its start to its end."""
    content = scenario(plan, {"ana": SCHEDULE}, PATROL, 30)
    times = [run_once(content)["process_s"] for _ in range(runs)]
    row = Row("fleet2d run as a process", statistics.median(times), min(times), max(times), 3, 1.2)
    print(row, flush=True)
    return row


def measure_regions(plan: Path, runs: int) -> Row:
    """Measure the visibility regions of all free cells."""
    import numpy as np

    from fleet2d.floorplan.load import load_floorplan
    from fleet2d.kernels import rasterize_cells, regions_of_cells

    home = load_floorplan(plan)
    triangles = rasterize_cells(home.mesh, home.lattice.rows, home.lattice.columns)
    cells = np.argwhere(triangles >= 0)
    regions_of_cells(home.mesh, cells, triangles)
    times = []
    for _ in range(max(5, runs)):
        began = time.perf_counter()
        regions_of_cells(home.mesh, cells, triangles)
        times.append(time.perf_counter() - began)
    case = f"visibility regions of all {len(cells)} free cells"
    row = Row(case, statistics.median(times), min(times), max(times), 0.3, 0.03)
    print(row, flush=True)
    return row


def measure_growth(plan: Path, runs: int) -> list[Row]:
    """Measure how the time grows with days and with users."""
    rows = [
        measure(f"{days} days, 1 user", scenario(plan, {"ana": SCHEDULE}, PATROL, days), runs)
        for days in (7, 30, 60, 365)
    ]
    for users in (1, 5, 50):
        people = {f"user{i}": SCHEDULE for i in range(users)}
        rows.append(measure(f"30 days, {users} users", scenario(plan, people, PATROL, 30), runs))
    return rows


def compare_peers(plan: Path, python: str) -> None:
    """Run navground and IR-SIM on the same walls, beside our own agent-steps per second."""
    result = run_once(scenario(plan, {"ana": SCHEDULE}, PATROL, 30))
    rate = 2 * result["steps"] / work_s(result)
    print(f"\nFleet2D, 1 robot that sees 1 user, all included: {rate:,.0f} agent-steps/s")
    script = Path(__file__).with_name("peers.py")
    command = [sys.executable, str(script), "--plan", str(plan), "--python", python]
    subprocess.run([*command, "--against", str(rate)], check=True)


def main() -> None:
    """Measure everything and print it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--plan", type=Path, required=True, help="HouseExpo plan 658e5214….json")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--peers", help="a Python that has navground and ir-sim")
    parser.add_argument("--json", type=Path, help="write the rows to this file, too")
    arguments = parser.parse_args()
    plan, runs = arguments.plan.absolute(), arguments.runs
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    print(f"{platform.platform()}, Python {platform.python_version()}, one core, {runs} runs each")
    print(f"{'case':<52}{'median s':>9} {'(min to max)':<18}{'must':>7} {'aim':>7}")
    run_once(scenario(plan, {"ana": SCHEDULE}, PATROL, 1))  # compile what is not yet compiled
    run_once(scenario(plan, {"ana": MEANDER}, MEANDER, 1))
    month = scenario(plan, {"ana": SCHEDULE}, PATROL, 30)
    routine = scenario(plan, {"ana": ROUTINE}, PATROL, 30)
    walks = scenario(plan, {"ana": MEANDER}, MEANDER, 30)
    crowd = scenario(plan, {f"user{i}": SCHEDULE for i in range(50)}, PATROL, 30)
    rows = [
        measure("month: 1 robot patrols, 1 user on a schedule", month, runs, 1, 0.2),
        measure("the same with a sampled routine", routine, runs),
        measure("the same with meander for both", walks, runs, 1.5, 0.4),
        measure_process(plan, runs),
        measure("50 users on schedules", crowd, runs, 20, 5),
        measure_regions(plan, runs),
        *measure_growth(plan, min(runs, 3)),
    ]
    if arguments.json:
        arguments.json.write_text(json.dumps([asdict(row) for row in rows], indent=2))
    if arguments.peers:
        compare_peers(plan, arguments.peers)


if __name__ == "__main__":
    main()
