"""The language of expectations for homes and people: each sentence of its page, in whole runs."""

from functools import cache

import numpy as np
import pytest
from tests.scenes import AGENDA, OWN, scenario, table

import fleet2d
from fleet2d.errors import InputError, ScenarioError
from fleet2d.expectations import at_end, distance, room, speed
from fleet2d.expectations.parse import parse_expectation
from fleet2d.expectations.verdict import check_judged

CAMERA = {"range": [0.2, 4], "angle_deg": 120}
WHOLE_HOME = [[0, 0], [20, 0], [20, 20], [0, 20]]


def home(**sections):
    return scenario(
        "12 min",
        users={
            "ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"},
            "ben": {"type": "meander", "speed": 0.7},
        },
        robots={
            "astro": {
                "behaviors": [{"type": "find", "user": "ana"}, {"type": "patrol", "dwell": "30 s"}],
                "camera": CAMERA,
                "battery": {
                    "driving": "2 h", "standing": "4 h", "charging": "1 h", "charger": [0.5, 6.5]
                },
            },
            "bolt": {"type": "patrol", "dwell": "1 min", "camera": CAMERA},
        },
        algorithms={"share": {"type": f"{OWN}:Share", "period": "2 min"}},
        artifacts={"trajectories": "every step"},
    ) | sections  # fmt: skip


EXPECTED = {
    "nearer": "always(distance(astro, ana) < distance(astro, ben))",
    "together": "never(room(astro) == room(ben))",
    "far": "always(distance(astro, ana) + 50 cm < 2 * distance(astro, ben))",
    "half": "always((distance(astro, ana) - distance(astro, ben)) / 2 < 1 m)",
    "ratio": "always(distance(astro, ana) / distance(astro, ben) < 3)",
    "anyone": "never(distance(astro, anyone) < 1 m)",
    "everyone": "always(distance(astro, everyone) >= 1 m)",
    "company": "never(room(ana) == room(anyone))",
    "who": "always(nearest(ana) == astro)",
    "off": "always(distance(nearest(ana), ana) > 1 m)",
    "likeliest": "never(likeliest(share) == bathroom)",
    "once": "always(once(moving(astro), within=10 s))",
    "since": "never(since(not moving(astro), room(astro) == kitchen))",
    "office": "never(room(astro) == office)",
    "toilet": "never(distance(astro, any toilet) < 1 m)",
    "a_bathroom": "never(room(astro) == any bathroom)",
    "bathroom": "never(room(astro) == bathroom)",
    "share": "share(distance(astro, ana) < 3 m) >= 80 %",
    "hour": "always(share(moving(astro), per=hour) <= 99 %)",
    "implies": "always(implies(distance(astro, ana) < 0.001 m, moving(astro)))",
    "implied": "always(implies(room(astro) == kitchen, distance(astro, kitchen) < 1 mm))",
}


@cache
def judged():
    """A run, its verdicts by name, and what they are about, step by step."""
    simulation = fleet2d.Simulation(home(expect=EXPECTED))
    run = simulation.run()
    of = {name: table(run, "trajectories", entity=name) for name in ("ana", "ben", "astro", "bolt")}

    def apart(one, other):
        gap = np.hypot(of[one]["x"] - of[other]["x"], of[one]["y"] - of[other]["y"])
        return np.where(of[one]["away"] | of[other]["away"], np.inf, gap)

    rooms = {name: rows["room"].astype(str) for name, rows in of.items()}
    moves = np.append(False, np.hypot(*np.diff([of["astro"]["x"], of["astro"]["y"]])) > 0)
    return run, simulation.verdicts(), apart, rooms, moves


def violated():
    """At which steps each expectation should be violated, by the trajectories and tables."""
    run, _, apart, rooms, moves = judged()
    ana, ben = apart("astro", "ana"), apart("astro", "ben")
    other = apart("bolt", "ana")
    kitchen = rooms["astro"] == "kitchen_1"
    since = []
    for step in range(720):
        goals = [t for t in range(step + 1) if kitchen[t] and not moves[t + 1 : step + 1].any()]
        since.append(bool(goals))
    likeliest = np.zeros(720, bool)
    rows = table(run, "share")
    for step in np.unique(rows["step"]).tolist():
        at = rows["step"] == step
        best = str(rows["room"][at][np.argmax(rows["share"][at])])
        likeliest[step + 1 :] = best == "bathroom_1"
    return {
        "nearer": ana >= ben,
        "together": (rooms["astro"] == rooms["ben"]) & (rooms["ben"] != ""),
        "far": ana + 0.5 >= 2 * ben,
        "half": (ana - ben) / 2 >= 1,
        "ratio": ana / ben >= 3,
        "anyone": np.minimum(ana, ben) < 1,
        "everyone": np.minimum(ana, ben) < 1,
        "company": (rooms["ana"] == rooms["ben"]) & (rooms["ana"] != ""),
        "who": ana > other,
        "off": np.minimum(ana, other) <= 1,
        "likeliest": likeliest,
        "once": np.array([not moves[max(0, k - 10) : k + 1].any() for k in range(720)]),
        "since": np.array(since),
        "bathroom": rooms["astro"] == "bathroom_1",
        "a_bathroom": rooms["astro"] == "bathroom_1",
        "office": np.zeros(720, bool),
        "toilet": np.zeros(720, bool),
    }


