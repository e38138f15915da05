"""A run as ROS 2 messages: topics, types, frames (REP 103, REP 105) and serialized messages.

Frames: `map` is the floor plan's; a robot has `NAME/odom` and `NAME/base_link`, and a user, whose
pose is the truth, `NAME`. A body that is away from home has no transform meanwhile. Stamps are the
local times of the run, taken as UTC; of a home with a time zone they are UTC.
"""

import json
import struct
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter, itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fleet2d.kernels import F64, I64, U8
from fleet2d.live.exporters import Chunk, Records, words_of
from fleet2d.live.ros.topics import (
    UNKNOWN,
    RosTopic,
    detection,
    occupancy_grid,
    odometry,
    pose_at,
    pose_of,
    stamp_at,
    transform,
)
from fleet2d.live.ros.types import MessageEncoder
from fleet2d.live.twists import twists
from fleet2d.runs.robot_log import LogEntry, robot_log
from fleet2d.runtime.local_time import stamp_us
from fleet2d.storage.bags import LOG_LEVELS, LOG_TYPE, ros_types

if TYPE_CHECKING:
    import pyarrow as pa

MAP = "/map"
TRANSFORMS = "/tf"
STATIC = "/tf_static"
_LEVELS = 20  # INFO in rcl_interfaces/msg/Log


class Message(NamedTuple):
    """A message: its time [ns since 1970], topic and content (CDR, little endian)."""

    time: int
    topic: str
    data: bytes


class Block(NamedTuple):
    """Messages of a topic, in order of time.

    Attributes:
        topic: The topic.
        times: Their times [ns since 1970], int64 (n,).
        sizes: The size of each, with a margin before it for the writer of a file, int64 (n,).
        data: The messages one after the other, uint8 (sum of sizes,).
    """

    topic: str
    times: I64
    sizes: I64
    data: U8


