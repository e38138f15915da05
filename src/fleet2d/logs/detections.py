"""Detections of a real robot: whom it perceived where, from tables and from topics of bags."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from fleet2d.bounds import BAG_SECONDS, FIXES, one_line
from fleet2d.configuration.problems import did_you_mean
from fleet2d.kernels import I64
from fleet2d.logs.frames import MAP, FrameTree, RigidMotions, StampedPoses, frame_name
from fleet2d.logs.log import LogError, PositionLog
from fleet2d.logs.positions import RawFixes
from fleet2d.logs.tables import NAMES, LogTable
from fleet2d.logs.times import Stamps
from fleet2d.runtime.local_time import Zone
from fleet2d.storage.apart import apart
from fleet2d.storage.bags import check_bag, headings_of, is_bag, open_bag, stamp_ns, times_of

COLUMNS = {
    "time": NAMES["time"],
    "user": ("user", "label", "identity", "person", "name", "class", "id"),
    "x": NAMES["x"],
    "y": NAMES["y"],
    "heading": NAMES["heading"],
}
"""The names that a column may have, if the user gives none."""

SPACE = ("x", "y", "z", "heading")
ARRAYS = ("vision_msgs/msg/Detection3DArray", "geometry_msgs/msg/PoseArray")
_FIELDS: dict[str, dict[str, str]] = {
    "vision_msgs/msg/Detection3DArray": {
        "each": "detections",
        "user": "results.0.hypothesis.class_id",
        "x": "bbox.center.position.x",
        "y": "bbox.center.position.y",
    },
    "geometry_msgs/msg/PoseArray": {"each": "poses", "x": "position.x", "y": "position.y"},
    "geometry_msgs/msg/PointStamped": {"x": "point.x", "y": "point.y"},
    "geometry_msgs/msg/PoseStamped": {"x": "pose.position.x", "y": "pose.position.y"},
}
"""Where the messages of known types have what `COLUMNS` lists; `each` is a list of detections."""


@dataclass(frozen=True, kw_only=True)
class RobotDetections(PositionLog):
    """Detections, in order of time; positions in the frame of the log.

    Attributes:
        label: Index in `labels` of whom each is of, -1 where the log doesn't say, int64 (n,).
        labels: The labels of people in the log.
    """

    label: I64
    labels: tuple[str, ...]

    @cached_property
    def counts(self) -> Counter[str]:
        """How many detections have each label; "" for those without one."""
        counts = np.bincount(self.label + 1, minlength=len(self.labels) + 1).tolist()
        return +Counter(dict(zip(("", *self.labels), counts, strict=True)))


def read_detections(
    path: str | Path,
    *,
    topic: str | None = None,
    frame: str | None = None,
    columns: Mapping[str, str] | None = None,
    time_zone: Zone | str | None = None,
    sort: bool = False,
    decimal_comma: bool | None = None,
    day_first: bool | None = None,
) -> RobotDetections:
    """Read detections of people: time, x, y, and, if there are, whom and heading.

    Times are as those of positions; see `read_positions`.

    Args:
        path: A table (.csv, .tsv, .parquet, .jsonl), or a bag of ROS 1 or ROS 2.
        topic: The topic of a bag; needed if several have detections.
        frame: The frame of a bag in which positions are returned; None: the map.
        columns: Names of columns, {"user": "face"}. Of a bag, the fields of its messages, like
            {"each": "people", "user": "name", "x": "pose.position.x"}, where `each` is the list of
            detections in a message; numbers select an element of a list.
        time_zone: The time zone of the home, if times have a zone or count from 1970.
        sort: Put rows in order of time instead of refusing times that run backwards.
        decimal_comma: Whether numbers have a comma as decimal mark; None: shown by the file.
        day_first: Whether 03/04/2026 is in April; None: shown by the file.

    Raises:
        LogError: The file can't be read, a column or field is missing, a value is not a number,
            times run backwards, or no transforms lead to `frame`.
        InputError: rosbags isn't installed.
    """
    path = Path(path)
    if not path.exists():
        raise LogError(f"no such file: {path}")
    if is_bag(path):
        check_bag(path, LogError)
        arguments = path, topic, dict(columns or {}), frame or MAP
        bag = apart(path, _from_bag, *arguments, failure=LogError, seconds=BAG_SECONDS)
        fixes, label, labels = bag
    else:
        if topic is not None or frame is not None:
            raise LogError(f"{path} is a table: 'topic' is for bags, and so is the name of a frame")
        table = LogTable.read(
            path, columns or {}, COLUMNS, decimal_comma=decimal_comma, day_first=day_first
        )
        fixes, label, labels = _from_table(table)
    local = fixes.local(path, "detections", time_zone=time_zone, sort=sort)
    xy = np.stack([fixes.x, fixes.y], 1)[local.row]
    heading = fixes.heading[local.row]
    log = (path, "detections", local.first_day, local.time_us, xy, heading, tuple(fixes.notes))
    return RobotDetections(*log, label=label[local.row], labels=labels, unit_m=fixes.unit_m)


_LabelledFixes = tuple[RawFixes, I64, tuple[str, ...]]
"""Detections as a file has them, the label of each, and all labels; see `RobotDetections`."""


def _from_table(table: LogTable) -> _LabelledFixes:
    if not table.rows.num_rows:
        raise LogError(f"{table.path} holds no detection")
    label = np.full(len(table.line), -1, np.int64)
    labels = tuple[str, ...]()
    if "user" in table.named:
        label, labels = _codes(table.texts("user"))
    return RawFixes.of(table), label, labels


def _codes(texts: pa.Array) -> tuple[I64, tuple[str, ...]]:
    """Return the index of each text among the different ones, -1 for none; and those, sorted."""
    found = [text for text in pc.unique(texts).to_pylist() if text and text.strip()]
    labels = tuple(sorted(found))
    index = pc.index_in(texts, value_set=pa.array(labels, pa.string()))
    return pc.fill_null(index, -1).to_numpy(zero_copy_only=False).astype(np.int64), labels


# Bags


def _from_bag(
    path: Path, topic: str | None, columns: Mapping[str, str], frame: str
) -> _LabelledFixes:
    with open_bag(path, LogError) as reader:
        connection, fields = _topic(reader, path, topic, columns)
        FIXES.check(connection.msgcount, path, LogError)
        depth = {"z": f"{fields['x'][:-1]}z"} if fields["x"].endswith(".x") else {}
        stamps = list[int]()
        recorded = list[int]()
        frames = list[str]()
        rows: list[list[float]] = []
        users: list[str | None] = []
        number = 0
        for number, (_, time, data) in enumerate(reader.messages([connection]), 1):
            message = reader.deserialize(data, connection.msgtype)
            for one in _each(message, fields, path, number):
                stamps.append(stamp_ns(message))
                recorded.append(time)
                frames.append(_frame_of(message))
                rows.append([_number(one, (fields | depth).get(k), path, number) for k in SPACE])
                user = _value(one, fields["user"]) if "user" in fields else None
                users.append(None if user is None else str(user))
            FIXES.check(len(rows), path, LogError)
        topic = connection.topic
        if not rows:
            raise LogError(f"{path}: none of the {number} messages of {topic} has a detection")
        notes = [f"{topic}: {len(rows)} detections in {number} messages"]
        times = times_of(np.array(stamps, np.int64), np.array(recorded, np.int64))
        x, y, z, heading = np.array(rows, np.float64).T
        level = np.zeros(len(x))
        turns = np.stack([level, level, np.sin(heading / 2), np.cos(heading / 2)], 1)
        motions = RigidMotions(np.stack([x, y, np.nan_to_num(z)], 1), turns)
        poses = StampedPoses(times, frames, motions)
        motions, is_known = poses.seen_from(frame, FrameTree(reader, path), topic, notes)
    x, y = np.where(is_known, motions.place[:, :2].T, np.nan)
    heading = headings_of(motions.turn)
    fixes = RawFixes(Stamps.of_messages(times), x, y, heading, notes)
    return fixes, *_codes(pa.array(users, pa.string()))


def _frame_of(message: Any) -> str:
    return frame_name(message.header.frame_id) if hasattr(message, "header") else ""


def _topic(
    reader: Any, path: Path, topic: str | None, columns: Mapping[str, str]
) -> tuple[Any, dict[str, str]]:
    """Return the connection of a topic, and the fields of its messages.

    Raises:
        LogError: There is no such topic, or it isn't known which fields its messages have.
    """
    topics = {connection.topic: connection for connection in reader.connections}
    known = [name for name, connection in topics.items() if connection.msgtype in ARRAYS]
    if topic is None and len(known) == 1:
        topic = known[0]
    if topic is None or topic not in topics:
        which = f"no topic {topic!r}{did_you_mean(topic, topics)}" if topic else "several topics"
        listed = ", ".join(f"{c.topic} ({c.msgtype})" for c in list(topics.values())[:20])
        raise LogError(f"{path} has {which}: select one by 'topic': {listed}")
    connection = topics[topic]
    unknown = sorted(set(columns) - {"each", *COLUMNS} | set(columns) & {"time"})
    if unknown:
        raise LogError(
            f"columns: unknown key {unknown[0]!r}; allowed for a bag: each, user, x, y, heading"
        )
    fields = {**_FIELDS.get(connection.msgtype, {}), **columns}
    if not {"x", "y"} <= fields.keys():
        raise LogError(
            f"{path}: {topic} has messages of the type {connection.msgtype}: say where they have"
            " the position by columns: {each: …, user: …, x: …, y: …}"
        )
    return connection, fields


def _each(message: Any, fields: Mapping[str, str], path: Path, number: int) -> Iterator[Any]:
    """Yield the detections in a message."""
    if "each" not in fields:
        yield message
        return
    items = _value(message, fields["each"])
    if not isinstance(items, list | tuple | np.ndarray):
        raise LogError(f"{path}, message {number}: {fields['each']!r} is not a list")
    yield from items


def _value(message: Any, field: str) -> Any:
    """Return a field of a message by its dotted path; None where a list is too short."""
    for part in field.split("."):
        if part.isdigit():
            if len(message) <= int(part):
                return None
            message = message[int(part)]
        elif hasattr(message, part):
            message = getattr(message, part)
        else:
            names = ", ".join(name for name in vars(message) if not name.startswith("_"))
            raise LogError(f"columns: {field!r}: there is no {part!r}; there are: {names}")
    return message


def _number(message: Any, field: str | None, path: Path, number: int) -> float:
    value = None if field is None else _value(message, field)
    try:
        return np.nan if value is None else float(value)
    except (TypeError, ValueError):
        raise LogError(
            f"{path}, message {number}: expected a number in {field!r}, got {one_line(value)!r}"
        ) from None
