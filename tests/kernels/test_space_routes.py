"""Shortest paths against Dijkstra over all corners, in free space with holes and pinches."""

import math
import pickle
from collections import defaultdict

import numpy as np
import pytest
import shapely
from hypothesis import given
from tests.meshed_homes import home_of, shuffled
from tests.reference.routes import graph_of, length_of, region_of, shortest, straight_ways
from tests.strategies import homes, quick, seeds

from fleet2d._core import distance
from fleet2d.kernels import Corners, Routes


def corners_of(home):
    """Return the nodes of a route graph: reflex corners, and vertices where several walls meet."""
    into, out_of = defaultdict(list), defaultdict(list)
    for ax, ay, bx, by in home.walls.tolist():
        out_of[ax, ay].append((bx, by))
        into[bx, by].append((ax, ay))
    rows = []
    for i, (x, y) in enumerate(home.mesh.vertices.tolist()):
        alone = len(into[x, y]) == 1
        for (ax, ay), (bx, by) in zip(into[x, y][:1], out_of[x, y][:1], strict=True):
            if not alone or (x - ax) * (by - y) < (y - ay) * (bx - x):
                rows.append((i, ax, ay, bx, by, alone))
    vertex, *ends, simple = np.array(rows, np.int64).reshape(-1, 6).T
    return Corners(vertex, np.stack(ends[:2], 1), np.stack(ends[2:], 1), simple.astype(np.bool_))


def routes_of(home):
    """Return the corners of a home and the legs between them."""
    return Routes(home.mesh, corners_of(home))


def legs_of(routes):
    """Return all legs, as arrays that can be compared."""
    return [routes.leg_start, routes.leg_end, routes.leg_length]


