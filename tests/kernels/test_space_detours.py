"""Ways round bodies that stand, against trying all legs; places beside, against trying all cells."""

import math

import numpy as np
import pytest
import shapely
from tests.kernels.test_space_routes import corners_of, crowded, routes_of, some_points
from tests.meshed_homes import home_of
from tests.reference import detours as slow
from tests.reference.routes import length_of, region_of, straight_ways

from fleet2d.kernels import SUB, place_beside

NOBODY = np.zeros((0, 3), np.int64)


@pytest.mark.parametrize("seed", range(6))
def test_a_way_round_discs_is_as_short_as_by_all_legs(seed):
    random = np.random.default_rng(seed)
    home = crowded(seed) if seed % 2 else home_of([shapely.box(0, 0, 4096, 4096)])
    region = region_of(home.mesh.vertices, home.mesh.triangles)
    routes = routes_of(home)
    twin = slow.SlowDetours(region, home.mesh.vertices, corners_of(home))
    bent = 0
    for _ in range(8):
        start, goal, *middles = some_points(home, random, 7).tolist()
        reach = random.integers(150, 700, len(middles))
        discs = np.column_stack([middles, reach])
        way = routes.around(*start, *goal, discs)
        expected = twin.length(tuple(start), tuple(goal), discs)
        if way is None:
            assert math.isinf(expected)
            continue
        assert [start, goal] == way[[0, -1]].tolist()
        assert straight_ways(region, way[:-1], way[1:]).all()
        for disc in discs:
            legs = zip(way[:-1].tolist(), way[1:].tolist(), strict=True)
            assert all(
                slow.is_clear(disc, tuple(a), tuple(b), may_leave=i == 0)
                for i, (a, b) in enumerate(legs)
            )
        assert math.isclose(expected, length_of(way), rel_tol=1e-9)
        bent += len(way) > 2
    assert bent


def test_nobody_in_the_way_leaves_the_shortest_way():
    home = crowded(1)
    routes = routes_of(home)
    start, goal = some_points(home, np.random.default_rng(1), 2).tolist()
    shortest = routes.find(*start, *goal)
    assert shortest is not None
    for discs in (NOBODY, np.array([[10**6, 10**6, 100]])):
        assert np.array_equal(routes.around(*start, *goal, discs), shortest)


def test_a_start_within_a_disc_is_left_away_from_its_middle():
    routes = routes_of(home_of([shapely.box(0, 0, 4096, 4096)]))
    discs = np.array([[2000, 2000, 300]])
    assert routes.around(2200, 2000, 3500, 2000, discs) is not None
    back = routes.around(2200, 2000, 500, 2000, discs)
    assert back is not None
    assert back[1, 0] >= 2200
    assert routes.around(2000, 2000, 500, 2000, discs) is not None  # each way leads off the middle


def test_there_is_no_way_to_a_goal_that_is_taken_or_walled_in_or_outside():
    routes = routes_of(home_of([shapely.box(0, 0, 4096, 640)]))
    assert routes.around(100, 300, 3000, 300, np.array([[3000, 300, 1]])) is None
    assert routes.around(100, 300, 3000, 300, np.array([[2000, 320, 320]])) is None
    assert routes.around(100, 300, 5000, 300, NOBODY) is None
    assert routes.around(0, 300, 3000, 300, NOBODY) is None


@pytest.mark.parametrize("seed", range(40))
def test_a_place_beside_is_the_clear_cell_that_trying_all_of_them_finds(seed):
    random = np.random.default_rng(seed)
    shape = tuple(random.integers(1, 24, 2))
    parts = random.integers(-1, 2, shape, np.int32)
    rooms = random.integers(-1, 2, shape, np.int16)
    height, width = (np.array(shape) * SUB).tolist()
    place, start = ((int(x * width), int(y * height)) for x, y in random.random((2, 2)))
    discs = np.column_stack(
        [random.integers(0, 24 * SUB, (seed % 5, 2)), random.integers(0, 500, seed % 5)]
    )
    room = int(random.integers(-1, 2))
    slack = int(random.integers(0, 4)) * SUB
    floor = parts, 1, rooms, room
    assert place_beside(*floor, place, start, slack, discs) == slow.place_beside(floor, place, start, slack, discs)  # fmt: skip
