"""Journals: files that are only appended to, and whose complete frames survive any crash.

A frame has a kind, a description in JSON, any bytes, and a checksum of all three. Readers stop at
the first frame that a crash cut off or that was damaged.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from fleet2d.errors import ArtifactError
from fleet2d.storage import files

# Kind, bytes of the description, bytes of the content, checksum of all three and of both sizes.
_HEADER = struct.Struct("<BIQI")
# Frames that are buffered until they are written, unless a commit comes before [bytes].
_BUFFER_BYTES = 1 << 22


@dataclass(frozen=True)
class JournalFormat:
    """What distinguishes the journals of one purpose.

    Attributes:
        magic: The first bytes of the file, which name the format and its version.
        kinds: The kinds of its frames.
    """

    magic: bytes
    kinds: tuple[str, ...]


class Frame(NamedTuple):
    """A frame of a journal.

    Attributes:
        kind: One of the format's kinds.
        description: Plain JSON data.
        content: Any bytes.
        start: Its position in the file [bytes].
        end: Position of the next frame [bytes].
    """

    kind: str
    description: Any
    content: bytes
    start: int
    end: int


class FrameWriter:
    """Appends frames to a journal.

    Attributes:
        path: The file.
        end: Position where the last commit ends [bytes].

    Example:
        >>> import tempfile
        >>> notes = JournalFormat(b"notes 1", ("note",))
        >>> writer = FrameWriter(Path(tempfile.mkdtemp(), "journal"), notes)
        >>> writer.add("note", '{"by": "ana"}')
        >>> writer.commit()
        >>> [frame.description for frame in read_frames(writer.path, notes)]
        [{'by': 'ana'}]
        >>> writer.close()
    """

    def __init__(self, path: Path, form: JournalFormat, start: int = 0) -> None:
        """Create the file, or continue it after a commit.

        Args:
            path: The file; if it is in somebody else's folder, from `path_in`.
            form: The format.
            start: Where the commit ends [bytes], and the file is cut off; 0: create the file, in
                place of one that is there.

        Raises:
            OSError: The file can't be written.
        """
        self.path, self.end = path, start
        self._kinds = form.kinds
        self._buffer: list[bytes] = []
        self._size = 0  # bytes in the buffer
        self._written = start
        if start:
            self._handle = os.open(path, os.O_WRONLY)
        else:
            path.unlink(missing_ok=True)
            self._handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        try:
            if start:
                os.ftruncate(self._handle, start)
                os.lseek(self._handle, 0, os.SEEK_END)
            else:
                files.write_all(self._handle, form.magic)
                self.end = self._written = len(form.magic)
        except OSError:
            os.close(self._handle)
            raise

    def add(self, kind: str, description: str, content: bytes = b"") -> None:
        """Append a frame; it is certain to be in the file after the next commit.

        Args:
            kind: One of the format's kinds.
            description: JSON.
            content: Any bytes.

        Raises:
            OSError: The frames so far can't be written.
        """
        text, number = description.encode(), self._kinds.index(kind)
        header = _HEADER.pack(number, len(text), len(content), _checksum(number, text, content))
        self._buffer += [header, text, content]
        self._size += len(text) + len(content)
        if self._size > _BUFFER_BYTES:
            self._write()

    def commit(self) -> None:
        """Write all frames so far: they survive the end of the process.

        Raises:
            OSError: They can't be written; see `undo`.
        """
        self._write()
        self.end = self._written

    def undo(self) -> None:
        """Remove all frames since the last commit, as after a failed write."""
        self._buffer, self._size, self._written = [], 0, self.end
        with suppress(OSError):  # readers ignore what is cut off
            os.ftruncate(self._handle, self.end)
            os.lseek(self._handle, self.end, os.SEEK_SET)

    def sync(self) -> None:
        """Flush the journal to the disk, so that it survives a power cut, too.

        Raises:
            OSError: The disk failed.
        """
        files.sync(self._handle)

    def close(self, *, undo: bool = False) -> None:
        """Close the file; with `undo`, remove what was written since the last commit."""
        if self._handle < 0:
            return
        if undo:
            self.undo()
        handle, self._handle = self._handle, -1
        with suppress(OSError):  # what has to be on the disk was synced before
            os.close(handle)

    def _write(self) -> None:
        content = b"".join(self._buffer)
        self._buffer, self._size = [], 0
        files.write_all(self._handle, content)
        self._written += len(content)


def read_frames(path: Path, form: JournalFormat, start: int = 0) -> Iterator[Frame]:
    """Yield the complete frames of a journal; another process may be appending to it.

    Args:
        path: The file; nothing is yielded if there is none, or if it has another format.
        form: The format.
        start: The position of the first frame to yield [bytes]; 0: that of the first frame.

    Raises:
        ArtifactError: The file can't be read.
    """
    try:
        with path.open("rb") as file:
            if file.read(len(form.magic)) != form.magic:
                return
            file.seek(start or len(form.magic))
            yield from _complete_frames(file, form.kinds)
    except FileNotFoundError:
        return
    except OSError as error:
        raise ArtifactError(f"{path} can't be read: {error.strerror or error}") from error


def _complete_frames(file: BinaryIO, kinds: tuple[str, ...]) -> Iterator[Frame]:
    size, start = os.fstat(file.fileno()).st_size, file.tell()
    while len(header := file.read(_HEADER.size)) == _HEADER.size:
        number, text_bytes, content_bytes, checksum = _HEADER.unpack(header)
        end = start + _HEADER.size + text_bytes + content_bytes
        # Before anything is read: a damaged size must not request all memory.
        if number >= len(kinds) or end > size:
            return
        text, content = file.read(text_bytes), file.read(content_bytes)
        if _checksum(number, text, content) != checksum:
            return
        try:
            description = json.loads(text)
        except (ValueError, RecursionError):
            return
        yield Frame(kinds[number], description, content, start, end)
        start = end


def _checksum(number: int, text: bytes, content: bytes) -> int:
    return zlib.crc32(content, zlib.crc32(text, number + len(text)))
