"""A run as ROS 2 messages: topics, types, frames (REP 103, REP 105) and serialized messages.

Frames: `map` is the floor plan's; a robot has `NAME/odom` and `NAME/base_link`, and a user, whose
pose is the truth, `NAME`. A body that is away from home has no transform meanwhile. Stamps are the
local times of the run, taken as UTC, because scenarios have no time zone.
"""

import json
import struct
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from functools import cached_property
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from fleet2d.errors import extra
from fleet2d.kernels import F64, I64, U8
from fleet2d.runs.records import Chunk, Records
from fleet2d.storage.bags import VISION_TYPES

MAP, TRANSFORMS, STATIC = "/map", "/tf", "/tf_static"
UNKNOWN = "unknown"
"""The class of a detected person who wasn't recognized."""
PERSON_M = 0.4
"""Width of the box of a detected person, whose true size no robot knows [m]."""
_LEVELS = 20  # INFO in rcl_interfaces/msg/Log


class Topic(NamedTuple):
    """A topic on which a run is published.

    Attributes:
        name: Its name, such as `/astro/odom`.
        type: The type of its messages, such as `nav_msgs/msg/Odometry`.
        latched: Whether its last message is also delivered to later subscribers.
    """

    name: str
    type: str
    latched: bool = False


class Message(NamedTuple):
    """A message: its time [ns since 1970], topic and content (CDR, little endian)."""

    time: int
    topic: str
    data: bytes


