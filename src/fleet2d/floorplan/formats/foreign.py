"""Files of other programs, recognized by their content, and what to convert them to."""

import re
import zlib
from contextlib import suppress
from typing import Any

_VECTOR = "export the floor as DXF or SVG, or draw its walls in a picture"
_PICTURE = "save it as PNG"
_POINTS = "cut a slice of points between 0.3 m and 1.8 m above the floor, and save it as a picture"
_MESH = "save a section 1 m above the floor as DXF"
_BAG = "give it the ending .bag, .mcap or .db3; {type: bag, path: …} reads its map"
_MAP = "export one floor of it as GeoJSON"
_UNPACK = "unpack it, and name the floor plan in it"
_ROBOT = "save the map by map_saver as PGM and YAML"
_SCAN = "of an Apple RoomPlan scan, export the JSON"
_BUILDING = "export the floor as IFC, DXF or SVG"
_VACUUM = "save the map by Valetudo as JSON, or as a picture"
_BY_HAND = "write each room as a rectangle: see draw-your-flat.md in the docs"

# The first bytes of a file, what it is, and what to do.
_BEGINNINGS: tuple[tuple[bytes, str, str], ...] = (
    (b"GIF8", "a GIF picture", _PICTURE),
    (b"BM", "a BMP picture", _PICTURE),
    (b"II*\0", "a TIFF picture", _PICTURE),
    (b"MM\0*", "a TIFF picture", _PICTURE),
    (b"%PDF", "a PDF", "save the page as PNG, and give its resolution"),
    (b"%!PS", "PostScript", "save it as PNG"),
    (b"AC10", "a DWG drawing of AutoCAD", "save it as DXF"),
    (b"AutoCAD Binary DXF", "a binary DXF drawing", "save it as DXF in text"),
    (b"ISO-10303-21", "an IFC or STEP model", f"give an IFC model the ending .ifc; else {_VECTOR}"),
    (b"\xff\xfe\xff\x0eS\0k\0e\0t", "a SketchUp model", _MESH),
    (b"BLENDER", "a Blender scene", _MESH),
    (b"glTF", "a glTF model", _MESH),
    (b"PXR-USDC", "a USD model", _SCAN),
    (b"#usda", "a USD model", _SCAN),
    (b"ply\n", "a PLY model", _POINTS),
    (b"solid ", "an STL model", _MESH),
    (b"# .PCD", "a point cloud (PCD)", _POINTS),
    (b"LASF", "a point cloud (LAS)", _POINTS),
    (b"ASTM-E57", "a point cloud (E57)", _POINTS),
    (b"# Octomap", "an OctoMap", _ROBOT),
    (b"#ROSBAG", "a ROS 1 bag", _BAG),
    (b"\x89MCAP", "a recording (MCAP)", _BAG),
    (b"SQLite format 3", "a database, such as a ROS 2 bag or a GeoPackage", f"{_BAG}; or {_MAP}"),
    (b"\0\0\x27\x0a", "a shapefile", _MAP),
    (b"\x1f\x8b", "a packed file (gzip)", _UNPACK),
    (b"7z\xbc\xaf", "a packed file (7z)", _UNPACK),
    (b"Rar!", "a packed file (RAR)", _UNPACK),
    (b"\x93NUMPY", "a NumPy array", "save it as a picture"),
    (b"MATLAB", "a MATLAB file", "save the grid as a picture"),
    (b"v ", "an OBJ model", _MESH),
    (b"Kaydara FBX", "an FBX model", _MESH),
    (b"\xd0\xcf\x11\xe0", "a model of Revit or a document of Office", _BUILDING),
    (b"\xfd7zXZ\0", "a packed file (XZ)", _UNPACK),
    (b"rr\x14\0", "a map of a Roborock or Xiaomi vacuum", _VACUUM),
    (b"\xdb\x01\xf5\x5b\x7b\x1f\x1d\x7b", "a state of Cartographer", _ROBOT),
    (b"\x16\0\0\0\0\0\0\0serialization::archive", "a pose graph of slam_toolbox", _ROBOT),
)
# What the name of a file in a ZIP file contains, what the whole is, and what to do.
_MEMBERS = (
    (b"Home", "a home of Sweet Home 3D", "unpack it as a ZIP file, and name the Home.xml in it"),
    (b"xl/", "a spreadsheet", _BY_HAND),
    (b"word/", "a text document", _PICTURE),
    (b"visio/", "a drawing of Visio", "export it as SVG or DXF"),
    (b"3D/3dmodel", "a 3MF model", _MESH),
    (b".usd", "a USD model (USDZ)", _SCAN),
    (b".ifc", "a packed IFC model", _UNPACK),
    (b".kml", "KML", _MAP),
)
# What a text begins with, after white space and an XML declaration; a regular expression.
_TEXTS = (
    (r"<svg|<!DOCTYPE svg", "an SVG drawing", "give it the ending .svg"),
    (r"<home\b", "a home of Sweet Home 3D", "give it the ending .xml"),
    (r"<kml", "KML", _MAP),
    (r"<osm", "OpenStreetMap data", _MAP),
    (r"<(\w+:)?(CityModel|FeatureCollection)", "GML", _MAP),
    (r"<html|<!DOCTYPE html", "a web page", "download the file itself"),
    (r"<COLLADA", "a COLLADA model", _MESH),
    (r"<(sdf|world|robot)\b", "a model of Gazebo or URDF", _ROBOT),
    (r"<", "XML", _VECTOR),
    (r"#VRML", "a VRML model", _MESH),
    (r"((#|mtllib |o |g )[^\n]*\n)+v\s", "an OBJ model", _MESH),
    (r"VERSION [\d.]+\s+FIELDS", "a point cloud (PCD)", _POINTS),
    (r"define \w+ ", "a world of Stage", "name its bitmap, and give its resolution"),
    (r"[^\n{\[]*[,;\t][^\n]*\n[^\n{\[]*[,;\t]", "a table (CSV)", _BY_HAND),
    (r"\s*0\s*\n\s*SECTION", "a DXF drawing", "name it with the ending .dxf"),
)
# Keys of a JSON file, what it is, and what to do.
_KEYS = (
    (
        {"walls", "doors", "objects"},
        "a room scan (Apple RoomPlan)",
        "name it with the ending .json",
    ),
    ({"junctions", "planes"}, "a Structured3D annotation", _VECTOR),
    ({"merger", "redraw"}, "a Zillow indoor plan (ZInD)", _MAP),
    ({"mesh", "furniture", "scene"}, "a 3D-FRONT scene", _MESH),
    ({"proceduralParameters", "rooms"}, "a ProcTHOR house", "write its rooms as rectangles"),
    ({"floors", "designs"}, "a Floorplanner project (FML)", _VECTOR),
    ({"images", "annotations"}, "a COCO annotation", _MAP),
    ({"arcs", "objects"}, "TopoJSON", _MAP),
    ({"CityObjects"}, "CityJSON", _MAP),
    ({"asset", "meshes"}, "a glTF model", _MESH),
)


