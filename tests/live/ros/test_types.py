"""Types of ROS 2: their bytes and hashes, against those of ROS itself."""

import json
from pathlib import Path

import numpy as np
import pytest

from fleet2d.errors import InputError
from fleet2d.live.ros.types import NAVIGATE, RosTypes, wire_name

pytest.importorskip("rosbags", reason="the extra ros is not installed")

# What the libraries of ROS 2 Kilted that rosidl generated and a compiler compiled say of their types.
HASHES = json.loads(Path(__file__).with_name("type_hashes.json").read_text())
FIBONACCI = "int32 order\n---\nint32[] sequence\n---\nint32[] sequence\n"


def kilted() -> RosTypes:
    types = RosTypes("kilted")
    types._add_action("test_msgs/action/Fibonacci", FIBONACCI)
    types._add_service("std_srvs/srv/SetBool", "bool data\n---\nbool success\nstring message\n")
    types._add_service("nav_msgs/srv/GetMap", "---\nnav_msgs/OccupancyGrid map\n")
    return types


def test_hashes_are_those_of_compiled_types():
    types = kilted()
    assert len(HASHES) > 150
    assert {name: types.hash(name) for name in HASHES} == HASHES


def test_the_three_wires_of_an_action_differ():
    hashes = {d: RosTypes(d).hash(f"{NAVIGATE}_GetResult") for d in ("humble", "jazzy", "kilted")}
    feedback = {RosTypes(d).hash(f"{NAVIGATE}_FeedbackMessage") for d in ("jazzy", "lyrical")}

    assert hashes["humble"] == "TypeHashNotSupported"
    assert hashes["jazzy"] == hashes["kilted"]
    assert len(feedback) == 2
    assert "error_code" not in str(RosTypes("humble").decode(f"{NAVIGATE}_Result", b"\0\1\0\0\0"))


@pytest.mark.parametrize("distribution", ["humble", "jazzy", "kilted", "lyrical"])
def test_what_is_left_out_is_zero_or_empty(distribution):
    types = RosTypes(distribution)
    name = f"{NAVIGATE}_FeedbackMessage"
    message = types.decode(name, types.encode(name, {"goal_id": {"uuid": range(16)}}))

    assert message["goal_id"]["uuid"].tolist() == list(range(16))
    assert message["feedback"]["current_pose"]["header"] == {
        "stamp": {"sec": 0, "nanosec": 0},
        "frame_id": "",
    }
    assert message["feedback"]["distance_remaining"] == 0.0


def test_messages_come_back_as_they_were():
    types = RosTypes()
    scan = {"angle_min": -3.0, "ranges": np.array([1.0, np.inf], np.float32)}
    transform = {"child_frame_id": "astro/odom", "transform": {"rotation": {"w": 1.0}}}

    back = types.decode(
        "sensor_msgs/msg/LaserScan", types.encode("sensor_msgs/msg/LaserScan", scan)
    )
    frames = types.encode("tf2_msgs/msg/TFMessage", {"transforms": [transform, transform]})

    assert back["ranges"].tolist() == [1.0, np.inf]
    assert back["angle_min"] == -3.0
    moved = types.decode("tf2_msgs/msg/TFMessage", frames)["transforms"]
    assert [t["child_frame_id"] for t in moved] == ["astro/odom"] * 2
    assert moved[0]["transform"]["rotation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


def test_a_field_that_a_type_lacks_is_an_error():
    with pytest.raises(KeyError, match="dada"):
        RosTypes().encode("std_msgs/msg/String", {"dada": "x"})


@pytest.mark.parametrize("data", [b"", b"\0", b"\0\1\0\0", b"\0\1\0\0\xff\xff\xff\xff", b"text"])
def test_bytes_that_are_no_message_are_told(data):
    with pytest.raises(ValueError, match="no std_msgs/msg/String"):
        RosTypes().decode("std_msgs/msg/String", data)


def test_an_unknown_distribution_is_told():
    with pytest.raises(InputError, match="ROS 2 'jade' is unknown: there are humble, jazzy"):
        RosTypes("jade")


def test_names_on_the_wire():
    assert wire_name("nav2_msgs/action/NavigateToPose_SendGoal") == (
        "nav2_msgs::action::dds_::NavigateToPose_SendGoal_"
    )
