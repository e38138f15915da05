"""Many points from one place: which are in sight, which in range and angle; and the best place."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from tests.meshed_homes import awkward_points, home_of
from tests.strategies import homes, quick, seeds

from fleet2d.kernels import (
    best_view,
    points_in_sight,
    points_near,
)

HALVES_OF_EIGHT = np.array([(1, 0), (0.7, 0.7), (0, 1), (-0.7, 0.7)])


def best_by_counting(mesh, places, points, far, cosine):
    """Return what `best_view` does, by the counts at all places and in all directions."""
    directions = np.concatenate([HALVES_OF_EIGHT, -HALVES_OF_EIGHT])
    counts = []
    for x, y in places.tolist():
        x_gaps, y_gaps = (points - (x, y)).T.astype(np.float64)
        length = np.sqrt(x_gaps * x_gaps + y_gaps * y_gaps)
        is_seen = points_in_sight(mesh, x, y, points) & (length * length <= far + 0.5)
        for along, up in directions:
            is_ahead = x_gaps * along + y_gaps * up >= length * cosine
            counts.append(int((is_seen & is_ahead).sum()))
    best = int(np.argmax(counts))
    return divmod(best, len(directions)) if counts[best] else None


@quick
@given(homes(), seeds())
def test_best_view_is_the_first_of_those_that_show_most(polygons, seed):
    home, rng = home_of(polygons), np.random.default_rng(seed)
    places, points = awkward_points(home, rng, 3), awkward_points(home, rng, 8)
    for far in (0.0, 300.0**2, 1e9):
        for cosine in (1.5, 0.9, 0.0, -0.6):
            expected = best_by_counting(home.mesh, places, points, far, cosine)
            assert expected == best_view(home.mesh, places, points, far, HALVES_OF_EIGHT, cosine)


def near(points, line, reach):
    """Return which points are near a line, by shapely."""
    return (shapely.distance(shapely.points(points), shapely.LineString(line)) < reach).tolist()


@quick
@given(seeds())
def test_points_near_a_line_are_those_of_shapely(seed):
    rng = np.random.default_rng(seed)
    points = rng.integers(-200, 200, (300, 2))
    line = rng.integers(-200, 200, (int(rng.integers(2, 6)), 2))
    line[-1] = line[int(rng.integers(len(line)))]  # it may stand still, and come back
    for reach in (0.0, 1.0, 5.0, 12.5, 25.0, 90.0):
        assert near(points, line, reach) == points_near(points, line, reach).tolist()


@pytest.mark.parametrize(
    ("line", "reach", "expected"),
    [
        ([[0, 0], [10, 0]], 4.5, [True, True, False, True]),
        ([[5, 3], [5, 3]], 1.5, [True, True, False, False]),
        ([[0, 0], [10, 0]], 0.0, [False] * 4),
        ([[5, 3]], 9.0, [False] * 4),
        ([], 9.0, [False] * 4),
    ],
)
def test_points_near_lines_at_the_edge(line, reach, expected):
    points = np.array([[5, 3], [5, 4], [15, 0], [-1, 0]])

    result = points_near(points, np.array(line, np.int64).reshape(-1, 2), reach)

    assert expected == result.tolist()


def test_points_at_the_very_distance_are_as_in_shapely():
    """3-4-5 triangles: the distance of points is exactly 5, which roundings may miss."""
    line = np.array([[-400, -300], [400, 300], [0, 600]])
    points = np.array([[x, y] for x in range(-60, 60) for y in range(-60, 60)])
    for reach in (5.0, 10.0, 35.0):
        assert near(points, line, reach) == points_near(points, line, reach).tolist()
