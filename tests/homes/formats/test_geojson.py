import json
import math

import numpy as np
import pytest
import shapely
from tests.small_home import INNER_M, VARIATIONS, check, noisy, small_home

import fleet2d
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan, save_floorplan
from fleet2d.homes.formats.geojson import GeoJson, geojson_document


def read_geojson(path, **settings):
    return GeoJson.model_construct(path=path, **settings).load()


def ring(*corners):
    return {"type": "Polygon", "coordinates": [[list(corner) for corner in (*corners, corners[0])]]}


def box(x0, y0, x1, y1):
    return ring((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def line(*points):
    return {"type": "LineString", "coordinates": [list(point) for point in points]}


def point(x, y):
    return {"type": "Point", "coordinates": [x, y]}


def feature(geometry, kind=None, **properties):
    all_properties = properties if kind is None else {"kind": kind, **properties}
    return {"type": "Feature", "geometry": geometry, "properties": all_properties}


def imdf(geometry, feature_type, **properties):
    return {**feature(geometry, **properties), "feature_type": feature_type}


def parts(*polygons):
    return {"type": "MultiPolygon", "coordinates": [each["coordinates"] for each in polygons]}


# A file with all that the format has; `test_damaged_files.py` damages it.
SAMPLE = (
    "flat.geojson",
    {
        "type": "FeatureCollection",
        "name": "flat",
        "units": "m",
        "features": [
            feature(box(0, 0, 4, 3), "room", name="Kitchen", type="kitchen"),
            imdf(parts(box(4, 0, 8, 3)), "unit", category="lounge", name={"en": "Lounge"}, level_id="0"),
            feature(line((4, 1), (4, 2)), "door", name="door"),
            feature(line((5, 1), (6, 2)), "wall"),
            feature(
                {"type": "Point", "coordinates": [7, 2, 0]}, "object",
                type="bed", blocks="path", heading=1, uses=[{"x": 7, "y": 2, "heading": 1}],
            ),
            feature(point(0, 1), "entrance"),
        ],
    },
)  # fmt: skip


KITCHEN = feature(box(0, 0, 4, 3), "room", name="Kitchen")
BEDROOM = feature(box(4, 0, 9, 3), "room", name="Master Bedroom")
DOOR = feature(line((4, 1), (4, 1.9)), "door")


def write(folder, *features, **members):
    path = folder / "flat.geojson"
    content = {"type": "FeatureCollection", "features": list(features), **members}
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def read(folder, *features, **options):
    return read_geojson(write(folder, *features), **options)


def areas(plan):
    return {room.name: round(room.area_m2, 2) for room in plan.rooms}


# --- Rooms that touch -----------------------------------------------------------------------------


def test_rooms_that_touch_have_a_wall_between_them_and_doors_lead_through(tmp_path):
    plan = read(tmp_path, KITCHEN, BEDROOM, DOOR)

    wall = shapely.difference(shapely.box(3.95, 0, 4.05, 3), shapely.box(3.95, 1, 4.05, 1.9))
    expected = shapely.difference(shapely.box(0, 0, 9, 3), wall)
    assert shapely.symmetric_difference(expected, plan.free_space).area < 1e-6
    assert [("Kitchen", "kitchen"), ("Master Bedroom", "bedroom")] == [
        (room.name, room.type) for room in plan.rooms
    ]
    (door,) = plan.doorways
    assert ((4.0, 1.0), (4.0, 1.9), True) == (door.start, door.end, door.leaf)
    assert {0, 1} == set(door.rooms)
    assert "rooms touch along 3.0 m: there are walls of 0.1 m but for doors" in plan.notes


HALL = feature(box(0, 3, 9, 5), "room", name="Hall")


@pytest.mark.parametrize(
    ("features", "wall_m", "area_m2", "parts"),
    [
        pytest.param([KITCHEN, BEDROOM], 0.2, 27 - 3 * 0.2, 2, id="as thick as the setting says"),
        pytest.param([KITCHEN, BEDROOM], 0, 27, 1, id="none"),
        pytest.param(
            [KITCHEN, BEDROOM, HALL], 0.1, 3.95 * 2.95 + 4.95 * 2.95 + 9 * 1.95, 3,
            id="the corner of three rooms is filled",
        ),
        pytest.param(
            [KITCHEN, feature(ring((4.01, 0), (9, 0), (9, 3), (3.99, 3)), "room")],
            0.1, 26.7, 2, id="all along a border that is inexact by a centimetre",
        ),
        pytest.param(
            [KITCHEN, feature(box(4, 3, 8, 6), "room")], 0.1, 24, 2, id="none in a common corner",
        ),
        pytest.param(
            [KITCHEN, BEDROOM, HALL, feature(line((0, 3), (9, 3)), "wall"), feature(box(2, 4, 2.2, 5), "wall")],
            0.1, 45 - 9 * 0.1 - 0.2, 2, id="those that the file draws are the only ones",
        ),
    ],
)  # fmt: skip
def test_walls_stand_where_rooms_touch(tmp_path, features, wall_m, area_m2, parts):
    plan = read(tmp_path, *features, wall_m=wall_m)

    assert area_m2 == pytest.approx(plan.area_m2)
    assert parts == len(plan.polygons)


def test_room_inside_another_has_no_walls(tmp_path):
    niche = feature(box(1, 1, 2, 2), "room", name="Niche")

    plan = read(tmp_path, KITCHEN, niche)

    assert {"Kitchen": 11.0, "Niche": 1.0} == areas(plan)
    assert 12 == pytest.approx(plan.area_m2)


# --- Walls that the file draws ----------------------------------------------------------------------


def test_gap_between_rooms_is_a_wall_and_the_passage_belongs_to_both(tmp_path):
    bath = feature(box(4.2, 0, 9, 3), "room", name="Bath")

    plan = read(tmp_path, KITCHEN, bath, DOOR)

    assert 12 + 4.8 * 3 + 0.2 * 0.9 == pytest.approx(plan.area_m2)
    assert {"Kitchen": 12.09, "Bath": 14.49} == areas(plan)
    assert (4.1, 1.0) == pytest.approx(plan.doorways[0].start)


@pytest.mark.parametrize(
    "door",
    [
        line((4, 1), (4, 1.9)),
        line((4.3, 1), (4.3, 1.9)),
        line((4.15, 1.9), (4.15, 1)),
        box(4, 1, 4.3, 1.9),
    ],
)
def test_door_may_be_drawn_anywhere_in_the_wall(tmp_path, door):
    bath = feature(box(4.3, 0, 9, 3), "room")

    plan = read(tmp_path, KITCHEN, bath, feature(door, "door"))

    (doorway,) = plan.doorways
    assert [4.15, 4.15] == pytest.approx([doorway.start[0], doorway.end[0]])
    assert 0.9 == pytest.approx(doorway.width_m)
    assert 12 + 4.7 * 3 + 0.3 * 0.9 == pytest.approx(plan.area_m2)


def test_free_areas_are_free_and_rooms_are_their_names_then(tmp_path):
    plan = read(tmp_path, feature(box(0, 0, 9, 3), "free"), KITCHEN)

    assert {"Kitchen": 12.0, "unknown_1": 15.0} == areas(plan)


def test_walls_as_lines_need_a_thickness(tmp_path):
    plan = read(tmp_path, KITCHEN, feature(line((1, 1), (2, 1)), "wall"), wall_m=0)

    assert 12 == pytest.approx(plan.area_m2)
    assert ("walls drawn as lines: 1, ignored as wall_m is 0",) == plan.notes


def test_opening_where_there_is_no_wall_is_a_doorway(tmp_path):
    door = feature(line((4, 0), (4, 3)), "opening", name="arch")

    plan = read(tmp_path, KITCHEN, BEDROOM, door, wall_m=0)

    assert [("arch", False)] == [(d.name, d.leaf) for d in plan.doorways]


def test_door_that_leads_outside_stays_shut_and_is_the_entrance(tmp_path):
    plan = read(tmp_path, KITCHEN, feature(line((0, 1), (0, 2)), "door", name="front"))

    assert (0.3, 1.5) == plan.entrance
    assert () == plan.doorways
    assert "the door front leads outside: it stays shut" in plan.notes


def test_door_in_no_wall_is_ignored_with_a_note(tmp_path):
    plan = read(tmp_path, KITCHEN, feature(line((20, 1), (20, 2)), "door"))

    assert ("the door features[1] is in no room's wall: ignored",) == plan.notes


# --- What is in it ----------------------------------------------------------------------------------


@pytest.mark.parametrize("at", [(2.0, 1.0), (0.0, 1.0), (-0.2, 1.0)])
def test_entrance_is_inside_where_it_is_drawn_or_nearby(tmp_path, at):
    plan = read(tmp_path, KITCHEN, feature(point(*at), "entrance"))

    assert (max(at[0], 0.1), 1.0) == plan.entrance


def test_entrance_far_outside_is_refused(tmp_path):
    with pytest.raises(FloorPlanError, match=r"the entrance of flat at .* is not in free space"):
        read(tmp_path, KITCHEN, feature(point(30, 1), "entrance"))


def test_objects_and_no_go_areas_are_taken_over(tmp_path):
    bed = feature(
        box(5, 1, 7, 2.5), "object", type="bed", blocks="path",
        uses=[{"x": 6, "y": 2, "heading": 1.5, "posture": "lie"}],
    )  # fmt: skip
    sensor = feature(point(1, 1), "object", type="motion sensor", name="pir", blocks="nothing")
    area = feature(box(0, 2, 1, 3), "no_go")

    plan = read(tmp_path, KITCHEN, BEDROOM, bed, sensor, area)

    assert [("bed_1", "bed"), ("pir", "motion_sensor")] == [(o.name, o.type) for o in plan.objects]
    (use,) = plan.objects[0].uses
    assert (6.0, 2.0, 1.5, "lie") == (use.x, use.y, use.heading, use.posture)
    assert (0.95, 0.95, 1.05, 1.05) == pytest.approx(plan.objects[1].footprint.bounds)
    assert [(0.0, 2.0, 1.0, 3.0)] == [area.bounds for area in plan.no_go]


@pytest.mark.parametrize(
    ("properties", "name", "kind"),
    [
        ({"type": "Kitchen"}, "kitchen_1", "kitchen"),
        ({"usage": "Living Room"}, "living_room_1", "living_room"),
        ({"name": "Bedroom 2"}, "Bedroom 2", "bedroom"),
        ({"name": "Blue room", "category": "office"}, "Blue room", "office"),
        ({"name": "A 101"}, "A 101", "unknown"),
        ({"name": "A 101", "type": "yoga studio"}, "A 101", "yoga_studio"),
        ({"name": {"de": "Küche", "en": "Kitchen"}}, "Kitchen", "kitchen"),
        ({"type": "room", "name": "Bad"}, "Bad", "bathroom"),
        ({"name": "  ", "type": 3}, "unknown_1", "unknown"),
        ({"category": "restroom.female"}, "toilet_1", "toilet"),
    ],
)
def test_room_has_the_type_of_its_use_else_of_its_name(tmp_path, properties, name, kind):
    (room,) = read(tmp_path, feature(box(0, 0, 4, 3), None, **properties)).rooms

    assert (name, kind) == (room.name, room.type)


def test_rooms_of_one_name_get_numbers(tmp_path):
    plan = read(tmp_path, KITCHEN, {**BEDROOM, "properties": {"name": "Kitchen"}})

    assert ["Kitchen", "Kitchen 2"] == [room.name for room in plan.rooms]
    assert "several rooms are called Kitchen: one of them is Kitchen 2 here" in plan.notes


def test_what_has_no_kind_is_counted_in_a_note(tmp_path):
    others = [feature(point(1, 1)), feature(line((0, 0), (1, 1))), imdf(None, "venue")]

    plan = read(tmp_path, KITCHEN, *others)

    assert (
        "also in the file, without effect on the plan: Point without a kind (1),"
        " LineString without a kind (1), venue (1)",
    ) == plan.notes


# --- IMDF and floors --------------------------------------------------------------------------------


def test_imdf_units_openings_and_fixtures_are_read(tmp_path):
    door = {"type": "swinging", "automatic": False, "material": "wood"}
    unit = {"level_id": "l0"}
    plan = read(
        tmp_path,
        imdf(box(0, 0, 4, 3), "unit", category="kitchen", name=None, **unit),
        imdf(box(4, 0, 9, 3), "unit", category="walkway", name={"en": "Aisle"}, **unit),
        imdf(box(1, 1, 1.5, 1.5), "unit", category="column", name=None, **unit),
        imdf(box(0, 3, 4, 9), "unit", category="opentobelow", name=None, **unit),
        imdf(line((4, 0.5), (4, 1.5)), "opening", category="pedestrian", door=door, **unit),
        imdf(line((4, 2), (4, 3)), "opening", category="pedestrian", door=None, **unit),
        imdf(box(7, 1, 8, 2), "fixture", category="desk", **unit),
        units="m",
    )

    assert [("kitchen_1", "kitchen"), ("Aisle", "hallway")] == [
        (r.name, r.type) for r in plan.rooms
    ]
    assert [True, False] == [d.leaf for d in plan.doorways]
    assert ["desk_1"] == [thing.name for thing in plan.objects]
    assert plan.room_at(1.25, 1.25) is None


FLOORS = (
    imdf(box(0, 0, 9, 3), "level", ordinal=1, name={"en": "Upstairs"}),
    imdf(box(0, 0, 9, 3), "level", ordinal=0, short_name={"en": "G"}),
    imdf(box(0, 0, 3, 3), "unit", category="office", name={"en": "Up"}, level_id="b"),
    imdf(box(0, 0, 4, 3), "unit", category="office", name={"en": "Down"}, level_id="a"),
)
FLOORS[0]["id"], FLOORS[1]["id"] = "b", "a"


@pytest.mark.parametrize(
    ("level", "room"),
    [("0", "Down"), ("G", "Down"), ("a", "Down"), ("1", "Up"), ("Upstairs", "Up")],
)
def test_one_level_is_taken(tmp_path, level, room):
    plan = read(tmp_path, *FLOORS, units="m", level=level)

    assert [room] == [plan_room.name for plan_room in plan.rooms]
    other = {"Down": "G is used, not Upstairs", "Up": "Upstairs is used, not G"}[room]
    assert (f"of its levels, {other}",) == plan.notes


def test_floor_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(FloorPlanError, match="no level '7'; its levels are: a or 0 or G, b or 1"):
        read(tmp_path, *FLOORS, units="m", level="7")


# --- Units ------------------------------------------------------------------------------------------


def on_earth(geometry, latitude, longitude):
    """Metres about a place as longitude and latitude, by WGS 84's radii of curvature."""
    square = 1 - 0.00669437999014 * math.sin(math.radians(latitude)) ** 2
    east = 6378137 / square**0.5 * math.cos(math.radians(latitude)) * math.radians(1)
    north = 6378137 * (1 - 0.00669437999014) / square**1.5 * math.radians(1)
    shape = shapely.from_geojson(json.dumps(geometry))
    degrees = shapely.transform(shape, lambda xy: xy / (east, north) + (longitude, latitude))
    return json.loads(shapely.to_geojson(degrees))  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("latitude", "longitude"), [(48.1, 11.6), (-33.9, 151.2), (0, 0), (69, -20)]
)
def test_longitude_and_latitude_become_metres(tmp_path, latitude, longitude):
    both = [
        {**f, "geometry": on_earth(f["geometry"], latitude, longitude)}
        for f in (KITCHEN, BEDROOM, DOOR)
    ]

    plan = read(tmp_path, *both)

    assert (-4.5, -1.5, 4.5, 1.5) == pytest.approx(plan.bounds, abs=0.002)
    assert 27 - 0.1 * 2.1 == pytest.approx(plan.area_m2, abs=0.02)
    assert 1 == len(plan.doorways)
    assert any("became metres east and north of" in note for note in plan.notes)


def test_units_can_be_set_by_the_file_and_by_the_setting(tmp_path):
    small = feature(box(0, 0, 0.3, 0.3), "room")
    path = write(tmp_path, small, units="m")

    assert 0.09 == pytest.approx(read_geojson(path).area_m2)
    with pytest.raises(FloorPlanError, match="too large"):
        read_geojson(path, units="degrees")
    with pytest.raises(
        FloorPlanError, match=r"0\.3 wide, which is small in metres and large in deg"
    ):
        read(tmp_path, small)


@pytest.mark.parametrize("units", ["feet", 3, None, [1]])
def test_unknown_units_are_refused(tmp_path, units):
    with pytest.raises(FloorPlanError, match="m, degrees or auto is expected"):
        read_geojson(write(tmp_path, KITCHEN, units=units))


def test_metres_far_from_the_origin_come_near_it(tmp_path):
    far = feature(box(691_000.5, 5_334_000, 691_004.5, 5_334_003), "room")

    plan = read(tmp_path, far)

    assert (0.5, 0.0, 4.5, 3.0) == pytest.approx(plan.bounds)
    assert plan.notes[0].startswith(
        "its coordinates count from (691000, 5334000) here; they are in"
    )
    assert 1 == len(plan.notes)


# --- Writing ----------------------------------------------------------------------------------------


def test_plan_written_as_geojson_comes_back_equal(tmp_path):
    plan = read(
        tmp_path, KITCHEN, BEDROOM, DOOR, feature(box(0, 2, 1, 3), "no_go"),
        feature(point(1, 1), "entrance"), feature(box(5, 1, 6, 2), "object", type="table"),
    )  # fmt: skip

    save_floorplan(plan, tmp_path / "again.geojson")

    assert plan == load_floorplan(tmp_path / "again.geojson")


@pytest.mark.parametrize("seed", [3, 4])
def test_synthetic_home_written_as_geojson_comes_back_with_its_front_door(tmp_path, seed):
    """It stands across its sill, behind which the plan ends, and stayed shut."""
    plan = load_floorplan(f"synthetic:{seed}")
    path = write(tmp_path)
    path.write_text(json.dumps(geojson_document(plan)))

    again = load_floorplan(path)

    assert () == again.notes
    assert plan.doorways == again.doorways
    assert plan.free_space.equals(again.free_space)


@pytest.mark.parametrize("y", [0.0, 0.1])
def test_door_along_an_outer_wall_of_free_space_leads_outside(tmp_path, y):
    plan = read(tmp_path, feature(box(0, 0, 5, 4), "free"), feature(line((1, y), (2, y)), "door"))

    assert () == plan.doorways
    assert "leads outside" in plan.notes[0]


# --- As a component, and wrong files ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (3, r"features\[0\] is 3: a Feature is expected"),
        (feature(None, "room"), r"features\[0\]\.geometry is null"),
        (feature(point(1, 1), "room"), r'of a room is "Point": Polygon, MultiPolygon is expected'),
        (feature(box(0, 0, 1, 1), "rom"), "unknown kind \"rom\": did you mean 'room'"),
        (feature(box(0, 0, 1, 1), ["room"]), "unknown kind"),  # type: ignore[arg-type]
        (feature({"type": "Polygon"}, "room"), "coordinates is null: a list"),
        (feature({"type": "Polygon", "coordinates": []}, "room"), "is empty"),
        (feature({"type": "Polygon", "coordinates": [[[0, 0], [1, 1]]]}, "room"), "2 different"),
        (
            feature(box(0, 0, float("nan"), 1), "room"),
            r"\[1\] is \[NaN, 0\]: NaN is not a coordinate",
        ),
        (feature(box(0, 0, 10**400, 1), "room"), "is not a coordinate"),
        (feature(box(0, 0, True, 1), "room"), "true is not a coordinate"),
        (feature(line((1, 1), (1, 1)), "door"), "1 different points: at least 2"),
        (feature(box(1, 1, 2, 2), "object", blocks="air"), "one of nothing, path, sight"),
        (feature(box(1, 1, 2, 2), "object", uses=3), r"properties\.uses is 3: a list"),
        (feature(box(1, 1, 2, 2), "object", heading="up"), "heading"),
        ({**KITCHEN, "properties": 3}, "properties is 3"),
    ],
)
def test_damaged_feature_is_refused_with_its_place(tmp_path, wrong, message):
    path = write(tmp_path, wrong, KITCHEN)

    with pytest.raises(FloorPlanError, match=message) as caught:
        read_geojson(path)

    assert str(caught.value).startswith(f"{path}: ")
    assert "features[0]" in str(caught.value)


