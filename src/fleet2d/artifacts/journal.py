"""The journal of a run: all rows so far in one file that survives the end of the process.

The file is a row of frames, each with its length and checksum: `table` names a table and its
columns, `rows` holds rows of one, `commit` says that everything before it belongs together. It
only grows; what comes after the last whole commit was cut off by a crash, and is left out.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple

import numpy as np

from fleet2d.artifacts import files
from fleet2d.artifacts.chunk import Chunk, ColumnChunk, Words
from fleet2d.artifacts.encoding import RAW, Encoded, decode, encode
from fleet2d.artifacts.table import DTYPES, Column, TableSpec
from fleet2d.errors import ArtifactError

FOLDER = "unfinished"
"""The folder in a run directory of what is needed until the run is complete."""
JOURNAL_NAME = "journal"
MAGIC = b"fleet2d journal 1\n"

Kind = Literal["table", "rows", "commit"]
_KINDS: tuple[Kind, ...] = ("table", "rows", "commit")
# Kind, bytes of the description, bytes of the arrays, checksum of all three and of both.
_HEADER = struct.Struct("<BIQI")
# Frames that wait for a commit are written once they take so much memory [bytes].
_WAITING = 1 << 22
# Rows in one frame at most: a few damaged bytes must not ask for all memory.
_MOST_ROWS = 1 << 20


class Commit(NamedTuple):
    """What belongs together: a run up to a step.

    Attributes:
        step: Every row before this step is there.
        rows: How many rows each table has.
        end: Where in the journal that is [bytes].
    """

    step: int
    rows: dict[str, int]
    end: int


@dataclass
class _Known:
    """A table in the journal: its number, its rows, and the words of its dictionaries so far."""

    number: int
    spec: TableSpec
    rows: int
    words: dict[str, int]


class JournalWriter:
    """Appends to the journal of a run.

    Attributes:
        path: The file.
        end: Where the last commit ends [bytes].
    """

    def __init__(self, path: Path, start: int = 0) -> None:
        """Create the file, or go on behind a commit whose rows are added anew by `replay`.

        Raises:
            OSError: The file can't be written.
        """
        self.path, self.end = path, start
        self._tables: dict[str, _Known] = {}
        self._waiting: list[bytes] = []
        self._size = 0
        how = os.O_WRONLY if start else os.O_WRONLY | os.O_CREAT | os.O_EXCL
        self._handle = os.open(path, how, 0o666)
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

    def replay(self, entry: Entry) -> None:
        """Take note of what the file holds already."""
        known = self._tables.setdefault(
            entry.spec.name, _Known(len(self._tables), entry.spec, 0, {})
        )
        known.rows += entry.rows
        known.words = {name: len(words) for name, words in entry.words.items()}

    def add(self, spec: TableSpec, chunk: Chunk, rows: int, words: Mapping[str, Words]) -> None:
        """Append rows, which count from the next commit on.

        Raises:
            OSError: They can't be written.
        """
        known = self._tables.get(spec.name)
        if known is None:
            known = self._tables[spec.name] = _Known(len(self._tables), spec, 0, {})
            self._append("table", asdict(spec), [])
        arrays: list[bytes] = []
        described = []
        for column in spec.columns:
            ramps = column.kind in ("step", "time")
            parts: list[list[Any] | None] = []
            for values in chunk[column.name]:
                if values is None:
                    parts.append(None)
                    continue
                how, runs, content = encode(values, ramps=ramps and values.dtype != np.bool_)
                parts.append([how, runs, sum(map(len, content))])
                arrays += content
            described.append(parts)
        added = {}
        for name, kept in words.items():
            listed = kept.listed()
            added[name] = listed[known.words.get(name, 0) :]
            known.words[name] = len(listed)
        known.rows += rows
        what = {"table": known.number, "rows": rows, "columns": described, "words": added}
        self._append("rows", what, arrays)

    def commit(self, step: int) -> Commit:
        """Say that everything so far belongs together, and hand it to the system.

        Raises:
            OSError: It can't be written; the last commit stands.
        """
        rows = {name: known.rows for name, known in self._tables.items()}
        self._append("commit", {"step": step, "rows": rows}, [])
        self._write()
        self.end = os.lseek(self._handle, 0, os.SEEK_CUR)
        return Commit(step, rows, self.end)

    def sync(self) -> None:
        """See the journal onto the disk: it survives a power cut then, not only a crash."""
        files.sync(self._handle)

    def close(self, *, undo: bool = False) -> None:
        """Let go of the file; after a failed write, cut off what was written since the commit."""
        if self._handle < 0:
            return
        try:
            if undo:
                os.ftruncate(self._handle, self.end)
        except OSError:
            pass  # a reader leaves it out anyway
        finally:
            os.close(self._handle)
            self._handle = -1

    def _append(self, kind: Kind, what: Mapping[str, Any], arrays: list[bytes]) -> None:
        described = json.dumps(what, separators=(",", ":")).encode()
        content = b"".join(arrays)
        number = _KINDS.index(kind)
        check = _checksum(number, described, content)
        self._waiting += [_HEADER.pack(number, len(described), len(content), check)]
        self._waiting += [described, content]
        self._size += len(described) + len(content)
        if self._size > _WAITING:
            self._write()

    def _write(self) -> None:
        content = b"".join(self._waiting)
        self._waiting, self._size = [], 0
        files.write_all(self._handle, content)


class Entry(NamedTuple):
    """Rows of a table as they stand in a journal.

    Attributes:
        spec: The table.
        chunk: The rows.
        rows: How many.
        words: The dictionaries of columns whose dictionary grows, up to these rows.
    """

    spec: TableSpec
    chunk: Chunk
    rows: int
    words: dict[str, Words]


def last_commit(path: Path) -> Commit | None:
    """Return the last commit of a journal; None if there is no journal, or none in it.

    Raises:
        ArtifactError: The file can't be read, or is no journal.
    """
    found = None
    for kind, what, _, end in _frames(path):
        if kind == "commit":
            found = Commit(int(what["step"]), dict(what["rows"]), end)
    return found


def read_journal(path: Path, end: int) -> Iterator[Entry]:
    """Yield the rows of a journal up to a commit, in the order in which they were stored.

    Args:
        path: The file.
        end: Where the commit ends, as `last_commit` says.

    Raises:
        ArtifactError: The file can't be read, or doesn't hold what it says.
    """
    specs: list[TableSpec] = []
    words: list[dict[str, Words]] = []
    try:
        for kind, what, content, stop in _frames(path):
            if stop > end:
                break
            if kind == "table":
                specs.append(_spec_of(what))
                words.append({c.name: Words() for c in specs[-1].columns if c.is_growing})
            if kind == "rows":
                spec, known = specs[what["table"]], words[what["table"]]
                for name, added in what["words"].items():
                    for word in added:
                        known[name][word]  # looking a new word up enters it
                yield Entry(spec, _chunk_of(spec, what, content), what["rows"], known)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise ArtifactError(f"{path} is damaged ({error}): run the scenario again") from error


def _frames(path: Path) -> Iterator[tuple[Kind, Any, bytes, int]]:
    """Yield kind, description, arrays and end of each whole frame, up to the first cut-off one."""
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
        number, described, arrays, check = _HEADER.unpack(header)
        if number >= len(_KINDS) or file.tell() + described + arrays > size:
            return
        what, content = file.read(described), file.read(arrays)
        if _checksum(number, what, content) != check:
            return
        try:
            understood = json.loads(what)
        except (ValueError, RecursionError):
            return
        yield _KINDS[number], understood, content, file.tell()


def _checksum(number: int, described: bytes, content: bytes) -> int:
    return zlib.crc32(content, zlib.crc32(described, number + len(described)))


def _spec_of(what: Mapping[str, Any]) -> TableSpec:
    columns = [Column(**{**c, "categories": tuple(c["categories"])}) for c in what["columns"]]
    return TableSpec(what["name"], tuple(columns), what["description"])


def _chunk_of(spec: TableSpec, what: Mapping[str, Any], content: bytes) -> Chunk:
    chunk, at, rows = {}, 0, int(what["rows"])
    if not 0 <= rows <= _MOST_ROWS:
        raise ValueError(f"{rows} rows at once")
    for column, parts in zip(spec.columns, what["columns"], strict=True):
        kept: list[Encoded | None] = []
        for part in parts:
            if part is None:
                kept.append(None)
                continue
            how, runs, size = part
            kept.append((how, runs, [content[at : at + size]]))
            at += size
        chunk[column.name] = _column_of(column, kept, rows)
    return chunk


def _column_of(column: Column, kept: list[Encoded | None], rows: int) -> ColumnChunk:
    values, valid, lengths = kept
    assert values is not None
    flags = None if valid is None else decode(valid, np.dtype(np.bool_), rows)
    if lengths is None:
        return ColumnChunk(decode(values, DTYPES[column.kind], rows), flags)
    sizes = decode(lengths, np.dtype(np.int64), rows)
    if values[0] != RAW:
        raise ValueError(f"text is kept as {values[0]!r}")
    text = decode(values, np.dtype(np.uint8), int(sizes.sum()))
    return ColumnChunk(text, flags, sizes)
