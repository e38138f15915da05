"""Tables of a data set from anybody: other columns, and values that no data set has, are refused."""

from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fleet2d.errors import InputError
from fleet2d.learning.datasets import reader
from fleet2d.learning.datasets.reader import LARGEST, NULLABLE
from fleet2d.learning.datasets.tables import SCHEMAS

VALUES = {"string": "x", "timestamp[us]": datetime(2026, 1, 5), "list<item: string>": ["x"]}
"""Values of the types that are no numbers."""


def written(path: Path, name, **changes) -> Path:
    row = {field.name: VALUES.get(str(field.type), 1) for field in SCHEMAS[name]} | changes
    table = pa.Table.from_pylist([row], SCHEMAS[name])
    pq.write_table(table, path)
    return path


@pytest.mark.parametrize("name", SCHEMAS)
def test_a_table_of_other_columns_is_refused(tmp_path, name):
    path = written(tmp_path / "table.parquet", name)
    other = pq.read_table(path).append_column("more", pa.array([1]))
    pq.write_table(other, path)
    with pytest.raises(InputError, match="its columns aren't"):
        reader._read(path, name)


def wrong_values() -> Iterator[tuple[str, str, float | None]]:
    """Yield a table, a column, and a value that the column's type has."""
    for name, schema in SCHEMAS.items():
        for field in schema:
            if field.name not in NULLABLE:
                yield name, field.name, None
            if pa.types.is_signed_integer(field.type):
                yield name, field.name, -1
            if pa.types.is_floating(field.type):
                yield name, field.name, float("inf")
                yield name, field.name, -2 * LARGEST


@pytest.mark.parametrize(("name", "column", "value"), list(wrong_values()))
def test_a_value_that_no_data_set_has_is_refused(tmp_path, name, column, value):
    path = written(tmp_path / "table.parquet", name, **{column: value})
    with pytest.raises(InputError, match=column):
        reader._read(path, name)
