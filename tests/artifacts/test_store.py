"""The `artifacts` section of a scenario."""

import errno
import os
import subprocess
import sys
import time
from datetime import timedelta
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from pydantic import ValidationError
from tests.thorough import some

from fleet2d.artifacts import arrow
from fleet2d.artifacts.manifest import Manifest
from fleet2d.artifacts.store import ArtifactSettings, RunStore
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.errors import ArtifactError, RunDirectoryError
from fleet2d.runs.run import open_run, open_store

from .tables import EVERY_KIND, part, rows_of_every_kind, stored


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("off", "off"),
        (False, "off"),  # YAML 1.1 reads a bare `off` so
        ("every step", "every step"),
        ("10 min", timedelta(minutes=10)),
        (timedelta(hours=2), timedelta(hours=2)),
    ],
)
def test_trajectories_take_off_every_step_or_a_duration(value, expected):
    assert expected == ArtifactSettings(trajectories=value).trajectories


@pytest.mark.parametrize("value", ["sometimes", "5 m", True, -1, "0 s"])
def test_trajectories_refuse_anything_else(value):
    with pytest.raises(ValidationError):
        ArtifactSettings(trajectories=value)


POSES = TableSpec("poses", (Column("step", "step"), Column("x", "float64")))
NOISE = TableSpec("noise", (Column("x", "float64"),))


def opened(directory: Path | None, *specs: TableSpec, **options) -> RunStore:
    store = RunStore(directory, specs or (POSES,), **options)
    store.open()
    return store


def names_in(directory: Path):
    return sorted(path.name for path in directory.iterdir())


@pytest.mark.parametrize("flush_rows", [3, 64, 2**17])
def test_rows_come_back_as_they_were_given(tmp_path, flush_rows):
    rows = rows_of_every_kind(200)
    stored(rows, directory=tmp_path / "run", pieces=7, flush_rows=flush_rows)

    disk, memory = open_run(tmp_path / "run"), open_store(stored(rows, pieces=3))
    expected = {name: np.ma.asarray(rows[name]).tolist() for name in rows if name != "said"}
    expected["time"] = rows["time"].astype("M8[us]").tolist()
    expected["gap"] = [None if np.isnan(gap) else gap for gap in rows["gap"]]
    expected["room"] = [("hall", "kitchen", "bath", None)[code] for code in rows["room"]]
    assert expected | {"said": rows["said"]} == disk.arrow("every_kind").to_pydict()
    assert memory.arrow("every_kind").equals(disk.arrow("every_kind"), check_metadata=True)
    assert memory.digest == disk.digest


def test_categories_are_whole_and_in_order_in_every_chunk(tmp_path):
    rows = rows_of_every_kind(200)
    rows["room"] = np.full(200, 1, np.int32)
    rows["what"] = np.array(["late"] * 150 + ["early"] * 50)
    stored(rows, directory=tmp_path / "run", flush_rows=100)

    table = open_run(tmp_path / "run").arrow("every_kind")
    for column, expected in (("room", ["hall", "kitchen", "bath"]), ("what", ["late", "early"])):
        assert 2 == table[column].num_chunks
        assert all(expected == part.dictionary.to_pylist() for part in table[column].chunks)


def test_row_groups_are_no_larger_than_the_flush_size(tmp_path):
    stored(rows_of_every_kind(250), directory=tmp_path / "run", flush_rows=100)

    metadata = pq.ParquetFile(tmp_path / "run" / "every_kind.parquet").metadata
    groups = [metadata.row_group(k).num_rows for k in range(metadata.num_row_groups)]
    assert [100, 100, 50] == groups


def test_same_rows_give_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        stored(rows_of_every_kind(300), directory=tmp_path / name)

    a, b = (tmp_path / name / "every_kind.parquet" for name in ("a", "b"))
    assert a.read_bytes() == b.read_bytes()


def test_empty_tables_and_no_rows(tmp_path):
    store = opened(tmp_path / "run", POSES, EVERY_KIND)
    store.append("poses", step=[], x=[])
    digests = store.close()

    run = open_run(tmp_path / "run")
    assert [0, 0] == [run.arrow(name).num_rows for name in ("poses", "every_kind")]
    assert [] == run.verify()
    assert digests == opened(None, POSES, EVERY_KIND).close()


def test_run_without_tables(tmp_path):
    store = RunStore(tmp_path / "run")
    store.open()
    store.close()

    assert [] == list(open_run(tmp_path / "run").tables)


def test_table_may_be_added_later_and_again(tmp_path):
    store = opened(tmp_path / "run")
    store.append("poses", step=1, x=0.5)
    store.add_table(NOISE)
    store.add_table(NOISE)
    store.append("noise", x=[1.0, 2.0])
    store.close()

    assert [1.0, 2.0] == open_run(tmp_path / "run").arrow("noise")["x"].to_pylist()


