"""Searching for failures: what is found fails, is kept as a scenario, and wrong input is refused."""

import pickle
import random
import re
import sys
from pathlib import Path

import pytest
import typer
import yaml
from tests.scenes import AGENDA, scenario
from typer.testing import CliRunner

import fleet2d
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.studies.executors import Crew, SerialExecutor
from fleet2d.testing import command
from fleet2d.testing.search import FailureSearch, parse_over, read_space

pytest.importorskip("optuna")
pytestmark = pytest.mark.filterwarnings("ignore::optuna.exceptions.ExperimentalWarning")

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
OVER = "robots.astro.speed={low: 0.05, high: 0.6}"
ALIASES = ", ".join(f"&a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 10))
BOMB = f"[&a0 [1, 1], {ALIASES}]"
AFAR = "robots.astro.start=[[500.0, 500.0], [600.0, 600.0]]"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with flat.yaml: a robot that is to be in the bathroom within a minute."""
    agenda = {"type": "schedule", "days": AGENDA, "rest": "living_room"}
    content = scenario(
        "4 min",
        users={"ana": agenda, "ben": agenda},
        robots={"astro": {"type": "patrol", "waypoints": [[1, 1], [7, 6]], "dwell": "1 min"}},
    )
    content["expect"] = {"comes": "eventually(distance(astro, bathroom) < 1 m, within=2 min)"}
    (tmp_path / "flat.yaml").write_text(yaml.safe_dump(content))
    (tmp_path / "test_flat.py").write_text(
        "from fleet2d.expectations import eventually, room\n"
        "from fleet2d.testing import trial\n"
        "@trial('flat.yaml')\n"
        "def test_comes(trial):\n"
        "    trial.do({'put': 'astro', 'to': 'kitchen'})\n"
        "    trial.expect(eventually(room('astro') == 'bathroom', within='2 min'), name='enters')\n"
        "@trial('flat.yaml')\n"
        "def test_more(trial, tmp_path): pass\n"
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


def falsify(*arguments):
    app = typer.Typer()
    app.command()(command.falsify)
    return CliRunner().invoke(app, [*arguments, "--workers", "1"])


@pytest.mark.slow
def test_the_resulting_scenario_fails(folder):
    arguments = ("--over", OVER, "--budget", "30", "--seed", "1", "--out", "found.yaml")
    done = falsify("flat.yaml", *arguments)
    assert 1 == done.exit_code, done.output
    assert "comes is violated" in done.output
    assert "written: found.yaml" in done.output
    failing = yaml.safe_load((folder / "found.yaml").read_text())
    assert "flat.yaml" == failing["extends"]
    simulation = fleet2d.Simulation("found.yaml")
    simulation.run()
    assert not simulation.verdicts()["comes"].holds
    assert fleet2d.reproduce(folder / "found" / "run").same
    smaller = fleet2d.open_run(folder / "found" / "smaller")
    assert [] == smaller.manifest["entities"]["users"]


@pytest.mark.slow
def test_a_test_of_a_trial_can_be_searched(folder):
    done = falsify("test_flat.py::test_comes", "--over", OVER, "--budget", "30", "--quiet")
    assert (1, "") == (done.exit_code, done.output)
    failing = fleet2d.load_scenario("falsified.yaml")
    assert failing.robots["astro"].speed < 0.3


def test_a_search_needs_an_axis():
    with pytest.raises(InputError, match="nothing to search over"):
        read_space({})


def test_a_test_that_holds_when_it_is_repeated_is_refused(folder):
    (folder / "test_once.py").write_text(
        "from pathlib import Path\n"
        "from fleet2d.testing import trial\n"
        "@trial('flat.yaml')\n"
        "def test_once(trial):\n"
        "    known = Path('known').exists()\n"
        "    Path('known').touch()\n"
        "    assert known\n"
    )
    done = falsify("test_once.py::test_once", "--over", OVER, "--budget", "1")

    assert isinstance(done.exception, InputError)
    assert "failed at try 1, but holds when that try is repeated" in str(done.exception)
    assert not (folder / "falsified.yaml").exists()


@pytest.mark.slow
def test_without_a_failure_the_smallest_margin_is_reported(folder):
    slow = "robots.astro.speed={low: 0.5, high: 0.6}"
    done = falsify("flat.yaml", "--over", slow, "--budget", "5")
    assert 0 == done.exit_code
    assert "Nothing fails in 5 runs." in done.output
    assert "The first 5 were random, so at most 45.1 % of cases fail (95 %)." in done.output
    assert re.search(r"The narrowest margin is 0\.\d+ m: robots", done.output)
    assert "It took 5 runs in" in done.output


@pytest.mark.slow
def test_it_goes_on_after_its_first_find_and_says_what_fails_apart(folder):
    axes = ["--over", OVER, "--over", "where={key: robots.astro.dwell, values: [1 min, 2 min]}"]
    done = falsify("flat.yaml", *axes, "--budget", "40", "--finds", "3", "--out", "found.yaml")

    assert 1 == done.exit_code, done.output
    assert "3 of " in done.output
    assert " failed: comes missed at try " in done.output
    assert all((folder / name).is_file() for name in ("found.yaml", "found-2.yaml", "found-3.yaml"))
    assert 1 == done.output.count("smaller:"), "failures of one kind are made smaller once"
    (never,) = (line for line in done.output.splitlines() if line.startswith("Never failed:"))
    assert "where = 1 min" in never
    assert "where = 2 min" not in never
    for name in ("found-2.yaml", "found-3.yaml"):
        simulation = fleet2d.Simulation(name)
        simulation.run()
        assert not simulation.verdicts()["comes"].holds


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["flat.yaml", "--over", "robots.astro.sped={low: 1, high: 2}"], "speed"),
        (["flat.yaml", "--over", "home={synthetik: 5}"], "synthetic"),
        (["flat.yaml", "--over", "axis.yaml"], "no such file"),
        (["flat.yaml", "--over", f"home={BOMB}"], "values"),
        (["flat.yaml", "--over", "home={synthetic: 5"], "not valid YAML"),
        (["flat.yaml", "--over", "robots.astro.speed={low: 2, high: 1}"], "low below high"),
        (["bundled:paper", "--over", OVER], "has no expectations"),
        (["flat.yaml", "--over", OVER, "--budget", "soon"], "--budget: expected"),
        (["test_flat.py::test_come", "--over", OVER], "did you mean 'test_comes'"),
        (["test_flat.py::test_more", "--over", OVER], "other arguments (tmp_path)"),
        (["flat.yaml", "--over", OVER, "--out", "flat.yaml"], "exists already"),
        (["flat.yaml", "--over", "home={synthetic: 0}"], "expected 1 home or more, got none"),
        (["flat.yaml", "--over", "home={synthetic: []}"], "expected 1 home or more, got none"),
        (["flat.yaml", "--over", OVER, "--budget", "0 s"], "0 s was over before the first run"),
        (["flat.yaml", "--over", AFAR, "--budget", "2"], "none of 2 runs could be done: "),
    ],
)
def test_wrong_input_is_refused_in_words(folder, arguments, words):
    done = falsify(*arguments)
    assert isinstance(done.exception, Fleet2DError), done.output
    assert words in str(done.exception)


@pytest.mark.slow
def test_a_planted_fault_is_detected_that_random_search_misses(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import falsify as benchmark

    job = benchmark.job("load and slope")
    guided, blind = (FailureSearch(job, 110, seed=1, is_guided=guided) for guided in (True, False))
    failure = guided.run(Crew(SerialExecutor()))
    assert failure is not None
    assert job.run(failure.point, failure.seed).margin < 0
    assert blind.run(Crew(SerialExecutor())) is None
    assert 110 == blind.tries
    sys.modules.pop("falsify")


def test_a_search_is_the_same_again():
    space = read_space({"a.b": {"low": 0, "high": 1}, "c": {"key": "d.e", "values": [1, 2]}})
    draws = [space.draw(random.Random(3)) for _ in range(2)]
    assert draws[0] == draws[1]
    assert [(("a", "b"), draws[0]["a.b"]), (("d", "e"), 1 + draws[0]["c"])] == space.changes(
        draws[0]
    )


def test_a_job_that_has_run_here_goes_to_another_process(folder):
    job = command.job_of("flat.yaml", read_space({"simulation.seed": [1, 2]}))
    margin = job.run({"simulation.seed": 1}, 3).margin
    twin = pickle.loads(pickle.dumps(job))
    assert margin == twin.run({"simulation.seed": 1}, 3).margin


def test_axes_come_from_files_and_texts(folder):
    (folder / "axes.yaml").write_text("axes: {home: {synthetic: 2}}\n")
    assert {"home": {"synthetic": 2}, "a.b": [1]} == parse_over(["axes.yaml", "a.b=[1]"])


@pytest.mark.parametrize("text", ["0", "-1", "1.5", "12345678", ""])
def test_a_budget_is_a_number_or_a_time(text):
    with pytest.raises(InputError, match="expected a number of runs"):
        command.parse_budget(text)
