"""Many points looked at from one place: which are in sight, and which in range and angle."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.headings import QUARTER, TURN
from fleet2d.kernels.mesh import Int64, Mesh, locate
from fleet2d.kernels.seen import Reach, left_of
from fleet2d.kernels.sight import line_of_sight


@kernel
def points_in_sight(mesh: Mesh, x: int, y: int, points: Int64) -> NDArray[np.bool_]:
    """Return bool (n,), which of the points int64 (n, 2) a line of sight leads to from (x, y)."""
    found = np.zeros(points.shape[0], np.bool_)
    triangle = locate(mesh, x, y)
    for i in range(points.shape[0]):
        found[i] = line_of_sight(mesh, x, y, triangle, points[i, 0], points[i, 1])
    return found


@kernel
def points_in_reach(x: int, y: int, heading: int, reach: Reach, points: Int64) -> NDArray[np.bool_]:
    """Return bool (n,), which of the points are in range and within the angle, walls apart."""
    found = np.zeros(points.shape[0], np.bool_)
    half = reach.half_angle
    a, b = left_of(2 * heading - half)
    c, d = left_of(2 * heading + half)
    for i in range(points.shape[0]):
        dx, dy = points[i, 0] - x, points[i, 1] - y
        if not reach.near_squared <= dx * dx + dy * dy <= reach.far_squared:
            continue
        in_right, in_left = a * dx + b * dy >= 0, c * dx + d * dy <= 0
        if half >= TURN:
            found[i] = True
        elif half <= 2 * QUARTER:
            found[i] = in_right and in_left
        else:
            found[i] = in_right or in_left
    return found