def test_table_with_the_name_of_another_is_refused():
    with pytest.raises(ArtifactError, match="choose another name"):
        opened(None).add_table(TableSpec("poses", (Column("y", "bool"),)))


def test_append_to_unknown_or_closed_is_refused(tmp_path):
    store = RunStore(tmp_path / "run", [POSES])
    with pytest.raises(ArtifactError, match=r"call open\(\)"):
        store.append("poses", step=1, x=0.5)
    store.open()
    with pytest.raises(ArtifactError, match=r"no table 'poes'"):
        store.append("poes", step=1, x=0.5)
    store.close()
    with pytest.raises(ArtifactError, match="is closed"):
        store.append("poses", step=1, x=0.5)


def test_nothing_on_disk_before_open_and_nothing_after_discard(tmp_path):
    store = RunStore(tmp_path / "new" / "run", [POSES])
    store.check()
    assert [] == names_in(tmp_path)

    store.open()
    store.discard()
    assert [] == names_in(tmp_path)


def test_a_name_that_no_directory_can_have_is_found_before_the_run(tmp_path):
    with pytest.raises(RunDirectoryError, match="File name too long"):
        RunStore(tmp_path / ("x" * 300)).check()


def test_discard_before_open_touches_nothing(tmp_path):
    stored(rows_of_every_kind(3), directory=tmp_path / "run")
    before = names_in(tmp_path / "run")

    RunStore(tmp_path / "run", [EVERY_KIND]).discard()
    assert before == names_in(tmp_path / "run")


def test_empty_directory_is_taken_and_missing_parents_are_made(tmp_path):
    (tmp_path / "empty").mkdir()
    for directory in (tmp_path / "empty", tmp_path / "a" / "b" / "c"):
        opened(directory).close()

        assert "complete" == open_run(directory).status


def test_directory_that_holds_something_is_refused(tmp_path):
    (tmp_path / "file").write_text("mine")

    with pytest.raises(RunDirectoryError, match="not empty: choose another --out or remove it"):
        opened(tmp_path)
    assert ["file"] == names_in(tmp_path)


@pytest.mark.parametrize("below", [".", "deeper/still"])
def test_file_in_the_way_is_refused(tmp_path, below):
    (tmp_path / "file").write_text("mine")

    with pytest.raises(RunDirectoryError, match="is not a directory"):
        opened(tmp_path / "file" / below)
    assert "mine" == (tmp_path / "file").read_text()


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_directory_without_permission_is_refused(tmp_path):
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)

    for directory in (locked, locked / "run"):
        with pytest.raises(RunDirectoryError, match="you may not write in"):
            opened(directory)


@pytest.mark.parametrize("number", [errno.EACCES, errno.EROFS, errno.ENAMETOOLONG])
def test_directory_that_cannot_be_made_is_refused(tmp_path, monkeypatch, number):
    def refuse(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(Manifest, "write", refuse)

    with pytest.raises(RunDirectoryError, match="choose another --out"):
        opened(tmp_path / "a" / "run")
    assert [] == names_in(tmp_path)


def test_disk_full_at_open_leaves_nothing(tmp_path, monkeypatch):
    def refuse(_: Manifest, directory: Path):
        (directory / "manifest.json.partial").write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Manifest, "write", refuse)
    (tmp_path / "run").mkdir()

    with pytest.raises(ArtifactError, match="the disk is full"):
        opened(tmp_path / "run")
    assert [] == names_in(tmp_path / "run")


