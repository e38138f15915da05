import pytest
import yaml
from tests.small_home import INNER_M, TYPES, VARIATIONS, check, small_home

import fleet2d
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.homes.formats.espresense import Espresense


def floor(name, low, *rooms):
    return {
        "id": name.lower(),
        "name": name,
        "bounds": [[0, 0, low], [8, 4.5, low + 2.4]],
        "rooms": [{"name": room, "points": points} for room, points in rooms],
    }


KITCHEN = ("Kitchen", [[0, 0], [4, 0], [4, 3], [0, 3]])
BEDROOM = ("Bedroom", [[4, 0], [8, 0], [8, 3], [4, 3]])
SAMPLE = (
    "espresense.yaml",
    {"floors": [floor("Ground", 0, KITCHEN, BEDROOM)], "nodes": [{"name": "Desk"}]},
)


def write(folder, *floors):
    path = folder / "espresense.yaml"
    path.write_text(yaml.safe_dump({"floors": list(floors)}))
    return path


def test_rooms_that_touch_are_open_to_each_other(tmp_path):
    plan = load_floorplan(write(tmp_path, floor("Ground", 0, KITCHEN, BEDROOM)))

    assert ["kitchen", "bedroom"] == [room.type for room in plan.rooms]
    assert (24, 1) == (pytest.approx(plan.area_m2), len(plan.polygons))
    assert "the file has no walls and no doors: rooms that touch are open" in plan.notes


def test_floors_lie_side_by_side_and_say_that_no_stairs_join_them(tmp_path):
    path = write(tmp_path, floor("Up", 2.7, BEDROOM), floor("Ground", 0, KITCHEN))

    plan = load_floorplan(path)

    assert 2 == fleet2d.Home(plan).space(0.2).parts
    assert any("the file has no stairs to Up: join storeys by" in note for note in plan.notes)
    assert ["Bedroom"] == [r.name for r in Espresense(path=path, level="Up").load().rooms]


def test_damaged_file_names_the_place(tmp_path):
    with pytest.raises(FloorPlanError, match=r"floors\[0\]\.rooms\[0\]\.points has 2 different"):
        load_floorplan(write(tmp_path, floor("Ground", 0, ("Kitchen", [[0, 0], [1, 1]]))))


@pytest.mark.parametrize("k", VARIATIONS)
def test_configurations_of_any_language_and_turn_are_the_home(tmp_path, k):
    home = small_home(k, turns=(0, 17, 90))
    half = INNER_M / 2
    (_, _, x, y), (_, _, _, top), (_, _, right, _) = home.rooms
    boxes = [(0, 0, x + half, y + half), (0, y + half, x + half, top), (x + half, 0, right, top)]
    rooms = [
        (name, [list(map(float, corner)) for corner in home.corners(box)])
        for name, box in zip(home.names, boxes, strict=True)
    ]

    plan = load_floorplan(write(tmp_path, floor("Ground", 0, *rooms)))

    check(plan, home, types=TYPES, doors=0, front=False, slack=0.03)
