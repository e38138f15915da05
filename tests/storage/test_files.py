"""Files of a folder that others may have written: names, links, replacement, and the lock."""

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from tests.scenes import process

from fleet2d.errors import RunDirectoryError
from fleet2d.storage import files
from fleet2d.storage.files import (
    FolderLock,
    new_folder,
    path_in,
    refuse_links,
    replacing,
    scratch_folder,
    write_atomically,
)

LOCK_NAME = "run.lock"


@pytest.mark.parametrize(
    "name",
    [
        "", "/", ".", "..", "../x", "a/../../x", "/etc/passwd", "a//b", "a/", "a\\b", "a\n", "a\0b",
        "\x1b[31mred", "a\udcff", None, 3, ["a"],
    ],
)  # fmt: skip
def test_a_name_that_leads_elsewhere_is_refused(tmp_path, name):
    with pytest.raises(RunDirectoryError, match="which is not inside of it") as caught:
        path_in(tmp_path, name)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("name", ["run", "learned/ltp.npz", "tables/events/000001.parquet", "é b"])
def test_a_plain_name_is_a_path(tmp_path, name):
    assert tmp_path / name == path_in(tmp_path, name)


def test_links_and_devices_are_refused_wherever_they_are_on_the_way(tmp_path):
    folder, elsewhere = tmp_path / "folder", tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "file").write_text("theirs")
    folder.mkdir()
    (folder / "way").symlink_to(elsewhere)
    (folder / "file").symlink_to(elsewhere / "file")
    (folder / "nowhere").symlink_to(elsewhere / "nothing")
    os.mkfifo(folder / "pipe")
    for name in ("way", "way/file", "way/new", "file", "nowhere"):
        with pytest.raises(RunDirectoryError, match="is a link, which may lead anywhere"):
            path_in(folder, name)
    with pytest.raises(RunDirectoryError, match="is not a file, but a device or a pipe"):
        path_in(folder, "pipe")
    with pytest.raises(RunDirectoryError):
        refuse_links(folder)
    for path in folder.iterdir():
        path.unlink()
    refuse_links(folder, ("nothing",))


def test_the_folder_itself_may_be_a_link(tmp_path):
    (tmp_path / "first").mkdir()
    (tmp_path / "latest").symlink_to(tmp_path / "first")
    assert tmp_path / "latest" / "file" == path_in(tmp_path / "latest", "file")
    refuse_links(tmp_path / "latest")


def test_a_link_in_place_of_a_file_is_replaced(tmp_path):
    """`study.json.partial` led to a file of the user, which was overwritten."""
    theirs = tmp_path / "theirs"
    theirs.write_text("precious")
    for name in ("plan.json", "plan.json.partial"):
        (tmp_path / name).symlink_to(theirs)
        write_atomically(tmp_path / "plan.json", b"{}")
        assert not (tmp_path / "plan.json").is_symlink()
    assert "precious" == theirs.read_text()
    assert {"theirs", "plan.json"} == {path.name for path in tmp_path.iterdir()}


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_file_that_was_not_finished_leaves_the_old_one(tmp_path, error):
    file = tmp_path / "plan.json"
    file.write_text("old")

    def fail():
        with replacing(file) as handle:
            os.write(handle, b"ne")
            raise error("no more")

    with pytest.raises(error, match="no more"):
        fail()
    assert "old" == file.read_text()
    assert [file] == list(tmp_path.iterdir())


def test_a_file_is_on_the_disk_before_it_replaces_another(tmp_path, monkeypatch):
    """After a power cut, a name may else lead to a file without content."""
    done = []
    for name in ("write_all", "sync", "replace"):
        operation = getattr(files, name)
        monkeypatch.setattr(
            files, name, lambda *given, f=operation, n=name: (done.append(n), f(*given))
        )
    write_atomically(tmp_path / "plan.json", b"{}")
    assert ["write_all", "sync", "replace"] == done


@pytest.mark.parametrize("path", [".", "/"])
def test_a_path_without_a_name_is_no_file(path):
    with pytest.raises(OSError, match="Is a directory"):
        write_atomically(Path(path), b"{}")


def test_a_lock_that_is_left_over_is_no_hindrance(tmp_path):
    (tmp_path / LOCK_NAME).write_text("process 1 on another machine")
    lock = FolderLock(tmp_path, LOCK_NAME)
    lock.release()
    assert [] == list(tmp_path.iterdir())


@pytest.mark.slow
def test_only_one_of_many_takes_the_lock(tmp_path):
    code = (
        "import sys, time; from pathlib import Path; from fleet2d.storage.files import FolderLock\n"
        f"try: FolderLock(Path({str(tmp_path)!r}), 'run.lock'); print('mine'); time.sleep(2)\n"
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


def test_a_folder_that_could_not_be_made_leaves_nothing(tmp_path):
    def make():
        with new_folder(tmp_path / "bag") as made:
            made.mkdir()
            (made / "half").touch()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make()
    assert [] == list(tmp_path.iterdir())


def test_what_a_killed_process_left_of_a_folder_is_replaced(tmp_path):
    left = tmp_path / "bag.partial" / "bag"
    left.mkdir(parents=True)
    (left / "half").touch()
    with new_folder(tmp_path / "bag") as made:
        made.mkdir()
        (made / "whole").touch()
    assert ["bag", "bag/whole"] == sorted(
        path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")
    )


def test_a_link_in_place_of_what_was_left_is_removed_and_not_followed(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "file").touch()
    (tmp_path / "bag.partial").symlink_to(tmp_path / "mine")
    with new_folder(tmp_path / "bag") as made:
        made.mkdir()
    assert (tmp_path / "mine" / "file").exists()
    assert not (tmp_path / "bag.partial").is_symlink()


@pytest.mark.parametrize("kind", ["folder", "file", "link"])
def test_a_folder_that_is_there_is_not_replaced(tmp_path, kind):
    path = tmp_path / "bag"
    if kind == "link":
        path.symlink_to(tmp_path / "nowhere")
    else:
        path.mkdir() if kind == "folder" else path.touch()
    with pytest.raises(FileExistsError), new_folder(path):
        raise AssertionError
    assert ["bag"] == [entry.name for entry in tmp_path.iterdir()]


def test_the_scratch_folder_of_a_killed_process_is_removed_by_the_next(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    code = (
        "import os, signal, sys; from fleet2d.storage.files import scratch_folder\n"
        "with scratch_folder('homes-') as folder:\n"
        "    (folder / 'home').write_text('walls')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)"
    )
    killed = process("-c", code, TMPDIR=str(tmp_path))
    (left,) = tmp_path.iterdir()
    (tmp_path / "homes-of-another").mkdir()  # without our lock

    with scratch_folder("homes-") as first, scratch_folder("homes-") as second:
        assert (-signal.SIGKILL, False) == (killed.returncode, left.exists())
        assert first.is_dir()
        assert second.is_dir()
    assert ["homes-of-another"] == [path.name for path in tmp_path.iterdir()]
