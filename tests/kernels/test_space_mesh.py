"""The mesh and its cells, against a look at every triangle and every wall."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests.meshed_homes import (
    all_homes,
    awkward_points,
    home_of,
    shuffled,
)
from tests.reference.line_of_sight import is_inside, on_any_wall
from tests.strategies import homes, quick, seeds

from fleet2d._core import BUCKET, contains_triangle
from fleet2d.kernels import locate, rasterize_cells, strictly_inside


def lowest_triangle(home, x, y):
    """Return what `locate` should find, by a look at every triangle."""
    for triangle, corners in enumerate(home.mesh.triangles.tolist()):
        ends = [home.mesh.vertices[corner].tolist() for corner in corners]
        pairs = zip(ends, ends[1:] + ends[:1], strict=True)
        if all((bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0 for (ax, ay), (bx, by) in pairs):
            return triangle
    return -1


@quick
@given(homes(), seeds())
def test_locate_returns_the_lowest_triangle_with_the_point(polygons, seed):
    home = home_of(polygons)

    for x, y in awkward_points(home, np.random.default_rng(seed), 3).tolist():
        assert lowest_triangle(home, x, y) == locate(home.mesh, x, y)


@pytest.mark.parametrize(("x", "y"), [(-1, 5), (5, -1), (10**6, 5), (5, 10**6), (641, 5)])
def test_locate_returns_outside_beyond_the_plan(x, y):
    home = home_of([shapely.box(0, 0, 640, 640)])

    assert locate(home.mesh, x, y) == -1


def test_every_triangle_is_listed_in_the_buckets_of_its_points():
    home = home_of([shapely.box(0, 0, 7 * BUCKET, 5 * BUCKET)])

    for x in range(0, 7 * BUCKET + 1, BUCKET // 2):
        for y in range(0, 5 * BUCKET + 1, BUCKET // 2):
            assert contains_triangle(home.mesh, locate(home.mesh, x, y), x, y)


@quick
@given(homes(), seeds())
def test_strictly_inside_agrees_with_a_count_of_crossings(polygons, seed):
    home = home_of(polygons)
    points = awkward_points(home, np.random.default_rng(seed), 5)

    expected = is_inside(home.walls, points) & ~on_any_wall(home.walls, points)
    assert expected.tolist() == [bool(strictly_inside(home.mesh, *p)) for p in points.tolist()]


@quick
@given(homes(), seeds(), st.integers(0, 2))
def test_rasterized_cells_are_those_strictly_inside_in_every_mesh(polygons, seed, fewer):
    home = home_of(polygons)
    rows, columns = home.rows - fewer, home.columns - 2 * fewer
    mesh = shuffled(home.mesh, np.random.default_rng(seed))

    triangle_of_cell = rasterize_cells(mesh, rows, columns)

    grid = np.indices((rows, columns)).reshape(2, -1).T[:, ::-1] * 64 + 33
    inside = is_inside(home.walls, grid) & ~on_any_wall(home.walls, grid)
    assert inside.tolist() == (triangle_of_cell.ravel() >= 0).tolist()
    for (x, y), triangle in zip(grid.tolist(), triangle_of_cell.ravel().tolist(), strict=True):
        assert triangle == (locate(mesh, x, y) if triangle >= 0 else -1)


def test_cells_of_every_home_equal_the_free_cells_of_shapely(shared_data):
    for home in all_homes(shared_data):
        if home.rows * home.columns > 10**6:
            continue
        free = shapely.union_all(home.polygons)
        shapely.prepare(free)
        x, y = np.meshgrid(np.arange(home.columns) * 64 + 33, np.arange(home.rows) * 64 + 33)

        is_free = rasterize_cells(home.mesh, home.rows, home.columns) >= 0

        assert np.array_equal(shapely.contains_xy(free, x, y), is_free)
