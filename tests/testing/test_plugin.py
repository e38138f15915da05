"""The plugin of pytest: tests with a trial run as other tests do, and say what was decided."""

import re
import sys
from dataclasses import dataclass
from importlib.metadata import entry_points
from xml.etree import ElementTree as ET

import pytest
import yaml
from tests.scenes import AGENDA, process, scenario

import fleet2d

INSTALLED = bool(entry_points(group="pytest11", name="fleet2d"))
LOAD = [] if INSTALLED else ["-p", "fleet2d.testing.plugin"]
QUIET = ["-p", "no:xdist", "-p", "no:hypothesispytest", "--capture=no"]

HEAD = """
import pytest
from fleet2d.testing import trial
"""


@dataclass
class Result:
    """What a run of pytest within this one came to."""

    text: str
    outcomes: dict[str, int]


class Counter:
    """Counts outcomes of tests."""

    def __init__(self):
        self.outcomes: dict[str, int] = {}

    def pytest_runtest_logreport(self, report):
        if report.when == "call":
            self.outcomes[report.outcome] = self.outcomes.get(report.outcome, 0) + 1


@pytest.fixture
def suite(tmp_path, monkeypatch, capsys):
    """Runs tests in a folder with flat.yaml: Ana and Ben with an agenda, and a robot on its rounds."""
    agenda = {"type": "schedule", "days": AGENDA, "rest": "living_room"}
    people = {"ana": agenda, "ben": agenda}
    content = scenario("10 min", users=people, robots={"astro": "patrol"})
    (tmp_path / "flat.yaml").write_text(yaml.safe_dump(content))
    (tmp_path / "pytest.ini").write_text("[pytest]")
    monkeypatch.chdir(tmp_path)

    def run(code, *options) -> Result:
        (tmp_path / "test_suite.py").write_text(HEAD + code)
        sys.modules.pop("test_suite", None)
        counter = Counter()
        more = ["--fleet2d-artifacts", "left", *options]
        pytest.main([*LOAD, *QUIET, *more, "test_suite.py"], plugins=[counter])
        return Result(capsys.readouterr().out, counter.outcomes)

    return run


def test_each_seed_is_a_run_and_the_decision_is_reported(suite):
    result = suite("""
seeds = []
@trial("flat.yaml", seeds=12)
def test_all(trial):
    seeds.append(trial.seed)
    trial.run_until("07:01")
    assert trial.step == 60
def test_seeds():
    assert seeds == list(range(12))
""", "--junit-xml=report.xml")  # fmt: skip
    assert {"passed": 2} == result.outcomes
    assert "test_all  assert       held     12 of 12  73.5 % to 100 %" in result.text
    report = ET.parse("report.xml")
    shown = "held in 12 of 12 seeds; at least 77.9 % was shown"
    assert [{"name": "fleet2d", "value": shown}] == [
        element.attrib for element in report.iter("property")
    ]


@pytest.mark.slow
def test_a_rate_is_decided_before_all_seeds_are_used(suite):
    result = suite("""
@trial("flat.yaml", seeds=200, holds=0.5)
def test_never(trial):
    assert trial.seed < 0
@trial("flat.yaml", seeds=200, holds=0.5)
def test_mostly(trial):
    assert trial.seed % 5
""", "--fleet2d-shrink=0")  # fmt: skip
    assert {"passed": 1, "failed": 1} == result.outcomes
    text = result.text
    assert "test_mostly  assert       held     50 %" in text
    assert "50 % refused after" in text
    assert " of 200" not in text


@pytest.mark.slow
def test_a_failure_leaves_a_run_that_reproduces_a_picture_and_the_command(suite, tmp_path):
    result = suite("""
@trial("flat.yaml", seeds=3)
def test_ana_stays(trial):
    trial.do({"put": "astro", "to": "kitchen"})
    trial.run_until("07:02")
    trial.do({"put": "ana", "to": "bathroom"})
    trial.advance(5)
    assert trial.state["ana"]["room"] == "kitchen_1"
""", "-q")  # fmt: skip
    assert {"failed": 1} == result.outcomes
    text = result.text
    assert "assert 'bathroom_1' == 'kitchen_1'" in text
    assert "again: pytest test_suite.py::test_ana_stays --fleet2d-seed 0" in text
    folder = tmp_path / "left" / "test_suite.py-test_ana_stays"
    for name in ("run", "smaller"):
        assert (folder / f"{name}.png").stat().st_size > 10_000
        stored = fleet2d.reproduce(folder / name)
        assert stored.same, stored.differing
    whole, smaller = (fleet2d.open_run(folder / name) for name in ("run", "smaller"))
    assert (600, 2) == (whole.manifest["steps"], len(whole.manifest["interventions"]))
    assert (5, 1) == (smaller.manifest["steps"], len(smaller.manifest["interventions"]))
    assert [] == smaller.manifest["entities"]["robots"]
    assert ["ana"] == smaller.manifest["entities"]["users"]
    report = (folder / "failure.txt").read_text()
    assert "see it: fleet2d view" in report
    place = folder.relative_to(tmp_path)
    film = f"film it: fleet2d export {place / 'run'} {place / 'run.mp4'} --from"
    assert f"{film} 'step 94' --to 'step 154'" in report
    film = f"film it: fleet2d export {place / 'smaller'} {place / 'smaller.mp4'} --from"
    assert f"{film} 'step 0' --to 'step 4'" in report


