"""Homes for ROS's map_server and for Gazebo."""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import shapely

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.homes.for_robots import save_map, save_world


def test_a_map_for_ros_reads_back_as_the_same_free_space_without_furniture(tmp_path):
    plan = load_floorplan("family_home")

    save_map(plan, tmp_path / "home.pgm")
    again = load_floorplan(tmp_path / "home.yaml")

    furniture = shapely.union_all([o.footprint for o in plan.objects if o.blocks != "nothing"])
    expected = plan.free_space.difference(furniture)
    differing = shapely.symmetric_difference(expected, again.free_space).area
    assert differing < 0.03 * expected.area  # half a cell along walls and furniture
    assert plan.lattice.cell == again.lattice.cell


def test_a_world_for_gazebo_has_solid_walls_exactly_where_the_home_has_no_free_space(tmp_path):
    plan = load_floorplan("family_home")

    save_world(plan, tmp_path / "home.sdf")

    world = ET.parse(tmp_path / "home.sdf").getroot().find("world")
    assert world is not None
    models = {model.get("name"): model for model in world.findall("model")}
    lines = models["walls"].findall("link/collision/geometry/polyline")
    walls = shapely.union_all([shapely.Polygon(corners(line)) for line in lines])
    assert 0.0 == pytest.approx(walls.intersection(plan.free_space).area, abs=0.01)
    beside = plan.free_space.buffer(0.1).difference(plan.free_space)
    assert beside.difference(walls).area < 0.01
    blocking = {o.name for o in plan.objects if o.blocks != "nothing"}
    assert models.keys() == {"floor", "walls", *blocking}


def corners(polyline):
    return [tuple(map(float, point.text.split())) for point in polyline if point.tag == "point"]  # type: ignore[union-attr]


@pytest.mark.parametrize("target", ["map.pgm", "home.sdf"])
def test_convert_for_robots_says_what_a_map_or_a_world_leaves_out(fleet2d, target):
    code, out, _ = fleet2d("convert", "family_home", target)

    assert code == 0
    assert "left out, as it holds only what stands in the way: 14 rooms, 14 doorways" in out


def test_convert_writes_both_and_replaces_nothing(fleet2d):
    assert 0 == fleet2d("convert", "synthetic:7", "map.pgm")[0]
    assert 0 == fleet2d("convert", "synthetic:7", "home.sdf")[0]
    before = Path("map.pgm").read_bytes()

    code, _, err = fleet2d("convert", "family_home", "map.pgm")

    assert code == 2
    assert "exists already" in err
    assert before == Path("map.pgm").read_bytes()


def test_a_map_whose_settings_exist_is_not_written(tmp_path):
    (tmp_path / "map.yaml").write_text("mine: 1\n")

    with pytest.raises(FloorPlanError, match=r"map\.yaml exists already"):
        save_map(load_floorplan("family_home"), tmp_path / "map.pgm")

    assert not (tmp_path / "map.pgm").exists()
    assert "mine: 1\n" == (tmp_path / "map.yaml").read_text()


def test_places_have_the_same_coordinates_in_a_map(tmp_path):
    plan = load_floorplan("family_home")

    save_map(plan, tmp_path / "home.pgm")

    again = load_floorplan(tmp_path / "home.yaml")
    rows, columns = np.nonzero(again.free)
    for row, column in zip(rows[::500].tolist(), columns[::500].tolist(), strict=True):
        x, y = again.lattice.xy_of(*again.lattice.cell_centre(row, column))
        assert plan.room_at(x, y) is not None
