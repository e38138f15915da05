"""How much robots move about."""

from collections.abc import Mapping
from datetime import timedelta
from math import dist
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pydantic import Field

from fleet2d.algorithms.history import History
from fleet2d.component import register
from fleet2d.metrics.metric import Metric
from fleet2d.units import Length, PositiveDuration

if TYPE_CHECKING:
    from fleet2d.algorithms.algorithm import Present
    from fleet2d.floorplan.home.home import Home

Place = tuple[float, float]


@register("metric", "travel")
class Travel(Metric):
    """Relocations and metres a day, of each robot.

    A robot rests where it stays on the spot for `rest` or longer, turning or not. A relocation is a
    rest at a place more than `apart` from that of the rest before. Metres are the sum of the moves
    from step to step.
    """

    units: ClassVar[Mapping[str, str]] = {"relocations": "a day", "metres": "m a day"}

    rest: PositiveDuration = Field(
        default=timedelta(minutes=1), description="standing for so long is a rest"
    )
    apart: Length = Field(default=0.5, ge=0, description="two rests are at two places from then on")

    def start(self, home: "Home") -> None:
        """Begin counting."""
        self.metres: dict[str, float] = {}
        self.relocations: dict[str, int] = {}
        self.rested: dict[str, Place] = {}  # where the last rest was
        self.still: dict[str, tuple[Place, int]] = {}  # where it stands, and for how many steps
        self.days = 0.0

    def update(self, history: History, state: "Present") -> Any:
        """Add up moves and rests."""
        long = self.rest.total_seconds() / history.step_s
        for robot in state.robots:
            poses = history.poses(robot)
            last = self.still.get(robot)
            between = 0.0 if last is None else dist(last[0], poses.at(0))
            self.metres[robot] = self.metres.get(robot, 0.0) + between + poses.distance
            self.relocations.setdefault(robot, 0)
            changes = np.flatnonzero((np.diff(poses.xy, axis=0) != 0).any(axis=1)) + 1
            begins = [0, *changes.tolist()]
            for begin, end in zip(begins, [*begins[1:], len(history)], strict=True):
                place, steps = poses.at(begin), end - begin
                if last is not None and last[0] == place:
                    steps += last[1]
                last = place, steps
                if steps >= long:
                    self._rest(robot, place)
            assert last is not None
            self.still[robot] = last
        self.days += len(history) * history.step_s / 86400

    def _rest(self, robot: str, place: Place) -> None:
        if robot in self.rested and dist(self.rested[robot], place) > self.apart:
            self.relocations[robot] += 1
            self.rested[robot] = place
        self.rested.setdefault(robot, place)

    def result(self) -> dict[str, Any]:
        """Return {robot: {relocations, metres}}, both per day."""
        return {
            robot: {
                "relocations": self.relocations[robot] / self.days,
                "metres": metres / self.days,
            }
            for robot, metres in self.metres.items()
        }
