"""Roaming: people whose rooms are drawn from given shares of time, and pets."""

from datetime import timedelta

import numpy as np
from pydantic import Field

from fleet2d.configuration.problems import problem
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.place import available_places, available_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.users.resident import Spot, Spots
from fleet2d.errors import PlacementError
from fleet2d.floorplan.lattice import UNITS_PER_CELL
from fleet2d.kernels import I64
from fleet2d.routines.activity import AnyDurationDistribution, DurationDistribution
from fleet2d.routines.distributions import draw_weighted
from fleet2d.routines.planner import MILLION
from fleet2d.runtime.clock import SECOND_US
from fleet2d.runtime.determinism import Draws, sum_in_order

AWAY = "away"
# This many visits are planned at once.
VISITS = 20
# The minimum length of a stay after subtracting the time of travel [us].
SHORTEST_US = 10 * SECOND_US
# The room is looked up at this many points per metre of a way.
POINTS_PER_M = 10


class RoomSampling(Behavior):
    """Be in each room for a given share of the time, in visits of random length.

    A semi-Markov process: the next room is drawn by the shares (if it is the present one, the body
    goes to another spot of it), the stay there from the distribution of dwell times. Time spent
    walking through a room is taken off the next stays in it, so that the time in each of the given
    rooms, walks included, tends to its share of the time in all of them. Time spent walking through
    other rooms is not compensated.

    Attributes:
        shares: Relative shares of the time in each room or kind of room, or 'away'.
        dwell: Duration of a visit.
    """

    always_decides = True

    shares: dict[str, float] = Field(
        min_length=1, examples=[{"living_room": 0.4, "bedroom": 0.4, "kitchen": 0.2}]
    )
    dwell: AnyDurationDistribution = DurationDistribution(
        law="gamma", mean=timedelta(minutes=30), std=timedelta(minutes=20)
    )

    def model_post_init(self, _: object, /) -> None:
        """Require shares of which at least one is above 0."""
        for name, share in self.shares.items():
            if share < 0:
                raise problem(f"the share of {name} is {share:g}: a share is 0 or more")
        if sum_in_order(self.shares.values()) <= 0:
            raise problem("all shares are 0: give one room a share above that")

    def start(self, actor: Actor) -> None:
        """Find the rooms; those of a kind have equal parts of its share."""
        names = [(name,) for name in self.shares if name != AWAY]
        available = {(AWAY,), *available_places(actor, "room_sampling.shares", names)}
        shares = {name: share for name, share in self.shares.items() if (name,) in available}
        total = sum_in_order(shares.values())
        if total <= 0:
            raise PlacementError(
                f"room_sampling.shares: nothing is left of it in this home: {', '.join(shares)}"
                " have a share of 0"
            )
        chances: dict[int | None, float] = {}
        for name, share in shares.items():
            rooms = [None] if name == AWAY else [room.index for room in actor.rooms((name,))]
            for index in rooms:
                chances[index] = chances.get(index, 0.0) + share / total / len(rooms)
        # Shares by the room's index, None for out of the home [per million].
        self.chances = {index: round(chance * MILLION) for index, chance in chances.items()}
        self.dwell_time = self.dwell.table()
        self.spots = Spots(actor)
        self.debt_us = {room: 0 for room in self.chances if room is not None}
        self.visits = 0

    def decide(self, now: Situation) -> Plan:
        """Plan the next visits."""
        plan = now.plan()
        for _ in range(VISITS):
            draws = Draws(now.actor.stream("visit"), self.visits)
            self.visits += 1
            self._visit(now.actor, plan, draws)
        return plan

    def _visit(self, actor: Actor, plan: Plan, draws: Draws) -> None:
        number = draw_weighted(draws, list(self.chances.values()))
        room = list(self.chances)[number]
        dwell_us = self.dwell_time.draw(draws) * SECOND_US
        if room is None:
            if not plan.away:
                self._walk(actor, plan, Spot(*actor.way_out))
                plan.leave_home()
            plan.stay(timedelta(microseconds=dwell_us))
            return
        spots = self.spots.in_room(actor.home.rooms[room])
        self._walk(actor, plan, draws.choice(spots))
        owed = self.debt_us[room]
        stay_us = max(dwell_us - owed, SHORTEST_US)
        self.debt_us[room] = owed - (dwell_us - stay_us)
        plan.stay(timedelta(microseconds=stay_us))

    def _walk(self, actor: Actor, plan: Plan, goal: Spot) -> None:
        """Walk to a spot, and add the time on the way to the debt of the rooms it leads through."""
        start = plan.position
        began_us = plan.time_us
        if start == goal and not plan.away:
            return
        goal.walk(plan)
        route = actor.space.route(start, tuple(goal))
        if route is None:
            return
        walk_us = plan.time_us - began_us
        for room, share in _rooms_along(actor, route):
            if room in self.debt_us:
                self.debt_us[room] += int(walk_us * share)


