import io
import json
import zipfile
from pathlib import Path

import pytest

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan


def zipped(name: str) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(name, "x" * 100)
    return file.getvalue()


FILES = {
    "plan.pdf": (b"%PDF-1.7\n%\xe2\xe3", "is a PDF", "save the page as PNG"),
    "plan.json": (b"%PDF-1.7\n", "is a PDF", "save the page as PNG"),
    "plan.dwg": (b"AC1032\0\0\0\xff", "is a DWG drawing", "save it as DXF"),
    "plan.stp": (b"ISO-10303-21;\nHEADER;", "is an IFC", "as DXF"),
    "plan.gif": (b"GIF89a\xff\xff", "is a GIF picture", "save it as PNG"),
    "plan.webp": (b"RIFF\x10\0\0\xffWEBPVP8 ", "is a WebP picture", "save it as PNG"),
    "plan.heic": (b"\0\0\0\x18ftypheic\xff", "is a HEIC picture", "save it as PNG"),
    "scan.ply": (b"ply\nformat ascii 1.0\n", "is a PLY model", "slice of points"),
    "scan.usdz": (zipped("scan.usdc"), "is a packed file (ZIP)", "unpack it"),
    "home.sh3d": (zipped("Home.xml"), "is a home of Sweet Home 3D", "Home.xml"),
    "map.json": (b"#ROSBAG V2.0\n\xff", "is a ROS 1 bag", "type: bag"),
    "map.osm": (b"<?xml version='1.0'?>\n<osm>", "is OpenStreetMap data", "GeoJSON"),
    "page.yaml": (b"<!DOCTYPE html><html>", "is a web page", "download the file"),
    "topo.json": (json.dumps({"arcs": [], "objects": {}}).encode(), "is TopoJSON", "GeoJSON"),
    "model.json": (json.dumps({"asset": {}, "meshes": []}).encode(), "is a glTF model", "section"),
}


@pytest.mark.parametrize("name", FILES)
def test_file_of_another_program_is_named_with_what_to_do(tmp_path: Path, name: str) -> None:
    content, kind, advice = FILES[name]
    (tmp_path / name).write_bytes(content)

    with pytest.raises(FloorPlanError) as caught:
        load_floorplan(tmp_path / name)

    assert kind in str(caught.value)
    assert advice in str(caught.value)
    assert name in str(caught.value)


def test_picture_of_another_kind_is_named(tmp_path: Path) -> None:
    (tmp_path / "plan.png").write_bytes(b"RIFF\x10\0\0\0WEBPVP8 ")

    with pytest.raises(FloorPlanError, match="is a WebP picture"):
        load_floorplan(tmp_path / "plan.png", resolution=0.05)


def test_text_that_is_no_known_format_is_said_to_be_no_json(tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text("hello")

    with pytest.raises(FloorPlanError, match="is not JSON: Expecting value in line 1"):
        load_floorplan(tmp_path / "plan.json")
