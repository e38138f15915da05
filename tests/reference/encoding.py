"""Arrays as bytes, value by value, in slow and obvious Python."""

from itertools import groupby, pairwise

import numpy as np

from fleet2d.artifacts.unfinished import GROWTH, HEADER, LINE, NARROW, RAW, RUNS

WHOLE = 2**64


def encode_arrays(arrays):
    """Return what the core should return for arrays."""
    content, previous = b"", None
    for values in arrays:
        content += _encode(values, previous)
        if values.dtype == np.int64:
            previous = values
    return content


def _encode(values, previous):
    raw, runs, narrow = _raw(values), _runs(values), _narrow(values)
    if values.dtype == np.uint8:
        return raw
    if values.dtype == np.int64:
        line, growth = _line(values, previous), _growth(values)
        if line is not None:
            return line
        if _length(runs) < len(values):
            return runs
        if growth is not None and _length(growth) < 2 * len(values):
            return growth
    if len(values) == 0:
        return raw
    return min(raw, narrow, runs, key=len)  # of equally short ones the first


def _length(encoded):
    return len(encoded) - HEADER.size


def _raw(values):
    return _with_header(RAW, 0, values.tobytes())


def _narrow(values):
    """Whole numbers in as few bytes as the greatest takes; -1 is the greatest of all."""
    if values.dtype not in (np.int32, np.int64):
        return _raw(values)
    numbers = [int(value) % (1 << 8 * values.itemsize) for value in values]
    width = _width(max(numbers, default=0))
    if width == values.itemsize:
        return _raw(values)
    return _with_header(NARROW, width, b"".join(_bytes(number, width) for number in numbers))


def _runs(values):
    parts = [value.tobytes() for value in values]
    groups = [(value, len(list(group))) for value, group in groupby(parts)]
    width = _width(max((length for _, length in groups), default=0))
    content = b"".join(value for value, _ in groups)
    content += b"".join(_bytes(length, width) for _, length in groups)
    return _with_header(RUNS, len(groups), content)


def _growth(values):
    if len(values) == 0:
        return None
    growth = [(int(b) - int(a)) % WHOLE for a, b in pairwise(values)]
    content = values[:1].tobytes() + bytes(min(number, 255) for number in growth)
    content += b"".join(_bytes(number, 8) for number in growth if number >= 255)
    return _with_header(GROWTH, 0, content)


def _line(values, previous):
    """The line through the first and the last value, if all are on it, modulo 2^64."""
    if previous is None or len(previous) != len(values) or len(values) < 3:
        return None
    y, x = [int(value) for value in values], [int(value) for value in previous]
    rise, run = _signed(y[-1] - y[0]), _signed(x[-1] - x[0])
    if run <= 0 or rise % run:
        return None
    slope = rise // run
    start = y[0] - slope * x[0]
    if any((start + slope * b - a) % WHOLE for a, b in zip(y, x, strict=True)):
        return None
    return _with_header(LINE, 0, _bytes(start % WHOLE, 8) + _bytes(slope % WHOLE, 8))


def _signed(number):
    """Return a number as 64 bits hold it."""
    return (number + WHOLE // 2) % WHOLE - WHOLE // 2


def _width(number):
    return next(width for width in (1, 2, 4, 8) if number < 1 << 8 * width)


def _bytes(number, width):
    return np.array(number, f"u{width}").tobytes()


def _with_header(encoding, count, content):
    return HEADER.pack(encoding, count, len(content)) + content