def test_disk_full_marks_the_run_as_failed(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    store = opened(tmp_path / "run", POSES, NOISE, flush_rows=10)
    store.append("noise", x=np.zeros(25))
    monkeypatch.setattr(arrow.ParquetTable, "write", refuse)

    with pytest.raises(ArtifactError, match=r"the disk is full.*marked as failed"):
        store.append("poses", step=np.arange(20), x=0.0)
    with pytest.raises(ArtifactError, match="the disk is full"):
        store.close()
    expected = ["manifest.json", "noise.parquet.partial", "poses.parquet.partial", "unfinished"]
    assert expected == names_in(tmp_path / "run")
    run = open_run(tmp_path / "run")
    assert "failed" == run.status
    assert None is run.digest
    assert any("the disk is full" in note for note in run.notes)


@pytest.fixture
def tiny_disk(tmp_path):
    """A file system of 1 MiB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)]
    try:
        subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("a file system of 1 MiB can't be mounted here (that takes root)")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def test_disk_really_full(tiny_disk):
    store = opened(tiny_disk / "run", NOISE, flush_rows=10_000)
    noise = np.random.default_rng(0).random(200_000)

    with pytest.raises(ArtifactError, match=r"the disk is full.*and marked as failed"):
        store.append("noise", x=noise)
    assert ["manifest.json", "noise.parquet.partial", "unfinished"] == names_in(tiny_disk / "run")
    run = open_run(tiny_disk / "run")
    assert "failed" == run.status
    assert [] == list(run.tables)
    assert any("the disk is full" in note for note in run.notes)


def test_disk_full_at_the_manifest_leaves_whole_tables(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    store = opened(tmp_path / "run")
    store.append("poses", step=1, x=0.5)
    monkeypatch.setattr(Manifest, "write", refuse)

    with pytest.raises(ArtifactError, match=r"manifest.json.*not marked as complete"):
        store.close()
    run = open_run(tmp_path / "run")
    assert "running" == run.status
    assert [1] == run.arrow("poses")["step"].to_pylist()


def test_words_of_an_interrupted_append_are_not_part_of_the_digest(tmp_path, monkeypatch):
    """The digest counted a word that no row has, so that `verify` found the table changed."""

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    late = TableSpec("late", (Column("what", "category", nullable=True),))
    store, same = opened(tmp_path / "run", late), opened(None, late)
    for each in (store, same):
        each.append("late", what=["on", "off"])
    with monkeypatch.context() as patch:
        patch.setattr(np, "copyto", interrupt)
        with pytest.raises(KeyboardInterrupt):
            store.append("late", what=["lost", None])

    assert same.close("interrupted") == store.close("interrupted")
    assert [] == open_run(tmp_path / "run").verify()


def test_close_after_an_interrupted_close(tmp_path, monkeypatch):
    """Ctrl-C may come while the files are being finished."""
    store = opened(tmp_path / "run", POSES, NOISE)
    store.append("poses", step=1, x=0.5)

    def interrupt(_: Path):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("fleet2d.artifacts.store.sync_directory", interrupt)
        with pytest.raises(KeyboardInterrupt):
            store.close()
    store.close("interrupted")

    assert "interrupted" == open_run(tmp_path / "run").status
    assert [] == open_run(tmp_path / "run").verify()


def test_close_again_gives_the_same(tmp_path):
    store = opened(tmp_path / "run")
    store.append("poses", step=1, x=0.5)
    digests = store.close_tables()
    store.manifest.wall_s = {"save": 0.25}

    assert digests == store.close()
    assert digests == store.close()
    assert {"save": 0.25} == open_run(tmp_path / "run").manifest["wall_s"]


CRASH = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from tests_of_artifacts import EVERY_KIND, rows_of_every_kind
from fleet2d.artifacts.store import RunStore
from fleet2d.artifacts.table import TableSpec

specs = [TableSpec(f"t{k}", EVERY_KIND.columns) for k in range(20)]
store = RunStore(Path(sys.argv[1]), specs, flush_rows=200)
store.open()
rows = rows_of_every_kind(500)
print("ready", flush=True)
for round in range(3):
    for spec in specs:
        store.append(spec.name, **rows)
    print("storing", flush=True)
    if sys.argv[3] == "storing":
        sys.stdin.read()
print("closing", flush=True)
store.close()
print("closed", flush=True)
sys.stdin.read()
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="kill -9 is a matter of POSIX")
def test_crash_never_leaves_a_file_that_looks_whole(tmp_path):
    """Killed in the middle of storing, of closing, and just after.

    The child waits for its end in the first case and in the last, whatever the machine is doing;
    the others die somewhere between.
    """
    helper = (Path(__file__).parent / "tables.py").read_text(encoding="utf-8")
    (tmp_path / "tests_of_artifacts.py").write_text(helper, encoding="utf-8")
    seen = set()
    for k, (word, delay) in enumerate(
        some([("storing", 0), ("ready", 0.02), ("closing", 0), ("closing", 0.01), ("closed", 0)], 2)
    ):
        directory = tmp_path / f"run{k}"
        command = [sys.executable, "-c", CRASH, str(directory), str(tmp_path), word]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as child:
            while child.stdout.readline().strip() != word:
                assert child.poll() is None, "the child failed"
            time.sleep(delay)
            child.kill()

        run = open_run(directory)
        seen.add(run.status)
        for path in directory.glob("*.parquet"):
            assert 1500 == pq.read_table(path).num_rows
        if run.status == "running":
            assert any("crashed" in note for note in run.notes)
            assert all(1500 == run.arrow(name).num_rows for name in run.tables)
        else:
            assert ("complete", []) == (run.status, run.verify())
    assert {"running", "complete"} == seen


def test_arrow_mid_run_shows_all_rows_and_keeps_the_digest():
    store = opened(None, EVERY_KIND)
    rows = rows_of_every_kind(300)
    for start in range(0, 300, 100):
        store.append("every_kind", **part(rows, start, start + 100))
        assert start + 100 == store.arrow("every_kind").num_rows
    store.close()

    assert stored(rows).manifest.digest == store.manifest.digest


def test_relative_directory_stays_where_it_was(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    store = opened(Path("run"))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    store.close()

    assert "complete" == open_run(tmp_path / "run").status
