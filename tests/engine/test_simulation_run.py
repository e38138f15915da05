"""Whole runs, and running a stored run again."""

import json
import shutil

import pyarrow.parquet as pq
import pytest
from tests.scenes import TESTS, everything, scenario, write_flat

import fleet2d
from fleet2d.errors import RunDirectoryError


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A run with every behavior in a directory."""
    directory = tmp_path_factory.mktemp("stored") / "run"
    fleet2d.run(everything("20 min"), out=directory)
    return directory


def test_a_stored_run_is_reproduced(stored):
    result = fleet2d.reproduce(stored)
    assert result.same
    assert ([], []) == (result.differing, result.causes)
    assert fleet2d.open_run(stored).digest == result.digest


def test_the_order_of_keys_is_kept_for_who_repeats_a_run(tmp_path):
    """Manifests had sorted keys: people who weren't listed by name lived another life."""
    shares = {"kitchen": 0.3, "bedroom": 0.3, "away": 0.2, "bathroom": 0.2}
    sampled = {"type": "room_sampling", "shares": shares, "dwell": "3 min"}
    users = {"zoe": sampled, "ben": sampled, "ana": {"type": "meander"}}
    stored = fleet2d.run(scenario("1 h", users=users), out=tmp_path / "run")
    result = fleet2d.reproduce(tmp_path / "run")
    by_name = {**sampled, "shares": dict(sorted(shares.items()))}
    other = fleet2d.run(
        scenario("1 h", users={"ana": users["ana"], "ben": by_name, "zoe": by_name})
    )

    assert ([], stored.digest) == (result.differing, result.digest)
    assert ["zoe", "ben", "ana"] == list(stored.manifest["scenario"]["users"])
    assert other.digest != stored.digest


def test_reproducing_leaves_the_run_as_it_was(stored):
    before = {path.name: path.read_bytes() for path in stored.iterdir()}
    fleet2d.reproduce(stored)
    assert before == {path.name: path.read_bytes() for path in stored.iterdir()}


def test_a_manifest_with_another_seed_is_not_reproduced(stored, tmp_path):
    copy = shutil.copytree(stored, tmp_path / "copy")
    manifest = json.loads((copy / "manifest.json").read_text())
    manifest["scenario"]["simulation"]["seed"] = 5
    (copy / "manifest.json").write_text(json.dumps(manifest))
    result = fleet2d.reproduce(copy)
    assert not result.same
    assert {"trajectories", "observations"} <= set(result.differing)


def test_a_table_that_was_changed_is_not_reproduced(stored, tmp_path):
    copy = shutil.copytree(stored, tmp_path / "copy")
    file = copy / "observations.parquet"
    rows = pq.read_table(file)
    pq.write_table(rows.slice(1), file)
    result = fleet2d.reproduce(copy)
    assert not result.same
    assert ["observations"] == result.differing
    (cause,) = result.causes
    assert "observations" in cause
    assert "changed" in cause


@pytest.mark.slow
def test_a_paced_run_is_reproduced_as_fast_as_possible(tmp_path, monkeypatch):
    content = scenario("5 min", users={"ana": {"type": "meander"}})
    fleet2d.run(content, out=tmp_path / "run", speedup=200)
    monkeypatch.setattr("fleet2d.engine.loop.Pace", None)  # which nobody may ask for
    assert fleet2d.reproduce(tmp_path / "run").same


def test_an_input_that_changed_is_named(tmp_path):
    plan = write_flat(tmp_path)
    content = scenario(robots={"astro": {"type": "patrol"}})
    content["floorplan"]["path"] = str(plan)
    fleet2d.run(content, out=tmp_path / "run")
    document = json.loads(plan.read_text())
    document["rooms"].pop(1)
    plan.write_text(json.dumps(document))
    result = fleet2d.reproduce(tmp_path / "run")
    assert not result.same
    (cause,) = result.causes
    assert "flat.json" in cause
    assert "changed" in cause


def test_an_input_that_is_gone_is_named(tmp_path):
    plan = write_flat(tmp_path)
    content = scenario(robots={"astro": {"type": "patrol"}})
    content["floorplan"]["path"] = str(plan)
    fleet2d.run(content, out=tmp_path / "run")
    plan.unlink()
    with pytest.raises(RunDirectoryError, match=r"flat\.json.*missing"):
        fleet2d.reproduce(tmp_path / "run")


def test_a_component_that_is_gone_is_named(tmp_path):
    module = tmp_path / "mine.py"
    module.write_text((TESTS / "own_components.py").read_text())
    content = scenario(algorithms={"share": {"type": f"{tmp_path.as_posix()}/mine:Share"}})
    fleet2d.run(content, out=tmp_path / "run")
    module.unlink()
    with pytest.raises(RunDirectoryError, match=r"mine\.py.*missing"):
        fleet2d.reproduce(tmp_path / "run", trust=True)


def test_only_a_complete_run_can_be_reproduced(tmp_path):
    simulation = fleet2d.Simulation(
        scenario(users={"ana": {"type": "meander"}}), out=tmp_path / "run"
    )
    simulation.advance(10)
    simulation.finish()
    with pytest.raises(RunDirectoryError, match="interrupted"):
        fleet2d.reproduce(tmp_path / "run")


def test_what_is_no_run_is_refused(tmp_path):
    with pytest.raises(RunDirectoryError, match=r"manifest\.json"):
        fleet2d.reproduce(tmp_path)
    with pytest.raises(RunDirectoryError, match="does not exist"):
        fleet2d.reproduce(tmp_path / "nothing")


def test_arguments_change_the_scenario():
    content = scenario(users={"ana": {"type": "meander"}})
    stored = fleet2d.run(content, "simulation.duration=2 min", seed=9)
    assert (120, 9) == (stored.manifest["steps"], stored.manifest["seed"])


def test_a_scenario_that_was_loaded_runs_as_its_source_does():
    content = everything("5 min")
    loaded = fleet2d.load_scenario(content)
    assert fleet2d.run(content).digest == fleet2d.run(loaded).digest == fleet2d.run(loaded).digest
