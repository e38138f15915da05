"""ROS 2 messages in an MCAP file, alone or as a bag: needs the extra `ros`."""

import json
import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from fleet2d.bounds import one_line
from fleet2d.errors import RunDirectoryError
from fleet2d.kernels import I64, U8
from fleet2d.live.exporters import Records, Selection, new_file
from fleet2d.live.exporters.ros import Block, RosMessages
from fleet2d.live.ros.topics import RosTopic
from fleet2d.runs.run import Run
from fleet2d.storage.bags import LOG_TYPE, METADATA
from fleet2d.storage.files import new_folder

MAGIC = b"\x89MCAP0\r\n"
# The codes of records of the format, https://mcap.dev/spec.
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS = 0x0B
SUMMARY_OFFSET = 0x0E
DATA_END = 0x0F
MESSAGE_HEAD = np.dtype(
    [
        ("record", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("logged", "<u8"),
        ("published", "<u8"),
    ]
)
"""The head of a message, before its content."""
QOS = "offered_qos_profiles"
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
COMPRESSION = "zstd"
# Covariances are zeros: higher levels save little.
COMPRESSION_LEVEL = 1


def export_mcap(run: Run, path: Path, part: Selection) -> str:
    """Write map, transforms, odometry, detections, events and tables as ROS 2 messages.

    A layout for Foxglove is written beside the file, as `NAME.layout.json`.

    Args:
        run: A run with key frames.
        path: The file to write.
        part: The part of the run, and the time between two poses.

    Returns:
        A line with the number of messages.

    Raises:
        InputError: rosbags isn't installed.
        RunDirectoryError: The file can't be written.
    """
    messages = RosMessages(Records(run, part), MESSAGE_HEAD.itemsize)
    layout = path.with_suffix(".layout.json")
    with new_file(path) as file:
        writer = _write(messages, file)
    with new_file(layout) as file:
        file.write(json.dumps(foxglove_layout(messages), indent=1).encode())
    size = path.stat().st_size / 1e6
    total = f"{writer.counts.total():,} messages in {path}, {size:.1f} MB"
    return f"{total}; layout: {layout}{_refused(messages)}"


class WrittenChunk(NamedTuple):
    """The place of a chunk in a file, for the summary of the file."""

    begins: int  # the times of its first and last message
    ends: int
    at: int
    length: int
    indices: dict[int, int]  # the places of its message indices, by channel
    indices_length: int
    compressed: int
    size: int


class McapWriter:
    """An MCAP file, written by whole blocks of messages.

    Libraries need a call per message: 5 million for a month at 1 s.

    Attributes:
        counts: The number of messages of each topic so far.
        chunks: The chunks written so far.
    """

    def __init__(self, file: BinaryIO, topics: Sequence[tuple[RosTopic, str]]) -> None:
        """Begin a file with topics and the definitions of their messages."""
        self._file = file
        self._at = 0
        self._channels: dict[str, int] = {}
        definitions = []
        for number, (topic, definition) in enumerate(topics, 1):
            self._channels[topic.name] = number
            code = struct.pack("<H", number)
            texts = map(_text, (topic.type, "ros2msg", definition))
            qos = _map(_text(key) + _text(value) for key, value in _metadata(topic).items())
            channel = (code, code, _text(topic.name), _text("cdr"), qos)
            definitions.append(_record(SCHEMA, code, *texts))
            definitions.append(_record(CHANNEL, *channel))
        self._definitions = b"".join(definitions)
        self.chunks: list[WrittenChunk] = []
        self.counts: Counter[str] = Counter()
        self._put(MAGIC, _record(HEADER, _text("ros2"), _text("fleet2d")), self._definitions)

    def _put(self, *parts: bytes) -> int:
        """Write bytes, and return their place in the file."""
        at = self._at
        for part in parts:
            self._at += self._file.write(part)
        return at

    def write(self, blocks: Sequence[Block]) -> None:
        """Write a chunk with messages, whose margins have room for MESSAGE_HEAD."""
        import pyarrow as pa

        blocks = [block for block in blocks if len(block.times)]
        if not blocks:
            return
        for topic in {block.topic for block in blocks}:
            self._fill_heads([block for block in blocks if block.topic == topic])
        records, places = _merged(blocks)
        data = pa.Codec(COMPRESSION, COMPRESSION_LEVEL).compress(records, asbytes=True)
        begins = min(int(block.times[0]) for block in blocks)
        ends = max(int(block.times[-1]) for block in blocks)
        times = struct.pack("<QQQI", begins, ends, len(records), zlib.crc32(records))
        size = struct.pack("<Q", len(data))
        at = self._put(_record(CHUNK, times, _text(COMPRESSION), size, data))
        length = self._at - at
        indices = {}
        for topic, channel in self._channels.items():
            pairs = [
                np.stack([block.times, begins_at], axis=-1)
                for block, begins_at in zip(blocks, places, strict=True)
                if block.topic == topic
            ]
            if pairs:
                index = np.concatenate(pairs)
                index = index[np.argsort(index[:, 1])].astype("<u8")
                head = struct.pack("<HI", channel, index.nbytes)
                indices[channel] = self._put(_record(MESSAGE_INDEX, head, index.tobytes()))
        sizes = self._at - at - length, len(data), len(records)
        self.chunks.append(WrittenChunk(begins, ends, at, length, indices, *sizes))

    def _fill_heads(self, blocks: Sequence[Block]) -> None:
        """Write the heads of the messages of a topic."""
        topic = blocks[0].topic
        times = np.concatenate([block.times for block in blocks])
        heads = np.empty(len(times), MESSAGE_HEAD)
        heads["record"] = MESSAGE
        heads["channel"] = self._channels[topic]
        sizes = np.concatenate([block.sizes for block in blocks])
        heads["length"] = sizes - 9  # the code and the length don't count
        order = np.argsort(times, kind="stable")
        heads["sequence"][order] = np.arange(len(times)) + self.counts[topic]
        heads["logged"] = heads["published"] = times
        self.counts[topic] += len(times)
        ends = np.cumsum([len(block.times) for block in blocks])
        for block, own in zip(blocks, np.split(heads, ends[:-1]), strict=True):
            size = int(block.sizes[0])
            if (block.sizes == size).all():
                np.ndarray(len(own), MESSAGE_HEAD, block.data, 0, (size,))[:] = own
            else:
                begins = np.cumsum(block.sizes) - block.sizes
                places = begins[:, None] + np.arange(MESSAGE_HEAD.itemsize)
                block.data[places] = own.view(np.uint8).reshape(places.shape)

    def finish(self) -> None:
        """Write the summary, by which readers find chunks and channels."""
        self._put(_record(DATA_END, struct.pack("<I", 0)))
        summary = self._put(self._definitions)
        # By channel, so that a run makes the same file in every process.
        counts = dict(sorted((self._channels[topic], n) for topic, n in self.counts.items()))
        begins = min((chunk.begins for chunk in self.chunks), default=0)
        ends = max((chunk.ends for chunk in self.chunks), default=0)
        channels = len(self._channels)
        chunks = len(self.chunks)
        numbers = (self.counts.total(), channels, channels, 0, 0, chunks, begins, ends)
        self._put(_record(STATISTICS, struct.pack("<QHIIIIQQ", *numbers), _numbers(counts)))
        for chunk in self.chunks:
            index = _record(
                CHUNK_INDEX,
                struct.pack("<QQQQ", chunk.begins, chunk.ends, chunk.at, chunk.length),
                _numbers(chunk.indices),
                struct.pack("<Q", chunk.indices_length),
                _text(COMPRESSION),
                struct.pack("<QQ", chunk.compressed, chunk.size),
            )
            self._put(index)
        self._put(_record(FOOTER, struct.pack("<QQI", summary, 0, 0)), MAGIC)


def _merged(blocks: Sequence[Block]) -> tuple[bytes, list[I64]]:
    """Return the messages of blocks in order of time, and the places of those of each block."""
    rows = _alike(blocks)
    times_by_row = []
    sizes_by_row = []
    data = []
    for row in rows:
        beside = [blocks[i] for i in row]
        times_by_row.append(beside[0].times)
        sizes_by_row.append(sum(block.sizes for block in beside))
        data.append(_side_by_side(beside).data)
    times = np.concatenate(times_by_row)
    sizes = np.concatenate(sizes_by_row)
    number = np.repeat(np.arange(len(rows)), list(map(len, times_by_row)))
    order = np.argsort(times, kind="stable")
    places = np.empty(len(order), np.int64)
    places[order] = np.cumsum(sizes[order]) - sizes[order]
    firsts = np.flatnonzero(np.diff(number, prepend=-1))
    own = np.cumsum(sizes) - sizes
    own -= np.repeat(own[firsts], np.diff(firsts, append=len(own)))  # relative to the row
    # Messages that are neighbours in a row and in time form a piece.
    piece = np.flatnonzero(np.diff(number[order], prepend=-1))
    last = order[np.append(piece[1:], len(order)) - 1]
    begins = own[order[piece]].tolist()
    ends = (own[last] + sizes[last]).tolist()
    pieces = zip(number[order[piece]].tolist(), begins, ends, strict=True)
    records = b"".join([data[row][begin:end] for row, begin, end in pieces])
    of_block = [np.empty(0, np.int64)] * len(blocks)
    for row, first in zip(rows, firsts.tolist(), strict=True):
        before = 0
        for i in row:
            of_block[i] = places[first : first + len(blocks[i].times)] + before
            before += int(blocks[i].sizes[0])
    return records, of_block


def _alike(blocks: Sequence[Block]) -> list[list[int]]:
    """Return the blocks that can stand side by side: with equal times and one size each."""
    rows: list[list[int]] = []
    has_one_size = [bool((block.sizes == block.sizes[0]).all()) for block in blocks]
    for i, block in enumerate(blocks):
        for row in rows:
            alike = has_one_size[i] and has_one_size[row[0]]
            if alike and np.array_equal(blocks[row[0]].times, block.times):
                row.append(i)
                break
        else:
            rows.append([i])
    return rows


def _side_by_side(blocks: Sequence[Block]) -> U8:
    """Return the messages of blocks, those of the same time next to each other."""
    if len(blocks) == 1:
        return blocks[0].data
    tables = [block.data.reshape(len(block.times), -1) for block in blocks]
    return np.concatenate(tables, axis=1).ravel()


def _record(code: int, *parts: bytes) -> bytes:
    return struct.pack("<BQ", code, sum(map(len, parts))) + b"".join(parts)


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def _map(entries: Iterable[bytes]) -> bytes:
    data = b"".join(entries)
    return struct.pack("<I", len(data)) + data


def _numbers(values: Mapping[int, int]) -> bytes:
    return _map(struct.pack("<HQ", key, value) for key, value in values.items())


def foxglove_layout(messages: RosMessages) -> dict[str, object]:
    """Return a layout of Foxglove's panels: the home, the first robot's log, events, speeds."""
    robots = [name for name in messages.topics if name.endswith("/odom")]
    detections = [name for name in messages.topics if name.endswith("/detections")]
    logs = [topic.name for topic in messages.topics.values() if topic.type == LOG_TYPE]
    logs = [*logs, "/events"][:1]
    visible = {name: {"visible": True} for name in ("/map", *robots, *detections)}
    plots = [{"value": f"{name}.twist.twist.linear.x", "enabled": True} for name in robots]
    return {
        "configById": {
            "3D!home": {
                "followTf": "map",
                "cameraState": {"perspective": False, "phi": 0, "distance": 25},
                "topics": visible,
            },
            "RosOut!events": {"topicToRender": "/events"},
            "RosOut!log": {"topicToRender": logs[0]},
            "Plot!speed": {"paths": plots, "title": "speed [m/s]"},
        },
        "globalVariables": {},
        "userNodes": {},
        "layout": {
            "direction": "row",
            "first": "3D!home",
            "second": {
                "direction": "column",
                "first": "RosOut!log",
                "second": {"direction": "column", "first": "RosOut!events", "second": "Plot!speed"},
            },
            "splitPercentage": 65,
        },
    }


def _metadata(topic: RosTopic) -> dict[str, str]:
    """Return the quality of service of a topic, as rosbag2 stores it."""
    if not topic.is_latched:
        return {}
    no_limit = {"sec": 0, "nsec": 0}
    latched = {
        "history": 1,  # keep the last
        "depth": 1,
        "reliability": 1,  # reliable
        "durability": 1,  # transient local: for those who subscribe later, too
        "deadline": no_limit,
        "lifespan": no_limit,
        "liveliness": 1,
        "liveliness_lease_duration": no_limit,
        "avoid_ros_namespace_conventions": False,
    }
    return {QOS: json.dumps([latched])}  # JSON is YAML


def export_rosbag2(run: Run, path: Path, part: Selection) -> str:
    """Write the same messages as the exporter `mcap` as a folder that `ros2 bag play` accepts.

    Args:
        run: A run with key frames.
        path: The folder to write, which doesn't exist yet.
        part: The part of the run, and the time between two poses.

    Returns:
        A line with the number of messages.

    Raises:
        InputError: rosbags isn't installed.
        RunDirectoryError: The folder exists, or can't be written.
    """
    if path.exists():
        raise RunDirectoryError(f"{path} exists: name another folder, or remove it")
    messages = RosMessages(Records(run, part), MESSAGE_HEAD.itemsize)
    file_name = f"{path.name}_0.mcap"
    try:
        with new_folder(path) as made:
            made.mkdir()
            with (made / file_name).open("wb") as file:
                writer = _write(messages, file)
            metadata = json.dumps(bag_metadata(messages, writer, file_name), indent=1)
            (made / METADATA).write_text(metadata + "\n", encoding="utf-8")  # JSON is YAML
    except FileExistsError:
        raise RunDirectoryError(f"{path} exists: name another folder, or remove it") from None
    except OSError as error:
        raise RunDirectoryError(f"{path} can't be written: {error}") from error
    return f"{writer.counts.total():,} messages in {path}{_refused(messages)}"


def _refused(messages: RosMessages) -> str:
    """Return a remark on topics whose names ROS refuses when a bag is played."""
    names = [name for name in messages.topics if not _TOPIC.fullmatch(name)]
    if not names:
        return ""
    shown = one_line(", ".join(names), 100)
    return f"; ROS plays no topic with other letters than a-z, 0-9 and _: {shown}"


def _write(messages: RosMessages, file: BinaryIO) -> "McapWriter":
    """Write the messages of a run as MCAP, and return the writer."""
    topics = messages.topics.values()
    writer = McapWriter(file, [(topic, messages.definition(topic)) for topic in topics])
    for blocks in messages.blocks():
        writer.write(blocks)
    writer.finish()
    return writer


def bag_metadata(messages: RosMessages, writer: McapWriter, file: str) -> dict[str, object]:
    """Return the content of `metadata.yaml` for the file of a bag."""
    begin = min((chunk.begins for chunk in writer.chunks), default=0)
    end = max((chunk.ends for chunk in writer.chunks), default=0)
    times: dict[str, object] = {
        "duration": {"nanoseconds": end - begin},
        "starting_time": {"nanoseconds_since_epoch": begin},
        "message_count": writer.counts.total(),
    }
    topics = [
        {
            "topic_metadata": {
                "name": topic.name,
                "type": topic.type,
                "serialization_format": "cdr",
                "offered_qos_profiles": _metadata(topic).get(QOS, ""),
                "type_description_hash": messages.types.hash_rihs01(topic.type),
            },
            "message_count": writer.counts[topic.name],
        }
        for topic in messages.topics.values()
    ]
    information = {
        "version": 8,
        "storage_identifier": "mcap",
        **times,
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file],
        "files": [{"path": file, **times}],
        "custom_data": {},
        "ros_distro": "",
    }
    return {"rosbag2_bagfile_information": information}
