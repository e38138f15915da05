"""Who is in view by a method that is not compiled: asked in Python, once per change of poses."""

import numpy as np
from numpy.typing import NDArray

from fleet2d.floorplan.home import Home
from fleet2d.kernels.lens import Lenses, camera_pose
from fleet2d.kernels.look import Crowd
from fleet2d.kernels.motion import Poses
from fleet2d.kernels.seen import Reach
from fleet2d.sight.fov import FieldOfView


def points_seen(
    method: FieldOfView,
    home: Home,
    lenses: Lenses,
    robot: Poses,
    crowd: Crowd,
    first: int,
    step_us: int,
) -> NDArray[np.uint8]:
    """Return how many points of each user's body are in view of each camera at each step.

    Args:
        method: What tells whether a point is in view.
        home: The home.
        lenses: The robot's cameras.
        robot: Its poses, n of them.
        crowd: The users.
        first: The step of the first pose.
        step_us: Length of a step.

    Returns:
        uint8 (cameras, users, n).
    """
    cameras, users = lenses.widest.shape
    steps = len(robot.x)
    seen = np.zeros((cameras, users, steps), np.uint8)
    begins = _changes(lenses, robot, crowd, first, step_us)
    for begin, end in zip(begins, [*begins[1:], steps], strict=True):
        if robot.away[begin]:
            continue
        at = (int(robot.x[begin]), int(robot.y[begin]), int(robot.heading[begin]))
        xy = np.stack([crowd.x[:, begin], crowd.y[:, begin]], axis=1)
        for camera in range(cameras):
            x, y, heading = camera_pose(lenses, camera, *at, (first + begin) * step_us)
            reach = Reach(
                int(lenses.near_squared[camera]),
                int(lenses.far_squared[camera]),
                int(lenses.half_angle[camera]),
            )
            near = ((xy - (x, y)) ** 2).sum(axis=1) <= lenses.widest[camera]
            for user in np.flatnonzero(near & (crowd.away[:, begin] == 0)).tolist():
                body = lenses.bodies[camera, user, : int(lenses.points[camera]) + 1]
                found = method.sees(home, int(x), int(y), int(heading), reach, xy[user] + body)
                seen[camera, user, begin:end] = np.count_nonzero(found)
    return seen


def _changes(lenses: Lenses, robot: Poses, crowd: Crowd, first: int, step_us: int) -> list[int]:
    """Return the columns at which the robot, a user or a camera has moved, and the first one."""
    steps = len(robot.x)
    moments = (first + np.arange(steps)) * step_us
    state = [robot.x, robot.y, robot.heading, robot.away, *crowd.x, *crowd.y, *crowd.away]
    state += [
        moments // lenses.pan_us[camera] for camera in np.flatnonzero(lenses.pan_count).tolist()
    ]
    moved = np.zeros(steps, np.bool_)
    moved[:1] = True
    for values in state:
        moved[1:] |= np.diff(values.astype(np.int64)) != 0
    changes: list[int] = np.flatnonzero(moved).tolist()
    return changes
