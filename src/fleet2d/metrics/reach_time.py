"""How long people would wait for a robot that they call."""

from collections.abc import Mapping
from datetime import timedelta
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.configuration.units import Length, PositiveDuration, Speed, micros
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric, pairs_of
from fleet2d.runtime.determinism import sum_in_order


@register("metric", "reach_time")
class ReachTime(Metric):
    """Seconds that a robot would drive to a user who called it, at evenly spaced times.

    Each user at home calls every robot at intervals of `every`, from the start of the run on. The
    time is the length of the shortest route of a body of `radius` to the free place nearest to the
    user, divided by `speed`, without turns and without people in the way; doors and furniture are
    as they are when the metric is updated. Calls without a route count as unreached only.

    Attributes:
        every: Time between two calls of a user.
        speed: Driving speed that is assumed [m/s].
        radius: The robot's radius [m].
    """

    hidden: ClassVar[frozenset[str]] = frozenset({"calls"})
    units: ClassVar[Mapping[str, str]] = {
        "mean": "s",
        "p90": "s",
        "calls": "calls",
        "unreached": "calls",
    }

    every: PositiveDuration = timedelta(minutes=10)
    speed: Speed = Field(default=0.6, gt=0)
    radius: Length = Field(default=0.15, gt=0, le=2)

    def start(self, home: Home) -> None:
        """Begin with no calls."""
        self.seconds: dict[tuple[str, str], list[float]] = {}
        self.unreached: dict[tuple[str, str], int] = {}

    def update(self, history: History, state: Present) -> Any:
        """Add the calls of each user at home."""
        step_us = round(history.step_s * 1e6)
        every = max(1, -(-micros(self.every) // step_us))
        calls = np.arange(-history.first % every, len(history), every)
        space, lattice = state.home.space(self.radius), state.home.plan.lattice
        for pair in pairs_of(history, state):
            key = (pair.robot, pair.user)
            seconds = self.seconds.setdefault(key, [])
            self.unreached.setdefault(key, 0)
            for i in calls[pair.at_home[calls]].tolist():
                start = lattice.point_at(pair.robot_poses.at(i))
                target = lattice.point_at(pair.user_poses.at(i))
                part = (
                    space.part_near(*start) if space.part_at(*start) < 0 else space.part_at(*start)
                )
                goal = (
                    tuple(target)
                    if space.part_at(*target) == part
                    else space.nearest(*target, part)
                )
                route = None if goal is None else space.route(tuple(start), goal)
                if route is None:
                    self.unreached[key] += 1
                    continue
                legs = np.diff(route, axis=0)
                length = float(np.sqrt((legs * legs).sum(axis=1).astype(np.float64)).sum())
                seconds.append(length / lattice.units_per_m / self.speed)

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: {mean, p90, calls, unreached}}}.

        `mean` and `p90` are of the times that the robot would take [s]; p90 is interpolated
        linearly. `calls` is the number of calls, `unreached` that of those without a route.
        """
        results: dict[str, Any] = {}
        for (robot, user), seconds in self.seconds.items():
            numbers: dict[str, Any] = {"calls": len(seconds) + self.unreached[robot, user]}
            if seconds:
                numbers["mean"] = sum_in_order(seconds) / len(seconds)
                numbers["p90"] = float(np.quantile(seconds, 0.9))
            if self.unreached[robot, user]:
                numbers["unreached"] = self.unreached[robot, user]
            results.setdefault(robot, {})[user] = numbers
        return results
