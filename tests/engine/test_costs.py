"""Costs in runs: robots keep out of where no way leads, and follow costs that change."""

import copy
import json
from datetime import timedelta

import pytest
import shapely
from tests.scenes import TESTS, digests, flat_document, path, run, scenario

from fleet2d import Algorithm, Behavior
from fleet2d.engine.simulation import Simulation
from fleet2d.errors import InputError
from fleet2d.runs.layers import read_layer

HERE = f"{TESTS.as_posix()}/engine/test_costs"
RUG = shapely.box(2.8, 2.3, 4.2, 3.9)  # between most of the living room and the kitchen
TOUR = {"type": "patrol", "waypoints": [[1.0, 3.0], [7.0, 3.0]], "dwell": "5 s"}


class Bar(Algorithm):
    """Shuts the kitchen to robots from its first update on, and opens it at its fourth."""

    def start(self, home):
        self.costs = home.layers["costmap"]
        self.kitchen = home.plan.room_of_cell == home.plan.room("kitchen_1").index
        self.updates = 0

    def update(self, history, state):
        self.updates += 1
        self.costs.values[self.kitchen] = 0 if self.updates >= 4 else -1


def flat_with_a_rug(folder, costmap, **more):
    document = flat_document()
    document["no_go"] = [[list(c) for c in RUG.exterior.coords[:-1]]]
    (folder / "rug.json").write_text(json.dumps(document))
    robot = {**TOUR, "start": [1.0, 3.0]}
    content = scenario("20 min", robots={"astro": robot}, artifacts={"trajectories": "every step"})
    content["floorplan"] = {"type": "native", "path": f"{folder}/rug.json", "costmap": costmap}
    return {**content, **more}


def on_the_rug(stored, name="astro", margin=0.0):
    poses = path(stored, name)
    return shapely.contains_xy(RUG.buffer(margin), poses.x, poses.y)


def test_robot_crosses_a_no_go_area_only_without_a_costmap(tmp_path):
    without, forbidden, dear = (
        run(flat_with_a_rug(tmp_path, costmap))
        for costmap in (None, {}, {"no_go": "cost", "clearance": 0, "no_go_cost": 5})
    )

    assert on_the_rug(without).sum() > 50
    assert not on_the_rug(forbidden, margin=0.15).any()  # nor does its body touch it
    assert path(forbidden, "astro").x.max() > 6.9  # it gets there all the same
    assert on_the_rug(dear).sum() > 50


def test_spots_that_are_drawn_in_a_room_are_never_where_no_way_leads(tmp_path):
    robot = {"type": "patrol", "rooms": ["living_room"], "dwell": "1 s", "start": [1, 3]}
    spots = {"type": f"{TESTS.as_posix()}/engine/test_costs:Hop", "start": [1, 3]}
    content = flat_with_a_rug(tmp_path, {}, robots={"astro": spots, "bolt": {**robot}})

    stored = run(content)
    assert not on_the_rug(stored).any()
    assert not on_the_rug(stored, "bolt").any()


def test_users_walk_where_robots_may_not(tmp_path):
    user = {"type": f"{HERE}:Hop", "start": [1, 3]}
    content = flat_with_a_rug(tmp_path, {}, users={"ana": user}, robots={})

    assert on_the_rug(run(content), "ana").any()


@pytest.mark.slow
def test_robot_follows_costs_that_an_algorithm_changes(tmp_path):
    bar = {"bar": {"type": f"{HERE}:Bar", "period": "5 min"}}
    content = flat_with_a_rug(tmp_path, {}, algorithms=bar)
    content["robots"]["astro"] = {"type": f"{HERE}:Hop", "start": [1.0, 3.0]}
    content["simulation"]["duration"] = "30 min"
    stored = run(content)
    poses = path(stored, "astro")
    in_kitchen = (poses.x > 5.2) & (poses.y < 3.9)
    there = [bool(in_kitchen[minute * 60 : (minute + 4) * 60].any()) for minute in (1, 8, 12, 21)]

    assert [True, False, False, True] == there
    assert digests(stored) == digests(run(content, max_span=7))
    simulation = Simulation(content)
    simulation.run_until(timedelta(minutes=7))
    twin = copy.deepcopy(simulation)
    assert stored.digest == twin.run().digest == simulation.run().digest


def test_patrol_leaves_out_what_costs_close_and_waits_where_nothing_is_left(tmp_path):
    bar = {"bar": {"type": f"{HERE}:Bar", "period": "5 min"}}
    only = {"type": "patrol", "waypoints": [[7.0, 3.0]], "dwell": "5 s", "start": [7, 3]}
    content = flat_with_a_rug(tmp_path, {}, algorithms=bar)
    content["robots"] = {"astro": {**TOUR, "start": [1.0, 3.0]}, "bolt": only}
    content["simulation"]["duration"] = "25 min"
    stored = run(content)
    xs = path(stored, "astro").x
    there = [bool((xs[m * 60 : (m + 4) * 60] > 6.9).any()) for m in (1, 10, 21)]

    assert [True, False, True] == there
    assert 0.9 < xs[10 * 60 : 14 * 60].min() < 1.1
    assert len(xs) == 25 * 60


def test_costmap_is_stored_when_the_scenario_asks_for_it(tmp_path):
    content = flat_with_a_rug(tmp_path, {"clearance": "40 cm"})
    content["floorplan"]["layers"] = {"costmap": {}}
    stored = run(content)
    costs = read_layer(stored, "costmap")

    assert -1 == costs[stored.plan.lattice.cell_of(*stored.plan.lattice.to_lattice((3.5, 3)))]
    assert 0 == costs[stored.plan.lattice.cell_of(*stored.plan.lattice.to_lattice((1.5, 3)))]
    assert 150 < costs[stored.plan.free].max() <= 200


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"robots": {"astro": {**TOUR, "waypoints": [[3.5, 3], [1, 3]]}}}, "costmap lets no route"),
        ({"robots": {"astro": {"start": [3.5, 3.0]}}}, "costmap lets no route pass"),
    ],
)
def test_place_where_no_way_leads_is_an_error_that_says_so(tmp_path, change, why):
    with pytest.raises(InputError, match=why):
        Simulation(flat_with_a_rug(tmp_path, {}, **change))


def test_costmap_that_leaves_no_place_is_an_error(tmp_path):
    document = flat_document()
    document["no_go"] = [[[-1, -1], [20, -1], [20, 20], [-1, 20]]]
    (tmp_path / "all.json").write_text(json.dumps(document))
    content = flat_with_a_rug(tmp_path, {})
    content["floorplan"]["path"] = f"{tmp_path}/all.json"
    with pytest.raises(InputError, match="leave it a place to be"):
        Simulation(content)


class Hop(Behavior):
    """From spot to spot in any room."""

    def decide(self, now):
        return now.plan().go_to("any", "hop").stay(timedelta(seconds=2))