@pytest.mark.parametrize(
    ("features", "message"),
    [
        ([], "no room and no free space"),
        ([DOOR], "no room and no free space"),
        ([KITCHEN, feature(box(-1, -1, 9, 9), "wall")], "all of it is wall"),
    ],
)
def test_file_without_space_is_refused(tmp_path, features, message):
    with pytest.raises(FloorPlanError, match=message):
        read(tmp_path, *features)


def test_other_json_is_refused(tmp_path):
    path = write(tmp_path)
    path.write_text('{"type": "Feature"}')

    with pytest.raises(FloorPlanError, match='no GeoJSON plan: "type": "FeatureCollection"'):
        read_geojson(path)


def test_outline_that_crosses_itself_is_repaired_with_a_note(tmp_path):
    bow = ring((0, 0), (4, 4), (4, 0), (0, 4))

    plan = read(tmp_path, feature(bow, "room"))

    assert 8 == pytest.approx(plan.area_m2, abs=0.01)
    assert "features[0].geometry.coordinates touches or crosses itself at (2, 2)" in plan.notes[0]


def test_glass_walls_of_imdf_are_seen_through(tmp_path):
    units = [
        imdf(box(0, 0, 4, 3), "unit", category="room"),
        imdf(box(4.2, 0, 8, 3), "unit", category="office"),
        imdf(box(4, 0, 4.2, 3), "unit", category="glass"),
    ]
    plan = load_floorplan(write(tmp_path, *units, units="m"))

    assert 1 == len(plan.glass)
    assert () == plan.doorways


