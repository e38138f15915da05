"""Interact: the robot serves its requests, and keeps to what people answer."""

import copy
import re
from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pytest
from tests.scenes import scenario, table
from tests.thorough import some

import fleet2d
from fleet2d import Algorithm
from fleet2d.algorithms.algorithm import RoomDistribution
from fleet2d.entities.robots.interact import Interact, RoundMemory
from fleet2d.errors import ScenarioError
from fleet2d.interactions.answers import Answers, Reply
from fleet2d.interactions.interaction import Outcome

PILL = {"do": "remind", "to": "ana", "at": ["07:10"], "within": "1 h", "worth": 4, "takes": "30 s"}


class Scripted(Answers):
    """Gives the same answers one after the other, 5 s after each question."""

    outcomes: tuple[str, ...] = ("accepted",)
    later: Any = (timedelta(minutes=12), timedelta(minutes=12))

    def reply(self, now, state, seed, path, step):
        self.__dict__.setdefault("number", 0)
        self.__dict__["number"] += 1
        outcome = self.outcomes[min(self.__dict__["number"], len(self.outcomes)) - 1]
        if not outcome:
            return None
        return Reply(Outcome(outcome), timedelta(seconds=5), self.later[0], 0.5)


def ana(place="kitchen", outcomes=("accepted",)):
    """A person who stays at a place, and whose answers are known."""
    item = {"at": "00:10", "place": place, "activity": "read"}
    days = [{"on": "daily", "items": [item]}]
    return {"type": "schedule", "days": days, "answers": Scripted(outcomes=outcomes)}


def home(duration="2 h", **changes):
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


def events_of(run, *kinds):
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


@pytest.mark.parametrize(
    ("place", "outcome", "behavior", "expected"),
    [
        ("kitchen", "declined", "interact", ["due", "asks", "declined", "withdraws"]),
        # A sleeper is never asked in vain twice.
        ("bedroom", "", "interact", ["due", "asks", "withdraws", "expired"]),
        ("kitchen", "accepted", "opportunistic", ["due", "asks", "accepted", "delivered"]),
    ],
    ids=["declined", "no answer in one place", "taken when in view"],
)
def test_a_request_takes_its_course(place, outcome, behavior, expected):
    astro = {"behaviors": [{"type": behavior}, {"type": "patrol"}]}
    run = fleet2d.run(home(users={"ana": ana(place, (outcome,))}, robots={"astro": astro}))

    assert expected == [event for _, event in events_of(run)]


@pytest.mark.parametrize("max_span", some([7, 1], 2))
def test_spans_and_branches_are_invisible(max_span):
    content = home("30 min")
    content["users"]["ana"]["answers"] = {"defers": 1}
    whole = fleet2d.run(content)
    half = fleet2d.Simulation(content)
    half.run_until(timedelta(minutes=11))

    assert whole.digest == fleet2d.run(content, max_span=max_span).digest
    assert whole.digest == copy.deepcopy(half).run().digest == half.run().digest


def test_a_deferred_reminder_comes_back_at_its_time():
    run = fleet2d.run(home(users={"ana": ana(outcomes=("deferred", "accepted"))}))
    happened = events_of(run, "asks", "deferred", "accepted")

    assert ["asks", "deferred", "asks", "accepted"] == [event for _, event in happened]
    deferred, again = happened[1][0], happened[2][0]
    assert 12 * 60 <= again - deferred < 12 * 60 + 120


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
    run = fleet2d.run(home("3 h", users={"ana": ana("bedroom", ("banned",))}))
    ((banned, _),) = events_of(run, "banned")
    left = next(step for step, _ in events_of(run, "withdraws") if step > banned) + 120
    rows = table(run, "trajectories", entity="astro")

    assert "bedroom_1" in rows["room"][:banned]
    assert "kitchen_1" in rows["room"][left:]
    assert "bedroom_1" not in rows["room"][left:]


def test_a_robot_that_is_switched_off_neither_moves_nor_sees_nor_hears():
    answers = Scripted(
        outcomes=("switched_off",),
        off_for="60 min",
        initiative={"type": "rates", "questions": 1000},
    )
    run = fleet2d.run(home("2 h", users={"ana": ana() | {"answers": answers}}))
    ((off, _),) = events_of(run, "switched_off")
    on = off + 3600
    x = table(run, "trajectories", entity="astro")["x"]
    seen = table(run, "observations")["step"]
    heard = [step for step, _ in events_of(run, "question")]

    assert np.ptp(x[off + 2 : on]) < 0.1 < np.ptp(x[on:])
    assert off in seen
    assert not ((off < seen) & (seen <= on)).any()
    assert not [step for step in heard if off < step <= on]
    assert [step for step in heard if step > on]
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


class Believed(Algorithm):
    """Believes the person to be out with a probability."""

    out: float = 0.9

    def update(self, history, state):
        belief = RoomDistribution(np.ones(len(state.home.rooms)))
        belief.away = self.out
        return belief


@pytest.mark.parametrize(("out", "moves"), [(0.9, False), (0.5, True)])
def test_nobody_is_looked_for_who_is_likely_out(out, moves):
    content = home(
        "40 min",
        users={"ana": OUT},
        robots={"astro": {"behaviors": [{"type": "interact", "source": "belief"}]}},
        algorithms={"belief": Believed(out=out, period=timedelta(minutes=1))},
    )
    rows = table(fleet2d.run(content), "trajectories", entity="astro")

    assert moves == bool(np.ptp(rows["x"]) > 1)


def test_who_is_out_is_looked_for_less_and_less_often():
    content = home(
        "8 h",
        users={"ana": OUT},
        robots={"astro": {"behaviors": [{"type": "interact"}]}},
        interactions={"pill": {**PILL, "within": "7 h"}},
    )
    x = table(fleet2d.run(content), "trajectories", entity="astro")["x"]
    pauses = np.diff(np.flatnonzero(np.diff(x)) / 60)

    assert [30, 97, 120, 120] == pytest.approx(pauses[pauses > 5].tolist(), abs=3)


def test_who_gave_no_answer_is_not_looked_for_within_four_hours():
    rounds = []

    class Watched(Interact):
        """Notes when it begins a round."""

        def decide(self, now):
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


OUT = {"type": "schedule", "days": [{"items": [{"at": "00:10", "away": True}]}]}
MONDAY = datetime(2026, 1, 5, 10)


def test_an_empty_round_is_doubted_until_it_fades_or_the_person_is_seen():
    memory = RoundMemory()
    memory.note_empty("ana", MONDAY, 0.5, 0.25)
    doubted, later = (memory.chance("ana", MONDAY + timedelta(hours=h), 0.5) for h in (0, 8))
    memory.note_found("ana", MONDAY + timedelta(hours=1))

    assert (pytest.approx(1 / 11), 0.5) == (doubted, later)
    assert 0.5 == memory.chance("ana", MONDAY + timedelta(hours=2), 0.5)


def test_rounds_of_an_hour_are_remembered_by_kind_of_day_and_forgotten_in_weeks():
    memory = RoundMemory()
    for day in range(3):
        memory.note_empty("ana", MONDAY + timedelta(days=day), 0.8, 0.25)

    def chance(**passed):
        return memory.chance("ana", MONDAY + timedelta(**passed), 0.8)

    assert 0.33 == pytest.approx(chance(days=4), abs=0.02)
    assert 0.8 == chance(days=4, hours=1) == chance(days=5)
    assert 0.75 < chance(days=70) < 0.8


def test_sightings_wake_nobody_who_wants_nothing():
    asked = []

    class Watched(Interact):
        """Notes when it is asked."""

        def decide(self, now):
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
