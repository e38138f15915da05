"""Interact: the robot serves its requests, and keeps to what people answer."""

import re
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pytest
from tests.scenes import digests, scenario, table
from tests.thorough import some

import fleet2d
from fleet2d import Algorithm, Plan, Situation
from fleet2d.algorithms.algorithm import Present, RoomDistribution
from fleet2d.algorithms.history import History
from fleet2d.entities.robots.interact import Interact, RoundMemory
from fleet2d.errors import ScenarioError
from fleet2d.interactions.answers import Answers, Circumstances, Reply
from fleet2d.interactions.attitude import AttitudeState
from fleet2d.interactions.interaction import Outcome

PILL = {"do": "remind", "to": "ana", "at": ["07:10"], "within": "1 h", "worth": 4, "takes": "30 s"}


class Scripted(Answers):
    """Gives the same answers one after the other, 5 s after each question."""

    outcomes: tuple[str, ...] = ("accepted",)
    later: Any = (timedelta(minutes=12), timedelta(minutes=12))

    def reply(
        self, now: Circumstances, state: AttitudeState, seed: int, path: str, step: int
    ) -> Reply | None:
        self.__dict__.setdefault("number", 0)
        self.__dict__["number"] += 1
        outcome = self.outcomes[min(self.__dict__["number"], len(self.outcomes)) - 1]
        if not outcome:
            return None
        return Reply(Outcome(outcome), timedelta(seconds=5), self.later[0], 0.5)


def ana(place: Any = "kitchen", outcomes: Sequence[str] = ("accepted",)) -> dict[str, Any]:
    """A person who stays at a place, and whose answers are known."""
    item = {"at": "00:10", "place": place, "activity": "read"}
    days = [{"on": "daily", "items": [item]}]
    return {"type": "schedule", "days": days, "answers": Scripted(outcomes=outcomes)}


def home(duration: str = "2 h", **changes: Any) -> dict[str, Any]:
    return scenario(
        duration,
        **{
            "users": {"ana": ana()},
            "robots": {"astro": {"behaviors": [{"type": "interact"}, {"type": "patrol"}]}},
            "interactions": {"pill": PILL},
            "artifacts": {"trajectories": "1 s"},
            **changes,
        },
    )


def events_of(run: fleet2d.Run, *kinds: str) -> list[tuple[int, str]]:
    rows = table(run, "events")
    wanted = kinds or (
        "due", "asks", *map(str, Outcome), "delivered", "withdraws", "expired",
    )  # fmt: skip
    return [
        (int(step), str(event))
        for step, event in zip(rows["step"], rows["event"], strict=True)
        if event in wanted
    ]


def test_a_reminder_is_given_once_it_is_due():
    run = fleet2d.run(home())
    (due, _), (asks, _), (accepted, _), (delivered, _) = happened = events_of(run)

    assert ["due", "asks", "accepted", "delivered"] == [event for _, event in happened]
    assert 600 == due < asks
    assert 5 == accepted - asks
    assert 30 <= delivered - accepted <= 32


@pytest.mark.parametrize("max_span", some([7, 1], 2))
def test_spans_are_invisible(max_span):
    content = home("30 min", users={"ana": ana(outcomes=("deferred", "accepted"))})
    content["users"]["ana"]["answers"] = {"defers": 1}
    other = {**content, "simulation": {**content["simulation"], "max_span": max_span}}
    assert digests(fleet2d.run(content)) == digests(fleet2d.run(other))


def test_a_deferred_reminder_comes_back_at_its_time():
    run = fleet2d.run(home(users={"ana": ana(outcomes=("deferred", "accepted"))}))
    happened = events_of(run, "asks", "deferred", "accepted")

    assert ["asks", "deferred", "asks", "accepted"] == [event for _, event in happened]
    deferred, again = happened[1][0], happened[2][0]
    assert 12 * 60 <= again - deferred < 12 * 60 + 120


def test_a_declined_reminder_is_dropped_and_the_robot_withdraws():
    run = fleet2d.run(home(users={"ana": ana(outcomes=("declined",))}))

    assert ["due", "asks", "declined", "withdraws"] == [event for _, event in events_of(run)]


def test_who_gives_no_answer_is_not_asked_again_in_the_same_place():
    """A sleeper is never asked in vain twice."""
    run = fleet2d.run(home(users={"ana": ana("bedroom", ("",))}))

    happened = [event for _, event in events_of(run)]
    assert ["due", "asks", "withdraws", "expired"] == happened


def test_who_has_moved_is_asked_again():
    items = [
        {"at": "00:10", "place": "bedroom", "activity": "sleep"},
        {"at": "07:40", "place": "kitchen", "activity": "breakfast"},
    ]
    person = ana() | {"days": [{"on": "daily", "items": items}]}
    person["answers"] = Scripted(outcomes=("", "accepted"))
    run = fleet2d.run(home(users={"ana": person}))

    happened = events_of(run, "asks", "accepted")
    assert ["asks", "asks", "accepted"] == [event for _, event in happened]
    assert happened[0][0] < 40 * 60 < happened[1][0]


