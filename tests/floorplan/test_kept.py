"""Homes that runs of one process share: made once, by content, and changed by nobody."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fleet2d
from fleet2d.floorplan import source
from fleet2d.floorplan.formats.bundled import HOMES
from fleet2d.floorplan.home import home as homes
from fleet2d.floorplan.kept import Kept
from fleet2d.metrics.presence.occupancy import walking_distances

SHORT = "simulation.duration=6 h"


@pytest.fixture(autouse=True)
def nothing_kept() -> None:
    source._PLANS.clear()
    homes._SHAPES.clear()


def test_value_asked_for_longest_ago_is_dropped() -> None:
    kept, made = Kept(most=2), list[str]()
    for key in "abacb":
        kept.get(key, lambda key=key: made.append(key))

    assert list("abcb") == made
    assert len(kept) == 2


def test_what_fails_is_not_kept() -> None:
    kept = Kept(most=2)
    with pytest.raises(ZeroDivisionError):
        kept.get("a", lambda: 1 // 0)

    assert kept.get("a", lambda: 5) == 5


def test_it_keeps_more_when_told_to_and_never_fewer() -> None:
    kept, made = Kept(most=1), list[str]()
    kept.keep(2)
    kept.keep(1)
    for key in "abab":
        kept.get(key, lambda key=key: made.append(key))

    assert list("ab") == made


def test_second_run_shares_plan_spaces_and_ratings() -> None:
    first, second = (fleet2d.Simulation(None, SHORT, seed=seed) for seed in (4, 5))
    hangouts = [
        next(b for b in simulation.actors["astro"].behaviors if hasattr(b, "places"))
        for simulation in (first, second)
    ]

    assert first.home is not second.home
    assert first.home.plan is second.home.plan
    assert first.home.space(0.15) is second.home.space(0.15)
    assert hangouts[0].nearness is hangouts[1].nearness
    assert walking_distances(first.home) is walking_distances(second.home)


def test_changed_file_is_read_anew(tmp_path: Path) -> None:
    path = tmp_path / "home.json"
    content: dict[str, Any] = json.loads((HOMES / "family_home.json").read_text())
    path.write_text(json.dumps(content))
    at = f"floorplan.path={path}"
    first = fleet2d.Simulation(None, "floorplan.type=native", at, SHORT, seed=4).home.plan
    again = fleet2d.Simulation(None, "floorplan.type=native", at, SHORT, seed=4).home.plan
    path.write_text(json.dumps({**content, "name": "another"}))
    changed = fleet2d.Simulation(None, "floorplan.type=native", at, SHORT, seed=4).home.plan

    assert first is again
    assert (first.name, changed.name) == ("family_home", "another")


def test_what_is_shared_is_read_only() -> None:
    simulation = fleet2d.Simulation(None, SHORT, seed=4)
    plan, space = simulation.home.plan, simulation.home.space(0.15)
    hangout: Any = next(b for b in simulation.actors["astro"].behaviors if hasattr(b, "places"))
    shared: list[np.ndarray[Any, Any]] = [
        plan.free, plan.room_of_cell, plan.room_of_place, plan.mesh.vertices, space.part_of_cell,
        space.cells(), space.cells(2), hangout.nearness, hangout.places.points,
        hangout.places.room, hangout.places.block, hangout.places.prox,
        walking_distances(simulation.home),
    ]  # fmt: skip

    assert [False] * len(shared) == [array.flags.writeable for array in shared]
    assert isinstance(plan.polygons, tuple)


def test_run_is_the_same_whatever_ran_before_in_its_home() -> None:
    alone = fleet2d.run(None, SHORT, seed=4).digest
    simulation = fleet2d.Simulation(None, SHORT, seed=7)
    simulation.home.use_room_as(simulation.home.rooms[0], "office")
    simulation.home.layers.add("dust").values[:] = 5
    simulation.home.objects = simulation.home.objects[:-1]
    simulation.home.version += 1
    simulation.run()

    assert alone == fleet2d.run(None, SHORT, seed=4).digest


def test_floor_plans_of_one_content_keep_their_own_source() -> None:
    plans = [fleet2d.load_floorplan() for _ in range(2)]
    first, second = (fleet2d.Home(plan) for plan in plans)

    assert plans[0] == plans[1]
    assert first.space(0.15) is not second.space(0.15)  # each belongs to its own plan
    assert first.space(0.15).plan is plans[0]
