"""How much of the home a robot has seen."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric
from fleet2d.runtime.clock import HOUR_S

SHARES = {"half": 0.5, "most": 0.9}


@register("metric", "coverage")
class Coverage(Metric):
    """Share of the floor of all rooms that was in view of a robot, and times to half and 90 %.

    `share`: the cells of rooms that were in view at some step, as in the layer `first_seen`,
    divided by all cells of rooms, with furniture or without. `half_h`, `most_h`: hours from the
    start of the run to the step at which half, and 90 %, of these cells had been in view; left out
    if that never happened.
    """

    needs: ClassVar[frozenset[str]] = frozenset({"first_seen"})
    units: ClassVar[Mapping[str, str]] = {
        "share": "share of the floor",
        "half_h": "h",
        "most_h": "h",
    }

    def start(self, home: Home) -> None:
        """Begin without any cells seen."""
        self.first: dict[str, Any] = {}  # sorted first steps of the cells seen, by robot
        self.cells = int(np.count_nonzero(home.plan.room_of_cell >= 0))
        self.step_s = 0.0

    def update(self, history: History, state: Present) -> Any:
        """Read the layers of first steps; return a row for each robot."""
        self.step_s, inside = history.step_s, state.home.plan.room_of_cell >= 0
        for robot in state.robots:
            layer = f"first_seen.{robot}"
            if layer in state.home.layers:
                first = state.home.layers[layer].values[inside]
                self.first[robot] = np.sort(first[(first >= 0) & (first < history.end)])
        if not self.first:
            return None
        shares = [len(first) / self.cells for first in self.first.values()]
        return {"robot": np.array(list(self.first), dtype=object), "share": np.array(shares)}

    def result(self) -> dict[str, Any]:
        """Return {robot: {share, half_h, most_h}}, hours only where the share was reached."""
        numbers: dict[str, Any] = {}
        for robot, first in self.first.items():
            numbers[robot] = {"share": len(first) / self.cells}
            for name, share in SHARES.items():
                needed = int(np.ceil(share * self.cells))
                if 0 < needed <= len(first):
                    numbers[robot][f"{name}_h"] = int(first[needed - 1]) * self.step_s / HOUR_S
        return numbers
