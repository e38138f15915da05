"""Columns and tables are refused when they could not be stored."""

from copy import deepcopy

import numpy as np
import pytest

from fleet2d.artifacts.arrow import schema_of, spec_of
from fleet2d.artifacts.table import Column, Repeated, TableBuffer, TableSpec
from fleet2d.errors import ArtifactError

from .tables import EVERY_KIND, rows_of_every_kind


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("", "int32"), "no name"),
        (("x", "float32"), "unknown kind 'float32'"),
    ],
)
def test_column_without_name_or_of_unknown_kind_is_refused(arguments, message):
    with pytest.raises(ArtifactError, match=message):
        Column(*arguments)


def test_column_refuses_categories_of_another_kind():
    with pytest.raises(ArtifactError, match="kind must be category"):
        Column("x", "int32", categories=("a",))


def test_column_refuses_a_category_named_twice():
    with pytest.raises(ArtifactError, match="twice"):
        Column("x", "category", categories=("a", "a"))


@pytest.mark.parametrize("name", ["", "../up", "a/b", ".hidden"])
def test_table_refuses_a_name_that_is_no_file_name(name):
    with pytest.raises(ArtifactError, match="can't be named"):
        TableSpec(name, (Column("step", "step"),))


@pytest.mark.parametrize("columns", [(), (Column("a", "int32"), Column("a", "bool"))])
def test_table_refuses_no_columns_and_double_ones(columns):
    with pytest.raises(ArtifactError, match=r"no columns|twice"):
        TableSpec("t", columns)


def test_schema_carries_the_whole_spec():
    schema = schema_of(EVERY_KIND)

    assert spec_of(schema) == EVERY_KIND
    assert schema.field("x").metadata[b"unit"] == b"m"
    assert schema.field("step").metadata[b"description"] == b"index of the step"


POSES = TableSpec("poses", (Column("step", "step"), Column("x", "float64")))


def of(*columns: Column) -> TableBuffer:
    return TableBuffer(TableSpec("t", columns))


def append(buffer: TableBuffer, **columns):
    buffer.fill(buffer.check(columns), 0)


def test_append_copies_its_arguments():
    buffer = TableBuffer(POSES)
    step = np.arange(3)

    append(buffer, step=step, x=np.zeros(3))
    step[:] = 9

    assert [0, 1, 2] == buffer.take()["step"].values.tolist()


def test_append_repeats_scalars():
    buffer = TableBuffer(POSES)

    append(buffer, step=np.arange(3), x=0.5)
    append(buffer, step=7, x=1.5)

    assert [0.5, 0.5, 0.5, 1.5] == buffer.take()["x"].values.tolist()


@pytest.mark.parametrize(
    ("column", "values"),
    [
        (Column("c", "float64", nullable=True), np.array([0.5, np.nan, 3])),
        (Column("c", "float64"), np.array([1, 2, 3], np.int32)),
        (Column("c", "float64"), np.array([0.5, 2.5, 3])),
        (Column("c", "category", categories=("a", "b"), nullable=True), np.array([-1, 1, 0])),
        (Column("c", "bool"), np.array([True, False, True])),
    ],
)
def test_repeated_values_are_stored_as_each_row_has_them(column, values):
    index = np.array([0, 0, 2, 1, 1, 1, 2])
    once, each = (TableBuffer(TableSpec("t", (column,)), limit=4) for _ in range(2))
    batches = once.check({"c": Repeated(values, index)}), each.check({"c": values[index]})

    for start in (0, 4):
        for buffer, batch in zip((once, each), batches, strict=True):
            buffer.fill(batch, start)
        for some, others in zip(once.take()["c"], each.take()["c"], strict=True):
            assert np.array_equal(some, others)


def test_append_of_all_scalars_to_strings_adds_one_row():
    buffer = of(Column("a", "string", nullable=True), Column("b", "category"))

    append(buffer, a=None, b="on")

    chunk = buffer.take()
    assert [0] == chunk["b"].values.tolist()
    assert [False] == chunk["a"].valid.tolist()


