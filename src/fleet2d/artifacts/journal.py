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
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleet2d.artifacts import files
from fleet2d.artifacts.chunk import Chunk, ColumnChunk, Dictionary, new_dictionaries
from fleet2d.artifacts.encoding import (
    FEW,
    RAW,
    STEPS,
    Encoded,
    decode,
    decode_times,
    encode,
    encode_times,
)
from fleet2d.artifacts.table import DTYPES, Column, TableSpec
from fleet2d.errors import ArtifactError

FOLDER = "unfinished"
"""The folder in a run directory for files that are needed until the run is complete."""
JOURNAL_NAME = "journal"
MAGIC = b"fleet2d journal 2\n"

Kind = Literal["table", "rows", "commit"]
_KINDS: tuple[Kind, ...] = ("table", "rows", "commit")
# Kind, bytes of the description, bytes of the arrays, checksum of all three and of both.
_HEADER = struct.Struct("<BIQI")
# Size of the frames that are written at once, unless a commit comes before [bytes].
_BUFFER_BYTES = 1 << 22
# Rows in one frame at most: a few damaged bytes must not request all memory.
_MOST_ROWS = 1 << 20
_IS_LITTLE_ENDIAN = sys.byteorder == "little"
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
        self._size = 0
        flags = os.O_WRONLY if start else os.O_WRONLY | os.O_CREAT | os.O_EXCL
        self._handle = os.open(path, flags, 0o666)
        try:
            if start:
                os.ftruncate(self._handle, start)
                os.lseek(self._handle, 0, os.SEEK_END)
            else:
                files.write_all(self._handle, MAGIC)
                self.end = len(MAGIC)
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
        self, spec: TableSpec, chunk: Chunk, rows: int, words: Mapping[str, Dictionary]
    ) -> None:
        """Append rows; readers see them after the next commit.

        Raises:
            OSError: They can't be written.
        """
        table = self._tables.get(spec.name)
        if table is None:
            table = self._tables[spec.name] = _LoggedTable(len(self._tables), spec, 0, {})
            self._append("table", asdict(spec), [])
        arrays: list[bytes] = []
        columns = []
        steps = None
        for column in spec.columns:
            parts: list[Any] = []  # raw values: their size; others: encoding, runs and size
            for values in chunk[column.name]:
                if values is None:
                    parts.append(None)
                    continue
                if len(values) < FEW and _IS_LITTLE_ENDIAN:  # most tables have few rows a day
                    parts.append(values.nbytes)
                    arrays.append(values.tobytes())
                    continue
                encoding, runs, content = _encoded(column, values, steps)
                length = sum(map(len, content))
                parts.append(length if encoding == RAW else [encoding, runs, length])
                arrays += content
            if column.kind == "step":
                steps = chunk[column.name].values
            columns.append(parts)
        added_words = {}
        for name, dictionary in words.items():
            known, count = table.words.get(name, 0), len(dictionary) - (None in dictionary)
            added_words[name] = dictionary.in_order()[known:] if count > known else []
            table.words[name] = count
        table.rows += rows
        size = {"table": table.number, "rows": rows}
        self._append("rows", {**size, "columns": columns, "words": added_words}, arrays)

    def commit(self, step: int) -> Commit:
        """Commit all rows so far, and write them to the file.

        Args:
            step: The first step of which rows may be missing.

        Raises:
            OSError: It can't be written; the commit before it is still the last one.
        """
        rows = {name: table.rows for name, table in self._tables.items()}
        self._append("commit", {"step": step, "rows": rows}, [])
        self._write()
        self.end = os.lseek(self._handle, 0, os.SEEK_CUR)
        return Commit(step, rows, self.end)

    def sync(self) -> None:
        """Flush the journal to the disk, so that it survives a power cut, not only a crash."""
        files.sync(self._handle)

    def close(self, *, undo: bool = False) -> None:
        """Close the file; with `undo`, remove what was written since the last commit."""
        if self._handle < 0:
            return
        try:
            if undo:
                os.ftruncate(self._handle, self.end)
        except OSError:
            pass  # readers ignore it anyway
        finally:
            os.close(self._handle)
            self._handle = -1

    def _append(self, kind: Kind, description: Mapping[str, Any], arrays: list[bytes]) -> None:
        text = _to_json(description).encode()
        size, number = sum(map(len, arrays)), _KINDS.index(kind)
        header = _HEADER.pack(number, len(text), size, _checksum(number, text, *arrays))
        self._buffer += [header, text, *arrays]
        self._size += len(text) + size
        if self._size > _BUFFER_BYTES:
            self._write()

    def _write(self) -> None:
        content = b"".join(self._buffer)
        self._buffer, self._size = [], 0
        files.write_all(self._handle, content)


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
    for kind, description, _, end in _frames(path):
        if kind == "commit":
            commit = Commit(int(description["step"]), dict(description["rows"]), end)
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
    try:
        for kind, description, content, stop in _frames(path):
            if stop > end:
                break
            if kind == "table":
                specs.append(_spec_of(description))
                words.append(new_dictionaries(specs[-1]))
            if kind == "rows":
                spec, dictionaries = specs[description["table"]], words[description["table"]]
                for name, added_words in description["words"].items():
                    dictionaries[name].enter(added_words)
                chunk = _chunk_of(spec, description, content)
                yield LoggedRows(spec, chunk, description["rows"], dictionaries)
    except (KeyError, IndexError, TypeError, ValueError) as error:
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
        number, text_bytes, array_bytes, checksum = _HEADER.unpack(header)
        if number >= len(_KINDS) or file.tell() + text_bytes + array_bytes > size:
            return
        text, content = file.read(text_bytes), file.read(array_bytes)
        if _checksum(number, text, content) != checksum:
            return
        try:
            description = json.loads(text)
        except (ValueError, RecursionError):
            return
        yield _KINDS[number], description, content, file.tell()


