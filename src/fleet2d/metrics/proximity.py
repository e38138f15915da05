"""Metrics of proximity: robots in people's way, and close to them."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.configuration.units import Length
from fleet2d.floorplan.home import Home
from fleet2d.kernels import F64
from fleet2d.metrics.metric import Metric, columns_of, in_sight, nested, pairs_of
from fleet2d.runtime.clock import DAY_S

# Hall's zones, by the distance at which they end [m].
ZONES = {"intimate": 0.45, "personal": 1.2, "social": 3.6}


@register("metric", "blocking")
class Blocking(Metric):
    """How often, and for how long, a robot is in the way of a user who walks.

    A step counts when the user moves in it, and the centres are nearer than `clearance` at its
    begin or at its end: two bodies of the usual radii (0.2 and 0.15 m) would touch at 0.35 m. A
    block is an unbroken run of such steps; `blocks` counts blocks, and `seconds` is the duration of
    their steps. People walk as if there were no robot, so this is how often they would have had to
    change their path or stop. `asides`, for people who react to robots, is how often they stepped
    aside for it.

    Attributes:
        clearance: Distance between the centres [m].
    """

    unit: ClassVar[str] = "a day"
    units: ClassVar[Mapping[str, str]] = {"seconds": "s a day"}

    clearance: Length = Field(default=0.4, gt=0, le=3)

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.counts: dict[tuple[str, str], dict[str, float]] = {}
        self.last: dict[tuple[str, str], tuple[tuple[float, float], bool, bool]] = {}
        self.days = 0.0

    def update(self, history: History, state: Present) -> Any:
        """Count the steps in which a user walks into a robot."""
        for pair in pairs_of(history, state):
            key = (pair.robot, pair.user)
            is_near, xy = pair.distance < self.clearance, pair.user_poses.xy
            # A step leads from one pose to the next: the first from the last of the last period.
            start, was_near, was_blocked = self.last.get(
                key, (pair.user_poses.at(0), bool(is_near[0]), False)
            )
            moves = (np.diff(xy, axis=0, prepend=[start]) != 0).any(axis=1) & pair.at_home
            is_blocked = moves & (is_near | np.append(was_near, is_near[:-1]))
            begins = is_blocked & ~np.append(was_blocked, is_blocked[:-1])
            counts = self.counts.setdefault(key, {"blocks": 0, "seconds": 0.0})
            counts["blocks"] += int(np.count_nonzero(begins))
            counts["seconds"] += int(np.count_nonzero(is_blocked)) * history.step_s
            self.last[key] = pair.user_poses.at(-1), bool(is_near[-1]), bool(is_blocked[-1])
        steps_aside = {f"steps aside for {robot}": robot for robot in state.robots}
        for event in history.events:
            if event.event == "reacts" and event.detail in steps_aside:
                counts = self.counts[steps_aside[event.detail], event.entity]
                counts["asides"] = counts.get("asides", 0) + 1
        self.days += len(history) * history.step_s / DAY_S

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: {blocks, seconds}}}, with asides if there were any, per day."""
        return nested(
            {
                pair: {name: value / self.days for name, value in counts.items()}
                for pair, counts in self.counts.items()
            }
        )


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
        self.minutes: dict[tuple[str, str], F64] = {}  # in each zone
        self.days = 0.0

    def update(self, history: History, state: Present) -> Any:
        """Count the steps in each zone; return a row for each robot and user."""
        rows = []
        for pair in pairs_of(history, state):
            distance, key = pair.distance, (pair.robot, pair.user)
            near = np.flatnonzero(distance < max(ZONES.values()))
            near = near[in_sight(state.home.plan, pair, near)]
            counts, _ = np.histogram(distance[near], [0.0, *ZONES.values()])
            minutes = counts * history.step_s / 60
            self.minutes[key] = self.minutes.get(key, 0.0) + minutes
            rows.append((*key, *minutes.tolist()))
        self.days += len(history) * history.step_s / DAY_S
        return columns_of(("robot", "user", *ZONES), rows)

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: {zone: minutes a day}}}."""
        return nested(
            {
                pair: dict(zip(ZONES, (minutes / self.days).tolist(), strict=True))
                for pair, minutes in self.minutes.items()
            }
        )
