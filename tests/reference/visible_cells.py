"""The slow, obvious twin of the seen area: every cell's centre is asked for by itself."""

import numpy as np
from tests.reference.line_of_sight import visible


def half_planes(heading, half_angle, away, sines):
    """Return which vectors (n, 2) lie within `half_angle` [1/8192 turn] of a heading, or on it.

    The borders are those of a table of sines over a whole turn at that resolution.
    """
    if half_angle >= 4096:
        return np.ones(len(away), bool)
    right, left = (2 * heading - half_angle) % 8192, (2 * heading + half_angle) % 8192
    dx, dy = away.T
    from_right = sines[(right + 2048) % 8192] * dy - sines[right] * dx >= 0
    to_left = sines[left] * dx - sines[(left + 2048) % 8192] * dy >= 0
    return from_right & to_left if half_angle <= 2048 else from_right | to_left


def cells_in_view(
    walls,
    shape,
    pose,
    near,
    far,
    half_angle,
    sines,
):
    """Return bool (rows, columns): the cells whose centre is in view of (x, y, heading)."""
    x, y, heading = pose
    rows, columns = np.indices(shape)
    centres = np.stack([columns.ravel() * 64 + 33, rows.ravel() * 64 + 33], axis=1).astype(np.int64)
    away = centres - (x, y)
    squared = (away**2).sum(axis=1)
    inside = (near**2 <= squared) & (squared <= far**2)
    inside &= half_planes(heading, half_angle, away, sines)
    asked = np.flatnonzero(inside)
    inside[asked] = visible(walls, np.array([x, y], np.int64), centres[asked])
    return inside.reshape(shape)
