"""How much of their time at home people have a robot in the room."""

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from fleet2d.algorithms.history import History
from fleet2d.component import register
from fleet2d.metrics.metric import Metric
from fleet2d.metrics.pairs import pairs_of

if TYPE_CHECKING:
    from fleet2d.algorithms.algorithm import Present
    from fleet2d.floorplan.home.home import Home


@register("metric", "co_presence")
class CoPresence(Metric):
    """Share of a user's steps at home in which a robot is in the same room.

    For each robot and user: steps at which the user is at home and both are in the same room,
    divided by the steps at which the user is at home. Where no room is, between two, nobody is
    together.
    """

    unit: ClassVar[str] = "share of time at home"

    def start(self, home: "Home") -> None:
        """Begin counting."""
        self.steps: dict[tuple[str, str], list[int]] = {}  # together, at home

    def update(self, history: History, state: "Present") -> Any:
        """Count the steps together."""
        for pair in pairs_of(history, state):
            room = pair.at_user.room
            together = (room >= 0) & (room == pair.at_robot.room)
            counts = self.steps.setdefault((pair.robot, pair.user), [0, 0])
            counts[0] += int(np.count_nonzero(together))
            counts[1] += int(np.count_nonzero(~pair.at_user.away))

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: share}}; a user who was never at home has none."""
        found: dict[str, Any] = {}
        for (robot, user), (together, at_home) in self.steps.items():
            if at_home:
                found.setdefault(robot, {})[user] = together / at_home
        return found
