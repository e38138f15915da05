"""Ways over cells of different cost: exactly the cheapest, and straightening that makes nothing dearer."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from tests.meshed_homes import home_of
from tests.reference.costs import cheapest_cells as slow_cheapest_cells
from tests.reference.costs import cost_distance

from fleet2d._core import leg_cost, step_cost
from fleet2d.kernels import cheapest_cells, pull_taut, walking_distance

HALL = home_of([shapely.box(0, 0, 64 * 20, 64 * 12)])


def random_costs(rng: np.random.Generator, shape: tuple[int, int], walls: float) -> np.ndarray:
    """Costs of which many are nothing or the most there is, and walls."""
    cost = rng.choice([0, 0, 0, 50, 1000, 137], shape).astype(np.int32)
    cost[rng.random(shape) < walls] = -1
    return cost


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 8), (14, 11)])
@pytest.mark.parametrize("walls", [0.0, 0.2, 0.5])
def test_cheapest_cells_equal_those_of_brute_force(shape, walls):
    rng = np.random.default_rng([*shape, int(10 * walls)])
    for _ in range(4):
        cost = random_costs(rng, shape, walls)
        goal = (int(rng.integers(0, shape[0])), int(rng.integers(0, shape[1])))
        for row, column in rng.permutation(np.argwhere(cost >= -1))[:20].tolist():
            expected = slow_cheapest_cells(cost, (row, column), goal)
            assert expected == cheapest_cells(cost, (row, column), goal).tolist()


def test_cheapest_cells_lead_from_start_to_goal_over_open_cells():
    rng = np.random.default_rng(2)
    for _ in range(20):
        cost = random_costs(rng, (12, 15), 0.25)
        goal, *starts = (
            tuple(cell) for cell in rng.permutation(np.argwhere(cost >= 0))[:6].tolist()
        )
        least = cost_distance(cost, goal)
        for start in starts:
            way = cheapest_cells(cost, start, goal)
            if least[start] < 0:
                assert len(way) == 0
                continue
            total = 0
            for (row, column), (r, c) in pairwise(way):
                assert max(abs(row - r), abs(column - c)) == 1
                assert min(cost[r, c], cost[row, c], cost[r, column]) >= 0
                total += step_cost(cost, row, column, r, c)
            assert (tuple(way[0].tolist()), tuple(way[-1].tolist())) == (start, goal)
            assert least[start] == total


def test_without_costs_the_cheapest_way_is_the_walking_distance():
    free = np.random.default_rng(7).random((40, 30)) < 0.8
    free[5, 5] = True
    plain = walking_distance(free, np.array([[5, 5]]))
    cost = np.where(free, 0, -1).astype(np.int32)
    for row, column in np.argwhere(plain >= 0)[::17].tolist():
        way = cheapest_cells(cost, (row, column), (5, 5))
        steps = np.abs(np.diff(way, axis=0)).sum(axis=1)
        assert plain[row, column] == np.where(steps == 2, 7, 5).sum()


def test_unreachable_goal_is_reached_from_nowhere():
    cost = np.full((3, 3), -1, np.int32)
    assert cheapest_cells(cost, (0, 0), (1, 1)).shape == (0, 2)


@pytest.mark.parametrize(
    ("bx", "by"), [(700, 33), (33, 500), (741, 555), (600, 37), (33, 33), (65, 65)]
)
def test_leg_costs_the_same_in_both_directions_and_as_by_sampling(bx, by):
    cost = random_costs(np.random.default_rng(3), (12, 20), 0.0)
    length = float(np.hypot(bx - 33, by - 33))
    shares = (np.arange(200_000) + 0.5) / 200_000
    x, y = 33 + shares * (bx - 33), 33 + shares * (by - 33)
    sampled = length * (100 + cost[(y // 64).astype(int), (x // 64).astype(int)]).mean()
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
        goal, *starts = (
            tuple(cell) for cell in rng.permutation(np.argwhere(cost >= 0))[:8].tolist()
        )
        for start in starts:
            way = cheapest_cells(cost, start, goal)[:, ::-1] * 64 + 33
            if len(way) == 0:
                continue
            pulled = pull_taut(HALL.mesh, cost, np.ascontiguousarray(way))
            before, after = (
                sum(
                    leg_cost(cost, *a, *b)
                    for a, b in zip(w[:-1].tolist(), w[1:].tolist(), strict=True)
                )
                for w in (way, pulled)
            )
            assert (way[0].tolist(), way[-1].tolist()) == (pulled[0].tolist(), pulled[-1].tolist())
            assert after <= before * (1 + 1e-6)
            straight += len(way) - len(pulled)
    assert straight > 10
