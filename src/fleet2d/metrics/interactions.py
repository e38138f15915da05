"""Metrics of requests: what came of them, and what they would have been worth at the best time."""

import copy
from bisect import bisect_right
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.units import PositiveDuration
from fleet2d.floorplan.home import Home
from fleet2d.interactions.answers import ASLEEP, AnswerRecord, Answers, Circumstances, Wanted
from fleet2d.interactions.attitude import AttitudeState
from fleet2d.interactions.interaction import Outcome
from fleet2d.metrics.metric import Metric, columns_of, nested
from fleet2d.runtime.determinism import sum_in_order
from fleet2d.runtime.events import Event, EventKind

# What happens between a person and a robot without a request.
TOLD = frozenset(
    {
        EventKind.CALLED, EventKind.QUESTION, EventKind.REPLIES, EventKind.SENT_AWAY,
        EventKind.BANNED, EventKind.SWITCHED_OFF, EventKind.GIVEN_UP, EventKind.BROKEN_OFF,
    }
)  # fmt: skip
# A person who answers says one of these, rather than nothing or that the robot has to go.
ANSWERS = (Outcome.ACCEPTED, Outcome.DECLINED, Outcome.DEFERRED, Outcome.MISTAKEN)


class Interactions(Metric):
    """What came of what robots wanted of people: value, answers, interruptions, annoyance.

    For each robot and person:

    - `wanted`: requests that came up; `asked`: times that the person was addressed for them;
    - `answered`, `accepted`: shares of `asked`, of which being sent away is no answer; `kept`:
      share of `wanted` accepted in time;
    - `value`: value of what was accepted, without what the robot broke off as it went off;
      `missed`: the worth of all requests minus that;
    - `wait_s`: mean time to an answer; `woke`: times that it woke the person;
    - `interrupted`: how often each of the person's activities was interrupted at a bad time: the
      probability of being available was below a half;
    - `called`, `question`, `replies`, `sent_away`, `banned`, `switched_off`, `given_up`,
      `broken_off`: how often each of them happened, whoever began;
    - `annoyance`, `trust`: at the end, and `mean_annoyance`, over the times of being addressed.

    Its table has a row for each time that a person was addressed, with the truth of it.
    """

    hidden = frozenset({"interrupted", "wait_s", "trust", "asked"})
    units = {
        "wanted": "requests",
        "kept": "share of requests",
        **dict.fromkeys(("answered", "accepted"), "share of times asked"),
        **dict.fromkeys(("value", "missed"), "worth"),
        **dict.fromkeys(("annoyance", "mean_annoyance"), "accumulated, 0 is none"),
        "trust": "of 1",
        "woke": "times",
    }
    least = {"": 0}
    better = {
        **dict.fromkeys(("answered", "accepted", "kept", "value", "trust"), "higher"),
        **dict.fromkeys(("missed", "wait_s", "woke", "annoyance", "mean_annoyance"), "lower"),
    }

    def start(self, home: Home) -> None:
        """Begin without any interaction."""
        self.wanted: Counter[tuple[str, str]] = Counter()
        self.worth: Counter[tuple[str, str]] = Counter()
        self.records: dict[tuple[str, str], list[AnswerRecord]] = {}
        self.told: dict[tuple[str, str], Counter[str]] = {}
        self.activities: dict[str, Counter[str]] = {}  # how often each user began each of them

    def update(self, history: History, state: Present) -> Any:
        """Take in what happened; return a row for each time that a person was addressed."""
        for wanted in history.wanted:
            key = wanted.robot, _person(wanted.text)
            self.wanted[key] += 1
            self.worth[key] += wanted.interaction.worth  # type: ignore[assignment]
        for event in history.events:
            if event.event == EventKind.ACTIVITY:
                self.activities.setdefault(event.entity, Counter())[event.detail] += 1
            if event.event in TOLD:
                people = (word for word in reversed(event.detail.split()) if word in state.users)
                if (person := next(people, None)) is not None:
                    self.told.setdefault((event.entity, person), Counter())[event.event] += 1
        records = history.answers
        for record in records:
            key = record.robot, _person(record.text)
            self.records.setdefault(key, []).append(record)
        for event in history.events:
            if event.event == EventKind.BROKEN_OFF:
                self._break_off(event)
        columns = columns_of(AnswerRecord._fields, records)
        if columns is not None:
            columns["asked_at"] = columns.pop("step")
        return columns

    def _break_off(self, event: Event) -> None:
        """Take back the value of what was accepted last, as it was not carried out."""
        records = self.records.get((event.entity, _person(event.detail)), [])
        before = [i for i, r in enumerate(records) if r.step < event.step]
        if before and records[before[-1]].text == event.detail:
            records[before[-1]] = records[before[-1]]._replace(value=0.0)

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: {number: value}}}."""
        result: dict[str, Any] = {}
        for robot, user in sorted(self.wanted.keys() | self.told):
            count = self.wanted[robot, user]
            numbers = {}
            if count:
                records = self.records.get((robot, user), [])
                numbers = _summary(records, count, float(self.worth[robot, user]))
                interrupted = dict.fromkeys(self.activities.get(user, ()), 0) | _bad_times(records)
                numbers["interrupted"] = dict(sorted(interrupted.items()))
            told: dict[str, int] = dict.fromkeys(sorted(TOLD), 0)
            told |= self.told.get((robot, user), {})
            result.setdefault(robot, {})[user] = {"wanted": count, **numbers, **told}
        return result

    @classmethod
    def summary(cls, result: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return all but hidden numbers, and of what happens without a request what did."""
        return super().summary(_without_what_never_happened(result))