@pytest.mark.parametrize("name", list(EXPECTED)[:17])
def test_an_expectation_is_violated_where_the_tables_say_so(name):
    marked = np.zeros(720, bool)
    for violation in judged()[1][name].violations:
        marked[violation.first : violation.last + 1] = True

    assert (marked == violated()[name]).all()


def test_verdicts_say_how_far_off_they_are_and_are_shown_as_they_were_written():
    _, verdicts, apart, _, _ = judged()
    ana, ben = apart("astro", "ana"), apart("astro", "ben")

    assert "anyone" in verdicts["anyone"].expectation
    assert verdicts["anyone"].robustness == pytest.approx(np.minimum(ana, ben).min() - 1)
    assert verdicts["share"].robustness == pytest.approx((ana < 3).mean() - 0.8)
    assert verdicts["share"].expectation.startswith("at_end(share(")
    assert verdicts["hour"].unit == verdicts["share"].unit == "share"


def test_a_window_has_two_ends():
    begin = "events(find_begins, astro)"
    texts = [
        f"after({begin}, moving(astro), within=1..2 min)",
        f'after({begin}, moving(astro), within="1 min..120 s")',
    ]
    one, other = map(parse_expectation, texts)

    assert (
        str(one)
        == str(other)
        == 'after(events("find_begins", "astro"), moving("astro"), within="1 min..2 min")'
    )


def test_a_kind_of_rooms_that_the_home_lacks_is_a_note_not_an_error():
    run, verdicts, *_ = judged()

    assert verdicts["office"].notes == ('room("astro"): this home has no office',)
    assert 'expect.office: room("astro"): this home has no office' in run.manifest["notes"]
    assert verdicts["toilet"].content()["notes"][0].endswith("this home has no toilet")
    assert verdicts["a_bathroom"].notes == ()


def test_implies_is_untested_if_its_premise_never_came():
    _, verdicts, *_ = judged()

    assert verdicts["implies"].holds is None
    assert "never came" in str(verdicts["implies"])
    assert verdicts["implied"].holds


REFUSED = {
    "always(battery(astro) > 20)": "a share is a number from 0 to 1, or from 0 % to 100 %, such as 20 %",
    "never(during(22:00-22:00))": "22:00-22:00 has no length: write 00:00-24:00 for the whole day",
    "never(activity(ana) == slep)": "there is no activity of ana 'slep': did you mean 'sleep'?",
    "never(activity(ben) == sleep)": "there is no activity of ben 'sleep'",
    "never(events(called, astro, detail='find anna'))": "'find anna': did you mean 'find ana'?",
    "never(events(activity, ana, detail=slep))": "did you mean 'sleep'?",
    "never(events(found, astro, detail=bob))": "'bob'",
    "never(room(astro) == bathrom)": "did you mean 'bathroom'",
    "never(distance(astro, (400, 2)) < 1)": "(400, 2) m is outside the home, which reaches from (0, 0) to",
    "always(distance(astro, ana) > speed(ana))": "different units: m and m/s",
    "never(room(ana) == activity(ana))": "room and activity are compared, which are never the same",
    "eventually(moving(astro), within=2..1 min)": "ends before it begins",
    "always(moving(astro) + 1 > 2)": "can't be part of an expectation",
    "always(distance(nearest(astro), nearest(kitchen)) > 2)": "no user or robot 'kitchen'",
}


@pytest.mark.parametrize(("text", "message"), REFUSED.items())
def test_words_that_can_never_occur_are_refused(text, message):
    with pytest.raises((ScenarioError, InputError)) as caught:
        fleet2d.Simulation(home(expect={"wrong": text}))
    assert message in str(caught.value)


def test_an_output_of_nobody_in_particular_has_no_likeliest_room_of_somebody():
    content = home(expect={"where": "never(likeliest(share, ana) == bathroom)"})
    with pytest.raises(ScenarioError, match="doesn't tell users apart"):
        fleet2d.run(content)


def test_an_activity_that_a_script_starts_is_known():
    told = {"at": "07:05", "activity": "ana", "what": "chess", "to": "kitchen"}
    waits = {"on": ["activity", "ana", "chess"], "replan": "astro"}
    simulation = fleet2d.Simulation(
        home(script=[waits, told], expect={"plays": "eventually(activity(ana) == chess)"})
    )
    simulation.run()

    assert simulation.verdicts()["plays"].holds


