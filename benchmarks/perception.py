"""What perception that errs costs: the bundled month with each part of it on, beside the bare one.

    python benchmarks/perception.py [--runs 9] [--json FILE]

Everything runs on one core in this process, compiling left out; the cases take turns, so that all
see the same machine. Times are the processor's, of loading, set-up, simulation and storing, since
those of a clock on the wall would be of whoever else is on the machine. Bounds are those that the
project set itself: the full model must not cost more than half of the bare month, and should cost a
tenth.
"""

import argparse
import copy
import json
import os
import platform
import statistics
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import fleet2d

MUST, AIM = 0.5, 0.1
CAMERA = {"range": [0.3, 4.5], "angle_deg": 108, "detection": 1}
LOOK = {"period": "1 s", "latency": "1 s", "body_points": 8}
FULL: dict[str, Any] = {
    "detection": {
        "distance": {"midpoint": 4.5, "width": 0.5, "top": 0.95},
        "bearing": [[0, 1], [40, 1], [54, 0.6]],
        "orientation": [[0, 1], [90, 0.9], [180, 0.7]],
        "posture": {"sit": 0.9, "lie": 0.4},
        "visible_share": [[0, 0], [0.5, 0.9], [1, 1]],
        "light": [[6, 0.4], [8, 1], [20, 1], [22, 0.4]],
        "memory": "10 s",
    },
    "false_positives": {
        "per_hour": 0.2,
        "spots": [{"at": [3.0, 2.5], "per_hour": 2, "spread": "20 cm"}],
        "looks_like": {"ana": 0.5},
    },
    "identity": {"right": [[0, 0.98], [3, 0.9], [6, 0.3]], "per_track": True},
    "attributes": {
        "range_noise": "3 cm",
        "range_noise_share": "2 %",
        "bearing_noise_deg": 1,
        "heading_noise_deg": 15,
        "posture": {"sit": {"stand": 0.1}},
        "activity": {"television": {"read": 0.2}},
    },
}


@dataclass(frozen=True)
class Row:
    """One case: seconds as median (minimum to maximum), and its cost beside the bare month."""

    case: str
    median_s: float
    min_s: float
    max_s: float
    rows: int  # observations
    cost: float  # median, of the bare month's

    def __str__(self) -> str:
        """Write the line."""
        spread = f"({self.min_s:.3f} to {self.max_s:.3f})"
        return f"{self.case:<44}{self.median_s:8.3f} {spread:<18}{self.rows:8} {self.cost:+8.1%}"


def month(perception: dict[str, Any] | None, **look: Any) -> dict[str, Any]:
    """Return the bundled month with a camera and a perception."""
    robot: dict[str, Any] = {"camera": {**CAMERA, **look}}
    if perception is not None:
        robot["perception"] = copy.deepcopy(perception)
    return {"extends": "bundled:paper", "robots": {"astro": robot}}


def cases() -> dict[str, dict[str, Any]]:
    """Return what is compared; the first is the bare month, `fleet2d run` as it is."""
    parts = {f"only {key}": month({key: part}) for key, part in FULL.items()}
    return {
        "the bundled month as it is": {"extends": "bundled:paper"},
        "only heights": {"extends": "bundled:paper", "sight": {"heights": True}},
        "only period, latency and 8 body points": month(None, **LOOK),
        "the same, with heights": {**month(None, **LOOK), "sight": {"heights": True}},
        **parts,
        "only errors": month({"errors": {"outliers": {"share": "3 %"}}}),
        "full perception model on": month(FULL, **LOOK),
    }


def measure(runs: int) -> list[Row]:
    """Run all cases in turn, so many times."""
    wanted = cases()
    times: dict[str, list[float]] = {case: [] for case in wanted}
    rows: dict[str, int] = {}
    for _ in range(runs + 1):
        for case, content in wanted.items():
            began = time.process_time()
            run = fleet2d.run(content)
            times[case].append(time.process_time() - began)
            rows[case] = run.tables["observations"].num_rows
    kept = {case: taken[1:] for case, taken in times.items()}  # the first compiles
    bare = statistics.median(next(iter(kept.values())))
    return [
        Row(
            case, statistics.median(taken), min(taken), max(taken), rows[case],
            statistics.median(taken) / bare - 1,
        )
        for case, taken in kept.items()
    ]  # fmt: skip


def main() -> None:
    """Measure everything and print it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--json", type=Path, help="where to store the figures")
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    print(f"{platform.processor() or platform.machine()}, Python {platform.python_version()}")
    print(f"{'case':<44}{'median s':>8} {'(min to max)':<18}{'rows':>8} {'cost':>8}")
    rows = measure(options.runs)
    for row in rows:
        print(row)
    print(f"full model: {rows[-1].cost:+.1%}; must {MUST:+.0%}, aim {AIM:+.0%}")
    if options.json:
        options.json.write_text(json.dumps([asdict(row) for row in rows], indent=2) + "\n")


if __name__ == "__main__":
    sys.exit(main())
