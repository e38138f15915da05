"""How much of the time robots perceive the users."""

from typing import Any, ClassVar

import numpy as np

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.metrics.metric import Metric


@register("metric", "sightings")
class Sightings(Metric):
    """Share of a user's steps at home at which at least one robot perceives the user.

    Detections of a real robot count while the user is known to be at home.
    """

    unit: ClassVar[str] = "share of time at home"

    def start(self, home: Home) -> None:
        """Begin counting."""
        self.seen: dict[str, int] = {}
        self.at_home: dict[str, int] = {}

    def update(self, history: History, state: Present) -> Any:
        """Count detections by step."""
        observations = history.observations
        order = np.argsort(observations.user, kind="stable")  # of one user still in order of step
        index, step = observations.user[order], observations.step[order]
        first = np.append(True, (index[1:] != index[:-1]) | (step[1:] != step[:-1]))[: len(step)]
        known = index[first & (index >= 0)]
        steps_seen = np.bincount(known, minlength=len(state.users)).tolist()
        for user, seen in zip(state.users, steps_seen, strict=True):
            at_home = int(history.poses(user).time_in_rooms[:-1].sum())
            if user in history.log.untracked and seen:
                steps = step[first & (index == state.users.index(user))] - history.first
                seen = int((~history.poses(user).away[steps]).sum())
            self.seen[user] = self.seen.get(user, 0) + seen
            self.at_home[user] = self.at_home.get(user, 0) + at_home

    def result(self) -> dict[str, Any]:
        """Return {user: share}, without users who were never at home."""
        return {
            user: seen / self.at_home[user]
            for user, seen in self.seen.items()
            if self.at_home[user]
        }
