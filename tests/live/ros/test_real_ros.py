"""ROS 2 itself, where its library can be imported: our bytes are its bytes, and its node hears the run.

`.ci/ros` installs it. What needs `rmw_zenoh`, Nav2 or RViz is in `.ci/ros-desktop`.
"""

import importlib
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from tests.live.ros.test_types import kilted

pytest.importorskip("rclpy", reason="the library of ROS is not installed: .ci/ros does")
# The library of ROS imports modules that Python calls deprecated.
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::DeprecationWarning")]

# A quaternion that is left out is 1 in ROS, and 0 in ours.
TURN = {"orientation": {"w": 1.0}}
MESSAGES = {
    "rosgraph_msgs/msg/Clock": {"clock": {"sec": 5, "nanosec": 7}},
    "nav_msgs/msg/OccupancyGrid": {
        "header": {"frame_id": "map"},
        "info": {"resolution": 0.05, "width": 3, "height": 1, "origin": TURN},
        "data": np.array([0, 100, -1], np.int8),
    },
    "nav_msgs/msg/Odometry": {
        "child_frame_id": "astro/base_link",
        "pose": {"pose": {"position": {"x": 1.5}, **TURN}, "covariance": np.arange(36.0)},
    },
    "sensor_msgs/msg/LaserScan": {"ranges": np.array([1.0, np.inf], np.float32)},
    "sensor_msgs/msg/BatteryState": {"percentage": 0.5, "present": True, "voltage": np.nan},
    "geometry_msgs/msg/Twist": {"linear": {"x": 0.25}, "angular": {"z": -1.0}},
    "geometry_msgs/msg/TwistStamped": {"header": {"frame_id": "ä"}, "twist": {}},
    "geometry_msgs/msg/PoseStamped": {"pose": TURN},
    "geometry_msgs/msg/PoseWithCovarianceStamped": {
        "pose": {"pose": TURN, "covariance": np.ones(36)}
    },
    "action_msgs/msg/GoalStatusArray": {
        "status_list": [{"goal_info": {"goal_id": {"uuid": range(16)}}, "status": 4}] * 2
    },
    "std_msgs/msg/String": {"data": "مريم"},
}


@pytest.mark.parametrize("name", MESSAGES)
def test_bytes_are_those_of_ros(name):
    from rclpy.serialization import deserialize_message, serialize_message

    from fleet2d.live.ros.rclpy_node import as_mapping, filled

    package, kind, last = name.split("/")
    cls = getattr(importlib.import_module(f"{package}.{kind}"), last)
    types = kilted()

    ours = types.encode(name, MESSAGES[name])
    theirs = serialize_message(filled(cls(), MESSAGES[name]))

    back = as_mapping(deserialize_message(ours, cls))
    assert str(types.decode(name, bytes(theirs))) == str(types.decode(name, ours))
    assert str(back) == str(as_mapping(deserialize_message(bytes(theirs), cls)))


LISTENER = """
import json, threading, time
import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String

rclpy.init()
node = rclpy.create_node("listener")
heard = {}
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
for name, kind, quality in (
    ("/clock", Clock, 10), ("/map", OccupancyGrid, latched), ("/astro/odom", Odometry, 10),
    ("/astro/scan", LaserScan, 10), ("/astro/goal_state", String, 10),
):
    node.create_subscription(kind, name, heard.setdefault(name, []).append, quality)
steer = node.create_publisher(Twist, "/astro/cmd_vel", 10)
goal = node.create_publisher(PoseStamped, "/astro/goal_pose", 10)
threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()

def wait_for(condition):
    until = time.monotonic() + 40
    while not condition():
        assert time.monotonic() < until, {name: len(all) for name, all in heard.items()}
        time.sleep(0.02)

wait_for(lambda: all(heard[name] for name in ("/clock", "/map", "/astro/odom", "/astro/scan")))
nodes = sorted(node.get_node_names())
twist = Twist()
twist.angular.z = 1.0
begin = heard["/astro/odom"][-1].pose.pose
for _ in range(10):
    steer.publish(twist)
    time.sleep(0.1)
turned = heard["/astro/odom"][-1].pose.pose.orientation.z != begin.orientation.z
there = PoseStamped()
there.header.frame_id = "map"
there.header.stamp = heard["/clock"][-1].clock
there.pose = begin
there.pose.position.y += 0.2
goal.publish(there)
states = lambda: [json.loads(message.data)["state"] for message in heard["/astro/goal_state"]]
wait_for(lambda: "reached" in states())
print(json.dumps([nodes, turned, states()[0], len(heard["/astro/scan"][-1].ranges)]), flush=True)
import os
os._exit(0)
"""


def test_a_node_of_ros_hears_and_drives_a_run(tmp_path):
    scene = """
        extends: bundled:paper
        simulation: {duration: 60 s, step: 0.1 s, start: "2026-01-05T12:00", seed: 4}
        users: {ana: {type: live}}
        robots: {astro: {behaviors: [{type: live}]}}
        algorithms: {ltp: null}
        metrics: {ltp_error: null}
    """
    (tmp_path / "lab.yaml").write_text(textwrap.dedent(scene))
    command = [sys.executable, "-m", "fleet2d", "live", "lab.yaml", "--with", "ros2:///jazzy"]
    live = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    try:
        heard = subprocess.run(
            [sys.executable, "-c", LISTENER],
            capture_output=True,
            text=True,
            timeout=55,
            check=False,
        )
    finally:
        live.terminate()
    assert heard.stdout.strip() == '[["fleet2d", "listener"], true, "accepted", 360]', heard.stderr
    assert "/tf: ROS has no tf2_msgs/msg/TFMessage here" in live.communicate()[1]
