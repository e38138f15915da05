import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from tests.small_home import VARIATIONS, SmallHome, check, small_home

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.homes.formats.dxf import Dxf

ezdxf = pytest.importorskip("ezdxf")

# Walls of 0.2 m drawn by their two sides: 8 m x 4 m outside, a wall across, a door, a front door.
OUTSIDE = [(0, 0), (8, 0), (8, 4), (0, 4)]
LEFT = [(4.0, 1.5), (4.0, 0.2), (0.2, 0.2), (0.2, 3.8), (4.0, 3.8), (4.0, 2.4)]
RIGHT = [(4.2, 2.4), (4.2, 3.8), (7.8, 3.8), (7.8, 0.2), (4.2, 0.2), (4.2, 1.5)]
JAMBS = [[(4.0, 1.5), (4.2, 1.5)], [(4.0, 2.4), (4.2, 2.4)]]


def write(
    folder: Path,
    unit_m=1.0,
    units=6,
    layer="A-WALL",
    windows=(),
) -> Path:
    drawing = ezdxf.new(units=units)
    space = drawing.modelspace()

    def line(points, on, close=False):
        scaled = [(x / unit_m, y / unit_m) for x, y in points]
        space.add_lwpolyline(scaled, close=close, dxfattribs={"layer": on})

    line(OUTSIDE, layer, close=True)
    for points in (LEFT, RIGHT, *JAMBS):
        line(points, layer)
    for points in windows:
        line(points, "A-WINDOW")
    line([(1, 1), (3, 1), (3, 2), (1, 2)], "FURNITURE", close=True)
    path = folder / "plan.dxf"
    drawing.saveas(path)
    return path


@pytest.mark.parametrize(
    ("unit_m", "units"), [(1.0, 6), (0.001, 4), (0.001, 0), (0.01, 5), (0.1, 14), (0.9144, 10)]
)
def test_walls_of_two_lines_bound_two_rooms(tmp_path, unit_m, units):
    plan = load_floorplan(write(tmp_path, unit_m, units))

    assert plan.area_m2 == pytest.approx(3.8 * 3.6 + 3.6 * 3.6 + 0.2 * 0.9, abs=0.4)
    assert 2 == len(plan.rooms)
    assert [(0, 1)] == [tuple(sorted(door.rooms)) for door in plan.doorways]


def test_layers_and_scale_can_be_named(tmp_path):
    path = write(tmp_path, layer="0-MAIN")

    named = Dxf(path=path, walls="0-*").load()

    assert 2 == len(named.rooms)
    assert Dxf(path=path, walls="0-*", scale=2.0).load().area_m2 > 3.5 * named.area_m2
    with pytest.raises(FloorPlanError, match="its layers are: 0-MAIN, FURNITURE"):
        Dxf(path=path, walls="WALLS").load()


def test_damaged_and_empty_drawings_are_refused(tmp_path):
    (tmp_path / "text.dxf").write_text("hello")
    ezdxf.new().saveas(tmp_path / "empty.dxf")

    with pytest.raises(FloorPlanError, match="is damaged, or not DXF"):
        load_floorplan(tmp_path / "text.dxf")
    with pytest.raises(FloorPlanError, match="no lines of walls"):
        load_floorplan(tmp_path / "empty.dxf")
    with pytest.raises(FloorPlanError, match="there is no file"):
        load_floorplan(tmp_path / "none.dxf")


def test_one_sees_through_windows_between_rooms(tmp_path):
    inner = [[(x, 2.7), (x, 3.5)] for x in (4.0, 4.1, 4.2)]
    outer = [[(1, y), (2, y)] for y in (0, 0.1, 0.2)]
    sides = [[(4.0, y), (4.2, y)] for y in (2.7, 3.5)]

    plan = load_floorplan(write(tmp_path, windows=(*inner, *sides, *outer)))

    (pane,) = plan.glass
    assert pane.area / plan.lattice.units_per_m**2 == pytest.approx(0.8 * 0.22, abs=0.05)
    assert 2 == len(plan.rooms)
    assert "windows in outer walls, through which nobody is seen: 1" in plan.notes


# Metres to a unit, and what the header says: it lies in the last five, where doors have arcs.
UNITS = [(0.001, 4), (0.01, 5), (1.0, 6), (0.0254, 1), (0.3048, 2), (0.001, 0)]
LIES = [(0.0254, 4), (0.001, 6), (0.01, 4), (0.0254, 6), (0.01, 1)]


def drawn(home: SmallHome, k, folder: Path) -> Path:
    unit_m, header = (UNITS + LIES)[k % 11]
    drawing = ezdxf.new(units=header)
    space = drawing.modelspace()
    layer = {"layer": ("WALL", "A-WALL", "Wände", "MURS", "Muros", "0-MURI")[k % 6]}

    def units(point: tuple[float, float]) -> tuple[float, float]:
        return point[0] / unit_m, point[1] / unit_m

    for box in home.walls:
        corners = [units(p) for p in home.corners(box)]
        if k % 2:
            space.add_lwpolyline(corners, close=True, dxfattribs=layer)
        else:
            for a, b in pairwise([*corners, corners[0]]):
                space.add_line(a, b, dxfattribs=layer)
    if k % 11 >= len(UNITS) or k % 3 == 0:
        for start, end in (*map(home.line, home.doors), home.line(home.front)):
            angle = math.degrees(math.atan2(end[1] - start[1], end[0] - start[0]))
            radius = math.dist(start, end) / unit_m
            space.add_arc(units(start), radius, angle - 90, angle, dxfattribs={"layer": "A-DOOR"})
    path = folder / "plan.dxf"
    drawing.saveas(path)
    return path


