"""Conversations: bans that end, objects from one person to another, and what people start."""

from statistics import median

import pytest
from tests.entities.robots.test_interact import PILL, Scripted, ana, events_of, home
from tests.scenes import digests, expecting, scenario, table, unmet
from tests.thorough import some

import fleet2d
from fleet2d.errors import ScenarioError

PARCEL = {**PILL, "do": "deliver", "fetch_from": "ben"}
CALM = {"robots": {"astro": {"behaviors": [{"type": "interact"}, {"type": "patrol"}]}}}


def told(run, *kinds):
    rows = table(run, "events")
    pairs = zip(rows["event"], rows["detail"], strict=True)
    return [(str(event), str(detail)) for event, detail in pairs if event in kinds]


@pytest.mark.parametrize(
    ("answer", "expected"),
    [
        ("accepted", ["asks parcel ben", "collects parcel ben", "asks parcel ana", "delivered parcel ana"]),
        ("declined", ["asks parcel ben", "declined parcel ben"]),
    ],
)  # fmt: skip
def test_a_parcel_that_is_handed_over_is_brought_to_the_other(answer, expected):
    users = {"ana": ana(), "ben": ana("bedroom", (answer,))}
    run = fleet2d.run(home(users=users, interactions={"parcel": PARCEL}))
    kinds = ("asks", "declined", "collects", "delivered", "expired")

    assert expected == [" ".join(pair) for pair in told(run, *kinds)]


def person_who(answers=None, **rates):
    return ana() | {"answers": {"initiative": rates} | (answers or {})}


def scripted(room, outcome, **keys):
    return ana(room) | {"answers": Scripted(outcomes=(outcome,), **keys)}