def _checksum(number: int, text: bytes, *arrays: bytes) -> int:
    checksum = zlib.crc32(text, number + len(text))
    for content in arrays:
        checksum = zlib.crc32(content, checksum)
    return checksum


def _encoded(column: Column, values: NDArray[Any], steps: NDArray[np.int64] | None) -> Encoded:
    """Return an array of a column, given the steps of the same rows if they come before it."""
    if values.dtype == np.bool_:
        return encode(values)
    if column.kind == "time" and steps is not None and (times := encode_times(values, steps)):
        return times
    return encode(values, grows=column.kind in ("step", "time"))


def _spec_of(description: Mapping[str, Any]) -> TableSpec:
    columns = [
        Column(**{**column, "categories": tuple(column["categories"])})
        for column in description["columns"]
    ]
    return TableSpec(description["name"], tuple(columns), description["description"])


def _chunk_of(spec: TableSpec, description: Mapping[str, Any], content: bytes) -> Chunk:
    chunk, position, rows = dict[str, ColumnChunk](), 0, int(description["rows"])
    steps = np.empty(0, np.int64)
    if not 0 <= rows <= _MOST_ROWS:
        raise ValueError(f"{rows} rows at once")
    for column, parts in zip(spec.columns, description["columns"], strict=True):
        arrays: list[Encoded | None] = []
        for part in parts:
            if part is None:
                arrays.append(None)
                continue
            encoding, runs, size = (RAW, 0, part) if isinstance(part, int) else part
            arrays.append((encoding, runs, [content[position : position + size]]))
            position += size
        chunk[column.name] = _column_of(column, arrays, rows, steps)
        if column.kind == "step":
            steps = chunk[column.name].values
    return chunk


def _column_of(
    column: Column, arrays: list[Encoded | None], rows: int, steps: NDArray[np.int64]
) -> ColumnChunk:
    values, valid, lengths = arrays
    assert values is not None
    flags = None if valid is None else decode(valid, np.dtype(np.bool_), rows)
    if values[0] == STEPS and column.kind == "time" and len(steps) == rows:
        return ColumnChunk(decode_times(values, steps), flags)
    if lengths is None:
        return ColumnChunk(decode(values, DTYPES[column.kind], rows), flags)
    sizes = decode(lengths, np.dtype(np.int64), rows)
    if values[0] != RAW:
        raise ValueError(f"text is encoded as {values[0]!r}")
    text = decode(values, np.dtype(np.uint8), int(sizes.sum()))
    return ColumnChunk(text, flags, sizes)
