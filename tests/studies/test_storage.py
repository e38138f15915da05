"""Where studies lie: folders, and an S3 server on this machine."""

import shutil
from collections.abc import Iterator

import polars as pl
import pyarrow as pa
import pyarrow.fs as pafs
import pytest
from tests.studies.scenes import CountingExecutor, digests, optional, run, small

from fleet2d.errors import ArtifactError, RunDirectoryError
from fleet2d.studies.directory import StudyDirectory
from fleet2d.studies.reader import open_study
from fleet2d.studies.storage import Storage

ROWS = small(keep={"tables": ["room_share"]})


@pytest.fixture(scope="module")
def server():
    """An S3 server on this machine: its address."""
    moto = optional("moto.server")
    running = moto.ThreadedMotoServer(port=0, verbose=False)
    running.start()
    _, port = running.get_host_and_port()
    yield f"127.0.0.1:{port}"
    running.stop()


@pytest.fixture
def location(server, tmp_path, monkeypatch):
    """Where a study lies on that server; the cache of this machine is empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    bucket = f"bucket-{abs(hash(tmp_path)) % 10**9}"
    pafs.S3FileSystem(
        access_key="key", secret_key="secret", endpoint_override=server, scheme="http",
        region="us-east-1", allow_bucket_creation=True,
    ).create_dir(bucket)  # fmt: skip
    options = f"endpoint_override={server}&scheme=http&region=us-east-1"
    return f"s3://key:secret@{bucket}/studies/speed?{options}"


def test_a_study_on_s3_is_the_same_as_in_a_folder(location, tmp_path):
    _, local = run(ROWS, tmp_path / "study")
    counts, remote = run(ROWS, location)
    assert 6 == counts.complete
    assert digests(local) == digests(remote)
    assert local.arrow("room_share").to_table() == remote.arrow("room_share").to_table()
    table = remote.polars("room_share").collect()
    assert 6 == table["variant"].n_unique()
    assert digests(local)[3] == remote.rerun(3).digest


def test_a_study_on_s3_goes_on_where_it_was_interrupted(location, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run(ROWS, location, CountingExecutor(2))
    assert 2 == open_study(location).counts.complete
    _, remote = run(ROWS, location)
    _, local = run(ROWS, tmp_path / "study")
    assert digests(local) == digests(remote)


def test_what_is_on_s3_is_there_for_another_machine(location, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run(ROWS, location, CountingExecutor(2))
    shutil.rmtree(tmp_path / "cache")
    assert 2 == open_study(location).counts.complete


def test_a_part_that_is_cut_on_s3_is_run_again(location):
    run(ROWS, location)
    Storage(location).write("results/000001.parquet", b"PAR1")
    counts, _ = run(ROWS, location)
    assert 6 == counts.complete


def test_a_location_that_is_none_is_refused():
    with pytest.raises(RunDirectoryError, match="can't be used as a store"):
        Storage("nowhere://bucket/study")


def test_secrets_in_a_location_are_not_printed():
    storage = Storage("s3://key:secret@bucket/study?region=us-east-1")
    assert "s3://bucket/study?region=us-east-1" == storage.location


@pytest.mark.slow
def test_a_server_that_does_not_answer_is_told(monkeypatch):
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
    gone = "s3://key:secret@bucket/study?endpoint_override=127.0.0.1:9&scheme=http&region=a"
    options = "&request_timeout=1&connect_timeout=1"
    try:
        directory = StudyDirectory(gone + options)
    except RunDirectoryError:  # some versions know no such options
        directory = StudyDirectory(gone)
    with pytest.raises((ArtifactError, RunDirectoryError), match=r"127.0.0.1|can't be reached"):
        directory.exists()


def test_a_file_location_is_a_folder_like_others(tmp_path):
    storage = Storage((tmp_path / "new" / "study").as_uri())
    storage.write("results/a.txt", b"a")
    assert b"a" == (tmp_path / "new" / "study" / "results" / "a.txt").read_bytes()
    assert str(tmp_path / "new" / "study") == storage.location


def test_files_are_whole_or_not_there(tmp_path):
    storage = Storage(tmp_path)
    storage.write("a/b.txt", b"whole")
    assert (["a/b.txt"], 5, b"whole") == (
        storage.names("a"), storage.size("a/b.txt"), storage.read("a/b.txt"),
    )  # fmt: skip
    storage.delete("a/b.txt")
    storage.delete("a/b.txt")
    assert (None, []) == (storage.size("a/b.txt"), storage.names("a"))


def test_a_table_that_ends_in_an_error_leaves_the_file_before(tmp_path):
    storage = Storage(tmp_path)
    table = pl.DataFrame({"variant": [1, 2]}).to_arrow()
    storage.write_table("plan.parquet", [table])

    def parts() -> Iterator[pa.Table]:
        yield table
        raise ArtifactError("no more")

    with pytest.raises(ArtifactError, match="no more"):
        storage.write_table("plan.parquet", parts())
    assert ["plan.parquet"] == [path.name for path in tmp_path.iterdir()]
    assert [1, 2] == storage.read_frame("plan.parquet")["variant"].to_list()
