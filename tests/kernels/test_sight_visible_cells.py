"""The cells in view: those that every single line of sight says, in every home, at every angle."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from tests.meshed_homes import (
    all_homes,
    awkward_points,
    home_of,
    shuffled,
    transformed,
    turns,
)
from tests.reference import visible_cells as slow
from tests.strategies import homes, quick, seeds

from fleet2d.kernels import (
    Reach,
    cells_in_view,
    half_sine,
    mark_spans,
    points_in_reach,
    points_in_sight,
)

SINES = np.array([half_sine(half) for half in range(8192)], np.int64)
HALVES = [1, 700, 1229, 2047, 2048, 2049, 3000, 4095, 4096]
ROOM = home_of([shapely.box(128, 128, 1280, 640).difference(shapely.box(500, 300, 700, 400))])


def mask_in_view(home, mesh, pose, reach):
    """Return the mask of the cells in view; no cell may be in two spans."""
    spans = cells_in_view(mesh, *pose, reach, home.rows, home.columns)
    mask = np.zeros((home.rows, home.columns), np.bool_)
    mark_spans(spans, mask)
    assert int(mask.sum()) == int((spans[:, 2] - spans[:, 1] + 1).sum())
    return mask


def by_lines(home, pose, reach):
    """Return the mask of the cells in view, each by its own line of sight."""
    centres = np.indices((home.rows, home.columns))[::-1].reshape(2, -1).T * 64 + 33
    mask = points_in_reach(*pose, reach, centres)
    mask[mask] = points_in_sight(home.mesh, *pose[:2], centres[mask])
    return mask.reshape(home.rows, home.columns)


def random_reach(rng):
    """Return near, far [lattice] and half angle, the odd ones often."""
    near = int(rng.choice([0, 0, 1, 64, 200, 500]))
    far = near + int(rng.choice([1, 64, 500, 1500, 6000, 200_000]))
    return near, far, int(rng.choice([*HALVES, rng.integers(1, 4097)]))


def random_pose(home, rng):
    """Return a pose at one of the awkward points, looking along an eighth of a turn or anywhere."""
    x, y = rng.choice(awkward_points(home, rng, 3)).tolist()
    heading = rng.integers(0, 8) * 512 if rng.random() < 0.5 else rng.integers(0, 4096)
    return x, y, int(heading)


@quick
@given(homes(), seeds())
def test_cells_equal_brute_force(polygons, seed):
    home, rng = home_of(polygons), np.random.default_rng(seed)
    mesh = shuffled(home.mesh, rng, 2)

    for _ in range(4):
        pose, (near, far, half) = random_pose(home, rng), random_reach(rng)
        shape = (home.rows, home.columns)
        expected = slow.cells_in_view(home.walls, shape, pose, near, far, half, SINES)
        in_view = mask_in_view(home, mesh, pose, Reach(near**2, far**2, half))
        assert np.array_equal(expected, in_view), (pose, near, far, half)
        assert np.array_equal(expected, by_lines(home, pose, Reach(near**2, far**2, half)))


@pytest.mark.parametrize("half", HALVES)
@pytest.mark.parametrize("at", [(33, 33), (0, 0), (40, 2), (33, 0), (0, 33)])
def test_cells_round_a_pillar_equal_brute_force(half, at):
    for heading in range(0, 4096, 256):
        pose = (320 + at[0], 192 + at[1], heading)
        shape = (ROOM.rows, ROOM.columns)
        expected = slow.cells_in_view(ROOM.walls, shape, pose, 70, 700, half, SINES)
        assert np.array_equal(
            expected, mask_in_view(ROOM, ROOM.mesh, pose, Reach(4900, 490_000, half))
        )


def test_cells_are_those_in_line_of_sight_in_real_homes_turned_and_mirrored(shared_data):
    rng = np.random.default_rng(8)
    compared = 0
    for number, home in enumerate(all_homes(shared_data)):
        for turn in [list(turns(home))[i] for i in (0, 1 + number % 7)]:
            turned = transformed(home, turn)
            for _ in range(6):
                pose, (near, far, half) = random_pose(turned, rng), random_reach(rng)
                reach = Reach(near**2, far**2, half)
                expected = by_lines(turned, pose, reach)
                assert np.array_equal(expected, mask_in_view(turned, turned.mesh, pose, reach)), (
                    pose
                )
                compared += expected.size
    assert compared > 200_000 * (number + 1)