def foreign_file(content: bytes) -> str | None:
    """Return what a file is and what to convert it to, or None if that is unknown.

    Args:
        content: Its beginning, at least 1 kB of it if it is longer.

    Example:
        >>> foreign_file(b"GIF89a")
        'is a GIF picture, which Fleet2D does not read: save it as PNG'
        >>> foreign_file(b"{}") is None
        True
    """
    if content.startswith(b"\x1f\x8b"):
        with suppress(zlib.error):
            inner = foreign_file(zlib.decompressobj(31).decompress(content, 65536))
            if inner is not None:
                return f"is packed by gzip: unpacked it {inner}"
    for beginning, kind, advice in _BEGINNINGS:
        if content.startswith(beginning):
            return _sentence(kind, advice)
    if content.startswith(b"RIFF") and content[8:12] == b"WEBP":
        return _sentence("a WebP picture", _PICTURE)
    if content[4:8] == b"ftyp":
        return _sentence("a HEIC picture or a film", _PICTURE)
    if content.startswith(b"PK\x03\x04"):
        names = b"\n".join(re.findall(rb"PK\x03\x04.{26}([ -~]{1,200})", content, re.DOTALL))
        known = ((kind, advice) for part, kind, advice in _MEMBERS if part in names)
        return _sentence(*next(known, ("a packed file (ZIP)", _UNPACK)))
    text = content.decode("utf-8-sig", "replace")
    text = re.sub(r"\A(\s|<\?[^>]*\?>|<!--.*?-->)*", "", text, flags=re.DOTALL)
    for pattern, kind, advice in _TEXTS:
        if re.match(pattern, text, re.IGNORECASE):
            return _sentence(kind, advice)
    return None


def foreign_document(content: dict[str, Any]) -> str | None:
    """Return what a JSON file is by its keys and what to convert it to, or None if unknown."""
    for keys, kind, advice in _KEYS:
        if keys <= content.keys():
            return _sentence(kind, advice)
    return None


def _sentence(kind: str, advice: str) -> str:
    return f"is {kind}, which Fleet2D does not read: {advice}"
