"""Poses of ROS 1 and ROS 2 bags: odometry, pose topics and frames of `/tf`, without ROS."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fleet2d.bounds import FIXES
from fleet2d.configuration.problems import did_you_mean
from fleet2d.kernels import F64, I64
from fleet2d.logs.log import LogError, PositionLog
from fleet2d.logs.positions import RawFixes, localize
from fleet2d.logs.times import Stamps
from fleet2d.storage.bags import open_bag, planar, stamp_of

TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")

# From a message to its pose: with a position and an orientation.
_POSES: dict[str, Callable[[Any], Any]] = {
    "nav_msgs/msg/Odometry": lambda message: message.pose.pose,
    "geometry_msgs/msg/PoseStamped": lambda message: message.pose,
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda message: message.pose.pose,
}


class _PlanarPoses(NamedTuple):
    """Planar poses over time.

    Attributes:
        time: Stamps [ns], int64 (n,).
        x, y: float64 (n,) [m].
        heading: float64 (n,) [rad].
    """

    time: I64
    x: F64
    y: F64
    heading: F64


def read_bag(
    path: Path,
    *,
    id: str | None = None,  # noqa: A002 - what positions call it
    time_zone: str | None = None,
    sort: bool = False,
) -> PositionLog:
    """Read the poses of one topic or frame.

    Poses of a topic are those of its messages. The pose of a frame is that in the root of its tree
    of transforms, such as `map`: between two messages about a link, the earlier one holds.

    Args:
        path: A ROS 1 bag, the folder of a ROS 2 bag, or one of its files (.mcap, .db3).
        id: The topic, such as "/odom", or the frame of `/tf`, such as "base_link"; needed if there
            are several.
        time_zone: The time zone of the home, like "Europe/Berlin"; needed unless the clock of the
            bag was simulated.
        sort: Put messages in order of their stamps instead of refusing stamps that run backwards.

    Raises:
        LogError: The bag can't be read, or has no such topic or frame.
        InputError: rosbags isn't installed.
    """
    with open_bag(path, LogError) as reader:
        poses, source = _poses(reader, path, id)
    fixes = RawFixes(Stamps.of_messages(poses.time), poses.x, poses.y, poses.heading, [source])
    return localize(path, "bag", fixes, time_zone=time_zone, sort=sort)


def _poses(reader: Any, path: Path, name: str | None) -> tuple[_PlanarPoses, str]:
    """Return the poses of a topic or frame, and a line about them."""
    topics = {c.topic: c for c in reader.connections if c.msgtype in _POSES}
    if name is None and len(topics) == 1:
        name = next(iter(topics))
    if name in topics:
        connection = topics[name]
        FIXES.check(connection.msgcount, path, LogError)
        pose_of = _POSES[connection.msgtype]
        rows, frame = [], ""
        for _, time, data in reader.messages([connection]):
            message = reader.deserialize(data, connection.msgtype)
            frame = message.header.frame_id
            pose = pose_of(message)
            rows.append((stamp_of(message, time), *planar(pose.position, pose.orientation)))
        return _columns(rows), f"{name}: {len(rows)} poses in the frame {frame!r}"
    links = _links(reader, path)
    if name is None or name not in links:
        known = [*topics, *links]
        if not known:
            names = ", ".join(sorted({c.topic for c in reader.connections})[:20])
            raise LogError(f"{path} has no poses: no odometry, poses or /tf among {names}")
        which = (
            f"no topic or frame {name!r}{did_you_mean(name, known)}" if name else "several poses"
        )
        raise LogError(f"{path} has {which}: select one by 'id': {', '.join(known[:20])}")
    poses, root = _in_root(links, name, path)
    return poses, f"{name}: {len(poses.time)} poses in the frame {root!r}"


def _columns(rows: list[tuple[int, float, float, float]]) -> _PlanarPoses:
    time = np.array([row[0] for row in rows], np.int64)
    x, y, heading = np.array([row[1:] for row in rows], np.float64).reshape(-1, 3).T
    return _PlanarPoses(time, x, y, heading)


def _links(reader: Any, path: Path) -> dict[str, tuple[str, _PlanarPoses]]:
    """Return each frame's parent, and its poses in the parent."""
    connections = [c for c in reader.connections if c.msgtype in TRANSFORMS]
    FIXES.check(sum(c.msgcount for c in connections), path, LogError)
    rows: dict[str, list[tuple[int, float, float, float]]] = {}
    parents: dict[str, str] = {}
    for connection, time, data in reader.messages(connections) if connections else ():
        for one in reader.deserialize(data, connection.msgtype).transforms:
            child, parent = one.child_frame_id.lstrip("/"), one.header.frame_id.lstrip("/")
            if parents.setdefault(child, parent) != parent:
                both = f"{parents[child]!r} and {parent!r}"
                raise LogError(f"{path}: the frame {child!r} has two parents, {both}")
            # A link that never changes holds at all times.
            stamp = 0 if connection.topic == "/tf_static" else stamp_of(one, time)
            pose = planar(one.transform.translation, one.transform.rotation)
            rows.setdefault(child, []).append((stamp, *pose))
            FIXES.check(len(rows[child]), path, LogError)
    return {child: (parents[child], _columns(rows[child])) for child in rows}


def _in_root(
    links: dict[str, tuple[str, _PlanarPoses]], frame: str, path: Path
) -> tuple[_PlanarPoses, str]:
    """Return the poses of a frame in the root of its tree, at the times of its fastest link."""
    chain = [frame]
    while chain[-1] in links:
        parent = links[chain[-1]][0]
        if parent in chain:
            raise LogError(f"{path}: the transforms form a circle: {' > '.join([*chain, parent])}")
        chain.append(parent)
    fastest = max(chain[:-1], key=lambda name: len(links[name][1].time))
    time = links[fastest][1].time
    begins = max(int(links[name][1].time.min()) for name in chain[:-1])
    time = time[time >= begins]  # before, a link is unknown
    x, y, heading = np.zeros(len(time)), np.zeros(len(time)), np.zeros(len(time))
    for name in chain[:-1]:
        link = links[name][1]
        order = np.argsort(link.time, kind="stable")
        at = order[np.searchsorted(link.time[order], time, side="right") - 1]
        turn = link.heading[at]
        cos, sin = np.cos(turn), np.sin(turn)
        x, y = link.x[at] + cos * x - sin * y, link.y[at] + sin * x + cos * y
        heading = heading + turn
    return _PlanarPoses(time, x, y, (heading + np.pi) % (2 * np.pi) - np.pi), chain[-1]
