"""When to address whom: the algorithm `timing`, its output, and its policies."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fleet2d.algorithms.algorithm import Algorithm, Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import Component, OneOf
from fleet2d.configuration.units import PositiveDuration, Share
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home import Home
from fleet2d.interactions.interaction import OUTCOMES, Outcome
from fleet2d.kernels import F64
from fleet2d.runtime.determinism import logistic
from fleet2d.runtime.events import EventKind

HOURS = 24


class Asked(NamedTuple):
    """A time that a robot has addressed a person, as the robot knows it.

    Attributes:
        user: The person meant.
        name: The interaction.
        hour: Hour of the day, 0 to 23.
        room: Index of the room that the robot was in; -1: none.
        outcome: The answer, an `Outcome`; empty: none.
    """

    user: str
    name: str
    hour: int
    room: int
    outcome: str = ""

    @property
    def was_accepted(self) -> bool:
        """Whether the answer was yes."""
        return self.outcome == Outcome.ACCEPTED

    @property
    def was_available(self) -> bool:
        """Whether the person had time for an answer, yes or no."""
        return self.outcome in (Outcome.ACCEPTED, Outcome.DECLINED)


class TimingPolicy(Component):
    """Base of policies: with which probability to address a person at an hour in a room.

    Each has its own copy for each person and interaction, and knows in `self.worth` the value of
    the interaction.

    Example:
        >>> class Never(TimingPolicy):
        ...     '''Never addresses anybody.'''
        ...     def chances(self):
        ...         return np.zeros((24, self.rooms))
    """

    kind = "timing_policy"

    def start(self, rooms: int) -> None:
        """Begin without experience in a home with a number of rooms."""
        self.rooms = rooms
        self.worth = 1.0

    def learn(self, asked: Asked) -> None:
        """Learn from an answer."""

    def learn_from_other(self, asked: Asked) -> None:
        """Learn from the answer to another interaction with the same person; by default nothing."""

    def chances(self) -> F64:
        """Return the probability of addressing the person now, by hour and room: (24, rooms)."""
        raise NotImplementedError


class TimingChances:
    """When to address whom: the output of `timing`.

    Attributes:
        by_pair: Probability by person and interaction: float64 (24, rooms).
    """

    def __init__(self, by_pair: Mapping[tuple[str, str], F64]) -> None:
        self.by_pair = dict(by_pair)

    def chance(self, user: str, name: str, time: datetime, room: int | None) -> float:
        """Return the probability with which to address a person now; 1 without experience."""
        chances = self.by_pair.get((user, name))
        if chances is None:
            return 1.0
        row = chances[time.hour]
        return float(row.max() if room is None or room < 0 else row[room])

    def to_columns(self, rooms: Sequence[str]) -> dict[str, NDArray[Any]]:
        """Return columns user, interaction, hour, room and chance, a row for each combination."""
        pairs = sorted(self.by_pair)
        each = HOURS * len(rooms)
        count = len(pairs)
        return {
            "user": np.repeat(np.array([user for user, _ in pairs], object), each),
            "interaction": np.repeat(np.array([name for _, name in pairs], object), each),
            "hour": np.tile(np.repeat(np.arange(HOURS), len(rooms)), count),
            "room": np.tile(np.array(rooms, object), HOURS * count),
            "chance": np.concatenate([self.by_pair[pair].ravel() for pair in pairs]),
        }


class TimingAlgorithm(Algorithm):
    """Learn from answers when and where a person welcomes an interaction.

    The behavior `interact` with `timing: NAME` addresses people with the probabilities of its
    output. It reads evidence only: where the robot was when it asked, and what was answered.

    Attributes:
        policy: What it learns, and how it explores.
    """

    policy: OneOf[TimingPolicy]
    period: PositiveDuration = timedelta(hours=1)

    def start(self, home: Home) -> None:
        """Begin without experience."""
        self.policies: dict[tuple[str, str], TimingPolicy] = {}
        self.open: dict[str, Asked] = {}  # by robot: the last question without an answer
        self.worth: dict[str, float] = {}  # of each interaction

    def remember(self) -> Mapping[str, Any]:
        """Return nothing: its learned state belongs to a home and its people."""
        return {}

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Refuse the learned state of another run.

        Raises:
            ComponentError: Always.
        """
        raise ComponentError("timing can't start from a learned state")

    def update(self, history: History, state: Present) -> Any:
        """Learn from the questions and answers; return the chances."""
        before = len(self.policies)
        learned = 0
        self.worth |= {w.text.rpartition(" ")[0]: w.interaction.worth for w in history.wanted}
        for event in history.events:
            if event.event == EventKind.ASKS:
                self._close(event.entity, "")
                name, _, user = event.detail.rpartition(" ")
                at = history.poses(event.entity).at(event.step - history.first)
                room = state.home.plan.room_at(*at)
                hour = (state.start + event.step * timedelta(seconds=history.step_s)).hour
                index = -1 if room is None else room.index
                self.open[event.entity] = Asked(user, name, hour, index)
                self._policy(user, name, len(state.home.rooms))
            elif event.event in OUTCOMES or event.event == EventKind.WITHDRAWS:
                outcome = event.event if event.event in OUTCOMES else ""
                learned += self._close(event.entity, outcome)
        if not learned and len(self.policies) == before:
            return None
        return TimingChances({pair: policy.chances() for pair, policy in self.policies.items()})

    def _policy(self, user: str, name: str, rooms: int) -> TimingPolicy:
        if (user, name) not in self.policies:
            policy = self.policies[user, name] = self.policy.model_copy(deep=True)
            policy.start(rooms)
            policy.worth = self.worth.get(name, 1.0)
        return self.policies[user, name]

    def _close(self, robot: str, outcome: str) -> bool:
        """Learn from the answer to the last question of a robot; return whether there was one."""
        asked = self.open.pop(robot, None)
        if asked is None:
            return False
        asked = asked._replace(outcome=outcome)
        for (user, name), policy in self.policies.items():
            if user == asked.user:
                (policy.learn if name == asked.name else policy.learn_from_other)(asked)
        return True


