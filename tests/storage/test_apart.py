"""The child process that reads foreign files: what it survives, and what its parent says."""

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Timer

import numpy as np
import pytest
import shapely
from tests.homes.formats import test_geojson

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.homes.formats.geojson import GeoJson
from fleet2d.storage import apart

SVG = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink">'


@pytest.fixture(autouse=True)
def end_children():
    yield
    apart._stop()


def good(folder: Path) -> Path:
    name, content = test_geojson.SAMPLE
    path = folder / name
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def endless(folder: Path) -> Path:
    """Write a drawing of 10 million copies, which refer to each other."""
    pytest.importorskip("svgelements")
    text = '<g id="a0"><rect class="wall" width="1" height="1"/></g>'
    for number in range(1, 8):
        copies = f'<use xlink:href="#a{number - 1}"/>' * 10
        text += f'<g id="a{number}">{copies}</g>'
    path = folder / "use.svg"
    path.write_text(f'{SVG}<defs>{text}</defs><use xlink:href="#a7"/></svg>')
    return path


def child():
    return apart._child.pid


def is_alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def soon(condition: Callable[[], bool]):
    end = time.monotonic() + 20
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return condition()


# --- One child ----------------------------------------------------------------------------------


def test_files_in_a_row_have_one_child(tmp_path):
    plan = load_floorplan(good(tmp_path))
    first = child()

    assert plan == load_floorplan(good(tmp_path))
    assert first == child()


def test_errors_of_the_reader_arrive_and_leave_the_child(tmp_path):
    path = good(tmp_path)
    plan = load_floorplan(path)
    first = child()
    damaged = tmp_path / "damaged.geojson"
    damaged.write_text('{"type": "FeatureCollection", "features": [7]}')

    with pytest.raises(FloorPlanError, match=r"damaged\.geojson: features\[0\] is 7"):
        load_floorplan(damaged)
    assert plan == load_floorplan(path)
    assert first == child()


def test_bounds_in_the_environment_hold_at_the_next_file(tmp_path, monkeypatch):
    path = good(tmp_path)
    load_floorplan(path)
    monkeypatch.setenv("FLEET2D_MAX_POLYGONS", "1")
    with pytest.raises(FloorPlanError, match="FLEET2D_MAX_POLYGONS"):
        load_floorplan(path)
    monkeypatch.delenv("FLEET2D_MAX_POLYGONS")

    load_floorplan(path)


def test_threads_share_a_child(tmp_path):
    path = good(tmp_path)
    with ThreadPoolExecutor(4) as threads:
        plans = list(threads.map(load_floorplan, [path] * 8))

    assert 1 == len(set(plans))


def _read_in_a_fork(path: Path, pids: "multiprocessing.Queue[int]"):
    load_floorplan(path)
    pids.put(child())


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_daemonic_forks_start_children_of_their_own(tmp_path):
    path = good(tmp_path)
    load_floorplan(path)
    context = multiprocessing.get_context("fork")
    pids = context.Queue()
    worker = context.Process(target=_read_in_a_fork, args=(path, pids), daemon=True)
    worker.start()
    other = pids.get(timeout=60)
    worker.join()

    assert other != child()
    assert soon(lambda: not is_alive(other))
    first = child()
    load_floorplan(path)
    assert first == child()


@pytest.mark.slow
def test_child_ends_with_its_parent(tmp_path):
    program = (
        "import sys, fleet2d; from fleet2d.storage import apart;"
        "fleet2d.load_floorplan(sys.argv[1]); print(apart._child.pid, flush=True);"
        "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"
    )
    command = [sys.executable, "-c", program, str(good(tmp_path))]
    pid = int(subprocess.run(command, stdout=subprocess.PIPE, check=False).stdout)

    assert soon(lambda: not is_alive(pid))


