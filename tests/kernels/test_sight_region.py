"""Visible regions: the verdicts of lines of sight, no gaps, exact areas, the same in every mesh."""

from itertools import pairwise

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
    houseexpo,
    shuffled,
)
from tests.reference.line_of_sight import visible_area
from tests.strategies import homes, quick, seeds

from fleet2d._core import region_contains
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


def canonical(mesh, right, wall):
    """Return the pieces by vertices only: on the right border, and at both ends of the wall."""
    corners = mesh.triangles[wall // 3]
    starts = np.take_along_axis(corners, wall[:, None] % 3, 1)[:, 0]
    ends = np.take_along_axis(corners, (wall[:, None] + 1) % 3, 1)[:, 0]
    return list(zip(right.tolist(), starts.tolist(), ends.tolist(), strict=True))


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
def test_every_direction_belongs_to_one_piece(polygons, seed):
    home = home_of(polygons)
    mesh = home.mesh

    for x, y in awkward_points(home, np.random.default_rng(seed), 2).tolist():
        right, _ = visible_region(mesh, x, y)
        if not strictly_inside(mesh, x, y):
            assert len(right) == 0
            continue
        borders = [(int(vx) - x, int(vy) - y) for vx, vy in mesh.vertices[right]]
        halves = [0 if dy > 0 or (dy == 0 and dx > 0) else 1 for dx, dy in borders]
        assert halves == sorted(halves)
        for (ax, ay), (bx, by) in [*pairwise(borders), (borders[-1], borders[0])]:
            assert ax * by - ay * bx > 0


@quick
@given(homes(), seeds())
def test_region_does_not_depend_on_the_mesh(polygons, seed):
    home, rng = home_of(polygons), np.random.default_rng(seed)
    other = shuffled(home.mesh, rng)

    for x, y in awkward_points(home, rng, 2).tolist():
        expected = canonical(home.mesh, *visible_region(home.mesh, x, y))
        assert expected == canonical(other, *visible_region(other, x, y))
        assert area_of(home.mesh, x, y)[0] == area_of(other, x, y)[0]


@quick
@given(homes(), seeds())
def test_area_is_exact(polygons, seed):
    home = home_of(polygons)

    for x, y in awkward_points(home, np.random.default_rng(seed), 1).tolist():
        if strictly_inside(home.mesh, x, y):
            expected = float(visible_area(home.walls, (x, y)))
            assert expected == pytest.approx(area_of(home.mesh, x, y)[0], rel=1e-12)


@pytest.mark.slow
def test_area_is_exact_and_equals_the_outline_in_a_real_home(shared_data):
    home = houseexpo(shared_data / "houseexpo" / "658e5214673c7a4e25b458e56bdb6144.json")

    for x, y in np.random.default_rng(4).choice(home.cells, 20).tolist():
        area, outline = area_of(home.mesh, x, y)
        assert float(visible_area(home.walls, (x, y))) == pytest.approx(area, rel=1e-12)
        assert Polygon(outline).area == pytest.approx(area, rel=1e-12)


def test_outline_ends_exactly_at_corners():
    area, outline = area_of(ROOM.mesh, 200, 200)

    corners = {tuple(corner) for corner in outline.tolist()}
    assert {(128, 128), (1280, 128), (128, 640), (500, 400), (500, 300), (700, 300)} <= corners
    assert area < Polygon([(128, 128), (1280, 128), (1280, 640), (128, 640)]).area


def test_convex_room_is_seen_whole_from_everywhere():
    mesh = home_of([shapely.box(0, 0, 640, 320)]).mesh

    for x, y in [(1, 1), (320, 160), (639, 319), (10, 300)]:
        assert area_of(mesh, x, y)[0] == pytest.approx(640 * 320, rel=1e-15)
        assert len(visible_region(mesh, x, y)[0]) == 4


def test_no_eye_in_a_wall_has_a_region():
    for x, y in [(128, 200), (128, 128), (600, 350), (0, 0), (-5, 9), (600, 300)]:
        right, wall = visible_region(ROOM.mesh, x, y)
        assert len(right) == 0
        assert not region_contains(ROOM.mesh, x, y, right, wall, x, y)


def check_regions_of_cells(home, step):
    """Compare regions with those found one by one; return the mean number of pieces."""
    cell_triangles = rasterize_cells(home.mesh, home.rows, home.columns)
    cells = np.ascontiguousarray(np.argwhere(cell_triangles >= 0)[::step])

    start, right, wall = regions_of_cells(home.mesh, cells, cell_triangles)

    assert len(right) == len(wall) == start[-1]
    for i, (row, column) in enumerate(cells.tolist()):
        expected = visible_region(home.mesh, 64 * column + 33, 64 * row + 33)
        piece = slice(start[i], start[i + 1])
        assert np.array_equal(expected[0], right[piece])
        assert np.array_equal(expected[1], wall[piece])
    return len(right) / len(cells)


def test_regions_of_cells_equal_single_regions():
    check_regions_of_cells(ROOM, step=11)


def test_regions_of_cells_may_have_any_number_of_pieces():
    raster = range(300, 1500, 200)
    pillars = [shapely.box(x, y, x + 8, y + 8) for x in raster for y in raster]
    hall = home_of([shapely.box(128, 128, 1600, 1600).difference(shapely.union_all(pillars))])

    # Room is made for 32 pieces a cell, and then doubled: twice, here.
    assert check_regions_of_cells(hall, step=40) > 64


def test_points_far_outside_the_home_are_in_no_region():
    right, wall = visible_region(ROOM.mesh, 200, 200)
    far = np.array([[200, 200], [2**62, 2**62], [-(2**63), 200], [200, 2**63 - 1]])

    contained = region_contains_points(ROOM.mesh, 200, 200, right, wall, far)

    assert contained.tolist() == [True, False, False, False]


def test_numbers_that_name_no_vertex_wall_or_cell_are_refused():
    mesh = ROOM.mesh
    right, wall = visible_region(mesh, 200, 200)
    points, triangles = np.array([[1, 1]]), rasterize_cells(mesh, ROOM.rows, ROOM.columns)

    for wrong, message in [
        ((right[1:], wall), "one length"),
        ((right + np.int32(10**6), wall), "right must hold"),
        ((right, wall - np.int32(10**6)), "wall must hold"),
    ]:
        with pytest.raises(ValueError, match=message):
            region_contains_points(mesh, 200, 200, *wrong, points)
        with pytest.raises(ValueError, match=message):
            region_outline(mesh, 200, 200, *wrong)
    with pytest.raises(ValueError, match="an eye"):
        region_contains(mesh, -1, 200, right, wall, 1, 1)
    with pytest.raises(ValueError, match="in cell_triangles"):
        regions_of_cells(mesh, np.array([[ROOM.rows, 0]]), triangles)
    with pytest.raises(ValueError, match="the triangle of each"):
        regions_of_cells(mesh, np.argwhere(triangles >= 0), triangles + np.int32(1))