def mapped(k):
    """An indoor map of the home: in metres or degrees, doors as points or lines, with noise."""
    home = small_home(k, turns=(0, 30, 90))
    noise = noisy(k, 0.015)
    is_osm = k % 2 == 1
    (_, _, x, y), (_, y1, _, top), (x1, _, right, _) = home.rooms
    shift = INNER_M / 2 if k % 4 < 2 else 0.0  # rooms touch, or have the gap of a wall between them
    boxes = [
        (0, 0, x + shift, y + shift),
        (0, y1 - shift, x + shift, top),
        (x1 - shift, 0, right, top),
    ]
    features = []
    for place, name in zip(boxes, home.names, strict=True):
        corners = [noise(corner) for corner in home.corners(place)]
        tags = {"indoor": "room", "level": "0"} if is_osm else {"kind": "room"}
        features.append(feature(ring(*corners), **tags, name=name))
    for line_ in (*home.doors, home.front):
        start, end = (noise(home.place(p)) for p in line_)
        middle = np.mean([start, end], axis=0).tolist()
        if is_osm:
            features.append(feature(point(*middle), door="hinged", level="0", width="0.9"))
        else:
            shape = point(*middle) if k % 6 == 0 else line(start, end)
            features.append(feature(shape, kind="door"))
    if is_osm:
        features.append(feature(box(-1, -1, 20, 20), building="yes"))
    if k % 3 == 2:
        return [{**f, "geometry": on_earth(f["geometry"], 48.1, 11.6)} for f in features]
    return features