APPROACHES = [{"type": "opportunistic", "again": "1 min"}, {"type": "patrol"}]
CASES = {
    "a ban ends": (
        "3 h",
        {"users": {"ana": scripted("bedroom", "banned", bans_for="30 min")}},
        """
        at_most(1, events(banned, astro), per=day)
        never(once(events(banned, astro), within=29 min) and events(allowed, astro))
        after(events(banned, astro), events(allowed, astro), within=30 min)
        never(once(events(banned, astro), within=30 min) and not once(events(banned, astro), within=1 min) and room(astro) == bedroom)
        after(events(allowed, astro), room(astro) == bedroom, within=2 h)
        """,
    ),
    "who sends the robot away is left alone for a while": (
        "50 min",
        {
            "users": {"ana": scripted("kitchen", "sent_away", away_for="20 min")},
            "robots": {"astro": {"behaviors": APPROACHES}},
        },
        """
        at_most(1, events(sent_away, astro), per=day)
        never(events(approaches, astro) and once(events(sent_away, astro), within=20 min))
        after(events(sent_away, astro), events(approaches, astro), within=50 min)
        """,
    ),
    "annoyed people send robots away that asked nothing": (
        "1 h",
        {
            "users": {
                "ana": person_who({"sends_away_at": -1, "away_for": "5 min"}, complaints=1000)
            },
            "robots": {"astro": {"behaviors": [{"type": "patrol"}]}},
            "interactions": {},
        },
        """
        eventually(events(sent_away, astro))
        always(implies(events(sent_away, astro), room(astro) == kitchen))
        never(once(events(sent_away, astro), within=5 min) and not once(events(sent_away, astro), within=20 s) and room(astro) == kitchen)
        """,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_what_answers_mean_for_a_while(name):
    duration, sections, expected = CASES[name]
    assert [] == unmet(fleet2d.run(home(duration, **sections, expect=expecting(expected))))


def test_people_call_robots_which_come():
    behaviors = [{"type": "interact"}, {"type": "come", "stay": "1 min"}, {"type": "patrol"}]
    content = home("3 h", users={"ana": person_who(calls=24)}, metrics={"interactions": {}})
    content["robots"] = {"astro": {"behaviors": behaviors}}
    run = fleet2d.run(content)
    called, came = told(run, "called"), told(run, "visits")

    assert len(came) >= len(called) > 0
    assert ("called", "come ana") in called
    assert len(called) == run.metrics["interactions"]["astro"]["ana"]["called"]


def test_questions_near_by_are_replied_to():
    run = fleet2d.run(home("3 h", users={"ana": person_who(questions=48)}))
    asked = [step for step, _ in events_of(run, "question")]
    replies = [step for step, _ in events_of(run, "replies")]

    assert len(asked) > 2
    assert len(replies) > len(asked) / 2  # others come while it is busy
    assert all(any(0 < reply - step < 15 for step in asked) for reply in replies)


def test_who_has_had_enough_switches_the_robot_off_for_good():
    person = person_who(complaints=1000)
    person["answers"] |= {"sends_away_at": -1, "away_for": "5 s", "off_for": "5 min"}
    robots = {"astro": {"behaviors": [{"type": "patrol"}]}}
    content = home("8 h", users={"ana": person}, interactions={}, robots=robots)
    run = fleet2d.run(content)
    ((given_up, _),) = events_of(run, "given_up")
    ends = ("given_up", "power_on", "sent_away", "switched_off")
    # Each time costs 3 % of trust, from a half down to a tenth.
    assert 50 < len(events_of(run, "sent_away")) < 60
    assert ["given_up", "switched_off"] == sorted(e for e, _ in told(run, *ends[:2], ends[3]))
    assert max(step for kind in ends for step, _ in events_of(run, kind)) == given_up

    person["answers"] |= {"gives_up_below": 0}
    assert not events_of(fleet2d.run(content), "given_up")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["leaving", "fading"])
def test_a_life_with_a_pushy_robot_ends_in_days_rather_than_in_a_thousand_quarrels(kind):
    """One who `leaves` switched it off 42 times in 60 days; another sent it away 893 times."""
    pushy = {
        "medicine": {"do": "remind", "to": "ana", "at": ["08:00"], "within": "2 h", "worth": 5},
        "music": {"do": "offer", "to": "ana", "every": "1 h", "within": "1 h"},
    }
    answers = {"months": {"type": kind}}
    users = {"ana": {"type": "routine", "persona": "retired", "answers": answers}}
    content = scenario("30 d", **CALM, users=users, interactions=pushy)
    ends = []
    quarrels = []
    for seed in range(4, 9):
        run = fleet2d.run(content, seed=seed)
        quarrels.append(len(events_of(run, "sent_away")))
        assert len(events_of(run, "switched_off")) <= 5
        for given_up, _ in events_of(run, "given_up"):
            ends.append(given_up / 86400)
            assert not [step for step, _ in events_of(run, "asks") if step > given_up]
    assert len(ends) >= 4  # in one of the five lives she bears it for the whole month
    assert median(ends) < 14
    assert median(quarrels) <= 893 / 8


@pytest.mark.parametrize("max_span", some([7, 1], 2))
def test_spans_are_invisible_to_what_people_start(max_span):
    person = person_who(questions=200, complaints=500)
    person["answers"] |= {"sends_away_at": 0.1, "away_for": "2 min"}
    content = home("25 min", users={"ana": person})
    other = {**content, "simulation": {**content["simulation"], "max_span": max_span}}

    assert digests(fleet2d.run(content)) == digests(fleet2d.run(other))


def test_calls_of_a_robot_that_can_not_come_are_refused():
    with pytest.raises(ScenarioError, match=r"initiative\.calls: none of the behaviors of astro"):
        fleet2d.run(home(users={"ana": person_who(calls=1)}))


def test_expectations_know_the_details_of_requests():
    text = "after(events(due, astro, detail='pill ana'), events(accepted, astro, detail='{}'), within=30 min)"
    assert [] == unmet(fleet2d.run(home("1 h", expect={"taken": text.format("pill ana")})))
    with pytest.raises(ScenarioError, match="'pil ana': did you mean 'pill ana'"):
        fleet2d.run(home("1 h", expect={"taken": text.format("pil ana")}))


STANDS = {"astro": {"behaviors": [{"type": "patrol", "rooms": ["bathroom"], "dwell": "1 d"}]}}
SHORT = {**PILL, "within": "1 min"}


@pytest.mark.parametrize("max_span", [7, 600])
def test_spans_are_invisible_to_requests_that_nothing_waits_for(max_span):
    content = home("30 min", robots=STANDS, interactions={"pill": SHORT})
    content["metrics"] = {"interactions": {}}
    other = {**content, "simulation": {**content["simulation"], "max_span": max_span}}
    run = fleet2d.run(content)

    assert [(600, "due"), (660, "expired")] == events_of(run)
    assert digests(run) == digests(fleet2d.run(other))


def test_who_waits_for_a_request_to_expire_is_told_at_its_deadline():
    run = fleet2d.Simulation(home("30 min", robots=STANDS, interactions={"pill": SHORT}))
    event = run.run_until(event="expired", entity="astro")

    assert (660, 661) == (event.step, run.step)
