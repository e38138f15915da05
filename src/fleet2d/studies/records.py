"""The results of single variants, and the journal that stores each as soon as it is finished."""

import json
import math
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet2d.kernels import I32
from fleet2d.storage.files import Frame, FrameWriter, JournalFormat, read_frames
from fleet2d.studies.storage import DAMAGE, damaged, writing

if TYPE_CHECKING:
    import pyarrow as pa

    from fleet2d.studies.executors import WorkerTask
    from fleet2d.studies.simulator import VariantOutcome

FORMAT = JournalFormat(b"fleet2d study journal 2\n", ("variant",))
SYNC_EVERY_S = 2.0  # maximum loss after a power cut; a killed process loses nothing
VARIANT = "variant"
GROUP_ROWS = 5_000  # of results, that are written together
MAX_NUMBER = 1 << 27  # above those of variants: statuses and rows are arrays by number
MAX_HEADERS = 1_000  # that a journal has in memory, 3 kB each; as rows of a table they take 0.4

_ENCODER = json.JSONEncoder(separators=(",", ":"))


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

        body = pa.py_buffer(self.body)
        start = 0
        readers = {}
        for name, size in self.header["tables"]:
            readers[name] = pa.ipc.open_stream(body.slice(start, size))
            start += size
        return readers


def record_of(task: "WorkerTask", outcome: "VariantOutcome", attempts: int = 1) -> VariantRecord:
    """Return the outcome of a task as a record; JSON has no NaN and no infinity: they are null."""
    streams = {name: _stream(table) for name, table in outcome.tables.items()}
    fields = vars(outcome).items()
    header = {key: value for key, value in fields if key != "tables" and value != {}}
    header |= {
        "number": task.number,
        "identity": task.identity,
        "attempts": attempts,
        "metrics": {
            name: value if math.isfinite(value) else None for name, value in outcome.metrics.items()
        },
        "tables": [(name, len(data)) for name, data in streams.items()],
    }
    return VariantRecord(header, b"".join(streams.values()))


def _stream(table: "pa.Table") -> bytes:
    """Return a table as a compressed Arrow stream."""
    import pyarrow as pa

    sink = pa.BufferOutputStream()
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.ipc.new_stream(sink, table.schema, options=options) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue())


_HEADER_FIELDS = ("identity", "status", "digest", "error", "trace")
_SECONDS = {"setup_s": "setup", "simulate_s": "simulate", "wall_s": "total"}
RESULT_COLUMNS = (VARIANT, *_HEADER_FIELDS, "attempts", *_SECONDS, "peak_rss_mb")
"""The columns of the results beside the metrics."""


def array_of(values: Iterable[Any], kind: "pa.DataType") -> "pa.Array":
    """Return values, None among them, as an array of Arrow.

    `pyarrow.array` would do, but it imports pandas where that is installed, which takes 40 MB.
    """
    import pyarrow as pa

    from fleet2d.artifacts.arrow import number_array, string_array

    items = list(values)
    if kind == pa.string():
        return string_array(items)
    if kind == pa.float64():
        floats = np.array(items, np.float64)  # None becomes NaN
        return number_array(floats, kind, np.isnan(floats))
    missing = np.array([item is None for item in items], np.bool_)
    numbers = [0 if item is None else item for item in items] if missing.any() else items
    return number_array(np.array(numbers, kind.to_pandas_dtype()), kind, missing)


def check_numbers(table: "pa.Table") -> None:
    """Refuse rows without the number of a variant, or with one that no study has.

    Raises:
        ValueError: There are such rows.
    """
    numbers = table.column(VARIANT)
    if numbers.null_count or numbers.type != "int32":
        raise ValueError("it has rows without the number of a variant")
    found = numbers_of(table)
    if len(found) and not 0 <= int(found.min()) <= int(found.max()) < MAX_NUMBER:
        raise ValueError(f"it has numbers of variants outside of 0 to {MAX_NUMBER - 1}")


def numbers_of(table: "pa.Table") -> I32:
    """Return the numbers of the variants in the rows of a table: int32 (n,)."""
    from fleet2d.artifacts.arrow import values_of

    return values_of(table.column(VARIANT)).astype(np.int32, copy=False)


