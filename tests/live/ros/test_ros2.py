"""ROS 2 over zenoh: another node hears the run, drives its robot, and sends, cancels and loses goals."""

import json
import math
import os
import threading
import time
import uuid
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.live.scenes import LIVE, place

import fleet2d
from fleet2d.errors import InputError
from fleet2d.live import Bridge, open_peer
from fleet2d.live.ros import ros2
from fleet2d.live.ros.node import LATCHED, ActionStatus
from fleet2d.live.ros.ros2 import Ros2Peer, domain_of_environment, parse_place
from fleet2d.live.ros.types import NAVIGATE, RosTypes

pytest.importorskip("zenoh", reason="the extra ros2 is not installed")
pytestmark = pytest.mark.slow

TOPICS = {
    "/clock": "rosgraph_msgs/msg/Clock",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/astro/odom": "nav_msgs/msg/Odometry",
    "/astro/scan": "sensor_msgs/msg/LaserScan",
    "/astro/battery_state": "sensor_msgs/msg/BatteryState",
    "/astro/navigate_to_pose/_action/feedback": f"{NAVIGATE}_FeedbackMessage",
}
LATCHED_TOPICS = {
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/astro/navigate_to_pose/_action/status": "action_msgs/msg/GoalStatusArray",
}
ACTION = "/astro/navigate_to_pose/_action"
BATTERY = {"driving": "2 h", "standing": "8 h", "charging": "1 h", "charger": "any"}
_ports = iter(range(17447 + os.getpid() % 1000, 65535))


class Program:
    """A program of ROS beside a run: what it hears by topic, and goals that it sends."""

    def __init__(self, port, distribution):
        from fleet2d.live.ros.zenoh_node import ZenohNode

        self.node = ZenohNode(RosTypes(distribution), port=port)
        self.heard: dict[str, list[dict[str, Any]]] = {}
        for name, of in TOPICS.items():
            self.node.subscribe(name, of, self.heard.setdefault(name, []).append, pytest.fail)
        for name, of in LATCHED_TOPICS.items():
            keep = self.heard.setdefault(name, []).append
            self.node.subscribe(name, of, keep, pytest.fail, LATCHED)

    def wait_for(self, topic, count=1, such=bool):
        until = time.monotonic() + 20
        while len(self.heard[topic]) < count or not such(self.heard[topic][-1]):
            assert time.monotonic() < until, f"nothing on {topic}"
            time.sleep(0.01)
        return self.heard[topic][-1]

    @property
    def position(self) -> tuple[float, float]:
        at = self.wait_for("/astro/odom")["pose"]["pose"]["position"]
        return at["x"], at["y"]

    def send(self, x, y, frame="map") -> tuple[bool, Any]:
        name = np.frombuffer(uuid.uuid4().bytes, np.uint8)
        pose = {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}}
        stamped = {"header": {"frame_id": frame}, "pose": pose}
        request = {"goal_id": {"uuid": name}, "goal": {"pose": stamped}}
        answer = self.node.call(f"{ACTION}/send_goal", f"{NAVIGATE}_SendGoal", request)
        return answer["accepted"], name

    def result(self, name):
        request = {"goal_id": {"uuid": name}}
        return self.node.call(f"{ACTION}/get_result", f"{NAVIGATE}_GetResult", request, 20)

    def cancel(self, name):
        request = {"goal_info": {"goal_id": {"uuid": name}}}
        answer = self.node.call(f"{ACTION}/cancel_goal", "action_msgs/srv/CancelGoal", request)
        return int(answer["return_code"])


class Beside:
    """A run in a thread, and a program beside it."""

    def __init__(self, distribution="jazzy", out: Path | None = None, **options):
        port = next(_ports)
        robot = LIVE["robots"]["astro"] | {"battery": BATTERY}
        simulation = LIVE["simulation"] | {"step": "50 ms", "duration": "10 min"}
        scene = LIVE | {"robots": {"astro": robot}, "simulation": simulation}
        peer = Ros2Peer("127.0.0.1", port, distribution)
        self.bridge = Bridge(fleet2d.Simulation(scene, out=out), [peer], **options)
        self.runs: list[fleet2d.Run] = []
        self.thread = threading.Thread(target=lambda: self.runs.append(self.bridge.run()))
        self.thread.start()
        self.program = Program(port, distribution)

    def __enter__(self) -> "Beside":
        return self

    def __exit__(self, *_):
        self.end()
        self.program.node.close()

    def end(self) -> fleet2d.Run:
        self.bridge._stop()
        self.thread.join(timeout=20)
        return self.runs[0]