def test_a_banned_room_stays_empty():
    users = {"ana": ana("bedroom", ("banned",))}
    run = fleet2d.run(home("3 h", users=users))
    (banned,) = events_of(run, "banned")
    left = next(step for step, event in events_of(run, "withdraws") if step > banned[0]) + 120
    rows = table(run, "trajectories")
    is_robot = rows["entity"] == "astro"

    before = set(rows["room"][is_robot & (rows["step"] <= banned[0])])
    after = set(rows["room"][is_robot & (rows["step"] > left)])
    assert any("bedroom" in str(room) for room in before)
    assert len(after) > 1
    assert not any("bedroom" in str(room) for room in after)


def test_a_robot_that_is_switched_off_stands_still_until_it_is_on_again():
    users = {"ana": ana(outcomes=("switched_off",))}
    users["ana"]["answers"] = Scripted(outcomes=("switched_off",), off_for="30 min")
    run = fleet2d.run(home("2 h", users=users))
    ((off, _),) = events_of(run, "switched_off")
    rows = table(run, "trajectories")
    is_robot = rows["entity"] == "astro"

    def moves(first: int, end: int) -> bool:
        now = is_robot & (rows["step"] > first) & (rows["step"] < end)
        return bool(np.ptp(rows["x"][now]) > 0.1 or np.ptp(rows["y"][now]) > 0.1)

    assert not moves(off + 1, off + 1800)
    assert moves(off + 1800, off + 3600)


def test_a_robot_that_is_switched_off_neither_sees_nor_hears():
    users = {"ana": ana(outcomes=("switched_off",))}
    users["ana"]["answers"] = Scripted(
        outcomes=("switched_off",),
        off_for="60 min",
        initiative={"type": "rates", "questions": 1000},
    )
    run = fleet2d.run(home("2 h", users=users))
    ((off, _),) = events_of(run, "switched_off")
    seen, heard = table(run, "observations")["step"], events_of(run, "question")

    def is_off(step: Any) -> Any:
        return (off < step) & (step <= off + 3600)

    assert not is_off(seen).any()
    assert not [step for step, _ in heard if is_off(step)]
    assert (seen == off).any()
    assert [step for step, _ in heard if step > off + 3600]
    (done,) = run.manifest["interventions"]
    assert {"do": "power", "step": off + 1, "by": "users.ana"}.items() <= done.items()


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("remind(ana) accepted within 30 min", True),
        ("pill(ana) accepted", True),
        ("pill(ana) accepted within 10 s", False),
        ("remind(ana) declined or not remind(ana) delivered within 1 h", False),
    ],
)
def test_answers_are_expected_in_words(text, holds):
    song = {"do": "offer", "to": "ana", "at": ["07:15"], "within": "1 h"}
    run = fleet2d.run(home(interactions={"pill": PILL, "song": song}, expect={"answers": text}))
    (verdict,) = run.manifest["expectations"].values()

    assert holds == verdict["holds"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("remimd(ana) accepted", "there is no interaction 'remimd': did you mean 'remind'?"),
        ("remind(anna) accepted", "there is no remind to 'anna': did you mean 'ana'?"),
        ("remind(ana) acepted", "there is no answer 'acepted': did you mean 'accepted'?"),
        ("remind(ana) accepted within 3 d", "3 d is beyond the run"),
    ],
)
def test_answers_that_nobody_can_give_are_refused(text, message):
    with pytest.raises(ScenarioError, match=re.escape(message)):
        fleet2d.run(home(expect={"answers": text}))


def test_an_opportunity_is_taken_when_the_person_comes_into_view():
    behaviors = [{"type": "opportunistic"}, {"type": "patrol"}]
    run = fleet2d.run(home(robots={"astro": {"behaviors": behaviors}}))

    happened = [event for _, event in events_of(run)]
    assert ["due", "asks", "accepted", "delivered"] == happened


def test_who_is_addressed_in_place_of_another_has_less_trust_in_the_robot():
    users = {
        "ana": ana([4.5, 3.5]) | {"answers": {"notice": {"base": 9}}},
        "ben": ana([1.0, 3.5]) | {"answers": {"notice": {"base": 9}}},
    }
    robots = {
        "astro": {
            "behaviors": [{"type": "interact"}, {"type": "patrol"}],
            "perception": {"identity": {"mistaken": 1.0}},  # it takes each for the other
        }
    }
    run = fleet2d.run(home(users=users, robots=robots, metrics={"interactions": {}}))
    rows = table(run, "interactions")
    (trust,) = rows["trust"][rows["outcome"] == "mistaken"][:1]

    assert "mistaken" in {event for _, event in events_of(run)}
    assert 0.5 * 0.7 == pytest.approx(trust)


