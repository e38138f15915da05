"""Homes that the runs of a process share: made once for each content, and read-only."""

import json

import pytest

import fleet2d
from fleet2d.floorplan import home as homes
from fleet2d.floorplan import source
from fleet2d.floorplan.native import HOMES
from fleet2d.floorplan.plan import HOME_FOLDER, Cache, FolderCache
from fleet2d.metrics.ltp_error import walking_distances

SHORT = "simulation.duration=6 h"


@pytest.fixture(autouse=True)
def empty_caches(monkeypatch):
    monkeypatch.setattr(source, "PLAN_CACHE", Cache(source.CACHED_PLANS))
    monkeypatch.setattr(homes, "HOME_CACHE", Cache(homes.CACHED_HOMES))


def test_value_used_least_recently_is_dropped():
    cache, calls = Cache(size=2), list[str]()
    for key in "abacb":
        cache.get(key, lambda key=key: calls.append(key))

    assert list("abcb") == calls
    assert len(cache) == 2


def test_value_that_could_not_be_made_is_not_stored():
    cache = Cache(size=2)
    with pytest.raises(ZeroDivisionError):
        cache.get("a", lambda: 1 // 0)

    assert cache.get("a", lambda: 5) == 5


def test_cache_grows_and_never_shrinks():
    cache, calls = Cache(size=1), list[str]()
    cache.grow(2)
    cache.grow(1)
    for key in "abab":
        cache.get(key, lambda key=key: calls.append(key))

    assert list("ab") == calls


def test_second_run_shares_plan_spaces_and_ratings():
    first, second = (fleet2d.Simulation("bundled:paper", SHORT, seed=seed) for seed in (4, 5))
    hangouts = [
        next(b for b in simulation.actors["astro"].behaviors if hasattr(b, "places"))
        for simulation in (first, second)
    ]

    assert first.home is not second.home
    assert first.home.plan is second.home.plan
    assert first.home.space(0.15) is second.home.space(0.15)
    assert hangouts[0].nearness is hangouts[1].nearness
    distances = [walking_distances(each.home, each.home.space(0.2)) for each in (first, second)]
    assert distances[0] is distances[1]


def test_changed_file_is_read_anew(tmp_path):
    path = tmp_path / "home.json"
    content = json.loads((HOMES / "family_home.json").read_text())
    path.write_text(json.dumps(content))

    def plan_of_a_run():
        at = f"floorplan.path={path}"
        return fleet2d.Simulation(
            "bundled:paper", "floorplan.type=native", at, SHORT, seed=4
        ).home.plan

    first, again = plan_of_a_run(), plan_of_a_run()
    path.write_text(json.dumps({**content, "name": "another"}))
    changed = plan_of_a_run()

    assert first is again
    assert (first.name, changed.name) == ("family_home", "another")


def test_shared_arrays_are_read_only():
    simulation = fleet2d.Simulation("bundled:paper", SHORT, seed=4)
    plan, space = simulation.home.plan, simulation.home.space(0.15)
    hangout = next(b for b in simulation.actors["astro"].behaviors if hasattr(b, "places"))
    shared = [
        plan.free, plan.room_of_cell, plan.room_of_place, plan.mesh.vertices, space.part_of_cell,
        space.cells(), space.cells(2), hangout.nearness, hangout.places.points,
        hangout.places.room, hangout.places.block, hangout.places.prox,
        walking_distances(simulation.home, simulation.home.space(0.2)),
    ]  # fmt: skip

    assert [False] * len(shared) == [array.flags.writeable for array in shared]
    assert isinstance(plan.polygons, tuple)


def test_run_is_the_same_whatever_ran_before_in_its_home():
    alone = fleet2d.run("bundled:paper", SHORT, seed=4).digest
    simulation = fleet2d.Simulation("bundled:paper", SHORT, seed=7)
    simulation.home.use_room_as(simulation.home.rooms[0], "office")
    simulation.home.layers.add("dust").values[:] = 5
    simulation.home.objects = simulation.home.objects[:-1]
    simulation.home.version += 1
    simulation.run()

    assert alone == fleet2d.run("bundled:paper", SHORT, seed=4).digest


def test_a_folder_shares_a_home_among_processes_and_changes_no_run(tmp_path, monkeypatch):
    home = {"type": "synthetic", "seed": 3, "furnish": True}
    alone = fleet2d.run("bundled:paper", SHORT, seed=4, floorplan=home).digest
    digests = []
    for _ in range(2):  # with memories as empty as those of two processes
        monkeypatch.setattr(source, "PLAN_CACHE", Cache(source.CACHED_PLANS))
        with HOME_FOLDER.within(tmp_path):
            digests.append(fleet2d.run("bundled:paper", SHORT, seed=4, floorplan=home).digest)
        # Neither the home nor its spaces and walls are made again.
        monkeypatch.setattr(source, "place_furniture", None)
        monkeypatch.setattr(homes, "shape_space", None)
        monkeypatch.setattr(homes, "build_mesh", None)

    assert [alone, alone] == digests


def test_a_damaged_or_missing_folder_is_no_error(tmp_path):
    cache = FolderCache()
    with cache.within(tmp_path):
        cache.get("a", lambda: 1)
        (file,) = tmp_path.iterdir()
        file.write_bytes(b"not a plan")
        assert 2 == cache.get("a", lambda: 2)
    with cache.within(tmp_path / "nowhere"):
        assert 3 == cache.get("a", lambda: 3)
