"""The rooms of a home as sites of a search: where to look round, and how long all of it takes."""

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fleet2d.entities.behavior import Situation
from fleet2d.entities.robots.approach import way_seconds
from fleet2d.entities.robots.looking import views_of
from fleet2d.kernels.headings import TURN
from fleet2d.search.problem import SearchProblem, search_problem

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.entities.plan import Plan

# Of a room so much is enough to be shown.
ENOUGH = 0.9
# A way that there isn't at present, as behind a shut door, takes so long [s].
NO_WAY = 86_400.0

F64 = NDArray[np.float64]


class Sites:
    """The rooms that a robot can enter, and from where it looks round in them.

    Attributes:
        rooms: Index of each site's room, int64 (n,).
        share: What part of each room is shown, float64 (n,).
    """

    def __init__(self, actor: "Actor", views: int) -> None:
        """Find the places, by walls and furniture as they are at present.

        Args:
            actor: The robot.
            views: In a room it looks round from so many places at most.
        """
        rooms = actor.reachable_rooms()
        found = [views_of(actor, room, ENOUGH, views) for room in rooms]
        self.rooms = np.array([room.index for room in rooms], np.int64)
        self.share = np.array([view.share for view in found], np.float64)
        self._points = [view.points for view in found]
        self._actor = actor
        self._ways: tuple[int, F64, F64] | None = None

    def __len__(self) -> int:
        """Return the number of sites."""
        return len(self.rooms)

    def can_go(self, plan: "Plan", site: int) -> bool:
        """Tell whether all places of a site can be reached from where a plan ends at present."""
        return all(plan.reaches(*point) for point in self._points[site])

    def look_round(self, plan: "Plan", site: int) -> "Plan":
        """Go to a site and look round from all of its places."""
        for point in self._points[site]:
            plan.go_to_point(*point).turn_by(1.0)
        return plan

    def problem(self, now: Situation, prior: F64) -> SearchProblem:
        """Return the search problem from where the robot is.

        Args:
            now: The situation.
            prior: float64 (n,), probability that the person is in each room.
        """
        travel, look = self._travel()
        here = (now.actor.state.x, now.actor.state.y)
        reach = [self._seconds(here, points[0]) for points in self._points]
        return search_problem(prior, reach, travel, look, self.share)

    def _travel(self) -> tuple[F64, F64]:
        """Return seconds from each site's last place to each other's first, and for a look."""
        version = self._actor.home.version
        if self._ways is None or self._ways[0] != version:
            last, first = [p[-1] for p in self._points], [p[0] for p in self._points]
            travel = np.array([[self._seconds(a, b) for b in first] for a in last], np.float64)
            turn = TURN / self._actor.turn_rate
            look = [
                len(points) * turn + sum(self._seconds(a, b) for a, b in pairwise(points))
                for points in self._points
            ]
            self._ways = version, travel, np.array(look, np.float64)
        return self._ways[1:]

    def _seconds(self, start: tuple[int, int], goal: tuple[int, int]) -> float:
        seconds = way_seconds(self._actor, start, goal)
        return NO_WAY if seconds is None else seconds
