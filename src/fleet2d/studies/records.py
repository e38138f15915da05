"""The results of one variant as bytes, as workers send them and the journal stores them."""

import json
import os
import struct
import time
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet2d.artifacts.manifest import plain
from fleet2d.studies.executors import WorkerTask
from fleet2d.studies.simulator import VariantOutcome
from fleet2d.studies.storage import write_error

if TYPE_CHECKING:
    import pyarrow as pa


_LENGTH = struct.Struct("<I")


@dataclass(frozen=True)
class VariantRecord:
    """The results of one variant.

    Attributes:
        header: All but the tables: `number`, `identity`, `status`, `digest`, `metrics`, `wall_s`,
            `peak_rss_mb`, `error`, `trace`, `attempts`; and `tables`, (name, bytes) pairs.
        body: The tables one after the other, each as an Arrow stream.
    """

    header: Mapping[str, Any]
    body: bytes = b""

    @property
    def number(self) -> int:
        """The number of the variant."""
        return int(self.header["number"])

    @property
    def is_complete(self) -> bool:
        """Whether the run succeeded."""
        return bool(self.header["status"] == "complete")

    def encode(self) -> bytes:
        """Return the record as bytes."""
        text = json.dumps(self.header, separators=(",", ":")).encode()
        return _LENGTH.pack(len(text)) + text + self.body

    @classmethod
    def decode(cls, data: bytes) -> "VariantRecord":
        """Return the record that `encode` returned as bytes."""
        (length,) = _LENGTH.unpack_from(data)
        end = _LENGTH.size + length
        return cls(json.loads(data[_LENGTH.size : end]), bytes(data[end:]))

    def streams(self) -> dict[str, "pa.Buffer"]:
        """Return the Arrow stream of each table."""
        import pyarrow as pa

        body, start, streams = pa.py_buffer(self.body), 0, {}
        for name, size in self.header["tables"]:
            streams[name] = body.slice(start, size)
            start += size
        return streams


def record_of(task: WorkerTask, outcome: VariantOutcome, attempts: int = 1) -> VariantRecord:
    """Return the outcome of a task as a record."""
    streams = {name: _stream(table) for name, table in outcome.tables.items()}
    fields = vars(outcome).items()
    header = {key: value for key, value in fields if key != "tables" and value != {}}
    header |= {
        "number": task.number,
        "identity": task.identity,
        "attempts": attempts,
        "metrics": outcome.metrics,
        "tables": [(name, len(data)) for name, data in streams.items()],
    }
    return VariantRecord(plain(header), b"".join(streams.values()))


def _stream(table: "pa.Table") -> bytes:
    """Return a table as a compressed Arrow stream."""
    import pyarrow as pa

    sink = pa.BufferOutputStream()
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.ipc.new_stream(sink, table.schema, options=options) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue())


_FRAME = struct.Struct("<4sQI")
_MARK = b"F2DV"
SYNC_EVERY_S = 2.0  # the most that a power cut loses; a killed process loses nothing


class Journal:
    """A file of records that only grows.

    Attributes:
        path: The file.
        offsets: The offset of the newest frame of each variant, by its number [bytes].
        size: The size of all complete frames [bytes].
    """

    def __init__(self, path: Path) -> None:
        """Open a journal for appending, and cut off an incomplete frame at its end.

        Raises:
            ArtifactError: It can't be written.
        """
        self.path = path
        self.offsets: dict[int, int] = {}
        self.size = 0
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
            for offset, end, record in _frames(self._file):
                self.offsets[record.number], self.size = offset, end
            os.ftruncate(self._file, self.size)
        except OSError as error:
            raise write_error(path.parent, error) from error
        self._sync_time = time.monotonic()

    def __len__(self) -> int:
        """Return the number of variants in it."""
        return len(self.offsets)

    def append(self, record: VariantRecord) -> None:
        """Add a record; after that it survives a kill of the process.

        Raises:
            ArtifactError: The disk is full, or the file can't be written; nothing is added.
        """
        data = record.encode()
        frame = _FRAME.pack(_MARK, len(data), zlib.crc32(data)) + data
        try:
            count = 0
            while count < len(frame):
                count += os.pwrite(self._file, frame[count:], self.size + count)
            if time.monotonic() - self._sync_time > SYNC_EVERY_S:
                os.fsync(self._file)
                self._sync_time = time.monotonic()
        except OSError as error:
            os.ftruncate(self._file, self.size)
            raise write_error(self.path.parent, error) from error
        self.offsets[record.number] = self.size
        self.size += len(frame)

    def read(self, number: int) -> VariantRecord:
        """Return the newest record of a variant."""
        offset = self.offsets[number]
        _, length, _ = _FRAME.unpack(os.pread(self._file, _FRAME.size, offset))
        return VariantRecord.decode(os.pread(self._file, length, offset + _FRAME.size))

    def close(self) -> None:
        """Flush everything to the disk, and close the file."""
        os.fsync(self._file)
        os.close(self._file)


def read_journal(path: Path) -> Iterator[VariantRecord]:
    """Yield the complete records of a journal; another process may be writing it."""
    try:
        file = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return
    try:
        for _, _, record in _frames(file):
            yield record
    finally:
        os.close(file)


def _frames(file: int) -> Iterator[tuple[int, int, VariantRecord]]:
    """Yield (start, end, record) of each complete frame, up to the first incomplete one [bytes]."""
    offset = 0
    while True:
        head = os.pread(file, _FRAME.size, offset)
        if len(head) < _FRAME.size:
            return
        mark, length, checksum = _FRAME.unpack(head)
        if mark != _MARK:
            return
        data = os.pread(file, length, offset + _FRAME.size)
        if len(data) < length or zlib.crc32(data) != checksum:
            return
        end = offset + _FRAME.size + length
        yield offset, end, VariantRecord.decode(data)
        offset = end
