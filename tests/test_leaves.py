"""Leaves: packages that nothing needs, and that can be deleted without a trace elsewhere."""

import os
import shutil
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from typer.testing import CliRunner

import fleet2d
from fleet2d import _core
from fleet2d.cli import app, plugins

SOURCE = Path(fleet2d.__file__).parent
LEAVES = {
    "calibrate": "calibrate",
    "fit": "fit",
    "floorplan/synthetic": "",
    "paper": "reproduce-paper",
    "published": "",
    "studies paper": "study",
    "viewer": "view",
}
REST = """
import sys
import fleet2d
from fleet2d.cli import app
from fleet2d.component import PACKAGES, components

for kind in PACKAGES:
    components(kind)
run = fleet2d.run(None, "simulation.duration=10 min", seed=1)
assert run.status == "complete"
assert fleet2d.load_floorplan("family_home").rooms
sys.argv = ["fleet2d", "--help"]
app()
"""


def copied(folder: Path) -> Path:
    """Copy Fleet2D with its core."""
    skipped = shutil.ignore_patterns("__pycache__", "page")
    copy = shutil.copytree(SOURCE, folder / "fleet2d", ignore=skipped)
    shutil.copy(_core.__file__, copy)
    return copy


def process(folder: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    """Run Python with the copy, and without what an editable install puts in its place."""
    libraries = [path for path in sys.path if path.endswith("site-packages")]
    return subprocess.run(
        [sys.executable, "-S", *arguments],
        cwd=folder,
        env={"PYTHONPATH": os.pathsep.join([str(folder), *libraries]), "HOME": str(folder)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize(("folders", "command"), LEAVES.items())
def test_rest_works_without_a_leaf(folders: str, command: str, tmp_path: Path) -> None:
    copy = copied(tmp_path)
    for folder in folders.split():
        shutil.rmtree(copy / folder)

    done = process(tmp_path, "-c", REST)

    assert (done.returncode, done.stderr) == (0, "")
    commands = [line.split()[0] for line in done.stdout.splitlines() if line.startswith("  ")]
    assert "run" in commands
    assert command not in commands


def test_command_of_a_missing_leaf_is_unknown(tmp_path: Path) -> None:
    shutil.rmtree(copied(tmp_path) / "paper")

    done = process(tmp_path, "-m", "fleet2d.cli", "reproduce-paper")

    assert done.returncode == 2
    assert "No such command 'reproduce-paper'" in done.stderr


def greet(name: str) -> None:
    """Greet somebody."""
    print(f"hello {name}")


@pytest.mark.parametrize(
    ("value", "output"),
    [
        ("tests.test_leaves:greet", "hello ana"),
        ("tests.test_leaves:nothing", "the command 'greet' (tests.test_leaves:nothing) fails"),
    ],
)
def test_command_of_another_package_runs_or_says_what_is_wrong(
    value: str, output: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = EntryPoint("greet", value, plugins.GROUP)
    monkeypatch.setattr(plugins, "_entry_points", lambda group=plugins.GROUP: iter([entry]))

    result = CliRunner().invoke(app, ["greet", "ana"])

    assert output in result.output
