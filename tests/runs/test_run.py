"""A stored run reads back, or says in plain words why not."""

import json
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from tests.artifacts.tables import EVERY_KIND, rows_of_every_kind, stored

from fleet2d.artifacts.arrow import spec_of
from fleet2d.artifacts.store import RunStore
from fleet2d.errors import ArtifactError, InputError, RunDirectoryError
from fleet2d.runs.run import open_run, open_store

ROWS = rows_of_every_kind(300)


@pytest.fixture
def directory(tmp_path):
    """A complete run."""
    stored(ROWS, directory=tmp_path / "run", flush_rows=100)
    return tmp_path / "run"


def test_run_in_memory_reads_like_a_stored_one(directory):
    for run in (open_run(directory), open_store(stored(ROWS))):
        assert "complete" == run.status
        assert ["every_kind"] == list(run.tables)
        assert "every_kind" in run.tables
        assert 300 == run.tables["every_kind"].num_rows
        assert 300 == run.manifest["tables"]["every_kind"]["rows"]
        assert [] == run.notes
        assert [] == run.verify()


def test_pandas_and_polars(directory):
    pytest.importorskip("pandas")
    pytest.importorskip("polars")
    run = open_run(directory)

    frame = run.pandas("every_kind")
    assert ["hall", "kitchen", "bath"] == list(frame["room"].cat.categories)
    assert ROWS["x"].tolist() == frame["x"].tolist()
    assert ROWS["x"].tolist() == run.polars("every_kind")["x"].to_list()


@pytest.mark.parametrize(("package", "extra"), [("pandas", "pandas"), ("polars", "study")])
def test_package_that_is_not_installed(directory, monkeypatch, package, extra):
    monkeypatch.setitem(sys.modules, package, None)

    with pytest.raises(InputError, match=rf'pip install "fleet2d\[{extra}\]"'):
        getattr(open_run(directory), package)("every_kind")


def test_unknown_table_names_the_nearest(directory):
    with pytest.raises(ArtifactError, match="did you mean 'every_kind'"):
        open_run(directory).arrow("evry_kind")
    with pytest.raises(KeyError):
        open_run(directory).tables["evry_kind"]


def test_tables_are_read_when_asked_for(directory):
    run = open_run(directory)
    (directory / "every_kind.parquet").unlink()

    with pytest.raises(ArtifactError, match="is missing"):
        run.arrow("every_kind")


def test_truncated_table_is_named_and_the_rest_opens(directory):
    path = directory / "every_kind.parquet"
    path.write_bytes(path.read_bytes()[:-100])

    run = open_run(directory)
    assert any("damaged or cut off" in note for note in run.notes)
    with pytest.raises(ArtifactError, match=r"every_kind.parquet is damaged or cut off"):
        run.arrow("every_kind")
    assert ["every_kind"] == run.verify()


def test_verify_sees_a_changed_value_and_not_a_new_layout(directory):
    path = directory / "every_kind.parquet"
    table = open_run(directory).arrow("every_kind")

    pq.write_table(table, path, compression="snappy", row_group_size=17)
    assert [] == open_run(directory).verify()

    x = ROWS["x"].copy()
    x[-1] = np.nextafter(x[-1], 2)
    pq.write_table(table.set_column(4, table.schema.field(4), [x]), path)
    assert ["every_kind"] == open_run(directory).verify()


def test_verify_sees_a_changed_manifest(directory):
    path = directory / "manifest.json"
    content = json.loads(path.read_text())
    content["digest"] = "0" * 64
    path.write_text(json.dumps(content))

    assert ["manifest.json"] == open_run(directory).verify()


def test_missing_rows_are_noted(directory):
    path = directory / "every_kind.parquet"
    pq.write_table(pq.read_table(path).slice(0, 299), path)

    assert ["table 'every_kind' has 299 rows, but 300 were stored"] == open_run(directory).notes


def test_crashed_run_opens_with_what_is_whole(tmp_path):
    store = RunStore(tmp_path / "run", [EVERY_KIND], flush_rows=50)
    store.open()
    store.append("every_kind", **ROWS)

    run = open_run(tmp_path / "run")
    assert ("running", None, []) == (run.status, run.digest, list(run.tables))
    assert "crashed, or is still going on" in run.notes[0]
    assert "every_kind.parquet.partial" in run.notes[1]
    with pytest.raises(ArtifactError, match="nothing to compare"):
        run.verify()
    with pytest.raises(ArtifactError, match="It has: none"):
        run.arrow("every_kind")
    store.discard()


@pytest.mark.parametrize(
    ("name", "message"),
    [("nowhere", "does not exist"), ("file", "is a file"), (".", "no manifest")],
)
def test_open_what_is_no_run(tmp_path, name, message):
    (tmp_path / "file").touch()
    with pytest.raises(RunDirectoryError, match=message):
        open_run(tmp_path / name)


def test_run_before_close_is_refused():
    with pytest.raises(ArtifactError, match="not closed yet"):
        open_store(RunStore(None, [EVERY_KIND]))


def test_run_says_where_and_how(directory):
    run = open_run(directory)

    assert f"<Run {directory}: complete, tables every_kind>" == repr(run)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.drop_columns(["x"]), "but .*x.* were stored"),
        (lambda t: t.rename_columns([f"{name}s" for name in t.column_names]), "were stored"),
        (lambda t: t.append_column("more", [range(t.num_rows)]), "more, but"),
        (lambda t: t.set_column(0, t.column_names[0], t["x"]), "column .* is double"),
    ],
)
def test_a_table_with_other_columns_than_were_stored_is_not_read(directory, change, words):
    """Pictures and paths expected the columns of the manifest, and ended in tracebacks."""
    path = directory / "every_kind.parquet"
    pq.write_table(change(pq.read_table(path)), path)
    with pytest.raises(ArtifactError, match=words):
        open_run(directory).arrow("every_kind")


def test_a_table_of_others_is_not_taken_for_one_of_ours():
    with pytest.raises(ArtifactError, match="was not stored by Fleet2D"):
        spec_of(pa.schema([("step", pa.int64())], {"fleet2d.table": "events"}))
