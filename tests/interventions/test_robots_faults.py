"""Faults of robots and falls of people: what is lost, broken, carried off, dismissed, or lies."""

from typing import Any

import numpy as np
import pytest
from tests.scenes import AGENDA, scenario, table

import fleet2d
from fleet2d.errors import PlacementError, ScenarioError
from fleet2d.interventions import Dismiss, Fault, HoldStill, Kidnap

BATTERY = {"driving": "1 h", "standing": "2 h", "charging": "1 h", "charger": [0.5, 6.5]}


def home(*script: dict[str, Any], behaviors: Any = None, **robot: Any) -> fleet2d.Simulation:
    robot = {"camera": {"range": [0.3, 5], "angle_deg": 200}, "battery": BATTERY, **robot}
    robot["behaviors"] = behaviors or [{"type": "patrol", "dwell": "10 s"}]
    content = scenario(
        "30 min",
        users={"ana": {"type": "schedule", "days": AGENDA, "rest": "living_room"}},
        robots={"astro": robot},
        artifacts={"trajectories": "every step"},
        script=list(script),
    )
    return fleet2d.Simulation(content)


def poses(run: fleet2d.Run, name: str = "astro") -> Any:
    rows = table(run, "trajectories", entity=name)
    return np.stack([rows["x"], rows["y"]], axis=1)


@pytest.mark.parametrize(
    "act",
    [
        {"kidnap": "astro", "to": "bathroom", "duration": "2 min"},
        {"fault": "astro", "lost": True, "duration": "2 min"},
    ],
)
def test_a_robot_that_does_not_know_its_place_stands_until_it_does(act):
    run = home({"at": "07:05", **act}).run()
    xy = poses(run)
    moves = np.hypot(*np.diff(xy, axis=0).T) > 0

    assert not moves[301:419].any(), "it stands for two minutes"
    assert moves[420:480].any(), "and goes on"
    assert moves[240:299].any()
    jump = float(np.hypot(*(xy[301] - xy[299])))
    assert (jump > 1) == ("kidnap" in act)
    if "kidnap" in act:
        rooms = table(run, "trajectories", entity="astro")["room"].astype(str)
        assert "bathroom_1" == rooms[301]


def test_a_broken_charger_does_not_charge_until_it_is_repaired():
    behaviors = [{"type": "dock", "threshold": "60 %", "until": "90 %"}, {"type": "patrol"}]
    battery = {**BATTERY, "charge": 0.55}
    whole = home(behaviors=behaviors, battery=battery)
    broken = home(
        {"at": "07:03", "fault": "astro", "charger": True, "duration": "10 min"},
        behaviors=behaviors,
        battery=battery,
    )
    for simulation in (whole, broken):
        simulation.expect("always(battery(astro) > 55 %, within=8..12 min)", "charges")
        simulation.expect("eventually(battery(astro) > 60 %)", "at last")
        simulation.run()

    assert whole.verdicts()["charges"].holds
    assert not broken.verdicts()["charges"].holds
    assert broken.verdicts()["at last"].holds


@pytest.mark.parametrize("behavior", ["find", "follow", "come"])
def test_a_robot_that_is_dismissed_drops_what_it_was_called_to_do(behavior):
    first = {"type": behavior} | ({"user": "ana"} if behavior != "come" else {"stay": "20 min"})
    calls = {"find": {"find": "ana"}, "come": {"to": "kitchen"}}
    script = [{"at": "07:05", "put": "ana", "to": "storage"}] if behavior == "find" else []
    if behavior in calls:
        script.append({"at": "07:06", "call": "astro", **calls[behavior]})
    script.append({"at": "07:06:20", "dismiss": "astro"})
    simulation = home(
        *script, behaviors=[first, {"type": "patrol", "rooms": ["bedroom"], "dwell": "1 h"}]
    )
    simulation.run_until("07:06:19")
    was_busy = simulation.actors["astro"].behaviors[0].busy() or behavior == "come"
    simulation.run_until("07:06:21")

    if behavior != "follow":
        assert was_busy
    assert not simulation.actors["astro"].behaviors[0].busy()
    simulation.run_until("07:12")
    assert simulation.state["astro"]["room"] == "bedroom_1" or behavior == "follow"


