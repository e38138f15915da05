"""Damaged files of every format are refused in plain words, or repaired with a note.

That anything wrong anywhere is read or refused is what `tests/fuzz` is for.
"""

import copy
import json
import math
import zlib
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import yaml

from fleet2d.configuration.components import components, lookup
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.homes.formats.drawing import Image
from fleet2d.homes.formats.ros import Ros

PIXELS = np.full((30, 40), 205, np.uint8)
PIXELS[2:-2, 2:-2] = 0
PIXELS[4:-4, 4:-4] = 254
PGM = b"P5\n# map\n40 30\n255\n" + PIXELS.tobytes()


def read_as(kind, path):
    """Read a file by the reader of a format."""
    source = lookup("floorplan", kind).model_construct(path=path)
    assert isinstance(source, FloorPlanSource)
    return source.load()


def formats():
    """Name, content and reader of the `SAMPLE` of each format's test, by the format."""
    paths = sorted(Path(__file__).parent.glob("formats/test_*.py"))
    names = [path.stem for path in paths if "\nSAMPLE" in path.read_text(encoding="utf-8")]
    modules = {name: import_module(f"tests.homes.formats.{name}") for name in names}
    modules["test_native"] = import_module("tests.floorplan.test_native")
    samples = {name.removeprefix("test_"): module.SAMPLE for name, module in modules.items()}
    samples["native as YAML"] = ("plan.yaml", samples["native"][1])
    return {k: (*sample, partial(read_as, k.split()[0])) for k, sample in samples.items()}


FORMATS = formats()
ROS = FORMATS["ros"][1]


def write(folder, name, content):
    path = folder / name
    dump = yaml.safe_dump if path.suffix == ".yaml" else json.dumps
    path.write_text(dump(content), encoding="utf-8")
    (folder / "map.pgm").write_bytes(PGM)
    return path


def png(width, height, rows):
    def chunk(kind, body):
        check = zlib.crc32(kind + body).to_bytes(4, "big")
        return len(body).to_bytes(4, "big") + kind + body + check

    head = width.to_bytes(4, "big") + height.to_bytes(4, "big") + bytes([8, 0, 0, 0, 0])
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


every_format = pytest.mark.parametrize("kind", FORMATS)


def read_ros(path):
    return Ros.model_construct(path=path).load()


def read_image(path, resolution):
    return Image.model_construct(path=path, resolution=resolution).load()


def refusal(read, path, *arguments):
    with pytest.raises(FloorPlanError) as caught:
        read(path, *arguments)
    assert path.name in str(caught.value)
    return str(caught.value)


def test_every_format_of_documents_has_a_sample():
    kinds = {k for k, source in components("floorplan").items() if getattr(source, "marks", ())}

    assert set() == kinds - set(FORMATS), "give tests/homes/formats/test_NAME.py a SAMPLE"


@every_format
def test_the_file_itself_is_read(tmp_path, kind):
    name, content, read = FORMATS[kind]
    path = write(tmp_path, name, content)

    plan = read(path)

    assert plan.area_m2 > 1
    assert plan == load_floorplan(path)


# --- Files that are none ----------------------------------------------------------------------------


@every_format
@pytest.mark.parametrize("share", [0.01, 0.3, 0.7, 0.95])
def test_truncated_file_is_refused_or_lacks_what_it_says(tmp_path, kind, share):
    name, content, read = FORMATS[kind]
    path = write(tmp_path, name, content)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])

    message = refusal(read, path)

    assert len(message) < 1000


RUBBISH = {
    "empty": b"",
    "null": b"null",
    "spaces": b"  \n \n",
    "bytes": bytes(range(256)) * 20,
    "zeros": bytes(5000),
    "number": b"3",
    "list": b"[1, 2, 3]",
    "deep lists": b"[" * 100_000,
    "deep objects": b'{"a":' * 100_000,
    "deep and closed": b'{"verts": ' + b"[" * 900 + b"]" * 900 + b"}",
    "long number": b'{"verts": [[' + b"9" * 10_000 + b", 1]]}",
    "bomb": b"a0: &a0 [1,1]\n"
    + b"".join(
        b"a%d: &a%d [%s]\n" % (n, n, b",".join([b"*a%d" % (n - 1)] * 9)) for n in range(1, 20)
    ),
    "circle": b"free: &a [*a]\n",
    "utf-16": '{"format": "fleet2d-floorplan"}'.encode("utf-16"),
}


@every_format
@pytest.mark.parametrize("rubbish", RUBBISH)
def test_rubbish_is_refused_in_a_few_words(tmp_path, kind, rubbish):
    name, content, read = FORMATS[kind]
    path = write(tmp_path, name, content)
    path.write_bytes(RUBBISH[rubbish])

    ways = (read, load_floorplan) if kind.startswith("native") else (read,)  # both suffixes once
    for way in ways:
        assert len(refusal(way, path)) < 1000


@every_format
def test_missing_file_and_folder_are_refused(tmp_path, kind):
    name, _, read = FORMATS[kind]

    assert ": check floorplan.path" in refusal(read, tmp_path / name)
    (tmp_path / name).mkdir()
    assert "is a folder: name the floor plan's file in it" in refusal(read, tmp_path / name)


# --- Outlines that are none -------------------------------------------------------------------------

