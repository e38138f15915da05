import numpy as np
import shapely
from hypothesis import given
from tests.meshed_homes import home_of
from tests.reference.routes import parts_of
from tests.strategies import homes, quick

from fleet2d.kernels import label_triangles


@quick
@given(homes())
def test_triangles_are_numbered_by_part_and_there_are_as_many_as_polygons(polygons):
    """Polygons have disjoint insides: they touch in points at most, and a point joins nothing."""
    merged = shapely.get_parts(shapely.union_all(polygons))
    neighbors = home_of(polygons).mesh.neighbors

    part = label_triangles(neighbors)

    assert parts_of(neighbors).tolist() == part.tolist()
    assert len(merged) == part.max() + 1


def test_triangles_of_a_long_corridor_are_one_part():
    """A walk through the mesh that called itself would run out of stack here."""
    count = 20_000
    chain = np.full((count, 3), -1, np.int32)
    chain[1:, 0] = np.arange(count - 1)
    chain[:-1, 1] = np.arange(1, count)

    assert not label_triangles(chain).any()