def test_fill_stops_at_the_limit_and_says_where():
    buffer = TableBuffer(POSES, limit=4)
    batch = buffer.check({"step": np.arange(6), "x": np.zeros(6)})

    assert 4 == buffer.fill(batch, 0)
    assert buffer.is_full
    assert [0, 1, 2, 3] == buffer.take(reuse=True)["step"].values.tolist()
    assert 6 == buffer.fill(batch, 4)
    assert [4, 5] == buffer.take()["step"].values.tolist()


def test_deepcopy_shares_nothing():
    buffer = TableBuffer(EVERY_KIND)
    append(buffer, **rows_of_every_kind(20))
    twin = deepcopy(buffer)

    append(twin, **rows_of_every_kind(300, seed=1))
    append(buffer, **rows_of_every_kind(10, seed=2))

    assert (30, 320) == (buffer.rows, twin.rows)
    np.testing.assert_array_equal(
        rows_of_every_kind(20)["x"], twin.take()["x"].values[:20], strict=True
    )
    np.testing.assert_array_equal(
        rows_of_every_kind(10, seed=2)["x"], buffer.take()["x"].values[20:], strict=True
    )


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"step": np.arange(3)}, "lacks x"),
        ({"step": np.arange(3), "x": np.zeros(3), "z": 1}, "has no column z"),
        ({"step": np.arange(3), "x": np.zeros(2)}, "'x' has 2 values where others have 3"),
        ({"step": np.arange(3.0), "x": np.zeros(3)}, "holds float64, not integers"),
        ({"step": np.arange(3), "x": np.array(["a"] * 3)}, "not float64"),
        ({"step": np.zeros((3, 1), int), "x": np.zeros(3)}, "2 dimensions"),
        ({"step": np.arange(3), "x": np.array([0, np.nan, 0])}, "declare it nullable"),
        ({"step": np.arange(3), "x": Repeated(np.array([np.nan]), np.zeros(3, int))}, "nullable"),
        ({"step": np.arange(3), "x": Repeated(np.zeros(1), np.zeros(2, int))}, "has 2 values"),
    ],
)
def test_append_refuses_columns_that_do_not_fit(columns, message):
    buffer = TableBuffer(POSES)

    with pytest.raises(ArtifactError, match=message):
        append(buffer, **columns)
    assert 0 == buffer.rows


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        (Column("c", "int32"), [2**31], "beyond int32"),
        (Column("c", "int64"), np.array([2**63], np.uint64), "beyond int64"),
        (Column("c", "bool"), [0, 1], "not bool"),
        (Column("c", "category", categories=("a",)), [1], "1 categories"),
        (Column("c", "category", categories=("a",)), [-1], "1 categories"),
        (Column("c", "category", categories=("a",), nullable=True), [-2], "1 categories"),
        (Column("c", "category", categories=("a",)), ["a"], "not integers"),
        (Column("c", "category"), [1], "holds int, not strings"),
        (Column("c", "category"), ["a", None], "declare it nullable"),
        (Column("c", "string"), [None], "declare it nullable"),
        (Column("c", "time"), np.array(["NaT"], "M8[us]"), "declare it nullable"),
        (Column("c", "int64"), np.ma.masked_array([1, 2], [True, False]), "declare it nullable"),
    ],
)
def test_append_refuses_values_that_do_not_fit(column, values, message):
    with pytest.raises(ArtifactError, match=f"table 't', column 'c': .*{message}"):
        append(of(column), c=values)


@pytest.mark.parametrize(
    ("kind", "parts", "stored"),
    [
        ("time", [np.array(["1970-01-01T00:00:01"], "M8[s]"), [2_000_000]], [1_000_000, 2_000_000]),
        ("int32", [np.array([2**31 - 1]), np.array([200], np.uint8)], [2**31 - 1, 200]),
    ],
)
def test_values_of_other_types_are_stored_where_they_fit(kind, parts, stored):
    buffer = of(Column("c", kind))
    for part in parts:
        append(buffer, c=part)
    assert stored == buffer.take()["c"].values.tolist()
