"""The public face of visible regions: metres in, metres out."""

import numpy as np
import pytest
import shapely
from shapely.geometry import Polygon

from fleet2d.errors import PlacementError
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.sight.fov import VisibleRegion

L_SHAPE = FloorPlan.build("L", Polygon([(-3, 1), (1, 1), (1, 3), (-1, 3), (-1, 5), (-3, 5)]))


def test_area_and_outline_are_in_metres():
    region = VisibleRegion(L_SHAPE, x=-2.0, y=4.0)

    expected = Polygon([(-3, 1), (1, 1), (-1, 3), (-1, 5), (-3, 5)])
    assert region.area_m2 == pytest.approx(10.0)
    assert shapely.area(expected.symmetric_difference(Polygon(region.polygon()))) < 1e-9


def test_outline_is_counter_clockwise_without_repeats():
    outline = VisibleRegion(L_SHAPE, x=-2.5, y=1.5).polygon()

    assert Polygon(outline).exterior.is_ccw
    assert len(outline) == len(np.unique(outline, axis=0))


def test_contains_takes_points_of_any_shape():
    region = VisibleRegion(L_SHAPE, x=-2.0, y=4.0)

    points = [[(-2.0, 4.0), (-2.0, 1.5)], [(0.5, 2.9), (-1.0, 3.0)]]
    assert [[True, True], [False, False]] == region.contains(points).tolist()
    assert bool(region.contains((-2.5, 4.5)))
    assert region.contains(np.empty((0, 2))).shape == (0,)


@pytest.mark.parametrize(("x", "y"), [(-3.0, 2.0), (0.0, 4.0), (50.0, 2.0), (-1.0, 3.0)])
def test_an_eye_in_a_wall_is_an_error_with_its_place(x, y):
    with pytest.raises(PlacementError, match=rf"\({x:g}, {y:g}\) m is in a wall or outside"):
        VisibleRegion(L_SHAPE, x, y)
