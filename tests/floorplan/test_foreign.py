import gzip
import io
import json
import zipfile

import pytest

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan


def zipped(name):
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
    "scan.usdz": (zipped("scan.usdc"), "is a USD model (USDZ)", "RoomPlan scan, export the JSON"),
    "plans.zip": (zipped("plan.json"), "is a packed file (ZIP)", "unpack it"),
    "rooms.xlsx": (zipped("xl/workbook.xml"), "is a spreadsheet", "draw-your-flat.md"),
    "plan.docx": (zipped("word/document.xml"), "is a text document", "save it as PNG"),
    "house.ifczip": (zipped("house.ifc"), "is a packed IFC model", "unpack it"),
    "house.rvt": (b"\xd0\xcf\x11\xe0\xa1\xb1", "is a model of Revit", "as IFC, DXF or SVG"),
    "house.fbx": (b"Kaydara FBX Binary  \0", "is an FBX model", "a section 1 m above"),
    "house.dae": (b"<?xml version='1.0'?><COLLADA>", "is a COLLADA model", "a section 1 m above"),
    "house.obj": (b"# exported\nmtllib a.mtl\no wall\nv 0 0 0\n", "is an OBJ model", "a section"),
    "cloud.pcd": (b"VERSION 0.7\nFIELDS x y z\n", "is a point cloud (PCD)", "slice of points"),
    "home.world": (b"<sdf version='1.6'/>", "is a model of Gazebo", "by map_saver"),
    "map.rrmap": (b"rr\x14\0\xff\0", "is a map of a Roborock", "by Valetudo"),
    "map.bin": (gzip.compress(b"rr\x14\0\xff"), "unpacked it is a map of a Roborock", "Valetudo"),
    "map.gz": (gzip.compress(b"unknown"), "is a packed file (gzip)", "unpack it"),
    "map.pbstream": (
        b"\xdb\x01\xf5\x5b\x7b\x1f\x1d\x7b\0",
        "is a state of Cartographer",
        "map_saver",
    ),
    "walls.csv": (b"x0,y0,x1,y1\n0,0,4,3\n", "is a table (CSV)", "each room as a rectangle"),
    "home.zip": (zipped("Home.xml"), "is a home of Sweet Home 3D", "the ending .sh3d"),
    "map.json": (b"#ROSBAG V2.0\n\xff", "is a ROS 1 bag", "type: bag"),
    "map.osm": (b"<?xml version='1.0'?>\n<osm>", "is OpenStreetMap data", "GeoJSON"),
    "page.yaml": (b"<!DOCTYPE html><html>", "is a web page", "download the file"),
    "topo.json": (json.dumps({"arcs": [], "objects": {}}).encode(), "is TopoJSON", "GeoJSON"),
    "model.json": (json.dumps({"asset": {}, "meshes": []}).encode(), "is a glTF model", "section"),
}


@pytest.mark.parametrize("name", FILES)
def test_file_of_another_program_is_named_with_what_to_do(tmp_path, name):
    content, kind, advice = FILES[name]
    (tmp_path / name).write_bytes(content)

    with pytest.raises(FloorPlanError) as caught:
        load_floorplan(tmp_path / name)

    assert kind in str(caught.value)
    assert advice in str(caught.value)
    assert name in str(caught.value)


def test_picture_of_another_kind_is_named(tmp_path):
    (tmp_path / "plan.png").write_bytes(b"RIFF\x10\0\0\0WEBPVP8 ")

    with pytest.raises(FloorPlanError, match="is a WebP picture"):
        load_floorplan(tmp_path / "plan.png", resolution=0.05)


def test_text_that_is_no_known_format_is_said_to_be_no_json(tmp_path):
    (tmp_path / "plan.json").write_text("hello")

    with pytest.raises(FloorPlanError, match="is not JSON: Expecting value in line 1"):
        load_floorplan(tmp_path / "plan.json")


def test_pictures_of_a_few_pixels_are_refused(tmp_path):
    (tmp_path / "map.pgm").write_bytes(b"P5\n4 4\n255\n" + bytes(16))

    with pytest.raises(FloorPlanError, match="without its scale"):
        load_floorplan(tmp_path / "map.pgm")
