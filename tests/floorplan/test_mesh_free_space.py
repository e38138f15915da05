"""Free space put on the lattice."""

import pytest
import shapely

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.mesh import free_on_lattice


def test_same_walls_in_another_order_are_the_same_free_space():
    boxes = [shapely.box(0, 0, 3, 2), shapely.box(5, 0, 6, 2)]
    turned = [shapely.reverse(box) for box in boxes[::-1]]
    one, other = (free_on_lattice("flat", shapely.MultiPolygon(b), 0.05) for b in (boxes, turned))
    assert one[0] == other[0]
    assert [p.wkt for p in one[1]] == [p.wkt for p in other[1]]


def test_free_space_that_is_there_already_is_not_moved():
    lattice, polygons = free_on_lattice("flat", shapely.box(0.013, 0.02, 3.333, 2.071), 0.05)
    back = shapely.transform(polygons[0], lattice.to_metres)
    again = free_on_lattice("flat", back, 0.05)
    assert (lattice, [p.wkt for p in polygons]) == (again[0], [p.wkt for p in again[1]])


@pytest.mark.parametrize(
    ("free", "words"),
    [
        (shapely.Polygon(), "encloses no area"),
        (shapely.box(0, 0, 1e-4, 1e-4), "nothing is left"),
        (shapely.box(0, 0, 5000, 5000), "too large for cells"),
    ],
)
def test_what_is_no_home_is_refused(free, words):
    with pytest.raises(FloorPlanError, match=words):
        free_on_lattice("flat", free, 0.05)
