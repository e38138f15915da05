"""Explore: drive from frontier to frontier of the floor seen so far, until all of it is seen."""

from datetime import datetime, timedelta

import numpy as np
from pydantic import Field

from fleet2d.configuration.units import Length, Share
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import avoided_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import centres, check_has_camera, spread, visible_from
from fleet2d.kernels import TURN, Bool, squared_distance
from fleet2d.runtime.events import EventKind

# At most this many cells of the home are tried as viewpoints, and as targets to be seen.
MAX_VIEWPOINT_CELLS = 800
MAX_TARGET_CELLS = 2000
# The smallest part of the floor that a look has to show.
WORTH = 0.002
# After this time, the robot tries again to pass a shut door to unseen floor.
RETRY_INTERVAL = timedelta(minutes=1)


class Explore(Behavior):
    """Complete the layer `explored` of the robot, frontier by frontier.

    A frontier is unseen floor beside floor that was seen (Yamauchi 1997). Among the places within
    `reach` of a frontier, the robot drives to that with the most unseen floor in view per second of
    the way and a turn (González-Baños and Latombe 2002). There it turns once, and decides again.
    Walls and tall furniture count as they are at present. It has finished when `enough` of the
    floor is seen of all rooms that it could enter at the beginning of the run, or when no look
    shows enough new floor; from then on, later behaviors decide. If a shut door is in the way, they
    decide until the door is open. Events: `explores`, with the share seen, and `explored` at the
    end.

    Attributes:
        enough: Share of the floor to be seen.
        reach: Distance from a frontier to go to [m].
        no_stops_in: Rooms, or kinds of rooms if the home has them, to leave unexplored: it looks
            round in none of them, and their floor needn't be seen.
    """

    records = frozenset({EventKind.EXPLORED, EventKind.EXPLORES})
    needs = frozenset({"explored"})

    enough: Share = 0.98
    reach: Length = Field(default=1.0, ge=0.1, le=5)
    no_stops_in: tuple[str, ...] = ()

    def start(self, actor: Actor) -> None:
        """Determine the floor to be seen, and the places from which it may be seen."""
        check_has_camera(actor, "explore")
        plan = actor.home.plan
        avoided = avoided_rooms(actor, "explore.no_stops_in", self.no_stops_in)
        rooms = [r.index for r in actor.reachable_rooms() if r.index not in avoided]
        self.floor: Bool = np.isin(plan.room_of_cell, rooms) & plan.free
        cells = actor.space.cells(None, actor.part)
        if avoided:
            row, column = cells.T
            cells = cells[self.floor[row, column]]
        self.stands = spread(cells, MAX_VIEWPOINT_CELLS)
        self.targets = spread(np.argwhere(self.floor), MAX_TARGET_CELLS)
        self.tried: Bool = np.zeros(len(self.targets), np.bool_)  # looked at, seen or not
        self.visible: tuple[int, dict[int, Bool]] = actor.home.version, {}  # targets, by stand
        self.stand: int | None = None  # index of the present destination
        self.blocked_stands: set[int] = set()  # places blocked by a person
        self.plan: Plan | None = None  # the last plan returned
        self.has_looked = self.is_done = self.is_shut_out = False

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return the time of the next try to pass a shut door."""
        return now.time + RETRY_INTERVAL if self.is_shut_out else None

    def give_up(self, now: Situation) -> None:
        """Leave out the present destination."""
        if self.stand is not None:
            self.blocked_stands.add(self.stand)

    def decide(self, now: Situation) -> Plan | None:
        """Drive to a frontier and look round; None when there is nothing left to see."""
        if self.is_done:
            return None
        plan = now.plan()
        if not self.has_looked:
            self.has_looked = True
            return plan.turn_by(1.0)
        explored: Bool = now.home.layers[f"explored.{now.actor.name}"].values
        seen = float((explored & self.floor).sum())
        share = seen / max(1.0, float(self.floor.sum()))
        self.is_shut_out = False
        self.stand = None if share >= self.enough else self._next(now, explored)
        if self.is_shut_out:
            return None
        percent = f"{100 * share:.1f} %"
        if self.stand is None:
            self.is_done = True
            return plan.note(EventKind.EXPLORED, percent).stay(timedelta(microseconds=1))
        plan.note(EventKind.EXPLORES, percent)
        row, column = self.stands[self.stand].tolist()
        plan.go_to_point(*now.home.lattice.cell_centre(row, column))
        self.plan = plan.turn_by(1.0)
        return plan

    def _next(self, now: Situation, explored: Bool) -> int | None:
        """Return the index of the next place; None if no look shows enough, or doors are shut."""
        last = now.actor.plan
        if self.stand is not None and last.root is self.plan and last.is_over(now.step):
            self.tried |= self._visible(now.actor, self.stand)
        row, column = self.targets.T
        unseen = ~(explored[row, column] | self.tried)
        near = np.flatnonzero(self._near_frontier(now, explored))
        actor = now.actor
        newly_seen = [self._visible(actor, stand) & unseen for stand in near.tolist()]
        gains = np.array(list(map(np.count_nonzero, newly_seen)), np.int64)
        shows_enough = gains > WORTH * len(self.targets)
        near = near[shows_enough]
        if not len(near):
            return None
        position = actor.state.position
        metres = actor.space.distances(position, centres(self.stands[near]))
        seconds = actor.seconds(metres) + TURN / actor.turn_rate
        best = int(np.argmax(gains[shows_enough] / seconds))
        self.is_shut_out = not bool(np.isfinite(seconds[best]))
        return None if self.is_shut_out else int(near[best])

    def _near_frontier(self, now: Situation, explored: Bool) -> Bool:
        """Return which places are within reach of a frontier, bool (places,)."""
        is_beside = squared_distance(~(explored & self.floor)) <= 2  # sides and corners
        frontier = self.floor & ~explored & is_beside
        away = squared_distance(~frontier)
        cells = self.reach / now.home.lattice.cell
        row, column = self.stands.T
        near: Bool = away[row, column] <= cells * cells
        near[sorted(self.blocked_stands)] = False
        return near if frontier.any() else np.zeros(len(self.stands), np.bool_)

    def _visible(self, actor: Actor, stand: int) -> Bool:
        """Return which targets are visible from a place, bool (targets,), by present walls."""
        if self.visible[0] != actor.home.version:
            self.visible = actor.home.version, {}
        if stand not in self.visible[1]:
            place = centres(self.stands[stand : stand + 1])
            self.visible[1][stand] = visible_from(actor, place, centres(self.targets))[0]
        return self.visible[1][stand]
