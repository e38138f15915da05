"""Moments as people write them."""

from datetime import datetime, timedelta

import numpy as np
import pytest

import fleet2d
from fleet2d.errors import InputError
from fleet2d.runs.moments import part_of_run, step_of
from fleet2d.runtime.clock import Clock

CLOCK = Clock(datetime(2026, 1, 5, 6), 1_000_000, 10 * 86_400)
HOUR = 3600


@pytest.mark.parametrize(
    ("text", "step"),
    [
        ("day 1 06:00", 0),
        ("Day 3 18:30", int(60.5 * HOUR)),
        ("day 2", 18 * HOUR),
        ("2026-01-05T07:00:01", HOUR + 1),
        ("2026-01-06", 18 * HOUR),
        ("2 h", 2 * HOUR),
        ("1 d 2 h", 26 * HOUR),
        ("step 17", 17),
        ("10 d", 240 * HOUR),
    ],
)
def test_moment_is_read(text, step):
    assert step == step_of(text, CLOCK)


@pytest.mark.parametrize(
    "text", ["", "noon", "day 3 25:00", "day 3 10:99", "2026-01-05T07:00Z", "step x", "-2 h"]
)
def test_what_names_no_moment_is_refused_with_examples(text):
    with pytest.raises(InputError, match="day 3 18:30"):
        step_of(text, CLOCK)


@pytest.mark.parametrize("text", ["day 1 05:59", "day 99", "11 d", "2025-01-01", "step 9999999"])
def test_moment_outside_the_run_is_refused_with_its_dates(text):
    with pytest.raises(InputError, match="2026-01-05 06:00 to 2026-01-15 06:00"):
        step_of(text, CLOCK)


SECOND = timedelta(seconds=1)


@pytest.fixture(scope="module")
def run_dir(tmp_path_factory):
    """A stored run of nine hours."""
    folder = tmp_path_factory.mktemp("moments") / "run"
    fleet2d.run("bundled:paper", "simulation.duration=9 h", seed=11, out=folder)
    return folder


@pytest.mark.parametrize(
    ("first", "end"), [(0, 3600), (7000, 7001), (3601, 30_000), (20_000, 32_400)]
)
def test_poses_of_a_part_are_those_of_the_run(run_dir, first, end):
    run = fleet2d.open_run(run_dir)
    part = part_of_run(run, first, end)
    for name in ("ana", "astro"):
        complete, cut = run.path(name, SECOND), part.path(name, SECOND)
        for values in ("x", "y", "heading", "away", "room", "time"):
            assert np.array_equal(getattr(complete, values)[first:end], getattr(cut, values))


def test_rows_outside_are_left_out_and_steps_count_from_zero(run_dir):
    run = fleet2d.open_run(run_dir)
    part = part_of_run(run, 3600, 7200)
    steps = run.tables["events"]["step"].to_numpy()
    inside = steps[(steps >= 3600) & (steps < 7200)] - 3600
    assert inside.tolist() == part.tables["events"]["step"].to_pylist()
    assert {} == part.metrics


def test_whole_run_is_itself(run_dir):
    run = fleet2d.open_run(run_dir)
    assert run is part_of_run(run, 0, run.manifest["steps"])