@pytest.fixture(scope="module", autouse=True)
def without_ros():
    """Have runs speak the protocol of `rmw_zenoh` where ROS is installed, too, as in `.ci/ros`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ros2, "is_rclpy_there", lambda: False)
        yield


@pytest.fixture(scope="module")
def beside():
    with Beside() as both:
        yield both


def test_a_program_that_comes_late_hears_all_topics(beside):
    program = beside.program
    program.wait_for("/clock", 20)

    chart = program.wait_for("/map")
    assert len(program.heard["/map"]) == 1
    assert len(chart["data"]) == chart["info"]["width"] * chart["info"]["height"]
    (fixed,) = program.wait_for("/tf_static")["transforms"]
    assert (fixed["header"]["frame_id"], fixed["child_frame_id"]) == ("map", "astro/odom")
    frames = {t["child_frame_id"] for t in program.wait_for("/tf")["transforms"]}
    assert frames == {"ana", "astro/base_link"}
    scan = program.wait_for("/astro/scan")
    assert len(scan["ranges"]) == 360
    assert np.isfinite(scan["ranges"]).any()
    assert 0.99 < program.wait_for("/astro/battery_state")["percentage"] <= 1


def test_clocks_come_before_the_stamps_of_their_step_and_count_up(beside):
    def stamp(fields):
        return int(fields["sec"]) * 10**9 + int(fields["nanosec"])

    times = [stamp(m["clock"]) for m in beside.program.heard["/clock"]]
    assert {b - a for a, b in pairwise(times)} == {50_000_000}
    assert times[0] >= 1_767_614_400 * 10**9
    assert stamp(beside.program.wait_for("/astro/odom")["header"]["stamp"]) in range(
        times[0], times[-1] + 10**9
    )


def test_the_graph_has_one_node_with_all_entities(beside):
    tokens = [t.split("/") for t in beside.program.node.entities()]
    kinds = [token[5] for token in tokens]

    assert kinds.count("NN") == 2  # the run and this program
    published = {t[9].replace("%", "/") for t in tokens if t[5] == "MP"}
    assert {"/clock", "/map", "/tf", "/astro/odom", "/astro/people"} <= published
    served = {t[9].replace("%", "/") for t in tokens if t[5] == "SS"}
    assert served == {f"{ACTION}/{part}" for part in ("send_goal", "get_result", "cancel_goal")}
    assert next(t for t in tokens if t[5] == "MP" and t[9] == "%map")[12] == ":1:,1:,:,:,,"


def test_a_goal_is_accepted_told_of_and_reached(beside):
    program = beside.program
    x, y = program.position

    accepted, name = program.send(x, y + 0.3)
    result = program.result(name)

    assert accepted
    assert result == {
        "status": ActionStatus.SUCCEEDED,
        "result": {"error_code": 0, "error_msg": ""},
    }
    assert math.dist(program.position, (x, y + 0.3)) < 0.01
    left = [
        m["feedback"]["distance_remaining"]
        for m in program.heard[f"{ACTION}/feedback"]
        if bytes(m["goal_id"]["uuid"]) == bytes(name)
    ]
    assert left == sorted(left, reverse=True)
    assert left[0] == pytest.approx(0.3, abs=0.01)


def test_a_goal_in_a_wall_is_aborted_with_the_reason(beside):
    accepted, name = beside.program.send(50.0, 50.0)
    result = beside.program.result(name)

    assert accepted
    assert result["status"] == ActionStatus.ABORTED
    assert "is in a wall" in result["result"]["error_msg"]


@pytest.mark.parametrize(
    ("x", "frame"), [(math.nan, "map"), (math.inf, "map"), (9.0, "astro/base_link")]
)
def test_what_is_no_goal_is_refused(beside, x, frame):
    accepted, name = beside.program.send(x, 9.0, frame)
    assert not accepted
    assert beside.program.result(name)["status"] == 0


def test_a_goal_is_canceled_once(beside):
    program = beside.program
    accepted, name = program.send(*place("bathroom_1"))
    time.sleep(0.3)

    assert accepted
    assert program.cancel(name) == 0
    assert program.result(name)["status"] == ActionStatus.CANCELED
    assert program.cancel(name) == 3  # it is over
    assert program.cancel(np.arange(16, dtype=np.uint8)) == 2  # it is unknown


def test_a_later_goal_ends_the_one_before(beside):
    program = beside.program
    _, first = program.send(*place("bathroom_1"))
    _, second = program.send(*place("office_1"))

    result = program.result(first)
    assert result["status"] == ActionStatus.ABORTED
    assert result["result"]["error_msg"] == "another goal was sent"
    assert program.cancel(second) == 0
    program.result(second)

    def is_over(message):
        return [state["status"] for state in message["status_list"]][-2:] == [6, 5]

    # States are published beside results, and may arrive later.
    program.wait_for(f"{ACTION}/status", such=is_over)


@pytest.mark.parametrize("of", ["geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"])
def test_velocities_move_the_robot_until_they_stop_coming(beside, of):
    program = beside.program
    publish = program.node.publisher("/astro/cmd_vel", of)
    time.sleep(0.3)
    twist = {"angular": {"z": 1.0}}
    message = {"twist": twist} if "Stamped" in of else twist

    for _ in range(5):
        publish(message)
        time.sleep(0.1)
    turned = program.wait_for("/astro/odom")["twist"]["twist"]["angular"]["z"]
    time.sleep(1)

    assert turned == pytest.approx(1.0, abs=0.1)
    assert program.wait_for("/astro/odom")["twist"]["twist"]["angular"]["z"] == 0.0


def test_an_initial_pose_puts_the_robot_there_and_goals_go_on(beside):
    program = beside.program
    x, y = place("office_1")
    of = "geometry_msgs/msg/PoseWithCovarianceStamped"
    publish = program.node.publisher("/astro/initialpose", of)
    time.sleep(0.3)
    pose = {"position": {"x": x, "y": y}, "orientation": {"w": 1.0}}

    publish({"header": {"frame_id": "map"}, "pose": {"pose": pose}})
    time.sleep(0.5)

    assert math.dist(program.position, (x, y)) < 0.01
    _, name = program.send(x + 0.2, y)
    assert program.result(name)["status"] == ActionStatus.SUCCEEDED


def test_open_goals_end_with_the_run_which_stores_what_was_taken(tmp_path):
    with Beside(out=tmp_path / "run") as both:
        program = both.program
        program.wait_for("/clock", 5)
        _, name = program.send(*place("bathroom_1"))
        answers = []
        waiting = threading.Thread(target=lambda: answers.append(program.result(name)))
        waiting.start()
        time.sleep(0.5)
        run = both.end()
        waiting.join(20)

    assert answers[0]["status"] == ActionStatus.ABORTED
    assert answers[0]["result"]["error_msg"] == "the run is over"
    assert run.status == "interrupted"
    assert [act["do"] for act in run.manifest["interventions"]] == ["send"]


def test_humble_has_its_own_wire():
    with Beside("humble") as both:
        x, y = both.program.position
        accepted, name = both.program.send(x, y + 0.1)
        assert accepted
        assert both.program.result(name)["status"] == ActionStatus.SUCCEEDED


def test_one_robot_may_be_without_a_prefix():
    peer = Ros2Peer("127.0.0.1", next(_ports), "jazzy/astro")
    bridge = Bridge(fleet2d.Simulation(LIVE, "simulation.duration=2 s"), [peer], speed=0)
    bridge.run()
    names = {topic.name for topic in peer._topics.all}
    assert {"/odom", "/scan", "/detections"} <= names
    assert peer._topics.frame("astro", "base_link") == "base_link"


def test_a_robot_that_isnt_there_is_told():
    peer = open_peer(f"ros2://127.0.0.1:{next(_ports)}/jazzy/asto")
    with pytest.raises(InputError, match="no robot 'asto', but astro"):
        Bridge(fleet2d.Simulation(LIVE, "simulation.duration=2 s"), [peer], speed=0).run()


def test_a_speed_that_ros_cant_follow_is_told():
    told = []
    peer = Ros2Peer("127.0.0.1", next(_ports))
    simulation = fleet2d.Simulation(LIVE, "simulation.duration=2 s")
    Bridge(simulation, [peer], speed=50, tell=told.append).run()
    assert told == ["at more than 10 times real time, timers of ROS skip"]


def test_places_of_an_address(monkeypatch):
    monkeypatch.delenv("ROS_DISTRO", raising=False)
    assert parse_place("") == ("jazzy", None)
    assert parse_place("/kilted/astro") == ("kilted", "astro")
    monkeypatch.setenv("ROS_DISTRO", "humble")
    assert parse_place("/") == ("humble", None)
    with pytest.raises(InputError, match="no such version of ROS 2"):
        parse_place("/jade")


@pytest.mark.parametrize("text", ["x", "-1", "233", "1.0", "²"])
def test_a_wrong_domain_is_told(text, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(InputError, match="ROS_DOMAIN_ID is"):
        domain_of_environment()


def test_a_router_of_another_machine_that_is_missing_is_told_and_found_once_it_is_there():
    from fleet2d.live.ros.zenoh_node import ZenohNode

    port = next(_ports)
    here = ZenohNode(RosTypes("jazzy"), "127.0.0.2", port)  # no name of this machine
    assert [note.split(": ")[1] for note in here.notes] == [
        "no router of zenoh answers there yet; it is tried again"
    ]
    router = zenoh_router(f"tcp/127.0.0.2:{port}")
    there = ZenohNode(RosTypes("jazzy"), "127.0.0.2", port)
    assert not there.notes
    heard = []
    there.subscribe("/clock", TOPICS["/clock"], heard.append, pytest.fail)
    publish = here.publisher("/clock", TOPICS["/clock"])
    until = time.monotonic() + 20
    while not heard and time.monotonic() < until:
        publish({"clock": {"sec": 1, "nanosec": 0}})
        time.sleep(0.05)
    for each in (here, there, router):
        each.close()
    assert heard


def zenoh_router(endpoint):

    import zenoh

    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)
