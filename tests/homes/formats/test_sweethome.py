import math
from pathlib import Path

import pytest
import shapely

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.homes.formats.storeys import Storey, choose_storey
from fleet2d.homes.formats.sweethome import SweetHome

WALLS = """
<wall xStart="0" yStart="0" xEnd="800" yEnd="0" thickness="10"/>
<wall xStart="800" yStart="0" xEnd="800" yEnd="400" thickness="10"/>
<wall xStart="800" yStart="400" xEnd="0" yEnd="400" thickness="10"/>
<wall xStart="0" yStart="400" xEnd="0" yEnd="0" thickness="10"/>
<wall xStart="400" yStart="0" xEnd="400" yEnd="400" thickness="10"/>
"""
ROOMS = """
<room name="Kitchen"><point x="5" y="5"/><point x="395" y="5"/><point x="395" y="395"/>
<point x="5" y="395"/></room>
<room name="Bedroom"><point x="405" y="5"/><point x="795" y="5"/><point x="795" y="395"/>
<point x="405" y="395"/></room>
"""
DOOR = '<doorOrWindow name="Door" x="400" y="200" width="90" depth="12" angle="1.5707963"/>'
WINDOW = (
    '<doorOrWindow name="Window" x="0" y="200" width="90" depth="12" angle="1.57" elevation="90"/>'
)
BED = (
    '<pieceOfFurniture catalogId="eTeks#bed140x190" name="Bed" x="700" y="200" width="140"'
    ' depth="200" angle="0"/>'
)


def write(folder: Path, *content: str) -> Path:
    path = folder / "Home.xml"
    path.write_text(f'<?xml version="1.0"?>\n<home name="flat">{"".join(content)}</home>')
    return path


def test_rooms_walls_doors_and_furniture_become_a_home(tmp_path: Path) -> None:
    plan = load_floorplan(write(tmp_path, WALLS, ROOMS, DOOR, WINDOW, BED))

    assert "flat" == plan.name
    assert [("Kitchen", "kitchen"), ("Bedroom", "bedroom")] == [
        (r.name, r.type) for r in plan.rooms
    ]
    assert plan.area_m2 == pytest.approx(2 * 3.9 * 3.9 + 0.1 * 0.9, abs=0.1)
    assert [(0, 1)] == [tuple(sorted(door.rooms)) for door in plan.doorways]
    assert ["bed"] == [thing.type for thing in plan.objects]
    assert (6.3, -3.0, 7.7, -1.0) == pytest.approx(plan.objects[0].footprint.bounds)


def piece(name: str, height: float, *, elevation: float = 0, angle: float = 0) -> str:
    return (
        f'<pieceOfFurniture name="{name}" x="600" y="200" width="200" depth="90"'
        f' height="{height}" elevation="{elevation}" angle="{angle}"/>'
    )


@pytest.mark.parametrize(
    ("element", "height"),
    [
        (piece("Sofa", 78.2), 0.782),
        (piece("Sofa", 78, elevation=12), 0.9),
        (piece("Table", 74), None),
        (piece("Fireplace", 110), 1.1),
        (piece("Sofa", 9000), 8.0),
        (BED, None),
    ],
    ids=["measured", "on a podium", "on legs", "of no known type", "damaged", "none in the file"],
)
def test_furniture_is_as_high_as_the_file_says(
    tmp_path: Path, element: str, height: float | None
) -> None:
    plan = load_floorplan(write(tmp_path, WALLS, ROOMS, element))

    assert [height] == [thing.height for thing in plan.objects]


@pytest.mark.parametrize(("angle", "heading"), [(0, 1.5 * math.pi), (math.pi / 2, math.pi)])
def test_the_front_of_furniture_is_its_lower_side_turned_clockwise(
    tmp_path: Path, angle: float, heading: float
) -> None:
    plan = load_floorplan(write(tmp_path, WALLS, ROOMS, piece("Sofa", 80, angle=angle)))

    assert heading == pytest.approx(plan.objects[0].heading, abs=1e-5)


def test_walls_alone_enclose_the_home(tmp_path: Path) -> None:
    plan = load_floorplan(write(tmp_path, WALLS, DOOR))

    assert plan.area_m2 == pytest.approx(2 * 3.9 * 3.9 + 0.1 * 0.9, abs=0.1)
    assert 2 == len(plan.rooms)


def test_level_is_chosen_by_name_and_else_all_lie_side_by_side(tmp_path: Path) -> None:
    levels = (
        '<level id="a" name="Cellar" elevation="-250"/><level id="b" name="Ground" elevation="0"/>'
    )
    upper = WALLS.replace("<wall", '<wall level="a"').replace('"400"', '"500"')
    path = write(tmp_path, levels, upper, WALLS.replace("<wall", '<wall level="b"'))

    assert SweetHome(path=path, level="Ground").load().bounds[1] == pytest.approx(-3.95)
    assert SweetHome(path=path, level="Cellar").load().bounds[1] == pytest.approx(-4.95)
    both = SweetHome(path=path).load()
    assert 4 == len(both.rooms)
    assert "its storeys lie side by side: Cellar, Ground" in both.notes
    with pytest.raises(FloorPlanError, match="its levels are: Cellar, Ground"):
        SweetHome(path=path, level="Roof").load()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("<plan/>", "it begins with <plan>"),
        ("<home", "is not XML"),
        ('<!DOCTYPE x [<!ENTITY a SYSTEM "b">]><home>&a;</home>', "undefined entity &a;"),
        ("<home/>", "it has no room and no free space"),
        ('<home><wall xStart="x" yStart="0" xEnd="1" yEnd="1"/></home>', "has xStart='x'"),
        ('<home><wall xStart="nan" yStart="0" xEnd="1" yEnd="1"/></home>', "a number is expected"),
    ],
)
def test_damaged_file_is_refused(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "Home.xml"
    path.write_text(content)

    with pytest.raises(FloorPlanError) as caught:
        load_floorplan(path)

    assert message in str(caught.value)
    assert "Home.xml" in str(caught.value)


def test_one_sees_through_low_windows_between_rooms_only(tmp_path: Path) -> None:
    inner = WINDOW.replace('x="0" y="200"', 'x="400" y="80"')
    plan = load_floorplan(write(tmp_path, WALLS, ROOMS, DOOR, WINDOW, inner))
    high = load_floorplan(
        write(tmp_path, WALLS, ROOMS, DOOR, inner.replace('elevation="90"', 'elevation="150"'))
    )

    (pane,) = shapely.transform(plan.glass, plan.lattice.to_metres)
    assert (3.94, -1.25, 4.06, -0.35) == pytest.approx(pane.bounds, abs=0.011)
    assert "windows in outer walls, through which nobody is seen: 1" in plan.notes
    assert () == high.glass


def test_levels_of_one_name_are_told_apart_by_their_ids() -> None:
    levels = [Storey("a", "Floor", 0.0), Storey("b", "Floor", 2.62)]

    assert choose_storey(levels, "b").key == "b"
    with pytest.raises(FloorPlanError, match="2 levels are called 'Floor'; its levels are: Floor"):
        choose_storey(levels, "Floor")
