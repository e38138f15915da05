"""Arrays as bytes for the journal: repeated values and constant steps take next to no room."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

RAW, RUNS, RAMPS = "raw", "runs", "ramps"

Encoded = tuple[str, int, list[bytes]]
"""How the values are kept, how many runs there are, and the bytes."""

# Fewer values than this aren't worth looking at.
_FEW = 256
_BITS = {1: np.uint8, 2: np.uint16, 4: np.uint32, 8: np.uint64}


def encode(values: NDArray[Any], *, ramps: bool = False) -> Encoded:
    """Return values as bytes.

    Args:
        values: Of any plain type, (n,).
        ramps: Whether they are likely to grow by the same amount for long, as times do.

    Example:
        >>> kept = encode(np.full(1000, 7))
        >>> kept[:2], sum(map(len, kept[2])), decode(kept, np.dtype(np.int64), 1000).sum()
        (('runs', 1), 12, np.int64(7000))
    """
    if len(values) >= _FEW and values.dtype != np.uint8:  # text
        looked_at = values[1:] - values[:-1] if ramps else values
        bits = looked_at.view(_BITS[values.itemsize])
        changes = (bits[1:] != bits[:-1]).nonzero()[0]
        if 4 * len(changes) < len(values):
            starts = np.empty(len(changes) + 2, np.int64)
            starts[0], starts[1:-1], starts[-1] = 0, changes + 1, len(looked_at)
            lengths, starts = (starts[1:] - starts[:-1]).astype(np.uint32), starts[:-1]
            first = [_bytes(values[:1])] if ramps else []
            parts = [*first, _bytes(looked_at[starts]), _bytes(lengths)]
            return (RAMPS if ramps else RUNS), len(starts), parts
    return RAW, len(values), [_bytes(values)]


def decode(kept: Encoded, dtype: np.dtype[Any], rows: int) -> NDArray[Any]:
    """Return the values that `encode` was given.

    Args:
        kept: What `encode` returned.
        dtype: The type of the values.
        rows: How many there should be.

    Raises:
        ValueError: The bytes are not those of so many values.
    """
    how, runs, parts = kept
    content = b"".join(parts)
    stored = dtype.newbyteorder("<")
    if how == RAW:
        values = np.frombuffer(content, stored)
    elif how in (RUNS, RAMPS):
        head = dtype.itemsize * (how == RAMPS)
        middle = head + runs * dtype.itemsize
        lengths = np.frombuffer(content[middle:], "<u4")
        # Before anything is repeated: a few bytes must not ask for all memory.
        if len(lengths) != runs or int(lengths.sum(dtype=np.int64)) != rows - (how == RAMPS):
            raise ValueError(f"{runs} runs don't make {rows} values")
        values = np.repeat(np.frombuffer(content[head:middle], stored), lengths)
        if how == RAMPS:
            values = np.cumsum(np.concatenate([np.frombuffer(content[:head], stored), values]))
    else:
        raise ValueError(f"{how!r} is no way to keep values")
    if len(values) != rows:
        raise ValueError(f"{len(values)} values where {rows} are wanted")
    return values.astype(dtype)


def _bytes(values: NDArray[Any]) -> bytes:
    if sys.byteorder == "big":
        values = values.byteswap()
    return values.tobytes()
