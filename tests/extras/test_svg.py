from pathlib import Path

import pytest
from tests.small_home import INNER_M, VARIATIONS, check, small_home

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.homes.formats.svg import Svg

pytest.importorskip("svgelements")

HEAD = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="1000" height="500"'
    ' xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape">'
)
# In the layout of CubiCasa5K: 100 units to a metre, doors of 0.85 m, rooms up to the walls.
CUBICASA = f"""<?xml version="1.0"?>{HEAD}<g id="Model" class="Model v1-1">
<g class="Space LivingRoom"><polygon points="20,20 500,20 500,400 20,400 20,20"/>
 <g class="SpaceDimensionsLabel"><rect x="100" y="100" width="50" height="20"/></g></g>
<g class="Space Bedroom" transform="translate(500,0)">
 <polygon points="20,20 380,20 380,400 20,400"/></g>
<g class="Wall" id="Wall"><polygon points="500,20 520,20 520,400 500,400"/>
 <g class="Door Swing Beside" id="Door"><polygon points="500,100 520,100 520,185 500,185"/>
  <g class="Panel"><path d="M500,100 A85,85 0 0 1 585,185"/></g></g></g>
<g class="Wall External"><polygon points="0,0 900,0 900,20 0,20"/>
 <g class="Window Regular"><polygon points="100,0 200,0 200,20 100,20"/></g></g>
<g class="FixedFurniture Sink"><rect x="700" y="300" width="60" height="60"/></g>
</g></svg>"""


def write(folder: Path, text) -> Path:
    path = folder / "plan.svg"
    path.write_text(text)
    return path


def test_cubicasa_layout_has_its_rooms_and_doors(tmp_path):
    plan = load_floorplan(write(tmp_path, CUBICASA))

    areas = {room.name: room.area_m2 for room in plan.rooms}
    assert areas == pytest.approx({"living_room_1": 18.24, "bedroom_1": 13.68}, abs=0.3)
    assert [("living_room", "bedroom")] == [
        tuple(plan.rooms[k].type for k in sorted(door.rooms)) for door in plan.doorways
    ]
    assert plan.doorways[0].width_m == pytest.approx(0.85, abs=0.06)
    assert "a unit is taken for 0.01 m, by the width of 1 doors" in plan.notes[0]


def test_layers_of_inkscape_with_walls_as_lines(tmp_path):
    drawing = f"""{HEAD}<g inkscape:label="Outer walls" id="layer1">
      <path id="path7" style="fill:none" d="M0,0 H800 V400 H0 Z"/><path fill="none" d="M400,0 V150 M400,240 V400"/></g>
      <g inkscape:label="furniture"><circle cx="100" cy="100" r="40"/></g></svg>"""

    plan = Svg(path=write(tmp_path, drawing), scale=0.01).load()

    assert 2 == len(plan.rooms)
    assert plan.area_m2 == pytest.approx(8 * 4, rel=0.06)
    with pytest.raises(FloorPlanError, match="that would tell its scale"):
        load_floorplan(tmp_path / "plan.svg")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("hello", "is damaged, or not SVG"),
        (CUBICASA[:-40], "is damaged, or not SVG"),
        (HEAD + "<rect width='9' height='9'/></svg>", "is named like walls or rooms"),
        ("<!DOCTYPE svg [<!ENTITY a SYSTEM 'b'>]>" + HEAD + "&a;</svg>", "undefined entity &a;"),
        (HEAD + "<g class='Wall'><path d='M0,0 L nan,5'/></g></svg>", "named like walls|damaged"),
    ],
)
def test_what_is_no_plan_is_refused(tmp_path, text, problem):
    with pytest.raises(FloorPlanError, match=problem):
        load_floorplan(write(tmp_path, text))


def test_one_sees_through_windows_between_rooms(tmp_path):
    inner = CUBICASA.replace(
        '<g class="Door',
        '<g class="Window"><polygon points="500,250 520,250 520,380 500,380"/></g><g class="Door',
    )

    plan = load_floorplan(write(tmp_path, inner))

    (pane,) = plan.glass
    assert pane.area / plan.lattice.units_per_m**2 == pytest.approx(1.3 * 0.22, abs=0.02)
    assert load_floorplan(write(tmp_path, CUBICASA)).glass == ()


