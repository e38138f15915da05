"""Columns and tables are refused when they could not be stored."""

import pytest

from fleet2d.artifacts.arrow import schema_of, spec_of
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.errors import ArtifactError

from .tables import EVERY_KIND


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("", "int32"), "no name"),
        (("x", "float32"), "unknown kind 'float32'"),
    ],
)
def test_column_without_name_or_of_unknown_kind_is_refused(
    arguments: tuple[str, str], message: str
) -> None:
    with pytest.raises(ArtifactError, match=message):
        Column(*arguments)  # type: ignore[arg-type]


def test_column_refuses_categories_of_another_kind() -> None:
    with pytest.raises(ArtifactError, match="kind must be category"):
        Column("x", "int32", categories=("a",))


def test_column_refuses_a_category_named_twice() -> None:
    with pytest.raises(ArtifactError, match="twice"):
        Column("x", "category", categories=("a", "a"))


@pytest.mark.parametrize("name", ["", "../up", "a/b", ".hidden"])
def test_table_refuses_a_name_that_is_no_file_name(name: str) -> None:
    with pytest.raises(ArtifactError, match="can't be named"):
        TableSpec(name, (Column("step", "step"),))


@pytest.mark.parametrize("columns", [(), (Column("a", "int32"), Column("a", "bool"))])
def test_table_refuses_no_columns_and_double_ones(columns: tuple[Column, ...]) -> None:
    with pytest.raises(ArtifactError, match=r"no columns|twice"):
        TableSpec("t", columns)


def test_schema_carries_the_whole_spec() -> None:
    schema = schema_of(EVERY_KIND)

    assert spec_of(schema) == EVERY_KIND
    assert schema.field("x").metadata[b"unit"] == b"m"
    assert schema.field("step").metadata[b"description"] == b"index of the step"
