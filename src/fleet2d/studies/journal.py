"""The journal of a study: each finished variant is appended at once, and survives whatever comes.

A frame is a mark, a length, a checksum and a record. What a crash cut off is recognized by its
checksum and dropped; everything before it counts.
"""

import os
import struct
import time
import zlib
from collections.abc import Iterator
from pathlib import Path

from fleet2d.studies.record import Record
from fleet2d.studies.storage import write_error

_FRAME = struct.Struct("<4sQI")
_MARK = b"F2DV"
SYNC_EVERY_S = 2.0  # what a power cut may take; a killed process loses nothing


class Journal:
    """A file of records that only grows.

    Attributes:
        path: The file.
        offsets: Where the frame of each record begins, by number of variant; the newest counts.
        size: Bytes of whole frames.
    """

    def __init__(self, path: Path) -> None:
        """Open a journal for appending, and cut off what a crash left unfinished.

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
        self._synced = time.monotonic()

    def __len__(self) -> int:
        """Return the number of variants in it."""
        return len(self.offsets)

    def append(self, record: Record) -> None:
        """Add a record; when this returns, a killed process loses it no more.

        Raises:
            ArtifactError: The disk is full, or the file can't be written; nothing is added then.
        """
        data = record.encode()
        frame = _FRAME.pack(_MARK, len(data), zlib.crc32(data)) + data
        try:
            written = 0
            while written < len(frame):
                written += os.pwrite(self._file, frame[written:], self.size + written)
            if time.monotonic() - self._synced > SYNC_EVERY_S:
                os.fsync(self._file)
                self._synced = time.monotonic()
        except OSError as error:
            os.ftruncate(self._file, self.size)
            raise write_error(self.path.parent, error) from error
        self.offsets[record.number] = self.size
        self.size += len(frame)

    def read(self, number: int) -> Record:
        """Return the newest record of a variant."""
        offset = self.offsets[number]
        _, length, _ = _FRAME.unpack(os.pread(self._file, _FRAME.size, offset))
        return Record.decode(os.pread(self._file, length, offset + _FRAME.size))

    def close(self) -> None:
        """See everything onto the disk, and let go of the file."""
        os.fsync(self._file)
        os.close(self._file)


def read_journal(path: Path) -> Iterator[Record]:
    """Yield the whole records of a journal that another process may be writing."""
    try:
        file = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return
    try:
        for _, _, record in _frames(file):
            yield record
    finally:
        os.close(file)


def _frames(file: int) -> Iterator[tuple[int, int, Record]]:
    """Yield (begin, end, record) of each whole frame, up to the first that is not."""
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
        yield offset, end, Record.decode(data)
        offset = end