@pytest.mark.parametrize("k", VARIATIONS)
def test_drawings_of_any_unit_language_and_turn_are_the_home(tmp_path, k):
    home = small_home(k, turns=(0, 90, 17, 0, 45))

    plan = load_floorplan(drawn(home, k, tmp_path))

    check(plan, home, types=("room",) * 3)
    assert plan.entrance is not None
    front = np.mean(home.line(home.front), axis=0)
    lowest = np.min([home.corners(box) for box in home.walls], axis=(0, 1))
    assert math.dist(plan.entrance, front - lowest) < 0.5


def test_a_drawing_without_a_unit_and_doors_is_refused_with_the_sizes(tmp_path):
    drawing = ezdxf.new(units=0)
    for corners in (
        [(0, 0), (900, 0), (900, 700), (0, 700)],
        [(20, 20), (880, 20), (880, 680), (20, 680)],
    ):
        drawing.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": "WALL"})
    drawing.saveas(tmp_path / "plan.dxf")

    with pytest.raises(FloorPlanError, match=r"set floorplan\.scale; 0\.01 makes it 57 m2"):
        load_floorplan(tmp_path / "plan.dxf")


def test_what_is_not_read_on_the_layers_of_walls_is_told(tmp_path):
    """A home whose inner walls were hatched had none of them, without a word."""
    path = write(tmp_path)
    drawing = ezdxf.readfile(path)
    for on in ("A-WALL", "FURNITURE"):
        hatch = drawing.modelspace().add_hatch(dxfattribs={"layer": on})
        hatch.paths.add_polyline_path([(1, 1), (2, 1), (2, 2)], is_closed=True)
    drawing.saveas(path)

    note = "left out on the layers of walls: 1 HATCH; exploded, they are lines"
    assert note in load_floorplan(path).notes

    for entity in drawing.modelspace().query("LWPOLYLINE"):
        drawing.modelspace().delete_entity(entity)
    drawing.saveas(path)
    with pytest.raises(FloorPlanError, match="no lines of walls but 1 HATCH: explode them"):
        load_floorplan(path)


def test_layers_that_are_off_or_frozen_draw_no_walls(tmp_path):
    path = write(tmp_path)
    seen = load_floorplan(path)
    drawing = ezdxf.readfile(path)
    drawing.layers.add("WALL-OLD").off()
    drawing.layers.add("WALL-DEMO").freeze()
    for layer, x in (("WALL-OLD", 2), ("WALL-DEMO", 6)):
        drawing.modelspace().add_line((x, 0), (x, 4), dxfattribs={"layer": layer})
    drawing.saveas(path)

    assert seen == load_floorplan(path)


def test_walls_in_blocks_of_blocks_are_walls(tmp_path):
    path = write(tmp_path)
    area_m2 = load_floorplan(path).area_m2
    drawing = ezdxf.readfile(path)
    inner = drawing.blocks.new("storey")
    outer = drawing.blocks.new("house")
    for entity in list(drawing.modelspace()):
        drawing.modelspace().move_to_layout(entity, inner)
    outer.add_blockref("storey", (1, 1), dxfattribs={"rotation": 90})
    drawing.modelspace().add_blockref("house", (3, 0), dxfattribs={"xscale": -1})
    drawing.saveas(path)

    assert load_floorplan(path).area_m2 == pytest.approx(area_m2, abs=0.05)


@pytest.mark.parametrize("unit_m", [1.0, 0.001])
@pytest.mark.parametrize("kind", ["circle", "bulges", "solid"])
def test_a_column_is_wall(tmp_path, unit_m, kind):
    path = write(tmp_path, unit_m, {1.0: 6, 0.001: 4}[unit_m])
    area_m2 = load_floorplan(path).area_m2
    drawing = ezdxf.readfile(path)
    x, y, radius = (length / unit_m for length in (2, 2, 0.5))
    if kind == "circle":
        drawing.modelspace().add_circle((x, y), radius, dxfattribs={"layer": "A-WALL"})
    elif kind == "solid":
        half = radius * math.sqrt(math.pi) / 2
        ends = [(x + i * half, y + j * half) for i in (-1, 1) for j in (-1, 1)]
        drawing.modelspace().add_solid(ends, dxfattribs={"layer": "A-WALL"})
    else:
        ends = [(x - radius, y, 0, 0, 1), (x + radius, y, 0, 0, 1)]
        drawing.modelspace().add_lwpolyline(ends, close=True, dxfattribs={"layer": "A-WALL"})
    drawing.saveas(path)

    column_m2 = area_m2 - load_floorplan(path).area_m2

    assert column_m2 == pytest.approx(math.pi * 0.5**2, abs=0.05)
