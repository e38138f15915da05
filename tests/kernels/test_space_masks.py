from itertools import pairwise

import numpy as np
import pytest
import shapely
from scipy.ndimage import label

from fleet2d.kernels import count_steps, label_parts, trace_rings

SHAPES = [(1, 1), (1, 9), (9, 1), (2, 2), (6, 7), (14, 11)]
SHARES = [0.0, 0.2, 0.5, 0.6, 0.9, 1.0]


def masks(shape, share, count=10):
    rng = np.random.default_rng([*shape, int(100 * share)])
    return [rng.random(shape) < share for _ in range(count)]


# --- Slow, obvious twins ------------------------------------------------------------------------


def slow_count_steps(start, mask):
    """Walk one step further from all that is reached, again and again."""
    out = np.where(start & mask, 0, -1).astype(np.int32)
    for step in range(1, mask.size + 1):
        reached = np.pad(out == step - 1, 1)
        around = reached[2:, 1:-1] | reached[:-2, 1:-1] | reached[1:-1, 2:] | reached[1:-1, :-2]
        out[around & mask & (out < 0)] = step
    return out


def rings_of(mask):
    corners, starts = trace_rings(mask)
    return [corners[a:b] for a, b in pairwise(starts.tolist())]


def sides_of(rings):
    """Cut rings into directed sides of one pixel."""
    sides = []
    for ring in rings:
        for start, end in pairwise([*ring.tolist(), ring[0].tolist()]):
            length = int(np.abs(np.subtract(end, start)).max())
            points = np.linspace(start, end, length + 1).tolist()
            sides += pairwise(map(tuple, points))
    return sides


def slow_sides(mask):
    """Go round every pixel, and drop what two pixels share."""
    sides = set()
    for y, x in np.argwhere(mask).tolist():
        corners = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1), (x, y)]
        sides |= set(pairwise(corners))
    return {side for side in sides if side[::-1] not in sides}


# --- Parts and steps ----------------------------------------------------------------------------


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("diagonal", [False, True])
def test_parts_of_random_masks_are_those_of_scipy(shape, share, diagonal):
    for mask in masks(shape, share, 4):
        parts, _ = label(mask, np.ones((3, 3)) if diagonal else None)

        assert np.array_equal(parts - 1, label_parts(mask, diagonal))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("share", SHARES)
def test_steps_in_random_masks_equal_the_reference(shape, share):
    for mask, start in zip(masks(shape, share), masks(shape, 0.1), strict=True):
        assert np.array_equal(slow_count_steps(start, mask), count_steps(start, mask))


# --- Rings --------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("share", SHARES)
def test_rings_run_along_every_side_once_with_the_mask_on_the_left(shape, share):
    for mask in masks(shape, share):
        sides = sides_of(rings_of(mask))

        assert len(sides) == len(set(sides))
        assert slow_sides(mask) == set(sides)


@pytest.mark.parametrize("share", [0.5, 0.6, 0.7, 0.9])
def test_rings_of_one_part_are_one_sound_polygon_that_covers_its_pixels(share):
    for mask in masks((14, 11), share, 40):
        part = label_parts(mask, False)
        largest = part == np.argmax(np.bincount(part[mask]))

        rings = [shapely.LinearRing(ring) for ring in rings_of(largest)]
        outer = [ring for ring in rings if ring.is_ccw]
        shape = shapely.Polygon(outer[0], [ring for ring in rings if not ring.is_ccw])

        y, x = np.nonzero(largest)
        assert 1 == len(outer)
        assert all(ring.is_simple for ring in rings)
        assert shape.is_valid, shapely.is_valid_reason(shape)
        assert shape.equals(shapely.union_all(shapely.box(x, y, x + 1, y + 1)))


def test_two_holes_that_share_a_corner_are_two_rings():
    """A ring that went on into the other hole would cross itself."""
    mask = np.ones((4, 4), np.bool_)
    mask[1, 2] = mask[2, 1] = False

    assert [4, 4, 4] == [len(ring) for ring in rings_of(mask)]


def test_an_empty_mask_has_no_ring():
    corners, starts = trace_rings(np.zeros((3, 4), np.bool_))

    assert [(0, 2), (1,)] == [corners.shape, starts.shape]
