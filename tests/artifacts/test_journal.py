"""The journal: every whole commit can be read back, whatever happens to the bytes behind it."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fleet2d.artifacts.encoding import (
    GROWTH,
    RAW,
    RUNS,
    decode,
    decode_times,
    encode,
    encode_times,
)
from fleet2d.artifacts.journal import FOLDER, JOURNAL_NAME, last_commit
from fleet2d.artifacts.ledger import Ledger
from fleet2d.artifacts.lock import LOCK_NAME, RunLock
from fleet2d.artifacts.store import RunStore
from fleet2d.artifacts.table import Column, TableSpec
from fleet2d.errors import ArtifactError, RunDirectoryError
from fleet2d.runs.run import open_run, run_of

from .tables import EVERY_KIND, part, rows_of_every_kind, stored

ROWS = rows_of_every_kind(500)
LATE = TableSpec("late", (Column("step", "step"), Column("what", "category", nullable=True)))


def begin_run(directory: Path, commits: int = 5, **options: Any) -> RunStore:
    """A run that commits every hundred rows, and then goes on with rows that it doesn't commit."""
    store = RunStore(directory, [EVERY_KIND], **options)
    store.open()
    for k in range(commits):
        store.append("every_kind", **part(ROWS, 100 * k, 100 * k + 100))
        if k == 2:
            store.add_table(LATE)
        if k >= 2:
            store.append("late", step=[k], what=[None if k % 2 else f"word {k}"])
        store.commit(k)
    return store


def kill(store: RunStore) -> Path:
    """End a run as the end of its process would: nothing more is written, the lock goes."""
    assert store._ledger is not None
    store._ledger.journal.close()
    store._ledger.release()
    assert store.directory is not None
    return store.directory


@pytest.mark.parametrize(
    ("values", "grows", "encoding"),
    [
        (np.zeros(1000), False, RUNS),
        (np.repeat([1.0, np.nan, -0.0], 400), False, RUNS),
        (np.arange(1000) * 7, True, GROWTH),
        (np.r_[np.arange(500), np.arange(9000, 9500)], True, GROWTH),
        (np.arange(1000) * 2**20, True, GROWTH),
        (np.arange(1000) * 2**40, True, RAW),
        (np.arange(1000)[::-1].copy(), True, RAW),
        (np.random.default_rng(0).normal(size=1000), False, RAW),
        (np.arange(3), True, RAW),
        (np.zeros(0, np.int32), False, RAW),
        (np.ones(1000, bool), False, RUNS),
        (np.array([-(2**63), 2**63 - 1, 5] * 500), True, RAW),
    ],
)
def test_arrays_come_back_to_the_last_bit(values: Any, grows: bool, encoding: str) -> None:
    encoded = encode(values, grows=grows)
    assert encoding == encoded[0]
    back = decode(encoded, values.dtype, len(values))
    assert values.tobytes() == back.tobytes()
    assert values.dtype == back.dtype


STEPS = np.random.default_rng(0).integers(0, 5, 1000).cumsum()


@pytest.mark.parametrize(
    ("times", "steps", "fits"),
    [
        (STEPS * 1_000_000 + 5, STEPS, True),
        (STEPS * -3, STEPS, True),
        (np.r_[STEPS[:-1] * 7, STEPS[-1] * 7 + 1], STEPS, False),
        (np.r_[STEPS[:500] * 7, STEPS[500] * 7 + 1, STEPS[501:] * 7], STEPS, False),
        (STEPS[:10] * 7, STEPS[:10], False),  # few
        (STEPS, np.zeros(1000, np.int64), False),
        (STEPS * 7, STEPS[::-1].copy(), False),
        (np.r_[-(2**63), np.arange(998), 2**63 - 1], np.r_[np.zeros(999, np.int64), 1], False),
    ],
)
def test_times_that_are_multiples_of_steps_come_back(times: Any, steps: Any, fits: bool) -> None:
    encoded = encode_times(times, steps)
    assert fits == (encoded is not None)
    if encoded is not None:
        assert times.tobytes() == decode_times(encoded, steps).tobytes()


def test_times_without_steps_are_stored_by_themselves(tmp_path: Path) -> None:
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


def test_few_bytes_can_not_ask_for_all_memory() -> None:
    with pytest.raises(ValueError, match="don't make"):
        decode((RUNS, 1, [b"\0" * 8, b"\xff\xff\xff\xff"]), np.dtype(np.int64), 1000)


