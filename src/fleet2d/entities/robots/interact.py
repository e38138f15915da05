"""Interaction with people: requests of a robot to them, and opportunities when they come by."""

import math
from datetime import datetime, timedelta
from typing import Literal, NamedTuple

from pydantic import Field

from fleet2d.configuration.units import Duration, Length, PositiveDuration, Share
from fleet2d.entities.behavior import Actor, Behavior, Situation
from fleet2d.entities.giving_way import resumed
from fleet2d.entities.place import Point, avoided_rooms
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.approach import (
    ANYONE,
    BeliefBehavior,
    approach,
    check_has_camera,
    is_in_rooms,
)
from fleet2d.errors import ComponentError
from fleet2d.floorplan.lattice import LatticePoint
from fleet2d.interactions.interaction import OUTCOMES, Outcome, Request
from fleet2d.kernels import F64
from fleet2d.runtime.determinism import exp2, sum_in_order
from fleet2d.runtime.events import EventKind

Step = Literal["seek", "ask", "carry_out"]
# A person who gave no answer isn't asked again before having moved this far [m].
MOVED_M = 1.0
# It looks for a person only above this probability of being at home, by `source`.
SOUGHT_FROM = 0.25
# It looks into the likeliest rooms, until they have this part of the probability.
ENOUGH = 0.9
# Without a source, all of the probability is at home; it counts as at most this.
MOST_SURE = 0.9
# The least times from one round for a person to the next, and to a round from an unanswered
# question, or from seeing that person in the same place.
SEARCH_PAUSE = timedelta(minutes=30)
UNANSWERED_PAUSE = timedelta(hours=4)
SATURDAY = 5
# An answer of the robot takes this time.
REPLY_TAKES = timedelta(seconds=10)
# If somebody was in the way, it tries again after this time.
DETOUR_PAUSE = timedelta(minutes=2)


class RoundCount(NamedTuple):
    """Rounds, and those that found a person, in an hour of the day; older ones count less."""

    found: float
    rounds: float
    at: datetime


class RoundMemory:
    """The evidence of rounds through the home on whether each person is there.

    In each hour of working days and of weekends, the share of rounds that found the person is mixed
    with the usual probability, which counts as two rounds; a round counts half after 14 days.
    A round that found nobody lowers the probability by Bayes' rule, as one in ten misses somebody
    who is there; that fades evenly over 8 h, or until the person is seen.
    """

    MISSED = 0.1
    DOUBT_LASTS = timedelta(hours=8)
    USUAL_COUNTS = 2.0
    HALF_LIFE = timedelta(days=14)

    def __init__(self) -> None:
        self._counts: dict[tuple[str, bool, int], RoundCount] = {}
        # The end of the last round without the person, and the probability right afterwards.
        self._empty: dict[str, tuple[datetime, float]] = {}

    def chance(self, person: str, time: datetime, usual: float) -> float:
        """Return the probability that a person is at home; `usual` without any round."""
        found, rounds, _ = self._count(person, time)
        chance = (found + self.USUAL_COUNTS * usual) / (rounds + self.USUAL_COUNTS)
        since, least = self._empty.get(person, (time, chance))
        return least + min(1.0, (time - since) / self.DOUBT_LASTS) * max(0.0, chance - least)

    def note_found(self, person: str, time: datetime) -> None:
        """Remember that a person was seen, on a round or not."""
        self._add(person, time, found=1)
        self._empty.pop(person, None)

    def note_empty(self, person: str, time: datetime, usual: float, enough: float) -> timedelta:
        """Remember that a round missed a person; return the time until the chance is `enough`."""
        chance = self.chance(person, time, usual)
        self._add(person, time, found=0)
        missed = self.MISSED * chance
        least = missed / (missed + 1 - chance) if missed else 0.0
        self._empty[person] = time, least
        rises = max(usual - least, 1e-9)
        return min(max((enough - least) / rises, 0.0), 1.0) * self.DOUBT_LASTS

    def _count(self, person: str, time: datetime) -> RoundCount:
        """Return the rounds for a person in an hour of such days, as they count now."""
        last = self._counts.get(_hour_of(person, time), RoundCount(0.0, 0.0, time))
        kept = exp2(-((time - last.at) / self.HALF_LIFE))
        return RoundCount(kept * last.found, kept * last.rounds, time)

    def _add(self, person: str, time: datetime, *, found: int) -> None:
        last = self._count(person, time)
        self._counts[_hour_of(person, time)] = RoundCount(last.found + found, last.rounds + 1, time)