@pytest.mark.slow
def test_fixtures_parameters_and_choices_of_tests_work(suite):
    code = """
@pytest.fixture
def place():
    return "bedroom"
@pytest.mark.parametrize("name", ["ana", "ben"])
@trial("flat.yaml", seeds=2)
def test_put(trial, name, place, tmp_path):
    trial.do({"put": name, "to": place})
    trial.advance()
    assert name == "ana"
class TestClass:
    @trial("flat.yaml")
    def test_method(self, trial):
        assert trial.seed == 4
"""
    assert {"passed": 2, "failed": 1} == suite(code).outcomes
    assert {"failed": 1} == suite(code, "--lf").outcomes
    assert {"passed": 2} == suite(code, "-k", "ana or method").outcomes


def test_one_seed_can_be_run_again(suite):
    result = suite("""
@trial("flat.yaml", seeds=50, holds=0.9)
def test_seed(trial):
    assert trial.seed == 17
""", "--fleet2d-seed=17")  # fmt: skip
    assert {"passed": 1} == result.outcomes


def test_trials_go_round_homes_households_and_axes(suite):
    result = suite("""
trials = []
@trial("flat.yaml", seeds=8, homes=["flat.json"], households={"one": {"ana": "meander"},
       "other": {"vera": {"type": "meander", "speed": 0.5}}}, axes={"robots.astro.speed": [0.3, 0.6]})
def test_axes(trial):
    trials.append((*trial.scenario.users, trial.scenario.robots["astro"].speed, trial.seed))
    assert trial.step == 0
def test_trials():
    assert trials[:4] == [("ana", .3, 0), ("vera", .3, 1), ("ana", .6, 2), ("vera", .6, 3)]
    assert trials[4:] == [("ana", .3, 4), ("vera", .3, 5), ("ana", .6, 6), ("vera", .6, 7)]
""".replace("flat.json", scenario()["floorplan"]["path"]))  # fmt: skip
    assert {"passed": 2} == result.outcomes
    assert "held     8 of 8 " in result.text


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("def test_x(trial): pass", "needs @fleet2d.testing.trial"),
        ("@trial('flat.yaml')\ndef test_x(): pass", "needs a test with an argument `trial`"),
        ("@trial('flat.yml')\ndef test_x(trial): pass", "flat.yml"),
        (
            "@trial('flat.yaml', 'users.ana.start=atttic')\ndef test_x(trial): pass",
            "seed 4: …no room…'atttic'",
        ),
        ("@trial('flat.yaml')\ndef test_x(trial): trial.do({'put': 'anna', 'to': 'attic'})", "did you mean 'ana'…trial.do"),
        ("@trial('flat.yaml', seeds=3, holds=.5)\ndef test_x(trial): pass", "take 5 seeds or more"),
    ],
)  # fmt: skip
def test_errors_of_a_test_are_reported(suite, code, words):
    result = suite(code)
    assert {"failed": 1} == result.outcomes
    assert all(word in result.text for word in words.split("…")), result.text
    assert "plugin.py" not in result.text


@pytest.mark.slow
def test_a_trial_without_expectation_or_assertion_is_untested(suite):
    result = suite("""
def helps(trial):
    assert trial.step == 5
@trial("flat.yaml")
def test_nothing(trial):
    trial.advance(5)
@trial("flat.yaml", may_be_untested=True)
def test_allowed(trial):
    trial.advance(5)
@trial("flat.yaml")
def test_helped(trial):
    trial.advance(5)
    helps(trial)
@trial("flat.yaml", seeds=25, holds=.9)
def test_trigger(trial):
    trial.expect("after(events(called, astro), moving(astro), within=1 min)")
@trial("flat.yaml")
def test_trigger_may_be_missing(trial):
    trial.expect("may_be_untested(after(events(called, astro), moving(astro), within=1 min))")
""", "--junit-xml=report.xml", "--fleet2d-shrink=0")  # fmt: skip

    assert {"passed": 3, "failed": 2} == result.outcomes
    assert "nothing is tested: there is no expectation, and no assert" in result.text
    assert "is untested: its trigger never happened" in result.text
    failures = [f.attrib["message"] for f in ET.parse("report.xml").iter("failure")]
    assert any("untested" in message for message in failures)


