"""Bags of ROS 1 and ROS 2, read without ROS."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import quote

import numpy as np

from fleet2d.bounds import CHUNK_BYTES, LOG_BYTES, METADATA_BYTES, Bound, check_file, one_line
from fleet2d.errors import Fleet2DError, InputError, extra
from fleet2d.kernels import F64, I64
from fleet2d.storage.archives import unpacked
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

LATEST_SIMULATED_NS = 10**17
"""Stamps below are of a simulated clock [ns]: three years."""

# A quaternion that is shorter says nothing.
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
    """Open a ROS 1 or ROS 2 bag for reading, once from its beginning to its end.

    Args:
        path: The bag: a file, or the folder of a ROS 2 bag.
        failure: The type of the error about a bag that can't be read.

    Raises:
        InputError: It can't be read, is beyond a bound, or rosbags isn't installed.
    """
    limits = _Limits(path, failure)
    if path.is_dir():
        refuse_links(path)
    for file in path.iterdir() if path.is_dir() else (path,):
        check_file(file, METADATA_BYTES if file.name == METADATA else LOG_BYTES, failure)
    types = ros_types("bags need rosbags")  # of bags without definitions of their own
    from rosbags.highlevel import AnyReader

    _guard_rosbags()
    _LIMITS.set(limits)
    try:
        for file in path.glob("*.zstd"):
            for _ in limits.blocks(file, "zstd", LOG_BYTES):
                pass
        with AnyReader([path], default_typestore=types) as reader:
            limits.total = 0  # opening an unindexed one unpacks all of it
            yield reader
    except Fleet2DError:
        raise
    except Exception as error:
        raise failure(f"{path} can't be read as a bag: {one_line(error, 200)}") from error
    finally:
        _LIMITS.set(None)


@dataclass
class _Limits:
    """What a bag may unpack to.

    Attributes:
        path: The bag.
        failure: The type of the error about one that exceeds it.
        total: How much was unpacked so far [bytes].
    """

    path: Path
    failure: type[InputError]
    total: int = 0

    def blocks(self, packed: object, compression: str, bound: Bound) -> Iterator[bytes]:
        """Yield what a part of the bag unpacks to; a part has a bound of its own."""
        size = 0
        for block in unpacked(packed, compression):
            size += len(block)
            self.total += len(block)
            bound.check(size, self.path, self.failure, prefix="more than ")
            LOG_BYTES.check(self.total, self.path, self.failure, prefix="more than ")
            yield block

    def check_database(self, path: Path) -> None:
        """Refuse a bag in SQLite whose tables aren't plain, or with a message beyond the bound.

        A view may have endless rows, and a generated column a gigabyte in each.
        """
        uri = f"file:{quote(str(path))}?immutable=1"
        with closing(sqlite3.connect(uri, uri=True)) as database:
            kinds = database.execute("SELECT type, sql FROM sqlite_master").fetchall()
            columns = database.execute("SELECT hidden FROM pragma_table_xinfo('messages')")
            is_plain = all(kind in ("table", "index") for kind, _ in kinds)
            is_virtual = any("VIRTUAL" in str(sql).upper() for _, sql in kinds)
            if not is_plain or is_virtual or any(hidden for (hidden,) in columns):
                raise self.failure(f"{path} has more than the tables of a bag: record it again")
            longest = database.execute("SELECT max(length(data)) FROM messages").fetchone()[0]
        CHUNK_BYTES.check(longest or 0, self.path, self.failure)


_LIMITS: ContextVar[_Limits | None] = ContextVar("limits", default=None)
"""Those of the bag that is being read; None: rosbags is used by others."""


def _guarded(unpack: Callable[..., bytes], compression: str) -> Callable[..., bytes]:
    """Return a function of rosbags that unpacks, with the limits of the bag that is read."""

    def guarded(packed: bytes, *rest: Any) -> bytes:
        limits = _LIMITS.get()
        if limits is None:
            return unpack(packed, *rest)
        return b"".join(limits.blocks(packed, compression, CHUNK_BYTES))

    return guarded


@cache
def _guard_rosbags() -> None:
    """Let rosbags keep the limits of a bag, for which it has no setting: a bomb fills the memory.

    Sizes in the bag can't be trusted, and its index may name the same chunk a thousand times: only
    what is unpacked can be counted.
    """
    from rosbags.rosbag1 import reader as ros1
    from rosbags.rosbag2 import reader as ros2
    from rosbags.rosbag2 import storage_mcap
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

    for unpackers in (ros1.decompressors, storage_mcap.DECOMPRESSORS):
        for name in {"bz2", "lz4", "zstd"} & unpackers.keys():
            unpackers[name] = _guarded(unpackers[name], name)
    zstd = ros2.zstd
    guarded = _guarded(zstd.decompress, "zstd")
    ros2.zstd = SimpleNamespace(decompress=guarded, open=zstd.open)
    open_database = Sqlite3Reader.open

    def open_guarded(reader: Any) -> None:
        limits = _LIMITS.get()
        if limits is not None:
            limits.check_database(Path(reader.path))
        open_database(reader)

    Sqlite3Reader.open = open_guarded


def stamp_ns(message: Any) -> int:
    """Return the stamp of a message [ns], 0 if it has none."""
    stamp = message.header.stamp if hasattr(message, "header") else None
    return 0 if stamp is None else int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def times_of(stamps: I64, recorded: I64) -> I64:
    """Return the times of messages [ns]: their stamps, or when they were recorded if these are 0.

    A simulated clock begins at 0, so that this is one of its stamps.
    """
    latest = int(stamps.max(initial=0))
    has_zeros = latest == 0 or latest >= LATEST_SIMULATED_NS
    return np.where(stamps == 0, recorded, stamps) if has_zeros else stamps


def numbers_of(place: Any, turn: Any) -> list[float]:
    """Return x, y, z of a place, and x, y, z, w of a quaternion."""
    numbers = (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)
    return [float(number) for number in numbers]


def unit_turns(turns: F64) -> F64:
    """Return quaternions x, y, z, w at the length 1, float64 (n, 4); NaN if they are none."""
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
