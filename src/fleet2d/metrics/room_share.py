"""True share of time that users spend in each room."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric

AWAY = "away"
MAX_PLACES = 4  # places per user in the closing table


@register("metric", "room_share")
class RoomShare(Metric):
    """Share of time that each user spends in each room, and away.

    Stored per period; the result is over the whole run. Shares of a user sum to one.
    """

    unit: ClassVar[str] = "share of time"

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.names = [*(room.name for room in home.rooms), AWAY]
        self.seconds: dict[str, Any] = {}

    def update(self, history: History, state: Present) -> Any:
        """Count the steps per room."""
        users, shares = [], []
        for user in state.users:
            steps = history.poses(user).time_in_rooms
            self.seconds[user] = self.seconds.get(user, 0) + steps
            users.append(user)
            shares.append(steps / steps.sum())
        if not users:
            return None
        return {
            "user": np.repeat(users, len(self.names)),
            "room": np.tile(self.names, len(users)),
            "share": np.concatenate(shares),
        }

    def result(self) -> dict[str, Any]:
        """Return {user: {room: share}} for the rooms that the user was in."""
        return {
            user: {n: float(s / steps.sum()) for n, s in zip(self.names, steps, strict=True) if s}
            for user, steps in self.seconds.items()
        }

    @classmethod
    def summary(cls, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the places where each user is most of the time, the longest first."""
        return {
            user: dict(sorted(shares.items(), key=lambda item: -item[1])[:MAX_PLACES])
            for user, shares in result.items()
        }
