"""Faults of robots and falls of people: what is lost, broken, carried off, dismissed, or lies."""

import numpy as np
import pytest
from tests.scenes import AGENDA, scenario, table

import fleet2d
from fleet2d.errors import ScenarioError

BATTERY = {"driving": "1 h", "standing": "2 h", "charging": "1 h", "charger": [0.5, 6.5]}


def home(*script, behaviors=None, **robot):
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


def poses(run, name="astro"):
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


def test_what_cannot_fail_or_lie_is_refused():
    with pytest.raises(ScenarioError, match="there is no user 'astro'"):
        home({"at": "07:05", "hold": "astro", "posture": "lie"})
    with pytest.raises(ScenarioError, match="has no battery"):
        home({"at": "07:05", "fault": "astro", "charger": True}, battery=None)
    with pytest.raises(ScenarioError, match="did you mean 'astro'"):
        home({"at": "07:05", "kidnap": "astr", "to": "kitchen"})


RELOCALIZES = {"relocalizes": "20 s"}
KIDNAP = {"at": "07:05", "kidnap": "astro", "to": "bathroom", "duration": "10 min"}


def place_events(simulation):
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
