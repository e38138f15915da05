"""Walls that are moved into the free space: the kernel beside its slow twin."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon
from tests.reference import moved_walls as slow
from tests.strategies import homes, quick

from fleet2d.kernels import move_walls


@quick
@given(homes(), st.integers(0, 300), st.sampled_from([0.0, 0.41, 1.0]))
def test_moved_walls_equal_the_slow_ones(polygons, reach, part):
    half = int(part * reach)
    for polygon in polygons:
        for ring in shapely.get_rings(shapely.orient_polygons(polygon)):
            corners = shapely.get_coordinates(ring)[:-1].astype(np.int64)
            expected = slow.move_walls(corners, reach, half)
            assert expected.tolist() == move_walls(corners, reach, half).tolist()


WIDTHS = (0, 1, 4, 6)  # of the lines of a grid, whose cells are 1 to 3 wide


@pytest.mark.parametrize("half_of", [0.0, 0.5, 1.0])
def test_every_small_outline_equals_the_slow_one(half_of):
    """Steps, notches and pillars as narrow as the reach, and narrower."""
    cells = [
        shapely.box(WIDTHS[k % 3], WIDTHS[k // 3], WIDTHS[k % 3 + 1], WIDTHS[k // 3 + 1])
        for k in range(9)
    ]
    for mask in range(1, 512):
        area = shapely.union_all([cells[k] for k in range(9) if mask >> k & 1])
        if not isinstance(area, Polygon):
            continue
        for ring in shapely.get_rings(shapely.orient_polygons(area)):
            corners = shapely.get_coordinates(ring)[:-1].astype(np.int64)
            for reach in range(5):
                asked = (corners, reach, int(half_of * reach))
                assert slow.move_walls(*asked).tolist() == move_walls(*asked).tolist()


def test_a_wall_that_turns_back_moves_nowhere():
    ring = np.array([(0, 0), (10, 0), (5, 0), (5, 10), (0, 10)])
    assert 0 == len(slow.move_walls(ring, 1, 0)) == len(move_walls(ring, 1, 0))
