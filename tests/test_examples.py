"""Everything in examples/ runs, as its first lines say, and leaves what it says."""

import runpy
import shutil
import sys
from pathlib import Path

import pytest
import yaml
from tests.thorough import THOROUGH

from fleet2d.learning.datasets.specification import plan_dataset
from fleet2d.runs.run import open_run
from fleet2d.studies.driver import check_study

EXAMPLES = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(EXAMPLES.rglob("*.py"))
# Those in agents/ need torch: tests/extras; those in live/ a run: tests/live; paper/ has tests of
# its own.
RUNNABLE = [
    path
    for path in SCRIPTS
    if '__name__ == "__main__"' in path.read_text()
    and path.parent.name not in ("agents", "live", "paper")
]
STUDIES = sorted((EXAMPLES / "studies").glob("*.yaml"))
DATA_SETS = sorted((EXAMPLES / "datasets").glob("*.yaml"))
# What makes a script short, unless it is thorough.
SHORTER = {"duration.days=7": "duration.days=1", "range(5, 5 +": "range(1, 1 +"}
MAY_BE_EMPTY = {"observations", "violations"}
PAPER = set((EXAMPLES / "paper").glob("*.yaml"))
BUILDS = sorted((EXAMPLES / "release_gate").glob("*.yaml"))
TRANSFERS = (EXAMPLES / "transfer").glob("*.yaml")  # run elsewhere
OTHERS = {*STUDIES, *DATA_SETS, *PAPER, *BUILDS, *TRANSFERS}
SCENARIOS = sorted(set(EXAMPLES.rglob("*.yaml")) - OTHERS)


@pytest.fixture
def examples(tmp_path):
    """A copy of the examples, in which nothing of the repository can be written over."""
    return shutil.copytree(
        EXAMPLES, tmp_path / "examples", ignore=shutil.ignore_patterns("__pycache__")
    )


def test_there_are_examples_of_an_own_behavior_and_an_own_algorithm():
    sources = [path.read_text() for path in SCRIPTS]
    assert any("(Behavior)" in source for source in sources)
    assert any("(Algorithm)" in source for source in sources)
    assert RUNNABLE
    assert SCENARIOS


@pytest.mark.slow
@pytest.mark.parametrize("path", RUNNABLE, ids=lambda path: path.name)
def test_a_script_runs(examples, path, monkeypatch, capfd):
    script = examples / path.relative_to(EXAMPLES)
    fewer = ["1" if path.stem == "compare_find" else "2"]  # days, seeds or homes
    if "sys.argv" not in script.read_text():
        fewer = []
    for text, other in SHORTER.items() if not THOROUGH else ():
        script.write_text(script.read_text().replace(text, other))
    monkeypatch.chdir(examples.parent)
    monkeypatch.syspath_prepend(script.parent)
    monkeypatch.setattr(sys, "argv", [str(script), *fewer])
    runpy.run_path(str(script), run_name="__main__")
    out, err = capfd.readouterr()
    assert out.strip()
    assert "" == err


@pytest.mark.slow
@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: str(path.relative_to(EXAMPLES)))
def test_a_scenario_runs_from_anywhere(fleet2d, examples, path):
    content = yaml.safe_load(path.read_text())
    duration = content.get("simulation", {}).get("duration", {"days": 30})
    is_long = duration in ({"days": 4}, {"days": 7}, {"days": 28}, {"days": 30})
    fewer = ["simulation.duration=1 d"] if is_long and not THOROUGH else []
    file = examples / path.relative_to(EXAMPLES)
    assert (0, "", "") == fleet2d("run", file, *fewer, "--out", "run", "--quiet")
    stored = open_run("run")
    assert "complete" == stored.status
    assert all(rows.num_rows for name, rows in stored.tables.items() if name not in MAY_BE_EMPTY)
    for name in (name for name, algorithm in content.get("algorithms", {}).items() if algorithm):
        assert name in stored.tables


@pytest.fixture
def complete(examples, path, request):
    """A file of the examples, with the data beside it that its first lines name."""
    file = examples / path.relative_to(EXAMPLES)
    for name, folder in (("logs", "activity"), ("houseexpo", "houseexpo")):
        if f"{name}/" in path.read_text():
            (file.parent / name).symlink_to(request.getfixturevalue("shared_data") / folder)
    return file


@pytest.mark.slow
@pytest.mark.parametrize("path", DATA_SETS, ids=lambda path: path.name)
def test_a_data_set_has_fitting_homes_and_households(complete, monkeypatch):
    monkeypatch.chdir(complete.parent)
    plan_dataset(complete)


@pytest.mark.slow
@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.name)
def test_a_study_is_as_it_should_be(complete):
    checked = check_study(complete)
    assert len(checked.plan.variants) > 10
    assert checked.specification.file.compare or checked.specification.file.tune


@pytest.mark.parametrize(
    "path", [*SCRIPTS, *SCENARIOS, *STUDIES], ids=lambda path: str(path.relative_to(EXAMPLES))
)
def test_an_example_begins_by_saying_what_it_is(path):
    first = path.read_text().splitlines()[0]
    assert first.startswith(('"""', "# "))
    assert len(first) > 20
