"""The language of expectations for homes and people: each sentence of its page, in whole runs."""

from typing import Any

import numpy as np
import pytest
from tests.scenes import AGENDA, OWN, scenario, table

import fleet2d
from fleet2d.errors import InputError, ScenarioError
from fleet2d.expectations import Verdict, at_end, distance, room, speed
from fleet2d.expectations.parse import parse_expectation

CAMERA = {"range": [0.2, 4], "angle_deg": 120}
WHOLE_HOME = [[0, 0], [20, 0], [20, 20], [0, 20]]


def home(**sections: Any) -> dict[str, Any]:
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


def verdicts(**expect: Any) -> tuple[fleet2d.Run, dict[str, Verdict]]:
    simulation = fleet2d.Simulation(home(expect=expect))
    return simulation.run(), simulation.verdicts()


def wrong(verdict: Verdict, steps: int = 720) -> Any:
    """Return at which steps an expectation is violated."""
    marked = np.zeros(steps, bool)
    for violation in verdict.violations:
        marked[violation.first : violation.last + 1] = True
    return marked


def poses(run: fleet2d.Run, name: str) -> dict[str, Any]:
    return table(run, "trajectories", entity=name)


def apart(run: fleet2d.Run, one: str, other: str) -> Any:
    a, b = poses(run, one), poses(run, other)
    return np.where(a["away"] | b["away"], np.inf, np.hypot(a["x"] - b["x"], a["y"] - b["y"]))


def rooms(run: fleet2d.Run, name: str) -> Any:
    return poses(run, name)["room"].astype(str)


def test_two_signals_are_compared():
    run, verdict = verdicts(
        nearer="always(distance(astro, ana) < distance(astro, ben))",
        together="never(room(astro) == room(ben))",
    )
    ana, ben = apart(run, "astro", "ana"), apart(run, "astro", "ben")
    same = (rooms(run, "astro") == rooms(run, "ben")) & (rooms(run, "ben") != "")

    assert (wrong(verdict["nearer"]) == (ana >= ben)).all()
    assert (wrong(verdict["together"]) == same).all()
    assert 0 < same.sum() < 720


def test_signals_are_computed_with():
    run, verdict = verdicts(
        far="always(distance(astro, ana) + 50 cm < 2 * distance(astro, ben))",
        half="always((distance(astro, ana) - distance(astro, ben)) / 2 < 1 m)",
        ratio="always(distance(astro, ana) / distance(astro, ben) < 3)",
    )
    ana, ben = apart(run, "astro", "ana"), apart(run, "astro", "ben")

    assert (wrong(verdict["far"]) == (ana + 0.5 >= 2 * ben)).all()
    assert (wrong(verdict["half"]) == ((ana - ben) / 2 >= 1)).all()
    assert (wrong(verdict["ratio"]) == (ana / ben >= 3)).all()


def test_anyone_and_everyone_are_the_people_of_the_scenario():
    run, verdict = verdicts(
        off="never(distance(astro, anyone) < 1 m)",
        all="always(distance(astro, everyone) >= 1 m)",
        seen="never(seen(everyone, by=astro))",
        company="never(room(ana) == room(anyone))",
    )
    ana, ben = apart(run, "astro", "ana"), apart(run, "astro", "ben")
    same = (rooms(run, "ana") == rooms(run, "ben")) & (rooms(run, "ana") != "")

    assert (wrong(verdict["off"]) == (np.minimum(ana, ben) < 1)).all()
    assert verdict["off"].violations == verdict["all"].violations
    assert "anyone" in verdict["off"].expectation, "it is shown as it was written"
    assert (wrong(verdict["company"]) == same).all()
    assert verdict["off"].robustness == pytest.approx(np.minimum(ana, ben).min() - 1)


def test_nearest_is_the_robot_that_is_nearest_at_each_step():
    run, verdict = verdicts(
        who="always(nearest(ana) == astro)",
        off="always(distance(nearest(ana), ana) > 1 m)",
    )
    astro, bolt = apart(run, "ana", "astro"), apart(run, "ana", "bolt")

    assert (wrong(verdict["who"]) == (astro > bolt)).all()
    assert (wrong(verdict["off"]) == (np.minimum(astro, bolt) <= 1)).all()


def test_a_kind_of_rooms_that_the_home_lacks_is_a_note_not_an_error():
    _, verdict = verdicts(
        out="never(room(astro) == office)",
        near="never(distance(astro, any toilet) < 1 m)",
        bath="never(room(astro) == any bathroom)",
        same="never(room(astro) == bathroom)",
    )

    assert verdict["out"].holds
    assert verdict["out"].notes == ('room("astro"): this home has no office',)
    assert verdict["near"].holds
    assert verdict["near"].content()["notes"][0].endswith("this home has no toilet")
    assert verdict["bath"].violations == verdict["same"].violations != ()
    assert verdict["bath"].notes == ()


def test_run_and_validate_note_a_kind_of_rooms_that_an_expectation_lacks():
    simulation = fleet2d.Simulation(home(expect={"out": "never(room(astro) == office)"}))
    note = 'expect.out: room("astro"): this home has no office'

    assert note in simulation.notes
    assert note in simulation.run().manifest["notes"]


