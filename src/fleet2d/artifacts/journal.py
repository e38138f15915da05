"""The journal of a run: all rows so far in one file that survives the end of the process.

The file is a sequence of frames, each with its length and checksum: `table` describes a table,
`rows` holds rows of a table, and `commit` ends a group of frames that belong together. The file is
only appended to; readers ignore all that follows the last complete commit, which a crash cut off.
"""

from __future__ import annotations

import json
import os
import struct
import sys
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts import files
from fleet2d.artifacts.chunk import Chunk, ColumnChunk, Dictionary, new_dictionaries
from fleet2d.artifacts.encoding import ArrayReader
from fleet2d.artifacts.table import DTYPES, Column, TableSpec
from fleet2d.errors import ArtifactError
from fleet2d.kernels import I64
from fleet2d.kernels.encoding import encode_arrays

FOLDER = "unfinished"
"""The folder in a run directory for files that are needed until the run is complete."""
JOURNAL_NAME = "journal"
# Journals are read where they were written: numbers are in the byte order of the machine.
MAGIC = f"fleet2d journal 3 {sys.byteorder}\n".encode()

Kind = Literal["table", "rows", "commit"]
_KINDS: tuple[Kind, ...] = ("table", "rows", "commit")
# Kind, bytes of the description, bytes of the arrays, checksum of all three and of both.
_HEADER = struct.Struct("<BIQI")
# Size of the frames that are written at once, unless a commit comes before [bytes].
_BUFFER_BYTES = 1 << 22
# Rows in one frame at most: a few damaged bytes must not request all memory.
_MOST_ROWS = 1 << 20
# The years 1 to 9999 [us since 1970], which `datetime` can express.
_FIRST_TIME, _END_OF_TIME = -62_135_596_800_000_000, 253_402_300_800_000_000
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
    """A table in the journal: its number, its rows, and the size of its dictionaries so far."""

    number: int
    spec: TableSpec
    rows: int
    words: dict[str, int]


class JournalWriter:
    """Appends to the journal of a run.

    Attributes:
        path: The file.
        end: Position where the last commit ends [bytes].
    """

    def __init__(self, path: Path, start: int = 0) -> None:
        """Create the file, or continue after a commit, whose rows are then passed to `replay`.

        Args:
            path: The file.
            start: Where the commit ends [bytes]; 0: create the file.

        Raises:
            OSError: The file can't be written.
        """
        self.path, self.end = path, start
        self._tables: dict[str, _LoggedTable] = {}
        self._buffer: list[bytes] = []
        self._size = 0  # bytes in the buffer
        self._written = start
        flags = os.O_WRONLY if start else os.O_WRONLY | os.O_CREAT | os.O_EXCL
        self._handle = os.open(path, flags, 0o666)
        try:
            if start:
                os.ftruncate(self._handle, start)
                os.lseek(self._handle, 0, os.SEEK_END)
            else:
                files.write_all(self._handle, MAGIC)
                self.end = self._written = len(MAGIC)
        except OSError:
            os.close(self._handle)
            raise

    def replay(self, entry: LoggedRows) -> None:
        """Count rows that are in the file already."""
        table = self._tables.setdefault(
            entry.spec.name, _LoggedTable(len(self._tables), entry.spec, 0, {})
        )
        table.rows += entry.rows
        table.words = {name: len(words) for name, words in entry.words.items()}

    def add(
        self,
        spec: TableSpec,
        arrays: list[NDArray[Any]],
        rows: int,
        words: Mapping[str, Dictionary],
    ) -> None:
        """Append rows; readers see them after the next commit.

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
            table = self._tables[spec.name] = _LoggedTable(len(self._tables), spec, 0, {})
            self._append("table", _to_json(asdict(spec)))
        added_words = {}
        for name, dictionary in words.items():
            known, count = table.words.get(name, 0), len(dictionary) - (None in dictionary)
            if count > known:
                added_words[name] = dictionary.in_order()[known:]
                table.words[name] = count
        table.rows += rows
        # Most parts of a table have no new words, and no need of an encoder.
        added = _to_json(added_words) if added_words else "{}"
        self._append("rows", f"[{table.number},{rows},{added}]", encode_arrays(arrays))

    def commit(self, step: int) -> Commit:
        """Commit all rows so far, and write them to the file.

        Args:
            step: The first step of which rows may be missing.

        Raises:
            OSError: It can't be written; the commit before it is still the last one.
        """
        rows = {name: table.rows for name, table in self._tables.items()}
        self._append("commit", f"[{step},[{','.join(map(str, rows.values()))}]]")
        self._write()
        self.end = self._written
        return Commit(step, rows, self.end)

    def sync(self) -> None:
        """Flush the journal to the disk, so that it survives a power cut, not only a crash."""
        files.sync(self._handle)

    def close(self, *, undo: bool = False) -> None:
        """Close the file; with `undo`, remove what was written since the last commit."""
        if self._handle < 0:
            return
        handle, self._handle = self._handle, -1
        if undo:
            with suppress(OSError):  # readers ignore it anyway
                os.ftruncate(handle, self.end)
        with suppress(OSError):  # what has to be on the disk was synced before
            os.close(handle)

    def _append(self, kind: Kind, description: str, content: bytes = b"") -> None:
        text, number = description.encode(), _KINDS.index(kind)
        header = _HEADER.pack(number, len(text), len(content), _checksum(number, text, content))
        self._buffer += [header, text, content]
        self._size += len(text) + len(content)
        if self._size > _BUFFER_BYTES:
            self._write()

    def _write(self) -> None:
        content = b"".join(self._buffer)
        self._buffer, self._size = [], 0
        files.write_all(self._handle, content)
        self._written += len(content)


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
        ArtifactError: The file can't be read, or is not a journal.
    """
    commit = None
    names: list[str] = []
    with _damage_of(path):
        for kind, description, _, end in _frames(path):
            if kind == "table":
                names.append(_spec_of(description).name)
            if kind == "commit":
                step, rows = description
                commit = Commit(int(step), dict(zip(names, map(int, rows), strict=True)), end)
    return commit


