"""rosbridge: roslibpy against a small server; standard messages out, goals in."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("roslibpy", reason="the extra rosbridge is not installed")
pytest.importorskip("websockets", reason="the extra live is not installed")

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


@pytest.mark.slow
def test_a_robot_program_hears_standard_messages_and_sends_goals() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCENE],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout.splitlines()[-1])

    x, y = result["place"]
    assert result["topics"] == ["/astro/detections", "/astro/odom", "/astro/scan", "/map", "/tf"]
    assert result["subscribed"] == [
        f"/{name}/{kind}" for name in ("ana", "astro") for kind in ("goal_pose", "pose")
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
    assert {"astro/base_link", "astro/odom", "ana"} >= frames
    assert max(m["twist"]["twist"]["linear"]["x"] for m in result["odom"]) == pytest.approx(
        0.6, abs=0.05
    )
    assert result["odom"][0]["header"]["stamp"]["sec"] == 1_767_614_400


def test_no_server_is_told() -> None:
    code = (
        "from fleet2d.live import open_peer\nfrom fleet2d.errors import InputError\nimport os\n"
        "try:\n    open_peer('rosbridge://127.0.0.1:9')\n"
        "except InputError as error:\n    print(error, flush=True)\nos._exit(0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )

    assert done.stdout.startswith("rosbridge://127.0.0.1:9: there is no server: ")


def test_a_scan_measures_the_walls_around() -> None:
    import numpy as np
    import shapely
    from tests.live.scenes import place

    import fleet2d
    from fleet2d.live.rosbridge import BEAMS, scan_of

    plan = fleet2d.load_floorplan()
    x, y = plan.lattice.point_at(place())
    for heading in (0.0, 1.0, -2.5):
        ranges = scan_of(plan.mesh, x, y, heading) / plan.lattice.units_per_m

        x_m, y_m = plan.lattice.xy_of(x, y)
        walls = plan.free_space.boundary
        for beam in range(0, BEAMS, 7):
            angle = heading - np.pi + 2 * np.pi / BEAMS * beam
            far = (x_m + 50 * np.cos(angle), y_m + 50 * np.sin(angle))
            line = shapely.LineString([(x_m, y_m), far])
            expected = shapely.Point(x_m, y_m).distance(line.intersection(walls))
            assert ranges[beam] == pytest.approx(expected, abs=0.02)
