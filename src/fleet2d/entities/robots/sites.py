"""The rooms of a home as sites of a search: where to look round, and how long that takes."""

from itertools import pairwise

import numpy as np

from fleet2d.entities.actor import Actor
from fleet2d.entities.behavior import Situation
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import way_seconds
from fleet2d.entities.robots.viewpoints import viewpoints_of
from fleet2d.kernels import F64
from fleet2d.kernels.numbers import TURN
from fleet2d.search.problem import SearchProblem, search_problem
from fleet2d.sums import sum_in_order

# The part of a room to be shown by its viewpoints, if there are few enough of them.
ENOUGH = 0.9
# Counted for a route that is blocked at present, as by a shut door [s].
NO_WAY = 86_400.0


class Sites:
    """The rooms that a robot can enter, and its viewpoints in them.

    Attributes:
        rooms: Index of each site's room, int64 (n,).
        share: The part of each room that its viewpoints show, float64 (n,).
    """

    def __init__(self, actor: Actor, views: int) -> None:
        """Choose the viewpoints, by walls and furniture as they are at present.

        Args:
            actor: The robot.
            views: The most viewpoints in a room.
        """
        rooms = actor.reachable_rooms()
        viewpoints = [viewpoints_of(actor, room, ENOUGH, views) for room in rooms]
        self.rooms = np.array([room.index for room in rooms], np.int64)
        self.share = np.array([of_room.share for of_room in viewpoints], np.float64)
        self._points = [of_room.points for of_room in viewpoints]
        self._actor = actor
        self._times: tuple[int, F64, F64] | None = None  # version of the home, travel, look

    def __len__(self) -> int:
        """Return the number of sites."""
        return len(self.rooms)

    def can_go(self, plan: Plan, site: int) -> bool:
        """Return whether all viewpoints of a site can be reached from where a plan ends so far."""
        return all(plan.reaches(*point) for point in self._points[site])

    def look_round(self, plan: Plan, site: int) -> Plan:
        """Go to a site and turn once at each of its viewpoints."""
        for point in self._points[site]:
            plan.go_to_point(*point).turn_by(1.0)
        return plan

    def problem(self, now: Situation, prior: F64) -> SearchProblem:
        """Return the search problem from where the robot is.

        Args:
            now: The situation.
            prior: Probability that the person is in each room, float64 (n,).
        """
        travel, look = self._travel()
        position = (now.actor.state.x, now.actor.state.y)
        reach = [self._seconds(position, points[0]) for points in self._points]
        return search_problem(prior, reach, travel, look, self.share)

    def _travel(self) -> tuple[F64, F64]:
        """Return the times of travel from site to site, (n, n), and of the looks, (n,) [s].

        A look begins at the first viewpoint of a site and ends at its last.
        """
        version = self._actor.home.version
        if self._times is None or self._times[0] != version:
            last, first = [p[-1] for p in self._points], [p[0] for p in self._points]
            travel = np.array([[self._seconds(a, b) for b in first] for a in last], np.float64)
            turn = TURN / self._actor.turn_rate
            look = [
                len(points) * turn + sum_in_order(self._seconds(a, b) for a, b in pairwise(points))
                for points in self._points
            ]
            self._times = version, travel, np.array(look, np.float64)
        return self._times[1:]

    def _seconds(self, start: tuple[int, int], goal: tuple[int, int]) -> float:
        seconds = way_seconds(self._actor, start, goal)
        return NO_WAY if seconds is None else seconds