# --- Deaths -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ending", "message"),
    [
        (signal.SIGKILL, "its reader was killed, .* try again"),
        (signal.SIGSEGV, r"died \(SIGSEGV\)"),
    ],
)
def test_child_that_dies_is_an_error_and_the_next_file_has_another(tmp_path, ending, message):
    path = good(tmp_path)
    drawing = endless(tmp_path)
    load_floorplan(path)
    timer = Timer(0.5, os.kill, (child(), ending))
    timer.start()
    with pytest.raises(FloorPlanError, match=message):
        load_floorplan(drawing)
    timer.join()

    load_floorplan(path)


def test_dead_child_is_replaced_without_a_word(tmp_path):
    path = good(tmp_path)
    load_floorplan(path)
    first = child()
    os.kill(first, signal.SIGKILL)
    assert soon(lambda: apart._child is not None and apart._child.poll() is not None)

    load_floorplan(path)
    assert first != child()


@pytest.mark.slow
def test_time_is_limited(tmp_path, monkeypatch):
    monkeypatch.setenv("FLEET2D_MAX_READ_SECONDS", "1")

    with pytest.raises(FloorPlanError, match=r"longer to read than 1 seconds.*READ_SECONDS=2"):
        load_floorplan(endless(tmp_path))


@pytest.mark.slow
def test_processor_time_ends_before_the_clock_does(tmp_path, monkeypatch):
    ends = []
    death = apart._death
    monkeypatch.setattr(
        apart,
        "_death",
        lambda *death_of: (ends.append(death_of[-1]), death(*death_of))[1],
    )
    monkeypatch.setattr(apart, "PATIENCE", 20)
    monkeypatch.setenv("FLEET2D_MAX_READ_SECONDS", "1")

    with pytest.raises(FloorPlanError, match="takes longer to read than 1 seconds"):
        load_floorplan(endless(tmp_path))
    assert [-signal.SIGXCPU] == ends


def test_clock_limits_what_takes_no_processor_time(tmp_path, monkeypatch):
    monkeypatch.setattr(apart, "PATIENCE", 0.5)
    monkeypatch.setattr(apart, "_CODE", "import time; time.sleep(20)")
    monkeypatch.setenv("FLEET2D_MAX_READ_SECONDS", "1")
    begin = time.monotonic()

    with pytest.raises(FloorPlanError, match="takes longer to read than 1 seconds"):
        load_floorplan(good(tmp_path))
    assert time.monotonic() < begin + 15


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory")
def test_memory_is_limited(tmp_path, monkeypatch):
    monkeypatch.setenv("FLEET2D_MAX_READ_MB", "40")
    path = tmp_path / "home.pgm"
    path.write_bytes(b"P5\n4000 4000\n255\n" + bytes(4000 * 4000))

    with pytest.raises(FloorPlanError, match="more memory to read than 40 MB"):
        load_floorplan(path, resolution=0.05)
    load_floorplan(good(tmp_path))


def test_ctrl_c_leaves_no_answer_for_the_next_file(tmp_path):
    path = good(tmp_path)
    drawing = endless(tmp_path)
    plan = load_floorplan(path)
    first = child()
    timer = Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        load_floorplan(drawing)

    assert plan == load_floorplan(path)
    assert first != child()


# --- Answers ------------------------------------------------------------------------------------

FLAT = json.loads(apart._encode(FloorPlan.build("flat", shapely.box(0, 0, 2, 2))))


def changed(**changes):
    """Return an answer that is a plan but for some fields."""
    return json.dumps({"value": FLAT | changes}).encode()


def _short(content):
    return f"bytes({len(content)})" if content == bytes(len(content)) else repr(content)


def answering(content, length: int | None = None):
    """Return the program of a child that has one answer."""
    head = (len(content) if length is None else length).to_bytes(8, "big")
    return (
        "import sys, pickle; pickle.load(sys.stdin.buffer); pickle.load(sys.stdin.buffer);"
        f"sys.stdout.buffer.write({head!r}); sys.stdout.buffer.write({_short(content)});"
        "sys.stdout.flush(); sys.stdin.read()"
    )