def rooms_of(k, folder: Path) -> Path:
    """The home in pixels: walls as one path or several, rooms named by ids, classes or texts."""
    home = small_home(k, turns=(0, 90, 17))
    pixels = (100.0, 50.0, 37.8)[k % 3]

    def at(point: tuple[float, float]) -> tuple[float, float]:
        return round(point[0] * pixels, 2), round(-point[1] * pixels, 2)

    def path_of(box: tuple[float, float, float, float]):
        return "M" + " L".join(f"{x} {y}" for x, y in map(at, home.corners(box))) + " Z"

    walls = [path_of(box) for box in home.walls]
    drawn = (
        f'<path d="{" ".join(walls)}"/>'
        if k % 4 == 0
        else "".join(f'<path d="{w}"/>' for w in walls)
    )
    rooms, texts = "", ""
    for box, name in zip(home.rooms, home.names, strict=True):
        named = {0: f'id="{name}"', 1: 'id="rect12"', 2: f'class="room {name}"'}[k % 3]
        rooms += f'<path {named} d="{path_of(box)}"/>'
        x, y = at(home.place(((box[0] + box[2]) / 2, (box[1] + box[3]) / 2)))
        texts += f'<text x="{x}" y="{y}">{name}</text><text x="{x}" y="{y + 5}">12 m²</text>'
    doors = ""
    for (ax, ay), (bx, by) in home.doors if k % 2 else ():
        dx, dy = (0, INNER_M / 2) if ay == by else (INNER_M / 2, 0)
        doors += f'<path d="{path_of((ax - dx, ay - dy, bx + dx, by + dy))}"/>'
    labels = f'<g id="labels">{texts}</g>' if k % 3 == 1 else ""
    file = folder / "plan.svg"
    file.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg"><g id="walls">{drawn}</g><g id="rooms">{rooms}</g>'
        f'<g id="doors">{doors}</g>{labels}</svg>'
    )
    return file


@pytest.mark.parametrize("k", VARIATIONS)
def test_drawings_of_any_scale_language_and_naming_are_the_home(tmp_path, k):
    path = rooms_of(k, tmp_path)

    plan = load_floorplan(path, scale=1 / (100.0, 50.0, 37.8)[k % 3])

    check(plan, small_home(k), slack=0.02)


def test_the_hole_of_a_wall_is_no_wall(tmp_path):
    """Walls as one shape whose outlines are its holes, as drawing programs join them."""
    path = tmp_path / "plan.svg"
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg"><g id="walls"><path fill="#000" d="M0 0H900V600H0Z'
        ' M10 10V590H445V10Z M455 10V590H890V10Z"/></g><g id="rooms"><rect x="10" y="10" width="435"'
        ' height="580"/><rect x="455" y="10" width="435" height="580"/></g><g id="door"><rect'
        ' x="445" y="200" width="10" height="90"/></g></svg>'
    )

    plan = load_floorplan(path, scale=0.01)

    assert plan.area_m2 == pytest.approx(2 * 4.35 * 5.8 + 0.09, abs=0.02)

    unscaled = load_floorplan(path)

    assert (85 / 90) ** 2 * plan.area_m2 == pytest.approx(unscaled.area_m2, rel=0.01)
    assert "by the width of 1 doors" in unscaled.notes[0]


ROOMS = """<g id="rooms"><rect id="kitchen" width="40" height="30"/>
<rect id="bedroom" x="41" width="40" height="30"/></g>"""

DOUBLE = """<g id="rooms"><rect id="kitchen" width="80" height="60"/>
<rect id="bedroom" x="82" width="80" height="60"/></g>"""


@pytest.mark.parametrize(
    ("size", "body"),
    [
        ('width="100mm" height="50mm" viewBox="0 0 100 50"', ROOMS),
        ('width="5cm" height="2.5cm" viewBox="0 0 100 50"', ROOMS),
        ("", f'<g transform="rotate(30)"><g transform="scale(0.5)">{DOUBLE}</g></g>'),
        (
            'width="100mm" height="50mm" viewBox="0 0 100 50"',
            """<symbol id="box"><rect width="40" height="30"/></symbol><g id="rooms">
            <use id="kitchen" href="#box"/><use id="bedroom" href="#box" x="41"/></g>""",
        ),
    ],
    ids=["millimetres of paper", "centimetres of paper", "turned", "used"],
)
def test_rectangles_have_their_places_and_sizes_in_units_of_the_drawing(tmp_path, size, body):
    drawing = f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{body}</svg>'

    plan = Svg(path=write(tmp_path, drawing), scale=0.1).load()

    areas = {room.type: room.area_m2 for room in plan.rooms}
    assert areas == pytest.approx({"kitchen": 12.0, "bedroom": 12.0}, abs=0.05)