class RosMessages:
    """The ROS 2 messages of a part of a run.

    Attributes:
        topics: The topics by name.
        types: The library's store of message types.
    """

    def __init__(self, records: Records, margin: int = 0) -> None:
        """Collect the topics of a part of a run.

        Args:
            records: The part of a run.
            margin: The number of bytes that `blocks` leaves free before each message.

        Raises:
            InputError: rosbags isn't installed.
        """
        self.types = ros_types("ROS messages need rosbags")
        self._encode = MessageEncoder(self.types).encode
        self._records = records
        self._margin = margin
        self._templates: dict[tuple[str, ...], Template] = {}
        self._run = records.run
        clock = self._run.clock
        self._start_ns = stamp_us(clock.start) // 1_000_000 * 1_000_000_000
        self._step_ns = clock.step_us * 1000
        topics = [
            RosTopic(MAP, "nav_msgs/msg/OccupancyGrid", is_latched=True),
            RosTopic(TRANSFORMS, "tf2_msgs/msg/TFMessage"),
            RosTopic(STATIC, "tf2_msgs/msg/TFMessage", is_latched=True),
            *(RosTopic(f"/{robot}/odom", "nav_msgs/msg/Odometry") for robot in records.robots),
        ]
        if "observations" in records.tables:
            kind = "vision_msgs/msg/Detection3DArray"
            topics += [RosTopic(f"/{robot}/detections", kind) for robot in records.robots]
        if "events" in records.tables:
            topics += [RosTopic(f"/{robot}/log", LOG_TYPE) for robot in records.robots]
        tables = [name for name in records.tables if name != "observations"]
        topics += [RosTopic(f"/{name}", self._encoder(name)[0]) for name in tables]
        self.topics = {topic.name: topic for topic in topics}

    def definition(self, topic: RosTopic) -> str:
        """Return the definition of a topic's type and of all types in it, as ROS writes it."""
        return str(self.types.generate_msgdef(topic.type, ros_version=2)[0])

    def __iter__(self) -> Iterator[Message]:
        """Yield all messages in order of time.

        Raises:
            ArtifactError: The run stored no key frames, or a table can't be read.
        """
        for blocks in self.blocks():
            messages = []
            for topic, times, sizes, data in blocks:
                ends = np.cumsum(sizes)
                begins = ends - sizes + self._margin
                content = data.tobytes()
                places = zip(times.tolist(), begins.tolist(), ends.tolist(), strict=True)
                messages += [Message(t, topic, content[begin:end]) for t, begin, end in places]
            messages.sort(key=itemgetter(0))
            yield from messages

    def blocks(self) -> Iterator[list[Block]]:
        """Yield the messages of one stretch of time after the other.

        Raises:
            ArtifactError: The run stored no key frames, or a table can't be read.
        """
        begin = self._time(self._records.part.first)
        once = [(MAP, self._map(begin)), (STATIC, self._static_transforms(begin))]
        yield [self._block(topic, [begin], [data]) for topic, data in once]
        last: dict[str, F64] = {}
        logs = self._logs()
        for chunk in self._records.chunks():
            blocks: list[Block] = []
            if chunk.poses:
                blocks += self._transforms(chunk)
                for robot in self._records.robots:
                    blocks += self._odometry(chunk, robot, last)
            for name, table in chunk.tables.items():
                if name == "observations":
                    blocks += self._detections(table)
                else:
                    blocks.append(self._rows(name, table.to_pylist()))
            blocks += [self._log_block(robot, logs[robot], chunk) for robot in logs]
            yield [block for block in blocks if len(block.times)]

    def _block(self, topic: str, times: Sequence[int], messages: Sequence[bytes]) -> Block:
        margin = bytes(self._margin)
        with_margins = [margin + message for message in messages]
        data = np.frombuffer(bytearray(b"".join(with_margins)), np.uint8)
        sizes = np.array(list(map(len, with_margins)), np.int64)
        return Block(topic, np.array(times, np.int64), sizes, data)

    def _time(self, step: int) -> int:
        return self._start_ns + int(step) * self._step_ns

    def _header(self, time: int, frame: str) -> dict[str, Any]:
        return {"stamp": stamp_at(time), "frame_id": frame}

    def _map(self, time: int) -> bytes:
        grid = occupancy_grid(self._header(time, "map"), self._run.plan)
        return self._encode("nav_msgs/msg/OccupancyGrid", grid)

    def _static_transforms(self, time: int) -> bytes:
        """Return the static transforms: odometry in Fleet2D doesn't drift from the map."""
        header = self._header(time, "map")
        still = pose_at(0.0, 0.0, 0.0)
        frames = [transform(header, f"{robot}/odom", still) for robot in self._records.robots]
        return self._encode("tf2_msgs/msg/TFMessage", {"transforms": frames})

    def _frames(self, name: str) -> tuple[str, str]:
        is_robot = name in self._records.robots
        return (f"{name}/odom", f"{name}/base_link") if is_robot else ("map", name)

    def _transforms(self, chunk: Chunk) -> Iterator[Block]:
        """Yield a message for each time, with all bodies that are at home."""
        names = list(chunk.poses)
        home = np.stack([~path.away for path in chunk.poses.values()], axis=-1)
        times = self._start_ns + chunk.poses[names[0]].step * self._step_ns
        changes = np.flatnonzero((home[1:] != home[:-1]).any(axis=1)) + 1
        for present in np.unique(home[[0, *changes]], axis=0):
            at = np.flatnonzero((home == present).all(axis=1))
            who = [name for name, is_home in zip(names, present, strict=True) if is_home]
            template = self._template(self._transform_template, *who)
            values = [v for name in who for v in _planar(chunk.poses[name], at)]
            yield template.fill(TRANSFORMS, times[at], values, self._margin)

    def _template(self, make: Callable[..., "Template"], *names: str) -> "Template":
        """Return a template by its names, made at most once."""
        key = (make.__name__, *names)
        if key not in self._templates:
            self._templates[key] = make(*names)
        return self._templates[key]

    def _transform_template(self, *names: str) -> "Template":
        def message(times: Sequence[int], values: Sequence[float]) -> bytes:
            transforms = []
            for i, (time, name) in enumerate(zip(times, names, strict=True)):
                parent, child = self._frames(name)
                pose = pose_of(*values[4 * i : 4 * i + 4])
                transforms.append(transform(self._header(time, parent), child, pose))
            return self._encode("tf2_msgs/msg/TFMessage", {"transforms": transforms})

        return Template(message, len(names), 4 * len(names))

    def _odometry(self, chunk: Chunk, robot: str, last: dict[str, F64]) -> list[Block]:
        path = chunk.poses[robot]
        if not len(path.x):
            return []
        poses = np.stack([path.x, path.y, path.heading], axis=-1)
        before = np.vstack([last.get(robot, poses[0]), poses[:-1]])
        last[robot] = poses[-1]
        passed_s = self._records.part.every.total_seconds()
        speeds = twists(self._run.plan, before, poses, passed_s).T
        at = np.flatnonzero(~path.away)
        stamps = self._start_ns + path.step[at] * self._step_ns
        values = [*_planar(path, at), *(speed[at] for speed in speeds)]
        template = self._template(self._odometry_template, robot)
        return [template.fill(f"/{robot}/odom", stamps, values, self._margin)]

    def _odometry_template(self, robot: str) -> "Template":
        def message(times: Sequence[int], values: Sequence[float]) -> bytes:
            x, y, z, w, forward, left, turning = values
            odom, base = self._frames(robot)
            header = self._header(times[0], odom)
            speeds = (forward, left, turning)
            fields = odometry(header, base, pose_of(x, y, z, w), speeds)
            return self._encode("nav_msgs/msg/Odometry", fields)

        return Template(message, 1, 7)

    def _detections(self, table: "pa.Table") -> Iterator[Block]:
        """Yield a message for each look in which a robot perceived somebody."""
        if not table.num_rows:
            return
        step, x, y = (table[name].to_numpy() for name in ("step", "x", "y"))
        robot, robots = _codes(table["robot"])
        user, users = _codes(table["user"])
        users = [*users, UNKNOWN]  # for the code -1
        has_heading = "heading" in table.column_names
        heading = np.nan_to_num(table["heading"].to_numpy()) if has_heading else np.zeros(len(x))
        is_first = (np.diff(step, prepend=-1) != 0) | (np.diff(robot, prepend=-1) != 0)
        first = np.flatnonzero(is_first)
        count = np.diff(first, append=len(step))
        kinds = np.unique(np.stack([robot[first], count], axis=-1), axis=0)
        for of, size in kinds.tolist():
            looks = first[(robot[first] == of) & (count == size)]
            rows = looks[:, None] + np.arange(size)  # shape (looks, people)
            people = user[rows]
            changes = np.flatnonzero((people[1:] != people[:-1]).any(axis=1)) + 1
            for who in np.unique(people[[0, *changes]], axis=0):
                at = rows[(people == who).all(axis=1)].T
                poses = [(x[i], y[i], *_quaternion(heading[i])) for i in at]
                template = self._template(self._detection_template, *(users[u] for u in who))
                stamps = self._start_ns + step[at[0]] * self._step_ns
                values = [v for pose in poses for v in pose * 2]
                topic = f"/{robots[of]}/detections"
                yield template.fill(topic, stamps, values, self._margin)

    def _detection_template(self, *users: str) -> "Template":
        def message(times: Sequence[int], values: Sequence[float]) -> bytes:
            detections = []
            for i, (time, user) in enumerate(zip(times[1:], users, strict=True)):
                x, y, z, w, *centre = values[8 * i : 8 * i + 8]
                header = self._header(time, "map")
                pose = pose_of(x, y, z, w)
                detections.append(detection(header, user, pose, pose_of(*centre)))
            fields = {"header": self._header(times[0], "map"), "detections": detections}
            return self._encode("vision_msgs/msg/Detection3DArray", fields)

        return Template(message, len(users) + 1, 8 * len(users))

    def _encoder(self, table: str) -> tuple[str, Callable[[dict[str, Any]], bytes]]:
        """Return the type of message for rows of a table, and the function that makes it."""
        if table == "events":
            return "rcl_interfaces/msg/Log", self.log_entry
        return "std_msgs/msg/String", self.json_text

    def _rows(self, name: str, rows: Sequence[dict[str, Any]]) -> Block:
        _, encode = self._encoder(name)
        times = [self._time(row["step"]) for row in rows]
        return self._block(f"/{name}", times, [encode(row) for row in rows])

    def _logs(self) -> dict[str, list[LogEntry]]:
        """Return the log of each robot, if the run stored events."""
        part = self._records.part
        robots = self._records.robots if "events" in self._records.tables else []
        return {robot: robot_log(self._run, robot, part.first, part.end) for robot in robots}

    def _log_block(self, robot: str, entries: list[LogEntry], chunk: Chunk) -> Block:
        """Return the lines of a log in the steps of a chunk."""
        begin, end = chunk.steps
        step = attrgetter("step")
        own = entries[bisect_left(entries, begin, key=step) : bisect_left(entries, end, key=step)]
        times = [self._time(entry.step) for entry in own]
        return self._block(f"/{robot}/log", times, [self._log(robot, entry) for entry in own])

    def _log(self, robot: str, entry: LogEntry) -> bytes:
        """Return a line of a robot's log as a message of Foxglove."""
        fields = {
            "timestamp": stamp_at(self._time(entry.step)),
            "level": LOG_LEVELS[entry.level],
            "message": entry.text,
            "name": robot,
            "file": entry.source,
        }
        return self._encode(LOG_TYPE, fields)

    def log_entry(self, row: dict[str, Any]) -> bytes:
        """Return an event as an entry of a log: who, what, details."""
        fields = {
            "stamp": stamp_at(self._time(row["step"])),
            "level": _LEVELS,
            "name": row["entity"],
            "msg": f"{row['event']} {words_of(row)}".strip(),
            "function": row["event"],
        }
        return self._encode("rcl_interfaces/msg/Log", fields)

    def json_text(self, row: dict[str, Any]) -> bytes:
        """Return a row of any table as JSON in a string."""
        return self._encode("std_msgs/msg/String", {"data": json.dumps(row, default=str)})


