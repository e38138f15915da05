"""Where cameras are, and what lies in their angle, against trigonometry."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from tests.reference import detections as slow
from tests.sight.watching import SIDE_M, UNITS_PER_M, scene
from tests.strategies import quick

from fleet2d._core import camera_pose, hides, in_wedge, near_wedge
from fleet2d.kernels import camera_poses
from fleet2d.sight.camera import Camera, stack_lenses

MIDDLE = round(SIDE_M / 2 * UNITS_PER_M)
OFFSET = st.integers(-4000, 4000)


def lenses(**camera):
    """Return one camera."""
    lens = Camera.model_validate(camera).lens(UNITS_PER_M, 10**6)
    return stack_lenses([lens], [False], scene())


@pytest.mark.parametrize("pan", [None, {"headings_deg": [-45, 0, 100], "dwell": "7 s"}])
def test_poses_of_a_camera_at_many_moments_are_those_at_each(pan):
    stacked = lenses(offset=[0.3, -0.2], heading_deg=77, pan=pan)
    moments = np.arange(200) * 333_333
    x, y, heading = 90_000 - 311 * moments // 10**6, 4 * np.arange(200), 37 * np.arange(200) % 4096
    poses = camera_poses(stacked, 0, (x, y, heading), moments)
    bodies = zip(x.tolist(), y.tolist(), heading.tolist(), moments.tolist(), strict=True)
    expected = [camera_pose(stacked, 0, *body) for body in bodies]
    assert expected == list(zip(*(column.tolist() for column in poses), strict=True))


@quick
@given(st.integers(0, 4095), st.integers(1, 4096), OFFSET, OFFSET, st.integers(0, 600))
def test_no_body_that_reaches_into_a_wedge_is_left_out(heading, half, dx, dy, reach):
    """The quick test may be wrong one way only."""
    rim = [
        (round(reach * math.cos(a)), round(reach * math.sin(a))) for a in np.linspace(0, 6.2, 12)
    ]
    if any(in_wedge(heading, half, dx + x, dy + y) for x, y in [(0, 0), *rim]):
        assert near_wedge(heading, half, dx, dy, reach + 1)


def test_a_body_at_the_very_place_of_the_eye_is_hidden_by_nobody():
    assert not hides(0, 0, 3, 0, 10)


FAR = st.one_of(st.integers(-60, 60), st.integers(-(2**26), 2**26))


@quick
@given(FAR, FAR, FAR, FAR, st.one_of(st.integers(1, 60), st.integers(1, 2**17 - 1)))
def test_points_hidden_by_a_body_equal_exact_fractions(px, py, bx, by, radius):
    assert slow.hides((px, py), (bx, by), radius) == hides(px, py, bx, by, radius)


@quick
@given(FAR, FAR, st.integers(1, 63), st.integers(1, 2**17 - 1), st.integers(-2, 2))
def test_hiding_is_exact_at_the_rim_of_a_body(px, py, part, radius, beside):
    """Centres a radius away from the line, as nearly as the lattice has them."""
    length = math.hypot(px, py) or 1
    bx = round(px * part / 64 - py * radius / length) + beside
    by = round(py * part / 64 + px * radius / length)
    assume(max(abs(bx), abs(by)) <= 2**26)

    assert slow.hides((px, py), (bx, by), radius) == hides(px, py, bx, by, radius)
