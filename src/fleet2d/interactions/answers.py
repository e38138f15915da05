"""How people answer a robot: stages, each a logit of named parts.

A person *notices* the robot, is *available*, and *accepts*; each is a draw with the probability
logistic(sum of parts), addressed by person, interaction and step. After Choi et al. (2019), Cha et
al. (2020) and the structure of Oralytics' simulation environment; docs/how-to/interactions.md has
the source and the range of each number.
"""

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import BeforeValidator, Field, model_validator

from fleet2d.configuration.components import Component, OneOf
from fleet2d.configuration.units import Duration, PositiveDuration, Share
from fleet2d.interactions.attitude import Attitude, AttitudeState
from fleet2d.interactions.interaction import Interaction, Outcome
from fleet2d.runtime.determinism import Draws, logistic, stream_key, sum_in_order

Stage = Literal["notice", "available", "accept"]

ASLEEP = frozenset({"sleep", "nap"})
PRIVATE_ROOMS = frozenset({"bedroom", "bathroom", "guest_room", "child_room", "toilet"})


class Circumstances(NamedTuple):
    """The truth at the moment at which a robot addresses a person.

    Attributes:
        time: The local time.
        name: The interaction's name in the scenario.
        interaction: The interaction.
        activity: The person's activity; empty if unknown.
        room: Type of the room that the person is in; empty outside of rooms.
        company: Number of other people in that room.
        is_moving: Whether the person is going somewhere.
        is_lying: Whether the person lies.
        distance: Distance of the robot [m].
        in_sight: Whether no wall is between them.
        from_behind: Whether the robot is outside of the front 200° of the person.
    """

    time: datetime
    name: str
    interaction: Interaction
    activity: str
    room: str
    company: int
    is_moving: bool
    is_lying: bool
    distance: float
    in_sight: bool
    from_behind: bool


class AnswerPart(Component):
    """Base of the parts of a person's answers: each adds to the logit of one stage.

    Example:
        >>> class NeverOnMonday(AnswerPart):
        ...     '''Refuses everything on Mondays.'''
        ...     def logit(self, now, state):
        ...         return -9.0 if now.time.weekday() == 0 else 0.0
    """

    kind = "answer_part"
    stage: ClassVar[Stage] = "accept"

    def logit(self, now: Circumstances, state: AttitudeState) -> float:
        """Return the term added to the logit of the stage."""
        raise NotImplementedError


# Beyond this distance, a robot is noticed less.
NOTICED_WITHIN_M = 2.0


class NoticePart(AnswerPart):
    """Whether the robot is heard or seen.

    Attributes:
        base: Logit for a person awake and near, in sight.
        asleep: Added for a sleeper: noticing wakes.
        out_of_sight: Added without line of sight.
        reading: Added for what is only shown, to a person who looks elsewhere.
        per_metre: Added for each metre beyond the second.
    """

    stage = "notice"

    base: float = 3.0
    asleep: float = -4.0
    out_of_sight: float = -2.0
    reading: float = -4.0
    per_metre: float = -1.0

    def logit(self, now: Circumstances, state: AttitudeState) -> float:
        """Sum the terms that make it hard to notice."""
        total = self.base + self.per_metre * max(0.0, now.distance - NOTICED_WITHIN_M)
        if now.activity in ASLEEP:
            total += self.asleep
        if not now.in_sight:
            total += self.out_of_sight
        if now.interaction.manner == "shown" and (now.from_behind or not now.in_sight):
            total += self.reading
        return total


# Activities reduce availability by these logits; negative ones raise it. The values are our own;
# see the docs.
LOADS: Mapping[str, float] = {
    "sleep": 9.0,
    "nap": 6.0,
    "shower": 4.0,
    "phone_call": 3.0,
    "phone": 2.0,
    "toilet": 2.5,
    "wash": 2.0,
    "work_at_home": 1.5,
    "study": 1.5,
    "homework": 1.5,
    "exercise": 1.5,
    "party": 1.5,
    "care": 1.2,
    "cook": 1.0,
    "paperwork": 1.0,
    "computer": 0.8,
    "dress": 0.8,
    "talk": 0.8,
    "dinner": 0.5,
    "supper": 0.5,
    "read": 0.5,
    "games": 0.5,
    "tv": 0.3,
    "lunch": 0.2,
    "rest": -0.3,
    "snack": -0.4,
    "breakfast": -0.5,
}


class ActivityPart(AnswerPart):
    """The load of the activity: asleep never, on the phone hardly, at breakfast well.

    Attributes:
        base: Logit of a person without an activity.
        loads: Logit that each activity takes off; these take precedence over the built-in ones.
    """

    stage = "available"

    base: float = 1.2
    loads: dict[str, float] = Field(default={})

    def logit(self, now: Circumstances, state: AttitudeState) -> float:
        """Subtract the load of the activity."""
        return self.base - self.loads.get(now.activity, LOADS.get(now.activity, 0.0))


