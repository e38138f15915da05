"""Poses of ROS 1 and ROS 2 bags: odometry, pose topics and frames of `/tf`, without ROS."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from fleet2d.bounds import BAG_SECONDS, FIXES
from fleet2d.configuration.problems import did_you_mean
from fleet2d.logs.frames import MAP, FrameTree, RigidMotions, StampedPoses, frame_name
from fleet2d.logs.log import LogError, PositionLog
from fleet2d.logs.positions import RawFixes, localize
from fleet2d.logs.times import Stamps
from fleet2d.runtime.local_time import Zone
from fleet2d.storage.apart import apart
from fleet2d.storage.bags import check_bag, headings_of, numbers_of, open_bag, stamp_ns, times_of

# From a message to its place and its quaternion.
_POSES: dict[str, Callable[[Any], tuple[Any, Any]]] = {
    "nav_msgs/msg/Odometry": lambda message: _parts(message.pose.pose),
    "geometry_msgs/msg/PoseStamped": lambda message: _parts(message.pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda message: _parts(message.pose.pose),
    "geometry_msgs/msg/TransformStamped": lambda message: (
        message.transform.translation,
        message.transform.rotation,
    ),
}
# The frames of a robot that say where it is, in any namespace.
_BASES = ("base_link", "base_footprint")


def _parts(pose: Any) -> tuple[Any, Any]:
    return pose.position, pose.orientation


def read_bag(
    path: Path,
    *,
    id: str | None = None,  # noqa: A002 - what positions call it
    frame: str = MAP,
    time_zone: Zone | str | None = None,
    sort: bool = False,
) -> PositionLog:
    """Read the poses of one topic or frame.

    Poses of a topic are those of its messages. Those in another frame than the map are transformed
    by the `/tf` and `/tf_static` of the bag: between two transforms as tf2 does, after the last
    one by it. Poses before the first one are left out.

    Args:
        path: A ROS 1 bag, the folder of a ROS 2 bag, or one of its files (.mcap, .db3).
        id: The topic, such as "/odom", or the frame of `/tf`, such as "base_link"; needed if there
            are several.
        frame: The frame in which positions are returned, in any namespace.
        time_zone: The time zone of the home, like "Europe/Berlin"; needed unless the clock of the
            bag was simulated.
        sort: Put messages in order of their stamps instead of refusing stamps that run backwards.

    Raises:
        LogError: The bag can't be read, has no such topic or frame, or no transforms from its frame
            to `frame`.
        InputError: rosbags isn't installed.
    """
    check_bag(path, LogError)
    arguments = path, id, frame
    fixes = apart(path, _fixes, *arguments, failure=LogError, seconds=BAG_SECONDS)
    return localize(path, "bag", fixes, time_zone=time_zone, sort=sort)


def _fixes(path: Path, name: str | None, frame: str) -> RawFixes:
    """Return the poses of a topic or frame, as they are in another frame; in the child."""
    with open_bag(path, LogError) as reader:
        tree = FrameTree(reader, path)
        source, poses, notes = _poses(reader, tree, name, frame)
        motions, is_known = poses.seen_from(frame, tree, source, notes)
    x, y, _ = motions.place.T
    heading = headings_of(motions.turn)
    if without := int(np.isnan(heading).sum()):
        notes.append(f"{without} poses have no heading: their quaternion is 0 or not a number")
    if steep := int(motions.is_steep().sum()):
        notes.append(f"{steep} poses are tilted by more than 45 degrees: their heading says little")
    if not is_known.any():
        raise LogError(f"{path}: {source}: no pose is left: {'; '.join(notes)}")
    stamps = Stamps.of_messages(poses.time[is_known])
    return RawFixes(stamps, x[is_known], y[is_known], heading[is_known], notes)


def _poses(
    reader: Any, tree: FrameTree, name: str | None, target: str
) -> tuple[str, StampedPoses, list[str]]:
    """Return the name and the poses of a topic or frame, and lines about them."""
    path = tree.path
    topics = {c.topic: c.msgtype for c in reader.connections if c.msgtype in _POSES}
    if name is None and len(topics) == 1:
        name = next(iter(topics))
    if name is not None and name in topics:
        return name, *_of_topic(reader, path, name)
    if name is None or frame_name(name) not in tree.links:
        known = [*topics, *tree.links]
        if not known:
            names = ", ".join(sorted({c.topic for c in reader.connections})[:20])
            raise LogError(f"{path} has no poses: no odometry, poses or /tf among {names}")
        which = (
            f"no topic or frame {name!r}{did_you_mean(name, known)}" if name else "several poses"
        )
        raise LogError(f"{path} has {which}: select one by 'id': {', '.join(known[:20])}")
    return name, *_of_frame(tree, frame_name(name), target)


def _of_topic(reader: Any, path: Path, topic: str) -> tuple[StampedPoses, list[str]]:
    connections = [c for c in reader.connections if c.topic == topic and c.msgtype in _POSES]
    FIXES.check(sum(c.msgcount for c in connections), path, LogError)
    stamps = list[int]()
    recorded = list[int]()
    frames = list[str]()
    rows = list[list[float]]()
    bodies: dict[str, None] = {}
    for connection, time, data in reader.messages(connections):
        message = reader.deserialize(data, connection.msgtype)
        stamps.append(stamp_ns(message))
        recorded.append(time)
        frames.append(frame_name(message.header.frame_id))
        rows.append(numbers_of(*_POSES[connection.msgtype](message)))
        bodies[frame_name(getattr(message, "child_frame_id", ""))] = None
    times = times_of(np.array(stamps, np.int64), np.array(recorded, np.int64))
    notes = [f"{topic}: {_count(len(rows), frames)}"]
    others = [body for body in bodies if body and body.rpartition("/")[2] not in _BASES]
    notes += [f"{topic}: these are poses of {body!r}, not of a base_link" for body in others]
    return StampedPoses(times, frames, RigidMotions.of_rows(rows)), notes


def _of_frame(tree: FrameTree, frame: str, target: str) -> tuple[StampedPoses, list[str]]:
    """Return the poses of a frame at the times of the fastest link between it and another one."""
    rise, fall = tree.way_to(frame, target, frame)
    moving = [link for link in (*rise, *fall) if not link.is_static]
    if not moving:
        raise LogError(f"{tree.path}: the frame {frame!r} never moves in {target!r}")
    fastest = max(moving, key=lambda link: len(link.rows))
    time = fastest.time
    poses = StampedPoses(time, [frame] * len(time), RigidMotions.still(len(time)))
    return poses, [f"{frame}: {_count(len(time), [target])}"]


def _count(count: int, frames: list[str]) -> str:
    named = ", ".join(repr(frame) for frame in dict.fromkeys(frames))
    return f"{count} poses in the frame {named}"
