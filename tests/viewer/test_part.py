"""A part of a run has the poses, observations and events of that part."""

from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest

import fleet2d
from fleet2d.viewer.part import part_of_run

SECOND = timedelta(seconds=1)


@pytest.mark.parametrize(
    ("first", "end"), [(0, 3600), (7000, 7001), (3601, 30_000), (20_000, 32_400)]
)
def test_poses_of_a_part_are_those_of_the_run(run_dir: Path, first: int, end: int) -> None:
    run = fleet2d.open_run(run_dir)
    part = part_of_run(run, first, end)
    for name in ("ana", "astro"):
        complete, cut = run.path(name, SECOND), part.path(name, SECOND)
        for values in ("x", "y", "heading", "away", "room", "time"):
            assert np.array_equal(getattr(complete, values)[first:end], getattr(cut, values))


def test_random_walk_can_be_cut() -> None:
    run = fleet2d.run(
        {
            "simulation": {"duration": "2 h", "start": "2026-01-05", "seed": 1},
            "floorplan": {"type": "bundled"},
            "users": {"ana": {"type": "meander"}},
        }
    )
    part = part_of_run(run, 4000, 6000)
    assert run.path("ana", SECOND).x[4000:6000].tolist() == part.path("ana", SECOND).x.tolist()


def test_rows_outside_are_left_out_and_steps_count_from_zero(run_dir: Path) -> None:
    run = fleet2d.open_run(run_dir)
    part = part_of_run(run, 3600, 7200)
    steps = run.tables["events"]["step"].to_numpy()
    inside = steps[(steps >= 3600) & (steps < 7200)] - 3600
    assert inside.tolist() == part.tables["events"]["step"].to_pylist()
    assert {} == part.metrics


def test_whole_run_is_itself(run_dir: Path) -> None:
    run = fleet2d.open_run(run_dir)
    assert run is part_of_run(run, 0, run.manifest["steps"])