class CompanyPart(AnswerPart):
    """Other people in the room.

    Attributes:
        each: Added for each of them, up to three.
    """

    stage = "available"

    each: float = -0.5

    def logit(self, now: Circumstances, state: AttitudeState) -> float:
        """Return the weight of the people who are present."""
        return self.each * min(now.company, 3)


class MovementPart(AnswerPart):
    """Whether the person is going somewhere.

    Attributes:
        going: Added for a person who is.
    """

    stage = "available"

    going: float = -1.5

    def logit(self, now: Circumstances, state: AttitudeState) -> float:
        """Add the weight of going somewhere."""
        return self.going if now.is_moving else 0.0


# The logit of accepting each kind, before any other part. The values are our own; see the docs.
KIND_LOGITS: Mapping[str, float] = {
    "remind": 0.6,
    "offer": -0.4,
    "ask": 0.4,
    "greet": 0.8,
    "deliver": 1.0,
    "patrol_report": -0.6,
}


# An interaction of this value adds half of what the highest value would.
HALF_WORTH = 2.0


def urgency(interaction: Interaction) -> float:
    """Return how much less burden and annoyance count for an interaction of its value, 0 to 1.

    >>> [urgency(Interaction(do="remind", to="ana", every="1 d", worth=w)) for w in (0, 2, 6)]
    [0.0, 0.5, 0.9]
    """
    return interaction.worth**2 / (interaction.worth**2 + HALF_WORTH**2)


class ImportancePart(AnswerPart):
    """The kind of an interaction, and its value to the person.

    Attributes:
        kinds: Logit of each kind; these take precedence over the built-in ones.
        worth: Added for a very high value; half of it for a value of 2.
    """

    kinds: dict[str, float] = Field(default={})
    worth: float = 1.5

    def logit(self, now: Circumstances, state: AttitudeState) -> float:
        """Add the terms of kind and value."""
        do = now.interaction.do
        worth = now.interaction.worth
        kind = self.kinds.get(do, KIND_LOGITS[do])
        return kind + self.worth * worth / (worth + HALF_WORTH)


# Between these distances a robot that addresses somebody is neither too near nor too far.
NEAREST_M = 0.45
FARTHEST_M = 2.5


class MannerPart(AnswerPart):
    """The robot's manner of coming: too near, from far away, from behind, in the way.

    Attributes:
        off: Added if it is nearer than 0.45 m or farther than 2.5 m.
        behind: Added if it comes from behind.
        in_the_way: Added if it stands within a metre of a person who is going somewhere.
    """

    off: float = -0.6
    behind: float = -0.5
    in_the_way: float = -0.8

    def logit(self, now: Circumstances, state: AttitudeState) -> float:
        """Add the terms of the robot's manner: from behind, too near or far, in the way."""
        total = self.behind if now.from_behind else 0.0
        if not NEAREST_M <= now.distance <= FARTHEST_M:
            total += self.off
        if now.is_moving and now.distance < 1:
            total += self.in_the_way
        return total


class RecencyPart(AnswerPart):
    """The time since the robot addressed the person last.

    Attributes:
        at_once: Added right afterwards, fading evenly within an hour.
    """

    at_once: float = -1.5

    def logit(self, now: Circumstances, state: AttitudeState) -> float:
        """Add the term of the last prompt, faded by now."""
        if state.last is None:
            return 0.0
        return self.at_once * max(0.0, 1 - (now.time - state.last) / timedelta(hours=1))


class BurdenPart(AnswerPart):
    """Too many recent prompts.

    Attributes:
        tolerance: Prompts a day that are no burden.
        each: Added for each further prompt a day.
    """

    tolerance: float = Field(default=4.0, ge=0)
    each: float = -0.35

    def logit(self, now: Circumstances, state: AttitudeState) -> float:
        """Add the burden beyond what is tolerated, less for what is urgent."""
        burden = max(0.0, state.burden - self.tolerance)
        return self.each * burden * (1 - urgency(now.interaction))


class AttitudePart(AnswerPart):
    """The person's attitude after months with the robot: novelty, habit, trust and annoyance.

    Attributes:
        novelty: Added while the robot is new.
        habit: Added if the interaction is expected at this time of day, within half an hour.
        trust: Added at full trust; as much is taken off without any.
        annoyance: Added for each unit of annoyance, less for what is urgent.
    """

    novelty: float = 0.7
    habit: float = 0.8
    trust: float = 0.8
    annoyance: float = -0.4

    def logit(self, now: Circumstances, state: AttitudeState) -> float:
        """Sum the terms of the attitude."""
        return (
            self.novelty * state.novelty
            + self.habit * state.expects(now.name, now.time, timedelta(minutes=30))
            + self.trust * (2 * state.trust - 1)
            + self.annoyance * state.annoyance * (1 - urgency(now.interaction))
        )


