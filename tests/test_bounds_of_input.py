"""Whatever a file would unfold to, it is refused with the bound that it breaks, and how to raise it."""

import json
import os
import struct
import zlib
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fleet2d.algorithms.algorithm import load_learned
from fleet2d.artifacts.arrow import read_parquet
from fleet2d.artifacts.manifest import Manifest
from fleet2d.bounds import FILE_BYTES, one_line, read_bytes
from fleet2d.configuration.documents import parse, read_document
from fleet2d.errors import Fleet2DError, InputError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.logs.layout import read_log
from fleet2d.logs.layout import read_log as read_detections
from fleet2d.scenario.load import load_scenario

SMALL = {
    "VALUES": 20_000, "FILE_BYTES": 1_000_000, "LEARNED_BYTES": 1 << 20, "TABLE_BYTES": 1 << 20,
    "FIXES": 1 << 16, "JSON_VALUES": 10_000, "CORNERS": 1000, "POLYGONS": 100,
    "CROSSINGS": 100,
}  # fmt: skip
"""Bounds for these tests: the usual ones would take long to reach."""


@pytest.fixture(autouse=True)
def small_bounds(monkeypatch):
    for name, most in SMALL.items():
        monkeypatch.setenv(f"FLEET2D_MAX_{name}", str(most))


LAUGHS = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 10)
)
MERGES = "a0: &a0 {x: 1, y: 2}\n" + "".join(
    f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 9)}]}}\n" for n in range(1, 12)
)


MANY_ROWS = pa.table({name: np.zeros(1 << 17) for name in ("time", "x", "y")})


def png(columns, rows):
    """A picture of black pixels, a thousandth of what it unpacks to."""

    def chunk(kind, content):
        check = struct.pack(">I", zlib.crc32(kind + content))
        return struct.pack(">I", len(content)) + kind + content + check

    head = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    packed = zlib.compress(bytes(1000))
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")
    )


