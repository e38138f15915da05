"""The algorithm `timing`, its output, and the base of its policies."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.algorithms.algorithm import Algorithm, Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import Component, OneOf, register
from fleet2d.configuration.units import PositiveDuration
from fleet2d.errors import ComponentError
from fleet2d.floorplan.home import Home
from fleet2d.interactions.interaction import Outcome
from fleet2d.kernels import F64

HOURS = 24
OUTCOMES = frozenset(str(outcome) for outcome in Outcome)


class Asked(NamedTuple):
    """A time that a robot has addressed a person, as the robot knows it.

    Attributes:
        user: The person meant.
        name: The interaction.
        hour: Hour of the day, 0 to 23.
        room: Index of the room that the robot was in; -1: none.
        was_accepted: Whether the answer was yes.
    """

    user: str
    name: str
    hour: int
    room: int
    was_accepted: bool


class TimingPolicy(Component):
    """Base of policies: with which probability to address a person at an hour in a room.

    Each has its own copy for each person and interaction.

    Example:
        >>> class Never(TimingPolicy):
        ...     '''Never addresses anybody.'''
        ...     def chances(self):
        ...         return np.zeros((24, self.rooms))
    """

    kind: ClassVar[str] = "timing_policy"

    def start(self, rooms: int) -> None:
        """Begin without experience in a home with a number of rooms."""
        self.rooms = rooms

    def learn(self, asked: Asked) -> None:
        """Learn from an answer."""

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
        each, count = HOURS * len(rooms), len(pairs)
        return {
            "user": np.repeat(np.array([user for user, _ in pairs], object), each),
            "interaction": np.repeat(np.array([name for _, name in pairs], object), each),
            "hour": np.tile(np.repeat(np.arange(HOURS), len(rooms)), count),
            "room": np.tile(np.array(rooms, object), HOURS * count),
            "chance": np.concatenate([self.by_pair[pair].ravel() for pair in pairs]),
        }


@register("algorithm", "timing")
class TimingAlgorithm(Algorithm):
    """Learn from answers when and where a person welcomes an interaction.

    The behavior `interact` with `timing: NAME` addresses people with the probabilities of its
    output. It reads evidence only: where the robot was when it asked, and what was answered.

    Attributes:
        policy: What it learns, and how it explores.
    """

    policy: Annotated["TimingPolicy", OneOf("timing_policy")]
    period: PositiveDuration = timedelta(hours=1)

    def start(self, home: Home) -> None:
        """Begin without experience."""
        self.policies: dict[tuple[str, str], TimingPolicy] = {}
        self.open: dict[str, Asked] = {}  # by robot: the last question without an answer

    def remember(self) -> Mapping[str, Any]:
        """Refuse: what it has learned belongs to a home and its people."""
        return {}

    def recall(self, learned: Mapping[str, Any]) -> None:
        """Refuse a state of another run.

        Raises:
            ComponentError: Always.
        """
        raise ComponentError("timing can't start from a learned state")

    def update(self, history: History, state: Present) -> Any:
        """Learn from the questions and answers; return the chances."""
        before = sum(1 for _ in self.policies)
        learned = 0
        for event in history.events:
            if event.event == "asks":
                self._close(event.entity, was_accepted=False)
                name, _, user = event.detail.rpartition(" ")
                pose = history.poses(event.entity)
                at = pose.xy[event.step - history.first]
                room = state.home.plan.room_at(float(at[0]), float(at[1]))
                hour = (state.start + event.step * timedelta(seconds=history.step_s)).hour
                index = -1 if room is None else room.index
                self.open[event.entity] = Asked(user, name, hour, index, False)
                self._policy(user, name, len(state.home.rooms))
            elif event.event in OUTCOMES or event.event == "withdraws":
                learned += self._close(event.entity, was_accepted=event.event == Outcome.ACCEPTED)
        if not learned and len(self.policies) == before:
            return None
        return TimingChances({pair: policy.chances() for pair, policy in self.policies.items()})

    def _policy(self, user: str, name: str, rooms: int) -> TimingPolicy:
        if (user, name) not in self.policies:
            policy = self.policies[user, name] = self.policy.model_copy(deep=True)
            policy.start(rooms)
        return self.policies[user, name]

    def _close(self, robot: str, *, was_accepted: bool) -> bool:
        """Learn from the answer to the last question of a robot; return whether there was one."""
        asked = self.open.pop(robot, None)
        if asked is None:
            return False
        policy = self.policies[asked.user, asked.name]
        policy.learn(asked._replace(was_accepted=was_accepted))
        return True