def test_nobody_is_refused_where_there_is_no_user():
    with pytest.raises(ScenarioError, match="there is no anyone: the scenario has no other user"):
        fleet2d.Simulation(
            home(
                users={},
                robots={"astro": {"type": "patrol"}},
                expect={"off": "never(distance(astro, anyone) < 1)"},
            )
        )


TEXTS = [
    'always((distance("ana", "astro") + 0.5 m) < distance("ana", "ben"))',
    'never(room("ana") == room(nearest("ana")))',
    'at_end(share(moving("astro"), per="day") >= 80 %)',
    'may_be_untested(after(moving("astro"), away("ana"), within="1 min..2 min"))',
    'always(implies(since(moving("ana"), away("ben"), within="2 min"), once(moving("ben"))))',
    'never(room("ana") == "any bathroom")',
]


@pytest.mark.parametrize("text", TEXTS)
def test_texts_are_read_as_they_are_written(text):
    assert str(parse_expectation(text)) == text


def test_python_has_the_same_language():
    near = distance("ana", "astro") + 0.5 < distance("ana", "ben")
    assert str(near) == '(distance("ana", "astro") + 0.5 m) < distance("ana", "ben")'
    assert str(2 * speed("ana") >= "1 m/s") == '(2 * speed("ana")) >= 1 m/s'
    assert str(room("ana") != room("ben")) == 'not (room("ana") == room("ben"))'
    assert str(at_end(-speed("ana") < 0)) == 'at_end((-1 * speed("ana")) < 0 m/s)'


@pytest.mark.parametrize(
    ("text", "outcome"),
    [
        (
            "always(distance(astro, ana) > -1)",
            'always holds: distance("astro", "ana") is 0 m or more',
        ),
        ("never(speed(astro) < 0)", 'can\'t hold: speed("astro") is 0 m/s or more'),
        (
            "at_end(metric(sightings.ana) < 10)",
            'always holds: metric("sightings.ana") is 0 to 1; write 0.1 for 10 %',
        ),
        (
            "at_end(metric(sightings.ana) > 30)",
            'can\'t hold: metric("sightings.ana") is 0 to 1; write 0.3 for 30 %',
        ),
        (
            "always(distance(astro, ana) + 1 > 50 cm)",
            'always holds: (distance("astro", "ana") + 1 m) is 1 m or more',
        ),
        (
            "never(probability(share, kitchen) > 30)",
            'can\'t hold: output("share.kitchen") is 0 to 1; write 0.3 for 30 %',
        ),
    ],
)
def test_a_comparison_whose_outcome_is_certain_is_noted(text, outcome):
    simulation = fleet2d.Simulation(home(expect={"it": text}, metrics={"sightings": {}}))
    told = [note for note in simulation.notes if note.startswith("expect")]

    assert len(told) == 1
    assert told[0].endswith(outcome)


def test_comparisons_whose_outcome_is_open_are_not_noted():
    texts = [
        "at_end(metric(sightings.ana) >= 0)",  # it is known
        "at_end(metric(distance.astro) > 50)",
        "always(battery(astro) > 0)",
        "always(distance(astro, ana) > distance(bolt, ana))",
        "count(moving(astro)) < 40",
    ]
    metrics = {"sightings": {}, "distance": {}}
    document = home(expect={f"e{n}": text for n, text in enumerate(texts)}, metrics=metrics)

    assert not [note for note in fleet2d.Simulation(document).notes if note.startswith("expect")]


@pytest.mark.parametrize("step", ["100 ms", "1 s"])
@pytest.mark.parametrize("slows", [[], [{"area": WHOLE_HOME, "speed": "50 %"}]])
def test_a_robot_is_no_faster_than_its_speed_by_the_rounding_of_positions(step, slows):
    limit = 0.3 if slows else 0.6
    document = scenario(
        "3 min",
        simulation={"step": step},
        robots={"astro": {"type": "patrol", "dwell": "1 s", "speed": 0.6}},
        expect={
            "keeps_to_it": f"always(speed(astro) <= {limit})",
            "reaches_it": f"eventually(speed(astro) >= {limit})",
        },
    )
    document["floorplan"]["slows"] = slows
    simulation = fleet2d.Simulation(document)
    simulation.run()

    assert all(verdict.holds for verdict in simulation.verdicts().values())


def test_a_sum_of_each_day_needs_an_operator_that_says_when_it_is_judged():
    with pytest.raises(InputError, match="says nothing of each day: write always"):
        check_judged(parse_expectation("count(moving(astro), per=day) < 3"))