@pytest.mark.parametrize(
    ("text", "variable"),
    [
        (LAUGHS, "FLEET2D_MAX_VALUES"),
        ("[" * 100_000, "FLEET2D_MAX_DEPTH"),
        ("- " * 100_000, "FLEET2D_MAX_DEPTH"),
        ("".join(" " * n + "a:\n" for n in range(1000)), "FLEET2D_MAX_DEPTH"),
        ("a: [" + "1, " * 30_000 + "1]", "FLEET2D_MAX_VALUES"),
        ("a: " + "x" * 1_000_001, "FLEET2D_MAX_FILE_BYTES"),
    ],
    ids=["aliases", "brackets", "dashes", "levels", "values", "bytes"],
)
@pytest.mark.parametrize("kind", ["scenario", "plan"])
def test_yaml_that_unfolds_without_end_is_refused_at_once(tmp_path, text, variable, kind):
    path = tmp_path / "home.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=f"home.yaml.*set {variable}=") as caught:
        read_document(path) if kind == "scenario" else load_floorplan(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400


def test_merges_of_merges_are_no_more_than_their_keys(tmp_path):
    assert {"x": 1, "y": 2} == parse(MERGES)["a11"]
    path = tmp_path / "home.yaml"
    path.write_text(MERGES)
    assert {"x": 1, "y": 2} == read_document(path).data["a11"]


def test_what_is_merged_keeps_its_order_and_its_precedence():
    text = "a: &a {x: 1, y: 1}\nb: &b {y: 2, z: 2}\nc: {z: 3, <<: [*a, *b], w: 3}"
    assert {"y": 1, "z": 3, "x": 1, "w": 3} == parse(text)["c"]


@pytest.mark.parametrize(
    "text",
    [
        "a: &a {<<: *a}",
        "&a {b: {<<: {<<: *a}}}",
        "a: {<<: 3}",
        "a: {<<: [{x: 1}, 2]}",
        "a: &a [*a]",
        "? [1]\n: 2",
        "a: !!float ''",
        "a: !!bool maybe",
        "a: !!int 0xx",
        "a: !!binary xx",
        "a: !!set x",
        "a: !!python/object:os.system ls",
        "a: " + "9" * 5000,
    ],
)
def test_odd_yaml_is_refused_with_its_line(tmp_path, text):
    path = tmp_path / "home.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_document(path)
    assert str(caught.value).startswith(f"{path}:1: ")
    assert len(str(caught.value)) < 300 + len(str(path))


def bomb(name, folder: Path) -> tuple[Path, Callable[[Path], Any], str]:
    """A file that unfolds to gigabytes, its reader, and the bound that stops it."""
    path = folder / name
    match name:
        case "map.png":
            path.write_bytes(png(60_000, 60_000))
            return path, lambda p: load_floorplan(p, resolution=0.05), "PIXELS"
        case "map.pgm":
            path.write_bytes(b"P5 100000 100000 255\n")
            return path, lambda p: load_floorplan(p, resolution=0.05), "PIXELS"
        case "learned.npz":
            np.savez_compressed(path, counts=np.zeros(1 << 19))
            return path, load_learned, "LEARNED_BYTES"
        case "table.parquet":
            pq.write_table(MANY_ROWS, path)
            return path, read_parquet, "TABLE_BYTES"
        case "fixes.parquet":
            pq.write_table(MANY_ROWS, path)
            return path, read_log, "FIXES"
        case "plan.json":
            path.write_text('{"verts": [' + "[]," * 9_000 + "[]]}")
            return path, load_floorplan, "JSON_VALUES"
        case "plan.geojson":
            features = ",".join(['{"type":"Feature","properties":{},"geometry":null}'] * 101)
            path.write_text(f'{{"type": "FeatureCollection", "features": [{features}]}}')
            return path, load_floorplan, "POLYGONS"
        case "parts.geojson":
            squares = [[[[n, 0], [n + 1, 0], [n + 1, 1], [n, 0]]] for n in range(101)]
            geometry = {"type": "MultiPolygon", "coordinates": squares}
            room = {"type": "Feature", "properties": {"type": "room"}, "geometry": geometry}
            path.write_text(json.dumps({"type": "FeatureCollection", "features": [room]}))
            return path, load_floorplan, "POLYGONS"
        case "star.json" | "star.geojson":
            turns = np.arange(101) * (50 / 101 * 2 * np.pi)  # each edge crosses nearly all others
            corners = (5 + 5 * np.stack([np.cos(turns), np.sin(turns)], axis=1)).tolist()
            geometry = {"type": "Polygon", "coordinates": [[*corners, corners[0]]]}
            room = {"type": "Feature", "properties": {"type": "room"}, "geometry": geometry}
            geojson = {"type": "FeatureCollection", "features": [room]}
            path.write_text(json.dumps({"verts": corners} if name == "star.json" else geojson))
            return path, load_floorplan, "CROSSINGS"
        case "house.json":
            boxes = ",".join(["[0, 0, 2, 2]"] * 101)
            path.write_text(f'{{"verts":[[0,0],[4,0],[4,3]],"room_category":{{"Den":[{boxes}]}}}}')
            return path, load_floorplan, "POLYGONS"
        case "long.json":
            corners = ",".join(f"[{n / 100}, {n % 2 / 100}]" for n in range(1200))
            path.write_text(f'{{"verts":[{corners},[12, -5],[0, -5]]}}')
            return path, load_floorplan, "CORNERS"
        case "events.txt":
            lines = ["0001-01-01 10:00:00 Kitchen K ON", "2020-01-01 10:00:00 Kitchen K ON"]
            path.write_text("\n".join(lines))
            return path, read_log, "LOG_DAYS"
        case "adl.txt":
            row = "2011-11-28 10:21:24\t2011-11-28 10:23:36\tToileting\n"
            path.write_text(row.replace("2011", "0001") + row)
            return path, read_log, "LOG_DAYS"
        case "fixes.csv":
            path.write_text("time,x,y\n0,1,1\n99999999,2,2\n10000000,1,1\n2000000000,1,1\n")
            return path, lambda p: read_log(p, time_zone="UTC"), "LOG_DAYS"
    raise AssertionError(name)


@pytest.mark.parametrize(
    "name",
    [
        "map.png", "map.pgm", "learned.npz", "table.parquet", "fixes.parquet", "plan.json",
        "plan.geojson", "parts.geojson", "star.json", "star.geojson", "house.json", "long.json", "events.txt", "adl.txt",
        "fixes.csv",
    ],
)  # fmt: skip
def test_a_file_that_unfolds_to_gigabytes_is_refused(tmp_path, name):
    path, read, bound = bomb(name, tmp_path)
    with pytest.raises(Fleet2DError, match=f"set FLEET2D_MAX_{bound}=") as caught:
        read(path)
    assert path.name in str(caught.value)
    assert len(str(caught.value)) < 400 + len(str(tmp_path))


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("time,x,y\n0001-01-01 00:00:00,1,1\n2020-01-01 00:00:00,1,1\n", "line 2"),
        ("time,x,y\n1,1,1\n1e300,1,1\n", "line 3"),
        ("time,x,y\n1,1,1\ninf,1,1\n", "line 3"),
        ("time,x,y\n2020-01-01T00:00:00Z,1,1\n9999-12-31T23:59:59Z,1,1\n", "line 3"),
        ("time,x,y\n99999999999999999999,1,1\n", "line 2"),
        ("time,x,y\n1," + "9" * 400 + ",1\n", "rtls.csv"),
        ("time,x,y\n2020-01-01 00:00:00,1,1\n" + "x" * 5000 + ",1,1\n", "line 3"),
    ],
)
def test_a_time_out_of_all_bounds_is_named_with_its_line(tmp_path, text, word):
    path = tmp_path / "rtls.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=word) as caught:
        read_log(path, time_zone="Europe/Berlin")
    assert len(str(caught.value)) < 400 + len(str(path))


