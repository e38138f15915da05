"""Arrays as bytes for the journal: repeated and slowly growing values take few bytes."""

from __future__ import annotations

import struct
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

RAW, RUNS, GROWTH, STEPS = "raw", "runs", "growth", "steps"

Encoded = tuple[str, int, list[bytes]]
"""The encoding (raw, runs, growth or steps), the number of runs or bytes of a value, the bytes."""

# Fewer values than this are stored raw: it isn't worth looking for runs.
FEW = 256
_SIZES = {1: np.uint8, 2: np.uint16, 4: np.uint32}
_LINE = struct.Struct("<qq")
_BITS = {1: np.uint8, 2: np.uint16, 4: np.uint32, 8: np.uint64}


def encode(values: NDArray[Any], *, grows: bool = False) -> Encoded:
    """Return values as bytes.

    Args:
        values: Of any plain type, (n,).
        grows: Whether whole numbers are likely to grow by little, as steps do.

    Example:
        >>> encoded = encode(np.full(1000, 7))
        >>> encoded[:2], sum(map(len, encoded[2])), decode(encoded, np.dtype(np.int64), 1000).sum()
        (('runs', 1), 12, np.int64(7000))
    """
    if len(values) >= FEW and values.dtype != np.uint8:  # text
        if grows:
            return _growth(values)
        bits = values.view(_BITS[values.itemsize])
        changes = (bits[1:] != bits[:-1]).nonzero()[0]
        if 4 * len(changes) < len(values):
            starts = np.empty(len(changes) + 2, np.int64)
            starts[0], starts[1:-1], starts[-1] = 0, changes + 1, len(values)
            lengths, starts = (starts[1:] - starts[:-1]).astype(np.uint32), starts[:-1]
            return RUNS, len(starts), [_bytes(values[starts]), _bytes(lengths)]
    return RAW, len(values), [_bytes(values)]


def _growth(values: NDArray[Any]) -> Encoded:
    """Return the first value, and by how much each of the others is above the one before."""
    growth = values[1:] - values[:-1]
    least, most = growth.min(), growth.max()
    for size, kind in _SIZES.items():
        if 0 <= least and most < 1 << 8 * size:
            return GROWTH, size, [_bytes(values[:1]), _bytes(growth.astype(kind))]
    return RAW, len(values), [_bytes(values)]


def encode_times(times: NDArray[np.int64], steps: NDArray[np.int64]) -> Encoded | None:
    """Return times by the steps of the same rows; None if steps of one length don't give them.

    Example:
        >>> steps = np.arange(300) ** 2
        >>> encoded = encode_times(5 + 60 * steps, steps)
        >>> np.array_equal(decode_times(encoded, steps), 5 + 60 * steps)
        True
    """
    if len(times) < FEW or steps[-1] <= steps[0]:
        return None
    length = (int(times[-1]) - int(times[0])) // (int(steps[-1]) - int(steps[0]))
    try:
        content = _LINE.pack(length, int(times[0]) - length * int(steps[0]))
    except struct.error:  # beyond 64 bits
        return None
    encoded = STEPS, 1, [content]
    return encoded if np.array_equal(decode_times(encoded, steps), times) else None


def decode_times(encoded: Encoded, steps: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the times that `encode_times` encoded.

    Raises:
        ValueError: The bytes don't encode times.
    """
    try:
        length, first = _LINE.unpack(b"".join(encoded[2]))
    except struct.error as error:
        raise ValueError(str(error)) from None
    times = steps * np.int64(length)
    times += np.int64(first)
    return times


def decode(encoded: Encoded, dtype: np.dtype[Any], rows: int) -> NDArray[Any]:
    """Return the values that were encoded.

    Args:
        encoded: What `encode` returned.
        dtype: The type of the values.
        rows: Their number.

    Raises:
        ValueError: The bytes don't encode that many values.
    """
    encoding, runs, parts = encoded
    content = b"".join(parts)
    little_endian = dtype.newbyteorder("<")
    if encoding == RAW:
        values = np.frombuffer(content, little_endian)
    elif encoding == GROWTH:
        growth = np.frombuffer(content[dtype.itemsize :], f"<u{runs}")
        values = np.empty(len(growth) + 1, dtype)
        values[0], values[1:] = np.frombuffer(content[: dtype.itemsize], little_endian)[0], growth
        values = np.cumsum(values)
    elif encoding == RUNS:
        middle = runs * dtype.itemsize
        lengths = np.frombuffer(content[middle:], "<u4")
        # Before anything is repeated: a few bytes must not request all memory.
        if len(lengths) != runs or int(lengths.sum(dtype=np.int64)) != rows:
            raise ValueError(f"{runs} runs don't make {rows} values")
        values = np.repeat(np.frombuffer(content[:middle], little_endian), lengths)
    else:
        raise ValueError(f"unknown encoding {encoding!r}")
    if len(values) != rows:
        raise ValueError(f"expected {rows} values, decoded {len(values)}")
    return values.astype(dtype)


def _bytes(values: NDArray[Any]) -> bytes:
    if sys.byteorder == "big":
        values = values.byteswap()
    return values.tobytes()
