"""Time that robots spend in people's personal space."""

from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric, in_sight, pairs_of
from fleet2d.runtime.clock import DAY_S

# Hall's zones, by the distance at which they end [m].
ZONES = {"intimate": 0.45, "personal": 1.2, "social": 3.6}


@register("metric", "intrusion")
class Intrusion(Metric):
    """Minutes a day that a robot is in each of Hall's zones of a user.

    Intimate: nearer than 0.45 m; personal: 0.45 to 1.2 m; social: 1.2 to 3.6 m, between the
    centres. Only steps count at which both are at home and no wall is between them. It is a proxy:
    how people feel about a robot depends on much else.
    """

    hidden: ClassVar[frozenset[str]] = frozenset({"social"})
    unit: ClassVar[str] = "min a day"

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.minutes: dict[tuple[str, str], list[float]] = {}
        self.days = 0.0

    def update(self, history: History, state: Present) -> Any:
        """Count the steps in each zone; return a row for each robot and user."""
        rows: dict[str, list[Any]] = {name: [] for name in ("robot", "user", *ZONES)}
        for pair in pairs_of(history, state):
            distance = pair.distance
            near = np.flatnonzero(distance < max(ZONES.values()))
            near = near[in_sight(state.home.plan, pair, near)]
            edges = [0.0, *ZONES.values()]
            counts = [
                np.count_nonzero((distance[near] >= low) & (distance[near] < high))
                for low, high in pairwise(edges)
            ]
            minutes = [int(count) * history.step_s / 60 for count in counts]
            total = self.minutes.setdefault((pair.robot, pair.user), [0.0] * len(ZONES))
            total[:] = [a + b for a, b in zip(total, minutes, strict=True)]
            for name, value in zip(rows, (pair.robot, pair.user, *minutes), strict=True):
                rows[name].append(value)
        self.days += len(history) * history.step_s / DAY_S
        return {name: np.array(column) for name, column in rows.items()} if rows["robot"] else None

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: {zone: minutes a day}}}."""
        minutes_by_robot: dict[str, Any] = {}
        for (robot, user), minutes in self.minutes.items():
            minutes_by_robot.setdefault(robot, {})[user] = {
                zone: m / self.days for zone, m in zip(ZONES, minutes, strict=True)
            }
        return minutes_by_robot
