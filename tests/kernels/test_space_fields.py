import numpy as np
import pytest
from tests.reference import fields as slow

from fleet2d.kernels import box_sums, climb, squared_distance, walking_distance

SHAPES = pytest.mark.parametrize("shape", [(1, 1), (1, 17), (17, 1), (2, 2), (13, 29)])
SHAPES_AND_NONE = pytest.mark.parametrize(
    "shape", [(0, 3), (3, 0), (1, 9), (9, 1), (2, 2), (7, 11)]
)


@SHAPES
@pytest.mark.parametrize("free", [0.0, 0.1, 0.5, 0.9, 0.99, 1.0])
def test_squared_distance_of_random_masks_is_that_of_scipy(shape, free):
    rng = np.random.default_rng([*shape, int(100 * free)])
    for _ in range(10):
        mask = rng.random(shape) < free

        assert np.array_equal(slow.squared_distance(mask), squared_distance(mask))


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

    assert np.array_equal(np.rot90(squared_distance(mask), turns), turned)


@SHAPES
@pytest.mark.parametrize("free", [0.0, 0.3, 0.6, 0.9, 1.0])
@pytest.mark.parametrize("count", [0, 1, 3])
def test_walking_distance_of_random_masks_is_that_of_scipy(shape, free, count):
    rng = np.random.default_rng([*shape, int(100 * free), count])
    for _ in range(4):
        mask = rng.random(shape) < free
        goals = rng.integers(-1, np.array(shape) + 1, (count, 2))  # some outside the grid
        goals = np.concatenate([goals, goals[:1]])  # one is named twice

        expected = slow.walking_distance(mask, goals)

        assert np.array_equal(expected, walking_distance(mask, goals))


@SHAPES_AND_NONE
@pytest.mark.parametrize("reach", [0, 1, 2, 8, 30])
def test_sums_of_squares_equal_adding_them_up(shape, reach):
    values = np.random.default_rng([*shape, reach]).integers(-100, 100, shape)

    assert np.array_equal(slow.box_sums(values, reach), box_sums(values, reach))


@SHAPES_AND_NONE
@pytest.mark.parametrize("heights", [1, 3, 1000])
def test_cells_lead_to_the_peaks_that_walking_up_does(shape, heights):
    """Of level cells the last is the peak."""
    rng = np.random.default_rng([*shape, heights])
    for labels in (1, 3):
        label = rng.integers(-1, labels, shape).astype(np.int32)
        height = rng.integers(0, heights, shape)

        assert np.array_equal(slow.climb(label, height), climb(label, height))
