"""Benchmarks: each can be imported; `.ci/benchmarks` starts each with its smallest size."""

import runpy
import subprocess
import sys
from pathlib import Path

import pytest
import shapely

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
NAMES = sorted(path.name for path in BENCHMARKS.glob("*.py"))


@pytest.mark.parametrize("name", NAMES)
def test_a_benchmark_can_be_imported(name, monkeypatch):
    """`benchmarks/studies.py` imported a class that had another name by then, and didn't start."""
    if name == "gru.py":
        pytest.importorskip("torch", reason="needs the extra ml")
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    runpy.run_path(str(BENCHMARKS / name), run_name="imported")


def test_ci_starts_every_benchmark():
    script = (BENCHMARKS.parent / ".ci" / "benchmarks").read_text(encoding="utf-8")
    # Those that others import or run.
    parts = {"faults.py", "visits.py", "peers.py", "sight_peers.py"}
    assert [] == [name for name in NAMES if name not in parts and f"start {name}" not in script]


@pytest.mark.slow
def test_studies_are_measured():
    command = [sys.executable, str(BENCHMARKS / "studies.py"), "overhead", "--small"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert 0 == done.returncode, done.stderr
    assert "overhead per variant" in done.stdout


def test_corners_of_all_parts_of_a_home_are_counted():
    measure = runpy.run_path(str(BENCHMARKS / "synthetic_homes.py"), run_name="imported")
    storeys = shapely.MultiPolygon([shapely.box(0, 0, 9, 9), shapely.box(20, 0, 29, 9)])

    assert 8 == measure["_corners"](storeys, 1)
    assert 4 == measure["_corners"](storeys.geoms[0], 1)
