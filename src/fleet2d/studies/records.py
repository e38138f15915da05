"""The results of single variants, and the journal that stores each as soon as it is finished."""

import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fleet2d.artifacts.manifest import plain
from fleet2d.storage.files import Frame, FrameWriter, JournalFormat, read_frames
from fleet2d.studies.executors import WorkerTask
from fleet2d.studies.simulator import VariantOutcome
from fleet2d.studies.storage import DAMAGE, damaged, write_error

if TYPE_CHECKING:
    import pyarrow as pa

FORMAT = JournalFormat(b"fleet2d study journal 2\n", ("variant",))
SYNC_EVERY_S = 2.0  # maximum loss after a power cut; a killed process loses nothing


@dataclass(frozen=True)
class VariantRecord:
    """The results of one variant, as workers send them and the journal stores them.

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

    def tables(self) -> "dict[str, pa.RecordBatchReader]":
        """Return the tables by name, not yet read."""
        import pyarrow as pa

        body, start, readers = pa.py_buffer(self.body), 0, {}
        for name, size in self.header["tables"]:
            readers[name] = pa.ipc.open_stream(body.slice(start, size))
            start += size
        return readers


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


class Journal:
    """The records of variants that are not yet in a part of the data set; it only grows.

    Attributes:
        path: The file.
        offsets: The offset of the newest frame of each variant, by its number [bytes].
    """

    def __init__(self, path: Path) -> None:
        """Open a journal for appending, and cut off an incomplete frame at its end.

        Raises:
            ArtifactError: It can't be written.
            RunDirectoryError: It is damaged.
        """
        self.path = path
        self.offsets: dict[int, int] = {}
        end = 0
        for frame in read_frames(path, FORMAT):
            self.offsets[_record(frame, path).number], end = frame.start, frame.end
        try:
            self._writer = FrameWriter(path, FORMAT, end)
        except OSError as error:
            raise write_error(path.parent, error) from error
        self._sync_time = time.monotonic()

    @property
    def size(self) -> int:
        """The size of all complete frames [bytes]."""
        return self._writer.end

    def __len__(self) -> int:
        """Return the number of variants in it."""
        return len(self.offsets)

    def append(self, record: VariantRecord) -> None:
        """Add a record; after that it survives a kill of the process.

        Raises:
            ArtifactError: The disk is full, or the file can't be written; nothing is added.
        """
        start = self.size
        try:
            header = json.dumps(record.header, separators=(",", ":"))
            self._writer.add("variant", header, record.body)
            self._writer.commit()
            if time.monotonic() - self._sync_time > SYNC_EVERY_S:
                self._writer.sync()
                self._sync_time = time.monotonic()
        except OSError as error:
            self._writer.undo()
            raise write_error(self.path.parent, error) from error
        self.offsets[record.number] = start

    def read(self, number: int) -> VariantRecord:
        """Return the newest record of a variant."""
        frame = next(read_frames(self.path, FORMAT, self.offsets[number]))
        return _record(frame, self.path)

    def close(self) -> None:
        """Flush everything to the disk, and close the file.

        Raises:
            ArtifactError: The disk failed.
        """
        try:
            self._writer.sync()
        except OSError as error:
            raise write_error(self.path.parent, error) from error
        finally:
            self._writer.close()


def read_journal(path: Path) -> Iterator[VariantRecord]:
    """Yield the complete records of a journal; another process may be writing it.

    Raises:
        RunDirectoryError: It is damaged.
    """
    for frame in read_frames(path, FORMAT):
        yield _record(frame, path)


def _record(frame: Frame, path: Path) -> VariantRecord:
    """Return the record in a frame, with the types that readers rely on."""
    try:
        header = frame.description
        sizes = [(str(name), int(size)) for name, size in header["tables"]]
        header = {**header, "tables": sizes, "metrics": dict(header["metrics"])}
        if header["status"] not in ("complete", "failed") or not 0 <= int(header["number"]) < 2**31:
            raise ValueError("no result of a variant")
    except DAMAGE as error:
        raise damaged(path, error) from error
    return VariantRecord(header, frame.content)
