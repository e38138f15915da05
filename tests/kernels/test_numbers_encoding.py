"""Arrays as bytes: equal to those of the slow twin, and read back to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.reference import encoding as slow

from fleet2d.artifacts.unfinished import GROWTH, HEADER, LINE, NARROW, RAW, RUNS, ArrayReader
from fleet2d.kernels import encode_arrays

RNG = np.random.default_rng(0)
INT64 = [-(2**63), -1, 0, 1, 254, 255, 256, 2**16, 2**32, 2**63 - 1]
STEPS = RNG.integers(0, 5, 1000).cumsum()


def read_back(arrays):
    reader = ArrayReader(encode_arrays(arrays))
    return [reader.read(values.dtype, len(values)) for values in arrays]


def is_same(one, other):
    return one.dtype == other.dtype and one.tobytes() == other.tobytes()


@st.composite
def columns(draw):
    """Arrays of any type and of any behaviour: few values, many, rising, at the limits."""
    arrays = []
    for _ in range(draw(st.integers(0, 4))):
        count = draw(st.sampled_from([0, 1, 2, 3, 7, 63, 64, 65, 66, 129, 300]))
        rng = np.random.default_rng(draw(st.integers(0, 2**32)))
        kind = draw(st.sampled_from(["bool", "text", "int32", "int64", "steps", "line", "float64"]))
        most = draw(st.sampled_from([0, 1, 2, 254, 255, 256, 2**16, 2**31 - 1]))
        repeat = draw(st.sampled_from([1, 3, 40]))
        numbers = np.repeat(rng.integers(-(most // 8), most, count, endpoint=True), repeat)[:count]
        if kind == "int64":
            numbers = np.where(rng.random(count) < 0.1, rng.choice(INT64, count), numbers)
        if kind == "steps":
            numbers = np.abs(numbers).cumsum()
        if kind == "line" and arrays and arrays[-1].dtype == np.int64:
            numbers = arrays[-1] * int(rng.choice(INT64)) + int(rng.choice(INT64[1:-1]))
        if kind == "float64":
            numbers = np.where(numbers % 5 == 0, rng.choice([np.nan, -0.0, 0.0]), numbers / 7)
        types = {"bool": bool, "text": np.uint8, "int32": np.int32, "float64": np.float64}
        arrays.append(numbers.astype(types.get(kind, np.int64)))
    return arrays


@given(columns())
def test_bytes_are_those_of_the_twin_and_read_back(arrays):
    assert slow.encode_arrays(arrays) == encode_arrays(arrays)
    for values, back in zip(arrays, read_back(arrays), strict=True):
        assert is_same(values, back)


@pytest.mark.parametrize(
    ("times", "steps"),
    [
        (np.r_[STEPS[:-1] * 7, STEPS[-1] * 7 + 1], STEPS),
        (np.r_[STEPS[:500] * 7, STEPS[500] * 7 + 1, STEPS[501:] * 7], STEPS),
        (STEPS[:2] * 7, STEPS[:2]),  # two are always on a line
        (STEPS, np.zeros(1000, np.int64)),
        (STEPS[:-1], STEPS),
        (STEPS * 7, STEPS[::-1].copy()),
        (np.r_[-(2**63), np.arange(998), 2**63 - 1], np.r_[np.zeros(999, np.int64), 1]),
    ],
)
def test_times_that_are_no_multiples_of_steps_are_no_line(times, steps):
    content, alone = encode_arrays([steps, times]), encode_arrays([steps])
    assert content[len(alone)] != LINE
    assert slow.encode_arrays([steps, times]) == content
    assert all(map(is_same, [steps, times], read_back([steps, times])))


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros(3, np.float32),
        np.zeros(3, np.int16),
        np.zeros((2, 3)),
        np.zeros(3).astype(">f8"),
        [1, 2],
        None,
    ],
)
def test_what_no_column_holds_is_refused(wrong):
    with pytest.raises(TypeError, match="incompatible function arguments"):
        encode_arrays([np.zeros(3), wrong])


@pytest.mark.parametrize(
    ("values", "encoding"),
    [
        (np.repeat([1.0, np.nan, -0.0], 400), RUNS),
        (np.full(1000, -1), RUNS),
        (np.r_[np.arange(500), np.arange(9000, 9500)], GROWTH),
        (np.arange(1000) * 300, NARROW),
        (np.arange(1000, dtype=np.int32) % 3, NARROW),
        (np.arange(1000, dtype=np.int32) % 3 - 1, RAW),
        (np.arange(1000) * 2**40, RAW),
    ],
)
def test_each_encoding_is_used_where_it_is_short(values, encoding):
    assert encoding == encode_arrays([values])[0]


@pytest.mark.parametrize("times", [STEPS * 1_000_000 + 5, STEPS * -3])
def test_times_that_are_multiples_of_steps_are_a_line(times):
    content, alone = encode_arrays([STEPS, times]), encode_arrays([STEPS])
    assert content[len(alone)] == LINE
    assert len(alone) + HEADER.size + 16 == len(content)