def test_plan_arrives_as_it_was_built(tmp_path):
    path = good(tmp_path)
    source = GeoJson(path=path)
    built = source.read(source.contents())

    plan = source.load()

    assert {**vars(built), "mesh": None} == {**vars(plan), "mesh": None} | {
        name: getattr(built, name) for name in ("free", "room_of_cell")
    }
    for name in ("free", "room_of_cell"):
        np.testing.assert_array_equal(getattr(built, name), getattr(plan, name), strict=True)
    for name in ("vertices", "triangles", "neighbors"):
        arrays = [getattr(each.mesh, name) for each in (built, plan)]
        np.testing.assert_array_equal(*arrays, strict=True)


def test_coordinate_beyond_all_floats_is_refused():
    """JSON may spell infinity as a number, too, which no check of words refuses."""
    answer = changed(polygons=[{"#rings": [[[0, 0], [9, 0], [9, 9], [0, 9]]]}])
    apart._decode(answer, FloorPlan)
    with pytest.raises(ValueError, match="a coordinate is infinite"):
        apart._decode(answer.replace(b"[9, 0]", b"[1e999, 0]"), FloorPlan)


TRIANGLE = [[0, 0], [9, 0], [9, 9]]


@pytest.mark.parametrize(
    "answer",
    [
        b"garbage",
        b"\xff\xfe",
        b"{}",
        b"[]",
        b"7",
        b'{"value": null}',
        b'{"failure": {"kind": "code", "text": ""}}',
        b"[" * 100_000,
        b'{"value": [' + b"1," * 3_100_000 + b"1]}",
        changed(name=7),
        changed(lattice=FLAT["lattice"] | {"cell": "x"}),
        changed(lattice=FLAT["lattice"] | {"cell": float("nan")}),
        changed(free=None),
        changed(free={"#array": ["|b1", [9, 9], "AAAA"]}),
        changed(free={"#array": ["|O", [1], "AAAAAAAAAAA="]}),
        changed(free={"#array": ["|b1", [3], 7]}),
        changed(mesh={"#mesh": [7, 7, 7]}),
        changed(mesh={"#mesh": [FLAT["free"]] * 3}),
        changed(polygons=[{"#rings": [[[0, 0], [1, 1]]]}]),
        changed(polygons=[{"#rings": [["x"]]}]),
        changed(polygons=[{"#polygons": [7]}]),
        changed(objects=[{"name": "x"}]),
        changed(regions=[{"#rings": [TRIANGLE]}]),
    ],
    ids=lambda answer: answer[:40].decode("latin-1"),
)
def test_wrong_answer_is_refused(answer):
    with pytest.raises(apart.WRONG):
        apart._decode(answer, FloorPlan)


def test_answer_of_too_many_values_is_not_parsed(monkeypatch):
    apart._decode(changed(), FloorPlan)
    monkeypatch.setenv("FLEET2D_MAX_JSON_VALUES", "9")
    with pytest.raises(ValueError, match="too many values"):
        apart._decode(changed(), FloorPlan)


@pytest.mark.parametrize(
    ("answer", "length"),
    [(b"garbage", None), (bytes(1 << 26), 2**63)],
    ids=["garbage", "endless"],
)
def test_wrong_answer_is_an_error_of_one_line(tmp_path, monkeypatch, answer, length):
    monkeypatch.setenv("FLEET2D_MAX_READ_MB", "64")
    monkeypatch.setattr(apart, "_CODE", answering(answer, length))
    with pytest.raises(FloorPlanError, match="its reader gave no valid answer: export the file"):
        load_floorplan(good(tmp_path))


@pytest.mark.parametrize("length", [0, 9])
def test_short_answer_is_that_of_a_dead_child(tmp_path, monkeypatch, length):
    monkeypatch.setattr(apart, "_CODE", answering(b"", length).replace("sys.stdin.read()", ""))

    with pytest.raises(FloorPlanError, match=r"its reader died \(exit code 0\)"):
        load_floorplan(good(tmp_path))
