"""Cameras that are calibrated or mounted wrongly."""

import numpy as np
from tests.sight.sightings import sightings

from fleet2d.sight.built_in_errors import Miscalibration


def test_people_are_turned_round_the_camera_and_so_are_their_headings():
    seen = sightings(x=[3.0, 2.0], y=[1.0, 3.0], camera=(2.0, 1.0), heading=[0.0, 1.0])
    turned = Miscalibration(yaw_deg=90).distort(seen)
    np.testing.assert_allclose([2.0, 0.0], turned.x, atol=1e-9)
    np.testing.assert_allclose([2.0, 1.0], turned.y, atol=1e-9)
    np.testing.assert_allclose([np.pi / 2, 1 + np.pi / 2], turned.heading)


def test_distances_are_scaled_and_then_offset():
    seen = sightings(x=[4.0, 0.5], y=[5.0, 1.0], camera=(1.0, 1.0))
    off = Miscalibration(scale=1.1, offset="-60 cm").distort(seen)
    np.testing.assert_allclose([4.9, 0.0], off.distance, atol=1e-9)  # not behind the camera
    np.testing.assert_allclose([1 + 4.9 * 0.6, 1.0], off.x)


def test_without_numbers_it_moves_nobody():
    seen = sightings(x=[3.3, 2.2], y=[1.1, 3.7])
    same = Miscalibration().distort(seen)
    np.testing.assert_allclose(seen.x, same.x, atol=1e-12)
    np.testing.assert_allclose(seen.y, same.y, atol=1e-12)
