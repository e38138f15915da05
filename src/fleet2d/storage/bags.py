"""Bags of ROS 1 and ROS 2, read without ROS."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.bounds import LOG_BYTES, check_file, one_line
from fleet2d.errors import Fleet2DError, InputError, extra
from fleet2d.kernels import F64, I64
from fleet2d.storage.files import refuse_links

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

LOG_TYPE = "foxglove_msgs/msg/Log"
LOG_LEVELS = {"INFO": 2, "WARN": 3, "ERROR": 4}
"""The levels of Foxglove's message of a log."""
LOG_TYPES = {
    LOG_TYPE: (
        "builtin_interfaces/Time timestamp\nuint8 UNKNOWN=0\nuint8 DEBUG=1\nuint8 INFO=2\n"
        "uint8 WARNING=3\nuint8 ERROR=4\nuint8 FATAL=5\nuint8 level\nstring message\n"
        "string name\nstring file\nuint32 line\n"
    ),
}

LATEST_SIMULATED_NS = 10**17
"""Stamps below are of a simulated clock [ns]: three years."""

# A shorter quaternion has no meaningful direction.
SHORTEST = 1e-3
_BAGS = (".bag", ".mcap", ".db3")
METADATA = "metadata.yaml"


def is_bag(path: Path) -> bool:
    """Return whether a file or folder is a bag of ROS, by its name."""
    if path.is_dir():
        return (path / METADATA).is_file()
    return path.suffix.lower() in _BAGS


def ros_types(need: str) -> Any:
    """Return the types of messages of ROS 2, with those of vision_msgs.

    Args:
        need: The beginning of the message, such as "bags need rosbags".

    Raises:
        InputError: rosbags isn't installed.
    """
    with extra("ros", need):
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in {**VISION_TYPES, **LOG_TYPES}.items():
        types.register(get_types_from_msg(definition, name))
    return types


def check_bag(path: Path, failure: type[InputError]) -> None:
    """Refuse a bag with links in its folder, or a file that is too large or not to be opened.

    Raises:
        InputError: The bag is refused; of the type `failure`.
    """
    if path.is_dir():
        refuse_links(path)
    for file in path.iterdir() if path.is_dir() else (path,):
        check_file(file, LOG_BYTES, failure)


@contextmanager
def open_bag(path: Path, failure: type[InputError] = InputError) -> Iterator[Any]:
    """Open a ROS 1 or ROS 2 bag for reading, once from its beginning to its end.

    Chunks and databases of a bag may unpack to any size, for which rosbags has no bound: only a
    child process opens one.

    Args:
        path: The bag: a file, or the folder of a ROS 2 bag.
        failure: The type of the error about a bag that can't be read.

    Raises:
        InputError: The bag can't be read, or rosbags isn't installed.
    """
    types = ros_types("bags need rosbags")  # for bags without definitions of their own
    from rosbags.highlevel import AnyReader

    try:
        with AnyReader([path], default_typestore=types) as reader:
            yield reader
    except (Fleet2DError, MemoryError):
        raise
    except Exception as error:
        raise failure(f"{path} can't be read as a bag: {one_line(error, 200)}") from error


def stamp_ns(message: Any) -> int:
    """Return the stamp of a message [ns], 0 if it has none."""
    stamp = message.header.stamp if hasattr(message, "header") else None
    return 0 if stamp is None else int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def times_of(stamps: I64, recorded: I64) -> I64:
    """Return the times of messages [ns]: their stamps, or the times of recording if these are 0.

    A simulated clock begins at 0, so among its stamps 0 is valid.
    """
    latest = int(stamps.max(initial=0))
    has_zeros = latest == 0 or latest >= LATEST_SIMULATED_NS
    return np.where(stamps == 0, recorded, stamps) if has_zeros else stamps


def numbers_of(place: Any, turn: Any) -> list[float]:
    """Return x, y, z of a place, and x, y, z, w of a quaternion."""
    numbers = (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)
    return [float(number) for number in numbers]


def unit_turns(turns: F64) -> F64:
    """Return quaternions x, y, z, w scaled to length 1, float64 (n, 4); NaN for invalid ones."""
    with np.errstate(all="ignore"):
        length = np.sqrt((turns * turns).sum(axis=1, keepdims=True))
        return np.where((length > SHORTEST) & (length < np.inf), turns / length, np.nan)


def headings_of(turns: F64) -> F64:
    """Return the headings of quaternions of any length [rad], float64 (n,).

    Args:
        turns: Their x, y, z and w, float64 (n, 4). All zeros, and NaN, have no heading: NaN.

    Example:
        >>> headings_of(np.array([[0.0, 0.0, 1.414, 1.414], [0.0, 0.0, 0.0, 0.0]])).round(4)
        array([1.5708,    nan])
    """
    x, y, z, w = unit_turns(turns).T
    heading: F64 = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return heading