class RosMessages:
    """The ROS 2 messages of a part of a run.

    Attributes:
        topics: The topics by name.
        types: The library's store of message types.
    """

    def __init__(self, records: Records) -> None:
        """Find out what topics there are.

        Raises:
            InputError: rosbags isn't installed.
        """
        with extra("ros", "ROS messages need rosbags"):
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.types = get_typestore(Stores.ROS2_HUMBLE)
        for name, definition in VISION_TYPES.items():
            self.types.register(get_types_from_msg(definition, name))
        self._records = records
        self._run = records.run
        start = datetime.fromisoformat(self._run.manifest["start"])
        self._start_ns = int(start.replace(tzinfo=UTC).timestamp()) * 1_000_000_000
        self._step_ns = self._run.manifest["step_us"] * 1000
        topics = [
            Topic(MAP, "nav_msgs/msg/OccupancyGrid", latched=True),
            Topic(TRANSFORMS, "tf2_msgs/msg/TFMessage"),
            Topic(STATIC, "tf2_msgs/msg/TFMessage", latched=True),
            *(Topic(f"/{robot}/odom", "nav_msgs/msg/Odometry") for robot in records.robots),
            *(
                Topic(f"/{robot}/detections", "vision_msgs/msg/Detection3DArray")
                for robot in records.robots
                if "observations" in records.tables
            ),
            *(
                Topic(f"/{name}", self._encoders[name][0])
                for name in records.tables
                if name != "observations"
            ),
        ]
        self.topics = {topic.name: topic for topic in topics}

    def definition(self, topic: Topic) -> str:
        """Return the definition of a topic's type and of all types in it, as ROS writes it."""
        return str(self.types.generate_msgdef(topic.type, ros_version=2)[0])

    def __iter__(self) -> Iterator[Message]:
        """Yield all messages in order of time.

        Raises:
            ArtifactError: The run stored no key frames, or a table can't be read.
        """
        begin = self._time(self._records.part.first)
        yield Message(begin, MAP, self._map(begin))
        yield Message(begin, STATIC, self._static_transforms(begin))
        last: dict[str, tuple[float, float, float]] = {}
        for chunk in self._records.chunks():
            messages: list[Message] = []
            if chunk.poses:
                messages += self._transforms(chunk)
                for robot in self._records.robots:
                    messages += self._odometry(chunk, robot, last)
            for name, rows in chunk.rows.items():
                messages += (
                    self._detections(rows) if name == "observations" else self._rows(name, rows)
                )
            messages.sort(key=itemgetter(0))
            yield from messages

    def _time(self, step: int) -> int:
        return self._start_ns + int(step) * self._step_ns

    def _new(self, name: str, *values: Any) -> Any:
        return self.types.types[name](*values)

    def _header(self, time: int, frame: str) -> Any:
        stamp = self._new("builtin_interfaces/msg/Time", *divmod(time, 1_000_000_000))
        return self._new("std_msgs/msg/Header", stamp, frame)

    def _data(self, message: Any) -> bytes:
        return bytes(self.types.serialize_cdr(message, message.__msgtype__))

    def _map(self, time: int) -> bytes:
        plan = self._run.plan
        lattice = plan.lattice
        stamp = self._header(time, "map").stamp
        x, y = lattice.origin
        corner = self._pose(x, y, 0.0, 1.0)
        info = self._new(
            "nav_msgs/msg/MapMetaData", stamp, lattice.cell, lattice.columns, lattice.rows, corner
        )
        grid = np.where(plan.free, 0, 100).astype(np.int8).ravel()
        header = self._header(time, "map")
        return self._data(self._new("nav_msgs/msg/OccupancyGrid", header, info, grid))

    def _pose(self, x: float, y: float, z: float, w: float) -> Any:
        """Return the pose at (x, y) whose quaternion has a z and w."""
        point = self._new("geometry_msgs/msg/Point", x, y, 0.0)
        return self._new("geometry_msgs/msg/Pose", point, self._turn(z, w))

    def _turn(self, z: float, w: float) -> Any:
        return self._new("geometry_msgs/msg/Quaternion", 0.0, 0.0, z, w)

    def _transform(self, time: int, frames: tuple[str, str], xyzw: Sequence[float]) -> Any:
        x, y, z, w = xyzw
        vector = self._new("geometry_msgs/msg/Vector3", x, y, 0.0)
        transform = self._new("geometry_msgs/msg/Transform", vector, self._turn(z, w))
        return self._new(
            "geometry_msgs/msg/TransformStamped",
            self._header(time, frames[0]),
            frames[1],
            transform,
        )

    def _static_transforms(self, time: int) -> bytes:
        """Odometry in Fleet2D doesn't drift from the map: errors of localization are in beliefs."""
        frames = [("map", f"{robot}/odom") for robot in self._records.robots]
        still = [self._transform(time, pair, (0.0, 0.0, 0.0, 1.0)) for pair in frames]
        return self._data(self._new("tf2_msgs/msg/TFMessage", still))

    def _frames(self, name: str) -> tuple[str, str]:
        is_robot = name in self._records.robots
        return (f"{name}/odom", f"{name}/base_link") if is_robot else ("map", name)

    def _transforms(self, chunk: Chunk) -> list[Message]:
        """Return a message for each time, with all bodies that are at home."""
        names = list(chunk.poses)
        home = np.stack([~path.away for path in chunk.poses.values()], axis=-1)
        times = self._start_ns + chunk.poses[names[0]].step * self._step_ns
        messages: list[Message] = []
        for present in np.unique(home, axis=0):
            at = np.flatnonzero((home == present).all(axis=1))
            who = [name for name, is_home in zip(names, present, strict=True) if is_home]
            template = self._transform_template(tuple(who))
            values = [_planar(chunk.poses[name], at) for name in who]
            stamps = times[at]
            data = template.fill([stamps] * len(who), [v for four in values for v in four], len(at))
            messages += [
                Message(time, TRANSFORMS, one)
                for time, one in zip(stamps.tolist(), data, strict=True)
            ]
        return messages

    def _transform_template(self, names: tuple[str, ...]) -> "Template":
        def message(times: Sequence[int], values: Sequence[float]) -> bytes:
            fours = [values[4 * i : 4 * i + 4] for i in range(len(names))]
            parts = [
                self._transform(time, self._frames(name), four)
                for time, name, four in zip(times, names, fours, strict=True)
            ]
            return self._data(self._new("tf2_msgs/msg/TFMessage", parts))

        return Template(message, len(names), 4 * len(names))

    def _odometry(
        self, chunk: Chunk, robot: str, last: dict[str, tuple[float, float, float]]
    ) -> list[Message]:
        path = chunk.poses[robot]
        if not len(path.x):
            return []
        before = last.get(robot, (path.x[0], path.y[0], path.heading[0]))
        last[robot] = (path.x[-1], path.y[-1], path.heading[-1])
        passed = self._records.part.every.total_seconds()
        dx, dy = np.diff(path.x, prepend=before[0]), np.diff(path.y, prepend=before[1])
        turned = np.diff(path.heading, prepend=before[2])
        turned = (turned + np.pi) % (2 * np.pi) - np.pi
        cos, sin = np.cos(path.heading), np.sin(path.heading)
        speeds = ((dx * cos + dy * sin) / passed, (dy * cos - dx * sin) / passed, turned / passed)
        at = np.flatnonzero(~path.away)
        stamps = self._start_ns + path.step[at] * self._step_ns
        values = [*_planar(path, at), *(speed[at] for speed in speeds)]
        data = self._odometry_template(robot).fill([stamps], values, len(at))
        topic = f"/{robot}/odom"
        return [Message(time, topic, one) for time, one in zip(stamps.tolist(), data, strict=True)]

    def _odometry_template(self, robot: str) -> "Template":
        def message(times: Sequence[int], values: Sequence[float]) -> bytes:
            x, y, z, w, forward, left, turning = values
            pose = self._pose(x, y, z, w)
            exact = np.zeros(36)
            twist = self._new(
                "geometry_msgs/msg/Twist",
                self._new("geometry_msgs/msg/Vector3", forward, left, 0.0),
                self._new("geometry_msgs/msg/Vector3", 0.0, 0.0, turning),
            )
            odom, base = self._frames(robot)
            return self._data(
                self._new(
                    "nav_msgs/msg/Odometry",
                    self._header(times[0], odom),
                    base,
                    self._new("geometry_msgs/msg/PoseWithCovariance", pose, exact),
                    self._new("geometry_msgs/msg/TwistWithCovariance", twist, exact),
                )
            )

        return Template(message, 1, 7)

    def _detections(self, rows: Sequence[dict[str, Any]]) -> list[Message]:
        """Return a message for each look in which a robot perceived somebody."""
        looks: dict[tuple[int, str], list[dict[str, Any]]] = {}
        for row in rows:
            looks.setdefault((row["step"], row["robot"]), []).append(row)
        alike: dict[tuple[str, ...], list[tuple[int, list[float]]]] = {}
        for (step, robot), seen in looks.items():
            who = (robot, *(row["user"] or UNKNOWN for row in seen))
            poses = [v for row in seen for v in (row["x"], row["y"], row.get("heading") or 0.0)]
            alike.setdefault(who, []).append((self._time(step), poses))
        messages: list[Message] = []
        for (robot, *users), these in alike.items():
            times = np.array([time for time, _ in these], np.int64)
            numbers = np.array([poses for _, poses in these]).T.reshape(len(users), 3, len(these))
            values = [v for x, y, h in numbers for v in (x, y, *_quaternion(h)) * 2]
            stamps = [times] * (len(users) + 1)
            data = self._detection_template(tuple(users)).fill(stamps, values, len(these))
            topic = f"/{robot}/detections"
            messages += [
                Message(t, topic, one) for t, one in zip(times.tolist(), data, strict=True)
            ]
        return messages

    def _detection_template(self, users: tuple[str, ...]) -> "Template":
        def message(times: Sequence[int], values: Sequence[float]) -> bytes:
            numbers = [values[8 * i : 8 * i + 8] for i in range(len(users))]
            detections = [
                self._detection(self._header(time, "map"), user, of_user)
                for time, user, of_user in zip(times[1:], users, numbers, strict=True)
            ]
            header = self._header(times[0], "map")
            return self._data(self._new("vision_msgs/msg/Detection3DArray", header, detections))

        return Template(message, len(users) + 1, 8 * len(users))

    def _detection(self, header: Any, user: str, places: Sequence[float]) -> Any:
        """Return a detection from the numbers of its pose and of its box's centre."""
        x, y, z, w, *centre = places
        exact = np.zeros(36)
        likely = self._new(
            "vision_msgs/msg/ObjectHypothesisWithPose",
            self._new("vision_msgs/msg/ObjectHypothesis", user, 1.0),
            self._new("geometry_msgs/msg/PoseWithCovariance", self._pose(x, y, z, w), exact),
        )
        size = self._new("geometry_msgs/msg/Vector3", PERSON_M, PERSON_M, 0.0)
        box = self._new("vision_msgs/msg/BoundingBox3D", self._pose(*centre), size)
        return self._new("vision_msgs/msg/Detection3D", header, [likely], box, user)

    @cached_property
    def _encoders(self) -> "_Encoders":
        return _Encoders(self)

    def _rows(self, name: str, rows: Sequence[dict[str, Any]]) -> list[Message]:
        _, encode = self._encoders[name]
        return [Message(self._time(row["step"]), f"/{name}", encode(row)) for row in rows]

    def log_entry(self, row: dict[str, Any]) -> bytes:
        """Return an event as an entry of a log: who, what, details."""
        detail = " ".join(str(row[key]) for key in ("user", "detail") if row.get(key))
        stamp = self._header(self._time(row["step"]), "").stamp
        fields = (
            stamp,
            _LEVELS,
            row["entity"],
            f"{row['event']} {detail}".strip(),
            "",
            row["event"],
            0,
        )
        return self._data(self._new("rcl_interfaces/msg/Log", *fields))

    def json_text(self, row: dict[str, Any]) -> bytes:
        """Return a row of any table as JSON in a string."""
        return self._data(self._new("std_msgs/msg/String", json.dumps(row, default=str)))


