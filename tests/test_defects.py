"""Defects that a check from outside found: each has a test that is named after it."""

from datetime import timedelta
from itertools import pairwise

import numpy as np
import pytest
from tests.algorithms.presence.worlds import evidence_of
from tests.entities.robots.robots import events, home_with
from tests.scenes import path, run, scenario, table
from typer.testing import CliRunner

import fleet2d
from fleet2d.algorithms.evidence import Evidence
from fleet2d.algorithms.presence.estimator import SightingShare
from fleet2d.cli.__main__ import app
from fleet2d.engine.simulation import Simulation
from fleet2d.entities.giving_way import WaitForPeople
from fleet2d.entities.plan import Plan
from fleet2d.errors import ArtifactError, ComponentError, InputError


def test_room_sampling_logs_no_return_that_did_not_happen():
    shares = {"living_room": 1, "away": 3}
    ana = {"type": "room_sampling", "shares": shares, "dwell": "20 min"}
    stored = run(scenario("5 d", users={"ana": ana}))
    rows = table(stored, "events", entity="ana")
    told = [e for e in rows["event"].tolist() if e in ("left_home", "came_home")]
    poses = path(stored, "ana")
    returns = int(((poses.away[:-1] == 1) & (poses.away[1:] == 0)).sum())
    assert returns == told.count("came_home")
    assert all(a != b for a, b in pairwise(told))


@pytest.mark.parametrize(("step", "good"), [("2 s", False), ("1 s", True), ("2.5 s", True)])
def test_lost_after_that_is_no_multiple_of_the_step_is_refused(step, good):
    content = home_with([{"type": "patrol"}], astro={"camera": {"lost_after": "5 s"}})
    content["simulation"]["step"] = step
    if good:
        Simulation(content)
        return
    with pytest.raises(InputError, match=r"lost_after is 5 s.*it would act as 6 s"):
        Simulation(content)


def test_lost_after_left_out_goes_with_every_step():
    content = home_with([{"type": "patrol"}], astro={"camera": {}})
    content["simulation"]["step"] = "2 s"
    Simulation(content)


def test_find_keeps_its_distance_from_who_is_already_near():
    """It looked round, saw the user 0.7 m off, and stayed there for as long as it stays."""
    sits = {"type": "schedule", "days": [{"items": [{"at": "00:00", "place": [1.7, 3.0]}]}]}
    find = {"type": "find", "user": "ana", "every": "5 min", "distance": "1.2 m", "stay": "4 min"}
    content = home_with([find], "20 min", sits, astro={"gives_way": {"distance": "50 cm"}})
    stored = run(content)
    assert "found" in {name for _, name, _ in events(stored)}
    found = next(step for step, name, _ in events(stored) if name == "found")
    robot, ana = path(stored, "astro"), path(stored, "ana")
    apart = np.hypot(robot.x - ana.x, robot.y - ana.y)[found + 10 : found + 200]
    assert apart.min() >= 1.19


def test_show_of_a_run_does_not_ignore_step(tmp_path):
    fleet2d.run(scenario("1 min", users={"ana": {"type": "meander"}}), out=tmp_path / "run")
    result = CliRunner().invoke(app, ["show", str(tmp_path / "run"), "--step", "3"])
    assert isinstance(result.exception, InputError)
    assert "--step needs --layer" in str(result.exception)
    assert not (tmp_path / "run" / "picture.png").exists()


def test_show_of_a_run_that_is_not_there_speaks_of_runs():
    result = CliRunner().invoke(app, ["show", "runs/nothing"])
    assert isinstance(result.exception, InputError)
    assert "runs/nothing" in str(result.exception)
    assert "directory of a run" in str(result.exception)
    assert "floorplan.path" not in str(result.exception)


def test_path_every_wants_a_timedelta():
    stored = run(scenario("1 min", users={"ana": {"type": "meander"}}))
    assert 6 == len(stored.path("ana", every=timedelta(seconds=10)).step)
    with pytest.raises(ArtifactError, match=r"every: 1 has no unit"):
        stored.path("ana", every=1)


def test_sums_of_a_wrong_width_name_the_line_of_the_user():
    class Own(SightingShare):
        def sums(self, evidence: Evidence):
            return np.zeros((len(evidence), self.users + 1, 1))

    own = Own()
    own.begin(rooms=3, users=2)
    evidence = evidence_of(np.zeros((1, 3)), np.zeros((1, 3, 3), np.int64))
    with pytest.raises(ComponentError, match=r"Own\.sums returned .*test_defects\.py:\d+, in sums"):
        own.observe(evidence)


def test_shutting_a_doorway_without_a_door_says_how_to_hang_one():
    content = {**scenario("1 min"), "floorplan": {"type": "bundled"}}
    content["script"] = [{"at": "10 s", "shut": "bathroom_1"}]
    with pytest.raises(InputError, match=r"objects: \{bathroom_1: \{type: door, doorway: bed"):
        Simulation(content)


def test_two_people_who_react_and_a_robot_that_gives_way_take_no_minutes(monkeypatch):
    """15 s for two days: each reaction planned the rest of the day anew, each look of the robot."""
    work = {"legs": 0, "looks": 0}

    def counted(owner: type, method, name):
        original = getattr(owner, method)

        def counting(*args, **more):
            work[name] += 1
            return original(*args, **more)

        monkeypatch.setattr(owner, method, counting)

    counted(Plan, "go_to_point", "legs")
    counted(WaitForPeople, "continued", "looks")
    people = {"ana": "retired", "ben": "works_from_home"}
    users = {
        name: {"behaviors": [{"type": "reactions"}, {"type": "routine", "persona": persona}]}
        for name, persona in people.items()
    }
    robot = {"camera": {}, "gives_way": {}, "behaviors": [{"type": "patrol", "dwell": "1 min"}]}
    content = scenario("6 h", users=users, robots={"astro": robot}, simulation={"seed": 3})
    stored = fleet2d.run(content)
    assert len(table(stored, "events", event="reacts")["step"]) > 20
    assert len(table(stored, "events", event="gives_way")["step"]) > 20
    assert work["legs"] < 1500
    assert work["looks"] < 300
