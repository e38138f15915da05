"""What is done to people and robots by hand: where they are then, and what they do."""

from datetime import timedelta

import pytest
from tests.scenes import AGENDA, digests, scenario, table

import fleet2d
from fleet2d.errors import ScenarioError
from fleet2d.interventions import (
    Away,
    Call,
    CallHome,
    Fault,
    HoldStill,
    LetIn,
    LockDoor,
    Put,
    Release,
    Send,
    SetBattery,
    ShutDoor,
    SwitchOff,
    UnlockDoor,
)

BATTERY = {"driving": "2 h", "standing": "10 h", "charging": "1 h", "charger": "storage_spot"}
CHARGER = [0.5, 3.5]


def home(*script, **more):
    battery = {**BATTERY, "charger": CHARGER}
    behaviors = [
        {"type": "dock"},
        {"type": "come", "stay": "2 min"},
        {"type": "find"},
        {"type": "patrol", "dwell": "20 s"},
    ]
    return scenario(
        "1 h",
        users={
            "ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"},
            "gina": "guest",
        },
        robots={"astro": {"battery": battery, "behaviors": behaviors}},
        objects={"bath_door": {"type": "door", "doorway": "bathroom_1"}},
        script=list(script),
        **more,
    )


def simulation(*script):
    return fleet2d.Simulation(home(*script))


def room(run, name):
    return run.state[name]["room"]


def test_who_is_sent_goes_on_foot_stays_and_is_left_to_itself_in_the_end():
    run = simulation({"at": "1 min", "send": "ana", "to": "kitchen", "duration": "5 min"})
    run.advance(61)
    before = run.state["ana"]
    run.advance(1)
    after = run.state["ana"]
    assert abs(after["x"] - before["x"]) + abs(after["y"] - before["y"]) < 1.5
    run.advance(60)
    spot = run.state["ana"]
    assert "kitchen_1" == spot["room"]
    run.advance(200)
    assert spot == run.state["ana"]
    assert run.actors["ana"].order is not None
    run.advance(120)
    assert run.actors["ana"].order is None


def test_who_is_held_stands_still_and_is_released():
    run = simulation()
    run.advance(130)
    run.do(HoldStill("astro"))
    run.advance(1)
    spot = run.state["astro"]
    run.advance(600)
    assert spot == run.state["astro"]
    run.do(Release("astro"))
    run.advance(20)
    assert spot != run.state["astro"]


def test_who_is_sent_away_comes_home_when_called():
    run = simulation()
    run.advance(10)
    run.do(Away("ana"))
    run.advance(120)
    assert run.state["ana"]["away"]
    run.do(CallHome("ana", to="kitchen"))
    run.advance(120)
    assert "kitchen_1" == room(run, "ana")
    run.advance(2400)  # her agenda has her out from 07:30 on
    assert "kitchen_1" == room(run, "ana")


def test_an_activity_is_done_where_the_agenda_has_it_and_recorded():
    script = {"at": "10 min", "activity": "ana", "what": "wash", "duration": "5 min"}
    run = fleet2d.Simulation(home(script))
    run.advance(720)
    assert "bathroom_1" == room(run, "ana")
    events = table(run.run(), "events", entity="ana")
    done = events["step"][(events["event"] == "activity") & (events["detail"] == "wash")]
    assert any(600 <= step < 700 for step in done)


def test_a_guest_comes_stays_and_leaves():
    script = {"at": "10 min", "guest": "gina", "to": "kitchen", "duration": "5 min"}
    run = simulation(script)
    run.advance(600)
    assert run.state["gina"]["away"]
    run.advance(120)
    assert "kitchen_1" == room(run, "gina")
    run.advance(420)
    assert run.state["gina"]["away"]
    with pytest.raises(ScenarioError, match="ana is not a guest"):
        run.do(LetIn("ana"))


def test_a_robot_docks_when_called_and_finds_whom_it_is_called_to_find():
    run = simulation()
    run.do(Put("ana", "bedroom"))
    run.do(HoldStill("ana"))
    run.advance(120)
    run.do(Call("astro", find="ana"))
    result = run.run_until(event="found", entity="astro", timeout="10 min")
    assert result is not None
    assert "ana" == result.detail
    run.do(SetBattery("astro", "50 %"))
    run.do(Call("astro", dock=True))
    assert run.run_until(event="docks", timeout="5 min") is not None
    assert run.run_until(event="charged", timeout="40 min") is not None


def test_stuck_wheels_hold_a_robot_whatever_it_is_called_to_do():
    run = simulation()
    run.advance(130)
    run.do(Fault("astro", wheels=True, duration="10 min"))
    run.do(Call("astro", to="bedroom"))
    run.advance(1)
    spot = run.state["astro"]
    run.advance(598)
    assert spot == run.state["astro"]
    run.advance(120)
    assert "bedroom_1" == room(run, "astro")  # the call still waited


def test_a_behavior_that_is_switched_off_is_not_asked():
    run = simulation()
    run.advance(200)
    run.do(SwitchOff("astro", behavior="patrol", duration="10 min"))
    run.advance(1)
    spot = run.state["astro"]
    run.advance(590)
    assert spot == run.state["astro"]
    run.advance(200)
    assert spot != run.state["astro"]


def test_who_is_sent_behind_a_locked_door_waits_until_it_is_open():
    run = simulation()
    run.do(Put("ana", "kitchen"))
    run.do(ShutDoor("bath_door"))
    run.do(LockDoor("bath_door"))
    run.advance(60)
    run.do(Send("ana", "bathroom"))
    run.advance(120)
    assert "bathroom_1" != room(run, "ana")
    run.do(UnlockDoor("bath_door"))
    run.advance(120)
    assert "bathroom_1" == room(run, "ana")
    assert any(event.event == "way_blocked" for event in run.events())


MANY = (
    {"at": "2 min", "send": "ana", "to": "kitchen", "duration": "5 min"},
    {"at": "3 min", "call": "astro", "to": "bedroom"},
    {"at": "10 min", "guest": "gina", "duration": "10 min"},
    {"at": "15 min", "fault": "astro", "wheels": True, "duration": "90 s"},
    {"at": "20 min", "switch_off": "astro", "behavior": "patrol", "duration": "5 min"},
    {"at": "22 min", "call": "astro", "find": "ana"},
    {"at": "30 min", "battery": "astro", "charge": 0.15},
    {"at": "40 min", "put": "astro", "to": "bathroom"},
    {"at": "41 min", "call": "astro", "dock": True},
)


def test_spans_are_invisible():
    runs = [fleet2d.run(home(*MANY), max_span=span) for span in (None, 1, 7)]
    assert digests(runs[0]) == digests(runs[1]) == digests(runs[2])
    assert len(MANY) == len(runs[0].manifest["interventions"])
    assert timedelta(hours=1).total_seconds() == runs[0].manifest["steps"]
