"""A behavior of one's own: make rounds, and keep people company who come into view."""

from datetime import timedelta
from math import sqrt
from typing import Any

from pydantic import Field

from fleet2d import Behavior, Duration, Length, Plan, Situation


class Greeter(Behavior):
    """Go from room to room; when a user comes into view, drive up and stay a while.

    Attributes:
        dwell: How long it looks around in a room.
        company: How long it stays with a user.
        distance: How near it goes to a user [m].
    """

    records = frozenset({"greeting"})

    # A typed field is a key in the YAML, checked and converted: `company: 10 min`.
    dwell: Duration = timedelta(minutes=5)
    company: Duration = timedelta(minutes=10)

    distance: Length = Field(default=1.0, gt=0)

    def start(self, actor: Any) -> None:
        """Find the rooms that the robot can enter; other attributes than fields are run state."""
        self.rooms = [room.name for room in actor.reachable_rooms()]
        self.round = 0

    def decide(self, now: Situation) -> Plan:
        """Return the next plan; called when a plan is over or interrupted."""
        for seen in now.events:
            plan = now.plan().note("greeting", seen.user)
            return plan.go_to(self._beside(seen, now)).stay(self.company)
        room = self.rooms[self.round % len(self.rooms)]
        self.round += 1
        return now.plan().go_to(room).turn_by(1).stay(self.dwell).interrupt_on("user_seen")

    def _beside(self, seen: Any, now: Situation) -> tuple[float, float]:
        """Return the place on the way to the user that is `distance` short of it."""
        x, y = now.xy
        away_x, away_y = seen.x - x, seen.y - y
        # sqrt and the four operations are the same on every machine; math.hypot is not.
        away = sqrt(away_x**2 + away_y**2)
        part = max(0.0, 1 - self.distance / away) if away else 0.0
        return now.nearest_free(x + part * away_x, y + part * away_y)
