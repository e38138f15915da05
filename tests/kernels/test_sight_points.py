"""Many points from one place: which are in sight, and which in range and angle."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from shapely.geometry import Polygon
from tests.homes import all_homes, awkward_points, behind_corners, home_of
from tests.reference.line_of_sight import visible
from tests.strategies import homes, quick, seeds

from fleet2d.kernels import I64, Reach, half_sine, points_in_reach, points_in_sight

HALVES = [1, 700, 1229, 2047, 2048, 2049, 3000, 4095, 4096]


def in_reach(x: int, y: int, heading: int, reach: Reach, px: int, py: int) -> bool:
    """Return the verdict on one point, in plain Python integers."""
    dx, dy = px - x, py - y
    if not reach.near_squared <= dx * dx + dy * dy <= reach.far_squared:
        return False

    def side(half: int) -> int:
        """Positive: left of a direction [1/8192 of a turn]."""
        along, up = int(half_sine(half + 2048)), int(half_sine(half))
        return along * dy - up * dx

    if reach.half_angle >= 4096:
        return True
    from_right = side(2 * heading - reach.half_angle) >= 0
    to_left = side(2 * heading + reach.half_angle) <= 0
    return (from_right and to_left) if reach.half_angle <= 2048 else (from_right or to_left)


@pytest.mark.parametrize("half", HALVES)
def test_points_in_reach_equal_plain_integers(half: int) -> None:
    rng = np.random.default_rng(half)
    x, y = 1000, 700
    around = rng.integers(-300, 300, (60, 2))
    along = np.array([(s * d, t * d) for d in (1, 40, 100) for s in (-1, 0, 1) for t in (-1, 0, 1)])
    points = np.concatenate([around, along]) + np.array([x, y])
    for heading in (0, 512, 1024, 2048, 3333):
        for near, far in ((0, 300), (40, 100), (1, 10_000)):
            reach = Reach(near * near, far * far, half)
            expected = [in_reach(x, y, heading, reach, *point) for point in points.tolist()]
            assert expected == points_in_reach(x, y, heading, reach, points).tolist()


@quick
@given(homes(), seeds())
def test_points_in_sight_are_those_that_no_wall_hides(polygons: list[Polygon], seed: int) -> None:
    home, rng = home_of(polygons), np.random.default_rng(seed)
    for eye in awkward_points(home, rng, 1):
        points = np.concatenate([awkward_points(home, rng, 4), behind_corners(home, eye, rng, 4)])
        expected = visible(home.walls, eye, points)
        assert np.array_equal(expected, points_in_sight(home.mesh, *eye.tolist(), points))


def test_points_in_sight_are_those_that_no_wall_hides_in_real_homes(shared_data: Path) -> None:
    rng, seen = np.random.default_rng(2), 0
    for home in all_homes(shared_data):
        for eye in awkward_points(home, rng, 3):
            points = np.concatenate(
                [awkward_points(home, rng, 9), behind_corners(home, eye, rng, 9)]
            )
            expected = visible(home.walls, eye, points)
            assert np.array_equal(expected, points_in_sight(home.mesh, *eye.tolist(), points))
            seen += int(expected.sum())
    assert seen > 200


@pytest.mark.parametrize("points", [np.array([[33, 33, 1]]), np.array([[33, 2**40]])])
def test_points_that_are_none_are_refused(points: I64) -> None:
    home = home_of([Polygon([(0, 0), (640, 0), (640, 640), (0, 640)])])

    with pytest.raises(ValueError, match="points"):
        points_in_sight(home.mesh, 5, 5, points)
    with pytest.raises(ValueError, match="points"):
        points_in_reach(5, 5, 0, Reach(0, 100, 1), points)
