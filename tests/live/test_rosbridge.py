"""rosbridge: roslibpy against a small server; standard messages out, goals in."""

import contextlib
import copy
import json
import math
import random
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from fleet2d.errors import InputError
from fleet2d.live.bridge import Content, PeerFault
from fleet2d.live.messages import parse_message
from fleet2d.live.rosbridge import contents_of

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
def _libraries() -> None:
    pytest.importorskip("roslibpy", reason="the extra rosbridge is not installed")
    pytest.importorskip("websockets", reason="the extra live is not installed")


@pytest.mark.slow
@pytest.mark.usefixtures("_libraries")
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


@pytest.mark.slow
@pytest.mark.usefixtures("_libraries")
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
def test_a_server_that_sends_garbage_leaves_no_traceback_and_gets_the_map_again() -> None:
    done = subprocess.run(
        [sys.executable, "-c", HOSTILE],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    assert done.stderr == ""
    status, charts, counts, notes = json.loads(done.stdout.splitlines()[-1])

    assert status == "complete"
    assert charts >= 2
    assert counts["wrong"] >= 4
    assert counts["errors"] >= 4
    assert counts["lost connections"] >= 1
    assert any("wrong: /ana/pose: pose: Field required" in note for note in notes)


def stamped(**header: Any) -> dict[str, Any]:
    place = {"x": 1.0, "y": 2.0, "z": 0.0}
    turn = {"x": 0.0, "y": 0.0, "z": 1.414, "w": 1.414}
    return {"header": header, "pose": {"position": place, "orientation": turn}}


def contents(message: object, kind: str = "pose") -> list[Content]:
    return list(contents_of("/ana/pose", "ana", kind, message))


@pytest.mark.parametrize("frame", ["map", "/map", "", "home/map"])
def test_a_pose_in_the_map_is_a_pose(frame: str) -> None:
    (content,) = contents(stamped(frame_id=frame))
    assert content == {
        "type": "pose",
        "entity": "ana",
        "x": 1.0,
        "y": 2.0,
        "heading_deg": pytest.approx(90),
    }


@pytest.mark.parametrize("frame", ["astro/base_link", "odom", "mapped", "/astro/odom"])
def test_a_pose_in_another_frame_is_left_out_and_told(frame: str) -> None:
    (fault,) = contents(stamped(frame_id=frame))
    assert isinstance(fault, PeerFault)
    assert (fault.kind, fault.is_message) == ("in other frames", True)
    assert fault.text.startswith(f"/ana/pose is in the frame {frame.lstrip('/')!r}: ")


def test_the_stamp_is_the_time_of_a_pose() -> None:
    now = int(time.time()) - 3600
    for stamp in ({"sec": now, "nanosec": 500_000_000}, {"secs": now, "nsecs": 500_000_000}):
        (content,) = contents(stamped(frame_id="map", stamp=stamp))
        assert isinstance(content, dict)
        assert content["time"] == now + 0.5


def test_the_stamp_0_means_now_and_a_simulated_clock_is_told() -> None:
    assert "time" not in str(contents(stamped(stamp={"sec": 0, "nanosec": 0})))
    fault, content = contents(stamped(stamp={"sec": 12, "nanosec": 0}))
    assert isinstance(fault, PeerFault)
    assert (fault.kind, fault.is_message) == ("of a simulated clock", False)
    assert "time" not in str(content)


def test_a_goal_keeps_its_orientation() -> None:
    (content,) = contents(stamped(frame_id="map"), "goal")
    goal: Any = parse_message(content)  # type: ignore[arg-type]
    assert (goal.to, goal.heading_deg) == ((1.0, 2.0), pytest.approx(90))


@pytest.mark.parametrize("turn", [{"z": 0, "w": 0}, {"z": None, "w": 1}, {"z": math.nan}, {}])
def test_a_quaternion_that_says_nothing_is_no_heading(turn: dict[str, Any]) -> None:
    message = stamped(frame_id="map")
    message["pose"]["orientation"] = turn
    fault, content = contents(message)
    assert isinstance(fault, PeerFault)
    assert fault.kind == "without heading"
    assert "heading_deg" not in str(content)


@pytest.mark.parametrize(
    ("message", "why"),
    [
        ({}, "pose: Field required"),
        ({"pose": None}, "pose: Input should be a valid dictionary"),
        ({"pose": {"position": {}}}, "pose.position.x: Field required"),
        ({"pose": {"position": {"x": "a", "y": 1}}}, "pose.position.x: Input should be a valid n"),
        ("text", "Input should be a valid dictionary"),
        ([1], "Input should be a valid dictionary"),
    ],
)
def test_a_message_without_a_pose_is_wrong(message: object, why: str) -> None:
    (fault,) = contents(message)
    assert isinstance(fault, PeerFault)
    assert (fault.kind, fault.is_message) == ("wrong", True)
    assert fault.text.startswith(f"/ana/pose: {why}")


ODD = (None, "", "x", 1e308, -1e308, math.nan, math.inf, 10**400, -1, [], {}, [[]], True, "\x1b[2J")


def mutated(message: Any, draw: random.Random) -> Any:
    """Return a message with one value removed, replaced, or moved below an odd key."""
    message = copy.deepcopy(message)
    place = message
    while isinstance(place, dict) and place:
        key = draw.choice(list(place))
        if not isinstance(place[key], dict) or draw.random() < 0.3:
            change = draw.randrange(3)
            value = place.pop(key)
            if change:
                place[key if change == 1 else "odd"] = draw.choice(ODD) if change == 1 else value
            break
        place = place[key]
    return message


def test_no_mutation_of_a_message_is_more_than_a_fault() -> None:
    draw = random.Random(5)
    stamp = {"sec": int(time.time()), "nanosec": 1}
    message: Any = stamped(frame_id="map", stamp=stamp)
    for _ in range(1000):
        odd = mutated(message, draw)
        odd = mutated(odd, draw) if draw.random() < 0.5 else odd
        for content in contents(odd, draw.choice(["pose", "goal"])):
            if not isinstance(content, PeerFault):
                with contextlib.suppress(InputError):
                    parse_message(content)  # type: ignore[arg-type]


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
