"""Routes of least cost, which keep away from walls and out of no-go areas."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from tests.scenes import flat_path

import fleet2d
from fleet2d._core import leg_cost
from fleet2d.errors import InputError
from fleet2d.floorplan.costmap import (
    CostedSpace,
    CostmapSettings,
    cells_within,
    costs_of,
    route_by_cost,
)
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.layers import LayerSettings
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import line_of_sight, locate

HALL = FloorPlan.build(
    "hall", shapely.box(0, 0, 6, 4), no_go=[shapely.box(2, 1, 4, 3), shapely.box(5, 3.5, 5.5, 4)]
)


@pytest.fixture(scope="module")
def space():
    return Home(HALL).space(0.15)


def length(way):
    return float(np.hypot(*np.diff(way, axis=0).T).sum())


def at(x, y):
    return HALL.lattice.point_at((x, y))


def cost_at(costs, *xs):
    """Return the costs at places across the middle of the hall."""
    return [int(costs[HALL.lattice.cell_of(*at(x, 2.0))]) for x in xs]


def test_cost_falls_from_walls_to_nothing_at_the_clearance():
    costs = costs_of(HALL, CostmapSettings(clearance=0.5, wall_cost=200, no_go="ignore"))
    row = cost_at(costs, 0.01, 0.13, 0.26, 0.48, 0.55, 3)

    assert row == sorted(row, reverse=True)
    assert 160 <= row[0] <= 200
    assert [0, 0] == row[-2:]
    assert 90 <= row[2] <= 110


def test_furniture_costs_as_walls_do():
    settings = CostmapSettings(clearance=0.5, wall_cost=200, no_go="ignore")
    costs = costs_of(HALL, settings, [shapely.box(2.5, 1.5, 3.5, 2.5)])
    beside, farther, far = cost_at(costs, 3.53, 3.78, 4.2)

    assert 160 <= beside <= 200
    assert 80 <= farther <= 120
    assert 0 == far


@pytest.mark.parametrize(("no_go", "inside"), [("forbid", -1), ("cost", 500), ("ignore", 0)])
def test_no_go_areas_are_what_the_settings_say(no_go, inside):
    costs = costs_of(HALL, CostmapSettings(no_go=no_go, no_go_cost=500))  # type: ignore[arg-type]

    assert [inside] == cost_at(costs, 3.0)
    assert 1600 + 100 == pytest.approx(cells_within(HALL, HALL.no_go).sum(), abs=100)


def test_route_avoids_or_crosses_a_no_go_area_by_the_settings(space):
    a, b = at(1.0, 2.0), at(5.0, 2.0)
    area = HALL.no_go[0]
    ways = {}
    for no_go in ("forbid", "cost", "ignore"):
        costs = costs_of(HALL, CostmapSettings(no_go=no_go, clearance=0))  # type: ignore[arg-type]
        way = route_by_cost(space, costs, a, b)
        assert way is not None
        ways[no_go] = shapely.LineString(HALL.lattice.to_metres(way))
    assert shapely.intersection(ways["forbid"], area).length < 0.1
    assert ways["forbid"].length > 4.3
    assert ways["ignore"].length == pytest.approx(4.0, abs=0.05)
    assert ways["cost"].length > 4.3


def test_goal_in_a_forbidden_area_is_out_of_reach_and_a_start_there_is_left(space):
    costs = costs_of(HALL, CostmapSettings())
    inside, outside = at(3.0, 2.1), at(1.0, 2.0)

    assert route_by_cost(space, costs, outside, inside) is None
    way = route_by_cost(space, costs, inside, outside)
    assert way is not None
    assert (inside, outside) == (tuple(way[0].tolist()), tuple(way[-1].tolist()))
    assert length(way) < 1.3 * 64 / 0.05 * 3
    assert route_by_cost(space, np.full(costs.shape, -1), outside, outside) is None
    for beyond in (at(5.99, 2.0), (-50, -50)):
        assert route_by_cost(space, costs, outside, beyond) is None


def test_route_without_costs_is_nearly_the_shortest_and_one_by_cost_is_cheaper():
    plan = fleet2d.load_floorplan(flat_path())
    space = Home(plan).space(0.15)
    free = np.zeros(plan.free.shape, np.int64)
    costs = costs_of(plan, CostmapSettings(clearance=0.6, wall_cost=400))
    rng = np.random.default_rng(3)
    cheaper = 0
    for a, b in rng.choice(space.cells(None, 0), (30, 2)).tolist():
        start, goal = plan.lattice.cell_centre(*a), plan.lattice.cell_centre(*b)
        shortest, way = space.route(start, goal), route_by_cost(space, costs, start, goal)
        without_costs = length(route_by_cost(space, free, start, goal))
        assert length(shortest) - 1e-6 <= without_costs <= 1.06 * max(length(shortest), 1.0)
        legs = list(pairwise(way.tolist()))
        for (x, y), (px, py) in legs:
            assert (x, y) == (px, py) or line_of_sight(
                space.mesh, x, y, locate(space.mesh, x, y), px, py
            )
        before = sum(leg_cost(costs, *p, *q) for p, q in pairwise(shortest.tolist()))
        after = sum(leg_cost(costs, *p, *q) for p, q in legs)
        assert after <= before * 1.05  # the grid's steps lie in eight directions
        cheaper += after < 0.9 * before
    assert cheaper > 5


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"clearance": -1}, "clearance"),
        ({"wall_cost": 2000}, "wall_cost"),
        ({"no_go": "maybe"}, "no_go"),
    ],
)
def test_wrong_settings_are_an_error_that_names_the_key(settings, why):
    with pytest.raises(InputError, match=f"floorplan.costmap.{why}"):
        fleet2d.load_scenario("bundled:paper", floorplan={"type": "bundled", "costmap": settings})


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_costed_space_equals_a_search_over_its_cells(seed):
    plan = fleet2d.load_floorplan(flat_path())
    base = Home(plan).space(0.15)
    rng = np.random.default_rng(seed)
    costs = rng.integers(0, 300, plan.free.shape)
    for row, column in rng.choice(np.argwhere(plan.free), 12):  # bars across the home
        costs[row : row + 3, column : column + 40] = -1
    closed = np.argwhere(costs < 0)
    cells = [
        (row, column)
        for row, column in np.argwhere(base.part_of_cell >= 0).tolist()
        if ((closed - (row, column)) ** 2).sum(axis=1).min() > (0.15 / 0.05 + 0.5) ** 2
    ]
    # Parts are what walking from side to side reaches, the largest first.
    squares = shapely.union_all([shapely.box(c, r, c + 1, r + 1) for r, c in cells])
    parts = shapely.get_parts(squares.buffer(-0.01))

    space = CostedSpace(base, costs)

    sizes = [len(space.cells(None, number)) for number in range(space.parts)]
    assert sorted(cells) == sorted(map(tuple, np.argwhere(space.part_of_cell >= 0).tolist()))
    assert sizes == sorted(sizes, reverse=True)
    assert len(parts) == len(sizes)
    for part in parts:
        inside = [(r, c) for r, c in cells if shapely.intersects_xy(part, c + 0.5, r + 0.5)]
        assert 1 == len({space.part_of_cell[cell] for cell in inside})
    chosen = [cells[i] for i in rng.choice(len(cells), 12)]
    for (a, b), (c, d) in zip(chosen[:6], chosen[6:], strict=True):
        start, goal = plan.lattice.cell_centre(a, b), plan.lattice.cell_centre(c, d)
        way = space.route(start, goal)
        assert (space.part_at(*start) == space.part_at(*goal)) == (way is not None)
        if way is not None:
            assert (start, goal) == (tuple(way[0].tolist()), tuple(way[-1].tolist()))


def test_costed_space_is_new_only_when_costs_change():
    home = Home(fleet2d.load_floorplan(flat_path()))
    base = home.space(0.15)
    assert home.costed(base) is base
    assert 0 == home.costs_version

    layer = home.layers.add_layer("costmap", LayerSettings(dtype="int32", store=False))
    space = home.costed(base)
    layer.values[0, 0] = 0
    assert (space, 1) == (home.costed(base), home.costs_version)
    layer.values[30, 30] = 7
    assert home.costed(base) is not space
    assert 2 == home.costs_version
