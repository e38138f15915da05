"""Expectations in whole runs, against what the tables of the run say step by step."""

import json
from functools import cache

import numpy as np
import pytest
import shapely
from tests.scenes import AGENDA, OWN, digests, run, scenario, table
from tests.thorough import some

import fleet2d
from fleet2d.errors import InputError, RunDirectoryError, ScenarioError
from fleet2d.expectations import always, distance, moving

STEPS = 12 * 60
EXPECTED = {
    "keeps_off": "always(distance(ana, astro) > 1.5 m)",
    "kitchen": "never(distance(astro, kitchen) < 0.5)",
    "point": "always(distance(ben, [1.0, 3.0]) >= 2)",
    "room": "never(room(astro) == bathroom)",
    "rooms": "always(room(ben) in [living_room, kitchen])",
    "still": "never(moving(astro))",
    "speed": "always(speed(ana) < 0.5)",
    "home": "never(away(ana))",
    "seen": "never(seen(ben, by=astro))",
    "perceived": "never(perceived(ben, by=astro))",
    "in_view": "never(in_view(ben, by=astro))",
    "washes": "never(activity(ana) == wash)",
    "shut": "never(door(bath))",
    "contact": "never(sensor(contact))",
    "few": "at_most(1, events(user_seen, astro), per=hour)",
    "early": "never(during(07:00-07:05) and moving(astro))",
    "long": "never(holds_for(not moving(astro), 20 s))",
    "share": "always(output(share.kitchen) < 0.3)",
    "ends": "at_end(metric(distance.ben) > 1)",
}


def home(**changes):
    return scenario(
        "12 min",
        users={
            "ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"},
            "ben": {"type": "meander", "speed": 0.7},
        },
        robots={
            "astro": {
                "type": "patrol",
                "dwell": "30 s",
                "camera": {"range": [0.2, 4], "angle_deg": 120, "detection": 0.7},
                "battery": {"driving": "2 h", "standing": "4 h", "charging": "1 h", "charger": [0.5, 6.5]},
            }
        },
        objects={
            "bath": {"type": "door", "doorway": "bathroom_1", "open": False, "closes_after": "5 s"},
            "contact": {"type": "contact_sensor", "of": "bath"},
        },
        algorithms={"share": {"type": f"{OWN}:Share", "period": "2 min"}},
        metrics={"distance": {"period": "5 min"}},
        artifacts={"trajectories": "every step"},
        expect=EXPECTED,
    ) | changes  # fmt: skip


@cache
def finished(max_span):
    simulation = fleet2d.Simulation(home(), max_span=max_span)
    return simulation.run(), simulation.verdicts()


def violations(name):
    return [(v.first, v.last) for v in finished(None)[1][name].violations]


def body(name):
    return table(finished(None)[0], "trajectories", entity=name)


def switched(rows, column, word):
    """From the step of each row on, whether it has a word in a column."""
    state = np.zeros(STEPS, bool)
    for step, value in zip(rows["step"].tolist(), rows[column], strict=True):
        state[step:] = value == word
    return state


@cache
def violated():
    """At which steps each expectation should be violated, by the tables."""
    run = finished(None)[0]
    ana, ben, astro = (body(name) for name in ("ana", "ben", "astro"))
    steps = np.arange(STEPS)
    way = {
        name: np.nan_to_num(np.hypot(*np.diff([at["x"], at["y"]], prepend=np.nan)))
        for name, at in (("ana", ana), ("astro", astro))
    }
    rooms = {name: body(name)["room"].astype(str) for name in ("ben", "astro")}
    rests = np.array([way["astro"][max(0, k - 20) : k + 1].max() == 0 for k in steps])
    doors = table(run, "events", entity="bath")
    seen = table(run, "events", entity="astro", user="ben")
    perceived = table(run, "observations", robot="astro", user="ben")["step"]
    share = table(run, "share", room="kitchen_1")
    below = np.zeros(STEPS, bool)  # a missing value is not
    for step, value in zip(share["step"].tolist(), share["share"].tolist(), strict=True):
        below[step + 1 :] = value < 0.3
    return {
        "keeps_off": np.hypot(ana["x"] - astro["x"], ana["y"] - astro["y"]) <= 1.5,
        "kitchen": to_kitchen(astro["x"], astro["y"]) < 0.5 - 1e-9,
        "point": np.hypot(ben["x"] - 1, ben["y"] - 3) < 2,
        "room": rooms["astro"] == "bathroom_1",
        "rooms": ~np.isin(rooms["ben"], ["living_room_1", "kitchen_1"]),
        "still": way["astro"] > 0,
        "speed": way["ana"] >= 0.5,
        "home": ana["away"],
        "early": (way["astro"] > 0) & (steps < 300),
        "long": rests & (steps >= 20),
        "seen": switched(seen, "event", "user_seen"),
        "perceived": np.isin(steps, perceived),
        "shut": switched(doors, "event", "opened"),
        "contact": switched(table(run, "sensors", sensor="contact"), "state", "OPEN"),
        "washes": switched(table(run, "events", entity="ana", event="activity"), "detail", "wash"),
        "share": ~below,
    }


