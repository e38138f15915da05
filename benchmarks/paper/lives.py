"""What the scripts here share: many months at once, intervals, and the home and person they use."""

import os
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

import numpy as np

Result = TypeVar("Result")

CAMERA = {"range": [0.3, 4.5], "angle_deg": 108, "detection": 0.95}
PRIVATE = ["bathroom", "bedroom"]


def month(
    robot: Mapping[str, Any],
    *,
    algorithms: Mapping[str, Any],
    metrics: Mapping[str, Any],
    seed: int = 4,
    days: int = 30,
    name: str = "astro",
) -> dict[str, Any]:
    """Return a month in the bundled home, of one person who works outside, and one robot.

    The person's life goes by `seed`; the robot's draws by its name, too.
    """
    return {
        "simulation": {"start": "2026-01-05", "duration": {"days": days}, "seed": seed},
        "floorplan": {"type": "bundled"},
        "users": {"ana": {"type": "routine", "persona": "works_outside"}},
        "robots": {name: {"camera": CAMERA, **robot}},
        "algorithms": dict(algorithms),
        "metrics": dict(metrics),
        "artifacts": {
            "trajectories": "off", "key_frames": False, "observations": False, "events": False,
        },
    }  # fmt: skip


def run_all(
    collect: Callable[[Mapping[str, Any]], Result], scenarios: Iterable[Mapping[str, Any]]
) -> list[Result]:
    """Run `collect` on each scenario, on all cores; with a progress bar."""
    from rich.progress import track

    contents = list(scenarios)
    workers = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    with ProcessPoolExecutor(workers) as pool:
        found = pool.map(collect, contents)
        return list(track(found, f"{len(contents)} months", len(contents), transient=True))


def interval(values: Iterable[float], resamples: int = 2000) -> tuple[float, float, float]:
    """Return the mean, and the ends of its 95 % bootstrap interval."""
    given = np.array(list(values))
    draws = np.random.default_rng(0).choice(given, (resamples, len(given))).mean(axis=1)
    low, high = np.quantile(draws, [0.025, 0.975])
    return float(given.mean()), float(low), float(high)