OUTLINES = {
    "nan": [[0, 0], [4, math.nan], [4, 3], [0, 3]],
    "infinity": [[0, 0], [4, 0], [4, math.inf], [0, 3]],
    "zero area": [[0, 0], [4, 0], [2, 0]],
    "one point": [[1, 1]] * 9,
    "tiny": [[0, 0], [1e-9, 0], [1e-9, 1e-9]],
    "text": [["0", "0"], ["4", "0"], ["4", "3"]],
    "flat list": [0, 0, 4, 0, 4, 3],
    "whole world": [[-9e4, -9e4], [9e4, -9e4], [9e4, 9e4]],
    "beyond": [[0, 0], [1e300, 0], [1e300, 1e300]],
    "nothing": [],
    "null": None,
}


def with_outline(kind, outline):
    content = copy.deepcopy(FORMATS[kind][1])
    if kind == "houseexpo":
        content["verts"] = outline
    elif kind == "geojson":
        content["features"] = content["features"][:1]
        closed = outline + outline[:1] if isinstance(outline, list) else outline
        content["features"][0]["geometry"]["coordinates"] = [closed]
    else:
        content = {"format": "fleet2d-floorplan", "version": 1, "free": [{"outline": outline}]}
    return content


vector_format = pytest.mark.parametrize(
    "kind", ["native", "native as YAML", "houseexpo", "geojson"]
)


@vector_format
@pytest.mark.parametrize("outline", OUTLINES)
def test_invalid_outline_is_refused(tmp_path, kind, outline):
    name, _, read = FORMATS[kind]
    path = write(tmp_path, name, with_outline(kind, OUTLINES[outline]))

    assert len(refusal(read, path)) < 1000


@vector_format
def test_outline_that_crosses_itself_is_refused_or_repaired_with_a_note(tmp_path, kind):
    name, _, read = FORMATS[kind]
    path = write(tmp_path, name, with_outline(kind, [[0, 0], [4, 4], [4, 0], [0, 4]]))

    if kind.startswith("native"):
        assert "self-intersection at (2, 2) m" in refusal(read, path)
    else:
        plan = read(path)
        assert 8 == pytest.approx(plan.area_m2, abs=0.01)
        assert "touches or crosses itself at (2, 2)" in plan.notes[0]


@pytest.mark.parametrize(
    ("kind", "corners"),
    # YAML takes its time to be parsed, and HouseExpo's doorways to be found.
    [("native", 20_000), ("geojson", 12_000), ("native as YAML", 3000), ("houseexpo", 3000)],
)
def test_outline_of_very_many_corners_is_read(tmp_path, kind, corners):
    angles = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    circle = np.round(np.stack([8 * np.cos(angles), 8 * np.sin(angles)], axis=1), 7).tolist()
    name, _, read = FORMATS[kind]
    path = write(tmp_path, name, with_outline(kind, circle))

    assert 64 * np.pi == pytest.approx(read(path).area_m2, rel=1e-3)


@vector_format
def test_tiny_coordinate_is_zero(tmp_path, kind):
    """GEOS would divide by a tiny coordinate."""
    name, _, read = FORMATS[kind]
    path = write(tmp_path, name, with_outline(kind, [[0, 0], [1e-300, 0], [4, 3], [-1e-200, 3]]))

    assert 6 == pytest.approx(read(path).area_m2, abs=0.01)


# --- Images -----------------------------------------------------------------------------------------

IMAGES = {
    "empty": b"",
    "cut off": PGM[:-50],
    "too long": PGM + b"more",
    "no header": PIXELS.tobytes(),
    "other size": PGM.replace(b"40 30", b"41 30"),
    "no size": PGM.replace(b"40 30", b"0 30"),
    "huge": b"P5\n99999999 99999999\n255\n",
    "no white": PGM.replace(b"\n255\n", b"\n0\n"),
    "text": b"P2\n2 2\n255\n1 2 x 4\n",
    "jpeg": b"\xff\xd8\xff\xe0" + bytes(100),
    "png cut off": png(40, 30, zlib.compress(bytes(41 * 30)))[:-40],
    "png of other size": png(40, 30, zlib.compress(bytes(41 * 3))),
    "png not packed": png(40, 30, b"rubbish"),
    "png of no size": png(0, 30, zlib.compress(b"")),
    "png too large": png(60_000, 60_000, zlib.compress(b"")),
}


@pytest.mark.parametrize("image", IMAGES)
def test_damaged_image_is_refused(tmp_path, image):
    if image.startswith("png"):
        pytest.importorskip("PIL.Image")
    path = write(tmp_path, "map.yaml", ROS)
    (tmp_path / "map.pgm").write_bytes(IMAGES[image])

    assert "map.pgm" in refusal(read_ros, path)
    assert "map.pgm" in refusal(read_image, tmp_path / "map.pgm", 0.05)


def test_missing_image_is_refused(tmp_path):
    path = write(tmp_path, "map.yaml", ROS)
    (tmp_path / "map.pgm").unlink()

    assert "there is no image" in refusal(read_ros, path)
    assert "there is no file" in refusal(read_image, tmp_path / "map.pgm", 0.05)


@pytest.mark.parametrize("resolution", [0.0, -1.0, 2.0, math.nan, math.inf])
def test_invalid_resolution_is_refused(tmp_path, resolution):
    write(tmp_path, "map.yaml", ROS)

    assert "resolution is" in refusal(read_image, tmp_path / "map.pgm", resolution)
