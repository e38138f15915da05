"""Sightings that are far off along the ray."""

import numpy as np
from tests.sight.sightings import sightings

from fleet2d.sight.built_in_errors import Outliers

MANY = 20_000


def errors(outliers):
    """Return the errors in distance of many looks, one a step, at somebody 50 m away."""
    seen = sightings(x=np.full(MANY, 50.0), y=np.zeros(MANY), camera=(0.0, 0.0))
    off = outliers.distort(seen)
    np.testing.assert_array_equal(0, off.y)
    return off.x - 50


def test_a_share_is_off_by_bell_shaped_errors():
    off = errors(Outliers(share="5 %", spread="80 cm"))
    is_off = off != 0
    assert abs(is_off.mean() - 0.05) < 4.5 * np.sqrt(0.05 * 0.95 / MANY)
    assert abs(off[is_off].mean()) < 4.5 * 0.8 / np.sqrt(is_off.sum())
    assert abs(off[is_off].std() - 0.8) < 4.5 * 0.8 / np.sqrt(2 * is_off.sum())


def test_outliers_last():
    is_off = errors(Outliers(share="20 %", lasts="10 s")) != 0
    groups = is_off.reshape(-1, 10).mean(axis=1)
    assert {True} == set((groups < 0.05) | (groups > 0.85))  # an error may be as small as nothing
    assert abs((groups > 0.5).mean() - 0.2) < 4.5 * np.sqrt(0.2 * 0.8 / len(groups))