def _count(asked: Asked, counts: F64, weight: float = 1.0) -> None:
    """Count an answer in its cell of (24, rooms), and less of it near by."""
    for hour, near in ((-2, 0.25), (-1, 0.5), (0, 1.0), (1, 0.5), (2, 0.25)):
        row = counts[(asked.hour + hour) % HOURS]
        row += 0.3 * near * weight
        if asked.room >= 0:
            row[asked.room] += 0.7 * near * weight


def _logistic(values: F64) -> F64:
    """Return the logistic function of each value, with the same bits on every machine."""
    return np.array([logistic(value) for value in values.ravel().tolist()]).reshape(values.shape)


class FixedTimes(TimingPolicy):
    """Address people in some hours, in any room.

    Attributes:
        hours: The hours of the day, 0 to 23; left out: all.
    """

    hours: tuple[Annotated[int, Field(ge=0, lt=HOURS)], ...] = tuple(range(HOURS))

    def chances(self) -> F64:
        """Return 1 in these hours, else 0."""
        chances = np.zeros((HOURS, self.rooms))
        chances[list(self.hours)] = 1
        return chances


class LogisticTiming(TimingPolicy):
    """Ask where the probability of a yes, by logistic regression, is high enough.

    Without exploration it is greedy: an hour with an unlucky first answer is never tried again, so
    that it never learns better.

    Attributes:
        ask_at: Minimum probability of a yes at which it asks.
        explore: Probability of asking nevertheless.
        rate: Learning rate of the gradient steps.
    """

    ask_at: Share = 0.5
    explore: Share = 0.0
    rate: float = Field(default=0.5, gt=0, le=10)

    def start(self, rooms: int) -> None:
        """Begin with even odds, slightly in favor."""
        super().start(rooms)
        self.base = 0.5
        self.by_hour = np.zeros(HOURS)
        self.by_room = np.zeros(rooms)

    def learn(self, asked: Asked) -> None:
        """Make a step along the gradient of the log likelihood; neighboring hours share half."""
        by_room = self.by_room[asked.room] if asked.room >= 0 else 0.0
        chance = logistic(float(self.base + self.by_hour[asked.hour] + by_room))
        step = self.rate * (asked.was_accepted - chance)
        self.base += step / 4
        for hour, part in ((-1, 0.5), (0, 1.0), (1, 0.5)):
            self.by_hour[(asked.hour + hour) % HOURS] += part * step
        if asked.room >= 0:
            self.by_room[asked.room] += step

    def chances(self) -> F64:
        """Return 1 where a yes is likely, else the probability of exploring."""
        chance = _logistic(self.base + self.by_hour[:, np.newaxis] + self.by_room)
        return np.where(chance >= self.ask_at, 1.0, self.explore)