def test_a_person_who_lies_down_is_lying():
    perception = {"detection": {"posture": {"lie": 0}}}
    fall = [{"at": "07:06", "put": "ana", "to": [1.0, 3.0]}, {"at": "07:06", "hold": "ana"}]
    lies = [fall[0], {**fall[1], "posture": "lie"}]
    near = {"at": "07:07", "put": "astro", "to": [2.0, 3.5]}
    seen = []
    for script in (fall, lies):
        simulation = home(
            *script,
            near,
            behaviors=[{"type": "patrol", "waypoints": [[2.0, 3.5]], "dwell": "1 min"}],
            perception=perception,
        )
        run = simulation.run()
        rows = table(run, "observations", robot="astro", user="ana")
        seen.append(int((rows["step"] > 480).sum()))

    assert seen[0] > 0, "who stands is seen"
    assert 0 == seen[1], "a detector that is blind to who lies doesn't see her"


def test_what_cannot_fail_or_lie_is_refused():
    with pytest.raises(ScenarioError, match="there is no user 'astro'"):
        home({"at": "07:05", "hold": "astro", "posture": "lie"})
    with pytest.raises(ScenarioError, match="has no battery"):
        home({"at": "07:05", "fault": "astro", "charger": True}, battery=None)
    with pytest.raises(ScenarioError, match="did you mean 'astro'"):
        home({"at": "07:05", "kidnap": "astr", "to": "kitchen"})


def test_methods_do_the_same_as_entries_of_a_script():
    acts = [
        {"kidnap": "astro", "to": "bathroom", "duration": "2 min"},
        {"hold": "ana", "posture": "lie", "duration": "1 min"},
        {"fault": "astro", "charger": True, "duration": "5 min"},
        {"dismiss": "astro"},
    ]
    scripted = home(*({"at": "07:05", **act} for act in acts)).run()
    simulation = home()
    simulation.run_until("07:05")
    simulation.do(Kidnap("astro", "bathroom", duration="2 min"))
    simulation.do(HoldStill("ana", posture="lie", duration="1 min"))
    simulation.do(Fault("astro", charger=True, duration="5 min"))
    simulation.do(Dismiss("astro"))
    by_hand = simulation.run()

    for name in ("trajectories", "observations", "events"):
        assert scripted.manifest["tables"][name] == by_hand.manifest["tables"][name]


RELOCALIZES = {"relocalizes": "20 s"}
KIDNAP = {"at": "07:05", "kidnap": "astro", "to": "bathroom", "duration": "10 min"}


def place_events(simulation: fleet2d.Simulation) -> list[tuple[int, str]]:
    """Return when a robot lost its place and found it: step, event."""
    rows = table(simulation.run(), "events", entity="astro")
    kinds = ("localization_lost", "relocalized")
    pairs = zip(rows["step"].tolist(), rows["event"].astype(str).tolist(), strict=True)
    return [(step, kind) for step, kind in pairs if kind in kinds]


@pytest.mark.parametrize("act", [KIDNAP, {"at": "07:05", "fault": "astro", "lost": True}])
def test_a_robot_localizes_again_by_sight_after_its_time(act):
    lost, found = (300, "localization_lost"), (320, "relocalized")
    assert [lost, found] == place_events(home(act, localization=RELOCALIZES))


def test_a_robot_that_cannot_localize_by_sight_is_lost_until_that_is_over():
    assert [300, 900] == [step for step, _ in place_events(home(KIDNAP))]


