"""An unfinished run: its rows in a journal, its checkpoint, and the right to write in its folder.

The folder `unfinished` in a run directory exists until the run is complete. In the journal, a frame
`table` holds the Arrow schema of a table, `rows` holds rows of one, and `commit` ends the frames
that belong together: readers ignore what follows the last commit.
"""

from __future__ import annotations

import hashlib
import json
import struct
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts.table import (
    DTYPES,
    Chunk,
    Column,
    ColumnChunk,
    Dictionary,
    TableSpec,
    Words,
    new_dictionaries,
)
from fleet2d.errors import ArtifactError
from fleet2d.kernels import I64, encode_arrays
from fleet2d.storage.files import (
    PARTIAL,
    FolderLock,
    FrameWriter,
    JournalFormat,
    read_frames,
    replacing,
    sync_directory,
)

if TYPE_CHECKING:
    import pyarrow as pa

FOLDER = "unfinished"
"""The folder in a run directory for files that are needed until the run is complete."""
JOURNAL_NAME = "journal"
CHECKPOINT_NAME = "checkpoint"
LOCK_NAME = "run.lock"
# Journals are read where they were written: numbers are in the byte order of the machine.
JOURNAL = JournalFormat(
    f"fleet2d journal 4 {sys.byteorder}\n".encode(), ("table", "rows", "commit")
)

# Interval of flushing the journal to the disk [s]: a power cut loses no more, and a crash of the
# process nothing.
SYNC_S = 5.0
# A frame has at most this many rows, as a few damaged bytes must not request all memory.
_MAX_ROWS = 1 << 20
# The years 1 to 9999 [us since 1970], which `datetime` can express.
_FIRST_TIME = -62_135_596_800_000_000
_END_OF_TIME = 253_402_300_800_000_000
_to_json = json.JSONEncoder(separators=(",", ":")).encode


class Commit(NamedTuple):
    """A commit: all rows of a run up to a step.

    Attributes:
        step: The first step of which rows may be missing.
        rows: Number of rows of each table, by name.
        end: Position in the journal [bytes].
    """

    step: int
    rows: dict[str, int]
    end: int


@dataclass
class _LoggedTable:
    """A table in a journal: its number, its rows, and the size of its dictionaries so far."""

    number: int
    rows: int = 0
    words: dict[str, int] = field(default_factory=dict)


class LoggedRows(NamedTuple):
    """Rows of a table in a journal.

    Attributes:
        spec: The table.
        chunk: The rows.
        rows: Their number.
        words: The dictionaries of columns whose dictionary grows, up to these rows.
    """

    spec: TableSpec
    chunk: Chunk
    rows: int
    words: dict[str, Dictionary]


def last_commit(path: Path) -> Commit | None:
    """Return the last commit of a journal; None if there is no journal, or none in it.

    Raises:
        ArtifactError: The file can't be read, or is damaged.
    """
    commit = None
    names: list[str] = []
    with _damage_of(path):
        for frame in read_frames(path, JOURNAL):
            if frame.kind == "table":
                names.append(_spec_of(frame.content).name)
            if frame.kind == "commit":
                step, rows = frame.description
                rows_of_tables = dict(zip(names, map(int, rows), strict=True))
                commit = Commit(int(step), rows_of_tables, frame.end)
    return commit


def read_rows(path: Path, end: int) -> Iterator[LoggedRows]:
    """Yield the rows of a journal up to a commit, in the order in which they were stored.

    Args:
        path: The file.
        end: Position where the commit ends [bytes].

    Raises:
        ArtifactError: The file can't be read, or is damaged.
    """
    specs: list[TableSpec] = []
    words: list[dict[str, Dictionary]] = []
    with _damage_of(path):
        for frame in read_frames(path, JOURNAL):
            if frame.end > end:
                break
            if frame.kind == "table":
                added = _spec_of(frame.content)
                if added.name in [spec.name for spec in specs]:
                    raise ValueError(f"two tables have the name {added.name}")
                specs.append(added)
                words.append(new_dictionaries(added))
            if frame.kind == "rows":
                number, rows, added_words = frame.description
                spec = specs[number]
                dictionaries = words[number]
                for name, column_words in added_words.items():
                    dictionaries[name].enter(column_words)
                chunk = _chunk_of(spec, rows, frame.content, dictionaries)
                yield LoggedRows(spec, chunk, rows, dictionaries)


