"""Hangout: stand near people without blocking their way, and move rarely."""

from collections import defaultdict
from datetime import timedelta
from functools import partial
from itertools import combinations
from typing import Literal

import numpy as np
from pydantic import Field

from fleet2d.configuration.units import PositiveDuration, Share
from fleet2d.entities.behavior import Actor, Hours, Situation, holds
from fleet2d.entities.place import Point, avoided_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import BeliefBehavior, centres, sight_range, viewpoints_of
from fleet2d.errors import PlacementError
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.floorplan.plan import Room, cells_of, read_only
from fleet2d.floorplan.space import Space
from fleet2d.kernels import F64, I64, SUB, pairs_in_sight, points_near
from fleet2d.runtime.events import EventKind

# Radius of the bodies whose ways count as the ways of people [m].
PERSON = 0.2
# Personal space ends at 1.2 m (Hall); within it, places get worse toward a seat [m].
PERSONAL = 1.2
# Maximum number of cells of a room that count as seats, if it has no furniture to sit or lie on.
MAX_SEATS = 60
# Places to stand are tried on a grid of this pitch [m].
PITCH = 0.5

Seats = tuple[I64, ...]
Nearness = Literal["room", "view", "path"]


class HangoutPlaces:
    """Candidate places of a robot: lattice points that its body can get to.

    Attributes:
        points: The places [lattice], int64 (n, 2).
        room: Index of each place's room, int64 (n,).
        block: Share of the ways between any two rooms that lead through the robot's body there,
            float64 (n,).
        prox: Depth within personal space, from 1 on a seat to 0 outside, float64 (n,).
    """

    def __init__(self, actor: Actor, avoid: frozenset[int]) -> None:
        """Lay out the places, by walls and furniture as they are at present.

        Args:
            actor: The robot.
            avoid: Indices of the rooms without places.
        """
        self._actor = actor
        home = actor.home
        people = home.space(PERSON, opens_doors=True)
        # Robots of other runs in this home share the places, so the key has all that they depend
        # on.
        body = actor.space, actor.part, actor.entity.radius
        self._key = (*body, people, home.objects, avoid)
        self.points, self.room, seats, self.block, self.prox = home.cached(
            ("places", *self._key), lambda: self._lay_out(avoid)
        )
        self._seats = dict(enumerate(seats))

    def _lay_out(self, avoid: frozenset[int]) -> tuple[I64, I64, Seats, F64, F64]:
        """Return the points, their rooms, the seats of each room, and two costs of each point.

        The costs are `block`, how much it blocks ways, and `prox`, how near it is to a seat.
        """
        self.points, self.room = self._candidates(avoid)
        seats = self._lay_out_seats()
        block = read_only(self._blocking())
        prox = read_only(self._proximity())
        return read_only(self.points), read_only(self.room), seats, block, prox

    def nearness(self, by: Nearness, tau: float) -> F64:
        """Return the nearness of each place to people in each room, float64 (n, rooms), 0 to 1.

        `room`: 1 in the same room, else 0. `view`: the share of the room's seats in range and in
        sight. `path`: exp(-t / tau), with t the travel time to the nearest point of the room [s].
        """
        actor = self._actor
        reach = actor.speed, type(actor.drive), repr(actor.drive)
        key = ("nearness", *self._key, by, tau, actor.home.walls, sight_range(actor), *reach)
        # The array is read room by room, hence in column order.
        return actor.home.cached(
            key, lambda: read_only(np.asfortranarray(self._compute_nearness(by, tau)))
        )

    def _compute_nearness(self, by: Nearness, tau: float) -> F64:
        rooms = self._actor.home.rooms
        if by == "room":
            return (self.room[:, None] == np.arange(len(rooms))).astype(np.float64)
        column = self._view if by == "view" else partial(self._path, tau=tau)
        return np.stack([column(room) for room in rooms], axis=1)

    def _candidates(self, avoid: frozenset[int]) -> tuple[I64, I64]:
        actor = self._actor
        plan = actor.home.plan
        cells = actor.space.cells(None, actor.part)
        pitch = max(1, round(PITCH / plan.lattice.cell))
        on_grid = (cells % pitch == 0).all(axis=1)
        row, column = cells.T
        rooms = plan.room_of_cell[row, column].astype(np.int64)
        is_candidate = on_grid & (rooms >= 0) & ~np.isin(rooms, sorted(avoid))
        rooms = rooms[is_candidate]
        points = centres(cells[is_candidate])
        for door in plan.doorways:
            line = plan.lattice.to_lattice((door.start, door.end))
            clear = ~points_near(points, line, OFF_DOORS_M * plan.lattice.units_per_m)
            points = points[clear]
            rooms = rooms[clear]
        return np.ascontiguousarray(points), rooms

    def _lay_out_seats(self) -> Seats:
        """Return the usual places of people in each room: at furniture, else all over [lattice].

        Each place at furniture is looked up once, not for every room.
        """
        home = self._actor.home
        uses: defaultdict[int, list[Point]] = defaultdict(list)
        for thing in home.objects:
            for use in thing.uses:
                room = home.plan.room_at(*use.at)
                if room is not None:
                    uses[room.index].append(use.at)
        return tuple(read_only(self._seats_of(room, uses[room.index])) for room in home.rooms)

    def _seats_of(self, room: Room, uses: list[Point]) -> I64:
        plan = self._actor.home.plan
        if uses:
            return np.ascontiguousarray(plan.lattice.to_lattice(uses))
        cells = cells_of(plan.room_of_cell == room.index)
        return centres(cells[:: max(1, len(cells) // MAX_SEATS)])

    def _view(self, room: Room) -> F64:
        walls = self._actor.home.walls
        reach = sight_range(self._actor)
        seats = self._seats[room.index]
        if not len(seats):
            return np.zeros(len(self.points))
        squares = self._squared_distances(seats)
        places, near = np.nonzero(squares <= reach * reach)
        is_seen = pairs_in_sight(walls, self.points[places], seats[near])
        return np.bincount(places[is_seen], minlength=len(self.points)) / len(seats)

    def _squared_distances(self, seats: I64) -> I64:
        """Return the squared distance of each place from each seat, int64 (n, seats)."""
        squares: I64 = ((self.points[:, None] - seats) ** 2).sum(axis=2)
        return squares

    def _path(self, room: Room, tau: float) -> F64:
        actor = self._actor
        cells = actor.space.cells(room.index, actor.part)
        if not len(cells):
            return np.zeros(len(self.points))
        field = actor.space.distance_field(centres(cells))
        column, row = self.points.T // SUB
        metres = field[row, column]
        return decay(actor.seconds(metres) / tau)

    def _blocking(self) -> F64:
        """Return the share of people's ways from room to room that a robot at each place blocks."""
        actor = self._actor
        home = actor.home
        space = home.space(PERSON, opens_doors=True)
        stops = []
        for room in home.rooms:
            x, y = home.lattice.point_at(room.anchor_xy)
            stops.append(space.nearest(x, y, 0, room.index))
        reach = (PERSON + actor.entity.radius) * home.lattice.units_per_m
        blocked = np.zeros(len(self.points))
        ways = 0
        for start, goal in combinations(filter(None, stops), 2):
            route = space.route(start, goal)
            if route is not None and len(route) > 1:
                ways += 1
                blocked += points_near(self.points, route, reach)
        return blocked / max(ways, 1)

    def _proximity(self) -> F64:
        """Return the depth of each place in the personal space of the nearest seat, 0 to 1."""
        plan = self._actor.home.plan
        uses = [use.at for thing in self._actor.home.objects for use in thing.uses]
        if not uses or not len(self.points):
            return np.zeros(len(self.points))
        seats = plan.lattice.to_lattice(uses)
        gaps = self._squared_distances(seats).min(axis=1)
        metres = np.sqrt(gaps.astype(np.float64)) / plan.lattice.units_per_m
        return np.maximum(0.0, 1 - metres / PERSONAL)


def decay(x: F64) -> F64:
    """Return exp(-x) for x >= 0 by sums and products only, the same on every machine.

    Computed as (1 + y + y**2/2 + y**3/6 + y**4/24)**-1024 with y = x / 1024: the relative error is
    below 1e-5 up to x = 60, beyond which the value is negligible.

    Example:
        >>> decay(np.array([0.0, 1.0, np.inf])).round(6).tolist()
        [1.0, 0.367879, 0.0]
    """
    y = np.minimum(x, 600.0) / 1024
    growth = 1 + y * (1 + y / 2 * (1 + y / 3 * (1 + y / 4)))
    for _ in range(10):
        growth = growth * growth
    return np.where(np.isfinite(x), 1 / growth, 0.0)


# Least distance from doorways [m].
OFF_DOORS_M = 0.8
# Weight of being near a seat, in relation to that of blocking ways.
SEAT_WEIGHT = 0.5
# Exploring a room has to show this part of it, from at most this many viewpoints.
SHARE_TO_SHOW = 0.95
MAX_VIEWS = 4


class Hangout(BeliefBehavior):
    """Stand near the likely places of people, out of their way.

    Every `period` it rates the places on a grid of 0.5 m by

    sum over rooms p(room) nearness(place, room) - b(place) - s(place) / 2 - moving * m(place)

    where p(room) is the probability that the user is at home and in that room, from `source`; b is
    the share of the shortest ways between two rooms that lead through the robot's body there, for a
    person of radius 0.2 m; s falls from 1 on the place where furniture is used to 0 at 1.2 m from
    it; and m = t / (t + tau), with t the travel time from its position [s]. It moves only to a
    place that beats the present one by `hysteresis`, and never in quiet hours. With probability
    `explore` it goes to a room drawn with equal chances instead, looks round in it, and comes back,
    so that its observations don't depend only on its own beliefs.

    If a person blocks its way and doesn't move, it stays where it is until the next period.

    Events: `relocates`, with the room it goes to, and `explores`, with the room it looks round in.

    Attributes:
        period: Time between two decisions where to stand.
        near: The measure of nearness: the same room; a view of its seats; or travel time.
        tau: Travel time at which nearness by `path` has fallen to 1/e.
        moving: Weight of the travel time to a place.
        hysteresis: The least advantage of another place for which it moves.
        explore: Share of decisions to explore any room instead.
        no_stops_in: Rooms, or kinds of rooms if the home has them, to stay out of.
        quiet: Hours without moves.
    """

    always_decides = True
    records = frozenset({EventKind.EXPLORES, EventKind.RELOCATES})

    period: PositiveDuration = timedelta(minutes=30)
    near: Nearness = "path"
    tau: PositiveDuration = timedelta(seconds=10)
    moving: float = Field(default=0.05, ge=0)
    hysteresis: float = Field(default=0.1, ge=0)
    explore: Share = 0.1
    no_stops_in: tuple[str, ...] = ()
    quiet: Hours = ()

    def start(self, actor: Actor) -> None:
        """Lay out the places, and rate them by the costs that don't depend on people."""
        self.avoided = avoided_rooms(actor, "hangout.no_stops_in", self.no_stops_in)
        self.places = HangoutPlaces(actor, self.avoided)
        if not len(self.places.points):
            raise PlacementError(
                f"{actor.path}: there is no place to hang out at, off doorways by"
                f" {OFF_DOORS_M:g} m and out of: {', '.join(self.no_stops_in) or 'no room'}"
            )
        self.nearness = self.places.nearness(self.near, self.tau.total_seconds())
        self.penalty = self.places.block + SEAT_WEIGHT * self.places.prox
        self.ways: tuple[Space, dict[LatticePoint, F64]] = actor.space, {}
        reachable = (room.index for room in actor.reachable_rooms())
        self.explored = [room for room in reachable if room not in self.avoided]
        self.rated_output: object = None  # the output behind `worth`; None before the first
        self.rated_by = b""  # the probabilities behind `worth`
        self.worth = -self.penalty
        self.best = -np.inf  # the largest of `worth`
        self.place: int | None = None
        self.decides_at = actor.clock.start
        self.is_blocked = False  # a person is on its place, or in the way

    def decide(self, now: Situation) -> Plan:
        """Stay, or go to a better place; go back to its place after another behavior's turn."""
        plan = now.plan()
        quiet_until = holds(self.quiet, now.time)
        # This happens after a visit, or when the run begins.
        is_in_avoided_room = now.room is not None and now.room.index in self.avoided
        if quiet_until is not None and not is_in_avoided_room:
            return plan.stay(until=quiet_until)
        if self.place is not None and now.actor.kept_out:
            point = self.places.points[self.place].tolist()
            self.place = self.place if plan.reaches(*point) else None
        is_due = quiet_until is None and now.time >= self.decides_at
        if self.place is None or is_due:
            self.is_blocked = False
            self.decides_at = now.time + self.period
            draws = now.random("hangout")
            explores = quiet_until is None and draws.uniform() < self.explore
            if self.place is None or not explores:
                self._choose(now, plan)
            if explores:
                self._explore(now, plan, draws.choice(self.explored))
        x, y = self.places.points[self.place].tolist()
        if plan.position != (x, y) and not self.is_blocked:
            plan.go_to_point(x, y)
            self._face_room(now, plan)
        if quiet_until is not None:
            return plan.stay(until=quiet_until)
        quiet_begins = (span.next_begin(now.time) for span in self.quiet)
        asks_by = min([self.decides_at, *quiet_begins])
        return plan.stay(until=self.decides_at).ask_by(asks_by)

    def give_up(self, now: Situation) -> None:
        """Stay where it is until the next period."""
        self.is_blocked = True

    def _choose(self, now: Situation, plan: Plan) -> None:
        """Choose the place to stand at until the next period."""
        output = self.output(now)
        if output is None or output is not self.rated_output:  # outputs never change
            self._rate(self.belief(now, self.user).joint)
            self.rated_output = output
        if self._stays(plan):
            return
        scores = self.worth - self._ways(now.actor)
        best = int(np.argmax(scores))
        if self.place is not None and scores[best] <= scores[self.place] + self.hysteresis:
            return
        self.place = best
        room = int(self.places.room[best])
        plan.note(EventKind.RELOCATES, now.home.plan.rooms[room].name)

    def _stays(self, plan: Plan) -> bool:
        """Return whether no place can be better, even without the costs of the ways.

        This spares the computation of the ways to all places for robots that yield, which stand
        elsewhere each time.
        """
        if self.place is None:
            return False
        if self.best > self.worth[self.place] - self.moving + self.hysteresis:
            return False
        return plan.reaches(*self.places.points[self.place].tolist())

    def _explore(self, now: Situation, plan: Plan, room: int) -> None:
        """Look round in a room from viewpoints that show nearly all of it, by present walls."""
        if room in now.actor.kept_out:
            return
        target = now.home.rooms[room]
        plan.note(EventKind.EXPLORES, target.name)
        for point in viewpoints_of(now.actor, target, SHARE_TO_SHOW, MAX_VIEWS).points:
            if plan.reaches(*point):
                plan.go_to_point(*point).turn_by(1.0)

    def _rate(self, joint: F64) -> None:
        """Rate each place but for its way, by chances of rooms, float64 (rooms,)."""
        probabilities = joint.tobytes()
        if probabilities != self.rated_by:
            gain = np.zeros(len(self.places.points))
            # Unlike a matrix product, this sums in a fixed order, the same on every machine.
            for room, chance in enumerate(joint.tolist()):
                gain += chance * self.nearness[:, room]
            self.rated_by = probabilities
            self.worth = gain - self.penalty
            self.best = self.worth.max()

    def _ways(self, actor: Actor) -> F64:
        """Return the cost of the way to each place, float64 (n,), infinite without a way.

        The robot decides often but stands at few places, so costs are cached by position until its
        space changes.
        """
        space = actor.space
        points = self.places.points
        if self.ways[0] is not space:
            self.ways = space, {}
        cell = actor.state.x // SUB, actor.state.y // SUB
        if cell not in self.ways[1]:
            seconds = actor.seconds(space.distances(actor.state.position, points))
            is_reachable = np.isfinite(seconds)
            way = np.where(is_reachable, seconds, 0.0)
            move = way / (way + self.tau.total_seconds())
            self.ways[1][cell] = np.where(is_reachable, self.moving * move, np.inf)
        return self.ways[1][cell]

    def _face_room(self, now: Situation, plan: Plan) -> None:
        """Turn to the middle of the present room."""
        room = now.home.plan.rooms[int(self.places.room[self.place])]
        x, y = now.home.lattice.point_at(room.anchor_xy)
        if (x, y) != plan.position:
            plan.face(x, y)