class Reply(NamedTuple):
    """The answer of a person.

    Attributes:
        outcome: The outcome that the robot sees.
        delay: Time from the question to the answer.
        later: For DEFERRED: time after which the person wants to be asked again.
        willingness: The probability that the person was available: truth.
        woke: Whether the robot woke a sleeper: truth.
    """

    outcome: Outcome
    delay: timedelta
    later: timedelta = timedelta(0)
    willingness: float = 0.0
    woke: bool = False


class Wanted(NamedTuple):
    """A request that came up: its step, the robot, and the interaction and the person."""

    step: int
    robot: str
    text: str
    interaction: Interaction


class AnswerRecord(NamedTuple):
    """The result of addressing a person: truth, for metrics.

    Attributes:
        step: The step of the question.
        robot: The robot.
        text: The interaction and the person meant.
        addressed: The person addressed, maybe another one than meant; empty: nobody was near.
        activity: The activity of that person.
        outcome: The answer; empty if the robot wasn't noticed.
        delay_s: Time from the question to the answer [s].
        value: Value of the request at the question; 0 if it was no longer open.
        woke: Whether the robot woke the person.
        willingness: Probability that the person was available.
        novelty, burden, annoyance, trust: The person's attitude afterwards.
    """

    step: int
    robot: str
    text: str
    addressed: str
    activity: str
    outcome: str
    delay_s: float
    value: float
    woke: bool
    willingness: float
    novelty: float
    burden: float
    annoyance: float
    trust: float


class Start(NamedTuple):
    """A moment at which a person may turn to a robot.

    Attributes:
        day_share: The time, as a part of the day.
        kind: The wish of the person: that the robot comes (call), an answer (question), or to be
            left alone (complaint).
    """

    day_share: float
    kind: str


class Initiative(Component):
    """Contacts that people start by themselves, at random times: mean numbers a day.

    Nothing comes of the moments at which the person is out, sleeps, or is too far away.

    Attributes:
        calls: Calls of the robot, from anywhere in the home.
        questions: Questions to a robot within 8 m.
        complaints: Thoughts about a robot in the same room: a person who is annoyed enough sends it
            away, bans it or switches it off.
    """

    kind = "initiative"

    calls: float = Field(default=0.0, ge=0, le=1000)
    questions: float = Field(default=0.0, ge=0, le=1000)
    complaints: float = Field(default=0.0, ge=0, le=1000)

    def starts(self, draws: Draws) -> list[Start]:
        """Return the moments of one day, from its random draws."""
        rates = {"call": self.calls, "question": self.questions, "complaint": self.complaints}
        starts = []
        for kind, rate in rates.items():
            count = int(rate) + (draws.uniform() < rate - int(rate))
            starts += [Start(draws.uniform(), kind) for _ in range(count)]
        return sorted(starts)


# An answer takes a time between these.
ANSWER_TAKES = (timedelta(seconds=2), timedelta(seconds=8))
# A robot is banned and switched off at these annoyances beyond that of sending it away.
BAN_AFTER = 2.0
OFF_AFTER = 5.0

PARTS = (
    "notice", "activity", "company", "movement", "importance", "manner", "recency", "burden",
    "attitude",
)  # fmt: skip
"""The parts of a person's answers, which are types of `answer_part`, too."""


