"""Messages of ROS 1 and ROS 2, and bags of them, that tests share."""

from typing import Any

import numpy as np

NINE = 1_767_600_000 * 10**9  # 2026-01-05T08:00 UTC, 09:00 in Berlin
Row = tuple[str, str, int, Any]


class Ros:
    """Messages of ROS, and bags of them."""

    def __init__(self, version):
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.version = version
        self.types = get_typestore(Stores.ROS2_HUMBLE if version == 2 else Stores.ROS1_NOETIC)
        if TF not in self.types.types:
            text = "geometry_msgs/TransformStamped[] transforms"
            self.types.register(get_types_from_msg(text, TF))

    def new(self, name, *values):
        return self.types.types[name](*values)

    def header(self, ns, frame):
        stamp = self.new("builtin_interfaces/msg/Time", *divmod(ns, 10**9))
        sequence = () if self.version == 2 else (0,)
        return self.new("std_msgs/msg/Header", *sequence, stamp, frame)

    def pose(self, x, y, heading):
        turn = (0.0, 0.0, float(np.sin(heading / 2)), float(np.cos(heading / 2)))
        return self.new(
            "geometry_msgs/msg/Pose",
            self.new("geometry_msgs/msg/Point", x, y, 0.0),
            self.new("geometry_msgs/msg/Quaternion", *turn),
        )

    def odometry(self, ns, x, y, heading, frame="map", body=""):
        still = self.new("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = self.new("geometry_msgs/msg/Twist", still, still)
        return self.new(
            "nav_msgs/msg/Odometry",
            self.header(ns, frame),
            body or "base_link",
            self.new(
                "geometry_msgs/msg/PoseWithCovariance", self.pose(x, y, heading), np.zeros(36)
            ),
            self.new("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
        )

    def transform(self, ns, parent, child, pose):
        x, y, heading = pose
        turn = self.pose(x, y, heading).orientation
        move = self.new(
            "geometry_msgs/msg/Transform", self.new("geometry_msgs/msg/Vector3", x, y, 0.0), turn
        )
        one = self.new("geometry_msgs/msg/TransformStamped", self.header(ns, parent), child, move)
        return self.new("tf2_msgs/msg/TFMessage", [one])

    def grid(self, ns, cells, pose, resolution=0.05):
        """A map of cells (rows, columns), whose lower left corner is at a pose."""
        header = self.header(ns, "map")
        size = (cells.shape[1], cells.shape[0])
        info = self.new("nav_msgs/msg/MapMetaData", header.stamp, resolution, *size, pose)
        return self.new("nav_msgs/msg/OccupancyGrid", header, info, cells.ravel().astype(np.int8))

    def bag(self, path, rows, storage="SQLITE3"):
        """Write messages: topic, type, time [ns], message."""
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2

        plugin = StoragePlugin[storage]
        writer = (
            Writer2(path, version=9, storage_plugin=plugin) if self.version == 2 else Writer1(path)
        )
        with writer:
            connections = {}
            for topic, kind, ns, message in rows:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self.types)
                serialize = (
                    self.types.serialize_cdr if self.version == 2 else self.types.serialize_ros1
                )
                writer.write(connections[topic], ns, bytes(serialize(message, kind)))
        return path


ODOMETRY = "nav_msgs/msg/Odometry"
TF = "tf2_msgs/msg/TFMessage"


def moved(ros, child, parent="map", x=2.0):
    """Return a transform of `/tf` that moves along x."""
    return "/tf", TF, NINE, ros.transform(NINE, parent, child, (x, 0.0, 0.0))


def stamped(
    ros,
    frame,
    turn=(0.0, 0.0, 0.0, 1.0),
    x=7.0,
    after=0,
):
    """Return a pose at (7, 4), some seconds after nine."""
    ns = NINE + after * 10**9
    kind = "geometry_msgs/msg/PoseStamped"
    place = ros.new("geometry_msgs/msg/Point", x, 4.0, 0.0)
    pose = ros.new("geometry_msgs/msg/Pose", place, ros.new("geometry_msgs/msg/Quaternion", *turn))
    return "/pose", kind, ns, ros.new(kind, ros.header(ns, frame), pose)
