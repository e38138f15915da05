"""Section V.A of the paper: how long its scenarios take, beside its own figures.

    python benchmarks/paper/speed.py [--map MAP.yaml] [--runs 3]

Every case is a process of its own on one core that stores the run; set-up, simulating and saving
count. The paper's figures are as printed there, on its authors' machine: they tell the order of
magnitude, no more. It names caches of visibility that are built once per home (1 h for a HouseExpo
plan, 6 h for a real map); here nothing is built beforehand.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

PAPER_BASE = "194 s, 45 of them loading the cache: 13,000 x real time"
CASES: list[tuple[str, list[str], str]] = [
    ("base: routine, presence, hangout", [], PAPER_BASE),
    ("60 days", ["simulation.duration.days=60"], "not told"),
    (
        "without what the robot learns",
        ["algorithms={}", "robots.astro.behaviors=[{type: patrol, dwell: 10 min}]", "metrics={}"],
        "127 s of simulating",
    ),
    ("Flashlight", ["sight.method=flashlight"], "8 times slower on smooth plans"),
    ("visibility polygons", ["sight.method=visibility_polygon"], PAPER_BASE),
]
PAPER_CROWD = {50: "28 min and all memory"}


def people(count: int) -> list[str]:
    """Return what makes so many people of one."""
    user = "{type: routine, persona: works_outside}"
    return ["users={" + ", ".join(f"user_{i}: {user}" for i in range(count)) + "}"]


def measure(case: str, overrides: list[str], paper: str, runs: int) -> dict[str, Any]:
    """Run a case several times; print its line."""
    times, peak, speedup = [], 0.0, 0.0
    for _ in range(runs):
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-m", "fleet2d.cli", "run", *overrides, "--json", "--quiet"]
            done = subprocess.run(
                [*command, "--out", f"{folder}/run"], capture_output=True, text=True, check=False
            )
        if done.returncode:
            print(f"{case:<36}{'failed':>10}  {done.stderr.strip()}", flush=True)
            return {"case": case, "failed": done.stderr}
        result = json.loads(done.stdout)
        times.append(sum(result["wall_s"][phase] for phase in ("setup", "simulate", "save")))
        peak = max(peak, result["peak_rss_mb"])
        speedup = result["simulated_s"] / statistics.median(times)
    middle = statistics.median(times)
    spread = f"({min(times):.2f} to {max(times):.2f})"
    line = f"{case:<36}{middle:>8.2f} s {spread:<18}{speedup:>14,.0f} x{peak:>7.0f} MB   {paper}"
    print(line, flush=True)
    return {"case": case, "median_s": middle, "peak_mb": peak, "speedup": speedup, "paper": paper}


def main() -> None:
    """Measure all and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--map", type=Path, help="a ROS map's YAML file, for the real-world row")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--json", type=Path, help="write the rows to this file, too")
    arguments = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    print(f"{platform.platform()}, Python {platform.python_version()}, one core")
    print(f"{'30 days of':<36}{'ours':>10} {'':<18}{'':>16}{'':>10}   the paper's")
    measure("(to compile)", ["simulation.duration.days=1"], "", 1)
    rows = [measure(*case, arguments.runs) for case in CASES]
    for count in (5, 10, 50):
        paper = PAPER_CROWD.get(count, "not told")
        rows.append(measure(f"{count} users", people(count), paper, arguments.runs))
    if arguments.map:
        real = ["floorplan.type=ros", f"floorplan.path={arguments.map.absolute()}"]
        rows.append(measure("real-world map", real, "6 h for the cache", arguments.runs))
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
