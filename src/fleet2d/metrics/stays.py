"""Where users truly were, stay by stay: labels for what is learned from evidence."""

from typing import Any

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.algorithms.presence.belief import AWAY
from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric


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
