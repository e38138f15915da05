"""Find: look for a person, room by room, by what is believed and how far it is."""

from datetime import datetime, timedelta
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from fleet2d.component import register
from fleet2d.entities.behavior import Behavior, Command, Situation
from fleet2d.entities.plan import Plan
from fleet2d.entities.resume import resumed
from fleet2d.entities.robots.approach import AT_A_DOOR, approach, check_has_camera, face, spot_back
from fleet2d.entities.robots.belief import ANYONE, room_belief
from fleet2d.entities.robots.sites import Sites
from fleet2d.errors import PlacementError
from fleet2d.search.policies import MOST_EXACT, Policy, after_empty_looks, order_by
from fleet2d.units import Duration, Length, PositiveDuration, Share, TimeOfDay, problem

if TYPE_CHECKING:
    from fleet2d.entities.actor import Actor

DAY = timedelta(days=1)


class Missed(NamedTuple):
    """A look that found nobody."""

    site: int
    at: datetime


class Search(NamedTuple):
    """A search under way."""

    since: datetime
    user: str
    missed: tuple[Missed, ...] = ()
    route: tuple[int, ...] = ()  # sites to go to yet, of a policy that decides beforehand
    going_to: int | None = None
    left_out: frozenset[int] = frozenset()  # sites that somebody didn't let it get to