def test_likeliest_is_the_room_with_the_highest_probability():
    run, verdict = verdicts(
        where="never(likeliest(share) == bathroom)", same="never(likeliest(share) == room(ana))"
    )
    rows = table(run, "share")
    expected = np.zeros(720, bool)
    for step in np.unique(rows["step"]).tolist():
        at = rows["step"] == step
        best = str(rows["room"][at][np.argmax(rows["share"][at])])
        expected[step + 1 :] = best == "bathroom_1"

    assert (wrong(verdict["where"]) == expected).all()
    with pytest.raises(ScenarioError, match="doesn't tell users apart"):
        verdicts(where="never(likeliest(share, ana) == bathroom)")


def test_a_share_is_of_the_time_so_far_and_counts_at_the_end():
    run, verdict = verdicts(
        near="share(distance(astro, ana) < 3 m) >= 80 %",
        then="share(seen(ana, by=astro), of=room(ana) == room(astro)) >= 1 %",
        hour="always(share(moving(astro), per=hour) <= 99 %)",
    )
    near = apart(run, "astro", "ana") < 3

    assert verdict["near"].robustness == pytest.approx(near.mean() - 0.8)
    assert verdict["near"].expectation.startswith("at_end(share(")
    assert verdict["hour"].unit == verdict["near"].unit == "share"


def test_implies_is_untested_if_its_premise_never_came():
    _, verdict = verdicts(
        never="always(implies(distance(astro, ana) < 0.001 m, moving(astro)))",
        often="always(implies(room(astro) == kitchen, distance(astro, kitchen) < 1 mm))",
    )

    assert verdict["never"].holds is None
    assert "never came" in str(verdict["never"])
    assert verdict["often"].holds


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
    with pytest.raises(InputError, match="ends before it begins"):
        parse_expectation("eventually(moving(astro), within=2..1 min)")


def test_the_past_is_told_by_once_and_since():
    run, verdict = verdicts(
        once="always(once(moving(astro), within=10 s))",
        since="never(since(not moving(astro), room(astro) == kitchen))",
    )
    at = poses(run, "astro")
    moves = np.append(False, np.hypot(np.diff(at["x"]), np.diff(at["y"])) > 0)
    lately = [moves[max(0, step - 10) : step + 1].any() for step in range(720)]
    kitchen, still_since = rooms(run, "astro") == "kitchen_1", []
    for step in range(720):
        goals = [t for t in range(step + 1) if kitchen[t] and not moves[t + 1 : step + 1].any()]
        still_since.append(bool(goals))

    assert (wrong(verdict["once"]) == ~np.array(lately)).all()
    assert (wrong(verdict["since"]) == np.array(still_since)).all()


def test_holds_for_120_s_is_120_s():
    run, verdict = verdicts(long="never(holds_for(not moving(astro), 20 s))")
    at = poses(run, "astro")
    still = np.append(True, np.hypot(np.diff(at["x"]), np.diff(at["y"])) == 0)

    expected = [step >= 20 and bool(still[step - 20 : step + 1].all()) for step in range(720)]
    assert (wrong(verdict["long"]) == np.array(expected)).all()


REFUSED = {
    "always(battery(astro) > 20)": "a share is a number from 0 to 1, or from 0 % to 100 %, such as 20 %",
    "never(during(22:00-22:00))": "22:00-22:00 has no length: write 00:00-24:00 for the whole day",
    "never(activity(ana) == slep)": "there is no activity of ana 'slep': did you mean 'sleep'?",
    "never(activity(ben) == sleep)": "there is no activity of ben 'sleep'",
    "never(events(called, astro, detail='find anna'))": "'find anna': did you mean 'find ana'?",
    "never(events(found, astro, detail=bob))": "'bob'",
    "never(events(activity, ana, detail=slep))": "did you mean 'sleep'?",
    "never(distance(astro, (400, 2)) < 1)": "(400, 2) m is outside the home, which reaches from (0, 0) to",
    "always(distance(astro, ana) > speed(ana))": "different units: m and m/s",
    "never(room(ana) == activity(ana))": "room and activity are compared, which are never the same",
    "never(room(astro) == bathrom)": "did you mean 'bathroom'",
    "always(moving(astro) + 1 > 2)": "can't be part of an expectation",
    "always(distance(nearest(astro), nearest(kitchen)) > 2)": "no user or robot 'kitchen'",
}


@pytest.mark.parametrize(("text", "message"), REFUSED.items())
def test_words_that_can_never_occur_are_refused(text, message):
    with pytest.raises((ScenarioError, InputError)) as caught:
        fleet2d.Simulation(home(expect={"wrong": text}))
    assert message in str(caught.value)


def test_a_script_may_not_wait_for_somebody_unknown():
    with pytest.raises(ScenarioError, match="'found' with the detail 'bob'"):
        fleet2d.Simulation(home(script=[{"on": ["found", "astro", "bob"], "replan": "astro"}]))
    with pytest.raises(ScenarioError, match="did you mean 'sleep'"):
        fleet2d.Simulation(home(script=[{"on": ["activity", "ana", "slep"], "replan": "astro"}]))


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
            "at_end(metric(sightings.ana) > 30)",
            'can\'t hold: metric("sightings.ana") is 0 to 1; write 0.3 for 30 %',
        ),
        (
            "at_end(metric(sightings.ana) < 10)",
            'always holds: metric("sightings.ana") is 0 to 1; write 0.1 for 10 %',
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
