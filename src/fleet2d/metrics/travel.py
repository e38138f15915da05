"""How much robots move."""

from collections.abc import Mapping
from datetime import timedelta
from math import dist
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.configuration.units import Length, PositiveDuration
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric
from fleet2d.runtime.clock import DAY_S

RestPlace = tuple[float, float]


@register("metric", "travel")
class Travel(Metric):
    """Relocations and metres a day, of each robot.

    A robot rests where its position doesn't change for `rest` or longer, turning or not. A
    relocation is a rest more than `apart` away from the previous rest. Metres are the sum of the
    moves from step to step.

    Attributes:
        rest: Shortest time at one place that is a rest.
        apart: Distance between two places of rest [m].
    """

    units: ClassVar[Mapping[str, str]] = {"relocations": "a day", "metres": "m a day"}

    rest: PositiveDuration = timedelta(minutes=1)
    apart: Length = Field(default=0.5, ge=0)

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.metres: dict[str, float] = {}
        self.relocations: dict[str, int] = {}
        self.last_rest: dict[str, RestPlace] = {}  # place of the last rest
        self.standing: dict[str, tuple[RestPlace, int]] = {}  # place, and for how many steps
        self.days = 0.0

    def update(self, history: History, state: Present) -> Any:
        """Add up moves and rests."""
        rest_steps = self.rest.total_seconds() / history.step_s
        for robot in state.robots:
            poses = history.poses(robot)
            standing = self.standing.get(robot)
            between = 0.0 if standing is None else dist(standing[0], poses.at(0))
            self.metres[robot] = self.metres.get(robot, 0.0) + between + poses.distance
            self.relocations.setdefault(robot, 0)
            changes = np.flatnonzero((np.diff(poses.xy, axis=0) != 0).any(axis=1)) + 1
            begins = [0, *changes.tolist()]
            for begin, end in zip(begins, [*begins[1:], len(history)], strict=True):
                place, steps = poses.at(begin), end - begin
                if standing is not None and standing[0] == place:
                    steps += standing[1]
                standing = place, steps
                if steps >= rest_steps:
                    self._rest(robot, place)
            assert standing is not None
            self.standing[robot] = standing
        self.days += len(history) * history.step_s / DAY_S

    def _rest(self, robot: str, place: RestPlace) -> None:
        if robot in self.last_rest and dist(self.last_rest[robot], place) > self.apart:
            self.relocations[robot] += 1
            self.last_rest[robot] = place
        self.last_rest.setdefault(robot, place)

    def result(self) -> dict[str, Any]:
        """Return {robot: {relocations, metres}}, both per day."""
        return {
            robot: {
                "relocations": self.relocations[robot] / self.days,
                "metres": metres / self.days,
            }
            for robot, metres in self.metres.items()
        }
