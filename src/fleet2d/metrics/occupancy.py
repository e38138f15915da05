"""Metrics of occupancy: where users are, how long they stay, and who is with whom."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import AWAY
from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric, pairs_of

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


@register("metric", "stays")
class Stays(Metric):
    """Where each user truly is: a row for each stay in a room, or away.

    Columns: `user`; `place`, the name of the room, or away; `begin` and `end`, the first step of
    the stay and one past the last. A stay that goes on at the end of a period continues in the row
    of the next one.
    """

    def start(self, home: Home) -> None:
        """Keep the names of rooms."""
        self.places = np.array([*(room.name for room in home.rooms), AWAY], object)

    def update(self, history: History, state: Present) -> Any:
        """Return the stays of the period."""
        visits = [history.poses(user).visits for user in state.users]
        if not visits:
            return None
        counts = [len(room) for *_, room in visits]
        begin, end, room = (np.concatenate(columns) for columns in zip(*visits, strict=True))
        return {
            "user": np.repeat(np.array(state.users, object), counts),
            "place": self.places[room],  # NOWHERE is the last
            "begin": history.first + begin,
            "end": history.first + end,
        }


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