@pytest.mark.parametrize("k", VARIATIONS)
def test_maps_of_any_unit_language_and_noise_are_the_home(tmp_path, k):
    plan = read(tmp_path, *mapped(k))

    check(plan, small_home(k), slack=0.03)


def storey_maps():
    """OpenStreetMap: two storeys, stairs and a lift on both, and a room of three."""

    def unit(x0, x1, level, **tags):
        return feature(box(x0, 0, x1, 3), indoor="room", level=level, **tags)

    return [
        unit(0, 4, "0", name="Kitchen"),
        unit(0, 4, "1", name="Bedroom"),
        unit(4, 6, "0;1", stairs="yes"),
        unit(6, 8, "0-1", highway="elevator"),
        *(feature(point(x, 1.5), door="yes", level="0;1") for x in (4, 6)),
    ]


def test_storeys_of_openstreetmap_lie_side_by_side(tmp_path):
    plan = read(tmp_path, *storey_maps(), units="m")

    assert 2 == len(plan.polygons)
    assert ["lift", "stairs"] == sorted(portal.type for portal in plan.portals)
    assert 1 == fleet2d.Home(plan).space(0.2, uses_portals=True).parts
    assert {"Kitchen", "Bedroom"} <= {room.name for room in plan.rooms}
    save_floorplan(plan, tmp_path / "again.geojson")
    assert plan.portals == load_floorplan(tmp_path / "again.geojson").portals
    upstairs = read_geojson(tmp_path / "flat.geojson", units="m", level="1")
    names = {room.name for room in upstairs.rooms}
    assert "Bedroom" in names
    assert "Kitchen" not in names


