"""rosbridge: roslibpy against a small server; standard messages out, goals in."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

# In a process of its own: roslibpy's reactor can't be started twice in one.
SCENE = """
import json, math, sys, threading
import fleet2d
from fleet2d.live import Bridge, open_peer
from tests.live.scenes import LIVE, place
from websockets.sync.server import serve

x, y = place()
published, subscribed = [], set()

def rosbridge(connection):
    for text in connection:
        message = json.loads(text)
        if message["op"] == "publish":
            published.append((message["topic"], message["msg"]))
        if message["op"] == "subscribe":
            subscribed.add(message["topic"])
            threading.Timer(1.5, connection.close).start()
            position, turn = {"x": x, "y": y, "z": 0.0}, {"x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0}
            pose = {"header": {}, "pose": {"position": position, "orientation": turn}}
            if message["topic"] in ("/ana/pose", "/astro/goal_pose"):
                answer = {"op": "publish", "topic": message["topic"], "msg": pose}
                connection.send(json.dumps(answer))

server = serve(rosbridge, "127.0.0.1", 0)
threading.Thread(target=server.serve_forever, daemon=True).start()
simulation = fleet2d.Simulation(LIVE)
port = server.socket.getsockname()[1]
bridge = Bridge(simulation, [open_peer(f"rosbridge://127.0.0.1:{port}")], speed=15)
seen = {"type": "detections", "entity": "astro", "detections": [{"user": "ana", "x": x, "y": y}]}
bridge._post_of(0)(seen)
run = bridge.run()
first = {}
for topic, message in published:
    first.setdefault(topic, message)
print(json.dumps({
    "topics": sorted(first), "subscribed": sorted(subscribed), "place": [x, y],
    "acts": run.manifest["interventions"], "first": first,
    "odom": [m for t, m in published if t == "/astro/odom"],
    "cells": first["/map"]["info"]["width"] * first["/map"]["info"]["height"],
}))
sys.stdout.flush()
import os
os._exit(0)
"""


@pytest.fixture
def _libraries():
    pytest.importorskip("roslibpy", reason="the extra rosbridge is not installed")
    pytest.importorskip("websockets", reason="the extra live is not installed")


@pytest.mark.slow
@pytest.mark.usefixtures("_libraries")
def test_a_robot_program_hears_standard_messages_and_sends_goals():
    done = subprocess.run(
        [sys.executable, "-c", SCENE],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        cwd=Path(__file__).parents[3],
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout.splitlines()[-1])

    x, y = result["place"]
    assert result["topics"] == [
        "/astro/detections",
        "/astro/goal_state",
        "/astro/odom",
        "/astro/people",
        "/astro/scan",
        "/clock",
        "/map",
        "/tf",
        "/tf_static",
    ]
    assert result["subscribed"] == [
        "/ana/goal_pose",
        "/ana/pose",
        "/astro/cmd_vel",
        "/astro/goal_pose",
        "/astro/pose",
    ]
    acts = {act["do"]: act for act in result["acts"]}
    assert acts["send"]["to"] == [x, y]
    assert acts["release"] == {"do": "release", "entity": "astro", "step": acts["release"]["step"]}
    assert acts["put"]["heading_deg"] == pytest.approx(180)
    grid = result["first"]["/map"]
    assert len(grid["data"]) == result["cells"]
    assert set(grid["data"]) == {0, 100}
    detection = result["first"]["/astro/detections"]["detections"][0]
    assert detection["results"][0]["hypothesis"]["class_id"] == "ana"
    assert detection["bbox"]["center"]["position"]["x"] == pytest.approx(x, abs=1e-3)
    frames = {t["child_frame_id"] for t in result["first"]["/tf"]["transforms"]}
    assert {"astro/base_link", "ana"} >= frames
    fixed = result["first"]["/tf_static"]["transforms"]
    assert [t["child_frame_id"] for t in fixed] == ["astro/odom"]
    assert max(m["twist"]["twist"]["linear"]["x"] for m in result["odom"]) == pytest.approx(
        0.6, abs=0.05
    )
    assert result["odom"][0]["header"]["stamp"]["sec"] == 1_767_614_400


@pytest.mark.slow
@pytest.mark.usefixtures("_libraries")
def test_a_server_that_is_missing_is_told_and_the_run_goes_on():
    code = (
        "import os, fleet2d\nfrom tests.live.scenes import LIVE\n"
        "from fleet2d.live import Bridge, open_peer\n"
        "bridge = Bridge(fleet2d.Simulation(LIVE), [open_peer('rosbridge://127.0.0.1:9')])\n"
        "print(bridge.run().status, bridge.notes(), flush=True)\nos._exit(0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )

    assert done.stdout.startswith("complete ")
    assert "rosbridge://127.0.0.1:9: there is no server yet; it is tried again" in done.stdout


HOSTILE = """
import json, sys, threading
import fleet2d
from fleet2d.live import Bridge, open_peer
from tests.live.scenes import LIVE
from websockets.sync.server import serve

charts = []

def rosbridge(connection):
    for text in connection:
        message = json.loads(text)
        if message["op"] == "publish" and message["topic"] == "/map":
            charts.append(message)
        if message["op"] == "subscribe" and message["topic"] == "/astro/pose":
            for msg in ({}, "text", [1], {"pose": None}):
                answer = {"op": "publish", "topic": "/ana/pose", "msg": msg}
                connection.send(json.dumps(answer))
            for text in ("garbage", "[]", '{"op":"publish"}', '{"op":"status"}'):
                connection.send(text)
            if len(charts) < 2:
                connection.send(b"binary")

server = serve(rosbridge, "127.0.0.1", 0)
threading.Thread(target=server.serve_forever, daemon=True).start()
peer = open_peer(f"rosbridge://127.0.0.1:{server.socket.getsockname()[1]}")
bridge = Bridge(fleet2d.Simulation(LIVE), [peer], speed=6)
run = bridge.run()
print(json.dumps([run.status, len(charts), bridge.counts, bridge.notes()]), flush=True)
import os
os._exit(0)
"""


@pytest.mark.slow
@pytest.mark.usefixtures("_libraries")
def test_a_server_that_sends_garbage_leaves_no_traceback_and_gets_the_map_again():
    done = subprocess.run(
        [sys.executable, "-c", HOSTILE],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        cwd=Path(__file__).parents[3],
    )
    assert done.stderr == ""
    status, charts, counts, notes = json.loads(done.stdout.splitlines()[-1])

    assert status == "complete"
    assert charts >= 2
    assert counts["wrong"] >= 4
    assert counts["errors"] >= 4
    assert counts["lost connections"] >= 1
    assert any("wrong: /ana/pose: pose: Field required" in note for note in notes)