def to_kitchen(x, y):
    """How far places are from the cells of the kitchen."""
    plan = finished(None)[0].plan
    cells = np.argwhere(plan.room_of_place == plan.room("kitchen_1").index)[:, ::-1]
    low = np.array(plan.lattice.origin) + plan.lattice.cell * cells
    boxes = shapely.box(*low.T, *(low + plan.lattice.cell).T)
    return shapely.distance(shapely.union_all(boxes), shapely.points(x, y))


def marked(name):
    """At which steps an expectation is violated."""
    result = np.zeros(STEPS, bool)
    for first, last in violations(name):
        result[first : last + 1] = True
    return result


@pytest.mark.parametrize("name", sorted(EXPECTED.keys() - {"in_view", "few", "ends"}))
def test_an_expectation_is_violated_where_the_tables_say_so(name):
    assert (marked(name) == violated()[name]).all()
    assert violated()[name].any() or name in ("home", "room")


def test_verdicts_say_how_far_off_they_are():
    ana, astro = body("ana"), body("astro")
    nearest = np.nanmin(np.hypot(ana["x"] - astro["x"], ana["y"] - astro["y"]))
    assert float(nearest) - 1.5 == pytest.approx(finished(None)[1]["keeps_off"].robustness)


def test_who_is_perceived_is_in_view_and_seven_of_ten_in_view_are_perceived():
    in_view, perceived = marked("in_view"), marked("perceived")
    assert (in_view | ~perceived).all()
    assert 0.5 < perceived.sum() / in_view.sum() < 0.9


def test_a_count_is_exceeded_from_the_next_event_on():
    steps = table(finished(None)[0], "events", entity="astro", event="user_seen")["step"].tolist()

    assert [(steps[1], STEPS - 1)] == violations("few")
    assert 1.0 - len(steps) == finished(None)[1]["few"].robustness


@pytest.mark.parametrize("max_span", some([7, 1], 2))
def test_spans_are_invisible(max_span):
    (whole, verdicts), (cut, again) = finished(None), finished(max_span)

    assert digests(whole) == digests(cut)
    assert whole.manifest["expectations"] == cut.manifest["expectations"]
    assert verdicts == again


def test_the_table_and_the_manifest_say_what_was_violated():
    stored, verdicts = finished(None)
    rows = table(stored, "violations", expectation="keeps_off")

    assert violations("keeps_off") == list(
        zip(rows["step"].tolist(), rows["last_step"].tolist(), strict=True)
    )
    content = stored.manifest["expectations"]["keeps_off"]
    assert (content["holds"], content["violations"]) == (False, len(violations("keeps_off")))
    assert str(verdicts["keeps_off"]) == content["says"]
    assert "keeps_off is violated: always(distance" in content["says"]
    assert stored.metrics["distance"]["ben"] - 1 == verdicts["ends"].robustness, "at its end"


def test_a_run_that_expects_nothing_stores_nothing_of_it():
    expecting, plain = digests(finished(None)[0]), digests(run(home(expect={})))

    assert expecting.keys() - plain.keys() == {"violations"}
    assert all(plain[name] == expecting[name] for name in plain if name != "run")


def test_a_run_is_reproduced_with_what_python_expected_of_it(tmp_path):
    """Its manifest was called damaged where `holds` was null: nothing was put to the test."""
    waits = "after(speed(astro) > 50, moving(astro), within=1 min)"
    simulation = fleet2d.Simulation(home(expect={"waits": waits}), out=tmp_path / "run")
    simulation.advance(100)
    assert not simulation.verdicts()["waits"].decided
    simulation.expect(always(distance("ana", "astro") > 2), "farther")
    expectations = simulation.run().manifest["expectations"]

    assert expectations["farther"]["first"] == 100
    assert expectations["farther"]["holds"] is False
    assert expectations["waits"]["holds"] is None
    assert "waits is untested" in expectations["waits"]["says"]
    assert fleet2d.reproduce(tmp_path / "run").same


def test_an_expectation_in_mid_run_begins_with_what_is_so_then():
    later = fleet2d.Simulation(home(expect={}))
    later.advance(200)
    for name, text in EXPECTED.items():
        if name not in ("few", "long", "share", "ends", "speed", "still"):
            later.expect(text, name)
    later.run()

    for name, verdict in later.verdicts().items():
        clipped = [(max(a, 200), b) for a, b in violations(name) if b >= 200]
        assert clipped == [(v.first, v.last) for v in verdict.violations], name


