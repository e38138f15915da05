"""Interact: look for the people of its requests, address them, wait for an answer, carry out."""

from datetime import datetime, timedelta
from typing import ClassVar, Literal, NamedTuple

from pydantic import Field

from fleet2d.configuration.components import register
from fleet2d.configuration.units import Duration, PositiveDuration, Share
from fleet2d.entities.behavior import Actor, Situation
from fleet2d.entities.giving_way import resumed
from fleet2d.entities.place import Point
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import (
    ANYONE,
    BeliefBehavior,
    approach,
    check_has_camera,
)
from fleet2d.errors import NoWayError
from fleet2d.interactions.interaction import Outcome, Request
from fleet2d.runtime.determinism import sum_in_order

Step = Literal["seek", "ask", "carry_out", "withdraw"]
ANSWERS = frozenset(str(outcome) for outcome in Outcome)
# A person who gave no answer isn't asked again before having moved this far [m].
MOVED_M = 1.0
# It looks into the likeliest rooms, until they have this part of the probability.
ENOUGH = 0.9


class ServedRequest(NamedTuple):
    """What the robot is doing about a request.

    Attributes:
        request: The request.
        step: What its last plan was for.
        place: Where the person was perceived when addressed [m].
    """

    request: Request
    step: Step
    place: Point | None = None


