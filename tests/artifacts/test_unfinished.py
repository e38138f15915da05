"""The journal: every whole commit can be read back, whatever happens to the bytes behind it."""

import json
import os
import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.thorough import examples

from fleet2d.artifacts.arrow import schema_of
from fleet2d.artifacts.store import RunStore
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.artifacts.unfinished import (
    FOLDER,
    GROWTH,
    HEADER,
    JOURNAL,
    JOURNAL_NAME,
    LINE,
    NARROW,
    RAW,
    RUNS,
    ArrayReader,
    UnfinishedRun,
    last_commit,
)
from fleet2d.errors import ArtifactError, RunDirectoryError
from fleet2d.runs.run import open_run, open_store
from fleet2d.storage.files import FrameWriter, read_frames

from .tables import EVERY_KIND, part, rows_of_every_kind, stored

ROWS = rows_of_every_kind(500)
LATE = TableSpec("late", (Column("step", "step"), Column("what", "category", nullable=True)))


def begin_run(directory: Path, commits=5, **options) -> RunStore:
    """A run that commits every hundred rows."""
    store = RunStore(directory, [EVERY_KIND], **options)
    store.open()
    commit_rows(store, commits)
    return store


def commit_rows(store: RunStore, commits):
    """Commit every hundred rows; return where each commit ends."""
    ends = []
    for k in range(commits):
        store.append("every_kind", **part(ROWS, 100 * k, 100 * k + 100))
        if k == 2:
            store.add_table(LATE)
        if k >= 2:
            store.append("late", step=[k], what=[None if k % 2 else f"word {k}"])
        ends.append(store.commit(k))
    return ends


def test_a_journal_that_begins_again_describes_its_tables_again(tmp_path):
    unfinished = UnfinishedRun(tmp_path)
    for rows in (3, 2):
        unfinished.begin()
        unfinished.add(LATE, [np.arange(rows), np.zeros(rows, np.bool_), np.arange(rows)], rows, {})
        commit = unfinished.commit(rows)
        unfinished.journal.close()
        assert {"late": rows} == commit.rows
        assert commit == last_commit(tmp_path / FOLDER / JOURNAL_NAME)


def kill(store: RunStore) -> Path:
    """End a run as the end of its process would: nothing more is written, the lock goes."""
    store._unfinished.journal.close()
    store._unfinished.release()
    return store.directory


def test_times_without_steps_are_stored_by_themselves(tmp_path):
    """The column of times may come first, or have missing values."""
    steps = np.arange(1000, dtype=np.int64)
    times = np.datetime64("2026-01-05T00:00", "us") + steps * 1_000_000
    late = np.where(steps % 9 == 0, np.datetime64("NaT"), times)
    columns = [
        Column("step", "step"),
        Column("time", "time"),
        Column("late", "time", nullable=True),
    ]
    for name, order in (("after", columns), ("before", columns[::-1])):
        store = RunStore(tmp_path / name, [TableSpec("t", tuple(order))])
        store.open()
        store.append("t", step=steps, time=times, late=late)
        store.commit(1)
        table = open_run(kill(store)).arrow("t")
        assert steps.tolist() == table["step"].to_pylist()
        assert times.tolist() == table["time"].to_pylist()
        assert late.tolist() == table["late"].to_pylist()


@pytest.mark.parametrize("flush_rows", [30, 250, 2**17])
def test_a_killed_run_reads_up_to_its_last_commit(tmp_path, flush_rows):
    store = begin_run(tmp_path / "run", flush_rows=flush_rows)
    store.append("every_kind", **part(ROWS, 0, 50))
    run = open_run(kill(store))
    whole = open_store(stored(part(ROWS, 0, 500)))

    assert "running" == run.status
    assert 4 == run.manifest["steps"]
    assert ["every_kind", "late"] == list(run.tables)
    assert whole.arrow("every_kind").to_pylist() == run.arrow("every_kind").to_pylist()
    assert ["word 2", None, "word 4"] == run.arrow("late")["what"].to_pylist()
    (note,) = run.notes
    assert "is unfinished" in note
    assert "before step 4" in note
    assert "fleet2d resume" in note


@pytest.mark.parametrize("flush_rows", [30, 250, 2**17])
@pytest.mark.parametrize("undone", [0, 2])
def test_a_store_goes_on_behind_a_commit(tmp_path, flush_rows, undone):
    expected = begin_run(None, flush_rows=flush_rows).close()
    store = RunStore(tmp_path / "run", [EVERY_KIND], flush_rows=flush_rows)
    store.open()
    ends = commit_rows(store, 5)
    unfinished = UnfinishedRun(kill(store))
    unfinished.lock()
    commit = ends[4 - undone]
    again = RunStore(tmp_path / "run", [EVERY_KIND], flush_rows=flush_rows)
    again.reopen(unfinished, commit)
    for k in range(5 - undone, 5):
        again.append("every_kind", **part(ROWS, 100 * k, 100 * k + 100))
        again.append("late", step=[k], what=[None if k % 2 else f"word {k}"])
        again.commit(k)
    assert expected == again.close()
    assert [] == open_run(tmp_path / "run").verify()
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert {"manifest.json", "every_kind.parquet", "late.parquet"} == names


