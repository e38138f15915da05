"""Distance that each body covers."""

from math import dist
from typing import Any, ClassVar

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric
from fleet2d.runtime.clock import DAY_S


@register("metric", "distance")
class Distance(Metric):
    """Metres that each body covers per day, as the sum of its moves from step to step."""

    unit: ClassVar[str] = "m a day"

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.metres: dict[str, float] = {}
        self.last: dict[str, tuple[float, float]] = {}
        self.days = 0.0

    def update(self, history: History, state: Present) -> Any:
        """Add up the moves."""
        for name in (*state.users, *state.robots):
            poses = history.poses(name)
            between = dist(self.last[name], poses.at(0)) if name in self.last else 0.0
            self.metres[name] = self.metres.get(name, 0.0) + between + poses.distance
            self.last[name] = poses.at(-1)
        self.days += len(history) * history.step_s / DAY_S

    def result(self) -> dict[str, Any]:
        """Return {name: metres per day}."""
        return {name: metres / self.days for name, metres in self.metres.items() if self.days}