class Answers(Component):
    """The model of a person's answers to robots; your own class may replace each part.

    Attributes:
        notice: Whether the robot is noticed.
        activity: The effect of the activity on availability.
        company: The effect of other people in the room on availability.
        movement: The effect of being on the way on availability.
        importance: The effect of the kind and value of an interaction on accepting.
        manner: The effect of the robot's manner of coming on accepting.
        recency: The effect of a recent interaction on accepting.
        burden: The effect of many prompts on accepting.
        attitude: The effect of novelty, habit, trust and annoyance on accepting.
        months: The change of the attitude over time.
        initiative: Contacts that the person starts without being addressed.
        defers: Probability that a person who isn't available asks to be addressed later.
        later: Least and greatest time after which the robot may come again.
        sends_away_at: Annoyance from which on the robot is sent away from the room; two more, and
            it is banned from a bedroom or bathroom; five more, and it is switched off. What is
            urgent annoys less.
        gives_up_below: Trust below which a person who would do any of this switches the robot off
            for good; 0: never.
        away_for: Time for which the robot is sent away.
        bans_for: Time for which the robot is banned.
        off_for: Time for which the robot is switched off.
    """

    kind = "answers"

    notice: OneOf[AnswerPart] = NoticePart()
    activity: OneOf[AnswerPart] = ActivityPart()
    company: OneOf[AnswerPart] = CompanyPart()
    movement: OneOf[AnswerPart] = MovementPart()
    importance: OneOf[AnswerPart] = ImportancePart()
    manner: OneOf[AnswerPart] = MannerPart()
    recency: OneOf[AnswerPart] = RecencyPart()
    burden: OneOf[AnswerPart] = BurdenPart()
    attitude: OneOf[AnswerPart] = AttitudePart()
    months: OneOf[Attitude] = Attitude()
    initiative: OneOf[Initiative] = Initiative()
    defers: Share = 0.3
    later: tuple[Duration, Duration] = (timedelta(minutes=15), timedelta(hours=1))
    sends_away_at: float = 3.0
    gives_up_below: Share = 0.1
    away_for: PositiveDuration = timedelta(minutes=30)
    bans_for: PositiveDuration = timedelta(days=7)
    off_for: PositiveDuration = timedelta(hours=24)

    @model_validator(mode="before")
    @classmethod
    def _types_by_name(cls, data: Any) -> Any:
        """Give a part without a type the type of its name."""
        if not isinstance(data, Mapping):
            return data
        typed = dict(data)
        types = {name: name for name in PARTS} | {"months": "fading", "initiative": "rates"}
        for name, kind in types.items():
            if isinstance(data.get(name), Mapping):
                typed[name] = {"type": kind, **data[name]}
        return typed

    def chance(self, stage: Stage, now: Circumstances, state: AttitudeState) -> float:
        """Return the probability of a stage."""
        parts = (getattr(self, name) for name in PARTS)
        terms = (part.logit(now, state) for part in parts if part.stage == stage)
        return logistic(sum_in_order(terms))

    def reply(
        self, now: Circumstances, state: AttitudeState, seed: int, path: str, step: int
    ) -> Reply | None:
        """Draw the answer; None: the person doesn't notice the robot.

        Args:
            now: The circumstances.
            state: The attitude of the person at that time.
            seed: The seed of the run.
            path: The person's path in the scenario.
            step: The step.
        """
        draws = Draws(stream_key(seed, path, f"answer {now.name}"), step)
        notices, available, accepts, defers, late, slow = (draws.uniform() for _ in range(6))
        if notices >= self.chance("notice", now, state):
            return None
        willingness = self.chance("available", now, state)
        delay = _interpolated(ANSWER_TAKES, slow)
        woke = now.activity in ASLEEP
        if available < willingness and accepts < self.chance("accept", now, state):
            return Reply(Outcome.ACCEPTED, delay, willingness=willingness)
        if (outcome := self.complaint(state, now.room, urgency(now.interaction))) is None:
            mild = Outcome.DEFERRED if defers < self.defers and not woke else Outcome.IGNORED
            outcome = Outcome.DECLINED if available < willingness else mild
        later = _interpolated(self.later, late)
        return Reply(outcome, delay, later, willingness, woke)

    def complaint(self, state: AttitudeState, room: str, urgent: float = 0.0) -> Outcome | None:
        """Return the way in which a person who is annoyed enough gets rid of a robot.

        Args:
            state: The person's attitude.
            room: The type of the room.
            urgent: The urgency of the robot's request.
        """
        annoyance = state.annoyance * (1 - urgent)
        if annoyance < self.sends_away_at:
            return None
        if annoyance >= self.sends_away_at + OFF_AFTER or self.has_enough(state):
            return Outcome.SWITCHED_OFF
        is_private = room in PRIVATE_ROOMS
        is_banned = is_private and annoyance >= self.sends_away_at + BAN_AFTER
        return Outcome.BANNED if is_banned else Outcome.SENT_AWAY

    def has_enough(self, state: AttitudeState) -> bool:
        """Return whether a person who switches the robot off does so for good."""
        return state.trust < self.gives_up_below


def _interpolated(limits: tuple[timedelta, timedelta], share: float) -> timedelta:
    """Return a duration between two, interpolated by a share, in whole seconds."""
    low, high = limits
    return timedelta(seconds=round((low + (high - low) * share).total_seconds()))


def _with_type(value: Any) -> Any:
    is_untyped = isinstance(value, Mapping) and "type" not in value
    return {"type": "stages", **value} if is_untyped else value


AnswersField = Annotated[OneOf[Answers], BeforeValidator(_with_type)]
"""A field for how somebody answers; without a type: stages."""
