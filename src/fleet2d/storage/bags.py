"""Bags of ROS 1 and ROS 2, read without ROS."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.bounds import LOG_BYTES, check_file, one_line
from fleet2d.errors import Fleet2DError, InputError, extra

VISION_TYPES = {
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"
    ),
    "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
    "vision_msgs/msg/Detection3D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox3D bbox\nstring id\n"
    ),
    "vision_msgs/msg/Detection3DArray": (
        "std_msgs/Header header\nvision_msgs/Detection3D[] detections\n"
    ),
}
"""The definitions of ROS's vision_msgs, which the library of types doesn't have."""

LATEST_SIMULATED_NS = 10**17
"""Stamps below are of a simulated clock [ns]: three years."""

_BAGS = (".bag", ".mcap", ".db3")


def is_bag(path: Path) -> bool:
    """Return whether a file or folder is a bag of ROS, by its name."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file()
    return path.suffix.lower() in _BAGS


def ros_types(need: str) -> Any:
    """Return the types of messages of ROS 2, with those of vision_msgs.

    Args:
        need: What rosbags is needed for, for the message.

    Raises:
        InputError: rosbags isn't installed.
    """
    with extra("ros", need):
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in VISION_TYPES.items():
        types.register(get_types_from_msg(definition, name))
    return types


@contextmanager
def open_bag(path: Path, failure: type[InputError] = InputError) -> Iterator[Any]:
    """Open a ROS 1 or ROS 2 bag for reading.

    Args:
        path: The bag: a file, or the folder of a ROS 2 bag.
        failure: The type of the error about a bag that can't be read.

    Raises:
        InputError: It can't be read, is beyond a bound, or rosbags isn't installed.
    """
    for file in path.iterdir() if path.is_dir() else (path,):
        check_file(file, LOG_BYTES, failure)
    types = ros_types("bags need rosbags")  # of bags without definitions of their own
    from rosbags.highlevel import AnyReader

    try:
        with AnyReader([path], default_typestore=types) as reader:
            yield reader
    except Fleet2DError:
        raise
    except Exception as error:
        raise failure(f"{path} can't be read as a bag: {one_line(error, 200)}") from error


def stamp_of(message: Any, time: int) -> int:
    """Return the stamp of a message [ns]; the time at which it was recorded if it has none."""
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec) or time


def planar(place: Any, turn: Any) -> tuple[float, float, float]:
    """Return x, y and the heading of a pose in space."""
    x, y, z, w = (float(value) for value in (turn.x, turn.y, turn.z, turn.w))
    heading = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return float(place.x), float(place.y), float(heading)