@contextmanager
def _damage_of(path: Path) -> Iterator[None]:
    """Raise an error that names the file if a frame has a right checksum and wrong content."""
    try:
        yield
    except (AttributeError, KeyError, IndexError, OSError, TypeError, ValueError) as error:
        raise ArtifactError(f"{path} is damaged ({error}): run the scenario again") from error


def _spec_of(schema: bytes) -> TableSpec:
    """Return the table that a serialized Arrow schema describes."""
    import pyarrow as pa

    from fleet2d.artifacts.arrow import spec_of

    return spec_of(pa.ipc.read_schema(pa.py_buffer(schema)))


def _chunk_of(spec: TableSpec, rows: int, content: bytes, words: dict[str, Dictionary]) -> Chunk:
    if not 0 <= rows <= _MAX_ROWS:
        raise ValueError(f"{rows} rows at once")
    reader = ArrayReader(content)
    return {c.name: _column_of(c, reader, rows, words.get(c.name)) for c in spec.columns}


def _column_of(
    column: Column, reader: ArrayReader, rows: int, words: Dictionary | None
) -> ColumnChunk:
    is_text = column.kind == "string"
    lengths = reader.read(np.dtype(np.int64), rows) if is_text else None
    valid = reader.read(np.dtype(np.bool_), rows) if column.nullable else None
    if lengths is None:
        values = reader.read(DTYPES[column.kind], rows)
        present = values if valid is None else values[valid]
        if column.kind == "category":
            _check_range(present, 0, len(column.categories if words is None else words))
        if column.kind == "time":
            _check_range(present, _FIRST_TIME, _END_OF_TIME)
        return ColumnChunk(values, valid)
    text = reader.read(np.dtype(np.uint8), int(lengths.sum()))
    _check_text(text.tobytes(), lengths)
    return ColumnChunk(text, valid, lengths)


def _check_range(values: NDArray[Any], first: int, end: int) -> None:
    if values.size and not first <= values.min() <= values.max() < end:
        raise ValueError(f"{values.min()} to {values.max()}, expected {first} to {end - 1}")


def _check_text(text: bytes, lengths: I64) -> None:
    if lengths.size and lengths.min() < 0:
        raise ValueError(f"a text of {lengths.min()} bytes")
    end = 0
    for length in lengths.tolist():
        text[end : end + length].decode()
        end += length


RAW, NARROW, GROWTH, RUNS, LINE = range(5)
"""The values · whole numbers in fewer bytes · the first value and by how much each of the others is
above the one before: a byte, or 255 and a number at the end · the value of each run of equal values
and the lengths, in as many bytes as the longest takes · `a` and `b`, where the values are `a + b`
times those of the array of int64 that comes before."""

# Encoding, number of runs or bytes of a narrow number, bytes of the content.
HEADER = struct.Struct("=BIQ")
_LONG = 255  # marks a growth that takes more than a byte
_NARROW = {1: np.uint8, 2: np.uint16, 4: np.uint32, 8: np.uint64}


class ArrayReader:
    """Reads arrays one after the other."""

    def __init__(self, content: bytes) -> None:
        """Begin with the first array."""
        self._content = content
        self._position = 0
        self._integers = np.empty(0, np.int64)

    def read(self, dtype: np.dtype[Any], rows: int) -> NDArray[Any]:
        """Return the next array.

        Args:
            dtype: The type of its values.
            rows: Their number.

        Raises:
            ValueError: The bytes don't encode that many values.
        """
        values = self._decode(dtype, rows)
        if len(values) != rows:
            raise ValueError(f"expected {rows} values, decoded {len(values)}")
        if dtype == np.bool_ and values.view(np.uint8).max(initial=0) > 1:
            raise ValueError("a flag is neither true nor false")
        if dtype == np.int64:
            self._integers = values
        return values

    def _decode(self, dtype: np.dtype[Any], rows: int) -> NDArray[Any]:
        encoding, count, content = self._next()
        if encoding == RAW:
            return np.frombuffer(content, dtype).copy()
        if dtype == np.uint8:
            raise ValueError(f"text has encoding {encoding}")
        if encoding == NARROW:
            return np.frombuffer(content, _narrow(count)).astype(dtype)
        if encoding == GROWTH:
            return _grow(content, dtype, rows)
        if encoding == RUNS:
            return _repeat(content, dtype, count, rows)
        if encoding == LINE:
            start, slope = np.frombuffer(content, dtype)
            return self._integers * slope + start
        raise ValueError(f"unknown encoding {encoding}")

    def _next(self) -> tuple[int, int, bytes]:
        try:
            encoding, count, size = HEADER.unpack_from(self._content, self._position)
        except struct.error as error:
            raise ValueError(str(error)) from None
        first = self._position + HEADER.size
        self._position = first + size
        if self._position > len(self._content):
            raise ValueError(f"{size} bytes of an array are missing")
        return encoding, count, self._content[first : self._position]


