"""Lines of sight against a look at every wall, where rounding would go wrong."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Polygon
from tests.meshed_homes import (
    all_homes,
    awkward_points,
    behind_corners,
    home_of,
    houseexpo,
    shuffled,
    transformed,
    turns,
)
from tests.reference.line_of_sight import nearest_cells_in_sight as nearest_slowly
from tests.reference.line_of_sight import vertices_seen, visible
from tests.strategies import homes, quick, seeds

from fleet2d._core import build_fans, vertices_seen_from_point, vertices_seen_from_vertex
from fleet2d.kernels import (
    line_of_sight,
    locate,
    nearest_cells_in_sight,
    pairs_in_sight,
    points_in_sight,
)

EYES, POINTS = 2, 24


def _sees_each(mesh, eye, points):
    """Return which points the eye sees."""
    return pairs_in_sight(mesh, np.broadcast_to(eye, points.shape), points)


def check_against_every_wall(home, mesh, rng):
    """Compare verdicts from awkward eyes to awkward points, both ways; return how many are seen."""
    count = 0
    for eye in awkward_points(home, rng, EYES):
        others = awkward_points(home, rng, POINTS), behind_corners(home, eye, rng, POINTS)
        points = np.concatenate([*others, eye[None]])
        eyes = np.broadcast_to(eye, points.shape)
        expected = visible(home.walls, eye, points)
        assert np.array_equal(expected, pairs_in_sight(mesh, eyes, points))
        assert np.array_equal(expected, pairs_in_sight(mesh, points, eyes))
        assert np.array_equal(expected, points_in_sight(mesh, *eye.tolist(), points))
        count += int(expected.sum())
    return count


@quick
@given(homes(), seeds())
def test_line_of_sight_agrees_with_every_wall_in_both_directions_and_any_mesh(polygons, seed):
    home, rng = home_of(polygons), np.random.default_rng(seed)

    for mesh in (home.mesh, shuffled(home.mesh, rng)):
        check_against_every_wall(home, mesh, rng)


def test_line_of_sight_agrees_with_every_wall_of_real_homes(shared_data):
    rng = np.random.default_rng(1)

    for home in all_homes(shared_data):
        assert check_against_every_wall(home, home.mesh, rng) > 50


@pytest.mark.parametrize("name", ["658e5214673c7a4e25b458e56bdb6144"])
def test_line_of_sight_is_the_same_in_the_turned_and_mirrored_home(shared_data, name):
    home = houseexpo(shared_data / "houseexpo" / f"{name}.json")
    rng = np.random.default_rng(2)
    eyes = awkward_points(home, rng, 6)
    points = np.concatenate([awkward_points(home, rng, 40), home.mesh.vertices])
    before = [_sees_each(home.mesh, eye, points) for eye in eyes]
    assert 0.02 < np.mean(before) < 0.6

    for turn in turns(home):
        turned = transformed(home, turn)
        moved = turn(points.astype(float)).astype(np.int64)
        for eye, expected in zip(turn(eyes.astype(float)).astype(np.int64), before, strict=True):
            assert np.array_equal(expected, _sees_each(turned.mesh, eye, moved))


def sees(home, eye, point):
    """Return one verdict."""
    return line_of_sight(home.mesh, *eye, locate(home.mesh, *eye), *point)


HALL = shapely.box(0, 0, 1280, 1280)
HALL_WITH_PILLAR = home_of([HALL - shapely.box(512, 512, 768, 768)])
CORNER_TO_CORNER = home_of(
    [HALL - shapely.box(200, 200, 600, 600) - shapely.box(600, 600, 900, 900)]
)
PILLAR_AT_WALL = home_of([HALL - Polygon([(640, 0), (800, 300), (480, 300)])])


@pytest.mark.parametrize(
    ("home", "eye", "point", "expected"),
    [
        pytest.param(HALL_WITH_PILLAR, (100, 640), (1100, 640), False, id="through a pillar"),
        pytest.param(HALL_WITH_PILLAR, (384, 640), (640, 384), False, id="touches a corner"),
        pytest.param(HALL_WITH_PILLAR, (382, 640), (638, 384), True, id="just misses a corner"),
        pytest.param(HALL_WITH_PILLAR, (256, 512), (1024, 512), False, id="along a wall"),
        pytest.param(HALL_WITH_PILLAR, (256, 511), (1024, 511), True, id="beside a wall"),
        pytest.param(HALL_WITH_PILLAR, (512, 640), (512, 640), False, id="itself on a wall"),
        pytest.param(HALL_WITH_PILLAR, (640, 640), (640, 640), False, id="itself in a pillar"),
        pytest.param(HALL_WITH_PILLAR, (-50, 100), (100, 100), False, id="into the home"),
        pytest.param(HALL_WITH_PILLAR, (100, 100), (0, 0), False, id="into a corner of the home"),
        pytest.param(CORNER_TO_CORNER, (500, 700), (700, 500), False, id="through a touch"),
        pytest.param(PILLAR_AT_WALL, (100, 150), (1200, 150), False, id="pillar at a wall"),
    ],
)
def test_line_of_sight(home, eye, point, expected):
    assert expected == sees(home, eye, point) == sees(home, point, eye)
    assert [expected] == visible(home.walls, np.array(eye), np.array([point])).tolist()


@pytest.mark.parametrize("length", [640, 6400, 64000, 640000])
@pytest.mark.parametrize("thickness", [2, 8, 64])
def test_nobody_right_behind_the_middle_of_a_long_wall_is_seen(length, thickness):
    wall = shapely.box(256, 512, 256 + length, 512 + thickness)
    home = home_of([shapely.box(128, 128, length + 384, 1024).difference(wall)])
    middle = 256 + length // 2

    for offset in range(-150, 151, 7):
        for behind in (1, 3, 40):
            point = (middle + offset, 512 + thickness + behind)
            assert not sees(home, (middle, 400), point)
            assert not sees(home, point, (middle + offset, 511))


@quick
@given(homes(), seeds(), st.integers(0, 700), st.integers(0, 40))
def test_nearest_cells_in_sight_equal_the_slow_ones(polygons, seed, reach, most):
    home = home_of(polygons)
    rng = np.random.default_rng(seed)
    cells = rng.random((home.rows, home.columns)) < 0.8
    for eye in awkward_points(home, rng, EYES):
        wanted = int(rng.integers(0, most + 1))
        expected = nearest_slowly(home.walls, cells, tuple(eye.tolist()), reach, most, wanted)
        found = nearest_cells_in_sight(home.mesh, cells, *eye.tolist(), reach, most, wanted)
        assert expected == found.tolist()


@quick
@given(homes(), seeds())
def test_vertices_seen_from_a_point_are_those_no_wall_blocks(polygons, seed):
    home, rng = home_of(polygons), np.random.default_rng(seed)
    mesh = shuffled(home.mesh, rng)
    corners = {(x, y) for x, y in mesh.vertices.tolist()}

    for x, y in awkward_points(home, rng, 2).tolist():
        seen = vertices_seen_from_point(mesh, x, y)
        visible = [tuple(vertex) for vertex in mesh.vertices[seen].tolist()]
        if locate(mesh, x, y) == -1:
            expected = set()
        elif (x, y) in corners:
            expected = {(x, y)}
        else:
            expected = vertices_seen(home.walls, (x, y))
        assert len(set(visible)) == len(visible)
        assert expected == set(visible)


@quick
@given(homes(), seeds())
def test_vertices_seen_from_a_vertex_are_those_no_wall_blocks(polygons, seed):
    home = home_of(polygons)
    mesh = shuffled(home.mesh, np.random.default_rng(seed))

    for vertex in range(0, len(mesh.vertices), 3):
        seen = vertices_seen_from_vertex(mesh, vertex)
        visible = [tuple(other) for other in mesh.vertices[seen].tolist()]
        x, y = mesh.vertices[vertex].tolist()
        assert len(set(visible)) == len(visible)
        assert vertices_seen(home.walls, (x, y)) == set(visible)


def test_fans_list_each_triangle_at_its_three_corners():
    start, triangles = build_fans(HALL_WITH_PILLAR.mesh)

    for vertex in range(len(HALL_WITH_PILLAR.mesh.vertices)):
        expected = np.flatnonzero((HALL_WITH_PILLAR.mesh.triangles == vertex).any(axis=1))
        at_vertex = triangles[start[vertex] : start[vertex + 1]]
        assert expected.tolist() == at_vertex.tolist()