def _without_what_never_happened(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return a result without the zeros of `TOLD`, however deep they are."""
    return {
        name: _without_what_never_happened(value) if isinstance(value, Mapping) else value
        for name, value in result.items()
        if value or name not in TOLD
    }


def _person(text: str) -> str:
    return text.rpartition(" ")[2]


def _summary(records: list[AnswerRecord], wanted: int, worth: float) -> dict[str, Any]:
    """Return the numbers of one robot and one person."""
    answered = [record for record in records if record.outcome in ANSWERS]
    accepted = [record for record in records if record.outcome == Outcome.ACCEPTED]
    value = sum_in_order(record.value for record in accepted)
    numbers: dict[str, Any] = {
        "asked": len(records),
        "kept": sum(record.value > 0 for record in accepted) / wanted,
        "value": value,
        "missed": worth - value,
        "woke": sum(record.woke for record in records),
    }
    if not records:
        return numbers
    numbers |= {
        "answered": len(answered) / len(records),
        "accepted": len(accepted) / len(records),
        "annoyance": records[-1].annoyance,
        "mean_annoyance": sum_in_order(r.annoyance for r in records) / len(records),
        "trust": records[-1].trust,
    }
    if answered:
        numbers["wait_s"] = sum_in_order(r.delay_s for r in answered) / len(answered)
    return numbers


def _bad_times(records: list[AnswerRecord]) -> dict[str, int]:
    """Return how often each activity was interrupted at a bad time, if ever."""
    return Counter(r.activity or "unknown" for r in records if r.outcome and r.willingness < 0.5)


REGRET_COLUMNS = ("robot", "request", "due_at", "best_at", "best_chance", "best", "value")


@dataclass
class OpenRequest:
    """A request whose deadline has not passed.

    Attributes:
        wanted: The request.
        state: The attitude that the person would have had, if not addressed for this request.
        deadline: The last step of it.
        best: The largest expected value of asking once so far.
        best_at: When that was.
        chance: The probability of a yes then.
        value: What was accepted in time.
    """

    wanted: Wanted
    state: AttitudeState
    deadline: int
    best: float = 0.0
    best_at: int = -1
    chance: float = 0.0
    value: float = 0.0


class TimingRegret(Metric):
    """How much more value asking at the best time of the same life would have had.

    The best time of a request maximizes the probability of a yes, by the model of answers, times
    the value left. The robot is then imagined at the interaction's distance, in sight and in front
    of the person, who lives as in the run; the attitude is that of the run without the prompts for
    this request. What one request does to others isn't followed: a run under another policy tells
    that. A robot that asks again after a refusal can do better than asking once, so regret may be
    negative.

    For each robot and person, over the requests whose deadline has passed: `best`, the expected
    value of asking for each once, at its best time; `value`, that of what was accepted; `regret`,
    the difference; `best_chance`, the mean probability of a yes at the best times. Its table has a
    row for each request; `best_at` is -1 if the person was never at home in time.

    Attributes:
        every: Distance of the times compared; those at which the person was addressed are, too.
    """

    hidden = frozenset({"requests", "value"})
    better = {"value": "higher", "regret": "lower"}

    every: PositiveDuration = timedelta(minutes=5)

    def start(self, home: Home) -> None:
        """Begin without requests."""
        self.attitudes: dict[tuple[str, str], AttitudeState] = {}
        self.open: list[OpenRequest] = []
        self.closed: list[OpenRequest] = []
        self.activities: dict[str, str] = {}  # what each user did at the end of the last history

    def update(self, history: History, state: Present) -> Any:
        """Compare the times of the history; return a row for each request that is over."""
        life = _LifeOfPeriod(history, state, self.activities)
        every = max(1, round(self.every.total_seconds() / history.step_s))
        broken = (each for each in history.events if each.event == EventKind.BROKEN_OFF)
        happened: list[tuple[int, int, Wanted | AnswerRecord | Event | None]] = [
            *((event.step, 1, event) for event in broken),
            *((wanted.step, 0, wanted) for wanted in history.wanted),
            *((record.step, 1, record) for record in history.answers),
        ]
        if self.open or happened:
            begin = -(history.first // -every) * every
            happened += ((step, 2, None) for step in range(begin, history.end, every))
        closed = []
        for step, _, event in sorted(happened, key=lambda row: row[:2]):
            closed += [each for each in self.open if each.deadline < step]
            self.open = [each for each in self.open if each.deadline >= step]
            if isinstance(event, Wanted):
                self._open(event, life)
            elif isinstance(event, Event):
                for request in self.open:
                    wanted = request.wanted
                    if wanted.robot == event.entity and wanted.text == event.detail:
                        request.value = 0.0  # what was accepted wasn't carried out
            elif event is not None:
                self._take_answer(event, life)
            else:
                for request in self.open:
                    _consider(request, step, life)
        self.activities = life.last_activities
        self.closed += closed
        rows = [
            (r.wanted.robot, r.wanted.text, r.wanted.step, r.best_at, r.chance, r.best, r.value)
            for r in closed
        ]
        return columns_of(REGRET_COLUMNS, rows)

    def _attitude(self, robot: str, user: str, life: "_LifeOfPeriod", step: int) -> AttitudeState:
        """Return the attitude of a user to a robot at a step."""
        months = life.answers[user].months
        if (robot, user) not in self.attitudes:
            self.attitudes[robot, user] = months.begin(life.start)
        state = self.attitudes[robot, user]
        months.pass_time(state, life.time(step))
        return state

    def _open(self, wanted: Wanted, life: "_LifeOfPeriod") -> None:
        """Begin to compare the times for a request."""
        state = self._attitude(wanted.robot, wanted.interaction.to, life, wanted.step)
        lasts = int(wanted.interaction.within / timedelta(seconds=life.step_s))
        self.open.append(OpenRequest(wanted, copy.deepcopy(state), wanted.step + lasts))
        _consider(self.open[-1], wanted.step, life)

    def _take_answer(self, record: AnswerRecord, life: "_LifeOfPeriod") -> None:
        """Let a prompt change the attitude, except for the request that it was for."""
        user = record.addressed
        states = [self._attitude(record.robot, user, life, record.step)] if user else []
        for request in self.open:
            if request.wanted.robot != record.robot:
                continue
            if request.wanted.text == record.text:
                request.value += record.value * (record.outcome == Outcome.ACCEPTED)
                _consider(request, record.step, life)
            elif request.wanted.interaction.to == user:
                life.answers[user].months.pass_time(request.state, life.time(record.step))
                states.append(request.state)
        if record.outcome:
            name = record.text.rpartition(" ")[0]
            outcome = Outcome(record.outcome)
            for state in states:
                life.answers[user].months.addressed(state, name, outcome, record.willingness)

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: {number: value}}}."""
        by_pair: dict[tuple[str, str], list[OpenRequest]] = {}
        for request in self.closed:
            pair = request.wanted.robot, request.wanted.interaction.to
            by_pair.setdefault(pair, []).append(request)
        return nested({pair: _numbers(by_pair[pair]) for pair in sorted(by_pair)})


class _LifeOfPeriod:
    """What users do in the steps of a history."""

    def __init__(self, history: History, state: Present, activities: dict[str, str]) -> None:
        self.start = state.start
        self.step_s = history.step_s
        self.answers = history.answer_models
        self._first = history.first
        self._rooms = state.home.rooms
        self._poses = {user: history.poses(user) for user in state.users}
        self._activities = {user: ([-1], [activities.get(user, "")]) for user in state.users}
        for event in history.events:
            if event.event == EventKind.ACTIVITY and event.entity in self._activities:
                steps, names = self._activities[event.entity]
                steps.append(event.step)
                names.append(event.detail)

    @property
    def last_activities(self) -> dict[str, str]:
        """What each user does at the end."""
        return {user: names[-1] for user, (_, names) in self._activities.items()}

    def time(self, step: int) -> datetime:
        """Return the local time of a step."""
        return self.start + timedelta(seconds=step * self.step_s)

    def circumstances(self, wanted: Wanted, step: int) -> Circumstances | None:
        """Return how a well-placed robot would find the person; None: not at home."""
        user = wanted.interaction.to
        at = step - self._first
        poses = self._poses[user]
        if poses.away[at]:
            return None
        room = int(poses.room[at])
        others = (self._poses[name].room[at] for name in self._poses if name != user)
        steps, names = self._activities[user]
        activity = names[bisect_right(steps, step) - 1]
        after = min(at + 1, len(poses) - 1)
        return Circumstances(
            time=self.time(step),
            name=wanted.text.rpartition(" ")[0],
            interaction=wanted.interaction,
            activity=activity,
            room="" if room < 0 else self._rooms[room].type,
            company=sum(room >= 0 and other == room for other in others),
            is_moving=bool((poses.xy[at] != poses.xy[after]).any()),
            is_lying=activity in ASLEEP,
            distance=wanted.interaction.distance,
            in_sight=True,
            from_behind=False,
        )


def _consider(request: OpenRequest, step: int, life: _LifeOfPeriod) -> None:
    """Compare a time with the best one of a request so far."""
    now = life.circumstances(request.wanted, step)
    if now is None:
        return
    interaction = request.wanted.interaction
    answers: Answers = life.answers[interaction.to]
    answers.months.pass_time(request.state, now.time)
    chance = 1.0
    for stage in ("notice", "available", "accept"):
        chance *= answers.chance(stage, now, request.state)
    value = chance * interaction.value_after(now.time - life.time(request.wanted.step))
    if value > request.best:
        request.best = value
        request.best_at = step
        request.chance = chance


def _numbers(requests: list[OpenRequest]) -> dict[str, float]:
    """Return the numbers of one robot and one person."""
    best = sum_in_order(request.best for request in requests)
    value = sum_in_order(request.value for request in requests)
    return {
        "requests": len(requests),
        "best": best,
        "value": value,
        "regret": best - value,
        "best_chance": sum_in_order(request.chance for request in requests) / len(requests),
    }