class ThompsonTiming(TimingPolicy):
    """Ask with the probability that a yes is likelier than usual, given the answers so far.

    A contextual bandit with probability matching (Thompson 1933): where little is known, that
    probability is near a half, so that it explores; it stops where the answers are clear. The
    rate of yes in a cell of hours and rooms is a beta variable, whose distribution is approximated
    by a logistic one; each answer counts in neighboring hours, and in other rooms, by a part.
    Answers to other interactions with the person count by whether there was time for an answer.

    Attributes:
        ask_at: Minimum probability of a yes that is worth asking; null: the share of yeses so
            far, so that it asks at the better times of the day. People accept about a third.
        min_chance: Minimum probability of asking anywhere: off-policy estimates need one above 0.
        prior: Number of imagined answers, at even odds.
        others: How much an answer to another interaction counts.
    """

    ask_at: Share | None = 0.35
    min_chance: Share = 0.02
    prior: float = Field(default=2.0, gt=0)
    others: Share = 1.0

    def start(self, rooms: int) -> None:
        """Begin with imagined answers only."""
        super().start(rooms)
        self.answers = [0.6 * self.prior, self.prior]  # yeses, and all
        self.yes = np.full((HOURS, rooms), self.prior * 0.6)
        self.no = np.full((HOURS, rooms), self.prior * 0.4)

    def learn(self, asked: Asked) -> None:
        """Count an answer, and less of it near by."""
        self.answers[0] += asked.was_accepted
        self.answers[1] += 1
        _count(asked, self.yes if asked.was_accepted else self.no)

    def learn_from_other(self, asked: Asked) -> None:
        """Count whether the person had time, by a part."""
        _count(asked, self.yes if asked.was_available else self.no, self.others)

    def chances(self) -> F64:
        """Return the probability that the rate of yes is above `ask_at`."""
        ask_at = self.answers[0] / self.answers[1] if self.ask_at is None else self.ask_at
        total = self.yes + self.no
        spread = np.sqrt(self.yes * self.no / (total * total * (total + 1)))
        above = _logistic(1.7 * (self.yes / total - ask_at) / spread)
        return above.clip(self.min_chance, 1.0)


class TwoStageTiming(TimingPolicy):
    """Ask with the probability that a question is worth more than it costs, by Thompson's rule.

    As people answer in stages, the rate of yes is a product of two: of having time, by hour and
    room, learned from the answers to all interactions with the person; and of saying yes with time,
    at any hour, learned from those to this one. Both are beta variables; the distribution of the
    product is approximated by a logistic one with its mean and variance. A question costs `price`:
    by annoying, it takes as much from the value of others. So what is worth little is asked only
    where a yes is nearly sure.

    Attributes:
        price: What a question costs, in the unit of `worth`.
        min_chance: Minimum probability of asking anywhere: off-policy estimates need one above 0.
        prior: Number of imagined answers in each rate, three in five of them favorable.
    """

    price: float = Field(default=1.0, ge=0)
    min_chance: Share = 0.02
    prior: float = Field(default=2.0, gt=0)

    def start(self, rooms: int) -> None:
        """Begin with imagined answers only."""
        super().start(rooms)
        yes = 0.6 * self.prior
        no = 0.4 * self.prior
        self.has_time = np.full((HOURS, rooms), yes)
        self.has_none = np.full((HOURS, rooms), no)
        self.agrees = yes
        self.declines = no

    def learn(self, asked: Asked) -> None:
        """Count whether the person had time, and whether she agreed."""
        self.learn_from_other(asked)
        self.agrees += asked.was_accepted
        self.declines += asked.was_available and not asked.was_accepted

    def learn_from_other(self, asked: Asked) -> None:
        """Count whether the person had time."""
        _count(asked, self.has_time if asked.was_available else self.has_none)

    def chances(self) -> F64:
        """Return the probability that a question is worth more than its price."""
        if not self.worth:
            return np.full((HOURS, self.rooms), self.min_chance)
        total = self.has_time + self.has_none
        answers = self.agrees + self.declines
        time = self.has_time / total
        yes = self.agrees / answers
        time_variance = time * (1 - time) / (total + 1)
        yes_variance = yes * (1 - yes) / (answers + 1)
        variance = time**2 * yes_variance + (yes**2 + yes_variance) * time_variance
        gain = (self.worth * time * yes - self.price) / (self.worth * np.sqrt(variance))
        return _logistic(1.7 * gain).clip(self.min_chance, 1.0)