@pytest.mark.parametrize("k", range(20))
def test_three_centimetres_of_noise_keep_the_door(tmp_path, k):
    """Rooms that touch up to a gap or an overlap of 3 cm."""
    noise = noisy(k, 0.015)
    rooms = [
        feature(
            ring(*(noise(corner) for corner in ((x, 0), (x + 4, 0), (x + 4, 3), (x, 3)))),
            "room",
            name=name,
        )
        for x, name in ((0, "Kitchen"), (4, "Bedroom"))
    ]
    door = feature(line(noise((4, 1)), noise((4, 1.9))), kind="door")

    plan = read(tmp_path, *rooms, door, units="m")

    assert 1 == len(plan.polygons)
    assert [True] == [d.leaf for d in plan.doorways]
    assert plan.doorways[0].width_m == pytest.approx(0.9, abs=0.1)
    assert plan.area_m2 == pytest.approx(24 - 0.1 * 2.1, abs=0.3)


def test_a_room_may_name_its_building(tmp_path):
    room = feature(box(0, 0, 4, 3), name="Kitchen", building="House A")

    assert ["Kitchen"] == [r.name for r in read(tmp_path, room, units="m").rooms]


@pytest.mark.parametrize("name", ["urn:ogc:def:crs:EPSG::3857", "EPSG:900913"])
def test_coordinates_of_web_mercator_are_refused_unless_their_unit_is_given(tmp_path, name):
    crs = {"type": "name", "properties": {"name": name}}
    path = tmp_path / "mercator.geojson"
    path.write_text(json.dumps({**SAMPLE[1], "crs": crs}))

    with pytest.raises(FloorPlanError, match=r"Web Mercator .*export it in EPSG:4326"):
        load_floorplan(path)
    assert GeoJson(path=path, units="m").load().area_m2 > 20
    assert GeoJson(path=path, scale=0.61).load().area_m2 > 8
    crs["properties"]["name"] = "urn:ogc:def:crs:EPSG::32633"
    path.write_text(json.dumps({**SAMPLE[1], "crs": crs}))
    assert load_floorplan(path).area_m2 > 20  # another system in metres


def test_latitudes_before_longitudes_are_refused(tmp_path):
    room = ring((37.7, -122.4), (37.70004, -122.4), (37.70004, -122.39995))
    path = write(tmp_path, feature(room, "room", name="Kitchen"))

    with pytest.raises(FloorPlanError, match=r"no latitude is -122.*\[longitude, latitude\]"):
        load_floorplan(path)