def test_a_robot_with_a_dark_camera_localizes_again_once_it_sees():
    dark = {"at": "07:04", "fault": "astro", "dark": True, "duration": "2 min"}
    steps = [step for step, _ in place_events(home(dark, KIDNAP, localization=RELOCALIZES))]
    assert [300, 360] == steps  # it tries at 320, 340 and 360


def test_a_script_can_tell_a_lost_robot_where_it_is():
    told = {"at": "07:06", "relocalize": "astro"}
    assert [300, 360] == [step for step, _ in place_events(home(KIDNAP, told))]


def test_a_kidnapped_robot_places_whom_it_sees_where_it_believes_to_be():
    """It is carried 2 m along x with its heading kept, so what it sees is perceived 2 m off."""
    content = scenario(
        users={"ana": {"type": "schedule", "days": [{"items": [{"at": "00:00", "place": [4.5, 2.0]}]}]}},
        robots={"astro": {"start": [1.0, 3.0], "start_heading_deg": 0, "camera": {"range": [0.1, 8], "angle_deg": 360}, "localization": {"relocalizes": "1 min"}}},
        script=[{"at": "07:02", "kidnap": "astro", "to": [3.0, 3.0], "duration": "5 min"}],
    )  # fmt: skip
    rows = table(fleet2d.run(content), "observations")
    off = (rows["x"] - rows["true_x"]).round(2)
    lost = (rows["step"] >= 120) & (rows["step"] < 180)
    assert {-2.0} == set(off[lost].tolist())
    assert {0.0} == set(off[~lost].tolist())


def test_localizing_again_is_reproduced_and_needs_a_camera(tmp_path):
    scene = home(KIDNAP, localization=RELOCALIZES).scenario
    fleet2d.run(scene, out=tmp_path / "run")
    assert fleet2d.reproduce(tmp_path / "run").same
    with pytest.raises(ScenarioError, match=r"localization\.relocalizes: it needs a camera"):
        home(localization=RELOCALIZES, camera=None)


def test_a_robot_keeps_out_of_rooms_until_it_may_enter_again():
    content = scenario(
        "1 h",
        robots={"astro": {"behaviors": [{"type": "patrol"}]}},
        artifacts={"trajectories": "1 s"},
        script=[{"at": "10 min", "keep_out": "astro", "of": "kitchen", "duration": "30 min"}],
    )
    run = fleet2d.run(content)
    rows, events = table(run, "trajectories"), table(run, "events")
    rooms = rows["room"][rows["entity"] == "astro"]
    told = {str(e): int(s) for s, e in zip(events["step"], events["event"], strict=True)}

    assert (600, 2400) == (told["banned"], told["allowed"])
    assert "kitchen_1" in set(rooms[:600])
    assert "kitchen_1" not in set(rooms[660:2400])
    assert "kitchen_1" in set(rooms[2400:])


def test_rooms_to_keep_out_of_are_checked():
    script = [{"at": "10 min", "keep_out": "astro", "of": "kitchn"}]
    with pytest.raises(PlacementError, match="no room 'kitchn': did you mean 'kitchen'"):
        fleet2d.run(scenario("1 h", robots={"astro": {}}, script=script))


@pytest.mark.parametrize("seed", range(4))
def test_a_robot_that_meanders_keeps_out_while_it_is_told_to(seed):
    content = scenario(
        "3 h",
        robots={"astro": {"behaviors": [{"type": "meander"}]}},
        artifacts={"trajectories": "1 s"},
        script=[{"at": "1 h", "keep_out": "astro", "of": "kitchen", "duration": "1 h"}],
    )
    run = fleet2d.run(content, seed=seed)
    rooms = table(run, "trajectories", entity="astro")["room"]

    assert "kitchen_1" in set(rooms[:3600]) | set(rooms[7200:])
    left = 3600 + int(np.argmax(rooms[3600:] != "kitchen_1"))
    assert left < 3700
    assert "kitchen_1" not in set(rooms[left:7200])
