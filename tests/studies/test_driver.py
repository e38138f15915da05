"""Running studies: what is kept, what is skipped, what is refused, and what is run again."""

import os
import shutil
from concurrent.futures import Future
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any

import polars as pl
import pyarrow.parquet as pq
import pytest
from polars.testing import assert_frame_equal
from tests.studies.scenes import SPEED, CountingExecutor, base, digests, run, small
from tests.thorough import some

from fleet2d.errors import ArtifactError, RunDirectoryError, ScenarioError
from fleet2d.storage import files
from fleet2d.studies import design, driver, plan, results, storage
from fleet2d.studies.executors import LocalExecutor, SerialExecutor
from fleet2d.studies.reader import open_study

ROWS = {"keep": {"tables": ["room_share"]}}
BROKEN = """from fleet2d import Algorithm

class Fails(Algorithm):
    at: int = 0
    def update(self, history, state):
        if self.at == 2:
            raise ValueError("no more")
"""


class CollectingObserver(driver.Observer):
    def __init__(self):
        self.notes: list[str] = []

    def on_note(self, text):
        self.notes.append(text)


@pytest.fixture(scope="module")
def undisturbed_dir(tmp_path_factory):
    """A study that ran without disturbance."""
    folder = tmp_path_factory.mktemp("studies") / "whole"
    run(small(**ROWS), folder)
    return folder


@pytest.fixture
def copied(undisturbed_dir, tmp_path):
    """The same, to be disturbed."""
    return shutil.copytree(undisturbed_dir, tmp_path / "copied")


def test_a_study_is_one_data_set_and_few_files(undisturbed_dir):
    files = sorted(
        p.relative_to(undisturbed_dir).as_posix().partition("-")[0]
        for p in undisturbed_dir.rglob("*")
        if p.is_file()
    )
    assert [
        "plan.parquet", "results/000001.parquet", "scenarios.parquet",
        "study.json", "tables/room_share/000001", "variants.parquet",
    ] == files  # fmt: skip


@pytest.mark.slow
def test_it_goes_on_where_it_was_interrupted(undisturbed_dir, tmp_path):
    folder = tmp_path / "study"
    ran = []
    for most in (2, 1, 0, 9):
        executor = CountingExecutor(most)
        with suppress(KeyboardInterrupt):
            _, study = run(small(**ROWS), folder, executor)
        ran += executor.ran
        found = open_study(folder)
        statuses = ["complete"] * len(ran) + ["missing"] * (6 - len(ran))
        assert statuses == found.variants["status"].to_list()
        assert len(ran) == len(found.arrow("room_share").to_table().column("variant").unique())
    assert sorted(ran) == list(range(6))  # nothing twice
    _, undisturbed = run(small(**ROWS), undisturbed_dir)
    assert digests(undisturbed) == digests(study)
    assert undisturbed.arrow("room_share").to_table() == study.arrow("room_share").to_table()


