"""One variant's results as bytes: what workers send, and what the journal keeps."""

import json
import struct
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from fleet2d.artifacts.manifest import plain
from fleet2d.studies.engine import Outcome

if TYPE_CHECKING:
    import pyarrow as pa

_LENGTH = struct.Struct("<I")


@dataclass(frozen=True)
class Task:
    """A variant to run.

    Attributes:
        number: What results call it.
        index: Its place in the design.
        identity: What it was when it was planned.
        home: The same for variants that can share a home.
    """

    number: int
    index: int
    identity: str
    home: str = ""


@dataclass(frozen=True)
class Record:
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
    def decode(cls, data: bytes) -> "Record":
        """Return the record of such bytes."""
        (length,) = _LENGTH.unpack_from(data)
        end = _LENGTH.size + length
        return cls(json.loads(data[_LENGTH.size : end]), bytes(data[end:]))

    def streams(self) -> dict[str, "pa.Buffer"]:
        """Return the Arrow stream of each table."""
        import pyarrow as pa

        whole, start, found = pa.py_buffer(self.body), 0, {}
        for name, size in self.header["tables"]:
            found[name] = whole.slice(start, size)
            start += size
        return found


def record_of(task: Task, outcome: Outcome, attempts: int = 1) -> Record:
    """Return what came of a task as a record."""
    streams = {name: _stream(table) for name, table in outcome.tables.items()}
    header = {key: value for key, value in asdict_without_tables(outcome).items() if value != {}}
    header |= {
        "number": task.number,
        "identity": task.identity,
        "attempts": attempts,
        "metrics": outcome.metrics,
        "tables": [(name, len(data)) for name, data in streams.items()],
    }
    return Record(plain(header), b"".join(streams.values()))


def asdict_without_tables(outcome: Outcome) -> dict[str, Any]:
    """Return the fields of an outcome but its tables."""
    bare = Outcome(**{**vars(outcome), "tables": {}})
    return {key: value for key, value in asdict(bare).items() if key != "tables"}


def _stream(table: "pa.Table") -> bytes:
    """Return a table as a compressed Arrow stream."""
    import pyarrow as pa

    sink = pa.BufferOutputStream()
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.ipc.new_stream(sink, table.schema, options=options) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue())