def read_journal(path: Path, end: int) -> Iterator[LoggedRows]:
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
        for kind, description, content, stop in _frames(path):
            if stop > end:
                break
            if kind == "table":
                specs.append(_spec_of(description))
                if specs[-1].name in [spec.name for spec in specs[:-1]]:
                    raise ValueError(f"two tables have the name {specs[-1].name}")
                words.append(new_dictionaries(specs[-1]))
            if kind == "rows":
                number, rows, added_words = description
                spec, dictionaries = specs[number], words[number]
                for name, column_words in added_words.items():
                    dictionaries[name].enter(column_words)
                chunk = _chunk_of(spec, rows, content, dictionaries)
                yield LoggedRows(spec, chunk, rows, dictionaries)


@contextmanager
def _damage_of(path: Path) -> Iterator[None]:
    """Name the file if a frame with a right checksum has a wrong content."""
    try:
        yield
    except (AttributeError, KeyError, IndexError, TypeError, ValueError) as error:
        raise ArtifactError(f"{path} is damaged ({error}): run the scenario again") from error


def _frames(path: Path) -> Iterator[tuple[Kind, Any, bytes, int]]:
    """Yield kind, description, arrays and end of each frame, up to the first incomplete one."""
    try:
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                return
            yield from _whole_frames(file)
    except FileNotFoundError:
        return
    except OSError as error:
        raise ArtifactError(f"{path} can't be read: {error.strerror or error}") from error


def _whole_frames(file: BinaryIO) -> Iterator[tuple[Kind, Any, bytes, int]]:
    size = os.fstat(file.fileno()).st_size
    while len(header := file.read(_HEADER.size)) == _HEADER.size:
        number, text_bytes, content_bytes, checksum = _HEADER.unpack(header)
        if number >= len(_KINDS) or file.tell() + text_bytes + content_bytes > size:
            return
        text, content = file.read(text_bytes), file.read(content_bytes)
        if _checksum(number, text, content) != checksum:
            return
        try:
            description = json.loads(text)
        except (ValueError, RecursionError):
            return
        yield _KINDS[number], description, content, file.tell()


def _checksum(number: int, text: bytes, content: bytes) -> int:
    return zlib.crc32(content, zlib.crc32(text, number + len(text)))


def _spec_of(description: Mapping[str, Any]) -> TableSpec:
    columns = [
        Column(**{**column, "categories": tuple(column["categories"])})
        for column in description["columns"]
    ]
    spec = TableSpec(description["name"], tuple(columns), description["description"])
    for column in columns:
        texts = column.name, column.unit, column.description, *column.categories, spec.description
        if not all(isinstance(text, str) for text in texts):
            raise TypeError(f"a column is described by {texts}")
    return spec


def _chunk_of(spec: TableSpec, rows: int, content: bytes, words: dict[str, Dictionary]) -> Chunk:
    if not 0 <= rows <= _MOST_ROWS:
        raise ValueError(f"{rows} rows at once")
    reader = ArrayReader(content)
    return {
        column.name: _column_of(column, reader, rows, words.get(column.name))
        for column in spec.columns
    }


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
