"""Messages of ROS to a run: poses, goals and velocities, whichever way they arrive."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from pydantic import AliasChoices, BaseModel, Field, ValidationError

from fleet2d.bounds import one_line
from fleet2d.live.bridge import Content, PeerFault
from fleet2d.live.messages import first_fault
from fleet2d.logs.frames import MAP, frame_name, is_named
from fleet2d.storage.bags import LATEST_SIMULATED_NS, headings_of

POSE = "geometry_msgs/msg/PoseStamped"
TWISTS = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
"""The types of `cmd_vel`: Nav2 sends the first one up to Jazzy, the second one from Kilted on."""
# A stamp this near to the simulated time is of the simulated clock rather than a wall clock [ns].
NEAR_NS = 86_400 * 10**9


class _RosStamp(BaseModel):
    """A time of ROS 2, or of ROS 1."""

    sec: int = Field(default=0, ge=0, lt=1 << 32, validation_alias=AliasChoices("sec", "secs"))
    nanosec: int = Field(
        default=0, ge=0, lt=1 << 32, validation_alias=AliasChoices("nanosec", "nsecs")
    )


class _RosHeader(BaseModel):
    frame_id: str = ""
    stamp: _RosStamp = _RosStamp()


class _RosPoint(BaseModel):
    x: float = Field(allow_inf_nan=False)
    y: float = Field(allow_inf_nan=False)


class _RosQuaternion(BaseModel):
    """A rotation; rosbridge writes null for NaN."""

    x: float | None = 0.0
    y: float | None = 0.0
    z: float | None = 0.0
    w: float | None = 0.0


class _RosPose(BaseModel):
    position: _RosPoint
    orientation: _RosQuaternion = _RosQuaternion()


class _PoseStamped(BaseModel):
    """A `geometry_msgs/PoseStamped`."""

    header: _RosHeader = _RosHeader()
    pose: _RosPose


class _RosVector(BaseModel):
    x: float = Field(default=0.0, allow_inf_nan=False)
    y: float = Field(default=0.0, allow_inf_nan=False)
    z: float = Field(default=0.0, allow_inf_nan=False)


class _Twist(BaseModel):
    """A `geometry_msgs/Twist`."""

    linear: _RosVector = _RosVector()
    angular: _RosVector = _RosVector()


def velocities_of(name: str, topic: str, message: object) -> Iterator[Content]:
    """Yield the velocity in a `Twist` or `TwistStamped` as a message to a run, or its fault.

    Args:
        name: The robot.
        topic: The topic on which it arrived.
        message: The message of ROS as JSON data.
    """
    if isinstance(message, dict) and "twist" in message:  # a TwistStamped
        message = message["twist"]
    try:
        twist = _Twist.model_validate(message)
    except ValidationError as error:
        yield PeerFault("wrong", f"{topic}: {first_fault(error)}", is_message=True)
        return
    turn_deg = math.degrees(twist.angular.z)
    velocity = {"forward": twist.linear.x, "left": twist.linear.y, "turn_deg": turn_deg}
    yield {"type": "velocity", "entity": name, **velocity}


def contents_of(
    name: str, kind: str, topic: str, message: object, now_ns: int | None = None
) -> Iterator[Content]:
    """Yield the pose or goal in a `PoseStamped` as a message to a run, and faults of it.

    Args:
        name: The body.
        kind: "pose" or "goal".
        topic: The topic on which it arrived.
        message: The message of ROS as JSON data.
        now_ns: The simulated time, if ROS hears it: a stamp near it says nothing about lateness.
    """
    try:
        stamped = _PoseStamped.model_validate(message)
    except ValidationError as error:
        yield PeerFault("wrong", f"{topic}: {first_fault(error)}", is_message=True)
        return
    frame = frame_name(stamped.header.frame_id)
    if frame and not is_named(frame, MAP):
        text = f"{topic} is in the frame {one_line(frame)!r}: only poses in {MAP!r} count"
        yield PeerFault("in other frames", text, is_message=True)
        return
    position = stamped.pose.position
    turn = stamped.pose.orientation
    content: dict[str, Any] = {"type": kind, "entity": name}
    content |= {"to": [position.x, position.y]} if kind == "goal" else dict(position)
    stamp_ns = stamped.header.stamp.sec * 1_000_000_000 + stamped.header.stamp.nanosec
    is_ours = now_ns is not None and abs(stamp_ns - now_ns) < NEAR_NS
    if is_ours:
        pass
    elif stamp_ns >= LATEST_SIMULATED_NS:
        content["time"] = stamp_ns / 1e9
    elif stamp_ns:
        yield PeerFault("of a simulated clock", f"{topic}: nobody knows which messages are late")
    quaternion = np.array([turn.x, turn.y, turn.z, turn.w], np.float64)
    (heading,) = headings_of(quaternion[None])
    if math.isfinite(heading):
        content["heading_deg"] = math.degrees(heading)
    else:
        yield PeerFault("without heading", f"{topic}: the quaternion is 0 or not a number")
    yield content
