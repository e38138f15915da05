"""Many points looked at from one place: which are in sight, and which in range and angle.

And for methods that are not compiled: what there is to ask over many steps, nothing twice in a row.
"""

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.headings import QUARTER, TURN
from fleet2d.kernels.lens import Lenses, camera_pose, near_wedge
from fleet2d.kernels.mesh import Int32, Int64, Mesh, locate
from fleet2d.kernels.motion import Poses
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


# The columns of a question: whose camera and body, where the camera is, and the body's centre.
CAMERA, BODY, EYE_X, EYE_Y, EYE_HEADING, BODY_X, BODY_Y = range(7)
QUESTION = 7


@kernel
def questions(
    lenses: Lenses,
    widest: Int64,
    slack: int,
    robot: Poses,
    xs: Int64,
    ys: Int64,
    aways: NDArray[np.uint8],
    first: int,
    step_us: int,
) -> tuple[Int64, Int32]:
    """List who may be in view of which camera when: near enough, and not far beside the angle.

    Args:
        lenses: The cameras.
        widest: int64 (cameras, bodies), the squared distance from which on nobody is in view.
        slack: How far beside the angle somebody may be [lattice units].
        robot: The poses of whoever has the cameras, n of them.
        xs: int64 (bodies, n), where the others are.
        ys: int64 (bodies, n).
        aways: uint8 (bodies, n), not 0 while one isn't at home.
        first: The step of the first pose.
        step_us: Length of a step.

    Returns:
        int64 (m, QUESTION) by camera and body, and int32 (cameras, bodies, n): the number of the
        question that each step asks, from 1 on; 0 for none. A question that is the one before is
        asked once.
    """
    cameras, bodies = widest.shape
    steps = robot.x.shape[0]
    asked = np.zeros((cameras, bodies, steps), np.int32)
    found = np.empty((cameras * bodies * steps, QUESTION), np.int64)
    count = 0
    for c in range(cameras):
        period, half_angle = lenses.period[c], lenses.half_angle[c]
        for j in range(-first % period, steps, period):
            if robot.away[j]:
                continue
            x, y, heading = camera_pose(
                lenses, c, robot.x[j], robot.y[j], robot.heading[j], (first + j) * step_us
            )
            for u in range(bodies):
                dx, dy = xs[u, j] - x, ys[u, j] - y
                if aways[u, j] or dx * dx + dy * dy > widest[c, u]:
                    continue
                if not near_wedge(heading, half_angle, dx, dy, lenses.reach[c, u] + slack):
                    continue
                last = asked[c, u, j - period] if j >= period else 0
                if last > 0:
                    before = found[last - 1]
                    if (
                        before[EYE_X] == x and before[EYE_Y] == y and before[EYE_HEADING] == heading
                        and before[BODY_X] == xs[u, j] and before[BODY_Y] == ys[u, j]
                    ):  # fmt: skip
                        asked[c, u, j] = last
                        continue
                row = found[count]
                row[CAMERA], row[BODY], row[EYE_X], row[EYE_Y] = c, u, x, y
                row[EYE_HEADING], row[BODY_X], row[BODY_Y] = heading, xs[u, j], ys[u, j]
                count += 1
                asked[c, u, j] = count
    return found[:count], asked