def _hour_of(person: str, time: datetime) -> tuple[str, bool, int]:
    """Return a person, whether it is the weekend, and the hour."""
    return person, time.weekday() >= SATURDAY, time.hour


class ServedRequest(NamedTuple):
    """The state of serving a request.

    Attributes:
        request: The request.
        step: The purpose of the last plan.
        text: The interaction and the person, as events name them.
        place: Perceived position of the person when addressed [m].
        came_from: Position of the robot before it approached the person [lattice].
    """

    request: Request
    step: Step
    text: str
    place: Point = (0.0, 0.0)
    came_from: LatticePoint = (0, 0)


class Interact(BeliefBehavior):
    """Serve the requests of `interactions:`: approach, address, wait for the answer, carry out.

    The robot looks for the person of the most valuable request on a round through the rooms where
    `source` believes the person to be, likeliest first, up to nine tenths of the probability; not
    while the person is likely out of the home. Rounds that find nobody are evidence for that
    (`RoundMemory`): the robot looks again once the person was seen, or is likely enough at home at
    that hour, after 30 min at least. A person in view is approached and addressed; the robot waits
    for `patience`. Accepted requests are carried out. Otherwise the robot goes back to where it
    came from, and comes back at the time that the person named, or after `retry` of the
    interaction. A person who gave no answer isn't addressed again in the same place, and not looked
    for within 4 h, unless seen in another one: a sleeper isn't asked twice. Nobody is addressed in
    a room from which the robot is banned.

    With `timing`, an algorithm decides first: when a request comes up, when the person comes into
    view, and at most every `look`, the robot serves the request with the algorithm's probability
    for the hour and the room of the person, seen or believed. A request that was put off is taken
    up only at better moments than before.

    The robot answers questions of people (`replies`). Events, with the interaction and the person:
    `opportunity`, with that probability and the draw, `asks`, the answer, `delivered` and
    `withdraws`.

    Attributes:
        user: The person whose requests are served, or anyone.
        timing: The algorithm that knows good moments for requests; left out: at once.
        look: Least time between two draws for a request.
        patience: Time of waiting for an answer.
        again: Time after an answer other than yes before the same person is addressed again.
        seek: Whether the robot looks for people; else it serves only those who come into view.
    """

    records = frozenset(
        {
            EventKind.ASKS, EventKind.COLLECTS, EventKind.DELIVERED, EventKind.WITHDRAWS,
            EventKind.OPPORTUNITY, EventKind.REPLIES,
        }
    )  # fmt: skip
    listens = frozenset({EventKind.USER_SEEN, EventKind.DUE, EventKind.QUESTION})

    serves_requests = True

    timing: str | None = None
    look: PositiveDuration = timedelta(minutes=20)
    patience: PositiveDuration = timedelta(seconds=20)
    again: Duration = timedelta(minutes=10)
    seek: bool = True

    def reads(self) -> tuple[str, ...]:
        """Return the algorithms to read."""
        own = () if self.timing is None else (self.timing,)
        return super().reads() + own

    def start(self, actor: Actor) -> None:
        """Check that it has a camera."""
        check_has_camera(actor, "interact")
        self.served: ServedRequest | None = None
        self.plan: Plan | None = None  # the last plan that addresses somebody
        self.set_aside: dict[str, datetime] = {}  # times until which requests aren't considered
        self.unanswered: dict[str, Point] = {}  # places where people gave no answer
        self.best_so_far: dict[str, tuple[datetime, float]] = {}  # best chance of each request
        self.left_alone: dict[str, datetime] = {}  # times until which people aren't addressed
        self.at_home = RoundMemory()
        self.not_sought: dict[str, datetime] = {}  # times until which people aren't sought

    def awaits(self, now: Situation) -> frozenset[str]:
        """Leave out `user_seen` unless a request waits for somebody to come into view."""
        waits = any(self._waits_for(now, request) for request in self._ready(now))
        return self.listens if waits else self.listens - {EventKind.USER_SEEN}

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return the time at which a waiting request may be served."""
        queue = now.requests
        if queue is None or not queue.open:
            return None
        times = [queue.next_ready(now.time)]
        for request in queue.open:
            times += [self.left_alone.get(request.to), self.not_sought.get(request.to)]
            times.append(self.set_aside.get(request.text))
        later = (time for time in times if time is not None and time > now.time)
        return min(later, default=None)

    def busy(self) -> bool:
        """Return whether the robot is with a person, which hours don't end."""
        return self.served is not None and self.served.step in ("ask", "carry_out")

    def give_up(self, now: Situation) -> None:
        """Drop the way to a person, since somebody is in the way."""
        if self.served is not None:
            self.not_sought[self.served.request.to] = now.time + DETOUR_PAUSE
        self.served = None

    def decide(self, now: Situation) -> Plan | None:
        """Go on with a person, begin with another, or leave the decision to later behaviors."""
        served = self._take_served(now)
        if served is not None and served.step == "ask":
            return self._react(now, served)
        plan = self._reply(now)
        ready = self._ready(now)
        if plan is not None or not ready:
            return plan
        plan = self._address(now, ready, served) or self._look_on(now, ready, served)
        if plan is None:
            out_of_view = [request for request in ready if request.to not in now.in_view]
            plan = self._look_for_somebody(now, out_of_view)
        return plan

    def _take_served(self, now: Situation) -> ServedRequest | None:
        """Return and forget the served request; None if another behavior has interrupted that."""
        served = self.served
        if served is None:
            return None
        self.served = None
        if now.actor.plan.root is self.plan:
            return served
        if served.step == "ask":  # the robot may have been sent away
            self.left_alone[served.request.to] = now.time + self.again
        return None

    def _reply(self, now: Situation) -> Plan | None:
        """Answer the question of a person, if there is one."""
        event = next((event for event in now.events if event.event == EventKind.QUESTION), None)
        if event is None:
            return None
        plan = now.plan().face_place((event.x, event.y))
        return plan.note(EventKind.REPLIES, event.user).stay(REPLY_TAKES)

    def _address(
        self, now: Situation, ready: list[Request], served: ServedRequest | None
    ) -> Plan | None:
        """Address the person of a request who is in view; None: nobody is."""
        in_view = now.in_view
        for request in ready:
            place = in_view.get(request.to)
            if place is not None and self._may_address(now, request, place):
                is_meant = served is not None and served.request is request
                if is_meant or self._is_good_time(now, request):
                    return self._ask(now, request, place)
        return None

    def _ready(self, now: Situation) -> list[Request]:
        """Return the open requests of its users that may be tried now, the most valuable first."""
        ready = [] if now.requests is None else now.requests.ready(now.time)
        return [each for each in ready if self.user in (ANYONE, each.to)]

    def _waits_for(self, now: Situation, request: Request) -> bool:
        """Return whether the person of a request would be addressed now, if in view."""
        rests = self.set_aside.get(request.text), self.left_alone.get(request.to)
        return all(until is None or until <= now.time for until in rests)

    def _look_for_somebody(self, now: Situation, ready: list[Request]) -> Plan | None:
        """Plan a search for the first requested person who is likely at home; None: nobody is."""
        for request in ready:
            to = request.to
            if not self.seek or not request.interaction.seek:
                continue
            rests = self.not_sought.get(to, now.time), self.left_alone.get(to, now.time)
            if max(rests) > now.time:
                continue
            joint = self.belief(now, to).joint
            usual = min(MOST_SURE, sum_in_order(joint.tolist()))
            if self.at_home.chance(to, now.time, usual) < SOUGHT_FROM:
                self.not_sought[to] = now.time + SEARCH_PAUSE
            elif self._is_good_time(now, request):
                return self._seek(now, request, joint)
        return None

    def _end_round(self, now: Situation, person: str, *, is_in_view: bool) -> None:
        """Wait after a round without a person to address: not found, or in view and left alone."""
        pause = UNANSWERED_PAUSE if person in self.unanswered else SEARCH_PAUSE
        if not is_in_view:
            joint = self.belief(now, person).joint
            usual = min(MOST_SURE, sum_in_order(joint.tolist()))
            doubted = self.at_home.note_empty(person, now.time, usual, SOUGHT_FROM)
            pause = max(SEARCH_PAUSE, doubted)
        self.not_sought[person] = now.time + pause

    def _may_address(self, now: Situation, request: Request, place: Point) -> bool:
        """Return whether a person in view may be addressed: one who was left alone for a while."""
        if self._leaves_alone(now, request, place):
            return False
        self.unanswered.pop(request.to, None)
        self.not_sought.pop(request.to, None)
        return True

    def _leaves_alone(self, now: Situation, request: Request, place: Point) -> bool:
        """Return whether the person of a request is left alone at a place; nothing changes."""
        if self.left_alone.get(request.to, now.time) > now.time:
            return True
        if is_in_rooms(now, *place, now.actor.banned(now.step)):
            return True
        x, y = self.unanswered.get(request.to, (math.inf, math.inf))
        return (x - place[0]) ** 2 + (y - place[1]) ** 2 < MOVED_M**2

    def _is_good_time(self, now: Situation, request: Request) -> bool:
        """Draw whether to serve a request now, with the probability that `timing` names."""
        if self.timing is None:
            return True
        if self.set_aside.get(request.text, now.time) > now.time:
            return False
        assert now.requests is not None
        self.set_aside[request.text] = now.time + self.look
        since, best = self.best_so_far.get(request.text, (request.since, 0.0))
        best = best if since == request.since else 0.0
        # The request is served at the first moment whose chance exceeds a threshold drawn for it.
        chance = max(0.0, (self._asking_probability(now, self.timing, request) - best) / (1 - best))
        is_drawn = now.random(f"timing {request.text}").uniform() < chance
        best = 0.0 if is_drawn else best + chance * (1 - best)
        self.best_so_far[request.text] = request.since, best
        text = f"{request.text} {chance:.3f} {'asks' if is_drawn else 'waits'}"
        now.requests.opportunities.append((now.step, text))
        return is_drawn

    def _asking_probability(self, now: Situation, timing: str, request: Request) -> float:
        """Return the probability that an algorithm asks now; 1 before its first output.

        Raises:
            ComponentError: The algorithm's output has no such probabilities.
        """
        output = now.outputs.get(timing)
        if output is None:
            return 1.0
        if not callable(getattr(output, "chance", None)):
            raise ComponentError(
                f"the output of {timing!r} has no chances of asking: name an algorithm of type"
                " timing, or one whose output has a method `chance`, as TimingChances has"
            )
        room = self._room_of(now, request.to)
        chance: float = output.chance(request.to, request.name, now.time, room)
        return chance

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
        self.at_home.note_found(request.to, now.time)
        x, y = now.home.lattice.point_at(now.nearest_free(*now.xy))
        self.served = ServedRequest(request, "ask", request.text, place, (x, y))
        plan = now.plan()
        approach(now, plan, *place, request.interaction.distance)
        plan.face_place(place)
        plan.note(EventKind.ASKS, request.text).stay(self.patience).interrupt_on(*OUTCOMES)
        self.plan = plan.root
        return plan

    def _react(self, now: Situation, served: ServedRequest) -> Plan:
        """Carry out an accepted request, or withdraw after another answer."""
        request = served.request
        to = served.text.rpartition(" ")[2]
        answers = answers_to(now, served.text)
        if Outcome.ACCEPTED in answers:
            self.served = served._replace(step="carry_out")
            self.plan = _carry_out(now, request, served.text)
            return self.plan.stay(timedelta(seconds=1))
        if not answers:
            assert now.requests is not None
            now.requests.settle(request, Outcome.IGNORED, now.time, now.time)
        if not answers or Outcome.IGNORED in answers:
            self.unanswered[to] = served.place
            self.not_sought[to] = now.time + UNANSWERED_PAUSE
        self.left_alone[to] = now.time + self.again
        plan = now.plan().note(EventKind.WITHDRAWS, served.text)
        return plan.go_to_point(*served.came_from).stay(timedelta(seconds=1))

    def _seek(self, now: Situation, request: Request, joint: F64) -> Plan:
        """Look into the likeliest rooms on one round, on which the person may come into view."""
        chances = joint.tolist()
        rooms = now.actor.reachable_rooms()
        rooms.sort(key=lambda room: (-chances[room.index], room.index))
        total = sum_in_order(chances[room.index] for room in rooms)
        self.served = ServedRequest(request, "seek", request.text)
        self.plan = now.plan()
        looked = 0.0
        for room in rooms:
            if looked > ENOUGH * total:
                break
            looked += chances[room.index]
            self.plan.go_to_point(*now.actor.middle(room)).turn_by(1)
        return self.plan.interrupt_on(EventKind.USER_SEEN)

    def _look_on(
        self, now: Situation, ready: list[Request], served: ServedRequest | None
    ) -> Plan | None:
        """Continue an interrupted round; None if it is over and nobody was found."""
        if served is None or served.step != "seek" or served.request not in ready:
            return None
        last = now.actor.plan
        plan = None
        is_in_view = served.request.to in now.in_view
        if not is_in_view and not last.is_over(now.step):
            plan = resumed(now.plan(), last, now.step)
        if plan is None:
            self._end_round(now, served.request.to, is_in_view=is_in_view)
            return None
        self.served = served
        return plan.interrupt_on(EventKind.USER_SEEN)


