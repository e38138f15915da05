"""The journal: what is appended is there whatever comes, and nothing half."""

import errno
import os
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from fleet2d.errors import ArtifactError
from fleet2d.studies import records
from fleet2d.studies.executors import WorkerTask
from fleet2d.studies.records import Journal, VariantRecord, read_journal, record_of
from fleet2d.studies.simulator import VariantOutcome


def record(
    number: int, status: Any = "complete", metrics: dict[str, float] | None = None
) -> VariantRecord:
    rows = pa.table({"step": [1, 2, 3], "value": [0.5, None, number]})
    outcome = VariantOutcome(
        status, "d" * 8, metrics or {"a.b": 0.25}, {"rows": rows}, {"total": 1.0}
    )
    return record_of(WorkerTask(number, number, f"id{number}"), outcome)


def numbers(path: Path) -> list[int]:
    return [entry.number for entry in read_journal(path)]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.bin"


def test_records_come_back_as_they_were(path: Path) -> None:
    journal = Journal(path)
    journal.append(record(7))
    (stored,) = read_journal(path)
    assert record(7).header | {"tables": [("rows", len(stored.body))]} == stored.header
    assert [1, 2, 3] == stored.tables()["rows"].read_all().column("step").to_pylist()
    assert stored == journal.read(7)


def test_the_newest_record_of_a_variant_counts(path: Path) -> None:
    journal = Journal(path)
    journal.append(record(1, "failed"))
    journal.append(record(1))
    assert (1, "complete") == (len(journal), journal.read(1).header["status"])


def test_results_are_the_newest_in_the_order_of_variants(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(records, "MAX_HEADERS", 2)
    monkeypatch.setattr(records, "GROUP_ROWS", 2)
    journal = Journal(path)
    for entry in (record(2), record(1, "failed"), record(0, metrics={"z": 1.0}), record(1)):
        journal.append(entry)
    groups = list(journal.results())
    rows = pa.concat_tables(groups)
    assert [2, 1] == [len(group) for group in groups]
    assert ([0, 1, 2], ["complete"] * 3) == tuple(
        rows[c].to_pylist() for c in ("variant", "status")
    )
    assert ["z", "a.b"] == rows.column_names[-2:]
    assert [1.0, None, None] == rows["z"].to_pylist()


def test_a_journal_goes_on_where_it_was_closed(path: Path) -> None:
    for number in range(3):
        journal = Journal(path)
        journal.append(record(number))
        journal.close()
    assert [0, 1, 2] == numbers(path)


@pytest.mark.parametrize("lost", [1, 5, 40, 200])
def test_what_was_cut_off_is_dropped_and_the_rest_stays(path: Path, lost: int) -> None:
    journal = Journal(path)
    for number in range(3):
        journal.append(record(number))
    journal.close()
    os.truncate(path, path.stat().st_size - lost)
    assert [0, 1] == numbers(path)
    journal = Journal(path)
    journal.append(record(5))
    assert [0, 1, 5] == numbers(path)


def test_what_was_damaged_is_dropped(path: Path) -> None:
    journal = Journal(path)
    journal.append(record(0))
    end_of_first = journal.size
    journal.append(record(1))
    journal.close()
    content = bytearray(path.read_bytes())
    content[end_of_first + 60] ^= 1
    path.write_bytes(content)
    assert [0] == numbers(path)


def test_a_full_disk_leaves_what_was_there_and_says_so(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = Journal(path)
    journal.append(record(0))
    write = os.write

    def full(file: int, data: bytes) -> int:
        if len(data) > 100:
            return write(file, data[:100])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(ArtifactError, match=r"the disk is full.*the same command continues"):
        journal.append(record(1))
    monkeypatch.setattr(os, "write", write)
    assert [0] == numbers(path)
    journal.append(record(1))
    assert [0, 1] == numbers(path)


def test_a_journal_that_is_not_there_has_no_records(path: Path) -> None:
    assert [] == numbers(path)
