"""Columns as arrays, without pandas."""

import numpy as np
import pyarrow as pa
import pytest

from fleet2d.artifacts.arrow import values_of

FLAGS = [True, False, False, True, True, False, True, True, True, False, True]
COLUMNS = {
    "int64": pa.array(range(11)),
    "int32": pa.array(range(11), pa.int32()),
    "float64": pa.array([k / 3 for k in range(11)]),
    "bool": pa.array(FLAGS),
    "time": pa.array(range(11), pa.timestamp("us")),
    "names": pa.array([*"abcabcabcab"]).dictionary_encode(),
}


@pytest.mark.parametrize("kind", COLUMNS)
@pytest.mark.parametrize(("first", "second"), [(0, 0), (3, 5), (9, 1), (0, 11)])
def test_values_of_chunks_equal_those_of_pyarrow(kind, first, second):
    array = COLUMNS[kind]
    column = pa.chunked_array([array.slice(first), array.slice(0, second)], array.type)

    values = values_of(column)

    expected = column.to_numpy()
    assert values.tolist() == (expected.astype(np.int64) if kind == "time" else expected).tolist()


def test_names_of_chunks_with_other_dictionaries_are_told_apart():
    chunks = [pa.array(names).dictionary_encode() for names in (["ana", "ben"], ["ben", "ana"])]

    assert values_of(pa.chunked_array(chunks)).tolist() == ["ana", "ben", "ben", "ana"]


def test_missing_value_is_an_error():
    with pytest.raises(ValueError, match="a value is missing"):
        values_of(pa.chunked_array([pa.array([1, None])]))
