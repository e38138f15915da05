"""A digest tells content apart, and nothing else."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.thorough import examples

from fleet2d.artifacts.digest import digest_table, run_digest
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.runs.run import open_run

from .tables import EVERY_KIND, part, rows_of_every_kind, stored

ROWS = rows_of_every_kind(500)


def digest(rows: dict[str, Any], **options: Any) -> str | None:
    return stored(rows, **options).manifest.digest


@settings(max_examples=examples(25))
@given(pieces=st.integers(1, 60), flush_rows=st.integers(1, 700))
def test_digest_independent_of_chunking(pieces: int, flush_rows: int) -> None:
    assert digest(ROWS) == digest(ROWS, pieces=pieces, flush_rows=flush_rows)


@pytest.mark.parametrize("flush_rows", [7, 100, 2**17])
def test_digest_of_file_equals_that_in_memory(tmp_path: Path, flush_rows: int) -> None:
    store = stored(ROWS, directory=tmp_path / "run", flush_rows=flush_rows)
    table = open_run(tmp_path / "run").arrow("every_kind")

    assert digest(ROWS) == store.manifest.digest
    assert store.close_tables()["every_kind"] == digest_table(table)


def test_digest_table_independent_of_arrow_layout(tmp_path: Path) -> None:
    stored(ROWS, directory=tmp_path / "run", flush_rows=64)
    table = open_run(tmp_path / "run").arrow("every_kind")
    one_piece = table.combine_chunks()
    slices = pa.concat_tables([table.slice(0, 13), table.slice(13, 101), table.slice(114)])
    plain_strings = table.set_column(
        7, pa.field("room", pa.string(), True), table["room"].cast(pa.string())
    )

    expected = digest_table(table, EVERY_KIND)
    assert expected == digest_table(one_piece, EVERY_KIND)
    assert expected == digest_table(slices, EVERY_KIND)
    assert expected == digest_table(plain_strings, EVERY_KIND)


def _changed(name: str, value: Any) -> Callable[[dict[str, Any]], dict[str, Any]]:
    def change(rows: dict[str, Any]) -> dict[str, Any]:
        values = rows[name].copy()
        values[123] = value
        return {**rows, name: values}

    return change


@pytest.mark.parametrize(
    "change",
    [
        _changed("step", 0),
        _changed("time", 1),
        _changed("count", 99),
        _changed("total", np.ma.masked),
        _changed("x", -0.0),
        _changed("gap", 77.0),
        _changed("said", "something else"),
        _changed("what", "lost"),
        lambda rows: {**rows, "true": ~rows["true"]},
        lambda rows: {**rows, "room": np.where(rows["room"] == -1, 0, rows["room"])},
        lambda rows: part(rows, 0, 499),
        lambda rows: part(rows, 1, 500),
        lambda rows: {name: values[::-1] for name, values in rows.items()},
    ],
)
def test_digest_changes_with_content(change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    rows = {**ROWS, "what": ROWS["what"].copy()}
    rows["what"][123] = "seen"
    rows["total"] = rows["total"].copy()
    rows["total"][123] = 5

    assert digest(rows) != digest(change(rows))


def test_digest_changes_with_names_kinds_categories_and_order() -> None:
    def of(table: str, *columns: Column) -> str | None:
        spec = TableSpec(table, columns)
        return digest({column.name: [0, 1] for column in columns} | {"step": [0, 1]}, spec=spec)

    step, a, b = Column("step", "step"), Column("a", "int64"), Column("b", "int64")
    room = Column("a", "category", categories=("hall", "bath"))
    other = Column("a", "category", categories=("hall", "kitchen"))
    digests = [
        of("t", step, a),
        of("u", step, a),
        of("t", step, b),
        of("t", a, step),
        of("t", step, Column("a", "step")),
        of("t", step, Column("a", "int64", nullable=True)),
        of("t", step, room),
        of("t", step, other),
        of("t", step, a, b),
    ]

    assert len(digests) == len(set(digests))


def test_strings_are_told_apart_where_they_join() -> None:
    spec = TableSpec("t", (Column("step", "step"), Column("said", "string")))

    one = digest({"step": [0, 1], "said": ["ab", "c"]}, spec=spec)
    assert one != digest({"step": [0, 1], "said": ["a", "bc"]}, spec=spec)


def test_missing_value_is_not_zero() -> None:
    spec = TableSpec("t", (Column("step", "step"), Column("x", "float64", nullable=True)))

    missing = digest({"step": [0], "x": [np.nan]}, spec=spec)
    assert missing != digest({"step": [0], "x": [0.0]}, spec=spec)


def test_digest_of_nan_independent_of_its_bits() -> None:
    spec = TableSpec("t", (Column("step", "step"), Column("x", "float64", nullable=True)))
    nans = np.array([0x7FF8000000000000, 0xFFF8000000000001], np.uint64).view(np.float64)

    assert digest({"step": [0], "x": nans[:1]}, spec=spec) == digest(
        {"step": [0], "x": nans[1:]}, spec=spec
    )


def test_digest_known_value() -> None:
    """A change of how digests are taken makes every stored run differ: it must be meant."""
    spec = TableSpec("events", (Column("step", "step"), Column("what", "category")))

    expected = "6de7edc35f2ac33221b95a145472ec06cc6cab2c3ee48e2d33f64c78f045dc03"
    assert expected == digest({"step": [0, 5], "what": ["seen", "lost"]}, spec=spec)


def test_run_digest_independent_of_order_of_tables() -> None:
    assert run_digest({"a": "1", "b": "2"}) == run_digest({"b": "2", "a": "1"})
    assert run_digest({"a": "1", "b": "2"}) != run_digest({"a": "2", "b": "1"})
