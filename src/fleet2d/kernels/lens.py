"""The cameras of a robot: where they are, where they look, and what lies in their view."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.kernels._jit import kernel
from fleet2d.kernels.headings import QUARTER, TURN, UNIT, cosine, half_sine, sine
from fleet2d.kernels.mesh import Mesh
from fleet2d.kernels.sight import walk_line_of_sight

I64 = NDArray[np.int64]


class Lenses(NamedTuple):
    """The constants of a robot's cameras; int64 (cameras,), unless it says otherwise."""

    near_squared: I64  # lattice units squared
    far_squared: I64
    half_angle: I64  # 1/8192 of a turn; 4096 and more is all round
    chance: I64  # probability of noticing a user in view, times 2**53
    moves: I64  # 0 if it is at the robot's centre and looks straight ahead
    forward: I64  # where it sits, in the robot's frame [lattice units]
    left: I64
    heading: I64  # where it looks, from the robot's heading
    pans: I64  # (cameras, headings): added to `heading`, one after the other
    pan_count: I64
    pan_us: I64  # how long it looks in each
    period: I64  # steps from look to look
    latency: I64  # steps until a sighting is known
    errs: I64  # 1 where what is perceived can be wrong
    points: I64  # points of a user's body besides its centre that are looked at
    bodies: I64  # (cameras, users, points + 1, 2): where they are, from the centre; it is first
    reach: I64  # (cameras, users): how far they are from it
    widest: I64  # (cameras, users): farthest distance of a centre in view, squared


@kernel
def in_wedge(heading: int, half_angle: int, dx: int, dy: int) -> bool:
    """Tell whether (dx, dy) lies within `half_angle` [1/8192 turn] of a heading, or on it."""
    return near_wedge(heading, half_angle, dx, dy, 0)


@kernel
def near_wedge(heading: int, half_angle: int, dx: int, dy: int, reach: int) -> bool:
    """Tell whether anything within `reach` of (dx, dy) may lie in a wedge; exact at reach 0."""
    if half_angle >= TURN:
        return True
    right, left = 2 * heading - half_angle, 2 * heading + half_angle
    from_right = half_sine(right + 2 * QUARTER) * dy - half_sine(right) * dx
    to_left = half_sine(left) * dx - half_sine(left + 2 * QUARTER) * dy
    least = -reach * UNIT
    if half_angle <= 2 * QUARTER:
        # With a wedge of half a turn, both borders are one line: the test is the half plane.
        return from_right >= least and to_left >= least
    return from_right >= least or to_left >= least


@kernel
def camera_pose(
    lenses: Lenses, camera: int, x: int, y: int, heading: int, moment_us: int
) -> tuple[int, int, int]:
    """Return where a camera is and where it looks; the offset is rounded to the lattice."""
    forward, left = lenses.forward[camera], lenses.left[camera]
    if forward != 0 or left != 0:
        along, up = cosine(heading), sine(heading)
        x += (forward * along - left * up + UNIT // 2) >> 30
        y += (forward * up + left * along + UNIT // 2) >> 30
    heading += lenses.heading[camera]
    if lenses.pan_count[camera] > 0:
        turn = moment_us // lenses.pan_us[camera] % lenses.pan_count[camera]
        heading += lenses.pans[camera, turn]
    return x, y, heading & (TURN - 1)


@kernel
def points_in_view(
    walls: Mesh,
    lenses: Lenses,
    camera: int,
    user: int,
    x: int,
    y: int,
    heading: int,
    triangle: int,
    dx: int,
    dy: int,
) -> int:
    """Return how many points of a user's body are in view, the user's centre being at (dx, dy)."""
    near, far = lenses.near_squared[camera], lenses.far_squared[camera]
    half_angle, body = lenses.half_angle[camera], lenses.bodies[camera, user]
    vertices, triangles, neighbors = walls.vertices, walls.triangles, walls.neighbors
    shown = 0
    for i in range(lenses.points[camera] + 1):
        px, py = dx + body[i, 0], dy + body[i, 1]
        if near <= px * px + py * py <= far and in_wedge(heading, half_angle, px, py):
            if walk_line_of_sight(vertices, triangles, neighbors, x, y, triangle, x + px, y + py):
                shown += 1
    return shown
