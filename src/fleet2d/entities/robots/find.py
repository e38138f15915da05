"""Find: look for a person, room by room, by probabilities and distances."""

from dataclasses import dataclass, field
from datetime import datetime, timedelta
from itertools import pairwise

import numpy as np
from pydantic import Field

from fleet2d.configuration.problems import problem
from fleet2d.configuration.units import Duration, Length, PositiveDuration, Share, TimeOfDay
from fleet2d.entities.behavior import DOOR_WAIT, Actor, Command, Situation
from fleet2d.entities.giving_way import resumed
from fleet2d.entities.place import avoided_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import (
    ANYONE,
    BeliefBehavior,
    approach,
    check_has_camera,
    is_in_rooms,
    spot_back,
    viewpoints_of,
    way_seconds,
)
from fleet2d.entities.robots.search import (
    MAX_EXACT_SITES,
    Policy,
    SearchProblem,
    after_empty_looks,
    order_by,
    search_problem,
)
from fleet2d.errors import PlacementError
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.kernels import F64, TURN
from fleet2d.runtime.clock import DAY, midnight_of
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.runtime.events import EventKind
from fleet2d.runtime.local_time import at_reading

# The part of a room to be shown by its viewpoints, if there are few enough of them.
SHARE_TO_SHOW = 0.9
# Weight of a prior proportional to the areas of rooms, beside that of the source.
DOUBT = 0.1
# A route that is blocked at present, as by a shut door, counts as this long [s].
BLOCKED_ROUTE_S = 86_400.0


class Sites:
    """The rooms that a robot can enter, and its viewpoints in them.

    Attributes:
        rooms: Index of each site's room, int64 (n,).
        share: The part of each room that its viewpoints show, float64 (n,).
    """

    def __init__(self, actor: Actor, views: int, avoided: frozenset[int] = frozenset()) -> None:
        """Choose the viewpoints, by walls and furniture as they are at present.

        Args:
            actor: The robot.
            views: The maximum number of viewpoints in a room.
            avoided: Indices of the rooms that it doesn't enter.
        """
        rooms = [room for room in actor.reachable_rooms() if room.index not in avoided]
        viewpoints = [viewpoints_of(actor, room, SHARE_TO_SHOW, views) for room in rooms]
        self.rooms = np.array([room.index for room in rooms], np.int64)
        self.share = np.array([of_room.share for of_room in viewpoints], np.float64)
        self._points = [of_room.points for of_room in viewpoints]
        self._actor = actor
        self._times: tuple[int, F64, F64] | None = None  # home's version; travel and look times

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
        """Return the search problem from the robot's position.

        Args:
            now: The situation.
            prior: Probability that the person is in each room, float64 (n,).
        """
        travel, look = self._travel()
        position = now.actor.state.position
        reach = [self._seconds(position, points[0]) for points in self._points]
        return search_problem(prior, reach, travel, look, self.share)

    def _travel(self) -> tuple[F64, F64]:
        """Return the times of travel from site to site, (n, n), and of the looks, (n,) [s].

        A look begins at the first viewpoint of a site and ends at its last.
        """
        version = self._actor.home.version
        if self._times is None or self._times[0] != version:
            travel = np.empty((len(self), len(self)))
            look = np.empty(len(self))
            turn_s = TURN / self._actor.turn_rate
            for site, points in enumerate(self._points):
                ways = [self._seconds(start, goal) for start, goal in pairwise(points)]
                look[site] = len(points) * turn_s + sum_in_order(ways)
                travel[site] = [self._seconds(points[-1], other[0]) for other in self._points]
            self._times = version, travel, look
        return self._times[1:]

    def _seconds(self, start: LatticePoint, goal: LatticePoint) -> float:
        seconds = way_seconds(self._actor, start, goal)
        return BLOCKED_ROUTE_S if seconds is None else seconds


@dataclass
class SearchState:
    """A search in progress.

    Attributes:
        since: The time of its beginning.
        user: The person to find, or ANYONE.
        looked_at: The end of the last empty look at each site, by number.
        route: The sites to go to next, by number.
        goal: The present destination; None: none.
        blocked: Sites blocked by a person.
    """

    since: datetime
    user: str
    looked_at: dict[int, datetime] = field(default_factory=dict)
    route: tuple[int, ...] = ()
    goal: int | None = None
    blocked: set[int] = field(default_factory=set)


