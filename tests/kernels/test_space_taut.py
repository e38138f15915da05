"""Ways over cells of different cost: exactly the cheapest, and straightening that makes nothing dearer."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from tests.meshed_homes import home_of
from tests.reference import costs as slow

from fleet2d._core import leg_cost, step_cost
from fleet2d.kernels import cheapest_cells, pull_taut

HALL = home_of([shapely.box(0, 0, 64 * 20, 64 * 12)])


def random_costs(rng, shape, walls):
    """Costs of which many are nothing or the most there is, and walls."""
    cost = rng.choice([0, 0, 0, 50, 1000, 137], shape).astype(np.int32)
    cost[rng.random(shape) < walls] = -1
    return cost


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 8), (14, 11)])
@pytest.mark.parametrize("walls", [0.0, 0.2, 0.5])
def test_cheapest_cells_equal_those_by_dijkstra(shape, walls):
    rng = np.random.default_rng([*shape, int(10 * walls)])
    for _ in range(4):
        cost = random_costs(rng, shape, walls)
        goal, *starts = (tuple(cell) for cell in rng.integers(0, shape, (12, 2)).tolist())
        for start in starts:
            expected = slow.cheapest_cells(cost, start, goal)
            assert expected == cheapest_cells(cost, start, goal).tolist()
        steps = slow.steps_over(cost)
        for here, there in pairwise(expected):
            cells = [row * shape[1] + column for row, column in (here, there)]
            assert steps[*cells] == step_cost(cost, *here, *there)


@pytest.mark.parametrize(
    ("bx", "by"), [(700, 33), (33, 500), (741, 555), (600, 37), (33, 33), (65, 65)]
)
def test_leg_costs_the_same_in_both_directions_and_as_by_sampling(bx, by):
    cost = random_costs(np.random.default_rng(3), (12, 20), 0.0)
    x, y = np.linspace((33, 33), (bx, by), 200_000).astype(int).T // 64
    sampled = np.hypot(bx - 33, by - 33) * (100 + cost[y, x]).mean()
    there, back = leg_cost(cost, 33, 33, bx, by), leg_cost(cost, bx, by, 33, 33)
    assert sampled == pytest.approx(there, rel=1e-3)
    if (bx, by) != (65, 65):  # right along a diagonal, cells meet at corners
        assert there == pytest.approx(back, rel=1e-9)


def test_leg_through_a_closed_cell_or_out_of_the_grid_is_none():
    cost = np.zeros((12, 20), np.int32)
    cost[3, 5] = -1
    assert leg_cost(cost, 33, 64 * 3 + 33, 64 * 10, 64 * 3 + 33) == np.inf
    assert leg_cost(cost, 33, 33, 64 * 20 + 5, 33) == np.inf


def test_pulled_path_has_the_same_ends_and_never_costs_more():
    rng = np.random.default_rng(4)
    straight = 0
    for walls in (0.0, 0.1, 0.3):
        cost = random_costs(rng, (12, 20), walls)
        goal, *starts = rng.permutation(np.argwhere(cost >= 0))[:8].tolist()
        for start in starts:
            way = cheapest_cells(cost, tuple(start), tuple(goal))[:, ::-1] * 64 + 33
            if len(way) == 0:
                continue
            pulled = pull_taut(HALL.mesh, cost, np.ascontiguousarray(way))
            before, after = (
                sum(leg_cost(cost, *a, *b) for a, b in pairwise(path.tolist()))
                for path in (way, pulled)
            )
            assert way[[0, -1]].tolist() == pulled[[0, -1]].tolist()
            assert after <= before * (1 + 1e-6)
            straight += len(way) - len(pulled)
    assert straight > 10
