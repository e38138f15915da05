"""An algorithm of one's own, and a behavior that acts on its output."""

from datetime import timedelta
from typing import Any

import numpy as np

from fleet2d import (
    Algorithm,
    Behavior,
    Duration,
    History,
    Home,
    Plan,
    Present,
    RoomDistribution,
    Situation,
)


class SightingShare(Algorithm):
    """Share of sightings per room; older sightings count less.

    Attributes:
        forget: About how long a sighting counts.
    """

    forget: Duration = timedelta(days=14)

    def start(self, home: Home) -> None:
        """Begin without a sighting."""
        self.counts = np.zeros(len(home.rooms))

    def update(self, history: History, state: Present) -> RoomDistribution:
        """Reduce the weight of old sightings, and add those since the last update."""
        self.counts *= max(0.0, 1 - self.period / self.forget)
        room = history.observations.room
        self.counts += np.bincount(room[room >= 0], minlength=len(self.counts))
        return RoomDistribution(self.counts)  # uniform as long as nobody was seen


class VisitMostSeen(Behavior):
    """Every other time wait in the room where an algorithm says that people were seen most.

    Attributes:
        of: The algorithm to go by.
        dwell: How long it waits.
    """

    records = frozenset({"visit"})

    of: str = "share"
    dwell: Duration = timedelta(hours=1)

    def start(self, actor: Any) -> None:
        """Let the next behavior act first."""
        self.came_last = True

    def decide(self, now: Situation) -> Plan | None:
        """Go to the likeliest room, or return None, so that the next behavior decides."""
        output: Any = now.outputs.get(self.of)
        self.came_last = not self.came_last
        if output is None or not self.came_last:
            return None
        room = now.home.rooms[int(np.argmax(output.share))]
        plan = now.plan().note("visit", room.name)
        return plan.go_to([room.name, "any"]).turn_by(1).stay(self.dwell)
