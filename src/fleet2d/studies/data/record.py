"""The results of one variant as bytes, as workers send them and the journal stores them."""

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fleet2d.artifacts.plain import plain
from fleet2d.studies.simulator import VariantOutcome

if TYPE_CHECKING:
    import pyarrow as pa

_LENGTH = struct.Struct("<I")


@dataclass(frozen=True)
class WorkerTask:
    """A variant to run.

    Attributes:
        number: Its number in results.
        index: Its index in the design.
        identity: Its identity when it was planned.
        home: The same for variants that can share a home.
    """

    number: int
    index: int
    identity: str
    home: str = ""


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
