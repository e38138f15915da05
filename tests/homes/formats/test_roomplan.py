import copy
import json
import math
from itertools import chain, pairwise

import pytest
from tests.small_home import TYPES, VARIATIONS, check, noisy, small_home

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.homes.formats.roomplan import RoomPlan


def surface(x, z, width, angle_deg=0, **keys):
    """A surface of RoomPlan: its middle (x, z), its width, and its turn about the upward axis."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    depth = keys.pop("depth", 0.0)
    return {
        "dimensions": [width, 2.5, depth],
        "transform": [c, 0, -s, 0, 0, 1, 0, 0, s, 0, c, 0, x, 1.25, z, 1],
        **keys,
    }


def scan(turn_deg=0.0):
    """A flat of 8 m x 4 m with a wall across its middle, a door in it, and a sofa."""

    def at(x, z, width, angle=0, **keys):
        c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
        return surface(c * x + s * z, -s * x + c * z, width, angle + turn_deg, **keys)

    return {
        "version": 2,
        "walls": [at(4, 0, 8), at(4, 4, 8), at(0, 2, 4, 90), at(8, 2, 4, 90), at(4, 2, 4, 90)],
        "doors": [at(4, 1, 0.9, 90, category={"door": {"isOpen": True}})],
        "windows": [at(0, 2, 1, 90)],
        "openings": [],
        "objects": [at(6, 3, 2.0, depth=0.9, category={"sofa": {}})],
    }


SAMPLE = ("scan.json", scan())


def write(folder, content):
    path = folder / "scan.json"
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize("turn_deg", [0, 33])
def test_scan_becomes_a_home_with_its_longest_wall_along_x(tmp_path, turn_deg):
    plan = load_floorplan(write(tmp_path, scan(turn_deg)))

    assert plan.area_m2 == pytest.approx(2 * 3.95 * 4 + 0.1 * 0.9, abs=0.15)
    assert 2 == len(plan.rooms)
    assert [(0, 1)] == [tuple(sorted(door.rooms)) for door in plan.doorways]
    assert 0.9 == pytest.approx(plan.doorways[0].width_m, abs=0.01)
    x0, y0, x1, y1 = plan.bounds
    assert (8.0, 4.0) == pytest.approx((x1 - x0, y1 - y0), abs=0.02)
    # The front of furniture is where z of its axes points.
    assert 1.5 * math.pi == pytest.approx(plan.objects[0].heading, abs=1e-3)


def test_furniture_has_the_names_of_the_catalogue_and_its_place(tmp_path):
    content = scan()
    content["objects"].append(surface(1, 3.5, 0.7, depth=0.7, category="refrigerator"))

    plan = load_floorplan(write(tmp_path, content))

    assert ["sofa", "fridge"] == [thing.type for thing in plan.objects]
    assert (5.0, -3.45, 7.0, -2.55) == pytest.approx(plan.objects[0].footprint.bounds)


@pytest.mark.parametrize(
    ("category", "high_m", "begins_m", "expected"),
    [
        ("sofa", 0.8, 0.0, 0.8),
        ("table", 0.75, 0.0, None),
        ("storage", 0.9, 0.0, 0.9),
        ("storage", 0.7, 1.5, 0.0),
        ("television", 0.7, 0.1, 0.8),
        ("fireplace", 1.2, 0.0, 1.2),
    ],
    ids=["measured", "on legs", "low", "on the wall", "on a low stand", "of no known type"],
)
def test_furniture_is_as_high_above_the_floor_as_the_scan_says(
    tmp_path, category, high_m, begins_m, expected
):
    piece = surface(6, 3, 1.6, depth=0.5, category={category: {}})
    piece["dimensions"][1], piece["transform"][13] = high_m, begins_m + high_m / 2
    raised = {**scan(), "objects": [piece]}
    for surfaces in (raised["walls"], raised["objects"]):  # a scan's own zero is not at the floor
        for each in surfaces:
            each["transform"][13] -= 1.3

    plan = load_floorplan(write(tmp_path, raised))

    assert expected == pytest.approx(plan.objects[0].height)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"walls": 3}, "walls is 3"),
        ({"walls": []}, "no free space"),
        ({"walls": [{"dimensions": [1, 2]}]}, "walls[0]"),
        ({"walls": [surface(0, 0, 4)]}, "no free space"),
    ],
)
def test_damaged_scan_is_refused(tmp_path, change, message):
    with pytest.raises(FloorPlanError) as caught:
        load_floorplan(write(tmp_path, {**scan(), **change}))

    assert message in str(caught.value)


@pytest.mark.parametrize("turn_deg", [0, 33])
def test_one_sees_through_windows_between_rooms(tmp_path, turn_deg):
    content = scan(turn_deg)
    c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    content["windows"].append(surface(c * 4 + s * 3, -s * 4 + c * 3, 1.2, 90 + turn_deg))

    plan = load_floorplan(write(tmp_path, content))

    (pane,) = plan.glass
    assert pane.area / plan.lattice.units_per_m**2 == pytest.approx(1.2 * 0.12, abs=0.01)
    assert "windows in outer walls, through which nobody is seen: 1" in plan.notes


def captured(k):
    """A scan of a home, turned, a few millimetres off; and whether its sections name its rooms."""
    home = small_home(k)
    noise = noisy(k, 0.003)
    turn = (0, 33, 90, 217)[k % 4]

    def on_floor(x, y):
        c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        return c * x - s * y, -(s * x + c * y)

    def span(start, end):
        (ax, ay), (bx, by) = noise(start), noise(end)
        x, z = on_floor((ax + bx) / 2, (ay + by) / 2)
        angle = math.degrees(math.atan2(by - ay, bx - ax)) + turn
        return surface(x, z, math.dist((ax, ay), (bx, by)), angle)

    def around(x0, y0, x1, y1):
        return [
            span(*ends) for ends in pairwise([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])
        ]

    def section(label, box):
        x, z = on_floor((box[0] + box[2]) / 2, (box[1] + box[3]) / 2)
        return {"label": label, "center": [x, 1.2, z], "story": 0}

    walls = list(chain.from_iterable(around(*box) for box in home.rooms))
    if k % 3 == 0:  # one surface serves both rooms, as in a single scan of several rooms
        (_, _, x, y), (_, y1, _, top), (x1, _, right, _) = home.rooms
        xm, ym = (x + x1) / 2, (y + y1) / 2
        walls = [*around(0, 0, right, top), span((0, ym), (xm, ym)), span((xm, 0), (xm, top))]
    sections = list(map(section, ("kitchen", "livingRoom", "bedroom"), home.rooms))
    content = {
        "walls": walls,
        "doors": [span(*line) for line in (*home.doors, home.front)],
        "openings": [],
        "sections": sections if k % 2 else [],
    }
    return content, bool(k % 2)


@pytest.mark.parametrize("k", VARIATIONS)
def test_scans_of_any_turn_and_noise_are_the_home(tmp_path, k):
    content, is_named = captured(k)

    plan = load_floorplan(write(tmp_path, content))

    check(plan, small_home(k), types=TYPES if is_named else ("unknown",) * 3, slack=0.02)


def test_sections_of_one_open_room_are_its_functions(tmp_path):
    content = scan()
    content["walls"] = content["walls"][:4]
    content["doors"] = []
    content["sections"] = [
        {"label": label, "center": [x, 1.0, 2.0], "story": 0}
        for label, x in (("kitchen", 1.0), ("livingRoom", 6.0))
    ]

    (room,) = load_floorplan(write(tmp_path, content)).rooms

    assert ("kitchen", ("kitchen", "living_room")) == (room.type, room.labels)
    assert 32 == pytest.approx(room.area_m2, abs=0.1)


@pytest.mark.parametrize("in_degrees", [True, False])
def test_a_curved_wall_is_curved(tmp_path, in_degrees):
    """A half-circle of 2 m radius in place of the wall at x = 8."""
    content = scan()
    content["doors"] = []
    content["walls"] = [w for k, w in enumerate(content["walls"]) if k not in (3, 4)]
    angles = [-math.pi / 2, math.pi / 2]
    if in_degrees:
        angles = [{"value": math.degrees(a), "unit": {"symbol": "°"}} for a in angles]
    curve = {"center": [0, 0], "radius": 2, "startAngle": angles[0], "endAngle": angles[1]}
    content["walls"].append(surface(8, 2, 4, curve=curve))

    plan = load_floorplan(write(tmp_path, content))

    assert plan.area_m2 == pytest.approx(8 * 4 + math.pi * 2**2 / 2, abs=0.2)


def test_where_walls_do_not_close_the_floor_bounds_the_room(tmp_path):
    corners = [(-4, -2, 0), (4, -2, 0), (4, 2, 0), (0, 2, 0), (0, 0, 0), (-4, 0, 0)]
    floor = surface(4, 2, 8)
    floor["transform"] = [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 4, 0, 2, 1]
    content = {**scan(), "doors": [], "objects": [], "windows": []}
    content |= {"walls": content["walls"][:2], "floors": [{**floor, "polygonCorners": corners}]}

    plan = load_floorplan(write(tmp_path, content))

    assert plan.area_m2 == pytest.approx(24, abs=0.1)


def test_stories_lie_side_by_side_and_stairs_join_them(tmp_path):
    content = scan()
    stairs = surface(6, 1.2, 1.0, depth=3.0, category={"stairs": {}}, story=0)
    for key in ("walls", "doors"):
        above = copy.deepcopy(content[key])
        for each in above:
            each["story"] = 1
            each["transform"][13] += 2.8
        content[key] = [*content[key], *above]
    content["objects"] = [stairs]

    plan = load_floorplan(write(tmp_path, content))

    assert (4, 2, 1) == (len(plan.rooms), len(plan.polygons), len(plan.portals))
    assert 2 == len(RoomPlan(path=tmp_path / "scan.json", level=1).load().rooms)
