"""Arrays as bytes for the journal: values that repeat or grow slowly take few bytes.

The core encodes them, see `fleet2d.kernels.encoding`. Each array has a header, which names one of
the encodings below, and its content. All is in the byte order of the machine.

Example:
    >>> from fleet2d.kernels.encoding import encode_arrays
    >>> content = encode_arrays([np.full(1000, 7)])
    >>> len(content), int(ArrayReader(content).read(np.dtype(np.int64), 1000).sum())
    (23, 7000)
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
        self._content, self._position = content, 0
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
    """Return the values of runs, each as often as its length says."""
    middle = runs * dtype.itemsize
    lengths = np.frombuffer(content[middle:], _narrow((len(content) - middle) // max(1, runs)))
    # Before anything is repeated: a few bytes must not request all memory.
    if len(lengths) != runs or int(lengths.sum(dtype=np.int64)) != rows:
        raise ValueError(f"{runs} runs don't make {rows} values")
    return np.repeat(np.frombuffer(content[:middle], dtype), lengths)


def _narrow(width: int) -> type[Any]:
    if width not in _NARROW:
        raise ValueError(f"no number is stored in {width} bytes")
    return _NARROW[width]
