import numpy as np
import pytest
import shapely
from hypothesis import given
from tests.meshed_homes import home_of
from tests.reference.routes import parts_of
from tests.strategies import homes, quick

from fleet2d.kernels import label_triangles, rasterize_cells


@quick
@given(homes())
def test_label_triangles_are_the_parts_of_the_twin(polygons):
    mesh = home_of(polygons).mesh

    part = label_triangles(mesh.neighbors)

    expected = sorted(sorted(triangles) for triangles in parts_of(mesh.neighbors))
    parts = [np.flatnonzero(part == i).tolist() for i in range(int(part.max()) + 1)]
    assert expected == sorted(parts)


@quick
@given(homes())
def test_label_triangles_counts_the_polygons(polygons):
    """Polygons have disjoint insides: they touch in points at most, and a point joins nothing."""
    merged = shapely.get_parts(shapely.union_all(polygons))

    assert len(merged) == len(set(label_triangles(home_of(polygons).mesh.neighbors).tolist()))


@pytest.mark.parametrize(
    ("neighbors", "expected"),
    [
        ([[-1, -1, -1]], [0]),
        ([[-1, -1, -1], [-1, -1, -1]], [0, 1]),
        ([[2, -1, -1], [-1, 3, -1], [-1, -1, 0], [1, -1, -1]], [0, 1, 0, 1]),
        ([[1, 2, 3], [0, -1, -1], [0, -1, -1], [0, -1, -1]], [0, 0, 0, 0]),
    ],
)
def test_label_triangles_numbers_parts_by_their_first_triangle(neighbors, expected):
    assert expected == label_triangles(np.array(neighbors, np.int32)).tolist()


def test_label_triangles_of_a_long_corridor_is_one_part():
    """A walk through the mesh that called itself would run out of stack here."""
    count = 20_000
    chain = np.full((count, 3), -1, np.int32)
    chain[1:, 0] = np.arange(count - 1)
    chain[:-1, 1] = np.arange(1, count)

    assert not label_triangles(chain).any()


def test_rasterized_cells_of_two_rooms_are_two_parts():
    home = home_of([shapely.box(64, 64, 640, 640), shapely.box(704, 64, 1280, 640)])

    triangles = rasterize_cells(home.mesh, home.rows, home.columns)
    part = np.where(triangles >= 0, label_triangles(home.mesh.neighbors)[triangles], -1)

    assert {-1, 0, 1} == set(part.ravel().tolist())
    assert (part[:, :10].max(), part[:, 11:].max()) in [(0, 1), (1, 0)]
