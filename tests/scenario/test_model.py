"""Loading a scenario: defaults, short forms, the resolved dump."""

import copy
import json
from datetime import date, datetime, timedelta
from pathlib import Path

import pytest

from fleet2d.errors import ScenarioError
from fleet2d.scenario.load import load_scenario
from fleet2d.scenario.model import SimulationSettings

pytestmark = pytest.mark.usefixtures("stand_ins")

HOME = """\
simulation: {start: 2026-01-05, duration: {days: 30}, step: 1 s, seed: 4}
floorplan: {type: houseexpo, path: plan.json}
users:
  ana: {type: tour, radius: 30 cm, stops: [kitchen, hall]}
  ben: {behaviors: [drift, {type: tour, dwell: 1 h}]}
robots:
  astro: drift
algorithms:
  count: {margin: 95 %}
  calm: {type: smooth, inner: {type: own:Own}}
metrics:
  tally: {of: count}
"""
OWN = """
from typing import ClassVar
from fleet2d.configuration.components import Component

class Own(Component):
    kind: ClassVar[str] = "algorithm"
"""


@pytest.fixture
def home(tmp_path, monkeypatch):
    folder = tmp_path / "homes"
    folder.mkdir()
    (folder / "home.yaml").write_text(HOME)
    (folder / "own.py").write_text(OWN)
    (folder / "plan.json").touch()
    monkeypatch.chdir(tmp_path)
    return folder / "home.yaml"


def simulation(**settings):
    return SimulationSettings.model_validate({"duration": "1 h", **settings})


def said(source, *overrides, **settings):
    with pytest.raises(ScenarioError) as caught:
        load_scenario(source, *overrides, **settings)
    return str(caught.value)


def test_run_stops_at_the_last_full_step():
    assert 3 == simulation(duration="10 s", step="3 s").steps
    assert 3600 == simulation().steps


@pytest.mark.parametrize("start", [date(2026, 1, 5), "2026-01-05", "2026-01-05T00:00"])
def test_start_is_a_date_or_a_date_and_time(start):
    assert datetime(2026, 1, 5) == simulation(start=start).start


def test_loaded_scenario_is_what_the_file_says(home):
    scenario = load_scenario(home)

    bodies = scenario.users | scenario.robots
    behaviors = {name: [b.type_name for b in body.behaviors] for name, body in bodies.items()}
    assert {"ana": ["tour"], "ben": ["drift", "tour"], "astro": ["drift"]} == behaviors
    assert timedelta(days=30) == scenario.simulation.duration
    assert datetime(2026, 1, 5) == scenario.simulation.start
    assert 0.3 == scenario.users["ana"].radius
    assert "tally" == scenario.metrics["tally"].type_name
    assert home.parent == scenario.folder


def test_relative_paths_start_from_the_file_and_dump_as_absolute(home):
    assert (
        str(home.parent / "plan.json")
        == load_scenario("homes/home.yaml").resolved()["floorplan"]["path"]
    )


def test_resolved_scenario_reloads_to_an_equal_one(home, tmp_path, monkeypatch):
    scenario = load_scenario(home)
    resolved = json.loads(json.dumps(scenario.resolved()))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    again = load_scenario(resolved)

    assert scenario == again
    assert resolved == again.resolved()
    assert scenario == copy.deepcopy(scenario)


def test_scenario_is_a_source_too(home):
    scenario = load_scenario(home)
    changed = load_scenario(scenario, "users.ana=null", seed=5, name="night")

    assert scenario is load_scenario(scenario)
    assert (5, "night", ["ben"]) == (changed.simulation.seed, changed.name, list(changed.users))
    assert home.parent == changed.folder