def test_a_finished_run_is_judged_by_running_it_again():
    stored, verdicts = finished(None)
    verdict = fleet2d.judge(always(distance("ana", "astro") > 1.5), stored, "keeps_off")

    assert verdicts["keeps_off"] == verdict
    broken = fleet2d.Simulation(home())
    broken.advance(10)
    with pytest.raises(InputError, match="was added after the last step"):
        fleet2d.judge(always(moving("ana")), broken)
    with pytest.raises(RunDirectoryError, match="only a complete run"):
        fleet2d.judge(always(moving("ana")), broken.finish())


WRONG = {
    "always(distance(an, astro) > 1)": "no user or robot 'an': did you mean 'ana'",
    "always(distance(kitchen, ana) > 1)": "name the body first",
    "always(distance(ana, kitchn) > 1)": "did you mean 'kitchen'",
    "never(room(ana) == bathrom)": "did you mean 'bathroom'",
    "never(events(dock))": "did you mean 'docks'",
    "never(events(docks, astro))": "'docks' happens only to robots with the behavior dock or policy (here: none)",
    "never(events(user_seen, ben))": "no such event is possible",
    "never(seen(astro, by=ben))": "no robot or user with a camera 'ben'",
    "never(door(bth))": "no door 'bth': did you mean 'bath'",
    "never(sensor(contct))": "did you mean 'contact'",
    "always(output(shre.kitchen) > 0)": "no algorithm 'shre': did you mean 'share'",
    "at_end(metric(distanc.ana) > 0)": "no metric 'distanc': did you mean 'distance'",
    "never(battery(ana) < 10 %)": "no robot with a battery 'ana'",
    "eventually(moving(ana), within=2 h)": "2 h is beyond the run, which goes on for 12 min",
    "alway(moving(ana))": "no 'alway': did you mean 'always'",
    "moving(ana)": "has no time operator",
    "always(distance(ana, astro))": "compare it",
    "always(moving(ana)": "can't be read",
    "never(during(25:00-26:00))": "a time of day up to 24:00",
    "always(__import__(os))": "there is no '__import__'",
}


@pytest.mark.parametrize(("text", "message"), WRONG.items())
def test_wrong_expectations_are_refused_with_their_line(text, message, tmp_path):
    (tmp_path / "base.yaml").write_text(json.dumps(home(expect={})))
    lines = ["extends: base.yaml", "expect:", f"  wrong: {json.dumps(text)}"]
    (tmp_path / "home.yaml").write_text("\n".join(lines))
    with pytest.raises(ScenarioError, match=r"home\.yaml:3: ") as caught:
        fleet2d.Simulation(tmp_path / "home.yaml")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("wrong", "example"),
    [
        ({"always": "moving(ana)"}, "expected two lines, such as `that: always"),
        (["moving(ana)"], "expected an expectation like always"),
        (3, "expected an expectation like always"),
        (True, "expected an expectation like always"),
    ],
)
def test_what_is_no_text_is_refused_with_an_example(wrong, example):
    with pytest.raises(ScenarioError, match=rf"expect\.wrong: {example}"):
        fleet2d.Simulation(home(expect={"wrong": wrong}))


@pytest.mark.parametrize("takes_the_guest_for_her", [True, False])
def test_who_is_found_is_told_apart_from_whom_the_robot_believes_to_have_found(
    takes_the_guest_for_her,
):
    taken = {"taken_for": {"users": {"gina": {"rate": 1, "others": {"ana": 1}}}}}
    still = {
        name: {
            "type": "schedule",
            "rest": room,
            "days": [{"items": [{"at": "00:00", "place": room}]}],
        }
        for name, room in (("ana", "bathroom"), ("gina", "living_room"))
    }
    content = scenario(
        "10 min",
        users=still,
        robots={
            "astro": {
                "behaviors": [{"type": "find", "user": "ana"}],
                "camera": {"range": [0.2, 6], "angle_deg": 300},
                "perception": {"errors": taken if takes_the_guest_for_her else {}},
            }
        },
        script=[{"at": "1 min", "call": "astro", "find": "ana"}],
        expect={
            "believes": "eventually(events(found, astro, detail=ana))",
            "finds": "eventually(found(ana, by=astro))",
            "is_there": "after(events(found, astro), in_view(ana, by=astro))",
        },
    )
    said = {name: v["holds"] for name, v in fleet2d.run(content).manifest["expectations"].items()}
    is_true = not takes_the_guest_for_her
    assert {"believes": True, "finds": is_true, "is_there": is_true} == said


def test_who_is_seen_as_a_robot_turns_past_counts_as_found():
    people = {"ana": {"type": "routine", "persona": "works_outside"}}
    find = {"type": "find", "user": "ana", "every": "20 min"}
    content = scenario(
        "5 h",
        users=people,
        robots={"astro": {"behaviors": [find, {"type": "patrol", "dwell": "2 min"}]}},
        expect={"finds": "after(events(found, astro), found(ana, by=astro))"},
    )
    run = fleet2d.run(content, "simulation.start=2026-01-05T17:00")
    assert run.manifest["expectations"]["finds"]["holds"]
