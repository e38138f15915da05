"""Ask policy: a robot that learns from sightings and answers whom to ask what, and when.

An observation has a row for each of the robot's interactions, in the order of the scenario. Nothing
in it is the truth: it is computed from the robot's queue, clock and sightings, and from the answers
that it was given; attitudes and activities of people are hidden.
"""

from datetime import datetime, timedelta
from typing import Literal, get_args

import numpy as np
from pydantic import Field

from fleet2d import kernels
from fleet2d.configuration.units import PositiveDuration
from fleet2d.entities.behavior import Actor, Situation
from fleet2d.entities.giving_way import resumed
from fleet2d.entities.plan import Plan
from fleet2d.entities.robots.interact import Interact, ServedRequest, answers_to
from fleet2d.entities.robots.policy import (
    HOURS,
    KIND_OF_TYPE,
    KINDS,
    LONG_S,
    SATURDAY,
    SEEN_S,
    LearnedBehavior,
)
from fleet2d.errors import PlacementError
from fleet2d.interactions.interaction import InteractionKind, Outcome, Request
from fleet2d.kernels import F32, F64, TURN, UNIT, Bool
from fleet2d.runtime.clock import DAY_MINUTES, DAY_S, HOUR_S
from fleet2d.runtime.events import EventKind

REQUEST_KINDS: tuple[str, ...] = get_args(InteractionKind)

ASK_COLUMNS = (
    # These describe the interaction and its open request.
    *("interaction", "open", "worth", "value", "time_left", "tries"),
    *(f"do_{kind}" for kind in REQUEST_KINDS),
    # These describe its person, as the robot has seen them.
    *("in_view", "seen_30min", "seen_6h", "seen_now"),
    *(f"in_{kind}" for kind in KINDS),
    # These count the answers so far.
    *("asked_1h", "asked_1d", "yes", "yes_now", "time_now"),
    # These are the same in all rows.
    *("hour_sin", "hour_cos", "weekend", "weeks"),
)
"""The columns of an observation, in their order: see docs/how-to/gym.md."""
_AT = {name: number for number, name in enumerate(ASK_COLUMNS)}

# The value of an interaction whose column `worth` is a half.
HALF_WORTH = 2.0
# After this time the column `weeks` is a half.
WEEKS_S = 28 * DAY_S
# Time of standing after a round that found nobody.
MOMENT = timedelta(seconds=1)
# Only a person who had time gives these answers.
HAD_TIME = frozenset({Outcome.ACCEPTED, Outcome.DECLINED})
# Imagined answers in each rate, half of them yes.
PRIOR = 2.0

Stage = Literal["react", "reply", "address", "go_on", "end_round", "choose", "leave"]


