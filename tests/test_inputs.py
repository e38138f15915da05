"""Input files: a pipe never blocks, and within a root nothing else is opened."""

import os
import signal
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import fleet2d
from fleet2d.configuration.trust import running_code
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.inputs import input_path, open_input, resolved, sha256_of_file, within
from fleet2d.learning.fit.perception import read_detections
from fleet2d.scenario.load import load_scenario

BASE = "extends: bundled:paper\nsimulation: {duration: 1 min}\n"


# --- What is no file -----------------------------------------------------------------------------


@pytest.fixture
def pipe(tmp_path):
    """A pipe that nobody writes; a test that waits for it fails."""

    def fail(*_):
        raise AssertionError("it waited for a pipe")

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(20)
    path = tmp_path / "pipe.yaml"
    os.mkfifo(path)
    yield path
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def test_a_file_is_read(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(b"content")

    with open_input(path) as file:
        assert file.read() == b"content"
    assert sha256_of_file(path).startswith("ed7002b439e9")


def test_pipes_sockets_devices_and_folders_are_refused(pipe, tmp_path):
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "socket"))
        for path in (pipe, tmp_path / "socket", Path("/dev/zero")):
            with pytest.raises(InputError, match="is a device or a pipe: give a file"):
                open_input(path)
    with pytest.raises(IsADirectoryError):
        open_input(tmp_path)


def test_a_pipe_in_place_of_a_checked_file_is_refused(pipe, monkeypatch):
    monkeypatch.setattr("fleet2d.inputs.input_path", lambda path, _: path)

    with pytest.raises(InputError, match="is a device or a pipe: give a file"):
        open_input(pipe)


def test_a_link_in_place_of_a_checked_file_is_not_followed(tmp_path, monkeypatch):
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
def test_no_reader_waits_for_a_pipe(pipe, read):
    with pytest.raises(Fleet2DError) as caught:
        read(pipe)
    assert str(caught.value).count("\n") == 0


@pytest.mark.parametrize("suffix", [".json", ".pgm", ".svg", ".dxf", ".ifc", ".sh3d", ".geojson"])
def test_no_format_of_plans_waits_for_a_pipe(pipe, suffix):
    with pytest.raises(Fleet2DError):
        load_floorplan(pipe.rename(pipe.with_suffix(suffix)))


# --- Roots ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["../secret", "/etc/passwd", "link", "a/../../secret", "absent/.."]
)
def test_paths_out_of_a_root_are_refused(tmp_path, name):
    root = tmp_path / "root"
    (root / "a").mkdir(parents=True)
    (tmp_path / "secret").write_text("1234")
    (root / "link").symlink_to("../secret")

    with within(root):
        for use in (open_input, input_path, resolved):
            if name == "absent/..":
                assert resolved(root / name) == root
            else:
                with pytest.raises(InputError, match="is outside of the folder"):
                    use(root / name)
    assert resolved("/etc") == Path("/etc").resolve()


def test_links_inside_of_a_root_and_the_package_are_read(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "link").symlink_to("file")

    with within(tmp_path):
        open_input(tmp_path / "link").close()
        assert list(load_scenario("bundled:paper").users) == ["ana"]


@pytest.mark.parametrize("name", ["a\0b", "\ud800"])
def test_what_is_no_name_is_refused(name):
    with pytest.raises(InputError, match="can't be the name of a file") as caught:
        open_input(name)
    str(caught.value).encode()


OPENED = None
"""The paths that were opened, while a test records them."""


def note_opened(event, arguments):
    """Record a file, also one that is refused afterwards; the hook can't be removed again."""
    if OPENED is not None and event in ("open", "sqlite3.connect", "os.listdir", "os.scandir"):
        OPENED.append(str(arguments[0]))


sys.addaudithook(note_opened)


@contextmanager
def recorded() -> Iterator[list[str]]:
    """Yield the paths that are opened in the block."""
    global OPENED
    OPENED = []
    try:
        yield OPENED
    finally:
        OPENED = None


def outside_of(opened, folder: Path):
    """Return which paths lead into the folder of secrets, or to files of the system."""
    real = {os.path.realpath(path) for path in opened}
    secret = os.path.realpath(folder)
    return {path for path in real if path.startswith(secret) or path == "/etc/passwd"}


