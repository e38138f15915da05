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
    before = {path.name: path.read_bytes() for path in stored.iterdir()}
    result = fleet2d.reproduce(stored)
    assert result.same
    assert ([], []) == (result.differing, result.causes)
    assert fleet2d.open_run(stored).digest == result.digest
    assert before == {path.name: path.read_bytes() for path in stored.iterdir()}


def test_the_order_of_keys_is_kept_for_who_repeats_a_run(tmp_path):
    """Manifests had sorted keys: people who weren't listed by name lived another life."""
    shares = {"kitchen": 0.3, "bedroom": 0.3, "away": 0.2, "bathroom": 0.2}
    sampled = {"type": "room_sampling", "shares": shares, "dwell": "3 min"}
    users = {"zoe": sampled, "ben": sampled, "ana": {"type": "meander"}}
    stored = fleet2d.run(scenario("1 h", users=users), out=tmp_path / "run")
    result = fleet2d.reproduce(tmp_path / "run")

    assert ([], stored.digest) == (result.differing, result.digest)
    assert ["zoe", "ben", "ana"] == list(stored.manifest["scenario"]["users"])
    assert list(shares) == list(
        stored.manifest["scenario"]["users"]["zoe"]["behaviors"][0]["shares"]
    )


def test_a_manifest_with_another_seed_is_not_reproduced(stored, tmp_path):
    copy = shutil.copytree(stored, tmp_path / "copy")
    manifest = json.loads((copy / "manifest.json").read_text())
    manifest["scenario"]["simulation"]["seed"] = 5
    (copy / "manifest.json").write_text(json.dumps(manifest))
    result = fleet2d.reproduce(copy)
    assert not result.same
    assert {"trajectories", "observations"} <= set(result.differing)


def test_fields_of_a_changed_manifest_are_named(stored, tmp_path):
    """Each key of a field that has keys, and the notes but for those on speed."""
    copy = shutil.copytree(stored, tmp_path / "copy")
    manifest = json.loads((copy / "manifest.json").read_text())
    manifest["steps"] += 1
    manifest["entities"]["users"].reverse()
    manifest["metrics"]["mine"] = 3
    manifest["notes"] += ["ana walks on water"]
    (copy / "manifest.json").write_text(json.dumps(manifest))
    result = fleet2d.reproduce(copy)
    assert not result.same
    assert {"steps", "entities.users", "metrics.mine", "notes"} <= set(result.differing)


def test_a_component_that_is_gone_is_named(tmp_path):
    module = tmp_path / "mine.py"
    module.write_text((TESTS / "own_components.py").read_text())
    content = scenario(algorithms={"share": {"type": f"{tmp_path.as_posix()}/mine:Share"}})
    fleet2d.run(content, out=tmp_path / "run")
    module.unlink()
    with pytest.raises(RunDirectoryError, match=r"mine\.py.*missing"):
        fleet2d.reproduce(tmp_path / "run", trust=True)


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


def test_an_input_that_is_gone_is_named(tmp_path):
    plan = write_flat(tmp_path)
    content = scenario(robots={"astro": {"type": "patrol"}})
    content["floorplan"]["path"] = str(plan)
    fleet2d.run(content, out=tmp_path / "run")
    plan.unlink()
    with pytest.raises(RunDirectoryError, match=r"flat\.json.*missing"):
        fleet2d.reproduce(tmp_path / "run")


def test_only_a_complete_run_can_be_reproduced(tmp_path):
    simulation = fleet2d.Simulation(
        scenario(users={"ana": {"type": "meander"}}), out=tmp_path / "run"
    )
    simulation.advance(10)
    simulation.finish()
    places = {"run": "interrupted", "": r"manifest\.json", "nothing": "does not exist"}
    for name, words in places.items():
        with pytest.raises(RunDirectoryError, match=words):
            fleet2d.reproduce(tmp_path / name)