def test_wrong_names_are_one_line(suite):
    result = suite("""
@trial("flat.yaml", sedes=3)
def test_key(trial): pass
@trial("flat.yaml", seeds=0)
def test_seeds(trial): pass
@trial("flat.yaml")
def test_body(trial):
    trial.do({"call": "astr", "dock": True})
""", "-rN")  # fmt: skip
    section = result.text.partition("= FAILURES =")[2].partition("\n=")[0].splitlines()[1:]
    lines = [line for line in section if line and not line.startswith("_")]

    assert {"failed": 3} == result.outcomes
    assert "did you mean 'seed'" in result.text
    assert "seeds=0: expected 1 or more seeds" in result.text
    place = 'test_suite.py:11: trial.do({"call": "astr", "dock": True}): there is no robot \'astr\''
    assert place in result.text
    assert 3 == len(lines), lines


@pytest.mark.slow
def test_trials_run_in_several_processes(suite, tmp_path):
    code = """
@pytest.mark.parametrize("number", range(4))
@trial("flat.yaml", seeds=5)
def test_many(trial, number):
    trial.advance(3)
    assert trial.step == 3
"""
    (tmp_path / "test_suite.py").write_text(HEAD + code)
    done = process("-m", "pytest", *LOAD, "-n", "2", "-p", "no:cacheprovider", cwd=tmp_path)
    assert "4 passed" in done.stdout
    assert 4 == done.stdout.count("held     5 of 5 ")
    assert "It took 20 trials: 1.0 min simulated in " in done.stdout


TELLS = "= what the trials show ="


def test_a_session_without_trials_says_nothing_of_them(suite):
    assert TELLS not in suite("def test_other(): pass").text


def test_all_that_was_skipped_is_told(suite):
    result = suite("""
@pytest.mark.skip(reason="no time")
@trial("flat.yaml")
def test_one(trial): pass
@pytest.mark.skip(reason="no time")
@trial("flat.yaml")
def test_other(trial): pass
""")  # fmt: skip
    said = result.text.partition(TELLS)[2]
    assert "The robot is untested: no trial was run.\n2 tests skipped: no time." in said
    assert "It took" not in said


def test_one_seed_tells_little_and_how_many_more_would_tell(suite):
    said = suite("""
@trial("flat.yaml")
def test_moves(trial):
    trial.expect("eventually(moving(astro))", "moves")
""").text.partition(TELLS)[2]
    assert "1 of 1 expectation held.\n" in said
    assert (
        "What fails in less than 95 % of trials may have gone unseen: 28 more trials of test_moves"
        " would show what fails in 10 %." in said
    )
    assert "It took 1 trial: " in said


@pytest.mark.slow
def test_what_failed_is_told_with_its_worst_seed_and_what_is_not_covered(suite, tmp_path):
    (tmp_path / "requirements.yaml").write_text("REQ-1: stands still\nREQ-2: greets\n")
    code = """
@trial("flat.yaml", seeds=20, holds=0.9)
def test_near(trial):
    trial.expect("never(moving(astro))", "still", covers=["REQ-1"])
    trial.expect("always(distance(ana, astro) < 0.1)", "near")
@pytest.mark.xfail
@trial("flat.yaml")
def test_expected(trial):
    trial.expect("never(moving(astro))", "still")
@pytest.fixture
def broken():
    raise ValueError("no network")
@trial("flat.yaml")
def test_broken(trial, broken): pass
"""
    options = ("--fleet2d-shrink=0", "--fleet2d-requirements=requirements.yaml")
    said = suite(code, *options).text.partition(TELLS)[2]
    lines = said.splitlines()
    assert "2 of 3 expectations fail and 1 test can't be run." in lines
    assert "test_broken can't be run: ValueError: no network" in said
    assert "still of test_near (REQ-1) failed in " in said
    assert "near of test_near failed in " in said
    assert re.search(r"worst in seed \d+, by [\d.]+ m", said)
    assert "still of test_expected fails as expected, in 1 of 1 trial." in lines
    assert "0 of 2 requirements held; failed: REQ-1; not covered: REQ-2." in lines


@pytest.mark.slow
def test_nothing_else_imports_pytest_and_the_plugin_is_light():
    code = (
        "import sys, fleet2d, fleet2d.testing; fleet2d.testing.trial; assert 'pytest' not in sys.modules;"
        "[sys.modules.pop(n) for n in list(sys.modules) if n.split('.')[0] in ('fleet2d', 'numpy')];"
        "import fleet2d.testing.plugin;"
        "assert not [n for n in sys.modules if n.startswith(('fleet2d.engine', 'numpy'))]"
    )
    done = process("-c", code)
    assert (0, "") == (done.returncode, done.stderr)