def _grow(content: bytes, dtype: np.dtype[Any], rows: int) -> NDArray[Any]:
    """Return the first value and those that follow from their growth."""
    end = dtype.itemsize + rows - 1
    first = np.frombuffer(content[: dtype.itemsize], dtype)
    growth = np.frombuffer(content[dtype.itemsize : end], np.uint8).astype(dtype)
    long = np.frombuffer(content[end:], dtype)
    is_long = growth == _LONG
    if len(long) != np.count_nonzero(is_long):
        raise ValueError(f"{len(long)} numbers don't make {rows} values")
    growth[is_long] = long
    return np.cumsum(np.concatenate([first, growth]), dtype=dtype)


def _repeat(content: bytes, dtype: np.dtype[Any], runs: int, rows: int) -> NDArray[Any]:
    """Return the values of run lengths, each repeated by its length."""
    middle = runs * dtype.itemsize
    width = (len(content) - middle) // max(1, runs)
    lengths = np.frombuffer(content[middle:], _narrow(width))
    # Lengths are checked before repeating: a few bytes must not request all memory.
    if len(lengths) != runs or int(lengths.sum(dtype=np.int64)) != rows:
        raise ValueError(f"{runs} runs don't make {rows} values")
    return np.repeat(np.frombuffer(content[:middle], dtype), lengths)


def _narrow(width: int) -> type[Any]:
    if width not in _NARROW:
        raise ValueError(f"no number is stored in {width} bytes")
    return _NARROW[width]