def test_a_heading_in_latin_1_is_no_traceback(tmp_path):
    path = tmp_path / "rtls.csv"
    path.write_bytes("zeit,x,y,höhe\n1,2,3,4\n".encode("latin-1"))
    with pytest.raises(InputError, match=r"rtls\.csv.*UTF-8"):
        read_log(path)
    path.write_bytes("distance,detected,höhe\n1,1,1\n".encode("latin-1"))
    with pytest.raises(InputError, match=r"rtls\.csv.*UTF-8"):
        read_detections(path)


@pytest.mark.parametrize("read", [read_document, load_floorplan, read_log, load_learned])
def test_devices_and_pipes_are_no_input(tmp_path, read):
    pipe = tmp_path / "plan.yaml"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero")):
        with pytest.raises(InputError, match=r"device or a pipe|no floor plan"):
            read(path)


def test_a_bound_is_raised_by_the_environment(tmp_path, monkeypatch):
    path = tmp_path / "home.yaml"
    path.write_text("[" * 70 + "]" * 70)
    with pytest.raises(InputError, match="FLEET2D_MAX_DEPTH=130"):
        read_document(path)
    monkeypatch.setenv("FLEET2D_MAX_DEPTH", "130")
    with pytest.raises(InputError, match="this is a list"):
        read_document(path)
    monkeypatch.setenv("FLEET2D_MAX_DEPTH", "many")
    with pytest.raises(InputError, match="FLEET2D_MAX_DEPTH: expected a whole number"):
        read_document(path)
    monkeypatch.setenv("FLEET2D_MAX_FILE_BYTES", "10")
    with pytest.raises(InputError, match="140 bytes, and at most 10"):
        read_bytes(path, FILE_BYTES)


@pytest.mark.parametrize(
    "override",
    [
        f"simulation.duration={'9' * 400} s",
        f"simulation.duration={'9' * 5000} s",
        f"simulation.duration={{days: {'9' * 400}}}",
        "simulation.duration=1e999 s",
        f"simulation.seed={'9' * 400}",
        f"users.ana.speed={'9' * 400}",
        f"floorplan.cell={'9' * 4000}",
        f"users.{'x' * 10_000}.type=meander",
        f"simulation.{'x' * 10_000}=1",
        f"users.ana.type={'x' * 10_000}",
        f"name=[{', '.join(['x'] * 5000)}]",
        f"simulation.start={'9' * 5000}",
        "simulation.start=0001-01-01",
        "simulation.seed=true",
        "simulation.speedup=1e-9",
        "floorplan=[1, 2]",
        "floorplan.type=[1]",
        "users.ana.type=[1]",
        "users=[1]",
        "floorplan=true",
        "metrics.distance.type={a: 1}",
        "algorithms.ltp.period=" + "9" * 400 + " s",
    ],
)
def test_no_message_echoes_more_than_a_line(override):
    with pytest.raises(InputError) as caught:
        load_scenario(override)
    for line in str(caught.value).splitlines():
        assert len(line) <= 1000, line
    assert len(str(caught.value)) < 2000


@pytest.mark.parametrize(
    "settings",
    [
        {"floorplan": {"type": "bundled", "cell": "x"}},
        {"floorplan": {"type": "bundled", "cell": [1]}},
        {"floorplan": {"type": "image", "path": "x.png", "resolution": {}}},
        {"floorplan": {"type": ["bundled"]}},
        {"floorplan": 3},
        {"users": {"ana": {"type": 4}}},
        {"users": {3: {"type": "meander"}}},
        {"seed": True},
        {"seed": 4.5},
        {"duration": timedelta.max},
        {"start": datetime.max},
        {"duration": float("nan")},
        {"max_span": True},
        {"speedup": 1e-9},
    ],
)
def test_wrong_values_from_python_are_no_tracebacks(settings):
    with pytest.raises(InputError):
        load_scenario("bundled:paper", **settings)


def test_a_large_manifest_is_not_read(tmp_path):
    with (tmp_path / "manifest.json").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(InputError, match="FLEET2D_MAX_FILE_BYTES"):
        Manifest.read(tmp_path)


def test_one_line_is_one_line():
    assert "a b" == one_line("a\n\n\tb")
    assert 60 == len(one_line("x " * 10**6))


def test_a_large_file_is_refused_before_it_is_read(tmp_path, monkeypatch):
    path = tmp_path / "large"
    path.write_bytes(bytes(SMALL["FILE_BYTES"] + 1))
    monkeypatch.setattr("fleet2d.bounds.open_input", lambda *_: pytest.fail("it was opened"))
    with pytest.raises(InputError, match="1000001 bytes, and at most 1000000 are read"):
        read_bytes(path, FILE_BYTES)


def test_a_file_that_has_grown_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "large"
    path.write_bytes(bytes(SMALL["FILE_BYTES"] + 7))
    monkeypatch.setattr("fleet2d.bounds.check_file", lambda *_: None)
    with pytest.raises(InputError, match="1000001 bytes, and at most 1000000 are read"):
        read_bytes(path, FILE_BYTES)
