"""Messages of ROS: which are poses, goals and velocities, and what is odd about the others."""

import contextlib
import math
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.fuzz.changes import structures
from tests.thorough import examples

from fleet2d.errors import InputError
from fleet2d.live.bridge import Content, PeerFault
from fleet2d.live.messages import parse_message
from fleet2d.live.ros.reading import contents_of, velocities_of


def stamped(**header):
    place = {"x": 1.0, "y": 2.0, "z": 0.0}
    turn = {"x": 0.0, "y": 0.0, "z": 1.414, "w": 1.414}
    return {"header": header, "pose": {"position": place, "orientation": turn}}


def contents(message, kind="pose") -> list[Content]:
    return list(contents_of("ana", kind, "/ana/pose", message))


@pytest.mark.parametrize("frame", ["map", "/map", "", "home/map"])
def test_a_pose_in_the_map_is_a_pose(frame):
    (content,) = contents(stamped(frame_id=frame))
    assert content == {
        "type": "pose",
        "entity": "ana",
        "x": 1.0,
        "y": 2.0,
        "heading_deg": pytest.approx(90),
    }


@pytest.mark.parametrize("frame", ["astro/base_link", "odom", "mapped", "/astro/odom"])
def test_a_pose_in_another_frame_is_left_out_and_told(frame):
    (fault,) = contents(stamped(frame_id=frame))
    assert (fault.kind, fault.is_message) == ("in other frames", True)
    assert fault.text.startswith(f"/ana/pose is in the frame {frame.lstrip('/')!r}: ")


def test_the_stamp_is_the_time_of_a_pose():
    now = int(time.time()) - 3600
    for stamp in ({"sec": now, "nanosec": 500_000_000}, {"secs": now, "nsecs": 500_000_000}):
        (content,) = contents(stamped(frame_id="map", stamp=stamp))
        assert content["time"] == now + 0.5


def test_the_stamp_0_means_now_and_a_simulated_clock_is_told():
    assert "time" not in str(contents(stamped(stamp={"sec": 0, "nanosec": 0})))
    fault, content = contents(stamped(stamp={"sec": 12, "nanosec": 0}))
    assert (fault.kind, fault.is_message) == ("of a simulated clock", False)
    assert "time" not in str(content)


def test_a_goal_keeps_its_orientation():
    (content,) = contents(stamped(frame_id="map"), "goal")
    goal = parse_message(content)
    assert (goal.to, goal.heading_deg) == ((1.0, 2.0), pytest.approx(90))


@pytest.mark.parametrize("turn", [{"z": 0, "w": 0}, {"z": None, "w": 1}, {"z": math.nan}, {}])
def test_a_quaternion_that_says_nothing_is_no_heading(turn):
    message = stamped(frame_id="map")
    message["pose"]["orientation"] = turn
    fault, content = contents(message)
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
def test_a_message_without_a_pose_is_wrong(message, why):
    (fault,) = contents(message)
    assert (fault.kind, fault.is_message) == ("wrong", True)
    assert fault.text.startswith(f"/ana/pose: {why}")


@settings(max_examples=examples(1000))
@given(
    message=structures(stamped(frame_id="map", stamp={"sec": int(time.time()), "nanosec": 1})),
    kind=st.sampled_from(["pose", "goal"]),
)
def test_no_mutation_of_a_message_is_more_than_a_fault(message, kind):
    for content in contents(message, kind):
        if not isinstance(content, PeerFault):
            with contextlib.suppress(InputError):
                parse_message(content)


def test_a_stamp_near_the_simulated_time_is_of_its_clock():
    """Programs that use_sim_time stamp so: by the clock on the wall these would be days late."""
    now_ns = 1_767_614_400 * 10**9
    near = stamped(frame_id="map", stamp={"sec": now_ns // 10**9 - 60, "nanosec": 0})
    (content,) = contents_of("ana", "goal", "/ana/goal_pose", near, now_ns)
    assert "time" not in str(content)


@pytest.mark.parametrize("is_stamped", [False, True])
def test_a_twist_is_a_velocity(is_stamped):
    twist = {"linear": {"x": 0.2, "y": -0.1, "z": 9.0}, "angular": {"z": math.pi / 2}}
    message = {"header": {}, "twist": twist} if is_stamped else twist
    (content,) = velocities_of("astro", "/astro/cmd_vel", message)
    assert content == {
        "type": "velocity",
        "entity": "astro",
        "forward": 0.2,
        "left": -0.1,
        "turn_deg": pytest.approx(90),
    }


@pytest.mark.parametrize("number", [math.nan, math.inf, None, "fast"])
def test_a_velocity_that_is_no_finite_number_is_wrong(number):
    (fault,) = velocities_of("astro", "/astro/cmd_vel", {"linear": {"x": number}})
    assert (fault.kind, fault.is_message) == ("wrong", True)
    assert fault.text.startswith("/astro/cmd_vel: linear.x: ")