@register("behavior", "find")
class Find(Behavior):
    """Look for a person at given times, or when called, until found, given up or believed out.

    A site is a room, looked round in from so many places that little of it stays out of view. In
    which order the sites are looked at is for the `policy` to say, from what `source` says of where
    the person is now, and the ways: see :mod:`fleet2d.search.policies`. `receding` decides anew
    after every empty look, by the belief that is left; the others decide once, when the search
    begins.

    The person is found when the cameras perceive somebody as that person; it may be somebody else
    whom they mistake. Called to find somebody, the robot begins at once, or as soon as the
    behaviors before this one let it, and drops the search that it was on. Events, with the person's
    name: `find_begins`, and one of `found`, `not_at_home` and `gave_up`.
    """

    records: ClassVar[frozenset[str]] = frozenset(
        {"find_begins", "found", "gave_up", "not_at_home"}
    )
    answers: ClassVar[frozenset[str]] = frozenset({"find"})

    user: str = Field(default=ANYONE, min_length=1, description="whom it looks for, or anyone")
    source: str | None = Field(
        default=None,
        description="the algorithm that says where people are; left out: rooms count by their size",
    )
    policy: Policy = Field(default="receding", description="in which order it looks at the rooms")
    at: tuple[TimeOfDay, ...] = Field(
        default=(),
        description="times of day at which it begins; without them and `every`: when it is called",
    )
    every: PositiveDuration | None = Field(
        default=None, description="or how much time lies between two searches, from the start on"
    )
    late: Duration = Field(
        default=timedelta(minutes=30),
        description="a search that can't begin within that time is left out",
    )
    deadline: PositiveDuration = Field(
        default=timedelta(minutes=10), description="after that it gives up"
    )
    out_at: Share = Field(
        default=0.9,
        description="it says that the person isn't at home once that is believed to be so probable,"
        " and every room that it can get to has been looked at",
    )
    doubt: Share = Field(
        default=0.1, description="share of belief that counts rooms by their size, whatever is said"
    )
    out: Share = Field(
        default=0.5,
        description="probability that the person is out, for as long as nothing says where people"
        " are",
    )
    memory: Duration = Field(
        default=timedelta(minutes=20),
        description="an empty look counts half when it is so long ago: people move",
    )
    views: int = Field(
        default=2, ge=1, le=8, description="in a room it looks round from so many places at most"
    )
    distance: Length = Field(
        default=1.5, ge=0.3, le=10, description="how far it stays from who is found [m]"
    )
    stay: Duration = Field(
        default=timedelta(minutes=1), description="how long it stays with who is found"
    )

    @model_validator(mode="after")
    def _begins(self) -> Self:
        if self.at and self.every is not None:
            raise problem("it begins by 'at' (times of day) or 'every' (a duration), not by both")
        return self

    def about(self) -> tuple[str, ...]:
        """Return whom it looks for."""
        return () if self.user == ANYONE else (self.user,)

    def takes(self, command: Command) -> bool:
        """Tell whether it would look for who is wanted."""
        return super().takes(command) and self.user in (ANYONE, command.target)

    def start(self, actor: "Actor") -> None:
        """Find where to look round in each room."""
        check_has_camera(actor, "find")
        self.sites = Sites(actor, self.views)
        if self.policy == "exact" and len(self.sites) > MOST_EXACT:
            raise PlacementError(
                f"{actor.path}: the exact policy works for up to {MOST_EXACT} rooms, and there are"
                f" {len(self.sites)}: choose policy: receding"
            )
        self.search: Search | None = None
        self.plan: Plan | None = None  # the last one it made
        start = actor.clock.start
        self.due: datetime | None = self._next(
            start if self.every else start - timedelta(microseconds=1), start
        )

    def reads(self) -> tuple[str, ...]:
        """Return the algorithm that it goes by."""
        return () if self.source is None else (self.source,)

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return when the next search begins."""
        return self.due

    def busy(self) -> bool:
        """Tell whether it searches."""
        return self.search is not None

    def give_up(self, now: Situation) -> None:
        """Leave out the site that it was going to, for this search."""
        search = self.search
        if search is not None and search.going_to is not None:
            left_out = search.left_out | {search.going_to}
            self.search = search._replace(left_out=left_out, route=search.route[1:], going_to=None)

    def decide(self, now: Situation) -> Plan | None:
        """Begin a search that is due, go on with one, or leave the robot to others."""
        plan = now.plan()
        user = self._called(now)
        if user is None and self.search is None and self._is_due(now):
            user = self.user
        if user is not None:
            self.search = Search(now.time, user)
            plan.note("find_begins", user)
        elif self.search is None:
            return None
        else:
            self._take_in(now)
            user = self.search.user
        seen = now.in_view
        name = user if user != ANYONE else next(iter(sorted(seen)), ANYONE)
        if name in seen:
            return self._found(now, plan, *seen[name])
        return self._go_on(now) or self._look_on(now, plan)

    def _called(self, now: Situation) -> str | None:
        """Return whom it is called to find, once; None: nobody."""
        if now.command is None or not self.takes(now.command):
            return None
        command = now.take_command("find")
        return None if command is None else command.target

    def _go_on(self, now: Situation) -> Plan | None:
        """Return what is left of a look in which somebody else came into view."""
        last = now.actor.plan
        if not now.events or last.root is not self.plan or last.is_over(now.step):
            return None
        plan = resumed(now.actor, now.plan(), last, now.step)
        return None if plan is None else plan.interrupt_on("user_seen")

    def _is_due(self, now: Situation) -> bool:
        """Tell whether a search is due, and not too late; in either case it isn't due any more."""
        due, start = self.due, now.actor.clock.start
        while self.due is not None and self.due <= now.time:
            due, self.due = self.due, self._next(self.due, start)
        return due is not None and due <= now.time <= due + self.late

    def _take_in(self, now: Situation) -> None:
        """Note that the look that the last plan made found nobody, if it came to its end."""
        search = self.search
        assert search is not None
        plan = now.actor.plan
        whole = plan.root is self.plan and plan.is_over(now.step)
        if search.going_to is not None and whole and not now.events:
            missed = (*search.missed, Missed(search.going_to, now.time))
            self.search = search._replace(missed=missed, route=search.route[1:], going_to=None)

    def _found(self, now: Situation, plan: Plan, x: float, y: float) -> Plan:
        assert self.search is not None
        user, self.search = self.search.user, None
        approach(now, plan.note("found", user), x, y, self.distance)
        back = spot_back(now, x, y, self.distance)
        if (plan.x, plan.y) == (now.actor.state.x, now.actor.state.y) != back:
            plan.go_to_point(*back)
        face(plan, *now.home.plan.lattice.point_at((x, y)))
        return plan.stay(self.stay)

    def _look_on(self, now: Situation, plan: Plan) -> Plan | None:
        """Go to the site that is next and look round there, or end the search."""
        search = self.search
        assert search is not None
        ends = search.since + self.deadline
        if now.time >= ends:
            return self._end(plan, "gave_up")
        prior, away = self._prior(now)
        age, memory = self._ages(search, now), self.memory.total_seconds()
        left = after_empty_looks(prior, age, memory, self.sites.share)
        out = away >= self.out_at * (away + sum(left.tolist()))
        unseen = np.flatnonzero(np.isinf(age)).tolist()
        if out and not any(self.sites.can_go(plan, site) for site in unseen):
            return self._end(plan, "not_at_home")
        route = search.route
        if self.policy == "receding" or not route:
            problem = self.sites.problem(now, after_empty_looks(prior, age, memory))
            route = tuple(order_by(self.policy, problem, now.random("order")))
        while route and (route[0] in search.left_out or not self.sites.can_go(plan, route[0])):
            route = route[1:]
        self.search = search._replace(route=route, going_to=route[0] if route else None)
        if route:
            self.sites.look_round(plan, route[0]).interrupt_on("user_seen")
        else:  # shut doors all round
            plan.stay(AT_A_DOOR)
        self.plan = plan.ask_by(ends)
        return plan

    def _prior(self, now: Situation) -> tuple[NDArray[np.float64], float]:
        """Return the probability of each site, and that of being out, before any look."""
        assert self.search is not None
        belief = room_belief(now, self.source, self.search.user)
        sizes = np.array([now.home.plan.rooms[room].cells for room in self.sites.rooms.tolist()])
        shares = belief.share[self.sites.rooms]
        known = sum(shares.tolist())
        shares = shares / known if known > 0 else np.zeros(len(sizes))
        doubt = self.doubt if known > 0 else 1.0
        mixed = (1 - doubt) * shares + doubt * sizes / int(sizes.sum())
        said = self.source is not None and now.outputs.get(self.source) is not None
        away = belief.away if said else self.out
        return mixed * (1 - away), away

    def _ages(self, search: Search, now: Situation) -> NDArray[np.float64]:
        """Return how long ago each site was looked at in vain [s], infinite for never."""
        ages = np.full(len(self.sites), np.inf)
        for missed in search.missed:  # the last one counts
            ages[missed.site] = (now.time - missed.at).total_seconds()
        return ages

    def _end(self, plan: Plan, event: str) -> Plan:
        assert self.search is not None
        user, self.search = self.search.user, None
        return plan.note(event, user)

    def _next(self, after: datetime, start: datetime) -> datetime | None:
        """Return when the next search is due after a moment; None: only when called."""
        if self.every is not None:
            return start + ((after - start) // self.every + 1) * self.every
        if not self.at:
            return None
        midnight = datetime.combine(after.date(), datetime.min.time())
        times = sorted(midnight + i * DAY + at for i in range(2) for at in self.at)
        return next(time for time in times if time > after)