class Find(BeliefBehavior):
    """Look for a person at given times or on command, until found, given up or believed out.

    A site is a room, with enough viewpoints that little of its floor stays out of view. The
    `policy` chooses the order of the sites by the probabilities of `source` for the present time,
    and by travel times: see :mod:`fleet2d.entities.robots.search`. `receding` decides again after
    every empty look, by the remaining probabilities; the others decide once, when the search
    begins.

    The person is found when the cameras perceive somebody as that person, who may be somebody else
    whom they mistake for the person. On a command to find somebody, the robot begins at once, or as
    soon as the behaviors before this one allow, and drops a search in progress. Events, with the
    person's name: `find_begins`, and one of `found`, `not_at_home` and `gave_up`.

    Attributes:
        policy: The order of looking into the rooms.
        at: Times of day at which a search begins; without them and `every`: on command only.
        every: Interval between two searches, from the start on, instead of `at`.
        late: A search that can't begin within this time is left out.
        deadline: Duration of a search after which it gives up.
        out_at: Probability of being out from which the person counts as not at home, once the robot
            has looked into every room that it can get to.
        out: Probability that the person is out, as long as the source has no output.
        memory: Age at which an empty look counts half, because people move.
        views: The maximum number of viewpoints in a room.
        distance: Distance to keep from the found person [m].
        stay: Time to stay with the found person.
        no_stops_in: Rooms, or kinds of rooms if the home has them, to look into from outside only.
    """

    records = frozenset(
        {EventKind.FIND_BEGINS, EventKind.FOUND, EventKind.GAVE_UP, EventKind.NOT_AT_HOME}
    )
    answers = frozenset({"find"})

    policy: Policy = "receding"
    at: tuple[TimeOfDay, ...] = ()
    every: PositiveDuration | None = None
    late: Duration = timedelta(minutes=30)
    deadline: PositiveDuration = timedelta(minutes=10)
    out_at: Share = 0.9
    out: Share = 0.5
    memory: Duration = timedelta(minutes=20)
    views: int = Field(default=2, ge=1, le=8)
    distance: Length = Field(default=1.5, ge=0.3, le=10)
    stay: Duration = timedelta(minutes=1)
    no_stops_in: tuple[str, ...] = ()

    def model_post_init(self, _: object, /) -> None:
        """Refuse two ways to begin."""
        if self.at and self.every is not None:
            raise problem("it begins by 'at' (times of day) or 'every' (a duration), not by both")

    def takes(self, command: Command) -> bool:
        """Return whether a command asks for a search."""
        return super().takes(command) and self.user in (ANYONE, command.target)

    def start(self, actor: Actor) -> None:
        """Choose the viewpoints of each room."""
        check_has_camera(actor, "find")
        self.avoided = avoided_rooms(actor, "find.no_stops_in", self.no_stops_in)
        self.sites = Sites(actor, self.views, self.avoided)
        if self.policy == "exact" and len(self.sites) > MAX_EXACT_SITES:
            raise PlacementError(
                f"{actor.path}: the exact policy works for up to {MAX_EXACT_SITES} rooms, and"
                f" there are {len(self.sites)}: choose policy: receding"
            )
        self.search: SearchState | None = None
        self.plan: Plan | None = None  # the last one that it returned
        start = actor.clock.start
        self.due: datetime | None = self._next(
            start if self.every else start - timedelta(microseconds=1), start
        )

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return the beginning of the next search."""
        return self.due

    def busy(self) -> bool:
        """Return whether a search is in progress."""
        return self.search is not None

    def give_up(self, now: Situation) -> None:
        """Leave out the present destination for this search."""
        search = self.search
        if search is not None and search.goal is not None:
            search.blocked.add(search.goal)
            search.route = search.route[1:]
            search.goal = None

    def dismiss(self) -> None:
        """End the search."""
        self.search = None

    def decide(self, now: Situation) -> Plan | None:
        """Begin a search that is due, continue one, or leave the robot to other behaviors."""
        plan = now.plan()
        search = self.search
        user = self._commanded_user(now)
        if user is None and search is None and self._is_due(now):
            user = self.user
        if user is not None:
            search = self.search = SearchState(now.time, user)
            plan.note(EventKind.FIND_BEGINS, user)
        elif search is None:
            return None
        else:
            self._note_empty_look(now, search)
        in_view = now.in_view
        name = search.user if search.user != ANYONE else min(in_view, default=ANYONE)
        if name in in_view:
            return self._approach(now, plan, *in_view[name])
        return self._resume(now) or self._look_further(now, plan, search)

    def _commanded_user(self, now: Situation) -> str | None:
        """Take a command to find somebody, and return the person; None: there is no command."""
        if now.command is None or not self.takes(now.command):
            return None
        command = now.take_command("find")
        return None if command is None else command.target

    def _resume(self, now: Situation) -> Plan | None:
        """Return the rest of a look that was interrupted because somebody else came into view."""
        last = now.actor.plan
        if not now.events or last.root is not self.plan or last.is_over(now.step):
            return None
        plan = resumed(now.plan(), last, now.step)
        return None if plan is None else plan.interrupt_on(EventKind.USER_SEEN)

    def _is_due(self, now: Situation) -> bool:
        """Return whether a search is due and not too late; afterwards the next one is due."""
        due = self.due
        start = now.actor.clock.start
        while self.due is not None and self.due <= now.time:
            due = self.due
            self.due = self._next(due, start)
        return due is not None and due <= now.time <= due + self.late

    def _note_empty_look(self, now: Situation, search: SearchState) -> None:
        """Note that the look of the last plan did not find the person, if it is complete."""
        plan = now.actor.plan
        is_complete = plan.root is self.plan and plan.is_over(now.step)
        if search.goal is not None and is_complete and not now.events:
            search.looked_at[search.goal] = now.time
            search.route = search.route[1:]
            search.goal = None

    def _approach(self, now: Situation, plan: Plan, x: float, y: float) -> Plan:
        """End the search: approach the person, at (x, y) [m], and stay."""
        self._end(plan, EventKind.FOUND)
        if is_in_rooms(now, x, y, self.avoided):
            return plan.face_place((x, y)).stay(self.stay)
        approach(now, plan, x, y, self.distance)
        back = spot_back(now, x, y, self.distance)
        if plan.position == now.actor.state.position != back:
            plan.go_to_point(*back)
        plan.face_place((x, y))
        return plan.stay(self.stay)

    def _look_further(self, now: Situation, plan: Plan, search: SearchState) -> Plan | None:
        """Go to the next site and look round there, or end the search."""
        ends = search.since + self.deadline
        if now.time >= ends:
            return self._end(plan, EventKind.GAVE_UP)
        prior, away = self._prior(now, search.user)
        age = np.full(len(self.sites), np.inf)
        memory = self.memory.total_seconds()
        for site, at in search.looked_at.items():
            age[site] = (now.time - at).total_seconds()
        remaining = after_empty_looks(prior, age, memory, self.sites.share)
        is_out = away >= self.out_at * (away + sum_in_order(remaining.tolist()))
        unseen = np.flatnonzero(np.isinf(age)).tolist()
        if is_out and not any(self.sites.can_go(plan, site) for site in unseen):
            return self._end(plan, EventKind.NOT_AT_HOME)
        route = search.route
        if self.policy == "receding" or not route:
            problem = self.sites.problem(now, after_empty_looks(prior, age, memory))
            route = tuple(order_by(self.policy, problem, now.random("order")))
        while route and not self._can_go(plan, search, route[0]):
            route = route[1:]
        search.route = route
        search.goal = route[0] if route else None
        if route:
            self.sites.look_round(plan, route[0]).interrupt_on(EventKind.USER_SEEN)
        else:  # shut doors block all remaining sites
            plan.stay(DOOR_WAIT)
        self.plan = plan.ask_by(ends)
        return plan

    def _can_go(self, plan: Plan, search: SearchState, site: int) -> bool:
        return site not in search.blocked and self.sites.can_go(plan, site)

    def _prior(self, now: Situation, user: str) -> tuple[F64, float]:
        """Return the probability of each site, and that of being out, disregarding all looks."""
        belief = self.belief(now, user)
        rooms = now.home.plan.rooms
        sizes = np.array([rooms[room].cells for room in self.sites.rooms.tolist()])
        shares = belief.share[self.sites.rooms]
        total = sum_in_order(shares.tolist())
        shares = shares / total if total > 0 else np.zeros(len(sizes))
        doubt = DOUBT if total > 0 else 1.0
        mixed = (1 - doubt) * shares + doubt * sizes / int(sizes.sum())
        has_output = self.source is not None and now.outputs.get(self.source) is not None
        away = belief.away if has_output else self.out
        return mixed * (1 - away), away

    def _end(self, plan: Plan, event: str) -> Plan:
        """End the search with an event."""
        assert self.search is not None
        user = self.search.user
        self.search = None
        return plan.note(event, user)

    def _next(self, after: datetime, start: datetime) -> datetime | None:
        """Return the time of the next search after a moment; None: only on command."""
        if self.every is not None:
            return start + ((after - start) // self.every + 1) * self.every
        if not self.at:
            return None
        midnight = midnight_of(after)
        days = (midnight, midnight + DAY)
        times = sorted(day + at for day in days for at in self.at)
        moments = (at_reading(start, time) for time in times)
        return next(moment for moment in moments if moment > after)
