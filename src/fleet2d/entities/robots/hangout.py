"""Hangout: stand near people without blocking their way, and move rarely."""

from datetime import datetime, timedelta
from typing import ClassVar

import numpy as np
from pydantic import Field

from fleet2d.component import register
from fleet2d.entities.actor import Actor
from fleet2d.entities.behavior import Situation
from fleet2d.entities.hours import Hours, holds
from fleet2d.entities.kinds import available_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import face
from fleet2d.entities.robots.belief import BeliefBehavior
from fleet2d.entities.robots.places import HangoutPlaces, Nearness
from fleet2d.entities.robots.viewpoints import Viewpoints, viewpoints_of
from fleet2d.errors import PlacementError
from fleet2d.floorplan.home.space import Space
from fleet2d.kernels import F64
from fleet2d.kernels.space import SUB
from fleet2d.units import Length, PositiveDuration, Share

# When exploring a room: the part of it to be shown, by at most this many viewpoints.
ENOUGH = 0.95
MOST_VIEWS = 4


@register("behavior", "hangout")
class Hangout(BeliefBehavior):
    """Stand near where people likely are, out of their way.

    Every `period` it rates the places on a grid of 0.5 m by

    sum over rooms p(room) nearness(place, room) - blocking * b(place) - personal_space * s(place)
    - moving * m(place)

    where p(room) is the probability that the user is at home and in that room, from `source`; b is
    the share of the shortest ways between two rooms that lead through the robot's body there, for a
    person of radius 0.2 m; s falls from 1 on the place where furniture is used to 0 at 1.2 m from
    it; and m = t / (t + tau), with t the travel time from where it is [s]. It moves only to a place
    that beats the present one by `hysteresis`, and never in quiet hours. With probability
    `explore` it goes to a room drawn with equal chances instead, looks round in it, and comes back,
    so that its observations don't depend only on its own beliefs.

    If a person blocks its way and doesn't move, it stays where it is until the next period.

    Events: `relocates`, with the room it goes to, and `explores`, with the room it looks round in.

    Attributes:
        period: How often it decides where to stand.
        near: The measure of nearness: the same room; a view of its seats; or travel time.
        tau: Travel time at which nearness by `path` has fallen to 1/e.
        blocking: Weight of blocking people's ways.
        personal_space: Weight of being near a seat.
        moving: Weight of the travel time to a place.
        hysteresis: By how much another place must be better for it to move.
        explore: Share of decisions in which it explores any room instead.
        avoid: Rooms, or kinds of rooms if the home has them, that it stays out of.
        quiet: Hours in which it doesn't move.
        off_doors: How far from doorways it stands at least [m].
    """

    records: ClassVar[frozenset[str]] = frozenset({"explores", "relocates"})

    period: PositiveDuration = timedelta(minutes=30)
    near: Nearness = "path"
    tau: PositiveDuration = timedelta(seconds=10)
    blocking: float = Field(default=1.0, ge=0)
    personal_space: float = Field(default=0.5, ge=0)
    moving: float = Field(default=0.05, ge=0)
    hysteresis: float = Field(default=0.1, ge=0)
    explore: Share = 0.1
    avoid: tuple[str, ...] = ()
    quiet: Hours = ()
    off_doors: Length = Field(default=0.8, ge=0)

    def start(self, actor: Actor) -> None:
        """Lay out the places, and rate them by what doesn't depend on where people are."""
        avoided = available_rooms(actor, "hangout.avoid", self.avoid, needed=False)
        self.avoided = frozenset(room.index for room in avoided)
        self.places = HangoutPlaces(actor, self.avoided, self.off_doors)
        if not len(self.places.points):
            raise PlacementError(
                f"{actor.path}: there is no place to hang out at, off doorways by"
                f" {self.off_doors:g} m and out of: {', '.join(self.avoid) or 'no room'}"
            )
        self.nearness = self.places.nearness(self.near, self.tau.total_seconds())
        self.penalty = self.blocking * self.places.block + self.personal_space * self.places.prox
        self.ways: tuple[Space, dict[tuple[int, int], F64]] = actor.space, {}
        self.explored = [r.index for r in actor.reachable_rooms() if r.index not in self.avoided]
        self.viewpoints: tuple[int, dict[int, Viewpoints]] = actor.home.version, {}
        self.rated_by: F64 | None = None  # the probabilities behind `worth`
        self.worth = -self.penalty
        self.place: int | None = None
        self.decides_at = actor.clock.start
        self.is_blocked = False  # a person is on its place, or in front of it

    def decide(self, now: Situation) -> Plan:
        """Stay, or go to a better place; go back to its place after another behavior's turn."""
        plan, quiet_until = now.plan(), holds(self.quiet, now.time)
        if quiet_until is not None and not self._is_in_avoided_room(now):
            return plan.stay(until=quiet_until)
        if self.place is None or (quiet_until is None and now.time >= self.decides_at):
            self.is_blocked = False
            self.decides_at = now.time + self.period
            draws = now.random("hangout")
            explores = quiet_until is None and draws.uniform() < self.explore
            if self.place is None or not explores:
                self._choose(now, plan)
            if explores:
                self._explore(now, plan, draws.choice(self.explored))
        x, y = self.places.points[self.place].tolist()
        if (plan.x, plan.y) != (x, y) and not self.is_blocked:
            plan.go_to_point(x, y)
            self._face_room(now, plan)
        if quiet_until is not None:
            return plan.stay(until=quiet_until)
        return plan.stay(until=self.decides_at).ask_by(
            self._quiet_begins(self.decides_at, now.time)
        )

    def give_up(self, now: Situation) -> None:
        """Stay where it is until the next period."""
        self.is_blocked = True

    def _is_in_avoided_room(self, now: Situation) -> bool:
        """Return whether it is in a room to avoid, as after a visit or when the run begins."""
        return now.room is not None and now.room.index in self.avoided

    def _choose(self, now: Situation, plan: Plan) -> None:
        """Choose the place to stand at until the next period."""
        belief = self.belief(now, self.user)
        scores = self._scores(now, belief.joint)
        best = int(np.argmax(scores))
        if self.place is None or scores[best] > scores[self.place] + self.hysteresis:
            self.place = best
            plan.note("relocates", now.home.plan.rooms[int(self.places.room[best])].name)

    def _explore(self, now: Situation, plan: Plan, room: int) -> None:
        """Look round in a room from viewpoints that show nearly all of it, by present walls."""
        actor = now.actor
        if self.viewpoints[0] != actor.home.version:
            self.viewpoints = actor.home.version, {}
        known = self.viewpoints[1]
        if room not in known:
            known[room] = viewpoints_of(actor, actor.home.rooms[room], ENOUGH, MOST_VIEWS)
        plan.note("explores", actor.home.rooms[room].name)
        for point in known[room].points:
            if plan.reaches(*point):
                plan.go_to_point(*point).turn_by(1.0)

    def _scores(self, now: Situation, joint: F64) -> F64:
        """Return the rating of each place, float64 (n,), by the probability of each room."""
        if self.rated_by is None or not np.array_equal(joint, self.rated_by):
            gain = np.zeros(len(self.places.points))
            # Summed in a fixed order, unlike in a matrix product: the same on every machine.
            for room, chance in enumerate(joint.tolist()):
                gain += chance * self.nearness[:, room]
            self.rated_by, self.worth = joint, gain - self.penalty
        return self.worth - self._ways(now.actor)

    def _ways(self, actor: Actor) -> F64:
        """Return the cost of the way to each place, float64 (n,), infinite without a way.

        The robot decides often, but stands at few places: costs are kept by position, until its
        space changes.
        """
        space, points = actor.space, self.places.points
        if self.ways[0] is not space:
            self.ways = space, {}
        cell = actor.state.x // SUB, actor.state.y // SUB
        if cell not in self.ways[1]:
            seconds = actor.seconds(space.distances((actor.state.x, actor.state.y), points))
            is_reachable = np.isfinite(seconds)
            way = np.where(is_reachable, seconds, 0.0)
            move = way / (way + self.tau.total_seconds())
            self.ways[1][cell] = np.where(is_reachable, self.moving * move, np.inf)
        return self.ways[1][cell]

    def _face_room(self, now: Situation, plan: Plan) -> None:
        """Turn to the middle of the room that it stands in."""
        room = now.home.plan.rooms[int(self.places.room[self.place])]
        x, y = now.home.plan.lattice.point_at(room.anchor_xy)
        if (x, y) != (plan.x, plan.y):
            face(plan, x, y)

    def _quiet_begins(self, until: datetime, time: datetime) -> datetime:
        """Return when the next quiet hours begin, or `until` if that is earlier."""
        return min([until, *(span.next_begin(time) for span in self.quiet)])