@pytest.mark.parametrize("encoded", [(GROWTH, 3, [b"\0" * 20]), (GROWTH, 1, []), ("zip", 1, [b""])])
def test_what_encodes_nothing_is_refused(encoded: Any) -> None:
    with pytest.raises((ValueError, TypeError, IndexError)):
        decode(encoded, np.dtype(np.int64), 1000)


@pytest.mark.parametrize("flush_rows", [30, 250, 2**17])
def test_a_killed_run_reads_up_to_its_last_commit(tmp_path: Path, flush_rows: int) -> None:
    store = begin_run(tmp_path / "run", flush_rows=flush_rows)
    store.append("every_kind", **part(ROWS, 0, 50))
    run = open_run(kill(store))
    whole = run_of(stored(part(ROWS, 0, 500)))

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
def test_a_store_goes_on_behind_a_commit(tmp_path: Path, flush_rows: int, undone: int) -> None:
    expected = begin_run(None, flush_rows=flush_rows).close()  # type: ignore[arg-type]
    ends = []
    store = RunStore(tmp_path / "run", [EVERY_KIND], flush_rows=flush_rows)
    store.open()
    for k in range(5):
        store.append("every_kind", **part(ROWS, 100 * k, 100 * k + 100))
        if k == 2:
            store.add_table(LATE)
        if k >= 2:
            store.append("late", step=[k], what=[None if k % 2 else f"word {k}"])
        ends.append(store.commit(k))
    ledger = Ledger(kill(store))
    ledger.lock()
    commit = ends[4 - undone]
    again = RunStore(tmp_path / "run", [EVERY_KIND], flush_rows=flush_rows)
    again.reopen(ledger, commit)
    for k in range(5 - undone, 5):
        again.append("every_kind", **part(ROWS, 100 * k, 100 * k + 100))
        again.append("late", step=[k], what=[None if k % 2 else f"word {k}"])
        again.commit(k)
    assert expected == again.close()
    assert [] == open_run(tmp_path / "run").verify()
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert {"manifest.json", "every_kind.parquet", "late.parquet"} == names


def test_a_cut_or_damaged_journal_reads_up_to_the_last_whole_commit(tmp_path: Path) -> None:
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


def test_a_flipped_byte_ends_the_journal_before_it(tmp_path: Path) -> None:
    directory = kill(begin_run(tmp_path / "run"))
    path = directory / FOLDER / JOURNAL_NAME
    content = path.read_bytes()
    for at in range(0, len(content), 997):
        path.write_bytes(content[:at] + bytes([content[at] ^ 8]) + content[at + 1 :])
        commit = last_commit(path)
        assert commit is None or commit.end <= at


def test_what_is_no_journal_has_no_commit(tmp_path: Path) -> None:
    assert last_commit(tmp_path / "nothing") is None
    (tmp_path / "text").write_text("hello")
    assert last_commit(tmp_path / "text") is None


def test_one_run_has_one_writer(tmp_path: Path) -> None:
    store = begin_run(tmp_path / "run")
    with pytest.raises(RunDirectoryError, match=f"being written by process {os.getpid()} on"):
        Ledger(tmp_path / "run").lock()
    store.close()
    Ledger(tmp_path / "run").lock()


def test_a_lock_that_is_left_over_is_no_hindrance(tmp_path: Path) -> None:
    (tmp_path / LOCK_NAME).write_text("process 1 on another machine")
    lock = RunLock(tmp_path)
    lock.release()
    assert [] == list(tmp_path.iterdir())


def test_only_one_of_many_takes_the_lock(tmp_path: Path) -> None:
    code = (
        "import sys, time; from pathlib import Path; from fleet2d.artifacts.lock import RunLock\n"
        f"try: RunLock(Path({str(tmp_path)!r})); print('mine'); time.sleep(2)\n"
        "except Exception as error: print(type(error).__name__)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=environment
        )
        for _ in range(5)
    ]
    outputs = sorted(process.communicate(timeout=60)[0].strip() for process in processes)
    assert 1 == outputs.count("mine")
    assert 4 == outputs.count("RunDirectoryError")


def test_a_run_in_memory_commits_nothing() -> None:
    store = RunStore(None, [EVERY_KIND])
    assert store.commit(3) is None


def test_a_full_disk_keeps_what_was_committed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = begin_run(tmp_path / "run", commits=3)
    store.append("every_kind", **part(ROWS, 300, 400))

    def refuse(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("fleet2d.artifacts.files.write_all", refuse)
        with pytest.raises(ArtifactError, match=r"the disk is full.*fleet2d resume"):
            store.commit(3)
    run = open_run(tmp_path / "run")
    assert 300 == run.arrow("every_kind").num_rows
    Ledger(tmp_path / "run").lock()  # nobody holds it any more