def answers_to(now: Situation, text: str) -> list[str]:
    """Return the answers to a question of which a robot has heard at a step."""
    events = (event for event in now.events if event.user == text)
    return [event.event for event in events if event.event in OUTCOMES]


def _carry_out(now: Situation, request: Request, text: str) -> Plan:
    """Return a plan to carry out an accepted request, such as to collect or deliver something."""
    interaction = request.interaction
    is_delivered = text.rpartition(" ")[2] == interaction.to
    done = EventKind.DELIVERED if is_delivered else EventKind.COLLECTS
    return now.plan().stay(interaction.takes).note(done, text)


class Opportunistic(Behavior):
    """Approach a person who comes into view, and interact for a while.

    The interrupted behavior goes on afterwards. The robot goes to the perceived position; a person
    who walks on in the meantime isn't followed. Events: `approaches`, `interacts`, with the name of
    the person as perceived, and `interaction_over`. If the robot has a request to the person
    (`interactions:`), it asks (`asks`), and carries out an accepted one (`delivered`).

    Attributes:
        users: Users to approach; left out: everybody, recognized or not.
        distance: Distance to the person [m]; personal space ends at 1.2 m.
        interaction: Duration of an interaction.
        chance: Probability of taking an opportunity.
        again: Minimum time between two approaches to the same person.
        no_stops_in: Rooms, or kinds of rooms if the home has them, in which to leave people alone.
    """

    records = frozenset(
        {
            EventKind.APPROACHES, EventKind.ASKS, EventKind.COLLECTS, EventKind.DELIVERED,
            EventKind.INTERACTION_OVER, EventKind.INTERACTS,
        }
    )  # fmt: skip
    listens = frozenset({EventKind.USER_SEEN})

    users: tuple[str, ...] = ()
    distance: Length = Field(default=1.2, ge=0.3, le=10)
    interaction: Duration = timedelta(minutes=1)
    chance: Share = 1.0
    again: Duration = timedelta(minutes=15)
    no_stops_in: tuple[str, ...] = ()

    def about(self) -> tuple[str, ...]:
        """Return the users to approach, if only some."""
        return self.users

    def start(self, actor: Actor) -> None:
        """Check that it has a camera."""
        check_has_camera(actor, "opportunistic")
        self.avoided = avoided_rooms(actor, "opportunistic.no_stops_in", self.no_stops_in)
        self.asked: tuple[Request, str] | None = None  # the request, with its text in events
        self.left_alone: dict[str, datetime] = {}  # times until which people aren't approached

    def decide(self, now: Situation) -> Plan | None:
        """Approach somebody in view, or leave the decision to later behaviors."""
        asked = self.asked
        self.asked = None
        texts = [event.user for event in now.events if event.event == EventKind.ACCEPTED]
        if asked is not None and asked[1] in texts:
            request, text = asked
            person = text.rpartition(" ")[2]
            return _carry_out(now, request, text).note(EventKind.INTERACTION_OVER, person)
        avoided = self.avoided | now.actor.banned(now.step)
        for name, (x, y) in sorted(now.in_view.items()):
            is_meant = not self.users or name in self.users
            is_left_alone = self.left_alone.get(name, now.time) > now.time
            if not is_meant or is_left_alone or is_in_rooms(now, x, y, avoided):
                continue
            self.left_alone[name] = now.time + self.again
            if now.random(f"chance {name}").uniform() < self.chance:
                return self._approach(now, name, x, y)
        return None

    def _approach(self, now: Situation, name: str, x: float, y: float) -> Plan:
        plan = now.plan().note(EventKind.APPROACHES, name)
        approach(now, plan, x, y, self.distance)
        plan.face_place((x, y))
        plan.note(EventKind.INTERACTS, name)
        ready = [] if now.requests is None else now.requests.ready(now.time, (name,))
        self.asked = (ready[0], ready[0].text) if ready else None
        if self.asked is not None:
            plan.note(EventKind.ASKS, self.asked[1]).interrupt_on(EventKind.ACCEPTED)
        return plan.stay(self.interaction).note(EventKind.INTERACTION_OVER, name)
