"""Pairs of a robot and a user, which several metrics measure step by step."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.log import BodyPoses
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I64, Bool
from fleet2d.kernels.sight import points_in_sight


class RobotUserPair(NamedTuple):
    """A robot and a user over some steps.

    Attributes:
        robot: The robot's name.
        user: The user's name.
        robot_poses: Poses of the robot.
        user_poses: Poses of the user.
    """

    robot: str
    user: str
    robot_poses: BodyPoses
    user_poses: BodyPoses

    @property
    def at_home(self) -> Bool:
        """Whether both are at home at each step: bool (steps,)."""
        return ~(self.robot_poses.away | self.user_poses.away)

    @property
    def distance(self) -> F64:
        """Distance between the centres at each step [m]: float64 (steps,), infinite while away."""
        gap = self.robot_poses.xy - self.user_poses.xy
        return np.where(self.at_home, np.sqrt((gap * gap).sum(axis=1)), np.inf)


def pairs_of(history: History, state: Present) -> Iterator[RobotUserPair]:
    """Yield every robot with every user."""
    for robot in state.robots:
        for user in state.users:
            yield RobotUserPair(robot, user, history.poses(robot), history.poses(user))


def in_sight(plan: FloorPlan, pair: RobotUserPair, steps: I64) -> Bool:
    """Return whether no wall of the plan is between the two at each of some steps: bool (n,).

    Doors count as open, and furniture as too low to block the view.
    """
    robot_xy = plan.lattice.to_lattice(pair.robot_poses.xy[steps])
    user_xy = plan.lattice.to_lattice(pair.user_poses.xy[steps])
    places = np.concatenate([robot_xy, user_xy], axis=1)
    is_visible = np.zeros(len(steps), np.bool_)
    if not len(places):
        return is_visible
    has_moved = (places[1:] != places[:-1]).any(axis=1)
    begins = [0, *(np.flatnonzero(has_moved) + 1).tolist()]
    for begin, end in zip(begins, [*begins[1:], len(places)], strict=True):
        x, y = robot_xy[begin].tolist()
        is_visible[begin:end] = points_in_sight(plan.mesh, x, y, user_xy[[begin]])[0]
    return is_visible