def _rooms_along(actor: Actor, route: I64) -> list[tuple[int, float]]:
    """Return the index of each room on a route, and its share of the route's length."""
    plan = actor.home.plan
    legs = np.diff(route, axis=0).astype(np.float64)
    lengths = np.sqrt((legs * legs).sum(axis=1))
    points_per_unit = POINTS_PER_M / plan.lattice.units_per_m
    steps = np.maximum(lengths * points_per_unit, 1).astype(np.int64)
    points = []
    for leg in range(len(legs)):
        along = (np.arange(steps[leg]) + 0.5) / steps[leg]
        points.append(route[leg] + along[:, None] * legs[leg])
    column, row = (np.concatenate(points).astype(np.int64) // UNITS_PER_CELL).T
    weight = np.repeat(lengths / steps, steps)
    rooms = plan.room_of_place[row, column]
    total = np.cumsum(weight)[-1]
    if not total > 0:
        return []
    by_room = ((room, weight[rooms == room]) for room in np.unique(rooms).tolist())
    return [(room, float(np.cumsum(weights)[-1] / total)) for room, weights in by_room]


# Probability that the next spot is in the same room.
STAYS_IN_ROOM = 0.6
# This many naps are planned at once.
NAPS = 10


class Pet(Behavior):
    """Nap somewhere, roam through a few spots of the home, nap somewhere else.

    The durations of naps and stops are drawn at random. The next spot is in the same room
    with probability 0.6, else in any room that it may enter.

    Attributes:
        rooms: Rooms and kinds of rooms that it may enter; none: all.
        nap: Duration of a nap.
        stop: Duration of a stop at a spot.
        spots: Smallest and largest number of stops between two naps.
    """

    always_decides = True
    usual_height = 0.3

    rooms: tuple[str, ...] = ()
    nap: AnyDurationDistribution = DurationDistribution(
        mean=timedelta(minutes=50), std=timedelta(minutes=40)
    )
    stop: AnyDurationDistribution = DurationDistribution(
        mean=timedelta(seconds=40), std=timedelta(seconds=40)
    )
    spots: tuple[int, int] = (3, 12)

    def model_post_init(self, _: object, /) -> None:
        """Require a range of spots."""
        least, most = self.spots
        if not 0 <= least <= most:
            raise problem(f"spots: expected [least, most] like [3, 12], got {list(self.spots)}")

    def start(self, actor: Actor) -> None:
        """Find the rooms that the pet may enter."""
        rooms = available_rooms(actor, "pet.rooms", self.rooms)
        self.allowed_rooms = rooms or actor.reachable_rooms()
        self.places = Spots(actor)
        self.durations = self.nap.table(), self.stop.table()
        self.naps = 0
        self.room = Draws(actor.stream("first room"), 0).choice(self.allowed_rooms)

    def decide(self, now: Situation) -> Plan:
        """Plan the next naps, and the stops between them."""
        plan = now.plan()
        nap, stop = self.durations
        least, most = self.spots
        for _ in range(NAPS):
            draws = Draws(now.actor.stream("roam"), self.naps)
            self.naps += 1
            for _ in range(least + draws.below(most - least + 1)):
                self._walk(plan, draws)
                plan.stay(timedelta(seconds=stop.draw(draws)))
            self._walk(plan, draws)
            plan.take("lie").stay(timedelta(seconds=nap.draw(draws)))
        return plan

    def _walk(self, plan: Plan, draws: Draws) -> None:
        """Walk to the next spot."""
        if draws.uniform() >= STAYS_IN_ROOM:
            self.room = draws.choice(self.allowed_rooms)
        draws.choice(self.places.in_room(self.room)).walk(plan)
