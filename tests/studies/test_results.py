"""Results in Parquet files: what is written, how it grows, and what comes back."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fleet2d.studies import results
from fleet2d.studies.executors import WorkerTask
from fleet2d.studies.results import (
    ResultWriter,
    VariantResult,
    drop_damaged,
    read_results,
    result_of,
    table_files,
)
from fleet2d.studies.simulator import VariantOutcome
from fleet2d.studies.storage import Storage

FILE = "results/000001.parquet"


def result(number, status="complete", rows=None, **metrics):
    tables = {"rows": pa.table(rows or {"step": [1, 2], "value": [0.5, number]})}
    outcome = VariantOutcome(status, "d" * 8, metrics or {"a": 0.25}, tables, {"total": 1.0})
    return result_of(WorkerTask(number, number, f"id{number}"), outcome)


@pytest.fixture
def storage(tmp_path):
    return Storage(tmp_path)


def write(storage: Storage, *found: VariantResult):
    writer = ResultWriter(storage)
    for each in found:
        writer.add(each)
    writer.flush(now=True)


def test_results_come_back_in_the_order_of_variants(storage):
    write(storage, result(7), result(2, "failed"))
    frame = read_results(storage)
    assert [2, 7] == frame["variant"].to_list()
    assert ["failed", "complete"] == frame["status"].to_list()
    assert [(0.25, 1.0, None)] * 2 == frame.select("a", "wall_s", "setup_s").rows()


def test_the_newest_result_of_a_variant_counts(storage):
    write(storage, result(1, "failed"), result(2))
    write(storage, result(1))
    assert [(2, "complete"), (1, "complete")] == read_results(storage).select(
        "variant", "status"
    ).rows()


def test_numbers_that_are_not_finite_or_of_other_variants_are_missing(storage):
    write(storage, result(1, a=float("nan")), result(2, b=float("inf")), result(3, b=1))
    assert [(None, None), (None, None), (None, 1.0)] == read_results(storage).select(
        "a", "b"
    ).rows()


def test_a_study_without_results_has_their_columns(storage):
    assert results.RESULT_COLUMNS == tuple(read_results(storage).columns)


def test_tables_have_the_rows_of_all_variants_sorted_and_the_columns_of_any(storage):
    words = pa.array(["x"]).dictionary_encode()
    write(storage, result(4, rows={"step": [1], "word": words}), result(3, rows={"step": [0.5]}))
    file = table_files(storage, FILE)["rows"]
    expected = {"variant": [3, 4], "step": [0.5, 1.0], "word": [None, "x"]}
    assert expected == pq.read_table(storage.path(file)).to_pydict()


def test_a_part_that_grows_is_written_again_with_all_of_its_rows(storage, monkeypatch):
    writer = ResultWriter(storage)
    for number in range(3):
        writer.add(result(number))
        writer.flush(now=True)
    assert [FILE] == storage.names("results")
    assert ["tables/rows/000001-0003.parquet"] == storage.names("tables/rows")
    assert 3 == len(read_results(storage))


def test_what_comes_soon_after_is_written_later(storage, monkeypatch):
    now_s = 100.0
    monkeypatch.setattr(results.time, "monotonic", lambda: now_s)
    writer = ResultWriter(storage)
    for number, at_s in enumerate((100.0, 100.5, 101.1)):
        now_s = at_s
        writer.add(result(number))
        writer.flush()
        assert [1, 1, 3][number] == len(read_results(storage))


@pytest.mark.parametrize("place", [40, -300])
def test_a_flipped_bit_is_noted_and_its_part_deleted(storage, place):
    write(storage, result(1))
    write(storage, result(2))
    path = Path(storage.path(FILE))
    content = bytearray(path.read_bytes())
    content[place] ^= 4
    path.write_bytes(content)
    (problem,) = drop_damaged(storage)
    assert "results/000001.parquet is damaged" in problem
    assert [2] == read_results(storage)["variant"].to_list()
    assert ["tables/rows/000002-0001.parquet"] == storage.names("tables/rows")


def test_files_of_others_stay(storage):
    write(storage, result(1))
    storage.write("tables/rows/mine.parquet", b"mine")
    storage.write("results/notes.txt", b"mine")
    assert [] == drop_damaged(storage)
    assert storage.exists("tables/rows/mine.parquet")
    assert 1 == len(read_results(storage))


@pytest.mark.parametrize("name", ["../precious.parquet", "tables/rows/000002-0001.parquet"])
def test_results_that_name_files_of_others_delete_nothing(storage, tmp_path, name):
    write(storage, result(1))
    rows = pq.read_table(storage.path(FILE))
    rows = rows.replace_schema_metadata({results._FILES: f'{{"rows": "{name}"}}'})
    storage.write_table(FILE, [rows])
    (problem,) = drop_damaged(storage)
    assert "is damaged" in problem
