"""The product tests of the examples: each holds, and fails where the robot is made worse for it.

The mutants are behaviors with a seeded bug, see `mutants`.
"""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from tests.scripts import script
from tests.thorough import THOROUGH, some

import fleet2d
from fleet2d.configuration.documents import read_document
from fleet2d.expectations import Verdict
from fleet2d.testing.claim import ATTRIBUTE
from fleet2d.testing.trials import run_claim

FOLDER = Path(__file__).parents[2] / "examples" / "product_tests"
WORSE = tomllib.loads((FOLDER / "worse.toml").read_text())


@pytest.fixture(scope="module")
def week():
    return script("examples/product_tests/test_week.py")


def test_each_of_the_twelve_tests_has_a_worse_robot(week):
    tests = [name for name, value in vars(week).items() if hasattr(value, ATTRIBUTE)]
    assert 12 == len(tests)
    assert {name.removeprefix("test_") for name in tests} == WORSE.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", WORSE)
def test_tests_pass_for_the_product_and_fail_for_a_worse_robot(week, name):
    function = getattr(week, f"test_{name}")
    claim = getattr(function, ATTRIBUTE)

    good = run_claim(claim, function)
    assert good.holds, [failure.text for trial in good.failed for failure in trial.failures]

    worse = replace(claim, overrides=(*claim.overrides, *WORSE[name]))
    bad = run_claim(worse, function)
    assert not bad.holds


SCENARIOS = sorted(set(FOLDER.glob("*.yaml")) - {FOLDER / "home.yaml"})
HOMES = range(10)
MUTANTS = {
    "change_night": ["VisitTwice", "VisitNextRoom"],
    "change_night_spring": [],  # the same, on another night
    "call": ["ComeLate", "ComeToNextRoom", "ComeAndGo"],
    "find": ["FindOther", "FindLate", "FindTooNear", "FindFromAfar"],
    "follow": ["FollowOther", "FollowTooNear", "FollowShortly"],
    "night_patrol": ["PatrolLate", "PatrolAnytime"],
    "keep_out": ["PatrolNextRooms", "PatrolWithoutAvoiding"],
    "low_battery": ["DockLate", "DockShortly"],
    "guest": ["GreetAnybody", "GreetTooNear", "GreetAgain"],
    "fall_alarm": ["FindOther", "FindRarely"],
    "medicine": ["VisitLate", "VisitNextRoom", "VisitDaily"],
    "sleeping_baby": ["PatrolAnytime", "PatrolEverywhere"],
    "power_cut": ["AskLate", "AskWithoutSeeking"],
    "update_night": ["VisitLate", "VisitNextRoom"],
}


def verdicts(scenario, home, *changes) -> dict[str, Verdict]:
    floorplan = f"floorplan={{type: synthetic, seed: {home}, furnish: true}}"
    quiet = ["artifacts.trajectories=off", "artifacts.checkpoint=off"]
    simulation = fleet2d.Simulation(FOLDER / f"{scenario}.yaml", floorplan, *quiet, *changes)
    simulation.run()
    return simulation.verdicts()


TWO_ROBOTS = sorted((FOLDER / "two_robots").glob("*.yaml"))


@pytest.mark.parametrize("path", TWO_ROBOTS, ids=lambda path: path.stem)
def test_each_scenario_of_two_robots_holds_and_fails_for_ghosts(path):

    def failed(home, *changes):
        floorplan = f"floorplan={{type: synthetic, seed: {home}, furnish: true}}"
        simulation = fleet2d.Simulation(path, floorplan, "artifacts.trajectories=off", *changes)
        simulation.run()
        return [str(verdict) for verdict in simulation.verdicts().values() if not verdict.holds]

    for home in HOMES if THOROUGH else [0]:
        assert [] == failed(home), home
    # In some homes the two never meet, even as ghosts.
    assert any(failed(home, "simulation.ghosts=true") for home in HOMES)


def test_there_are_ten_scenarios_of_two_robots_of_at_most_twenty_lines():
    assert 10 == len(TWO_ROBOTS)
    assert max(len(path.read_text().splitlines()) for path in TWO_ROBOTS) <= 20


def test_scenarios_are_of_at_most_twenty_lines_and_twenty_mutants():
    assert sorted(MUTANTS) == [path.stem for path in SCENARIOS]
    assert max(len(path.read_text().splitlines()) for path in SCENARIOS) <= 20
    assert len({name for names in MUTANTS.values() for name in names}) >= 20


@pytest.mark.slow
@pytest.mark.parametrize("home", HOMES if THOROUGH else [0, 4])
@pytest.mark.parametrize("scenario", MUTANTS)
def test_each_scenario_holds_in_ten_homes(scenario, home):
    assert [] == [
        str(verdict) for verdict in verdicts(scenario, home).values() if not verdict.holds
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "mutant"),
    some([(name, mutant) for name, mutants in MUTANTS.items() for mutant in mutants], 2),
)
def test_each_mutant_is_caught_in_one_of_the_homes(scenario, mutant):
    content = read_document(FOLDER / f"{scenario}.yaml").data
    behavior = content["robots"]["astro"]["behaviors"][0]
    behavior["type"] = f"{Path(__file__).parent.as_posix()}/mutants:{mutant}"
    change = f"robots.astro.behaviors.0={json.dumps(behavior)}"

    assert any(
        verdict.fails for home in HOMES for verdict in verdicts(scenario, home, change).values()
    )
