"""How robots use their batteries."""

from collections.abc import Mapping
from typing import Any, ClassVar

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric
from fleet2d.runtime.clock import DAY_S


@register("metric", "battery")
class BatteryUse(Metric):
    """Lowest charge, dockings a day, and shares of time charging and empty, of each robot.

    From the events `battery`, `docks` and `charged`. `lowest` is the lowest charge in these events:
    they happen at decisions, after a change of 5 %, when the robot docks, and when it is empty.
    `dockings` counts `docks`. `charging` is the share of the run's steps from a `docks` to the
    `charged` after it, or to the end of the run; a robot at its charger charges at other times,
    too. `empty` is the share of steps with an empty battery, from which on the robot stands still.
    """

    units: ClassVar[Mapping[str, str]] = {
        "lowest": "share of a full charge",
        "dockings": "a day",
        "charging": "share of time",
        "empty": "share of time",
    }

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.lowest: dict[str, float] = {}
        self.dockings: dict[str, int] = {}
        self.docked_at: dict[str, int] = {}
        self.charging: dict[str, int] = {}  # steps
        self.empty_at: dict[str, int] = {}
        self.steps = 0
        self.step_s = 1.0

    def update(self, history: History, state: Present) -> Any:
        """Read the events."""
        for event in history.events:
            name = event.entity
            if event.event in ("battery", "docks", "charged"):
                level = float(event.detail.removesuffix(" %")) / 100
                self.lowest[name] = min(self.lowest.get(name, 1.0), level)
                if event.event == "battery" and level == 0:
                    self.empty_at.setdefault(name, event.step)
            if event.event == "docks":
                self.dockings[name] = self.dockings.get(name, 0) + 1
                self.docked_at[name] = event.step
            elif event.event == "charged" and name in self.docked_at:
                steps = event.step - self.docked_at.pop(name)
                self.charging[name] = self.charging.get(name, 0) + steps
        self.steps, self.step_s = history.end, history.step_s

    def result(self) -> dict[str, Any]:
        """Return {robot: {lowest, dockings, charging}}, and empty of those that ran empty."""
        numbers = {}
        for name, lowest in self.lowest.items():
            present = self.steps - self.docked_at[name] if name in self.docked_at else 0
            numbers[name] = {
                "lowest": lowest,
                "dockings": self.dockings.get(name, 0) / (self.steps * self.step_s / DAY_S),
                "charging": (self.charging.get(name, 0) + present) / self.steps,
            }
            if name in self.empty_at:
                numbers[name]["empty"] = (self.steps - self.empty_at[name]) / self.steps
        return numbers