def test_a_cut_or_damaged_journal_reads_up_to_the_last_whole_commit(tmp_path):
    """What a power cut leaves: the file ends anywhere, or holds anything behind what was synced."""
    directory = kill(begin_run(tmp_path / "run"))
    path = directory / FOLDER / JOURNAL_NAME
    content = path.read_bytes()
    rng = np.random.default_rng(3)
    full = open_run(directory).arrow("every_kind").to_pylist()
    seen = set()
    for _ in range(150):
        cut = int(rng.integers(0, len(content)))
        noise = rng.integers(0, 256, int(rng.integers(0, 40))).astype(np.uint8).tobytes()
        path.write_bytes(content[:cut] + (noise if rng.random() < 0.5 else bytes(len(noise))))
        commit = last_commit(path)
        if commit is None:
            continue
        run = open_run(directory)
        rows = run.arrow("every_kind").to_pylist()
        assert 100 * (commit.step + 1) == len(rows)
        assert full[: len(rows)] == rows
        seen.add(commit.step)
    assert {0, 1, 2, 3} <= seen


Frame = tuple[str, Any, bytes]


def with_frames(path: Path, change: Callable[[list[Frame]], None]):
    """Change the frames of a journal; their checksums are right afterwards."""
    frames = [frame[:3] for frame in read_frames(path, JOURNAL)]
    change(frames)
    writer = FrameWriter(path, JOURNAL)
    for kind, description, arrays in frames:
        writer.add(kind, json.dumps(description), arrays)
    writer.commit()
    writer.close()


def put_into(value, rng: random.Random):
    """Return JSON data with another value at a random place, or without one."""
    if isinstance(value, list | dict) and value and rng.random() < 0.8:
        key = rng.choice(range(len(value)) if isinstance(value, list) else list(value))
        value = value.copy()
        if rng.random() < 0.2:
            del value[key]
        else:
            value[key] = put_into(value[key], rng)
        return value
    return rng.choice([None, -1, 0, 2**62, 1e300, "x", [], {}, True, [1], 10**30, "every_kind"])


def test_forged_frames_read_or_are_refused(tmp_path):
    """Right checksums around wrong content: codes beyond the words, a text cut inside a letter,
    two tables of one name, a time after the year 9999."""
    directory = kill(begin_run(tmp_path / "run"))
    path = directory / FOLDER / JOURNAL_NAME
    content, rng = path.read_bytes(), random.Random(1)

    def forge(frames: list[Frame]):
        for _ in range(rng.choice([1, 1, 2])):
            at = rng.randrange(len(frames))
            kind, description, arrays = frames[at]
            if rng.random() < 0.5:
                frames[at] = kind, put_into(description, rng), arrays
            elif arrays:
                changed = bytearray(arrays)
                end = min(len(changed), rng.choice([60, 10**6]))  # the first headers, or anything
                changed[rng.randrange(end)] = rng.choice([0, 1, 2, 3, 4, 255])
                frames[at] = kind, description, bytes(changed)

    results = Counter[str]()
    for _ in range(examples(600)):
        path.write_bytes(content)
        with_frames(path, forge)
        try:
            run = open_run(directory)
            for name in run.tables:
                run.arrow(name).to_pylist()
            results["read"] += 1
        except (ArtifactError, RunDirectoryError):
            results["refused"] += 1
    assert min(results["read"], results["refused"]) > 20


ROOM = Column("c", "category", categories=("hall", "bath", "kitchen"))
LETTERS = np.frombuffer("aé".encode(), np.uint8)


@pytest.mark.parametrize(
    ("column", "arrays", "words"),
    [
        (ROOM, [np.array([0, 3], np.int32)], "expected 0 to 2"),
        (ROOM, [np.array([0, -1], np.int32)], "expected 0 to 2"),
        (Column("c", "time"), [np.array([0, 2**60])], "expected -62135596800000000 to"),
        (Column("c", "string"), [np.array([-1, 4]), LETTERS], "a text of -1 bytes"),
        (Column("c", "string"), [np.array([2, 1]), LETTERS], "can't decode byte"),
    ],
)
def test_rows_that_no_run_stores_are_refused(tmp_path, column, arrays, words):
    directory = kill(begin_run(tmp_path / "run"))
    unfinished = UnfinishedRun(directory)
    unfinished.begin()
    unfinished.add(TableSpec("t", (column,)), arrays, 2, {})
    unfinished.commit(2)
    unfinished.journal.close()
    with pytest.raises(ArtifactError, match=f"journal is damaged .*{words}"):
        open_run(directory).arrow("t")


