"""Columns of categories, such as the entities of a table, as numbers."""

from typing import Any

import numpy as np

from fleet2d.kernels import I64


def categories(column: Any) -> tuple[I64, list[str]]:
    """Return the category of each row as a number, and the names of the categories.

    Args:
        column: A column of a pyarrow table, of text or of a dictionary of texts.

    Returns:
        int64 (rows,), -1 where the column is null; and the name that each number stands for.

    Example:
        >>> import pyarrow as pa
        >>> numbers, names = categories(pa.chunked_array([["ana", None], ["bob", "ana"]]))
        >>> numbers.tolist(), names
        ([0, -1, 1, 0], ['ana', 'bob'])
    """
    encoded = column.cast("string").combine_chunks().dictionary_encode()
    numbers = encoded.indices.fill_null(-1).to_numpy(zero_copy_only=False).astype(np.int64)
    return numbers, encoded.dictionary.to_pylist()
