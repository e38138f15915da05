"""A behavior whose keys change in mid-run starts anew with them; everything before stays the same."""

import copy
from datetime import timedelta

import pytest

import fleet2d
from fleet2d.engine.access import interventions_of
from fleet2d.errors import PlacementError, ScenarioError
from fleet2d.interventions import Configure


def simulation():
    return fleet2d.Simulation("bundled:paper", "simulation.duration=10 h", seed=4)


def test_changed_key_changes_what_follows_and_nothing_before():
    changed = simulation()
    changed.advance(6 * 3600)
    plain = copy.deepcopy(changed)
    changed.do(
        Configure(
            "astro", "hangout", {"no_stops_in": ["bathroom", "living_room"], "period": "10 min"}
        )
    )
    paths = [run.run().path("astro") for run in (changed, plain)]
    same = paths[0].x == paths[1].x
    assert same[: 6 * 60].all()
    assert not same.all()


def test_configured_run_is_saved_and_loaded(tmp_path):
    run = simulation()
    run.advance(3600)
    run.do(Configure("astro", "hangout", {"tau": "10 min"}))
    run.advance()
    run.save(tmp_path / "saved")
    loaded = fleet2d.Simulation.load(tmp_path / "saved")
    assert timedelta(minutes=10) == loaded.actors["astro"].behaviors[1].tau
    assert loaded.run().digest == run.run().digest


def test_another_type_takes_the_place_of_a_behavior_with_its_own_keys_alone(tmp_path):
    run = simulation()
    run.advance(3600)
    run.do(Configure("astro", "hangout", {"type": "patrol", "dwell": "3 min"}))
    run.advance()
    run.save(tmp_path / "saved")
    loaded = fleet2d.Simulation.load(tmp_path / "saved")
    assert ["patrol", "patrol"] == [b.type_name for b in loaded.actors["astro"].behaviors[:2]]
    assert timedelta(minutes=3) == loaded.actors["astro"].behaviors[1].dwell  # type: ignore[attr-defined]
    assert loaded.run().digest == run.run().digest


@pytest.mark.parametrize(
    ("behavior", "keys", "error", "words"),
    [
        ("hangout", {"type": "patrl"}, ScenarioError, "did you mean 'patrol'"),
        ("hangout", {"type": "patrol", "tau": "3 s"}, ScenarioError, "unknown key 'tau'"),
        ("hangot", {"tau": "3 s"}, ScenarioError, "did you mean 'hangout'"),
        ("hangout", {"tao": 3}, ScenarioError, "did you mean 'tau'"),
        ("hangout", {"source": "lpt"}, ScenarioError, "did you mean 'ltp'"),
        ("hangout", {"no_stops_in": ["bethroom"]}, PlacementError, "did you mean 'bathroom'"),
        ("hangout", {}, ScenarioError, "at least 1"),
    ],
)
def test_wrong_keys_are_refused_and_nothing_is_recorded(behavior, keys, error, words):
    run = simulation()
    with pytest.raises(error, match=words):
        run.do(Configure("astro", behavior, keys))
    assert [] == interventions_of(run)