def results_table(headers: Iterable[Mapping[str, Any]]) -> "pa.Table":
    """Return one row for each variant: status, times, memory, and a column for each metric.

    Args:
        headers: The headers of their records.
    """
    import pyarrow as pa

    rows = list(headers)

    def column(kind: "pa.DataType", key: str, group: str = "") -> "pa.Array":
        """Return the values of a key of all headers, or of one of their mappings."""
        return array_of([(row.get(group, {}) if group else row).get(key) for row in rows], kind)

    columns = {VARIANT: column(pa.int32(), "number")}
    columns |= {name: column(pa.string(), name) for name in _HEADER_FIELDS}
    columns["attempts"] = column(pa.int32(), "attempts")
    columns |= {name: column(pa.float64(), phase, "wall_s") for name, phase in _SECONDS.items()}
    columns["peak_rss_mb"] = column(pa.float64(), "peak_rss_mb")
    metrics = dict.fromkeys(name for row in rows for name in row.get("metrics", {}))
    columns |= {name: column(pa.float64(), name, "metrics") for name in metrics}
    return pa.table(columns)


class Journal:
    """The records of variants that are not yet in a part of the data set; it only grows.

    Attributes:
        path: The file.
        offsets: The offset of the newest frame of each variant, by its number [bytes].
        with_tables: The numbers of variants that have tables.
    """

    def __init__(self, path: Path) -> None:
        """Open a journal for appending, and cut off an incomplete frame at its end.

        Raises:
            ArtifactError: It can't be written.
            RunDirectoryError: It is damaged.
        """
        self.path = path
        self.offsets: dict[int, int] = {}
        self.with_tables = set[int]()
        self._headers: list[Mapping[str, Any]] = []
        self._results: list[pa.Table] = []
        self._first_with: dict[tuple[str, ...], int] = {}  # variant, by the names of its metrics
        end = 0
        for frame in read_frames(path, FORMAT):
            self._add(_record(frame, path), frame.start)
            end = frame.end
        with writing(path.parent):
            self._writer = FrameWriter(path, FORMAT, end)
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
        with writing(self.path.parent):
            try:
                self._writer.add("variant", _ENCODER.encode(record.header), record.body)
                self._writer.commit()
                if time.monotonic() - self._sync_time > SYNC_EVERY_S:
                    self._writer.sync()
                    self._sync_time = time.monotonic()
            except OSError:
                self._writer.undo()
                raise
        self._add(record, start)

    def results(self) -> "Iterator[pa.Table]":
        """Yield the newest results of each variant as rows, in the order of their numbers."""
        import pyarrow as pa

        from fleet2d.artifacts.arrow import number_array

        self._pack()
        layouts = sorted(self._first_with, key=self._first_with.__getitem__)
        metrics = dict.fromkeys(name for layout in layouts for name in layout)
        rows = pa.concat_tables(self._results, promote_options="default")
        rows = rows.select([*RESULT_COLUMNS, *metrics])
        numbers = numbers_of(rows)
        newest = len(numbers) - 1 - np.unique(numbers[::-1], return_index=True)[1]
        for begin in range(0, max(len(newest), 1), GROUP_ROWS):
            yield rows.take(number_array(newest[begin : begin + GROUP_ROWS], pa.int64()))

    def _add(self, record: VariantRecord, start: int) -> None:
        number = record.number
        layout = tuple(record.header["metrics"])
        self.offsets[number] = start
        if record.header["tables"]:
            self.with_tables.add(number)
        else:
            self.with_tables.discard(number)
        self._first_with[layout] = min(number, self._first_with.get(layout, number))
        self._headers.append(record.header)
        if len(self._headers) == MAX_HEADERS:
            self._pack()

    def _pack(self) -> None:
        self._results.append(results_table(self._headers))
        self._headers = []

    def read(self, number: int) -> VariantRecord:
        """Return the newest record of a variant."""
        frame = next(read_frames(self.path, FORMAT, self.offsets[number]))
        return _record(frame, self.path)

    def close(self) -> None:
        """Flush everything to the disk, and close the file.

        Raises:
            ArtifactError: The disk failed.
        """
        with closing(self._writer), writing(self.path.parent):
            self._writer.sync()


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
        if (
            header["status"] not in ("complete", "failed")
            or not 0 <= int(header["number"]) < MAX_NUMBER
        ):
            raise ValueError("no result of a variant")
    except DAMAGE as error:
        raise damaged(path, error) from error
    return VariantRecord(header, frame.content)
