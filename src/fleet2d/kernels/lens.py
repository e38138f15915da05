"""The cameras of a robot: their poses, and what is in their view."""

from typing import NamedTuple

from fleet2d._core import camera_pose, hides, in_wedge, near_wedge, points_in_view
from fleet2d.kernels import I64
from fleet2d.kernels.headings import TURN, turned

__all__ = [
    "Lenses",
    "camera_pose",
    "camera_poses",
    "hides",
    "in_wedge",
    "near_wedge",
    "points_in_view",
]


class Lenses(NamedTuple):
    """The constants of a robot's cameras; int64 (cameras,) unless noted otherwise."""

    near_squared: I64  # lattice units squared
    far_squared: I64
    half_angle: I64  # 1/8192 of a turn; 4096 and more is all round
    chance: I64  # probability of noticing a user in view, times 2**53
    moves: I64  # 0 if it is at the robot's centre and looks straight ahead
    forward: I64  # its position in the robot's frame [lattice units]
    left: I64
    heading: I64  # its heading relative to the robot's
    pans: I64  # (cameras, headings): added to `heading`, one after the other
    pan_count: I64
    pan_us: I64  # time at each of these headings
    period: I64  # steps from look to look
    latency: I64  # steps until a sighting is known
    errs: I64  # 1 where what is perceived can be wrong
    points: I64  # points of a user's body besides its centre that are looked at
    bodies: I64  # (cameras, users, points + 1, 2): where they are, from the centre; it is first
    reach: I64  # (cameras, users): how far they are from it
    widest: I64  # (cameras, users): farthest distance of a centre in view, squared


def camera_poses(
    lenses: Lenses, camera: int, body: tuple[I64, I64, I64], moments_us: I64
) -> tuple[I64, I64, I64]:
    """Return where a camera is and where it looks at some moments, as `camera_pose` does.

    Args:
        lenses: The cameras of a body.
        camera: The number of the camera.
        body: x, y [lattice units] and heading of the body, int64 (n,) each.
        moments_us: The times since the start, int64 (n,).
    """
    x, y, heading = body
    dx, dy = turned(lenses.forward[camera], lenses.left[camera], 2 * heading)
    looks = heading + lenses.heading[camera]
    if lenses.pan_count[camera]:
        looks = (
            looks
            + lenses.pans[camera][moments_us // lenses.pan_us[camera] % lenses.pan_count[camera]]
        )
    return x + dx, y + dy, looks % TURN
