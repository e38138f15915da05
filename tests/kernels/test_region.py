"""Visible regions: the verdicts of lines of sight, no gaps, exact areas, the same in every mesh."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from hypothesis import given
from shapely.geometry import Polygon
from tests.homes import (
    Home,
    all_homes,
    awkward_points,
    behind_corners,
    home_of,
    houseexpo,
    needs_jit,
    shuffled,
    times_compiled,
)
from tests.reference.sight import visible_area
from tests.strategies import homes, quick, seeds

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.mesh import Mesh, locate, rasterize_cells, strictly_inside
from fleet2d.kernels.region import (
    region_contains,
    region_contains_points,
    region_outline,
    regions_of_cells,
    visible_region,
)
from fleet2d.kernels.sight import line_of_sight, scratch_for

Int64 = npt.NDArray[np.int64]
Int32 = npt.NDArray[np.int32]
Bool = npt.NDArray[np.bool_]

ROOM = home_of([shapely.box(128, 128, 1280, 640).difference(shapely.box(500, 300, 700, 400))])


def region_of(mesh: Mesh, x: int, y: int) -> tuple[Int32, Int32]:
    """Return the region of a point: `right` and `wall` of its pieces."""
    wall, stack = scratch_for(mesh.vertices)
    right = np.empty_like(wall)
    count = visible_region(mesh, x, y, locate(mesh, x, y), right, wall, stack)
    return right[:count].copy(), wall[:count].copy()


def canonical(mesh: Mesh, right: Int32, wall: Int32) -> list[tuple[int, int, int]]:
    """Return the pieces by vertices only: on the right border, and at both ends of the wall."""
    corners = mesh.triangles[wall // 3]
    starts = np.take_along_axis(corners, wall[:, None] % 3, 1)[:, 0]
    ends = np.take_along_axis(corners, (wall[:, None] + 1) % 3, 1)[:, 0]
    return list(zip(right.tolist(), starts.tolist(), ends.tolist(), strict=True))


def area_of(mesh: Mesh, x: int, y: int) -> tuple[float, npt.NDArray[np.float64]]:
    """Return the area of a region, and the corners of its outline."""
    right, wall = region_of(mesh, x, y)
    outline = np.empty((2 * len(right), 2))
    return region_outline(mesh, x, y, right, wall, outline), outline


@kernel
def _sees_each(mesh: Mesh, x: int, y: int, points: Int64) -> Bool:
    """Return which points are visible from (x, y), by lines of sight."""
    found = np.zeros(points.shape[0], np.bool_)
    triangle = locate(mesh, x, y)
    for i in range(points.shape[0]):
        found[i] = line_of_sight(mesh, x, y, triangle, points[i, 0], points[i, 1])
    return found


def check_verdicts(home: Home, mesh: Mesh, rng: np.random.Generator, eyes: int, count: int) -> None:
    """Compare regions with lines of sight."""
    for eye in awkward_points(home, rng, eyes):
        around = [
            awkward_points(home, rng, count),
            behind_corners(home, eye, rng, count),
            eye[None],
        ]
        points = np.concatenate(around)
        right, wall = region_of(mesh, *eye.tolist())
        expected = _sees_each(mesh, *eye.tolist(), points)
        found = region_contains_points(mesh, *eye.tolist(), right, wall, points)
        assert np.array_equal(expected, found)


@quick
@given(homes(), seeds())
def test_region_holds_exactly_the_points_in_line_of_sight(
    polygons: list[Polygon], seed: int
) -> None:
    home, rng = home_of(polygons), np.random.default_rng(seed)

    check_verdicts(home, shuffled(home.mesh, rng), rng, eyes=1, count=4)


@needs_jit
def test_region_holds_exactly_the_points_in_line_of_sight_in_fifty_homes(shared_data: Path) -> None:
    rng = np.random.default_rng(3)

    for home in all_homes(shared_data):
        check_verdicts(home, home.mesh, rng, eyes=4, count=100)


@quick
@given(homes(), seeds())
def test_every_direction_belongs_to_one_piece(polygons: list[Polygon], seed: int) -> None:
    home = home_of(polygons)
    mesh = home.mesh

    for x, y in awkward_points(home, np.random.default_rng(seed), 2).tolist():
        right, _ = region_of(mesh, x, y)
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
def test_region_does_not_depend_on_the_mesh(polygons: list[Polygon], seed: int) -> None:
    home, rng = home_of(polygons), np.random.default_rng(seed)
    other = shuffled(home.mesh, rng)

    for x, y in awkward_points(home, rng, 2).tolist():
        expected = canonical(home.mesh, *region_of(home.mesh, x, y))
        assert expected == canonical(other, *region_of(other, x, y))
        assert area_of(home.mesh, x, y)[0] == area_of(other, x, y)[0]


@quick
@given(homes(), seeds())
def test_area_is_exact(polygons: list[Polygon], seed: int) -> None:
    home = home_of(polygons)

    for x, y in awkward_points(home, np.random.default_rng(seed), 1).tolist():
        if strictly_inside(home.mesh, x, y):
            expected = float(visible_area(home.walls, (x, y)))
            assert expected == pytest.approx(area_of(home.mesh, x, y)[0], rel=1e-12)


@needs_jit
def test_area_is_exact_and_the_outline_has_it_in_a_real_home(shared_data: Path) -> None:
    home = houseexpo(shared_data / "houseexpo" / "658e5214673c7a4e25b458e56bdb6144.json")

    for x, y in np.random.default_rng(4).choice(home.cells, 20).tolist():
        area, outline = area_of(home.mesh, x, y)
        assert float(visible_area(home.walls, (x, y))) == pytest.approx(area, rel=1e-12)
        assert Polygon(outline).area == pytest.approx(area, rel=1e-12)


def test_outline_ends_exactly_at_corners() -> None:
    area, outline = area_of(ROOM.mesh, 200, 200)

    corners = {tuple(corner) for corner in outline.tolist()}
    assert {(128, 128), (1280, 128), (128, 640), (500, 400), (500, 300), (700, 300)} <= corners
    assert area < Polygon([(128, 128), (1280, 128), (1280, 640), (128, 640)]).area


def test_convex_room_is_seen_whole_from_everywhere() -> None:
    mesh = home_of([shapely.box(0, 0, 640, 320)]).mesh

    for x, y in [(1, 1), (320, 160), (639, 319), (10, 300)]:
        assert area_of(mesh, x, y)[0] == pytest.approx(640 * 320, rel=1e-15)
        assert len(region_of(mesh, x, y)[0]) == 4


def test_no_eye_in_a_wall_has_a_region() -> None:
    for x, y in [(128, 200), (128, 128), (600, 350), (0, 0), (-5, 9), (600, 300)]:
        right, wall = region_of(ROOM.mesh, x, y)
        assert len(right) == 0
        assert not region_contains(ROOM.mesh, x, y, right, wall, x, y)


def check_regions_of_cells(home: Home, step: int) -> float:
    """Compare regions with those found one by one; return the mean number of pieces."""
    cell_triangles = rasterize_cells(home.mesh, home.rows, home.columns)
    cells = np.ascontiguousarray(np.argwhere(cell_triangles >= 0)[::step])

    start, right, wall = regions_of_cells(home.mesh, cells, cell_triangles)

    assert len(right) == len(wall) == start[-1]
    for i, (row, column) in enumerate(cells.tolist()):
        expected = region_of(home.mesh, 64 * column + 33, 64 * row + 33)
        piece = slice(start[i], start[i + 1])
        assert np.array_equal(expected[0], right[piece])
        assert np.array_equal(expected[1], wall[piece])
    return len(right) / len(cells)


def test_regions_of_cells_are_those_found_one_by_one() -> None:
    check_regions_of_cells(ROOM, step=11)


def test_regions_of_cells_may_have_any_number_of_pieces() -> None:
    raster = range(300, 1500, 200)
    pillars = [shapely.box(x, y, x + 8, y + 8) for x in raster for y in raster]
    hall = home_of([shapely.box(128, 128, 1600, 1600).difference(shapely.union_all(pillars))])

    # Room is made for 32 pieces a cell, and then doubled: twice, here.
    assert check_regions_of_cells(hall, step=40) > 64


@needs_jit
def test_every_kernel_is_compiled_once() -> None:
    right, wall = region_of(ROOM.mesh, 200, 200)
    region_contains(ROOM.mesh, 200, 200, right, wall, 201, 201)
    check_regions_of_cells(ROOM, step=50)
    area_of(ROOM.mesh, 200, 200)

    for function in (visible_region, region_contains, regions_of_cells, region_outline):
        assert 1 == times_compiled(function)
