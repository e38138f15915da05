"""Scripts in a run: when each entry is done, and that nothing else changes."""

import copy

import pytest
from tests.scenes import AGENDA, digests, entries, scenario, table

import fleet2d
from fleet2d.errors import ScenarioError
from fleet2d.interventions import HoldStill

DOOR = {"bath_door": {"type": "door", "doorway": "bathroom_1"}}
SENSOR = {"contact": {"type": "contact_sensor", "of": "bath_door"}}


def home(script, duration="1 h", **more):
    """A person with an agenda, one who walks about, and a robot that can be called."""
    behaviors = [{"type": "come", "stay": "2 min"}, {"type": "find"}, {"type": "patrol"}]
    return scenario(
        duration,
        users={
            "ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"},
            "ben": {"type": "meander", "speed": 0.7},
        },
        robots={"astro": {"behaviors": behaviors, "camera": {"detection": 0.8}}},
        objects=DOOR | SENSOR,
        script=script,
        **more,
    )


LIVELY = entries(
    """
    at: 5 min, put: ben, to: bedroom
    at: 5 min, send: ben, to: living_room, duration: 3 min
    at: 10 min, call: astro, find: ana
    on: [found, astro], delay: 3 s, call: astro, to: kitchen
    on: [user_seen, astro], each: true, delay: 1 s, shut: bath_door
    on: [sensor, contact, CLOSE], each: true, delay: 20 s, open: bath_door
    on: [activity, ana], hold: ben, duration: 40 s
    at: daily 07:40, each: true, away: ben, duration: 5 min
    """
)


def acts(run):
    return [(act["step"], act["do"], act["by"]) for act in run.manifest["interventions"]]


@pytest.fixture(scope="module")
def lively():
    return fleet2d.run(home(LIVELY))


def test_each_entry_is_done_at_its_step(lively):
    done = acts(lively)
    assert (300, "put", "script.0") in done
    assert done.index((300, "put", "script.0")) + 1 == done.index((300, "send", "script.1"))
    assert (600, "call", "script.2") in done
    assert (2400, "away", "script.7") in done
    events = table(lively, "events")
    rows = list(zip(events["step"], events["entity"], events["event"], strict=True))
    first_found = next(step for step, _, event in rows if event == "found")
    assert [first_found + 3] == [step for step, _, by in done if by == "script.3"]
    first_activity = next(step for step, who, event in rows if (who, event) == ("ana", "activity"))
    assert [first_activity + 1] == [step for step, _, by in done if by == "script.6"]
    seen = sorted({step + 1 for step, _, event in rows if event == "user_seen"})
    assert seen == [step for step, _, by in done if by == "script.4"]
    readings = table(lively, "sensors")
    closed = readings["step"][readings["state"] == "CLOSE"] + 20
    assert closed.tolist() == [step for step, _, by in done if by == "script.5"]


@pytest.mark.slow
@pytest.mark.parametrize("max_span", [1, 7])
def test_spans_are_invisible(lively, max_span):
    again = fleet2d.run(home(LIVELY), max_span=max_span)
    assert digests(lively) == digests(again)
    assert lively.manifest["interventions"] == again.manifest["interventions"]


def test_a_run_with_a_script_and_somebody_outside_is_reproduced(tmp_path):
    run = fleet2d.Simulation(home(LIVELY), out=tmp_path / "run")
    run.advance(305)
    run.do(HoldStill("astro", duration="1 min"))
    run.do({"on": ["user_lost", "astro"], "delay": "2 s", "put": "astro", "to": "bedroom"})
    run.do({"at": "07:30", "shut": "bath_door"})
    run.run()
    assert fleet2d.reproduce(tmp_path / "run").same


@pytest.mark.parametrize("way", ["copy", "save", "resume"])
def test_copies_and_runs_that_go_on_keep_what_a_script_still_waits_for(lively, way, tmp_path):
    run = fleet2d.Simulation(home(LIVELY), out=tmp_path / "run" if way == "resume" else None)
    run.advance(500)
    if way == "copy":
        done = copy.deepcopy(run).run()
    elif way == "save":
        run.save(tmp_path / "state")
        done = fleet2d.Simulation.load(tmp_path / "state").run()
    else:
        run.finish()
        done = fleet2d.resume(tmp_path / "run")
    assert lively.digest == done.digest
    assert lively.manifest["interventions"] == done.manifest["interventions"]


def test_an_entry_on_an_event_is_done_once_unless_each_time_is_wanted():
    script = "on: user_seen, replan: ben\non: user_seen, each: true, replan: ben"
    done = acts(fleet2d.run(home(entries(script))))
    assert 1 == sum(by == "script.0" for _, _, by in done)
    assert 1 < sum(by == "script.1" for _, _, by in done)


def test_a_scenario_without_a_script_waits_for_nothing():
    run = fleet2d.Simulation(home([]))
    interventions = run._state.interventions
    assert interventions.next_due() is None
    assert interventions not in run._state.events.sinks
    assert frozenset() == run._state.awaited


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("at: 19:00, hold: ana", "at: 19:00 is not within the run"),
        ("at: 1 h, hold: ana", "not within the run"),
        ("at: 2026-01-05T06:59:59, hold: ana", "not within the run"),
        ("at: tuesday 07:30, hold: ana", "not within the run"),
        ("at: 5 s, hold: anna", "'anna': did you mean 'ana'"),
        ("at: 5 s, away: astro", "no user 'astro'"),
        ("at: 5 s, call: ana, dock: true", "no robot 'ana'"),
        ("at: 5 s, put: ana, to: kitchn", "did you mean 'kitchen'"),
        ("at: 5 s, send: ana, to: storage", "can't be reached"),
        ("at: 5 s, send: ana, to: [50, 50]", "is in a wall"),
        ("at: 5 s, activity: ana, what: breakfst", "did you mean 'breakfast'"),
        ("at: 5 s, call: astro, dock: true", "none of the behaviors of astro answers"),
        ("at: 5 s, shut: bat_door", "did you mean 'bath_door'"),
        ("at: 5 s, room: kitchen_1, type: bedrom", "did you mean 'bedroom'"),
        ("on: user_sen, hold: ana", "did you mean 'user_seen'"),
        ("on: [user_seen, asto], hold: ana", "did you mean 'astro'"),
        ("on: [user_seen, astro, bens], hold: ana", "did you mean 'ben'"),
        ("on: [found, astro, bob], hold: ana", "'found' with the detail 'bob'"),
        ("on: [activity, ana, slep], hold: ana", "did you mean 'sleep'"),
        ("on: [docks, astro], hold: ana", "'docks' can never happen to astro"),
        ("on: robot_seen, hold: ana", "'robot_seen' can never happen in this run"),
        ("on: [shut, contact], hold: ana", "can never happen to contact"),
    ],
)
def test_what_can_not_be_is_refused_before_the_run(entry, words):
    with pytest.raises((ScenarioError, fleet2d.InputError), match=rf"script\.1: .*{words}"):
        fleet2d.Simulation(home(entries(f"at: 1 s, hold: ben\n{entry}")))


def test_a_wrong_entry_is_named_by_its_line(tmp_path):
    file = tmp_path / "home.yaml"
    file.write_text(
        "extends: bundled:paper\n"
        "simulation: {duration: 1 h}\n"
        "script:\n"
        "  - {at: 5 min, hold: ana}\n"
        "  - at: 6 min\n"
        "    hold: anna\n"
    )
    with pytest.raises(ScenarioError, match=r"home\.yaml:5: script\.1: .*did you mean 'ana'"):
        fleet2d.Simulation(file)
