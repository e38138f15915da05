"""Homes for robots' programs: a map of ROS's map_server, and a world of Gazebo.

Both have the coordinates of the home: a pose in one is the same pose in the other and in a run.
"""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from fleet2d.configuration.problems import counted
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.furniture import FURNITURE
from fleet2d.floorplan.load import write_new
from fleet2d.floorplan.plan import FloorPlan

# Shades of a map's pixels as map_saver writes them; what it knows nothing of is 205.
FREE = 254
OCCUPIED = 0

WALL_HEIGHT_M = 2.5
OUTER_WALL_M = 0.15
# Objects on legs, such as tables, which hide nobody in a run, so that it has no height of them [m].
LEGS_HEIGHT_M = 0.75
# Metres are written to the tenth of a millimetre.
DIGITS = 4


def save_map(plan: FloorPlan, path: Path) -> None:
    """Write a map of ROS's map_server: a picture, `NAME.pgm`, and `NAME.yaml` beside it.

    Cells whose centre is in free space are free, all others occupied; so is furniture that blocks
    the way of robots, as a robot that had mapped this home would have it.

    Args:
        plan: The home.
        path: The picture.

    Raises:
        FloorPlanError: A file exists, or can't be written.

    Example:
        >>> import tempfile, fleet2d
        >>> folder = Path(tempfile.mkdtemp())
        >>> save_map(fleet2d.load_floorplan("family_home"), folder / "home.pgm")
        >>> print((folder / "home.yaml").read_text().splitlines()[0])
        image: home.pgm
    """
    lattice = plan.lattice
    free = plan.free.copy()
    blocks = [thing.footprint for thing in plan.objects if thing.blocks != "nothing"]
    if blocks:
        centres = lattice.to_metres(np.stack(np.meshgrid(*lattice.centre_axes()), axis=-1))
        free &= ~shapely.contains_xy(shapely.union_all(blocks), centres[..., 0], centres[..., 1])
    shades = np.where(free, FREE, OCCUPIED).astype(np.uint8)
    header = f"P5\n{lattice.columns} {lattice.rows}\n255\n".encode()
    x0, y0 = lattice.origin
    settings = (
        f"image: {path.name}\nmode: trinary\nresolution: {lattice.cell:g}\n"
        f"origin: [{x0:.{DIGITS}f}, {y0:.{DIGITS}f}, 0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    beside = path.with_suffix(".yaml")
    if path.exists():
        raise FloorPlanError(f"{path} exists already: remove it, or name another file")
    write_new(beside, settings.encode())
    # The first row of a picture is its top, that of the cells is the bottom.
    write_new(path, header + shades[::-1].tobytes())


def save_world(plan: FloorPlan, path: Path) -> None:
    """Write a world of Gazebo in SDF: walls, glass and furniture as upright blocks, and the floor.

    Doorways are open. Each block is a triangle of its outline, since outlines with holes and
    notches aren't taken by all physics engines.

    Args:
        plan: The home.
        path: The world's file.

    Raises:
        FloorPlanError: The file exists, or can't be written.

    Example:
        >>> import tempfile, fleet2d
        >>> path = Path(tempfile.mkdtemp()) / "home.sdf"
        >>> save_world(fleet2d.load_floorplan("family_home"), path)
        >>> [model.get("name") for model in ET.parse(path).findall("world/model")][:3]
        ['floor', 'walls', 'bench_1']
    """
    root = ET.Element("sdf", version="1.9")
    world = ET.SubElement(root, "world", name=plan.name)
    _sun(world)
    _floor(world, plan)
    free = plan.free_space
    panes = shapely.transform(MultiPolygon(plan.glass), plan.lattice.to_metres)
    around = free.buffer(OUTER_WALL_M, join_style="mitre")
    solid = shapely.difference(shapely.union_all([around, panes]), free)
    _model(world, "walls", solid.difference(panes), WALL_HEIGHT_M, "0.9 0.88 0.85 1")
    if plan.glass:
        _model(world, "glass", panes, WALL_HEIGHT_M, "0.7 0.85 0.95 0.3")
    for thing in plan.objects:
        if thing.blocks != "nothing":
            usual = FURNITURE[thing.type].height if thing.type in FURNITURE else 0
            height = thing.height or usual or LEGS_HEIGHT_M
            _model(world, thing.name, thing.footprint, height, "0.7 0.55 0.4 1")
    ET.indent(root)
    write_new(path, ET.tostring(root, encoding="utf-8", xml_declaration=True))


def left_out_for_robots(plan: FloorPlan) -> str:
    """Return what of a home neither a map nor a world holds, for a note.

    >>> import fleet2d
    >>> left_out_for_robots(fleet2d.load_floorplan("family_home"))
    'left out, as it holds only what stands in the way: 14 rooms, 14 doorways, 3 objects'
    """
    passable = sum(thing.blocks == "nothing" for thing in plan.objects)
    counts = {
        "room": len(plan.rooms),
        "doorway": len(plan.doorways),
        "object": passable,
        "no-go area": len(plan.no_go),
        "portal": len(plan.portals),
    }
    parts = [counted(number, noun) for noun, number in counts.items() if number]
    return f"left out, as it holds only what stands in the way: {', '.join(parts)}"


def _sun(world: ET.Element) -> None:
    light = ET.SubElement(world, "light", type="directional", name="sun")
    _texts(light, pose="0 0 10 0 0 0", diffuse="0.8 0.8 0.8 1", direction="-0.5 0.1 -0.9")


def _floor(world: ET.Element, plan: FloorPlan) -> None:
    x0, y0, x1, y1 = plan.bounds
    link = _link(world, "floor")
    _texts(link, pose=f"{(x0 + x1) / 2:.{DIGITS}f} {(y0 + y1) / 2:.{DIGITS}f} 0 0 0 0")
    for kind in ("collision", "visual"):
        part = ET.SubElement(link, kind, name=kind)
        plane = ET.SubElement(ET.SubElement(part, "geometry"), "plane")
        _texts(plane, normal="0 0 1", size=f"{x1 - x0 + 2:.2f} {y1 - y0 + 2:.2f}")


def _model(world: ET.Element, name: str, area: BaseGeometry, height: float, color: str) -> None:
    link = _link(world, name)
    parts = shapely.get_parts(shapely.get_parts(shapely.constrained_delaunay_triangles(area)))
    for number, triangle in enumerate(parts):
        for kind in ("collision", "visual"):
            part = ET.SubElement(link, kind, name=f"{kind}_{number}")
            _prism(ET.SubElement(part, "geometry"), triangle, height)
            if kind == "visual":
                _texts(ET.SubElement(part, "material"), ambient=color, diffuse=color)


def _prism(geometry: ET.Element, triangle: Polygon, height: float) -> None:
    line = ET.SubElement(geometry, "polyline")
    for x, y in triangle.exterior.coords[:-1]:
        ET.SubElement(line, "point").text = f"{x:.{DIGITS}f} {y:.{DIGITS}f}"
    _texts(line, height=f"{height:g}")


def _link(world: ET.Element, name: str) -> ET.Element:
    model = ET.SubElement(world, "model", name=name)
    _texts(model, static="true")
    return ET.SubElement(model, "link", name="link")


def _texts(element: ET.Element, **texts: str) -> None:
    for name, text in texts.items():
        ET.SubElement(element, name).text = text
