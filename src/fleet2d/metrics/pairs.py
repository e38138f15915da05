"""What metrics about robots and people share: every robot with every user, step by step."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.history import History
from fleet2d.algorithms.poses import BodyPoses
from fleet2d.kernels.points import points_in_sight

if TYPE_CHECKING:
    from fleet2d.algorithms.algorithm import Present
    from fleet2d.floorplan.plan import FloorPlan

DAY_S = 86_400.0

Bool = NDArray[np.bool_]


class Pair(NamedTuple):
    """A robot and a user over some steps.

    Attributes:
        robot: The robot's name.
        user: The user's name.
        at_robot: Poses of the robot.
        at_user: Poses of the user.
    """

    robot: str
    user: str
    at_robot: BodyPoses
    at_user: BodyPoses

    @property
    def at_home(self) -> Bool:
        """At which steps both are at home: bool (steps,)."""
        home: Bool = ~(self.at_robot.away | self.at_user.away)
        return home

    @property
    def distance(self) -> NDArray[np.float64]:
        """Distance between the centres at each step [m], infinite while one is away."""
        gap = self.at_robot.xy - self.at_user.xy
        return np.where(self.at_home, np.sqrt((gap * gap).sum(axis=1)), np.inf)


def pairs_of(history: History, state: "Present") -> Iterator[Pair]:
    """Yield every robot with every user."""
    for robot in state.robots:
        for user in state.users:
            yield Pair(robot, user, history.poses(robot), history.poses(user))


def in_sight(plan: "FloorPlan", pair: Pair, steps: NDArray[np.int64]) -> Bool:
    """Return at which of some steps no wall of the plan stands between the two: bool (n,).

    Doors count as open, and furniture as low.
    """
    one = plan.lattice.to_lattice(pair.at_robot.xy[steps])
    other = plan.lattice.to_lattice(pair.at_user.xy[steps])
    places = np.concatenate([one, other], axis=1)
    seen = np.zeros(len(steps), np.bool_)
    moved = np.append(True, (places[1:] != places[:-1]).any(axis=1)) if len(places) else seen
    begins = np.flatnonzero(moved)
    for begin, end in zip(begins.tolist(), [*begins.tolist()[1:], len(places)], strict=False):
        x, y = one[begin].tolist()
        seen[begin:end] = points_in_sight(plan.mesh, x, y, other[[begin]])[0]
    return seen