@register("behavior", "interact")
class Interact(BeliefBehavior):
    """Serve the requests of `interactions:`: approach, address, wait for the answer, carry out.

    It looks for the person of the most valuable request, at most four times, in the rooms where
    `source` believes the person to be, likeliest first, up to nine tenths of the probability. A
    person in view is approached and addressed; the robot waits for `patience`. What is accepted is
    carried out; after any other answer the robot withdraws from the room, and comes back at the
    time that the person named, or after `retry` of the interaction. A person who gave no answer
    isn't addressed again in the same place: a sleeper isn't asked twice. Rooms that it was told to
    keep out of are no part of its ways any more.

    With `timing` it asks an algorithm first: when a request comes up, when the person comes into
    view, and at most every `look`, it serves it with the probability that the algorithm names for
    the hour and the room of the person, seen or believed. A request that was put off is taken up
    only at moments that are better than those before.

    Events, with the interaction and the person: `opportunity`, with that probability and what was
    drawn, `asks`, the answer, `delivered` and `withdraws`.

    Attributes:
        user: Whose requests it serves, or anyone's.
        timing: The algorithm that knows when a person welcomes what; left out: at once.
        look: Least time between two draws for a request.
        patience: How long it waits for an answer.
        again: Time after an answer other than yes before it addresses the same person again.
        seek: Whether it looks for people; else it serves only those who come into view.
        only_urgent_at: With `timing`: part of the time to the deadline after which it no longer
            waits for a better moment.
    """

    records: ClassVar[frozenset[str]] = frozenset({"asks", "delivered", "withdraws", "opportunity"})
    listens: ClassVar[frozenset[str]] = frozenset({"user_seen", "due"})

    serves_requests: ClassVar[bool] = True

    timing: str | None = None
    look: PositiveDuration = timedelta(minutes=20)
    patience: PositiveDuration = timedelta(seconds=20)
    again: Duration = timedelta(minutes=10)
    seek: bool = True
    only_urgent_at: Share = Field(default=1.0)

    def reads(self) -> tuple[str, ...]:
        """Return the algorithms that it reads."""
        return (*super().reads(), *(() if self.timing is None else (self.timing,)))

    def start(self, actor: Actor) -> None:
        """Check that it has a camera."""
        check_has_camera(actor, "interact")
        self.served: ServedRequest | None = None
        self.plan: Plan | None = None  # the last one that addresses somebody
        self.looked: dict[str, datetime] = {}  # when each request was considered last
        self.unanswered: dict[str, Point] = {}  # where a person gave no answer
        self.best_so_far: dict[str, tuple[datetime, float]] = {}  # best chance of each request
        self.left_alone: dict[str, datetime] = {}  # until when each person isn't addressed
        self.not_found: dict[str, datetime] = {}  # when it may look for a person again

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return when a request may be served that has to wait now."""
        queue = now.requests
        if queue is None:
            return None
        times = [queue.next_change(), queue.next_ready(now.time)]
        later = (*self.not_found.values(), *self.left_alone.values())
        times += [time for time in later if time > now.time]
        times += [seen + self.look for seen in self.looked.values() if seen + self.look > now.time]
        return min((time for time in times if time is not None), default=None)

    def busy(self) -> bool:
        """Return whether it is with a person, which hours don't end."""
        return self.served is not None and self.served.step in ("ask", "carry_out")

    def give_up(self, now: Situation) -> None:
        """Drop the way to a person: somebody is in the way."""
        if self.served is not None:
            self.not_found[self.served.request.text] = now.time + timedelta(minutes=2)
        self.served = None

    def decide(self, now: Situation) -> Plan | None:
        """Go on with a person, begin with another, or leave the decision to later behaviors."""
        if now.requests is None:
            return None
        self._keep_out(now)
        served = self.served
        if served is not None and served.step in ("ask", "carry_out"):
            if now.actor.plan.root is self.plan:
                return self._go_on(now, served)
            served = self.served = None  # another behavior has interrupted it
        if served is not None and served.step == "withdraw":
            served = self.served = None
        ready = [
            request
            for request in now.requests.ready(now.time)
            if self.user in (ANYONE, request.interaction.to)
        ]
        for request in ready:
            place = now.in_view.get(request.interaction.to)
            if place is not None and self._may_address(now, request, place):
                is_meant = served is not None and served.request is request
                if is_meant or self._is_good_time(now, request):
                    return self._ask(now, request, place)
        return self._look_for_somebody(now, ready, served)

    def _look_for_somebody(
        self, now: Situation, ready: list[Request], served: ServedRequest | None
    ) -> Plan | None:
        """Look for the person of a request; None: of none, or it has looked for all."""
        self.served = None
        if served is not None and (plan := self._look_on(now, served)) is not None:
            return plan
        for request in ready:
            again_at = self.not_found.get(request.text, now.time)
            if max(again_at, self.left_alone.get(request.interaction.to, now.time)) > now.time:
                continue
            if self.seek and request.interaction.seek and self._is_good_time(now, request):
                return self._seek(now, request)
        return None

    def _keep_out(self, now: Situation) -> None:
        """Keep out of the rooms that it was told to, from when it is outside on."""
        queue, room = now.requests, now.room
        assert queue is not None
        if queue.banned != now.actor.kept_out and (room is None or room.index not in queue.banned):
            now.actor.kept_out = queue.banned

    def _may_address(self, now: Situation, request: Request, place: Point) -> bool:
        """Return whether a person in view may be addressed: one who was left alone for a while."""
        if self.left_alone.get(request.interaction.to, now.time) > now.time:
            return False
        quiet_at = self.unanswered.get(request.interaction.to)
        if quiet_at is not None and _squared(quiet_at, place) < MOVED_M**2:
            return False
        self.unanswered.pop(request.interaction.to, None)
        return True

    def _is_good_time(self, now: Situation, request: Request) -> bool:
        """Draw whether to serve a request now, with the probability that `timing` names."""
        if self.timing is None:
            return True
        last = self.looked.get(request.text)
        if last is not None and now.time - last < self.look:
            return False
        assert now.requests is not None
        self.looked[request.text] = now.time
        chances, chance, to = now.outputs.get(self.timing), 1.0, request.interaction.to
        age = (now.time - request.since) / request.interaction.within
        if chances is not None and age < self.only_urgent_at:
            chance = chances.chance(to, request.name, now.time, self._room_of(now, to))
        since, best = self.best_so_far.get(request.text, (request.since, 0.0))
        best = best if since == request.since else 0.0
        # It is asked at the first moment whose chance exceeds a threshold drawn for the request.
        chance = max(0.0, (chance - best) / (1 - best))
        is_drawn = now.random(f"timing {request.text}").uniform() < chance
        best = 0.0 if is_drawn else best + chance * (1 - best)
        self.best_so_far[request.text] = request.since, best
        text = f"{request.text} {chance:.3f} {'asks' if is_drawn else 'waits'}"
        now.requests.opportunities.append((now.step, text))
        return is_drawn

    def _room_of(self, now: Situation, person: str) -> int | None:
        """Return the index of the room of a person in view, or the likeliest one."""
        place = now.in_view.get(person)
        if place is not None:
            room = now.home.plan.room_at(*place)
            return None if room is None else room.index
        if self.source is None:
            return None
        joint = self.belief(now, person).joint.tolist()
        return joint.index(max(joint))

    def _ask(self, now: Situation, request: Request, place: Point) -> Plan:
        """Approach a person in view, address the person, and wait for the answer."""
        self.served = ServedRequest(request, "ask", place)
        self.plan = plan = now.plan()
        approach(now, plan, *place, request.interaction.distance)
        plan.face(*now.home.plan.lattice.point_at(place))
        return plan.note("asks", request.text).stay(self.patience).interrupt_on(*ANSWERS)

    def _go_on(self, now: Situation, served: ServedRequest) -> Plan:
        """Carry out what was accepted, say that it is done, or withdraw after another answer."""
        request, to = served.request, served.request.interaction.to
        if served.step == "carry_out":
            self.served = None
            return now.plan().note("delivered", request.text).stay(timedelta(seconds=1))
        answers = [e.event for e in now.events if e.event in ANSWERS and e.user == request.text]
        if Outcome.ACCEPTED in answers:
            self.served = served._replace(step="carry_out")
            self.plan = now.plan().stay(request.interaction.takes)
            return self.plan
        if not answers:
            assert now.requests is not None
            now.requests.settle(request, Outcome.IGNORED, now.time, now.time)
        if served.place is not None and (not answers or Outcome.IGNORED in answers):
            self.unanswered[to] = served.place
        self.served = served._replace(step="withdraw")
        self.left_alone[to] = now.time + self.again
        return self._withdraw(now, request)

    def _withdraw(self, now: Situation, request: Request) -> Plan:
        """Leave the room of the person for the nearest one in which it isn't shut in by bans."""
        plan, room, queue = now.plan().note("withdraws", request.text), now.room, now.requests
        assert queue is not None
        entity, others = now.actor.entity, now.actor.reachable_rooms()
        if queue.banned:
            space = now.home.space(
                entity.radius, opens_doors=entity.opens_doors, without=queue.banned
            )
            others = [other for other in others if other.index in space.rooms_of(0)]
        others = [other for other in others if room is None or other.index != room.index]
        if others and room is not None:
            here = now.xy
            nearest = min(others, key=lambda r: _squared(r.anchor_xy, here))
            try:
                plan.go_to([nearest.name], "withdraw")
            except NoWayError:
                plan.stay(timedelta(seconds=10))
        return plan.stay(timedelta(seconds=1))

    def _seek(self, now: Situation, request: Request) -> Plan:
        """Look into the likeliest rooms, on one round; the person may come into view on the way."""
        joint = self.belief(now, request.interaction.to).joint
        rooms = now.actor.reachable_rooms()
        rooms.sort(key=lambda room: (-float(joint[room.index]), room.index))
        total = sum_in_order(float(joint[room.index]) for room in rooms)
        self.served, self.plan = ServedRequest(request, "seek"), now.plan()
        looked = 0.0
        for room in rooms:
            if looked > ENOUGH * total:
                break
            looked += float(joint[room.index])
            self.plan.go_to_point(*now.actor.middle(room)).turn_by(1)
        return self.plan.interrupt_on("user_seen")

    def _look_on(self, now: Situation, served: ServedRequest) -> Plan | None:
        """Go on with a round that somebody has interrupted; None: it is over, without a find."""
        last = now.actor.plan
        if last.root is not self.plan:
            return None
        plan = None if last.is_over(now.step) else resumed(now.actor, now.plan(), last, now.step)
        if plan is None:
            within = served.request.interaction.within
            self.not_found[served.request.text] = now.time + max(
                served.request.interaction.retry, within / 4
            )
            return None
        self.served = served
        return plan.interrupt_on("user_seen")


def _squared(one: Point, other: Point) -> float:
    return (one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2
