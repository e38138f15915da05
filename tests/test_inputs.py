"""Input files: a pipe never blocks."""

import os
import signal
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import fleet2d
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.inputs import open_input, sha256_of_file
from fleet2d.learning.fit.perception import read_detections
from fleet2d.scenario.load import load_scenario

BASE = "extends: bundled:paper\nsimulation: {duration: 1 min}\n"


# --- What is no file -----------------------------------------------------------------------------


@pytest.fixture
def pipe(tmp_path: Path) -> Iterator[Path]:
    """A pipe that nobody writes; a test that waits for it fails."""

    def fail(*_: object) -> None:
        raise AssertionError("it waited for a pipe")

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(20)
    path = tmp_path / "pipe.yaml"
    os.mkfifo(path)
    yield path
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"content")

    with open_input(path) as file:
        assert file.read() == b"content"
    assert sha256_of_file(path).startswith("ed7002b439e9")


def test_pipes_sockets_devices_and_folders_are_refused(pipe: Path, tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "socket"))
        for path in (pipe, tmp_path / "socket", Path("/dev/zero")):
            with pytest.raises(InputError, match="is a device or a pipe: give a file"):
                open_input(path)
    with pytest.raises(IsADirectoryError):
        open_input(tmp_path)


def test_a_pipe_in_place_of_a_checked_file_is_refused(
    pipe: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fleet2d.inputs.input_path", lambda path, _: path)

    with pytest.raises(InputError, match="is a device or a pipe: give a file"):
        open_input(pipe)


def test_a_link_in_place_of_a_checked_file_is_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "secret").write_text("1234")
    (tmp_path / "link").symlink_to("secret")
    monkeypatch.setattr("fleet2d.inputs.input_path", lambda path, _: path)

    with pytest.raises(OSError, match="symbolic links"):
        open_input(tmp_path / "link")


@pytest.mark.parametrize(
    "read",
    [
        load_scenario,
        lambda path: load_scenario("bundled:paper", f"floorplan={{type: native, path: {path}}}"),
        lambda path: load_scenario(
            "bundled:paper", f"users.ana={{type: routine, persona: {path}}}"
        ),
        lambda path: load_scenario("bundled:paper", f"users.ana={{type: replay, path: {path}}}"),
        load_floorplan,
        read_detections,
        fleet2d.Simulation.load,
        sha256_of_file,
    ],
)
def test_no_reader_waits_for_a_pipe(pipe: Path, read: Callable[[Path], object]) -> None:
    with pytest.raises(Fleet2DError) as caught:
        read(pipe)
    assert str(caught.value).count("\n") == 0


@pytest.mark.parametrize("suffix", [".json", ".pgm", ".svg", ".dxf", ".ifc", ".sh3d", ".geojson"])
def test_no_format_of_plans_waits_for_a_pipe(pipe: Path, suffix: str) -> None:
    with pytest.raises(Fleet2DError):
        load_floorplan(pipe.rename(pipe.with_suffix(suffix)))


@pytest.mark.parametrize("name", ["a\0b", "\ud800"])
def test_what_is_no_name_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="can't be the name of a file") as caught:
        open_input(name)
    str(caught.value).encode()
