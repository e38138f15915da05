"""Branches: a run is continued otherwise from a moment, beside itself, as an ordinary stored run."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from starlette.testclient import TestClient

import fleet2d
from fleet2d.errors import ArtifactError, InputError
from fleet2d.viewing.contract import BRANCH_ORDER, BranchOrder, LiveOrder, read_body
from fleet2d.viewing.live import LiveRun
from fleet2d.viewing.live_runs import LiveRuns, free_directory
from fleet2d.viewing.page_server import page_app
from fleet2d.viewing.served_runs import ServedRuns

AT = 4 * 3600


@pytest.fixture
def parent(run_dir, tmp_path):
    return Path(shutil.copytree(run_dir, tmp_path / "day"))


@pytest.fixture
def served(parent):
    return ServedRuns([parent])


@pytest.fixture
def lives(served):
    lives = LiveRuns(served)
    yield lives
    lives.end_branches()


def order(action, target="", value=0, **more):
    blank = {"x": 0.0, "y": 0.0, "key": "", "text": ""}
    return LiveOrder(**{**blank, "action": action, "target": target, "value": value, **more})  # type: ignore[typeddict-item]


@pytest.mark.slow
def test_branch_has_the_past_of_its_run_and_a_future_of_its_own(lives, served, parent):
    session = lives.branch(BranchOrder(of="run/0", step=AT))
    assert ("live/0", "day-branch-1", "run/0", AT) == tuple(session.values())
    live = lives._live(0)
    assert AT == live.engine.simulation.step
    assert "" == live.submit(order("configure", "astro", key="hangout.tau", text="10 min"))
    assert "" == live.submit(order("door", "bath_door", value=0))
    assert "" == live.submit(order("resume"))
    live.wait()
    branch = served.data(1).run
    assert (branch.status, branch.directory) == ("complete", parent.parent / "day-branch-1")
    done = [(entry["do"], entry["step"]) for entry in branch.manifest["interventions"]]
    assert [("configure", AT), ("shut", AT)] == done
    for name in ("ana", "astro"):
        now, then = branch.path(name), fleet2d.open_run(parent).path(name)
        assert np.array_equal(now.x[: AT // 60 + 1], then.x[: AT // 60 + 1])
    assert [] == lives.sessions()
    assert "is over" in live.submit(order("replan", "astro"))
    assert fleet2d.reproduce(branch.directory).same


def test_branch_of_a_running_simulation_keeps_its_interventions(served):
    first = LiveRun(
        fleet2d.Simulation("bundled:paper", "simulation.duration=2 h", seed=4), paused=True
    )
    lives = LiveRuns(served, first)
    first.start()
    first.submit(order("step", value=600))
    first.submit(order("replan", "astro"))
    first.submit(order("step", value=600))
    with pytest.raises(InputError, match="step 1300 is not simulated yet: the run is at 1200"):
        lives.branch(BranchOrder(of="live/0", step=1300))
    lives.branch(BranchOrder(of="live/0", step=1200))
    twin = lives._live(1)
    assert first.engine.bodies() == twin.engine.bodies()
    first.end()
    twins = lives.end_branches()
    assert first.run is not None
    assert [first.run.manifest["interventions"]] == [run.manifest["interventions"] for run in twins]


def test_run_that_cannot_be_repeated_has_no_branch(parent, lives):
    manifest = json.loads((parent / "manifest.json").read_text())
    manifest["scenario"]["simulation"]["seed"] += 1
    (parent / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(ArtifactError, match="would be elsewhere than it was"):
        lives.branch(BranchOrder(of="run/0", step=AT))
    assert [] == lives.sessions()


@pytest.mark.parametrize(
    ("of", "step", "words"),
    [
        ("run/7", 3, "there is no run 7"),
        ("live/7", 3, "no running simulation 7"),
        ("run/0", 9 * 3600, "its last is 32399"),
        ("run/0", -1, "can't be continued from step -1"),
        ("../etc", 3, "no running simulation"),
    ],
)
def test_impossible_branch_is_refused_with_a_reason(lives, parent, of, step, words):
    with pytest.raises((InputError, ArtifactError), match=words):
        lives.branch(BranchOrder(of=of, step=step))
    assert [parent] == list(parent.parent.iterdir())


@pytest.mark.parametrize(
    "body", [b"", b"[]", b'{"of": 3, "step": 4}', b'{"of": "run/0", "step": true}', b" " * 5000]
)
def test_what_is_no_branch_is_refused(body):
    with pytest.raises(InputError, match="not a valid wish"):
        read_body(body, BRANCH_ORDER, "not a valid wish")


@pytest.mark.slow
def test_branch_needs_the_page_s_origin(lives, served):
    own = "http://127.0.0.1:8765"
    client = TestClient(page_app(served, "token", 8765, lives), base_url=own)
    body = json.dumps({"of": "run/0", "step": 60})
    kind = {"Content-Type": "application/json"}
    assert 403 == client.post("/token/branch", content=body, headers=kind).status_code
    headers = {**kind, "Origin": own}
    assert 415 == client.post("/token/branch", content=body, headers={"Origin": own}).status_code
    assert 200 == client.post("/token/branch", content=body, headers=headers).status_code
    assert ["live/0"] == [
        entry["path"] for entry in client.get("/token/session.json").json()["live"]
    ]


def test_directories_of_branches_are_numbered(tmp_path):
    for name in ("day", "day-branch-1", "day-branch-3"):
        (tmp_path / name).mkdir()
    assert tmp_path / "day-branch-2" == free_directory(tmp_path / "day")
    assert free_directory(None) is None