class UnfinishedRun:
    """The folder `unfinished` of a run directory, and the right to write there.

    Attributes:
        folder: The path of that folder.
    """

    def __init__(self, directory: Path) -> None:
        """Prepare access; `begin` and `resume` create the files."""
        self.directory = directory
        self.folder = directory / FOLDER
        self._lock: FolderLock | None = None
        self._journal: FrameWriter | None = None
        self._tables: dict[str, _LoggedTable] = {}  # in the journal
        self._synced = time.monotonic()

    @property
    def journal(self) -> FrameWriter:
        """The frames of the journal; there is none before `begin` or `resume`."""
        assert self._journal is not None, "the journal was not begun"
        return self._journal

    @property
    def checkpoint(self) -> Path:
        """The path of the last checkpoint, if there is one."""
        return self.folder / CHECKPOINT_NAME

    def lock(self) -> None:
        """Acquire the right to write.

        Raises:
            RunDirectoryError: Another process has the right.
            OSError: The lock file can't be created.
        """
        self._lock = self._lock or FolderLock(self.directory, LOCK_NAME)

    def begin(self) -> None:
        """Lock the directory and begin a new journal, which replaces an old one.

        Raises:
            RunDirectoryError: Another process is writing there.
            OSError: They can't be written.
        """
        self.lock()
        self.folder.mkdir(exist_ok=True)
        self.checkpoint.unlink(missing_ok=True)
        self._journal = FrameWriter(self.folder / JOURNAL_NAME, JOURNAL)
        self._tables = {}

    def resume(self, commit: Commit | None) -> Iterator[LoggedRows]:
        """Truncate the journal after a commit, and yield the rows before it.

        Raises:
            ArtifactError: The journal is damaged.
            OSError: It can't be written.
        """
        if commit is None:
            self.begin()
            return
        path = self.folder / JOURNAL_NAME
        self._journal = FrameWriter(path, JOURNAL, commit.end)
        for entry in read_rows(path, commit.end):
            table = self._tables.setdefault(entry.spec.name, _LoggedTable(len(self._tables)))
            table.rows += entry.rows
            table.words = {name: len(words) for name, words in entry.words.items()}
            yield entry

    def add(self, spec: TableSpec, arrays: list[NDArray[Any]], rows: int, words: Words) -> None:
        """Append rows to the journal; readers see them after the next commit.

        Args:
            spec: The table.
            arrays: The rows; see `TableBuffer.arrays`.
            rows: Their number.
            words: The dictionaries of columns whose dictionary grows, up to these rows.

        Raises:
            OSError: They can't be written.
        """
        table = self._tables.get(spec.name)
        if table is None:
            from fleet2d.artifacts.arrow import schema_of

            table = self._tables[spec.name] = _LoggedTable(len(self._tables))
            self.journal.add("table", "{}", schema_of(spec).serialize().to_pybytes())
        added_words = {}
        for name, dictionary in words.items():
            known = table.words.get(name, 0)
            count = len(dictionary) - (None in dictionary)
            if count > known:
                added_words[name] = dictionary.in_order()[known:]
                table.words[name] = count
        table.rows += rows
        # Most parts of a table have no new words, and no need of an encoder.
        added = _to_json(added_words) if added_words else "{}"
        self.journal.add("rows", f"[{table.number},{rows},{added}]", encode_arrays(arrays))

    def commit(self, step: int, *, sync: bool = False) -> Commit:
        """Commit all rows so far, and write them to the journal.

        Args:
            step: The first step of which rows may be missing.
            sync: Whether to flush the journal to the disk now.

        Raises:
            OSError: The rows can't be written; the commit before is still the last one.
        """
        rows = {name: table.rows for name, table in self._tables.items()}
        self.journal.add("commit", f"[{step},[{','.join(map(str, rows.values()))}]]")
        self.journal.commit()
        now = time.monotonic()
        if sync or now - self._synced > SYNC_S:
            self.journal.sync()
            self._synced = now
        return Commit(step, rows, self.journal.end)

    def journal_digest(self, end: int | None = None) -> str:
        """Return the SHA-256 of the journal up to a commit; None: up to the last one.

        Raises:
            OSError: It can't be read.
        """
        digest = hashlib.sha256()
        rest = self.journal.end if end is None else end
        with (self.folder / JOURNAL_NAME).open("rb") as file:
            while part := file.read(min(rest, 1 << 20)):
                digest.update(part)
                rest -= len(part)
        return digest.hexdigest()

    def keep_checkpoint(self, write: Callable[[int], None]) -> None:
        """Replace the checkpoint atomically; the rows that it refers to must be synced before.

        Args:
            write: Writes the checkpoint to the handle of an open file.

        Raises:
            OSError: It can't be written; the checkpoint before it is unchanged.
        """
        with replacing(self.checkpoint) as handle:
            write(handle)
        sync_directory(self.folder)

    def end(self, *, keep: bool = False, undo: bool = False) -> None:
        """Close the journal and release the run directory.

        Args:
            keep: Whether the run can be resumed later; else the folder is removed.
            undo: Whether to remove all rows since the last commit, as after a failed write.
        """
        if self._journal is not None:
            self._journal.close(undo=undo)
        if not keep and self._lock is not None:
            remove_leftovers(self.directory)
        self.release()

    def release(self) -> None:
        """Release the right to write, if it is held."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None


def remove_leftovers(directory: Path) -> None:
    """Remove the files that a complete run no longer needs, and no others."""
    folder = directory / FOLDER
    for name in (JOURNAL_NAME, CHECKPOINT_NAME, f"{CHECKPOINT_NAME}{PARTIAL}"):
        with suppress(OSError):
            (folder / name).unlink()
    with suppress(OSError):
        folder.rmdir()


def columns_of(entry: LoggedRows) -> dict[str, object]:
    """Return the rows of a journal's entry as columns that `RunStore.append` takes."""
    from fleet2d.artifacts.arrow import table_of

    table = table_of([(entry.chunk, entry.rows)], entry.spec, entry.words)
    columns: dict[str, object] = {}
    for column in entry.spec.columns:
        values, valid, _ = entry.chunk[column.name]
        if column.takes_strings:
            columns[column.name] = table[column.name].to_pylist()
        elif valid is None:
            columns[column.name] = values
        else:
            columns[column.name] = np.ma.MaskedArray(values, ~valid)
    return columns


def read_committed(path: Path, end: int, name: str) -> pa.Table:
    """Return a table of a journal up to a commit.

    Args:
        path: The journal.
        end: Position where the commit ends [bytes].
        name: The name of the table.

    Raises:
        ArtifactError: The journal is damaged.
    """
    from fleet2d.artifacts.arrow import table_of

    rows = [entry for entry in read_rows(path, end) if entry.spec.name == name]
    if not rows:
        raise ArtifactError(f"{path} names the table {name!r}, but has no rows of it")
    last: LoggedRows = rows[-1]  # the last dictionaries hold the words of all rows
    return table_of([(entry.chunk, entry.rows) for entry in rows], last.spec, last.words)