class Template:
    """Messages that differ only in some numbers: serialized once, then filled in as arrays."""

    def __init__(
        self, message: Callable[[Sequence[int], Sequence[float]], bytes], times: int, values: int
    ) -> None:
        """Serialize a message with unique numbers, to find the places of numbers."""
        stamps = [(1_000_000_007 + i) * 1_000_000_000 + 999_000_001 + i for i in range(times)]
        floats = [1.2345678901234e200 * (i + 1) for i in range(values)]
        data = message(stamps, floats)
        self._bytes = np.frombuffer(data, np.uint8)
        packed_stamps = [struct.pack("<iI", *divmod(stamp, 1_000_000_000)) for stamp in stamps]
        packed_floats = [struct.pack("<d", value) for value in floats]
        self._stamps = list(map(data.index, packed_stamps))
        self._floats = list(map(data.index, packed_floats))

    def fill(self, topic: str, times: I64, values: Sequence[F64], margin: int) -> Block:
        """Return messages with other times [ns] and numbers, each an array (n,)."""
        count = len(times)
        size = margin + len(self._bytes)
        filled = np.empty((count, size), np.uint8)
        filled[:, margin:] = self._bytes
        for part, numbers in enumerate(np.divmod(times, 1_000_000_000)):
            for place in self._stamps:
                at = margin + place + 4 * part
                np.ndarray((count,), "<u4", filled, at, (size,))[:] = numbers
        for place, numbers in zip(self._floats, values, strict=True):
            np.ndarray((count,), "<f8", filled, margin + place, (size,))[:] = numbers
        return Block(topic, times, np.full(count, size), filled.ravel())


def _codes(column: "pa.ChunkedArray") -> tuple[I64, list[str]]:
    """Return a column of words as indices of its words, -1 where there is none."""
    words = column.combine_chunks().dictionary_encode()
    codes = words.indices.fill_null(-1).to_numpy()
    return codes.astype(np.int64), words.dictionary.to_pylist()


def _quaternion(heading: Any) -> tuple[Any, Any]:
    """Return z and w of the turn about the vertical axis."""
    return np.sin(heading / 2), np.cos(heading / 2)


def _planar(path: Any, at: I64) -> tuple[F64, F64, F64, F64]:
    """Return x, y, and the z and w of the quaternion, of some poses."""
    return (path.x[at], path.y[at], *_quaternion(path.heading[at]))