@pytest.fixture
def root(tmp_path):
    """A folder beside one of secrets, to which links in it lead."""
    secrets, root = tmp_path / "secrets", tmp_path / "root"
    secrets.mkdir()
    root.mkdir()
    (secrets / "s.yaml").write_text("users: {zara_secret: {type: meander}}\n")
    (secrets / "key.yaml").write_text("password: hunter2\n")
    (secrets / "persona.yaml").write_text("extends: retired\n")
    rows = [bytes(60)] * 4 + [bytes([0] * 4 + [254] * 52 + [0] * 4)] * 52 + [bytes(60)] * 4
    (secrets / "map.pgm").write_bytes(b"P5\n60 60\n255\n" + b"".join(rows))
    (secrets / "own_code.py").write_text("class Class: ...\n")
    (secrets / "log.txt").write_text("2026-01-05 00:00:00 hall\n")
    (secrets / "log.csv").write_text("time,x,y\n0,1,1\n")
    for suffix in (
        "json",
        "geojson",
        "svg",
        "dxf",
        "ifc",
        "sh3d",
        "mcap",
        "npz",
        "onnx",
        "parquet",
    ):
        (secrets / f"file.{suffix}").write_bytes(b"secret 1234")
    (root / "link").symlink_to(secrets)
    (root / "link.yaml").symlink_to(secrets / "s.yaml")
    (root / "extends.json").write_text('{"extends": "../secrets/s.yaml"}')
    (root / "key.json").write_text('{"extends": "../secrets/key.yaml"}')
    (root / "passwd.json").write_text('{"extends": "/etc/passwd"}')
    (root / "persona.json").write_text('{"extends": "../secrets/persona.yaml"}')
    ros = '{"image": "IMAGE", "resolution": 0.1, "origin": [0, 0, 0], "negate": 0, "occupied_thresh": 0.65,'
    ros += ' "free_thresh": 0.2}'
    (root / "map.json").write_text(ros.replace("IMAGE", "../secrets/map.pgm"))
    (root / "map.yaml").write_text(ros.replace("IMAGE", "link/map.pgm"))
    (root / "bag").mkdir()
    (root / "bag" / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    (root / "bag" / "file.mcap").symlink_to(secrets / "file.mcap")
    (root / "logs").mkdir()
    (root / "logs" / "log.txt").symlink_to(secrets / "log.txt")
    return root


EXTENDED = [
    "extends: ../secrets/s.yaml", "extends: link.yaml", "extends: link/s.yaml", "extends: key.json",
    "extends: [bundled:paper, extends.json]", "extends: passwd.json", "extends: /etc/passwd",
    "extends: ../secrets/../secrets/s.yaml", "extends: 'bundled:../../../../../../../etc/passwd'",
    "extends: ../secrets",
]  # fmt: skip
PLANS = [
    "{type: ros, path: map.json}", "{type: ros, path: map.yaml}",
    "{type: bag, path: bag}", "{type: bag, path: ../secrets/file.mcap}",
    "{type: image, path: ../secrets/map.pgm, resolution: 0.1}",
    *(
        f"{{type: {kind}, path: {folder}/file.{suffix}}}"
        for kind, suffix in (
            ("native", "json"), ("geojson", "geojson"), ("svg", "svg"), ("dxf", "dxf"),
            ("ifc", "ifc"), ("sweethome", "sh3d"), ("valetudo", "json"),
        )
        for folder in ("../secrets", "link")
    ),
    "../secrets/file.json",
]  # fmt: skip
USERS = [
    "{type: routine, persona: ../secrets/persona.yaml}", "{type: routine, persona: persona.json}",
    "{type: routine, persona: link/persona.yaml}", "{type: replay, path: logs}",
    "{type: replay, path: ../secrets/log.txt}", "{type: replay, path: ../secrets/log.csv}",
    "{type: replay, path: link/file.parquet}", "{type: replay, path: bag}",
    "{type: routine, persona: retired, household: ../secrets/s.yaml}",
]  # fmt: skip
MODELS = [
    "algorithms: {rtp: {type: real_time_presence, model: {type: learned, weights: ../secrets/file.npz}}}",
    "algorithms: {rtp: {type: real_time_presence, model: {type: onnx, file: ../secrets/file.onnx}}}",
    "robots: {astro: {type: policy, file: link/file.onnx}}",
    "algorithms: {x: {type: ../secrets/own_code.py:Class}}",
    "algorithms: {x: {type: process, command: ../secrets/s.yaml}}",
]
CASES = [
    *EXTENDED,
    *(f"{BASE}floorplan: {plan}" for plan in PLANS),
    *(f"{BASE}users: {{ana: {user}}}" for user in USERS),
    *(BASE + model for model in MODELS),
]


@pytest.mark.parametrize("text", CASES)
def test_nothing_outside_of_a_root_is_opened(root, text):
    (root / "home.yaml").write_text(text)

    refusal = "is outside of the folder|there is no image|is bundled|is a link|it hasn't run"
    with (
        recorded() as opened,
        within(root),
        running_code(allowed=False),
        pytest.raises(Fleet2DError, match=refusal) as caught,
    ):
        fleet2d.Simulation(root / "home.yaml").run()

    assert outside_of(opened, root.parent / "secrets") == set()
    assert str(root / "home.yaml") in opened
    assert [] == [s for s in ("zara", "hunter2", "root:x", "1234") if s in str(caught.value)]


def test_the_same_is_opened_without_a_root(root):
    (root / "home.yaml").write_text("extends: [bundled:paper, extends.json]")

    with recorded() as opened:
        assert "zara_secret" in load_scenario(root / "home.yaml").users

    assert outside_of(opened, root.parent / "secrets") == {str(root.parent / "secrets" / "s.yaml")}