def some_points(home, rng, count):
    """Return points inside: centres of cells, and points in line with corners."""
    region = region_of(home.mesh.vertices, home.mesh.triangles)
    anywhere = rng.integers(0, [64 * home.columns, 64 * home.rows], (20 * count, 2))
    first, second = rng.choice(home.mesh.vertices, (2, 20 * count))
    tried = np.concatenate([anywhere, (first + second) // 2, 2 * second - first])
    rng.shuffle(tried)
    inside = shapely.contains_properly(region, shapely.points(tried))
    return np.asarray(tried[inside][:count], np.int64)


def check_routes(home, rng, count):
    """Compare paths between random points with the twin; return how many bend and how many fail."""
    vertices = home.mesh.vertices
    region, routes = region_of(vertices, home.mesh.triangles), routes_of(home)
    slow_graph = graph_of(region, vertices)
    points = some_points(home, rng, 2 * count)
    bent = failed = 0
    for start, goal in zip(points[::2], points[1::2], strict=False):
        expected = shortest(region, vertices, slow_graph, start, goal)
        path, back = routes.find(*start, *goal), routes.find(*goal, *start)
        if path is None:
            assert math.isinf(expected)
            assert back is None
            failed += 1
            continue
        assert back is not None
        assert [start.tolist(), goal.tolist()] == path[[0, -1]].tolist()
        assert straight_ways(region, path[:-1], path[1:]).all()
        assert math.isclose(expected, length_of(path), rel_tol=1e-9)
        assert math.isclose(expected, length_of(back), rel_tol=1e-9)
        bent += len(path) > 2
    return bent, failed


@quick
@given(homes(), seeds())
def test_find_route_is_as_short_as_dijkstra_over_all_corners(polygons, seed):
    check_routes(home_of(polygons), np.random.default_rng(seed), 6)


@quick
@given(homes(), seeds())
def test_find_route_does_not_depend_on_the_mesh(polygons, seed):
    home, rng = home_of(polygons), np.random.default_rng(seed)
    other = home._replace(mesh=shuffled(home.mesh, rng))
    routes, other_routes = routes_of(home), routes_of(other)
    points = some_points(home, rng, 8)

    assert all(map(np.array_equal, legs_of(routes), legs_of(other_routes)))
    for start, goal in zip(points[::2], points[1::2], strict=False):
        path, same = routes.find(*start, *goal), other_routes.find(*start, *goal)
        assert (path is None) == (same is None)
        assert path is None or np.array_equal(path, same)


def crowded(seed):
    """Return a hall full of slanted pillars."""
    rng = np.random.default_rng(seed)
    pillars = []
    for _ in range(22):
        centre, spread = rng.integers(300, 3800, 2), rng.integers(60, 500)
        outline = centre + rng.integers(-spread, spread, (6, 2))
        pillars.append(shapely.convex_hull(shapely.multipoints(outline)))
    hall = shapely.difference(
        shapely.box(0, 0, 4096, 4096), shapely.union_all(pillars), grid_size=2
    )
    return home_of([part for part in shapely.get_parts(hall) if part.area > 0])


@pytest.mark.parametrize("seed", range(4))
def test_find_route_among_many_pillars_is_as_short_as_dijkstra(seed):
    bent, _ = check_routes(crowded(seed), np.random.default_rng(seed), 40)

    assert bent > 15


def test_find_route_between_two_parts_is_none():
    home = home_of([shapely.box(0, 0, 640, 640), shapely.box(704, 0, 1344, 640)])
    routes = routes_of(home)

    assert routes.find(33, 33, 737, 33) is None
    assert routes.find(33, 33, 670, 33) is None
    assert routes.find(670, 33, 33, 33) is None


SQUARE = shapely.box(0, 0, 640, 640)
PILLARS = [shapely.box(128, 320, 320, 512), shapely.box(320, 128, 512, 320)]


@pytest.mark.parametrize(
    ("free", "route"),
    [
        pytest.param(SQUARE, [[33, 33], [33, 33]], id="of length 0 to its start"),
        pytest.param(
            SQUARE.difference(shapely.box(200, 100, 400, 600)),
            [[101, 301], [200, 100], [400, 100], [501, 301]],
            id="on the shorter side of a pillar",
        ),
        # The straight line touches corners: strictly no line of sight, but the shortest way.
        pytest.param(
            SQUARE - shapely.box(128, 64, 192, 320) - shapely.box(384, 128, 448, 320),
            [[64, 320], [128, 320], [192, 320], [384, 320], [448, 320], [512, 320]],
            id="along a row of corners",
        ),
        # The string bends round one pillar there, though it runs into the walls of the other.
        pytest.param(
            SQUARE.difference(shapely.union_all(PILLARS)),
            [[319, 129], [320, 320], [321, 511]],
            id="at a point where two pillars meet",
        ),
        # The tie goes to corners with lower ids: the lower way, as ids are sorted by x, then y.
        pytest.param(
            SQUARE.difference(shapely.box(220, 220, 420, 420)),
            [[100, 320], [220, 220], [420, 220], [540, 320]],
            id="among equal ones",
        ),
    ],
)
def test_find_route_bends_where_it_has_to(free, route):
    path = routes_of(home_of([free])).find(*route[0], *route[-1])

    assert path is not None
    assert route == path.tolist()


def test_find_route_again_returns_an_array_of_its_own():
    routes = routes_of(home_of([shapely.box(0, 0, 640, 640)]))

    first = routes.find(33, 33, 601, 97)
    assert first is not None
    first[:] = 0

    assert [[33, 33], [601, 97]] == np.asarray(routes.find(33, 33, 601, 97)).tolist()
    assert [[33, 33], [601, 99]] == np.asarray(routes.find(33, 33, 601, 99)).tolist()


def test_routes_keep_their_mesh_and_can_be_pickled():
    home = home_of([shapely.box(0, 0, 640, 640).difference(shapely.box(200, 100, 400, 600))])
    routes = routes_of(home)

    other = pickle.loads(pickle.dumps(routes))

    assert all(map(np.array_equal, legs_of(routes), legs_of(other)))
    ends = other.leg_end
    path = other.find(101, 301, 501, 301)
    del other
    assert path is not None
    assert [[101, 301], [200, 100], [400, 100], [501, 301]] == path.tolist()
    assert not ends.flags.writeable
    assert len(ends) == len(routes.leg_end)


def test_route_graph_has_each_leg_in_both_directions():
    routes = routes_of(crowded(1))
    begins = np.repeat(np.arange(len(routes.leg_start) - 1), np.diff(routes.leg_start))
    ends = zip(begins.tolist(), routes.leg_end.tolist(), strict=True)
    legs = dict(zip(ends, routes.leg_length.tolist(), strict=True))

    assert len(legs) == len(routes.leg_end)
    assert len(legs) > 20
    assert all(legs[b, a] == length for (a, b), length in legs.items())


@pytest.mark.parametrize(
    ("b", "expected"), [((0, 0), 0.0), ((3, 4), 5.0), ((2**20, 2**20), math.sqrt(2**41))]
)
def test_distance_is_the_correctly_rounded_root(b, expected):
    assert expected == distance(0, 0, *b) == distance(*b, 0, 0)