def test_keywords_are_simulation_settings_and_sections(home):
    scenario = load_scenario(
        home, "simulation.seed=1", seed=2, duration=timedelta(hours=1), robots=None
    )

    assert (2, 3600) == (scenario.simulation.seed, scenario.simulation.steps)
    assert {} == scenario.robots


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (["simulation.step=2 h", "simulation.duration=1 h"],
         "simulation.duration: 1 h is shorter than one step, 2 h"),
        (["simulation.start=2026-01-05T00:00:00Z"], "simulation.start: expected a local time without"
         " a time zone, since a simulated day has 24 hours, got 2026-01-05T00:00:00+00:00"),
        (["simulation.start=20260105"],
         "simulation.start: expected a date and time like 2026-01-05T08:00, got 20260105"),
        (["simulation.start=2026-02-31"], "simulation.start: expected a date and time like "),
        (["simulation.seed=-1"], "simulation.seed: expected 0 or more, got -1"),
        (["simulation.max_span=0"], "simulation.max_span: expected 1 or more, got 0"),
        (["simulation.speedup=0"], "simulation.speedup: expected 0.001 or more, got 0"),
        (["simulation.speedup=.inf"], "simulation.speedup: expected a finite number, got inf"),
        (["users.9x=drift"], "users.9x: the name '9x' must be letters"),
        (["robots.ana=drift"], "robots.ana: there is a user named 'ana' already"),
        (["users.unknown=drift"], "users.unknown: there is a word for people named 'unknown' already"),
        (["users.anyone=drift"], "users.anyone: there is a word for people named 'anyone' already: choose"),
        (["floorplan=null"], "floorplan: missing, and has no default"),
        (["floorplan.path=gone.json"], "floorplan.path: no such file"),
        (["users.ana.sped=1"], "users.ana.sped: unknown key 'sped': did you mean 'speed'? Allowed "
         "here: answers, camera, color, "),
        (["users.ana.stops=hall"], "users.ana.stops: expected a list, got 'hall'"),
        (["users.ana.speed=fast"], "users.ana.speed: expected a speed, got 'fast': write a number in"),
        (["users.ana.type=wander"], "users.ana.type: there is no behavior 'wander'"),
        (["users.ben.behaviors.1.dwell=1 parsec"],
         "users.ben.behaviors.1.dwell: unknown unit 'parsec' in '1 parsec'"),
        (["algorithms.count.margin=2"], "algorithms.count.margin: expected a share from 0 to"),
        (["algorithms.calm.inner.type=own:Gone"], "algorithms.calm.inner.type: can't import"),
        (["algorithms.calm.inner=count"], None),
        (["metrics.other={of: count}"], "metrics.other: there is no metric 'other'"),
        (["artifacts.events=maybe"], "artifacts.events: expected true or false, got 'maybe'"),
        (["sumulation.seed=1"], "sumulation: unknown key 'sumulation': did you mean 'simulation'?"),
    ],
)  # fmt: skip
def test_override_error_says_where_and_what(home, overrides, line):
    if line is None:
        assert load_scenario(home, *overrides)
    else:
        assert f"override '{overrides[-1]}': {line}" in said(home, *overrides)


def test_all_errors_of_a_file_are_told_with_their_lines(home):
    home.write_text(HOME.replace("30 cm", "wide").replace("margin: 95 %", "margn: 1"))

    assert said("homes/home.yaml").splitlines() == [
        "homes/home.yaml:4: users.ana.radius: expected a length, got 'wide': write a number in m, or "
        "like '0.2 m', '20 cm', '5 mm'",
        "homes/home.yaml:9: algorithms.count.margn: unknown key 'margn': did you mean 'margin'? "
        "Allowed here: margin",
    ]


def test_unknown_keyword_is_refused(home):
    assert "unknown argument 'sed': did you mean 'seed'? There are: start," in said(home, sed=3)


def test_empty_scenario_names_what_is_missing():
    assert said({}).splitlines() == [
        "simulation: missing, and has no default",
        "floorplan: missing, and has no default",
    ]


def test_where_says_where_a_key_was_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("home.yaml").write_text(
        "simulation: {duration: 1 h}\nfloorplan: empty\nusers:\n  ana:\n    type: tour\n"
        "    stops:\n      - hall\n      - attic\n  ben:\n    behaviors:\n      - drift\n"
        "      - type: tour\n        stops: [hall]\n"
    )
    scenario = load_scenario("home.yaml", "robots.astro=drift")

    assert "home.yaml:8" == scenario.where("users.ana.stops.1")
    assert "home.yaml:8" == scenario.where("users.ana.behaviors.0.stops.1")
    assert "home.yaml:4" == scenario.where("users.ana.radius")
    assert "home.yaml:13" == scenario.where("users.ben.behaviors.1.stops.0")
    assert "override 'robots.astro=drift'" == scenario.where("robots.astro.speed")
    assert "" == load_scenario(scenario.resolved()).where("users.ana")
