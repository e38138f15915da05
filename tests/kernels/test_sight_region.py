"""Visible regions: the verdicts of lines of sight, no gaps, exact areas, the same in every mesh."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from shapely.geometry import Polygon
from tests.meshed_homes import (
    all_homes,
    awkward_points,
    behind_corners,
    home_of,
    shuffled,
)
from tests.reference.line_of_sight import visible_area
from tests.strategies import homes, quick, seeds

from fleet2d.kernels import (
    points_in_sight,
    rasterize_cells,
    region_contains_points,
    region_outline,
    regions_of_cells,
    strictly_inside,
    visible_region,
)

ROOM = home_of([shapely.box(128, 128, 1280, 640).difference(shapely.box(500, 300, 700, 400))])


def area_of(mesh, x, y):
    """Return the area of a region, and the corners of its outline."""
    outline, area = region_outline(mesh, x, y, *visible_region(mesh, x, y))
    return area, outline


def check_verdicts(home, mesh, rng, eyes, count):
    """Compare regions with lines of sight."""
    for eye in awkward_points(home, rng, eyes):
        around = [
            awkward_points(home, rng, count),
            behind_corners(home, eye, rng, count),
            eye[None],
        ]
        points = np.concatenate(around)
        right, wall = visible_region(mesh, *eye.tolist())
        expected = points_in_sight(mesh, *eye.tolist(), points)
        contained = region_contains_points(mesh, *eye.tolist(), right, wall, points)
        assert np.array_equal(expected, contained)


@quick
@given(homes(), seeds())
def test_region_contains_exactly_the_points_in_line_of_sight(polygons, seed):
    home, rng = home_of(polygons), np.random.default_rng(seed)

    check_verdicts(home, shuffled(home.mesh, rng), rng, eyes=1, count=4)


def test_region_contains_exactly_the_points_in_line_of_sight_in_real_homes(shared_data):
    rng = np.random.default_rng(3)

    for home in all_homes(shared_data):
        check_verdicts(home, home.mesh, rng, eyes=4, count=100)


@quick
@given(homes(), seeds())
def test_area_is_exact_and_that_of_the_outline_in_any_mesh(polygons, seed):
    home, rng = home_of(polygons), np.random.default_rng(seed)
    mesh = shuffled(home.mesh, rng)

    for x, y in awkward_points(home, rng, 1).tolist():
        if strictly_inside(mesh, x, y):
            area, outline = area_of(mesh, x, y)
            assert float(visible_area(home.walls, (x, y))) == pytest.approx(area, rel=1e-12)
            assert Polygon(outline).area == pytest.approx(area, rel=1e-12)


def test_convex_room_is_seen_whole_from_everywhere():
    mesh = home_of([shapely.box(0, 0, 640, 320)]).mesh

    for x, y in [(1, 1), (320, 160), (639, 319), (10, 300)]:
        assert area_of(mesh, x, y)[0] == pytest.approx(640 * 320, rel=1e-15)
        assert len(visible_region(mesh, x, y)[0]) == 4


def test_regions_of_cells_equal_single_regions_of_any_number_of_pieces():
    """Room is made for 32 pieces a cell, and then doubled: twice, here."""
    raster = range(300, 1500, 200)
    pillars = [shapely.box(x, y, x + 8, y + 8) for x in raster for y in raster]
    hall = home_of([shapely.box(128, 128, 1600, 1600).difference(shapely.union_all(pillars))])
    cell_triangles = rasterize_cells(hall.mesh, hall.rows, hall.columns)
    cells = np.ascontiguousarray(np.argwhere(cell_triangles >= 0)[::40])

    start, *pieces = regions_of_cells(hall.mesh, cells, cell_triangles)

    for i, (row, column) in enumerate(cells.tolist()):
        expected = visible_region(hall.mesh, 64 * column + 33, 64 * row + 33)
        found = (part[start[i] : start[i + 1]] for part in pieces)
        assert all(map(np.array_equal, expected, found))
    assert len(pieces[0]) == len(pieces[1]) == start[-1] > 64 * len(cells)


def test_points_far_outside_the_home_are_in_no_region():
    right, wall = visible_region(ROOM.mesh, 200, 200)
    far = np.array([[200, 200], [2**62, 2**62], [-(2**63), 200], [200, 2**63 - 1]])

    contained = region_contains_points(ROOM.mesh, 200, 200, right, wall, far)

    assert contained.tolist() == [True, False, False, False]
