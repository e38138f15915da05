"""What came of what robots wanted of people."""

from collections import Counter
from typing import Any, ClassVar

from fleet2d.algorithms.algorithm import Present
from fleet2d.algorithms.history import History
from fleet2d.configuration.components import register
from fleet2d.floorplan.home import Home
from fleet2d.interactions.answers import AnswerRecord
from fleet2d.interactions.interaction import Outcome
from fleet2d.metrics.metric import Metric, columns_of
from fleet2d.runtime.determinism import sum_in_order

# What happens between a person and a robot without a request.
TOLD = frozenset({"called", "question", "replies", "sent_away", "banned", "switched_off"})


@register("metric", "interactions")
class Interactions(Metric):
    """What came of what robots wanted of people: value, answers, interruptions, annoyance.

    For each robot and person:

    - `wanted`: requests that came up; `asked`: times that the person was addressed for them;
    - `answered`, `accepted`: shares of `asked`; `kept`: share of `wanted` accepted in time;
    - `value`: value of what was accepted; `missed`: the worth of all requests minus that;
    - `wait_s`: mean time to an answer; `woke`: times that it woke the person;
    - `interrupted`: how often each activity was interrupted at a bad time: the probability of being
      available was below a half;
    - `called`, `question`, `replies`, `sent_away`, `banned`, `switched_off`: how often each of them
      happened, if ever, whoever began;
    - `annoyance`, `trust`: at the end, and `mean_annoyance`, over the times of being addressed.

    Its table has a row for each time that a person was addressed, with the truth of it.
    """

    hidden: ClassVar[frozenset[str]] = frozenset({"interrupted", "wait_s", "trust", "asked"})

    def start(self, home: Home) -> None:
        """Begin without any interaction."""
        self.wanted: Counter[tuple[str, str]] = Counter()
        self.worth: Counter[tuple[str, str]] = Counter()
        self.records: dict[tuple[str, str], list[AnswerRecord]] = {}
        self.told: dict[tuple[str, str], Counter[str]] = {}

    def update(self, history: History, state: Present) -> Any:
        """Take in what happened; return a row for each time that a person was addressed."""
        for wanted in history.wanted:
            key = wanted.robot, _person(wanted.text)
            self.wanted[key] += 1
            self.worth[key] += wanted.interaction.worth  # type: ignore[assignment]
        for event in history.events:
            if event.event in TOLD:
                people = (word for word in reversed(event.detail.split()) if word in state.users)
                if (person := next(people, None)) is not None:
                    self.told.setdefault((event.entity, person), Counter())[event.event] += 1
        records = history.answers
        for record in records:
            key = record.robot, _person(record.text)
            self.records.setdefault(key, []).append(record)
        columns = columns_of(AnswerRecord._fields, records)
        if columns is not None:
            columns["asked_at"] = columns.pop("step")
        return columns

    def result(self) -> dict[str, Any]:
        """Return {robot: {user: {number: value}}}."""
        result: dict[str, Any] = {}
        for robot, user in sorted(self.wanted.keys() | self.told):
            count, numbers = self.wanted[robot, user], {}
            if count:
                records = self.records.get((robot, user), [])
                numbers = _summary(records, count, float(self.worth[robot, user]))
            told = sorted(self.told.get((robot, user), {}).items())
            result.setdefault(robot, {})[user] = {"wanted": count, **numbers, **dict(told)}
        return result


def _person(text: str) -> str:
    return text.rpartition(" ")[2]


def _summary(records: list[AnswerRecord], wanted: int, worth: float) -> dict[str, Any]:
    """Return the numbers of one robot and one person."""
    answered = [r for r in records if r.outcome not in ("", Outcome.IGNORED)]
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
    bad = Counter(r.activity or "unknown" for r in records if r.outcome and r.willingness < 0.5)
    numbers |= {
        "answered": len(answered) / len(records),
        "accepted": len(accepted) / len(records),
        "interrupted": dict(sorted(bad.items())),
        "annoyance": records[-1].annoyance,
        "mean_annoyance": sum_in_order(r.annoyance for r in records) / len(records),
        "trust": records[-1].trust,
    }
    if answered:
        numbers["wait_s"] = sum_in_order(r.delay_s for r in answered) / len(answered)
    return numbers
