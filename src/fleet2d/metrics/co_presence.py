"""Share of users' time at home with a robot in the same room."""

from typing import Any, ClassVar

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric, pairs_of


@register("metric", "co_presence")
class CoPresence(Metric):
    """Share of a user's steps at home in which a robot is in the same room.

    For each robot and user: steps at which both are in the same room, divided by the steps at which
    the user is at home. Between two rooms, where no room is, they don't count as together.
    """

    unit: ClassVar[str] = "share of time at home"

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.steps: dict[tuple[str, str], list[int]] = {}  # together, at home

    def update(self, history: History, state: Present) -> Any:
        """Count the steps together."""
        for pair in pairs_of(history, state):
            counts = self.steps.setdefault((pair.robot, pair.user), [0, 0])
            counts[0] += pair.user_poses.steps_together(pair.robot_poses)
            counts[1] += pair.user_poses.steps_at_home

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: share}}, without users who were never at home."""
        results: dict[str, Any] = {}
        for (robot, user), (together, at_home) in self.steps.items():
            if at_home:
                results.setdefault(robot, {})[user] = together / at_home
        return results
