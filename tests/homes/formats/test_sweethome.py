import math
from itertools import pairwise
from zipfile import ZIP_DEFLATED, ZipFile

import pytest
import shapely
from tests.small_home import INNER_M, OUTER_M, VARIATIONS, check, small_home

import fleet2d
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


def write(folder, *content):
    path = folder / "Home.xml"
    path.write_text(f'<?xml version="1.0"?>\n<home name="flat">{"".join(content)}</home>')
    return path


def test_rooms_walls_doors_and_furniture_become_a_home(tmp_path):
    plan = load_floorplan(write(tmp_path, WALLS, ROOMS, DOOR, WINDOW, BED))

    assert "flat" == plan.name
    assert [("Kitchen", "kitchen"), ("Bedroom", "bedroom")] == [
        (r.name, r.type) for r in plan.rooms
    ]
    assert plan.area_m2 == pytest.approx(2 * 3.9 * 3.9 + 0.1 * 0.9, abs=0.1)
    assert [(0, 1)] == [tuple(sorted(door.rooms)) for door in plan.doorways]
    assert ["bed"] == [thing.type for thing in plan.objects]
    assert (6.3, -3.0, 7.7, -1.0) == pytest.approx(plan.objects[0].footprint.bounds)


def piece(name, height, *, elevation=0, angle=0):
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
def test_furniture_is_as_high_as_the_file_says(tmp_path, element, height):
    plan = load_floorplan(write(tmp_path, WALLS, ROOMS, element))

    assert [height] == [thing.height for thing in plan.objects]


@pytest.mark.parametrize(("angle", "heading"), [(0, 1.5 * math.pi), (math.pi / 2, math.pi)])
def test_the_front_of_furniture_is_its_lower_side_turned_clockwise(tmp_path, angle, heading):
    plan = load_floorplan(write(tmp_path, WALLS, ROOMS, piece("Sofa", 80, angle=angle)))

    assert heading == pytest.approx(plan.objects[0].heading, abs=1e-5)


def test_walls_alone_enclose_the_home(tmp_path):
    plan = load_floorplan(write(tmp_path, WALLS, DOOR))

    assert plan.area_m2 == pytest.approx(2 * 3.9 * 3.9 + 0.1 * 0.9, abs=0.1)
    assert 2 == len(plan.rooms)


def test_level_is_chosen_by_name_and_else_all_lie_side_by_side(tmp_path):
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
def test_damaged_file_is_refused(tmp_path, content, message):
    path = tmp_path / "Home.xml"
    path.write_text(content)

    with pytest.raises(FloorPlanError) as caught:
        load_floorplan(path)

    assert message in str(caught.value)
    assert "Home.xml" in str(caught.value)


def test_one_sees_through_low_windows_between_rooms_only(tmp_path):
    inner = WINDOW.replace('x="0" y="200"', 'x="400" y="80"')
    plan = load_floorplan(write(tmp_path, WALLS, ROOMS, DOOR, WINDOW, inner))
    high = load_floorplan(
        write(tmp_path, WALLS, ROOMS, DOOR, inner.replace('elevation="90"', 'elevation="150"'))
    )

    (pane,) = shapely.transform(plan.glass, plan.lattice.to_metres)
    assert (3.94, -1.25, 4.06, -0.35) == pytest.approx(pane.bounds, abs=0.011)
    assert "windows in outer walls, through which nobody is seen: 1" in plan.notes
    assert () == high.glass


def test_levels_of_one_name_are_told_apart_by_their_ids():
    levels = [Storey("a", "Floor", 0.0), Storey("b", "Floor", 2.62)]

    assert choose_storey(levels, "b").key == "b"
    with pytest.raises(FloorPlanError, match="2 levels are called 'Floor'; its levels are: Floor"):
        choose_storey(levels, "Floor")


def house(k):
    """A home of one to three storeys, turned, and how many storeys it has."""
    home = small_home(k, turns=(0, 90, 17, 45))
    storeys = 1 + k % 3
    (_, _, x, y), (_, y1, _, top), (x1, _, right, _) = home.rooms
    half = OUTER_M / 2

    def xy(point, x_key="x", y_key="y"):
        px, py = home.place(point)
        return f'{x_key}="{px * 100:.3f}" {y_key}="{-py * 100:.3f}"'

    def wall(start, end, thickness):
        ends = f"{xy(start, 'xStart', 'yStart')} {xy(end, 'xEnd', 'yEnd')}"
        return f'<wall {ends} thickness="{thickness * 100}" LEVEL/>'

    def room(box, name):
        x0, y0, x2, y2 = box
        corners = ((x0, y0), (x2, y0), (x2, y2), (x0, y2))
        points = "".join(f"<point {xy(corner)}/>" for corner in corners)
        return f'<room name="{name}" LEVEL>{points}</room>'

    def door(start, end):
        angle = (0 if start[1] == end[1] else math.pi / 2) - home.turn
        middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
        size = f'width="{math.dist(start, end) * 100:.1f}" depth="12" angle="{angle}"'
        return f'<doorOrWindow name="Door" {xy(middle)} {size} LEVEL/>'

    corners = [
        (-half, -half),
        (right + half, -half),
        (right + half, top + half),
        (-half, top + half),
    ]
    words = ("Staircase", "Treppe", "Escalier", "Escalera", "Scala")[k % 5]
    stairs = f'width="100" depth="280" height="262" angle="{-home.turn}" LEVEL'
    storey = "".join(
        [
            *(wall(*ends, OUTER_M) for ends in pairwise([*corners, corners[0]])),
            wall((0, (y + y1) / 2), (x, (y + y1) / 2), INNER_M),
            wall(((x + x1) / 2, 0), ((x + x1) / 2, top), INNER_M),
            *map(room, home.rooms, home.names),
            *(door(*ends) for ends in (*home.doors, home.front)),
            f'<pieceOfFurniture name="{words}" {xy((right - 1, 1.8))} {stairs}/>',
        ]
    )
    content = storey.replace("LEVEL", "")
    if storeys > 1:
        levels = [
            f'<level id="L{n}" name="{n}. OG" elevation="{n * 262}"/>' for n in range(storeys)
        ]
        copies = [storey.replace("LEVEL", f'level="L{n}"') for n in range(storeys)]
        content = "".join([*levels, *copies])
    return f'<?xml version="1.0"?>\n<home name="house">{content}</home>', storeys