class _Encoders(dict[str, tuple[str, Callable[[dict[str, Any]], bytes]]]):
    """The type of message and the function that makes it, for rows of a table."""

    def __init__(self, messages: RosMessages) -> None:
        super().__init__(events=("rcl_interfaces/msg/Log", messages.log_entry))
        self._messages = messages

    def __missing__(self, table: str) -> tuple[str, Callable[[dict[str, Any]], bytes]]:
        return "std_msgs/msg/String", self._messages.json_text


class Template:
    """Messages that differ only in some numbers: serialized once, then filled in as arrays."""

    def __init__(
        self, message: Callable[[Sequence[int], Sequence[float]], bytes], times: int, values: int
    ) -> None:
        """Serialize a message with numbers that stand nowhere else, to find their places."""
        stamps = [(1_000_000_007 + i) * 1_000_000_000 + 999_000_001 + i for i in range(times)]
        floats = [1.2345678901234e200 * (i + 1) for i in range(values)]
        data = message(stamps, floats)
        self._bytes = np.frombuffer(data, np.uint8)
        self._stamps = [data.index(struct.pack("<iI", *divmod(s, 1_000_000_000))) for s in stamps]
        self._floats = [data.index(struct.pack("<d", value)) for value in floats]

    def fill(self, stamps: Sequence[I64], values: Sequence[F64], count: int) -> Iterator[bytes]:
        """Yield messages with other times [ns] and numbers, each an array (count,)."""
        filled: U8 = np.tile(self._bytes, (count, 1))
        for place, times in zip(self._stamps, stamps, strict=True):
            pairs = np.stack(np.divmod(times, 1_000_000_000), axis=-1).astype("<u4")
            filled[:, place : place + 8] = pairs.view(np.uint8)
        for place, numbers in zip(self._floats, values, strict=True):
            column = np.ascontiguousarray(numbers, dtype="<f8").view(np.uint8).reshape(count, 8)
            filled[:, place : place + 8] = column
        size, data = filled.shape[1], filled.tobytes()
        return (data[at : at + size] for at in range(0, size * count, size))


def _quaternion(heading: Any) -> tuple[Any, Any]:
    """Return z and w of the turn about the vertical axis."""
    return np.sin(heading / 2), np.cos(heading / 2)


def _planar(path: Any, at: I64) -> tuple[F64, F64, F64, F64]:
    """Return x, y, and the z and w of the quaternion, of some poses."""
    return (path.x[at], path.y[at], *_quaternion(path.heading[at]))
