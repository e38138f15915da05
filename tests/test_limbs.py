"""Limbs: packages upon the heart, each of which can be taken away."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import pytest
from tests.thorough import THOROUGH
from tools.package_map import limbs
from typer.testing import CliRunner

import fleet2d
from fleet2d import _core
from fleet2d.cli import __main__ as plugins
from fleet2d.cli.__main__ import app

ROOT = Path(__file__).parents[1]
SOURCE = Path(fleet2d.__file__).parent
LIMBS = limbs()
REGISTRY = """
from fleet2d.configuration.built_in import COMPONENTS
from fleet2d.configuration.components import components

for kind in COMPONENTS:
    components(kind)
"""
OF_THE_HEART = (
    "configuration/test_components.py",
    "engine/test_simulation.py",
    "engine/test_spans.py",
    "entities/robots/test_dock.py",
    "entities/users/test_schedule.py",
    "floorplan/test_native_bundled.py",
    "metrics/test_metrics.py",
    "runs/test_run.py",
    "runs/test_trajectory.py",
    "scenario/test_compose.py",
)
"""Tests that pass without any limb."""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A folder with a copy of Fleet2D and its core, which the first process compiles for all."""
    folder = tmp_path_factory.mktemp("limbs")
    skipped = shutil.ignore_patterns("__pycache__", "page")
    package = shutil.copytree(SOURCE, folder / "fleet2d", ignore=skipped)
    shutil.copy(_core.__file__, package)
    return folder


@contextmanager
def without(copy: Path, missing: Sequence[str]) -> Iterator[None]:
    """Let the copy be without some limbs for a while."""
    away = copy / "away"
    away.mkdir()
    for limb in missing:
        (copy / "fleet2d" / limb).rename(away / limb)
    try:
        yield
    finally:
        for limb in missing:
            (away / limb).rename(copy / "fleet2d" / limb)
        away.rmdir()


def process(folder: Path, *arguments) -> "subprocess.CompletedProcess[str]":
    """Run Python with the copy, and without what an editable install puts in its place."""
    libraries = [path for path in sys.path if path.endswith("site-packages")]
    return subprocess.run(
        [sys.executable, "-S", *arguments],
        cwd=folder,
        env={"PYTHONPATH": os.pathsep.join([str(folder), *libraries]), "HOME": str(folder)},
        capture_output=True,
        text=True,
        timeout=900,  # a machine that does much else is slow, not wrong
        check=False,
    )


def commands_of(limb):
    """Return the commands that a limb adds."""
    return {e.name for e in entry_points(group=plugins.GROUP) if f".{limb}." in e.module}


@pytest.mark.slow
@pytest.mark.parametrize("missing", [*([limb] for limb in LIMBS if THOROUGH), LIMBS], ids=" ".join)
def test_heart_works_without_limbs(missing, copy):
    shutil.rmtree(copy / "run", ignore_errors=True)
    with without(copy, missing):
        calls = [
            process(copy, "-m", "fleet2d", "run", "simulation.duration=10 min", "--out", "run"),
            process(copy, "-m", "fleet2d", "--help"),
            process(copy, "-c", REGISTRY),
        ]

    assert [(0, "")] * len(calls) == [(done.returncode, done.stderr) for done in calls]
    commands = {line.split()[0] for line in calls[1].stdout.splitlines() if line.startswith("  ")}
    assert {"run", "resume", "verify", "validate", "components"} <= commands
    assert not commands & set().union(*map(commands_of, missing))


@pytest.mark.slow
@pytest.mark.parametrize("missing", [*([limb] for limb in LIMBS if THOROUGH), LIMBS], ids=" ".join)
def test_tests_of_the_heart_pass_without_limbs(missing, copy):
    files = [str(ROOT / "tests" / name) for name in OF_THE_HEART]
    options = ["-q", "-p", "no:fleet2d", "-p", "no:cacheprovider", "--rootdir", str(ROOT)]
    with without(copy, missing):
        done = process(copy, "-m", "pytest", "-c", str(ROOT / "pyproject.toml"), *options, *files)

    assert 0 == done.returncode, done.stdout


@pytest.mark.slow
def test_command_of_a_missing_limb_is_unknown(copy):
    with without(copy, ["learning"]):
        done = process(copy, "-m", "fleet2d", "fit")

    assert done.returncode == 2
    assert "No such command 'fit'" in done.stderr


@pytest.mark.slow
def test_command_that_needs_a_missing_limb_names_it(copy):
    with without(copy, ["studies"]):
        done = process(copy, "-m", "fleet2d", "test", "bundled:family", "--homes", "2")

    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.endswith("this needs fleet2d.studies, which is missing: reinstall fleet2d\n")


def greet(name):
    """Greet somebody."""
    print(f"hello {name}")


@pytest.mark.parametrize(
    ("value", "output"),
    [
        ("tests.test_limbs:greet", "hello ana"),
        ("tests.test_limbs:nothing", "the command 'greet' (tests.test_limbs:nothing) fails"),
    ],
)
def test_command_of_another_package_runs_or_says_what_is_wrong(value, output, monkeypatch):
    entry = EntryPoint("greet", value, plugins.GROUP)
    monkeypatch.setattr(plugins, "entries", lambda group=plugins.GROUP: iter([entry]))

    result = CliRunner().invoke(app, ["greet", "ana"])

    assert output in result.output
