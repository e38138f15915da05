"""Commands without the packages of an extra: one line, with the extra and how to install it."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from tests.hostile.test_archives import BOMBS
from tests.learning.datasets.small import SOURCE, make
from tests.learning.transfer.homes import write_home
from tests.scenes import TESTS, process
from tests.thorough import some

import fleet2d
from fleet2d.cli import extra_with

PROJECT = tomllib.loads((TESTS.parent / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
HIDING = """
import os
import sys

hidden = set(os.environ["HIDDEN_MODULES"].split(","))

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in hidden:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Absent())
"""
"""A `sitecustomize` that hides modules from a process and from the children that it starts."""
OTHERS = {"paho-mqtt": "paho"}
"""Modules whose names aren't those of their packages."""
TOOLS = ("test", "browser", "page", "lint", "docs", "build", "cluster")


def packages(extra):
    """The packages that an extra installs by itself."""
    names = [line.partition(">")[0].partition("[")[0] for line in EXTRAS[extra]]
    return [name for name in names if name != "fleet2d"]


def modules():
    """All modules of all extras, as a list with commas."""
    names = {name for extra in EXTRAS if extra not in TOOLS for name in packages(extra)}
    return ",".join(sorted(OTHERS.get(name, name) for name in names))


SCENARIO = {"extends": "bundled:paper", "simulation": {"duration": "5 min"}}
FILES = {
    "home.yaml": SCENARIO,
    "network.yaml": {
        **SCENARIO,
        "robots": {"astro": {"behaviors": [{"type": "policy", "file": "net.onnx", "rooms": 30}]}},
    },
    "study.yaml": {"base": SCENARIO, "axes": {"robots.astro.speed": [0.3, 0.5]}},
    "tune.yaml": {
        "base": SCENARIO,
        "axes": {"home": {"synthetic": 2}},
        "tune": {
            "search": {"speed": {"key": "robots.astro.speed", "low": 0.2, "high": 0.8}},
            "objective": {"distance.astro.metres": "maximize"},
            "held_out": {"home": [1]},
        },
    },
    "people.yaml": SOURCE,
    "homes.yaml": {
        "homes": {"one": {"path": "one.txt"}},
        "tasks": ["presence"],
        "arms": ["own"],
        "days": [1],
    },
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a run, a study, a data set and the files that commands need."""
    root = tmp_path_factory.mktemp("extras")
    for name, content in FILES.items():
        (root / name).write_text(yaml.safe_dump(content))
    (root / "hiding").mkdir()
    (root / "hiding" / "sitecustomize.py").write_text(HIDING)
    write_home(root / "one.txt", 8)
    (root / "net.onnx").write_bytes((BOMBS / "pol-good.onnx").read_bytes())
    (root / "log.csv").write_text("distance,bearing,detected\n1,0,1\n" * 60)
    for name in ("plan.svg", "plan.dxf", "plan.ifc"):
        (root / name).write_text("")
    fleet2d.run(SCENARIO, out=root / "run")
    fleet2d.study(root / "study.yaml", out=root / "st", workers=1)
    make(root / "data")
    return root


def without(folder: Path, hidden, command) -> subprocess.CompletedProcess[str]:
    """Run a command without some modules."""
    path = os.pathsep.join([str(folder / "hiding"), *sys.path])
    arguments = ("-m", "fleet2d.cli", *command.split())
    return process(*arguments, cwd=folder, PYTHONPATH=path, HIDDEN_MODULES=hidden)


MAP = f"floorplan.path={BOMBS / 'bomb-mcap.mcap'}"
# A command, the modules that aren't there (none: all of all extras), and the extra that it names.
LACKING = [
    ("view run --no-browser", "", "view"),
    ("export run run.mp4", "", "viz"),
    ("export run run.mp4", "av", "film"),
    ("show run --out run.png", "", "viz"),
    ("export run run.mcap", "", "ros"),
    ("study run study.yaml --out plain-study", "", "study"),
    ("study status st", "", "study"),
    ("study report st", "matplotlib", "viz"),
    ("study report st", "polars", "polars|study"),
    ("study tune tune.yaml --out tuned", "optuna", "tune"),
    ("dataset train --on data --out weights.npz", "", "ml"),
    ("dataset train --on people.yaml --out own.npz", "torch", "ml"),
    ("dataset score data --tune 1", "", "ml"),
    ("dataset score data --task ltp --task rtp --tune 1", "torch", "ml"),
    ("transfer homes.yaml --out transferred", "torch", "ml"),
    ("dataset score data --picture forecasts.png", "", "viz"),
    ("live home.yaml --with ws://127.0.0.1:0 --speed 0", "", "live"),
    ("live home.yaml --with rosbridge://127.0.0.1:9 --speed 0", "", "rosbridge"),
    ("live home.yaml --with mqtt://127.0.0.1:9/x --speed 0", "", "mqtt"),
    ("mcp .", "", "mcp"),
    ("run network.yaml --out net", "", "onnx"),
    ("fit perception log.csv", "", "calibrate"),
    ("validate floorplan.type=svg floorplan.path=plan.svg", "", "svg"),
    ("validate floorplan.type=dxf floorplan.path=plan.dxf", "", "cad"),
    ("validate floorplan.type=ifc floorplan.path=plan.ifc", "", "ifc"),
    (f"validate floorplan.type=bag {MAP}", "", "ros"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("command", "hidden", "extra"), LACKING)
def test_a_command_says_in_one_line_what_to_install(folder, command, hidden, extra):
    """`view` printed a traceback of 41 lines."""
    before = sorted(folder.rglob("*"))
    done = without(folder, hidden or modules(), command)
    assert 2 == done.returncode
    (line,) = done.stderr.splitlines()
    assert re.fullmatch(rf'error: .*: pip install "fleet2d\[({extra})\]"', line)
    new = (path for path in folder.rglob("*") if path not in before)
    left = {path.name for path in new if "hiding" not in path.parts}
    assert left <= {"run.notes.json", "tables", "report", "figures"}  # of the run and the study


PLAIN = (
    "run home.yaml --out plain", "validate home.yaml", "test home.yaml",
    "verify run", "verify run --again", "export run run.csv", "export run run.html", "components",
    "dataset make people.yaml --out plain-data --workers 1", "dataset score data",
    "dataset score data --task ltp --tune 1",
    "live home.yaml --with udp://127.0.0.1:0 --speed 0",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("command", some(PLAIN, 3))
def test_a_command_that_needs_no_extra_runs_without_any(folder, command):
    """`dataset` simulated everything, and then failed as polars wasn't there."""
    done = without(folder, modules(), command)
    assert 0 == done.returncode, done.stderr


@pytest.mark.parametrize("extra", [extra for extra in EXTRAS if extra not in TOOLS])
def test_the_extra_of_every_module_is_known(extra):
    for package in packages(extra):
        if package not in OTHERS:
            assert package in map(str.lower, packages(extra_with(package)))