def test_a_run_that_is_branched_goes_on_the_same():
    import copy

    content = home("1 h", users={"ana": ana()})
    content["users"]["ana"]["answers"] = {"activity": {"base": -1}}
    whole = fleet2d.run(content)
    half = fleet2d.Simulation(content)
    half.run_until(timedelta(minutes=11))

    assert whole.digest == copy.deepcopy(half).run().digest == half.run().digest


class Believed(Algorithm):
    """Believes the person to be out with a probability."""

    out: float = 0.9

    def update(self, history: History, state: Present) -> Any:
        belief = RoomDistribution(np.ones(len(state.home.rooms)))
        belief.away = self.out  # type: ignore[attr-defined]
        return belief


@pytest.mark.parametrize(("out", "moves"), [(0.9, False), (0.5, True)])
def test_nobody_is_looked_for_who_is_likely_out(out, moves):
    content = home(
        "40 min",
        users={"ana": {"type": "schedule", "days": [{"items": [{"at": "00:10", "away": True}]}]}},
        robots={"astro": {"behaviors": [{"type": "interact", "source": "belief"}]}},
        algorithms={"belief": Believed(out=out, period=timedelta(minutes=1))},
    )
    rows = table(fleet2d.run(content), "trajectories")

    assert moves == bool(np.ptp(rows["x"][rows["entity"] == "astro"]) > 1)


def test_who_is_out_is_looked_for_less_and_less_often():
    content = home(
        "8 h",
        users={"ana": {"type": "schedule", "days": [{"items": [{"at": "00:10", "away": True}]}]}},
        robots={"astro": {"behaviors": [{"type": "interact"}]}},
        interactions={"pill": {**PILL, "within": "7 h"}},
    )
    rows = table(fleet2d.run(content), "trajectories")
    x = rows["x"][rows["entity"] == "astro"]
    moves = np.flatnonzero(np.diff(x)) / 60
    pauses = np.diff(moves)

    assert [30, 97, 120, 120] == pytest.approx(pauses[pauses > 5].tolist(), abs=3)


def test_who_gave_no_answer_is_not_looked_for_within_four_hours():
    rounds: list[int] = []

    class Watched(Interact):
        """Notes when it begins a round."""

        def decide(self, now: Situation) -> Plan | None:
            plan = super().decide(now)
            if plan is not None and "user_seen" in plan.interrupts and not now.events:
                rounds.append(now.step)
            return plan

    content = home(
        "6 h",
        users={"ana": ana("bedroom", ("",))},
        robots={"astro": {"behaviors": [Watched(), {"type": "patrol", "dwell": "1 min"}]}},
        interactions={"pill": {**PILL, "within": "5 h", "retry": "1 min", "tries": 9}},
    )
    ((asked, _),) = events_of(fleet2d.run(content), "asks")

    assert not [step for step in rounds if asked < step < asked + 4 * 3600]
    assert [step for step in rounds if step > asked]


MONDAY = datetime(2026, 1, 5, 10)


def test_an_empty_round_is_doubted_until_it_fades_or_the_person_is_seen():
    memory = RoundMemory()
    memory.note_empty("ana", MONDAY, 0.5, 0.25)
    doubted, later = (memory.chance("ana", MONDAY + timedelta(hours=h), 0.5) for h in (0, 8))
    memory.note_found("ana", MONDAY + timedelta(hours=1))

    assert 1 / 11 == pytest.approx(doubted)
    assert 0.5 == later
    assert 0.5 == memory.chance("ana", MONDAY + timedelta(hours=1, minutes=60), 0.5)


def test_rounds_of_an_hour_are_remembered_by_kind_of_day_and_forgotten_in_weeks():
    memory = RoundMemory()
    for day in range(3):
        memory.note_empty("ana", MONDAY + timedelta(days=day), 0.8, 0.25)

    def chance(**passed: float) -> float:
        return memory.chance("ana", MONDAY + timedelta(**passed), 0.8)

    assert 0.33 == pytest.approx(chance(days=4), abs=0.02)
    assert 0.8 == chance(days=4, hours=1) == chance(days=5)
    assert 0.75 < chance(days=70) < 0.8


def test_sightings_wake_nobody_who_wants_nothing():
    asked: list[int] = []

    class Watched(Interact):
        """Notes when it is asked."""

        def decide(self, now: Situation) -> Plan | None:
            asked.append(now.step)
            return super().decide(now)

    behaviors = [Watched(), {"type": "patrol", "dwell": "10 s"}]
    run = fleet2d.run(home(robots={"astro": {"behaviors": behaviors}}))
    (delivered,) = events_of(run, "delivered")
    seen = [step for step, _ in events_of(run, "user_seen")]
    ends = [step for step, _ in events_of(run, "visits")]

    assert sum(step > delivered[0] for step in seen) > 10
    assert not {step + 1 for step in seen if step > delivered[0] + 5} & set(asked) - set(ends)


def test_interact_without_requests_is_refused():
    with pytest.raises(ScenarioError, match="write a section `interactions`"):
        fleet2d.run(home(interactions={}))