@pytest.mark.parametrize("file", ["results/000001.parquet", "tables/room_share/000001-*.parquet"])
@pytest.mark.parametrize("harm", ["cut", "gone", "changed"])
def test_what_is_damaged_is_run_again(copied, undisturbed_dir, file, harm):
    (path,) = copied.glob(file)
    if harm == "gone":
        path.unlink()
    elif harm == "cut":
        os.truncate(path, path.stat().st_size // 2)
    else:
        path.write_bytes(path.read_bytes()[:-9] + b"\0" * 9)
    executor, observer = CountingExecutor(), CollectingObserver()
    counts, study = run(small(**ROWS), copied, executor, observer=observer)
    assert (6, 6) == (counts.complete, len(executor.ran))
    if (file, harm) != ("results/000001.parquet", "gone"):  # without which there were no results
        assert path.relative_to(copied).as_posix() in observer.notes[0]
    assert digests(open_study(undisturbed_dir)) == digests(study)


@pytest.mark.parametrize("file", ["variants.parquet", "scenarios.parquet", "study.json"])
@pytest.mark.parametrize("harm", ["gone", "cut"])
def test_what_can_be_made_again_is_made_again(copied, file, harm):
    content = (copied / file).read_bytes()
    if harm == "cut":
        os.truncate(copied / file, len(content) // 2)
    elif file != "study.json":  # without which it is no study
        (copied / file).unlink()
    executor = CountingExecutor()
    run(small(**ROWS), copied, executor)
    assert ([], content) == (executor.ran, (copied / file).read_bytes())


def test_a_plan_that_is_gone_is_refused_as_results_would_be_of_other_variants(copied):
    """Results are stored by number: renumbered variants would silently get those of others."""
    (copied / "plan.parquet").unlink()
    with pytest.raises(RunDirectoryError, match=r"plan.parquet is missing.*another --out"):
        run(small(axes={SPEED: [0.1, 0.3, 0.6]}, **ROWS), copied)


def test_a_crash_between_a_table_and_its_results_counts_nothing_twice(copied):
    """Before the results name the new file of a table, and after it, the old one is there, too."""
    folder = copied / "tables/room_share"
    (file,) = folder.iterdir()
    for version in ("000001-0000.parquet", "000001-0099.parquet"):
        shutil.copy(file, folder / version)
    executor = CountingExecutor()
    before = open_study(copied).arrow("room_share").count_rows()
    _, study = run(small(**ROWS), copied, executor)
    assert ([], before) == (executor.ran, study.arrow("room_share").count_rows())
    assert [file] == list(folder.iterdir())


def test_a_part_that_grows_large_is_followed_by_another(tmp_path, monkeypatch, undisturbed_dir):
    monkeypatch.setattr(results, "PART_ROWS", 2)
    monkeypatch.setattr(results, "FLUSH_EVERY_S", 0.0)
    monkeypatch.setattr(results, "FLUSH_SHARE", 1e9)
    _, study = run(small(**ROWS), tmp_path / "study")
    assert 3 == len(list((tmp_path / "study/results").iterdir()))
    assert 3 == len(list((tmp_path / "study/tables/room_share").iterdir()))
    assert digests(open_study(undisturbed_dir)) == digests(study)
    rows = study.polars("room_share").collect()
    assert 6 == rows["variant"].n_unique()


def test_a_data_set_of_many_slices_is_the_same(copied, monkeypatch):
    monkeypatch.setattr(plan, "SLICE_ROWS", 4)
    more = small(axes={SPEED: [0.1, 0.3, 0.6]}, replicates=4, **ROWS)
    _, study = run(more, copied)
    stored = pq.ParquetFile(copied / "variants.parquet")
    assert 3 == stored.num_row_groups
    assert_frame_equal(pl.DataFrame(stored.read()), study.variants)


def test_a_full_disk_ends_it_and_the_same_command_goes_on(tmp_path, monkeypatch, undisturbed_dir):
    def full(path: Path) -> AbstractContextManager[int]:
        if path.parent.name == "results" and path.exists():
            raise OSError(28, "No space left on device")
        return files.replacing(path)

    with monkeypatch.context() as patched:
        patched.setattr(storage, "replacing", full)
        patched.setattr(results, "FLUSH_EVERY_S", 0.0)
        patched.setattr(results, "FLUSH_SHARE", 1e9)
        with pytest.raises(ArtifactError, match="the disk is full"):
            run(small(**ROWS), tmp_path / "study")
    executor = CountingExecutor()
    _, study = run(small(**ROWS), tmp_path / "study", executor)
    assert 5 == len(executor.ran)
    assert digests(open_study(undisturbed_dir)) == digests(study)


def test_more_values_and_seeds_are_run_beside_those_that_are_there(copied):
    executor, observer = CountingExecutor(), CollectingObserver()
    more = small(axes={SPEED: [0.1, 0.3, 0.6]}, replicates=4, **ROWS)
    counts, study = run(more, copied, executor, observer=observer)
    assert (12, 6) == (counts.complete, len(executor.ran))
    assert ["6 variants are new in " + str(copied)] == observer.notes
    assert [0.1] * 4 + [0.3] * 4 + [0.6] * 4 == study.variants[SPEED].to_list()
    assert set(digests(open_study(copied))) == set(digests(study))


def test_results_of_another_scenario_are_refused_until_told_to_redo(copied):
    longer = small(base=base("3 min"), **ROWS)
    with pytest.raises(RunDirectoryError, match=r"6 of scenarios.*no longer has.*--changed redo"):
        run(longer, copied)
    executor = CountingExecutor()
    counts, study = run(longer, copied, executor, changed="redo")
    assert (6, 6) == (counts.complete, len(executor.ran))
    assert {180.0} == set(study.variants["simulated_s"])


@pytest.mark.parametrize(("changed", "runs"), [("redo", 6), ("keep", 0)])
def test_results_of_other_code_are_refused_until_told_what_to_do(
    copied, monkeypatch, changed, runs
):
    monkeypatch.setattr(design, "code_version", lambda: "another")
    with pytest.raises(RunDirectoryError, match="6 of the same scenarios, by other code"):
        run(small(**ROWS), copied)
    executor = CountingExecutor()
    counts, _ = run(small(**ROWS), copied, executor, changed=changed)
    assert (6, runs) == (counts.complete, len(executor.ran))


@pytest.mark.parametrize("name", ["thesis.txt", "plan.parquet"])  # a plan without a lock
def test_a_folder_with_something_else_is_refused(tmp_path, name):
    (tmp_path / name).write_text("precious")
    with pytest.raises(RunDirectoryError, match="holds no study"):
        run(small(), tmp_path)


@pytest.mark.parametrize("last", ["lock", "scenarios.parquet", "plan.parquet"])
def test_a_study_that_was_killed_while_it_began_is_run(undisturbed_dir, tmp_path, last):
    """One of a thousand kills left the plan without `study.json`, and the folder was refused."""
    written = ["lock", "scenarios.parquet", "plan.parquet", "study.json"]
    number = written.index(last) + 1
    (tmp_path / "lock").touch()
    for name in written[1:number]:
        shutil.copy(undisturbed_dir / name, tmp_path)
    (tmp_path / f"{written[number]}.partial").write_bytes(b"half")
    counts, _ = run(small(**ROWS), tmp_path)
    assert counts.complete == 6


def test_wrong_input_leaves_nothing_behind(tmp_path):
    with pytest.raises(ScenarioError):
        run(small(axes={SPEED: [0.3, "quick"]}), tmp_path / "study")
    axes = {"start": {"key": "users.ana.start", "values": ["attic"]}}
    with pytest.raises(ScenarioError):
        run(small(axes=axes), tmp_path / "study")
    assert [] == list(tmp_path.iterdir())


def test_two_processes_can_not_run_the_same_study(tmp_path):
    class Nested(SerialExecutor):
        def submit(self, function, /, *args, **kwargs) -> Future[Any]:
            with pytest.raises(RunDirectoryError, match="is being written by process"):
                run(small(), tmp_path / "study")
            return super().submit(function, *args, **kwargs)

    assert 6 == run(small(), tmp_path / "study", Nested())[0].complete


@pytest.fixture
def failing(tmp_path):
    """A study of whose variants one fails."""
    (tmp_path / "broken.py").write_text(BROKEN)
    own = {"type": f"{tmp_path.as_posix()}/broken:Fails", "period": "1 min"}
    axes = {"at": {"key": "algorithms.own.at", "values": [1, 2, 3]}}
    return {"base": base(algorithms={"own": own}), "axes": axes, "replicates": 1}


def test_a_variant_that_fails_is_kept_with_its_error_and_alone_is_run_again(failing, tmp_path):
    counts, study = run(failing, tmp_path / "study")
    assert (2, 1) == (counts.complete, counts.failed)
    (row,) = study.failures.to_dicts()
    assert (1, 2) == (row["variant"], row["at"])
    assert "no more" in row["error"]
    assert "broken.py" in row["trace"]
    assert 2 == study.scenario(1)["algorithms"]["own"]["at"]
    executor = CountingExecutor()
    counts, _ = run(failing, tmp_path / "study", executor)
    assert ([1], 1) == (executor.ran, counts.failed)


def test_with_fail_fast_the_first_failure_ends_the_study(failing, tmp_path):
    counts, _ = run(failing, tmp_path / "study", fail_fast=True)
    assert (1, 1, 1) == (counts.complete, counts.failed, counts.missing)


def test_a_file_that_changes_during_a_study_fails_its_variants(failing, tmp_path):
    class Meddling(SerialExecutor):
        def submit(self, function, /, *args, **kwargs) -> Future[Any]:
            with (tmp_path / "broken.py").open("a") as file:
                file.write("# changed\n")
            return super().submit(function, *args, **kwargs)

    counts, study = run(failing, tmp_path / "study", Meddling())
    assert 3 == counts.failed
    assert {driver.CHANGED_MESSAGE} == set(study.failures["error"])


@pytest.mark.slow
@pytest.mark.parametrize("workers", some([2, 1, 4], 3))
def test_results_are_the_same_with_any_number_of_workers(undisturbed_dir, tmp_path, workers):
    counts, study = run(small(**ROWS), tmp_path / "study", LocalExecutor(workers), workers)
    assert 6 == counts.complete
    assert digests(open_study(undisturbed_dir)) == digests(study)
    undisturbed = open_study(undisturbed_dir)
    assert undisturbed.arrow("room_share").to_table() == study.arrow("room_share").to_table()