@pytest.mark.parametrize("k", VARIATIONS)
def test_houses_of_any_storeys_language_and_turn_are_the_home(tmp_path, k):
    content, storeys = house(k)
    path = tmp_path / ("Home.xml", "house.sh3d")[k % 2]
    if k % 2:
        with ZipFile(path, "w") as archive:
            archive.writestr("Home.xml", content)
    else:
        path.write_text(content)

    plan = load_floorplan(path)

    check(plan, small_home(k), storeys=storeys)
    home = fleet2d.Home(plan)
    assert (storeys, 1) == (home.space(0.2).parts, home.space(0.2, uses_portals=True).parts)


@pytest.mark.parametrize("degrees", [-150, -90, -30, 10, 45, 90, 120, 179, 200, 270])
def test_round_walls_bulge_by_their_arc(tmp_path, degrees):
    """The area changes by the segment of the circle; rooms reach to the wall."""
    angle = math.radians(degrees)
    sides = [(0, 0, 800, 0), (800, 0, 800, 1400), (800, 1400, 0, 1400), (0, 1400, 0, 0)]
    areas = []
    for arc in (f'arcExtent="{angle}"', ""):
        walls = [
            f'<wall xStart="{a}" yStart="{b}" xEnd="{c}" yEnd="{d}" thickness="10"'
            f" {arc if k == 0 else ''}/>"
            for k, (a, b, c, d) in enumerate(sides)
        ]
        room = (
            '<room name="Hall"><point x="5" y="5"/><point x="795" y="5"/><point x="795" y="1395"/>'
        )
        areas.append(
            load_floorplan(write(tmp_path, *walls, f'{room}<point x="5" y="1395"/></room>')).area_m2
        )

    radius = 8 / 2 / abs(math.sin(angle / 2))
    segment = radius**2 / 2 * (angle - math.sin(angle))
    assert areas[0] - areas[1] == pytest.approx(segment, rel=0.06, abs=0.3)


@pytest.mark.parametrize(("y", "moved"), [(150, True), (160, True), (260, False)])
def test_a_door_that_a_round_wall_covers_is_moved_to_where_it_opens(tmp_path, y, moved):
    arc = WALLS.replace('yEnd="0" thickness', 'yEnd="0" arcExtent="-1.5708" thickness', 1)
    plan = load_floorplan(write(tmp_path, arc, ROOMS, DOOR.replace('y="200"', f'y="{y}"')))

    assert moved == any("stands in another wall, too" in note for note in plan.notes)
    (door,) = plan.doorways
    assert 0.9 == pytest.approx(door.width_m, abs=0.02)
    assert 1 == fleet2d.Home(plan).space(0.2).parts


def test_a_home_of_an_older_program_says_how_to_save_it(tmp_path):
    with ZipFile(tmp_path / "old.sh3d", "w") as archive:
        archive.writestr("Home", b"\xac\xed\x00\x05")

    with pytest.raises(FloorPlanError, match=r"has no Home\.xml in it: save it with Sweet Home 3D"):
        load_floorplan(tmp_path / "old.sh3d")


def test_an_archive_that_unpacks_to_gigabytes_is_refused(tmp_path):
    with ZipFile(tmp_path / "bomb.sh3d", "w", ZIP_DEFLATED) as archive:
        archive.writestr("Home.xml", b" " * (65 << 20))

    with pytest.raises(FloorPlanError, match=r"Home\.xml has at least 67,?108,?865 bytes"):
        load_floorplan(tmp_path / "bomb.sh3d")


def test_a_room_whose_outline_goes_back_on_itself_is_there(tmp_path):
    outline = [(0, 0), (400, 0), (500, 0), (400, 0), (400, 300), (0, 300)]
    points = "".join(f'<point x="{x}" y="{y}"/>' for x, y in outline)

    plan = load_floorplan(write(tmp_path, f'<room name="Kitchen">{points}</room>'))

    areas = {room.name: room.area_m2 for room in plan.rooms}
    assert areas == pytest.approx({"Kitchen": 12.0}, abs=0.1)
