"""The run that the tests of exporters write, and the poses in it."""

from datetime import timedelta
from functools import cache
from pathlib import Path

import numpy as np

import fleet2d
from fleet2d.live.exporters import Selection
from fleet2d.runs.run import Run

FIRST, END, EVERY = 6 * 3600, 10 * 3600, timedelta(seconds=30)
NAMES = ("ana", "ben", "astro")


@cache
def day() -> Run:
    """A day with two people, one of whom goes out, and a robot that is sometimes mistaken."""
    scenario = {
        "extends": "bundled:paper",
        "simulation": {"duration": "10 h", "seed": 4},
        "users": {"ben": {"type": "routine", "persona": "works_outside"}},
        "robots": {"astro": {"perception": {"identity": {"right": 0.8, "mistaken": 0.1}}}},
    }
    return fleet2d.run(scenario)


def part() -> Selection:
    return Selection(FIRST, END, EVERY)


def poses(name) -> list[tuple[int, float, float, float]]:
    """The step, x, y [m] and heading [rad] of a body in the part, without those away."""
    path = day().path(name, EVERY)
    at = np.flatnonzero((path.step >= FIRST) & (path.step < END) & ~path.away)
    columns = (path.step[at], path.x[at], path.y[at], path.heading[at])
    return list(zip(*(column.tolist() for column in columns), strict=True))


def rows(table) -> list[dict[str, object]]:
    """The rows of a table in the part."""
    return [row for row in day().tables[table].to_pylist() if FIRST <= row["step"] < END]


def stored(folder: Path) -> Path:
    """A run of ten minutes in a run directory."""
    fleet2d.run("bundled:paper", "simulation.duration=10 min", seed=4, out=folder / "run")
    return folder / "run"