class AskPolicy(LearnedBehavior, Interact):
    """Let a learned policy choose which request to serve next, or to wait.

    The robot approaches, addresses and looks for people as `interact` does. The policy chooses
    whenever a request comes up, the robot is done with one, or `period` after it chose to wait:
    action i is to serve the open request of interaction i, looking for its person if necessary; the
    last action is to wait. Requests that aren't open, have to rest, or are about a person to be
    left alone can't be chosen. While the robot waits, later behaviors decide.

    Attributes:
        requests: Number of interactions in an observation; a scenario may have fewer.
        period: Time of waiting, unless a request comes up.
    """

    columns = ASK_COLUMNS

    requests: int = Field(default=8, ge=1, le=256)
    period: PositiveDuration = timedelta(minutes=30)

    @property
    def rows(self) -> int:
        """Number of interactions in an observation."""
        return self.requests

    def start(self, actor: Actor) -> None:
        """Begin without answers.

        Raises:
            PlacementError: The robot has no camera.
            InputError: The file is no policy.
        """
        super().start(actor)
        self.open_policy()
        self.waits_until = actor.clock.start
        self.asked = np.zeros((self.requests, HOURS))
        self.accepted = np.zeros((self.requests, HOURS))
        self.had_time = np.zeros((self.requests, HOURS))
        self.asked_at = np.full(self.requests, -np.inf)  # [s since the start]

    def names(self, now: Situation) -> list[str]:
        """Return the names of the robot's interactions, in the order of the rows.

        Raises:
            PlacementError: The robot has more interactions than an observation has rows.
        """
        names = [] if now.requests is None else list(now.requests.interactions)
        if len(names) > self.requests:
            raise PlacementError(
                f"{now.actor.path}: it has {len(names)} interactions, and observations have"
                f" {self.requests}: set requests: {len(names)}, or more, here and when you train"
            )
        return names

    def options(self, now: Situation) -> dict[int, Request]:
        """Return the requests that may be served now, by their rows."""
        names = self.names(now)
        options = dict[int, Request]()
        for request in self._ready(now):
            if self._may_serve(now, request):
                options.setdefault(names.index(request.name), request)
        return options

    def _may_serve(self, now: Situation, request: Request) -> bool:
        """Return whether the person of a request may be addressed, or looked for."""
        to = request.to
        is_asked = self.served is not None and self.served.request.to == to
        if is_asked and self._is_broken_off(now):
            return False  # the robot was sent away while it asked
        place = now.in_view.get(to)
        if place is not None:
            return not self._leaves_alone(now, request, place)
        rests = self.left_alone.get(to, now.time), self.not_sought.get(to, now.time)
        return self.seek and request.interaction.seek and max(rests) <= now.time

    def mask(self, now: Situation) -> Bool:
        """Return which actions are possible: requests that may be served, and last to wait."""
        mask = np.zeros(self.requests + 1, np.bool_)
        mask[[*self.options(now), -1]] = True
        return mask

    def why_not(self, now: Situation, row: int) -> str:
        """Return why the request of a row can't be served."""
        names = self.names(now)
        if row >= len(names):
            return f"interaction {row}, which doesn't exist"
        return f"{names[row]}, which isn't open, or whose person has to be left alone for a while"

    def observe(self, now: Situation) -> F32:
        """Return the observation, float32 (requests, columns): see docs/how-to/gym.md."""
        table = np.zeros((self.requests, len(ASK_COLUMNS)), np.float32)
        queue = now.requests
        if queue is None:
            return table
        open_now = {request.name: request for request in reversed(queue.open)}
        minute = (now.time.hour * 60 + now.time.minute) * TURN // DAY_MINUTES
        elapsed_s = now.step * now.actor.clock.step_us / 1e6
        for row, name in enumerate(self.names(now)):
            interaction = queue.interactions[name]
            shown = {
                "interaction": 1.0,
                "worth": interaction.worth / (interaction.worth + HALF_WORTH),
                f"do_{interaction.do}": 1.0,
                "hour_sin": kernels.sine(minute) / UNIT,
                "hour_cos": kernels.cosine(minute) / UNIT,
                "weekend": float(now.time.weekday() >= SATURDAY),
                "weeks": elapsed_s / (elapsed_s + WEEKS_S),
            }
            request = open_now.get(name)
            if request is not None:
                shown |= {
                    "open": 1.0,
                    "value": request.value_at(now.time) / max(interaction.worth, 1e-9),
                    "time_left": (request.until - now.time) / interaction.within,
                    "tries": request.tries / interaction.tries,
                }
            to = interaction.to if request is None else request.to
            shown |= self._sightings(now, to) | self._answers(now, row, to)
            for column, value in shown.items():
                table[row, _AT[column]] = value
        return table

    def _sightings(self, now: Situation, person: str) -> dict[str, float]:
        """Return the columns on when and where a person was seen."""
        memory = now.actor.recall().rooms
        of = list(now.actor.people).index(person)
        last: int = int(memory.last[of].max())
        if last < 0:
            return {}
        age_s = (now.step - last) * now.actor.clock.step_us / 1e6
        room = now.home.rooms[int(memory.last[of].argmax())]
        at_hour = memory.looks[of].sum(axis=0)
        return {
            "in_view": float(person in now.in_view),
            "seen_30min": SEEN_S / (SEEN_S + age_s),
            "seen_6h": LONG_S / (LONG_S + age_s),
            "seen_now": float(at_hour[now.time.hour] / max(at_hour.max(), 1)),
            f"in_{KIND_OF_TYPE.get(room.type, 'other')}": 1.0,
        }

    def _answers(self, now: Situation, row: int, person: str) -> dict[str, float]:
        """Return the columns on a person's answers, to an interaction and to all."""
        assert now.requests is not None
        wanted = now.requests.interactions.values()
        same = [number for number, each in enumerate(wanted) if each.to == person]
        hours = [(now.time.hour + near) % HOURS for near in (-1, 0, 1)]
        elapsed_s = now.step * now.actor.clock.step_us / 1e6
        since_s = elapsed_s - float(self.asked_at[same].max(initial=-np.inf))
        return {
            "asked_1h": HOUR_S / (HOUR_S + since_s),
            "asked_1d": DAY_S / (DAY_S + since_s),
            "yes": _rate(self.accepted[row], self.asked[row]),
            "yes_now": _rate(self.accepted[row, hours], self.asked[row, hours]),
            "time_now": _rate(self.had_time[same][:, hours], self.asked[same][:, hours]),
        }

    def asks(self, now: Situation) -> bool:
        """Return whether the decision at a step depends on the policy."""
        return self._stage(now) == "choose"

    def _is_broken_off(self, now: Situation) -> bool:
        """Return whether an order or another behavior has broken off the question to a person."""
        is_asking = self.served is not None and self.served.step == "ask"
        return is_asking and now.actor.plan.root is not self.plan

    def _stage(self, now: Situation) -> Stage:
        """Return the stage of the behavior at a step; nothing changes."""
        served = self.served if now.actor.plan.root is self.plan else None
        if served is not None and served.step == "ask":
            return "react"
        if any(event.event == EventKind.QUESTION for event in now.events):
            return "reply"
        if served is not None and served.step == "seek" and served.request in self._ready(now):
            place = now.in_view.get(served.request.to)
            if place is not None and not self._leaves_alone(now, served.request, place):
                return "address"
            is_over = place is not None or self._rest_of_round(now) is None
            return "end_round" if is_over else "go_on"
        is_due = any(event.event == EventKind.DUE for event in now.events)
        waits = now.time < self.waits_until and not is_due
        return "leave" if waits or not self.options(now) else "choose"

    def _rest_of_round(self, now: Situation) -> Plan | None:
        """Return the rest of the present round; None: it is over."""
        last = now.actor.plan
        return None if last.is_over(now.step) else resumed(now.plan(), last, now.step)

    def wakes_at(self, now: Situation, plan: Plan) -> datetime | None:
        """Return the time at which the policy may choose again."""
        times = [super().wakes_at(now, plan)]
        if now.time < self.waits_until and now.requests is not None and now.requests.open:
            times.append(self.waits_until)
        return min((time for time in times if time is not None), default=None)

    def decide(self, now: Situation) -> Plan | None:
        """Go on with a person, let the policy choose, or leave the decision to later behaviors."""
        served = self.served
        plan = self._next_plan(now)
        if served is not None and served.step == "ask":
            self._remember_answer(now, served)  # observations are made before this
        return plan

    def _next_plan(self, now: Situation) -> Plan | None:
        """Return the plan at a step; None: later behaviors decide."""
        stage = self._stage(now)
        served = self._take_served(now)
        if stage == "reply":
            return self._reply(now)
        if stage == "choose":
            return self._serve(now)
        if served is None or stage == "leave":
            return None
        request = served.request
        if stage == "react":
            return self._react(now, served)
        if stage == "address":
            return self._address_in_view(now, request)
        if stage == "end_round":
            self._end_round(now, request.to, is_in_view=request.to in now.in_view)
            return now.plan().stay(MOMENT)
        rest = self._rest_of_round(now)
        assert rest is not None
        self.served = served
        return rest.interrupt_on(EventKind.USER_SEEN)

    def _serve(self, now: Situation) -> Plan | None:
        """Carry out the action that the policy chooses."""
        action = self.choose(now)
        if action == self.requests:
            self.waits_until = now.time + self.period
            return None
        self.waits_until = now.time
        request = self.options(now)[action]
        if request.to in now.in_view:
            return self._address_in_view(now, request)
        return self._seek(now, request, self.belief(now, request.to).joint)

    def _address_in_view(self, now: Situation, request: Request) -> Plan:
        """Address the person of a request, who is in view."""
        place = now.in_view[request.to]
        self._may_address(now, request, place)  # the robot may address the person again
        return self._ask(now, request, place)

    def _remember_answer(self, now: Situation, served: ServedRequest) -> None:
        """Count the answer to a question; being sent away counts as no answer."""
        row = self.names(now).index(served.request.name)
        answers = answers_to(now, served.text)
        hour = now.time.hour
        self.asked[row, hour] += 1
        self.accepted[row, hour] += Outcome.ACCEPTED in answers
        self.had_time[row, hour] += any(answer in HAD_TIME for answer in answers)
        self.asked_at[row] = now.step * now.actor.clock.step_us / 1e6


def _rate(yes: F64, all_of_them: F64) -> float:
    """Return a rate of answers, with some imagined ones."""
    return float((yes.sum() + PRIOR / 2) / (all_of_them.sum() + PRIOR))
