import numpy as np
import pytest
from tests.reference.fields import box_sums as slow_box_sums
from tests.reference.fields import climb as slow_climb
from tests.reference.fields import squared_distance as slow_squared_distance
from tests.reference.fields import walking_distance as slow_walking_distance

from fleet2d.kernels import box_sums, climb, squared_distance, walking_distance


@pytest.mark.parametrize("shape", [(1, 1), (1, 17), (17, 1), (2, 2), (13, 29), (40, 25)])
@pytest.mark.parametrize("free", [0.0, 0.1, 0.5, 0.9, 0.99, 1.0])
def test_squared_distance_of_random_masks_equals_brute_force(shape, free):
    rng = np.random.default_rng([*shape, int(100 * free)])
    for _ in range(10):
        mask = rng.random(shape) < free

        assert np.array_equal(slow_squared_distance(mask), squared_distance(mask))


def test_squared_distance_with_one_cell_outside_is_exact_across_the_grid():
    mask = np.ones((300, 500), np.bool_)
    mask[299, 0] = False

    depth = squared_distance(mask)

    assert 299**2 + 499**2 == depth[0, 499]
    assert depth[299, 0] == 0


def test_squared_distance_of_a_mask_without_outside_is_the_stated_bound():
    assert np.array_equal(np.full((3, 4), 49), squared_distance(np.ones((3, 4), np.bool_)))


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_squared_distance_is_the_same_on_every_side(turns):
    """Known failure 15: erosion with even kernels left other clearance on each side."""
    mask = np.random.default_rng(3).random((30, 41)) < 0.97

    turned = squared_distance(np.ascontiguousarray(np.rot90(mask, turns)))
    mirrored = squared_distance(np.ascontiguousarray(mask[:, ::-1]))

    assert np.array_equal(np.rot90(squared_distance(mask), turns), turned)
    assert np.array_equal(squared_distance(mask)[:, ::-1], mirrored)


@pytest.mark.parametrize("shape", [(1, 1), (1, 17), (17, 1), (2, 2), (13, 29)])
@pytest.mark.parametrize("free", [0.0, 0.3, 0.6, 0.9, 1.0])
@pytest.mark.parametrize("count", [0, 1, 3])
def test_walking_distance_of_random_masks_equals_trying_all_steps(shape, free, count):
    rng = np.random.default_rng([*shape, int(100 * free), count])
    for _ in range(4):
        mask = rng.random(shape) < free
        goals = rng.integers(-1, np.array(shape) + 1, (count, 2))  # some outside the grid

        expected = slow_walking_distance(mask, goals)

        assert np.array_equal(expected, walking_distance(mask, goals))


def test_walking_distance_cuts_no_corner():
    mask = np.array([[True, False], [True, True]])

    assert [[10, -1], [5, 0]] == walking_distance(mask, np.array([[1, 1]])).tolist()
    assert [[0, -1], [-1, -1]] == walking_distance(
        np.array([[True, False], [False, True]]), np.array([[0, 0]])
    ).tolist()


def test_walking_distance_counts_a_goal_named_twice_once():
    mask = np.ones((3, 4), np.bool_)

    assert np.array_equal(
        walking_distance(mask, np.array([[1, 1]])),
        walking_distance(mask, np.array([[1, 1], [1, 1], [9, 9]])),
    )


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (1, 1), (1, 9), (9, 1), (2, 2), (7, 11)])
@pytest.mark.parametrize("reach", [0, 1, 2, 8, 30])
def test_sums_of_squares_equal_adding_them_up(shape, reach):
    values = np.random.default_rng([*shape, reach]).integers(-100, 100, shape)

    assert np.array_equal(slow_box_sums(values, reach), box_sums(values, reach))


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (1, 1), (1, 9), (9, 1), (2, 2), (12, 17)])
@pytest.mark.parametrize("heights", [1, 3, 1000])
def test_cells_lead_to_the_peaks_that_walking_up_does(shape, heights):
    rng = np.random.default_rng([*shape, heights])
    for labels in (1, 3):
        label = rng.integers(-1, labels, shape).astype(np.int32)
        height = rng.integers(0, heights, shape)

        assert np.array_equal(slow_climb(label, height), climb(label, height))


def test_of_level_cells_the_last_is_the_peak():
    peak = climb(np.zeros((2, 3), np.int32), np.zeros((2, 3), np.int64))

    assert [[0, 0, 0]] * 2 == peak.tolist()
