"""Hangout: stand near people without being in the way, and move rarely."""

from datetime import datetime, timedelta
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.component import register
from fleet2d.entities.behavior import Behavior, Situation
from fleet2d.entities.hours import Hours, holds
from fleet2d.entities.kinds import kept_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import face
from fleet2d.entities.robots.belief import ANYONE, room_belief
from fleet2d.entities.robots.looking import Views, views_of
from fleet2d.entities.robots.places import Nearness, Places
from fleet2d.errors import PlacementError
from fleet2d.kernels.mesh import SUB
from fleet2d.units import Length, PositiveDuration, Share

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor
    from fleet2d.floorplan.home.space import Space

# A room is looked over when so much of it was shown, or from so many places.
ENOUGH = 0.95
MOST_VIEWS = 4


@register("behavior", "hangout")
class Hangout(Behavior):
    """Stand where people likely are, out of their way; think about it now and then.

    Every `period` it rates the places on a grid of 0.5 m by

    sum over rooms p(room) nearness(place, room) - blocking * b(place) - personal_space * s(place)
    - moving * m(place)

    where p(room) is the probability that the user is at home and in that room, from `source`; b is
    the share of the shortest ways between two rooms that lead through the robot's body there, for a
    person of radius 0.2 m; s falls from 1 on the place where furniture is used to 0 at 1.2 m from
    it; and m = t / (t + tau), with t the seconds on foot from where it is. It moves only to a place
    that beats the present one by `hysteresis`, and never in quiet hours. With probability
    `explore` it goes to a room drawn with equal chances instead, looks all of it over, and comes
    back, so that what it believes doesn't feed on itself.

    Where somebody is in its way who doesn't go away, it stays where it is until it thinks again.

    Events: `relocates`, with the room it goes to, and `explores`, with the room it looks over.
    """

    records: ClassVar[frozenset[str]] = frozenset({"explores", "relocates"})

    source: str | None = Field(
        default=None,
        description="the algorithm that says where people are; left out: rooms count by their size",
    )
    user: str = Field(default=ANYONE, min_length=1, description="near whom, or anyone")
    period: PositiveDuration = Field(
        default=timedelta(minutes=30), description="how often it thinks about where to stand"
    )
    near: Nearness = Field(
        default="path",
        description="what counts as near: the same room; a view of its seats; or time on foot",
    )
    tau: PositiveDuration = Field(
        default=timedelta(seconds=10),
        description="time on foot at which nearness by `path` has fallen to 1/e",
    )
    blocking: float = Field(default=1.0, ge=0, description="weight of ways that it stands in")
    personal_space: float = Field(default=0.5, ge=0, description="weight of seats that it is near")
    moving: float = Field(default=0.05, ge=0, description="weight of the way to a place")
    hysteresis: float = Field(
        default=0.1, ge=0, description="by how much another place must be better for it to move"
    )
    explore: Share = Field(
        default=0.1, description="share of decisions in which it looks over any room instead"
    )
    avoid: tuple[str, ...] = Field(
        default=(),
        description="rooms, or kinds of rooms if the home has them, that it stays out of",
    )
    quiet: Hours = Field(default=(), description="hours in which it doesn't move")
    off_doors: Length = Field(
        default=0.8, ge=0, description="how far from doorways it stands at least [m]"
    )

    def start(self, actor: "Actor") -> None:
        """Find the places, and rate what doesn't depend on where people are."""
        avoided = kept_rooms(actor, "hangout.avoid", self.avoid, needed=False)
        self.avoided = frozenset(room.index for room in avoided)
        self.places = Places(actor, self.avoided, self.off_doors)
        if not len(self.places.points):
            raise PlacementError(
                f"{actor.path}: there is no place to hang out at, off doorways by"
                f" {self.off_doors:g} m and out of: {', '.join(self.avoid) or 'no room'}"
            )
        self.nearness = self.places.nearness(self.near, self.tau.total_seconds())
        self.penalty = self.blocking * self.places.block + self.personal_space * self.places.prox
        self.ways: tuple[Space, dict[tuple[int, int], NDArray[np.float64]]] = actor.space, {}
        self.explored = [r.index for r in actor.reachable_rooms() if r.index not in self.avoided]
        self.views: tuple[int, dict[int, Views]] = actor.home.version, {}
        self.believed: NDArray[np.float64] | None = None  # by which places were rated last
        self.worth = -self.penalty
        self.place: int | None = None
        self.decides_at = actor.clock.start
        self.kept_off = False  # somebody is on its place, or in front of it

    def reads(self) -> tuple[str, ...]:
        """Return the algorithm that it goes by."""
        return () if self.source is None else (self.source,)

    def about(self) -> tuple[str, ...]:
        """Return the user that it stays near."""
        return () if self.user == ANYONE else (self.user,)

    def decide(self, now: Situation) -> Plan:
        """Stay, or go where it is better; back to its place, if it was called away."""
        plan, still = now.plan(), holds(self.quiet, now.time)
        if still is not None and not self._is_in_avoided_room(now):
            return plan.stay(until=still)
        if self.place is None or (still is None and now.time >= self.decides_at):
            self.kept_off = False
            self.decides_at = now.time + self.period
            draws = now.random("hangout")
            explores = still is None and draws.uniform() < self.explore
            if self.place is None or not explores:
                self._choose(now, plan)
            if explores:
                self._look_over(now, plan, draws.choice(self.explored))
        x, y = self.places.points[self.place].tolist()
        if (plan.x, plan.y) != (x, y) and not self.kept_off:
            plan.go_to_point(x, y)
            self._face_people(now, plan)
        if still is not None:
            return plan.stay(until=still)
        return plan.stay(until=self.decides_at).ask_by(
            self._quiet_begins(self.decides_at, now.time)
        )

    def give_up(self, now: Situation) -> None:
        """Stay where it is until it thinks again."""
        self.kept_off = True

    def _is_in_avoided_room(self, now: Situation) -> bool:
        """Tell whether it is where it doesn't stay, as after a visit or when the run begins."""
        return now.room is not None and now.room.index in self.avoided

    def _choose(self, now: Situation, plan: Plan) -> None:
        """Choose the place to stand at until it thinks again."""
        belief = room_belief(now, self.source, self.user)
        scores = self._scores(now, belief.joint)
        best = int(np.argmax(scores))
        if self.place is None or scores[best] > scores[self.place] + self.hysteresis:
            self.place = best
            plan.note("relocates", now.home.plan.rooms[int(self.places.room[best])].name)

    def _look_over(self, now: Situation, plan: Plan, room: int) -> None:
        """Look round in a room from where nearly all of it is in view; walls as they are now."""
        actor = now.actor
        if self.views[0] != actor.home.version:
            self.views = actor.home.version, {}
        if room not in self.views[1]:
            self.views[1][room] = views_of(actor, actor.home.rooms[room], ENOUGH, MOST_VIEWS)
        plan.note("explores", actor.home.rooms[room].name)
        for point in self.views[1][room].points:
            if plan.reaches(*point):
                plan.go_to_point(*point).turn_by(1.0)

    def _scores(self, now: Situation, joint: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rating of each place: float64 (n,); products are summed room by room."""
        if self.believed is None or not np.array_equal(joint, self.believed):
            gain = np.zeros(len(self.places.points))
            for room, chance in enumerate(joint.tolist()):  # in a fixed order, unlike a product
                gain += chance * self.nearness[:, room]
            self.believed, self.worth = joint, gain - self.penalty
        return self.worth - self._ways(now.actor)

    def _ways(self, actor: "Actor") -> NDArray[np.float64]:
        """Return what the way to each place counts: float64 (n,), infinite where none leads.

        It stands at few places, and thinks there often: ways from them are kept, until it can go
        other ways.
        """
        space, points = actor.space, self.places.points
        if self.ways[0] is not space:
            self.ways = space, {}
        cell = actor.state.x // SUB, actor.state.y // SUB
        if cell not in self.ways[1]:
            metres = space.distances((actor.state.x, actor.state.y), points)
            seconds = metres * actor.home.plan.lattice.units_per_m / actor.speed
            reached = np.isfinite(seconds)
            way = np.where(reached, seconds, 0.0)
            move = way / (way + self.tau.total_seconds())
            self.ways[1][cell] = np.where(reached, self.moving * move, np.inf)
        return self.ways[1][cell]

    def _face_people(self, now: Situation, plan: Plan) -> None:
        """Turn to the middle of the room that it stands in."""
        room = now.home.plan.rooms[int(self.places.room[self.place])]
        x, y = now.home.plan.lattice.point_at(room.anchor_xy)
        if (x, y) != (plan.x, plan.y):
            face(plan, x, y)

    def _quiet_begins(self, until: datetime, time: datetime) -> datetime:
        """Return when the next quiet hours begin, or `until` if that is earlier."""
        return min([until, *(span.next_begin(time) for span in self.quiet)])
