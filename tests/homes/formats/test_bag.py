"""Maps in bags: the last grid of a topic, its frame, and what is wrong with it."""

import numpy as np
import pytest
from tests.logs.ros import Ros

import fleet2d
from fleet2d.errors import FloorPlanError
from fleet2d.homes.formats.bag import BagMap

pytest.importorskip("rosbags", reason="the extra ros is not installed")


def write(path, *grids, resolution=0.1, turn=0.0):
    """Write a bag with maps whose lower left corner is at (-1, 2)."""
    ros = Ros(2)
    corner = ros.pose(-1.0, 2.0, turn)
    rows = [
        (topic, "nav_msgs/msg/OccupancyGrid", ns, ros.grid(ns, cells, corner, resolution))
        for ns, (topic, cells) in enumerate(grids)
    ]
    return ros.bag(path, rows, "MCAP")


def room(width=60, height=40):
    """Return a free room with walls around it, and unknown cells outside."""
    cells = np.full((height + 10, width + 10), -1)
    cells[4 : height + 6, 4 : width + 6] = 100
    cells[5 : height + 5, 5 : width + 5] = 0
    return cells


def test_the_last_map_is_a_home_in_the_frame_of_the_map(tmp_path):
    path = write(tmp_path / "slam", ("/map", room(10, 10)), ("/map", room()))

    plan = BagMap(path=path).plan()

    assert plan.area_m2 == pytest.approx(24.0, abs=0.01)
    assert plan.free_space.bounds == pytest.approx((-0.5, 2.5, 5.5, 6.5), abs=0.01)
    assert (
        "/map: the last of 2 maps, 70 × 50 cells of 0.1 m, its corner at (-1.00, 2.00) m"
        in plan.notes[-1]
    )


def test_a_turned_map_is_turned(tmp_path):
    path = write(tmp_path / "slam", ("/map", room()), turn=np.pi / 2)

    plan = BagMap(path=path).plan()

    assert plan.free_space.bounds == pytest.approx((-5.5, 2.5, -1.5, 8.5), abs=0.01)


def test_a_run_exported_as_a_bag_is_lived_in_again(tmp_path):
    run = fleet2d.run("bundled:paper", "simulation.duration=1 min", seed=4)
    fleet2d.export(run, tmp_path / "home.mcap")

    again = fleet2d.load_floorplan(tmp_path / "home.mcap")

    assert again.area_m2 == pytest.approx(run.plan.area_m2, rel=0.05)


@pytest.mark.parametrize(
    ("grids", "topic", "message"),
    [
        ([("/a", room()), ("/b", room())], None, "has several maps: select one by 'topic': /a, /b"),
        ([("/a", room())], "/c", "has no map '/c'"),
        ([("/map", np.full((20, 20), -1))], None, "free"),
    ],
)
def test_a_bag_without_one_home_is_refused(tmp_path, grids, topic, message):
    path = write(tmp_path / "slam", *grids)

    with pytest.raises(FloorPlanError, match=message):
        BagMap(path=path, topic=topic).plan()


def test_a_bag_without_a_map_is_refused(tmp_path):
    run = fleet2d.run("bundled:paper", "simulation.duration=1 min", seed=4)
    fleet2d.export(run, tmp_path / "home.mcap")
    text = (tmp_path / "home.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(text[: len(text) // 2])

    with pytest.raises(FloorPlanError, match="can't be read as a bag"):
        fleet2d.load_floorplan(tmp_path / "cut.mcap")
