"""Packed files that unpack to gigabytes, or lie about it: weights, learned state, bags."""

import io
import os
import pickle
import re
import shutil
import sqlite3
import struct
import subprocess
import sys
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from tests.logs.ros import Ros

from fleet2d.algorithms.algorithm import load_learned
from fleet2d.algorithms.presence.learned import WEIGHTS, Weights
from fleet2d.errors import InputError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.homes.formats.bag import BagMap
from fleet2d.logs.bags import read_bag
from fleet2d.logs.detections import read_detections
from fleet2d.storage import apart

BOMBS = Path(__file__).parent / "bombs"


def peak_mb(code, path):
    """Run code in a process of its own; return its output, and the most memory that it took."""
    lines = (
        "from pathlib import Path",
        f"path = Path({str(path)!r})",
        code,
        "import resource",
        "from fleet2d.storage import apart",
        "apart._stop(1.0)",
        "child = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss",
        "status = Path('/proc/self/status').read_text()",
        "print(max(child, int(status.partition('VmHWM:')[2].split()[0])))",
    )
    command = [sys.executable, "-c", "\n".join(lines)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    said, _, peak = done.stdout.strip().rpartition("\n")
    return said, int(peak) / 1024


# Arrays

GOOD = dict(np.load(WEIGHTS))


def npy(shape, descr="'<f4'", data=b"", version=1):
    """An array whose header says anything."""
    head = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack("<H", len(head)) + head.encode() + data


def members(**changes):
    """The files of good weights, with some changed or left out."""
    files = {}
    for name, value in GOOD.items():
        buffer = io.BytesIO()
        np.lib.format.write_array(buffer, np.asanyarray(value))
        files[f"{name}.npy"] = buffer.getvalue()
    files |= {f"{name}.npy": new for name, new in changes.items() if new is not None}
    return {name: data for name, data in files.items() if changes.get(name[:-4], b"") is not None}


def packed(path, files, method=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


ZEROS = npy(f"({2 << 20},)", "'|u1'") + bytes(2 << 20)
DEEP = "{'descr': " + "(" * 4000 + "'f4'" + ")" * 4000 + "}"
ARRAYS = {
    "pickle": {"o": npy("(1,)", "'|O'", pickle.dumps([os.getpid]))},
    "pickle-weight": {"bias": npy("(32,)", "'|O'", pickle.dumps(np.zeros(32, object)))},
    "hugeshape": {"bias": npy("(100000000000,)")},
    "hugeshape2": {"bias": npy("(1000000000,)", data=bytes(64))},
    "overflowshape": {"bias": npy("(4611686018427387904, 4)")},
    "negshape": {"bias": npy("(-1,)")},
    "descr-bomb": {"bias": npy("(1,)", "'V2000000000'")},
    "text-bomb": {"bias": npy("(1,)", "'<U500000000'")},
    "badversion": {"bias": npy("(1,)", version=9)},
    "nonnpy": {"bias": b"hello"},
    "header-long": {"bias": b"\x93NUMPY\2\0" + struct.pack("<I", 2**31 - 1) + b" " * 100},
    "descr-deep": {"bias": b"\x93NUMPY\2\0" + struct.pack("<I", len(DEEP)) + DEEP.encode()},
}


@pytest.mark.parametrize("read", [Weights.read, load_learned])
@pytest.mark.parametrize("name", ARRAYS)
def test_a_forged_array_is_refused(tmp_path, name, read):
    path = packed(tmp_path / f"{name}.npz", members(**ARRAYS[name]))
    with pytest.raises(InputError, match=str(path)) as caught:
        read(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("read", [Weights.read, load_learned])
@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_an_archive_that_unpacks_to_more_than_the_bound_is_refused(
    tmp_path, method, read, monkeypatch
):
    monkeypatch.setenv("FLEET2D_MAX_LEARNED_BYTES", str(1 << 20))
    path = packed(tmp_path / "bomb.npz", members(z=ZEROS), method)
    with pytest.raises(InputError, match=r"at most|compressed in another way"):
        read(path)


def test_a_directory_that_states_less_than_a_member_unpacks_to_is_refused(tmp_path):
    path = packed(tmp_path / "forged-size.npz", {"z.npy": ZEROS}, zipfile.ZIP_DEFLATED)
    content = bytearray(path.read_bytes())
    at = content.rfind(b"PK\1\2")
    content[at + 24 : at + 28] = struct.pack("<I", 100)
    path.write_bytes(content)
    with pytest.raises(InputError, match="is not a file of learned state"):
        load_learned(path)


def test_an_archive_with_a_hundred_thousand_arrays_is_refused(tmp_path):
    path = packed(tmp_path / "many.npz", {f"{n}.npy": b"" for n in range(30_000)})
    with pytest.raises(InputError, match="too many arrays"):
        load_learned(path)


def test_an_array_that_is_there_twice_is_refused(tmp_path):
    path = packed(tmp_path / "dup.npz", members())
    with pytest.warns(UserWarning, match="Duplicate"), zipfile.ZipFile(path, "a") as archive:
        archive.writestr("bias.npy", npy("(32,)", data=np.full(32, np.nan, "<f4").tobytes()))
    with pytest.raises(InputError, match="'bias' twice"):
        Weights.read(path)


def test_an_array_that_is_no_weight_is_refused(tmp_path):
    path = packed(tmp_path / "more.npz", members(z=npy("(1,)", data=bytes(4))))
    with pytest.raises(InputError, match="has 'z', which is no part of a model"):
        Weights.read(path)


@pytest.mark.parametrize("read", [Weights.read, load_learned])
@pytest.mark.parametrize("kind", ["fifo", "dev", "dir", "empty", "text", "trunc", "encrypted"])
def test_what_is_no_archive_is_refused(tmp_path, kind, read):
    path = tmp_path / f"{kind}.npz"
    match kind:
        case "fifo":
            os.mkfifo(path)
        case "dev":
            path.symlink_to("/dev/zero")
        case "dir":
            path.mkdir()
        case "encrypted":
            content = bytearray(WEIGHTS.read_bytes())
            content[content.find(b"PK\3\4") + 6] |= 1
            content[content.find(b"PK\1\2") + 8] |= 1
            path.write_bytes(content)
        case _:
            whole = WEIGHTS.read_bytes()
            path.write_bytes({"empty": b"", "text": b"hello", "trunc": whole[:-200]}[kind])
    with pytest.raises(InputError, match=str(path)):
        read(path)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the memory isn't known")
def test_bomb_bz2_is_refused_before_it_fills_the_memory():
    """19 kB took 4.6 GB."""
    code = (
        "from fleet2d.algorithms.presence.learned import Weights\n"
        "try: Weights.read(path)\nexcept Exception as error: print(error)"
    )
    said, peak = peak_mb(code, BOMBS / "bomb-bz2.npz")
    assert "compressed in another way" in said or "at most 1048576 are read" in said
    assert peak < 600


# Bags

rosbags = pytest.importorskip("rosbags")
POSE, GRID = "geometry_msgs/msg/PoseStamped", "nav_msgs/msg/OccupancyGrid"


@cache
def ros():
    return Ros(2)


def poses():
    rows = []
    for ns in range(10**9, 10**11, 10**9):
        message = ros().new(POSE, ros().header(ns, "map"), ros().pose(1.0, 2.0, 0.0))
        rows.append(("/pose", POSE, ns, message))
    return rows


def grid(side, x=0.0):
    cells = np.zeros((side, side))
    return [("/map", GRID, 10**9, ros().grid(10**9, cells, ros().pose(x, 0.0, 0.0)))]


@pytest.fixture(params=["SQLITE3", "MCAP"])
def storage(request):
    return str(request.param)


@pytest.fixture
def good(tmp_path):
    return ros().bag(tmp_path / "bag", poses())


def database(folder):
    return next(folder.glob("*.db3"))


def tamper(folder, *statements, values=()):
    connection = sqlite3.connect(database(folder))
    for statement in statements:
        connection.execute(statement, values)
    connection.commit()
    connection.close()


def zstd(content):
    return pa.compress(content, "zstd", asbytes=True)


def pack_database(folder, content=None):
    """Pack the database of a bag, or other content in its place."""
    file = database(folder)
    packed_file = folder / f"{file.name}.zstd"
    packed_file.write_bytes(zstd(file.read_bytes() if content is None else content))
    file.unlink()
    compress(folder, "file")
    metadata = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(metadata.replace(file.name, packed_file.name))


def compress(folder, mode):
    """Say that messages, or files, are compressed."""
    path = folder / "metadata.yaml"
    text = path.read_text()
    text = text.replace("compression_format: ''", "compression_format: zstd")
    path.write_text(text.replace("compression_mode: ''", f"compression_mode: {mode}"))


def refusal(path, read=read_bag):
    with pytest.raises(InputError) as caught:
        read(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def limit_memory(monkeypatch):
    """Let a new child, which has no memory yet, take 60 MB."""
    monkeypatch.setenv("FLEET2D_MAX_READ_MB", "60")
    apart._stop()


def read_map(path):
    return BagMap(path=path).load()


def test_a_good_bag_is_read_packed_and_not(tmp_path, good, storage):
    assert 99 == len(read_bag(ros().bag(tmp_path / storage, poses(), storage)).time_us)
    connection = sqlite3.connect(database(good))
    connection.create_function("zstd", 1, zstd)
    connection.execute("UPDATE messages SET data=zstd(data)")
    connection.commit()
    connection.close()
    compress(good, "message")
    assert 99 == len(read_bag(good).time_us)


def test_a_good_bag_whose_file_is_packed_is_read(good):
    pack_database(good)
    assert 99 == len(read_bag(good).time_us)


@pytest.mark.parametrize("read", [read_bag, read_detections, load_floorplan])
def test_bomb_mcap_is_refused(read, monkeypatch):
    monkeypatch.setenv("FLEET2D_MAX_READ_MB", "200")
    assert "FLEET2D_MAX_READ_MB" in refusal(BOMBS / "bomb-mcap.mcap", read)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the memory isn't known")
def test_bomb_mcap_is_refused_before_it_fills_the_memory():
    """48 kB took 3.1 GB."""
    code = (
        "from fleet2d.logs.bags import read_bag\n"
        "try: read_bag(path)\nexcept Exception as error: print(error)"
    )
    said, peak = peak_mb(code, BOMBS / "bomb-mcap.mcap")
    assert "FLEET2D_MAX_READ_MB" in said
    assert peak < 900


def test_bomb_of_zstd_in_the_messages_of_a_database_is_refused(good, monkeypatch):
    limit_memory(monkeypatch)
    tamper(good, "UPDATE messages SET data=?", values=(zstd(bytes(65 << 20)),))
    compress(good, "message")
    assert "FLEET2D_MAX_READ_MB" in refusal(good)


@pytest.mark.skipif(os.name != "posix", reason="only Unix limits the size of files")
def test_file_that_unpacks_to_more_than_a_log_has_is_refused(good, monkeypatch):
    monkeypatch.setenv("FLEET2D_MAX_LOG_BYTES", str(64 << 20))
    pack_database(good, bytes(65 << 20))
    assert "File too large" in refusal(good)


def test_a_large_blob_is_refused(good, monkeypatch):
    limit_memory(monkeypatch)
    tamper(good, "UPDATE messages SET data=zeroblob(65000000) WHERE id=1")
    assert "memory" in refusal(good)


REBUILT = {
    "sqlx-endless": (
        "CREATE VIEW messages AS WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n+1 FROM r)"
        " SELECT n AS id, 1 AS topic_id, n AS timestamp, x'00' AS data FROM r",
    ),
    "sqlx-generated": (
        "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,"
        " data BLOB AS (zeroblob(900000000)))",
        "INSERT INTO messages (topic_id, timestamp) VALUES (1, 1)",
    ),
}


@pytest.mark.parametrize("name", REBUILT)
def test_a_database_that_computes_its_rows_is_refused(good, name, monkeypatch):
    """A view of endless rows was read for ever."""
    limit_memory(monkeypatch)
    monkeypatch.setenv("FLEET2D_MAX_BAG_SECONDS", "1")
    tamper(good, "ALTER TABLE messages RENAME TO m0", *REBUILT[name])
    assert re.search("FLEET2D_MAX|out of memory|missing tables", refusal(good))


TAMPERED = {
    "nulldata": ("UPDATE messages SET data=zeroblob(0)",),
    "textdata": ("UPDATE messages SET data='hello', timestamp='x'",),
    "badtopic": ("UPDATE messages SET topic_id=99",),
    "badtype": ("UPDATE topics SET type='evil/msg/Evil'",),
    "typepath": ("UPDATE topics SET type='../../../etc/passwd'",),
    "notables": ("DROP TABLE messages", "DROP TABLE topics"),
}


@pytest.mark.parametrize("name", TAMPERED)
def test_a_tampered_database_is_refused(good, name):
    tamper(good, *TAMPERED[name])
    assert str(good) in refusal(good)


@pytest.mark.parametrize("name", ["trunc", "flip", "text", "zero"])
def test_a_damaged_bag_is_refused(tmp_path, storage, name):
    folder = ros().bag(tmp_path / "bag", poses(), storage)
    path = next(p for p in folder.iterdir() if p.suffix in (".db3", ".mcap"))
    whole = path.read_bytes()
    flipped = bytes(b ^ 0x55 if 16 < i < 4000 else b for i, b in enumerate(whole))
    content = {"trunc": whole[: len(whole) // 2], "flip": flipped, "text": b"hello", "zero": b""}
    path.write_bytes(content[name])
    assert str(folder) in refusal(folder)


METADATA = {
    "empty": lambda text: "",
    "list": lambda text: "[1, 2]",
    "deep": lambda text: "[" * 5000 + "]" * 5000,
    "big": lambda text: text + "\nz: [" + ",".join(["1"] * 3_000_000) + "]",
    "passwd": lambda text: text.replace("bag.db3", "/etc/passwd"),
    "outside": lambda text: text.replace("bag.db3", "../../../../../../etc/passwd"),
    "tag": lambda text: '!!python/object/apply:os.system ["id"]\n' + text,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", METADATA)
def test_forged_metadata_is_refused(good, name, monkeypatch):
    monkeypatch.setenv("FLEET2D_MAX_BAG_SECONDS", "2")
    path = good / "metadata.yaml"
    path.write_text(METADATA[name](path.read_text()))
    assert str(good) in refusal(good)


@pytest.mark.parametrize("name", ["metadata.yaml", "bag.db3"])
@pytest.mark.parametrize("trick", ["link", "dev", "fifo"])
def test_a_link_or_a_pipe_in_a_bag_is_refused(tmp_path, good, name, trick):
    path = good / name
    shutil.move(path, tmp_path / name)
    if trick == "fifo":
        os.mkfifo(path)
    else:
        path.symlink_to(tmp_path / name if trick == "link" else "/dev/zero")
    assert f"{path} is " in refusal(good)


def test_mapfar_is_refused():
    """An origin of (1e300, NaN) ended in a traceback."""
    assert "its corner is at (1e+300, nan) m" in refusal(BOMBS / "mcap-mapfar", read_map)


@pytest.mark.parametrize("x", [np.inf, -1e300, np.nan])
def test_a_map_far_away_is_refused(tmp_path, storage, x):
    folder = ros().bag(tmp_path / "bag", grid(80, x), storage)
    assert "the map of /map is damaged" in refusal(folder, read_map)


@pytest.mark.slow
def test_a_map_of_many_cells_is_refused(tmp_path, storage):
    folder = ros().bag(tmp_path / "bag", grid(8000), storage)
    assert "has 64000000 pixels, and at most 16777216" in refusal(folder, read_map)


@pytest.mark.slow
def test_a_bomb_of_bz2_in_a_bag_of_ros_1_is_refused(tmp_path, monkeypatch):
    from rosbags.rosbag1 import Writer

    path = tmp_path / "old.bag"
    writer = Writer(path)
    writer.set_compression(Writer.CompressionFormat.BZ2)
    with writer:
        connection = writer.add_connection("/map", GRID, typestore=Ros(1).types)
        writer.write(connection, 10**9, bytes(65 << 20))
    limit_memory(monkeypatch)
    assert "FLEET2D_MAX_READ_MB" in refusal(path, load_floorplan)