def test_two_tables_of_one_name_are_refused(tmp_path):
    directory = kill(begin_run(tmp_path / "run"))
    writer = FrameWriter(directory / FOLDER / JOURNAL_NAME, JOURNAL)
    for _ in range(2):
        writer.add("table", "{}", schema_of(LATE).serialize().to_pybytes())
    writer.add("commit", "[1,[0,0]]")
    writer.commit()
    writer.close()
    with pytest.raises(ArtifactError, match=r"journal is damaged \(two tables have the name"):
        open_run(directory).arrow("late")


def test_what_is_no_journal_has_no_commit(tmp_path):
    assert last_commit(tmp_path / "nothing") is None
    (tmp_path / "text").write_text("hello")
    assert last_commit(tmp_path / "text") is None


def test_one_run_has_one_writer(tmp_path):
    store = begin_run(tmp_path / "run")
    with pytest.raises(RunDirectoryError, match=f"being written by process {os.getpid()} on"):
        UnfinishedRun(tmp_path / "run").lock()
    store.close()
    UnfinishedRun(tmp_path / "run").lock()


def test_a_run_in_memory_commits_nothing():
    store = RunStore(None, [EVERY_KIND])
    assert store.commit(3) is None


def test_a_full_disk_keeps_what_was_committed(tmp_path, monkeypatch):
    store = begin_run(tmp_path / "run", commits=3)
    store.append("every_kind", **part(ROWS, 300, 400))

    def refuse(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("fleet2d.storage.files.write_all", refuse)
        with pytest.raises(ArtifactError, match=r"the disk is full.*fleet2d resume"):
            store.commit(3)
    run = open_run(tmp_path / "run")
    assert 300 == run.arrow("every_kind").num_rows
    UnfinishedRun(tmp_path / "run").lock()  # nobody holds it any more


@pytest.mark.parametrize("status", ["complete", "interrupted"])
def test_a_disk_that_fails_when_the_journal_is_closed_ends_no_run(tmp_path, monkeypatch, status):
    """Network file systems report late that they are full; nothing of the journal is needed."""
    store = begin_run(tmp_path / "run")
    close = os.close

    def fail(handle):
        close(handle)
        raise OSError(5, "Input/output error")

    handle = store._unfinished.journal._handle
    monkeypatch.setattr("fleet2d.storage.files.os.close", lambda h: (fail if h == handle else close)(h))  # fmt: skip
    store.close(status)
    assert status == open_run(tmp_path / "run").status
    UnfinishedRun(tmp_path / "run").lock()  # nobody holds it any more


INT64 = np.dtype(np.int64)


def frame(encoding, count, content):
    return HEADER.pack(encoding, count, len(content)) + content


def test_few_bytes_can_not_ask_for_all_memory():
    content = frame(RUNS, 1, bytes(8) + b"\xff" * 4)
    with pytest.raises(ValueError, match="don't make"):
        ArrayReader(content).read(INT64, 1000)


@pytest.mark.parametrize("encoding", [NARROW, GROWTH, RUNS, LINE])
def test_text_is_never_repeated(encoding):
    """The length of a text isn't bounded as that of other columns is: it must be there."""
    with pytest.raises(ValueError, match="text has encoding"):
        ArrayReader(frame(encoding, 1, b"a" + bytes(7) + b"\1")).read(np.dtype(np.uint8), 2**56)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        HEADER.pack(RAW, 0, 16) + bytes(8),  # cut off
        HEADER.pack(RAW, 0, 2**63) + bytes(8),
        frame(RAW, 0, bytes(7)),
        frame(RAW, 0, bytes(16)),
        frame(NARROW, 3, bytes(9)),
        frame(NARROW, 1, bytes(2)),
        frame(GROWTH, 0, b""),
        frame(GROWTH, 0, bytes(8) + b"\1"),
        frame(GROWTH, 0, bytes(8) + b"\1\xff" + bytes(7)),
        frame(GROWTH, 0, bytes(8) + b"\1\2" + bytes(8)),
        frame(RUNS, 0, b""),
        frame(RUNS, 2, bytes(18)),
        frame(RUNS, 2**32 - 1, bytes(9)),
        frame(LINE, 0, bytes(8)),
        frame(LINE, 0, bytes(16)),  # there is no array before it
        frame(9, 0, bytes(24)),
    ],
)
def test_what_encodes_nothing_is_refused(content):
    with pytest.raises(ValueError):  # noqa: PT011 - some messages are numpy's
        ArrayReader(content).read(INT64, 3)


def test_flags_are_true_or_false():
    with pytest.raises(ValueError, match="neither"):
        ArrayReader(frame(RAW, 0, b"\1\0\2")).read(np.dtype(np.bool_), 3)
