"""Leaves: packages that nothing needs, and that can be deleted without a trace elsewhere."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from tests.thorough import THOROUGH
from typer.testing import CliRunner

import fleet2d
from fleet2d import _core
from fleet2d.cli import __main__ as plugins
from fleet2d.cli.__main__ import app

SOURCE = Path(fleet2d.__file__).parent
LEAVES = {
    "learning/fit": "fit",
    "homes/synthetic": "",
    "studies": "study",
    "viewing": "view",
}
REST = """
import sys
import fleet2d
from fleet2d.cli.__main__ import app
from fleet2d.configuration.components import PACKAGES, components

for kind in PACKAGES:
    components(kind)
run = fleet2d.run(None, "simulation.duration=10 min", seed=1)
assert run.status == "complete"
assert fleet2d.load_floorplan("family_home").rooms
sys.argv = ["fleet2d", "--help"]
app()
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of Fleet2D and its core, which the first process compiles for all."""
    folder = tmp_path_factory.mktemp("leaves")
    skipped = shutil.ignore_patterns("__pycache__", "page")
    package = shutil.copytree(SOURCE, folder / "fleet2d", ignore=skipped)
    shutil.copy(_core.__file__, package)
    return folder


@contextmanager
def without(copy: Path, *leaves: str) -> Iterator[None]:
    """Let the copy be without some of its packages for a while."""
    away = copy / "away"
    away.mkdir()
    for leaf in leaves:
        (copy / "fleet2d" / leaf).rename(away / Path(leaf).name)
    yield
    for leaf in leaves:
        (away / Path(leaf).name).rename(copy / "fleet2d" / leaf)
    away.rmdir()


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


EVERY = sorted(set(" ".join(LEAVES).split()))


@pytest.mark.slow
@pytest.mark.parametrize("folders", [*LEAVES, " ".join(EVERY)] if THOROUGH else [" ".join(EVERY)])
def test_rest_works_without_leaves(folders: str, copy: Path) -> None:
    with without(copy, *folders.split()):
        done = process(copy, "-c", REST)

    assert (done.returncode, done.stderr) == (0, "")
    commands = {line.split()[0] for line in done.stdout.splitlines() if line.startswith("  ")}
    assert "run" in commands
    gone = {LEAVES[leaf] for leaf in (folders, *folders.split()) if leaf in LEAVES}
    assert not gone & commands


@pytest.mark.slow
def test_command_of_a_missing_leaf_is_unknown(copy: Path) -> None:
    with without(copy, "learning/fit"):
        done = process(copy, "-m", "fleet2d.cli", "fit")

    assert done.returncode == 2
    assert "No such command 'fit'" in done.stderr


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
    monkeypatch.setattr(plugins, "entries", lambda group=plugins.GROUP: iter([entry]))

    result = CliRunner().invoke(app, ["greet", "ana"])

    assert output in result.output
