"""The journal of a study: each finished variant is appended at once, and survives crashes.

A frame is a mark, a length, a checksum and a record. A frame that a crash cut off has a wrong
checksum and is dropped; all frames before it count.
"""

import os
import struct
import time
import zlib
from collections.abc import Iterator
from pathlib import Path

from fleet2d.studies.data.record import VariantRecord
from fleet2d.studies.data.storage import write_error

_FRAME = struct.Struct("<4sQI")
_MARK = b"F2DV"
SYNC_EVERY_S = 2.0  # the most that a power cut loses; a killed process loses nothing


class Journal:
    """A file of records that only grows.

    Attributes:
        path: The file.
        offsets: The offset of the newest frame of each variant, by its number [bytes].
        size: The size of all complete frames [bytes].
    """

    def __init__(self, path: Path) -> None:
        """Open a journal for appending, and cut off an incomplete frame at its end.

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
        self._sync_time = time.monotonic()

    def __len__(self) -> int:
        """Return the number of variants in it."""
        return len(self.offsets)

    def append(self, record: VariantRecord) -> None:
        """Add a record; after that it survives a kill of the process.

        Raises:
            ArtifactError: The disk is full, or the file can't be written; nothing is added.
        """
        data = record.encode()
        frame = _FRAME.pack(_MARK, len(data), zlib.crc32(data)) + data
        try:
            count = 0
            while count < len(frame):
                count += os.pwrite(self._file, frame[count:], self.size + count)
            if time.monotonic() - self._sync_time > SYNC_EVERY_S:
                os.fsync(self._file)
                self._sync_time = time.monotonic()
        except OSError as error:
            os.ftruncate(self._file, self.size)
            raise write_error(self.path.parent, error) from error
        self.offsets[record.number] = self.size
        self.size += len(frame)

    def read(self, number: int) -> VariantRecord:
        """Return the newest record of a variant."""
        offset = self.offsets[number]
        _, length, _ = _FRAME.unpack(os.pread(self._file, _FRAME.size, offset))
        return VariantRecord.decode(os.pread(self._file, length, offset + _FRAME.size))

    def close(self) -> None:
        """Flush everything to the disk, and close the file."""
        os.fsync(self._file)
        os.close(self._file)


def read_journal(path: Path) -> Iterator[VariantRecord]:
    """Yield the complete records of a journal; another process may be writing it."""
    try:
        file = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        return
    try:
        for _, _, record in _frames(file):
            yield record
    finally:
        os.close(file)


def _frames(file: int) -> Iterator[tuple[int, int, VariantRecord]]:
    """Yield (start, end, record) of each complete frame, up to the first incomplete one [bytes]."""
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
        yield offset, end, VariantRecord.decode(data)
        offset = end
