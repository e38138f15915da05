"""Reading arrays back: bytes that encode nothing are refused, and request no memory."""

import numpy as np
import pytest

from fleet2d.artifacts.unfinished import GROWTH, HEADER, LINE, NARROW, RAW, RUNS, ArrayReader

INT64 = np.dtype(np.int64)


def frame(encoding: int, count: int, content: bytes) -> bytes:
    return HEADER.pack(encoding, count, len(content)) + content


def test_few_bytes_can_not_ask_for_all_memory() -> None:
    content = frame(RUNS, 1, bytes(8) + b"\xff" * 4)
    with pytest.raises(ValueError, match="don't make"):
        ArrayReader(content).read(INT64, 1000)


@pytest.mark.parametrize("encoding", [NARROW, GROWTH, RUNS, LINE])
def test_text_is_never_repeated(encoding: int) -> None:
    """The length of a text isn't bounded as that of other columns is: it must be there."""
    with pytest.raises(ValueError, match="text has encoding"):
        ArrayReader(frame(encoding, 1, b"a" + bytes(7) + b"\1")).read(np.dtype(np.uint8), 2**56)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        HEADER.pack(RAW, 0, 16) + bytes(8),  # cut off
        HEADER.pack(RAW, 0, 2**63) + bytes(8),
        frame(RAW, 0, bytes(7)),
        frame(RAW, 0, bytes(16)),
        frame(NARROW, 3, bytes(9)),
        frame(NARROW, 1, bytes(2)),
        frame(GROWTH, 0, b""),
        frame(GROWTH, 0, bytes(8) + b"\1"),
        frame(GROWTH, 0, bytes(8) + b"\1\xff" + bytes(7)),
        frame(GROWTH, 0, bytes(8) + b"\1\2" + bytes(8)),
        frame(RUNS, 0, b""),
        frame(RUNS, 2, bytes(18)),
        frame(RUNS, 2**32 - 1, bytes(9)),
        frame(LINE, 0, bytes(8)),
        frame(LINE, 0, bytes(16)),  # there is no array before it
        frame(9, 0, bytes(24)),
    ],
)
def test_what_encodes_nothing_is_refused(content: bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - some messages are numpy's
        ArrayReader(content).read(INT64, 3)


def test_flags_are_true_or_false() -> None:
    with pytest.raises(ValueError, match="neither"):
        ArrayReader(frame(RAW, 0, b"\1\0\2")).read(np.dtype(np.bool_), 3)
