import copy
import json
import math
from itertools import combinations

import numpy as np
import pytest
import shapely
from pydantic import ValidationError

from fleet2d.configuration.components import lookup
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.native import native_document, read_native
from fleet2d.homes.formats.valetudo import (
    Valetudo,
    read_valetudo_charger,
    read_valetudo_path,
    read_valetudo_paths,
)

MAPS = (
    "dreame_d9_no_segments",
    "dreame_x40_named_rooms",
    "dreame_z10_named_rooms_and_paths",
    "roborock_s6_segments",
)
PIXEL_AREA = 0.05**2


def runs(x0, y0, x1, y1):
    """A box of pixels, the last row and column not in it, as Valetudo writes it."""
    return [number for y in range(y0, y1) for number in (x0, y, x1 - x0)]


def layer(kind, pixels, **meta):
    return {
        "__class": "MapLayer",
        "type": kind,
        "metaData": meta,
        "compressedPixels": list(pixels),
    }


def entity(kind, *points):
    return {"__class": "Entity", "type": kind, "metaData": {}, "points": list(points)}


KITCHEN = layer("segment", runs(10, 10, 50, 40), segmentId="3", name="Kitchen")
ROOM_17 = layer("segment", runs(50, 10, 70, 40), segmentId="17")
FLOOR = layer("floor", runs(10, 40, 30, 50))


def vacuum_map(*layers, **changes):
    return {
        "__class": "ValetudoMap",
        "metaData": {"version": 2},
        "size": {"x": 600, "y": 400},
        "pixelSize": 5,
        "layers": copy.deepcopy(list(layers or (KITCHEN, ROOM_17, FLOOR))),
        "entities": [],
        **changes,
    }


# A file with all that the format has; `test_damaged_files.py` damages it.
SAMPLE = (
    "vacuum.json",
    vacuum_map(
        {
            **layer("segment", runs(5, 5, 35, 25), segmentId="1", name="Kitchen", area=3000),
            "dimensions": {"pixelCount": 600},
        },
        {"type": "wall", "metaData": {}, "pixels": [6, 6, 7, 6]},
        entities=[
            entity("charger_location", 60, 60),
            entity("path", 60, 60, 90, 90),
            entity("no_go_area", 50, 50, 80, 50, 80, 80, 50, 80),
            entity("virtual_wall", 50, 90, 90, 90),
        ],
    ),
)


def read_valetudo(path, cell=None, **settings):
    """Read a map without cleaning, except where the settings ask for it."""
    plain = {"bridge_pixels": 0, "scrap_area_m2": 0.0, "borders": "exact"}
    return Valetudo.model_construct(path=path, cell=cell, **(plain | settings)).load()


def write(folder, content):
    path = folder / "home.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def home(folder, *layers, **changes):
    return read_valetudo(write(folder, vacuum_map(*layers, **changes)))


def refusal(folder, content):
    path = write(folder, content)
    with pytest.raises(FloorPlanError) as caught:
        read_valetudo(path)
    assert str(path) in str(caught.value)
    return str(caught.value)


def assert_box(expected, plan):
    assert pytest.approx(expected) == plan.bounds
    assert shapely.box(*expected).symmetric_difference(plan.free_space).area < 1e-9


# --- The real maps ------------------------------------------------------------------------------


def pixels_of(content, *kinds):
    """The pixels (x, y) of all layers of some kinds, decoded one by one."""
    pixels = set()
    for item in content["layers"]:
        if item["type"] not in kinds:
            continue
        packed, single = item.get("compressedPixels") or [], item.get("pixels") or []
        for x, y, count in zip(packed[::3], packed[1::3], packed[2::3], strict=True):
            pixels.update((x + k, y) for k in range(count))
        pixels.update(zip(single[::2], single[1::2], strict=True))
    return pixels


@pytest.mark.parametrize("name", MAPS)
def test_real_map_has_the_pixels_of_the_file_and_its_segments_as_rooms(shared_data, name):
    path = shared_data / "valetudo" / f"{name}.json"
    content = json.loads(path.read_text())
    segments = [item for item in content["layers"] if item["type"] == "segment"]
    wall = pixels_of(content, "wall")
    floor = pixels_of(content, "floor", "segment") - wall

    plan = read_valetudo(path, no_go="ignore")

    rows, columns = np.nonzero(plan.free)
    x0, y0 = (round(v / 0.05) for v in plan.lattice.origin)
    assert floor == set(zip((x0 + columns).tolist(), (-1 - y0 - rows).tolist(), strict=True))
    assert np.array_equal(plan.free, plan.room_of_cell >= 0)
    names = [s["metaData"].get("name") or f"segment_{s['metaData']['segmentId']}" for s in segments]
    if segments:
        names += ["unknown_1"] * ("floor" in {item["type"] for item in content["layers"]})
        assert names == [room.name for room in plan.rooms]
    else:  # rooms are found then
        assert {"room"} == {room.type for room in plan.rooms}
    for segment, room in zip(segments, plan.rooms, strict=False):
        in_wall = len(pixels_of({"layers": [segment]}, "segment") & wall)
        stated = segment["metaData"]["area"] / 100**2
        assert pytest.approx(stated - in_wall * PIXEL_AREA) == room.area_m2
        assert in_wall <= 4  # the x40 map has a few


@pytest.mark.parametrize("name", MAPS)
def test_real_path_runs_on_the_floor_of_the_plan_and_the_charger_has_a_place_before_it(
    shared_data, name
):
    """Entities and pixels share a frame: a mirrored or shifted path would leave the floor."""
    path = shared_data / "valetudo" / f"{name}.json"
    plan = read_valetudo(path)

    way = read_valetudo_path(path)

    recorded = [e for e in json.loads(path.read_text())["entities"] if e["type"] == "path"]
    assert (sum(len(e["points"]) for e in recorded) // 2, 2) == way.shape
    assert all(plan.room_at(x, y) is not None for x, y in way.tolist())
    (charger,) = plan.objects
    (place,) = charger.uses
    at = charger.footprint.centroid
    assert ("charger", "charger", "nothing") == (charger.name, charger.type, charger.blocks)
    assert read_valetudo_charger(path) == pytest.approx((at.x, at.y))
    assert plan.free_space.contains(shapely.Point(place.x, place.y).buffer(0.17))
    assert math.hypot(at.x - place.x, at.y - place.y) < 0.6
    assert math.atan2(at.y - place.y, at.x - place.x) == pytest.approx(
        math.remainder(place.heading, math.tau), abs=1e-5
    )


def test_real_map_with_german_names_has_rooms_of_known_types(shared_data):
    plan = read_valetudo(shared_data / "valetudo" / f"{MAPS[2]}.json")

    expected = {
        "Bad": "bathroom",
        "Schlafzimmer": "bedroom",
        "Küche": "kitchen",
        "Flur": "hallway",
        "Wohnzimmer": "living_room",
        "Essbereich": "dining_room",
        "Schreibtisch": "schreibtisch",
        "unknown_1": "unknown",
    }
    assert expected == {room.name: room.type for room in plan.rooms}


# --- Free space ---------------------------------------------------------------------------------


def test_pixels_become_metres_with_y_upwards(tmp_path):
    """Pixel (10, 20) covers 50 to 55 cm and 100 to 105 cm down."""
    plan = home(tmp_path, layer("floor", runs(10, 20, 30, 24)))

    assert_box((0.5, -1.2, 1.5, -1.0), plan)


def test_overlapping_runs_count_once(tmp_path):
    plan = home(tmp_path, layer("floor", [*runs(10, 10, 30, 20), 15, 12, 5, 29, 19, 1, 3, 3, 0]))

    assert_box((0.5, -1.0, 1.5, -0.5), plan)


def test_wall_removes_floor_with_a_note(tmp_path):
    plan = home(tmp_path, KITCHEN, layer("wall", [*runs(20, 20, 22, 22), *runs(0, 0, 90, 5)]))

    assert pytest.approx((40 * 30 - 4) * PIXEL_AREA) == plan.area_m2
    assert 1 == len(plan.polygons[0].interiors)
    assert "4 pixels are floor and wall: they count as wall" in plan.notes


def test_room_inside_a_ring_of_wall_is_apart(tmp_path):
    """An outline in the hole of another one."""
    inner = runs(20, 20, 30, 30)
    outer = [*runs(10, 10, 40, 15), *runs(10, 35, 40, 40), *runs(10, 15, 15, 35)]
    outer += runs(35, 15, 40, 35)

    plan = home(tmp_path, layer("floor", [*outer, *inner]))

    assert pytest.approx((900 - 400 + 100) * PIXEL_AREA) == plan.area_m2
    assert [0, 1] == sorted(len(polygon.interiors) for polygon in plan.polygons)


# --- Rooms --------------------------------------------------------------------------------------


def test_segments_of_one_name_get_names_of_their_own(tmp_path):
    boxes = [runs(10 * k, 0, 10 * k + 10, 10) for k in range(1, 5)]
    names = ["Bedroom", "Bedroom", "Bedroom 2", "Ku\u0308che"]

    plan = home(tmp_path, *(layer("segment", b, name=n) for b, n in zip(boxes, names, strict=True)))

    assert ["Bedroom", "Bedroom 3", "Bedroom 2", "Küche"] == [room.name for room in plan.rooms]
    assert ["bedroom", "bedroom", "bedroom", "kitchen"] == [room.type for room in plan.rooms]
    assert any("several segments are called Bedroom" in note for note in plan.notes)


def test_pixels_of_two_segments_belong_to_the_smaller(tmp_path):
    niche = layer("segment", runs(45, 10, 55, 20), segmentId="4", name="Niche")

    plan = home(tmp_path, KITCHEN, niche)

    assert [1150, 100] == [room.cells for room in plan.rooms]
    assert any("50 pixels are in several segments" in note for note in plan.notes)


# --- No-go areas and virtual walls ----------------------------------------------------------------


def test_no_go_areas_and_virtual_walls_are_areas_of_the_plan(tmp_path):
    entities = [
        entity("no_go_area", 101, 100, 114, 100, 114, 150, 101, 150),
        entity("virtual_wall", 50, 100, 250, 100),
    ]

    plan = home(tmp_path, KITCHEN, entities=entities)

    assert_box((0.5, -2.0, 2.5, -0.5), plan)
    assert [(1.01, -1.5, 1.14, -1.0), (0.5, -1.025, 2.5, -0.975)] == [a.bounds for a in plan.no_go]
    assert "no-go areas in the map: 1, robots keep out of them" in plan.notes
    assert plan == read_native(write(tmp_path, native_document(plan)))


def test_no_go_area_takes_every_pixel_that_it_touches_as_a_wall(tmp_path):
    """From 101 to 114 cm are the pixels 20 to 22, down to 150 cm the row 29."""
    area = entity("no_go_area", 101, 100, 114, 100, 114, 150, 101, 150)

    plan = read_valetudo(write(tmp_path, vacuum_map(KITCHEN, entities=[area])), no_go="wall")

    (hole,) = (shapely.Polygon(hole) for hole in plan.free_space.geoms[0].interiors)
    assert pytest.approx((1.0, -1.5, 1.15, -1.0)) == hole.bounds
    assert any("no-go areas in the map: 1, obstacles on 0.08 m2" in n for n in plan.notes)


@pytest.mark.parametrize("y", [100, 102])
def test_virtual_wall_parts_a_room(tmp_path, y):
    path = write(
        tmp_path, vacuum_map(KITCHEN, entities=[entity("virtual_wall", 50, y, 250, y + 31)])
    )

    plan = read_valetudo(path, no_go="wall")

    assert ("virtual walls in the map: 1, ignored",) == read_valetudo(path, no_go="ignore").notes
    assert 2 == len(plan.polygons)
    assert plan.area_m2 > 1140 * PIXEL_AREA - 0.2


@pytest.mark.parametrize(
    "bad",
    [
        entity("no_go_area", 60, 60, 200, 60, 130, 60),
        entity("virtual_wall", 60, 60, 60, 60),
        entity("virtual_wall"),
    ],
)
def test_no_go_area_without_extent_is_ignored_with_a_note(tmp_path, bad):
    plan = home(tmp_path, KITCHEN, entities=[bad])

    assert 1200 == plan.rooms[0].cells
    assert [f"entities[0], {bad['type']}, has no extent: ignored"] == list(plan.notes)


def test_no_go_area_beyond_the_floor_and_no_mop_area_change_nothing(tmp_path):
    far = entity("no_go_area", 9000, 9000, 9100, 9000, 9100, 9100)
    mop = entity("no_mop_area", 60, 60, 200, 60, 200, 150, 60, 150)

    plan = home(tmp_path, KITCHEN, entities=[far, mop])

    assert 1200 == plan.rooms[0].cells
    assert "also in the map, without effect on the plan: no_mop_area (1)" in plan.notes


def test_no_go_area_over_everything_leaves_no_floor(tmp_path):
    area = entity("no_go_area", 0, 0, 900, 0, 900, 900, 0, 900)

    path = write(tmp_path, vacuum_map(entities=[area]))

    with pytest.raises(FloorPlanError, match="no floor is left"):
        read_valetudo(path, no_go="wall")
    assert read_valetudo(path).area_m2 == read_valetudo(path, no_go="ignore").area_m2


# --- Path and charger -----------------------------------------------------------------------------


def test_path_and_charger_are_in_the_frame_of_the_plan(tmp_path):
    entities = [
        entity("path", 100, 100, 150, 100.5),
        entity("predicted_path", 1, 2, 3, 4),
        entity("path"),
        entity("charger_location", 60, 75),
        entity("path", 200, 150),
    ]
    path = write(tmp_path, vacuum_map(entities=entities))

    assert [[1.0, -1.0], [1.5, -1.005], [2.0, -1.5]] == read_valetudo_path(path).tolist()
    assert [2, 1] == [len(piece) for piece in read_valetudo_paths(path)]
    assert (0.6, -0.75) == read_valetudo_charger(path)
    plan = read_valetudo(path)
    assert plan.entrance is None
    assert "the vacuum's charger is at (0.60, -0.75) m" in plan.notes
    assert any("path is 0.5 m long, 3 points" in note for note in plan.notes)
    assert "also in the map, without effect on the plan: predicted_path (1)" in plan.notes


def test_map_without_path_and_with_a_charger_far_from_all_floor_is_read(tmp_path):
    path = write(tmp_path, vacuum_map(entities=[entity("charger_location", 5000, 5000)]))

    plan = read_valetudo(path)

    assert (0, 2) == read_valetudo_path(path).shape
    assert [] == read_valetudo_paths(path)
    assert [()] == [thing.uses for thing in plan.objects]
    assert plan == read_native(write(tmp_path, native_document(plan)))
    assert read_valetudo_charger(write(tmp_path, vacuum_map())) is None


@pytest.mark.parametrize("points", [None, [1], [1, "2"], [1, True], [1, float("nan")], [1, 1e99]])
@pytest.mark.parametrize("read", [read_valetudo_path, read_valetudo, read_valetudo_paths])
def test_damaged_path_is_refused(tmp_path, read, points):
    bad = {"type": "path", "points": points}
    path = write(tmp_path, vacuum_map(entities=[bad]))

    with pytest.raises(FloorPlanError, match=r"home\.json: entities\[0\]\.points"):
        read(path)


# --- As a component, and found by its content -------------------------------------------------------


def test_component_takes_the_cell_from_the_map_unless_it_is_set(tmp_path):
    path = write(tmp_path, vacuum_map(pixelSize=4))

    source = Valetudo(path=path)

    assert lookup("floorplan", "valetudo") is Valetudo
    assert 0.04 == source.cell == source.load().lattice.cell
    assert source.load() == load_floorplan(path)
    for plan in (Valetudo(path=path, cell=0.1).load(), load_floorplan(path, 0.1)):
        assert 0.1 == plan.lattice.cell
        assert pytest.approx(2000 * 0.04**2) == plan.area_m2
    with pytest.raises(ValidationError, match="keep_out"):
        Valetudo(path=path, no_go="maybe")


# --- Odd and damaged files --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"__class": "Map"}, "not a Valetudo map"),
        ({"metaData": {"version": 3}}, "version 3 of Valetudo's map format"),
        ({"metaData": None}, "version null"),
        ({"pixelSize": None}, "pixelSize is null"),
        ({"pixelSize": 0}, "pixelSize is 0"),
        ({"pixelSize": 0.05}, "1 to 100 cm"),
        ({"pixelSize": -5}, "pixelSize is -5"),
        ({"pixelSize": float("nan")}, "pixelSize is NaN"),
        ({"pixelSize": 10**400}, "pixelSize is a whole number of 1329 bits"),
        ({"size": {"x": 10**400, "y": 5}}, "size is"),
        ({"size": {"x": -1, "y": 5}}, "size is"),
        ({"size": [1, 2]}, "size is"),
        ({"layers": {}}, "layers is {}: a list"),
        ({"layers": [3]}, "layers[0] is 3"),
        ({"layers": []}, "no floor"),
        ({"layers": [layer("floor", [])]}, "no floor"),
        ({"layers": [layer("wall", runs(0, 0, 9, 9))]}, "no floor"),
        ({"layers": [FLOOR, layer("wall", runs(0, 0, 99, 99))]}, "no floor is left"),
        ({"layers": [layer("floor", [0, 0, 9, 0])]}, "cut off"),
        ({"layers": [{"type": "floor", "pixels": [1, 2, 3]}]}, "cut off"),
        ({"layers": [layer("floor", [0, 0, -4])]}, "negative length: [0, 0, -4]"),
        (
            {"layers": [layer("floor", [0, 0, 2**40])]},
            "layers[0].compressedPixels[2] is 1099511627776: 1048576 or less",
        ),
        ({"layers": [layer("floor", [0, 0, 1.5])]}, "[2] is 1.5: a whole number"),
        ({"layers": [layer("floor", [0, 0, True])]}, "[2] is true: a whole number"),
        ({"layers": [layer("floor", ["0", 0, 4])]}, 'compressedPixels[0] is "0": a whole number'),
        ({"layers": [{"type": "floor", "compressedPixels": "0 0 4"}]}, "a list is expected"),
        ({"layers": [layer("floor", [0, 0, 9, 10**6, 10**6, 9])]}, "spread over"),
        ({"layers": [layer("floor", [0, 0, 20_000])]}, "too large"),
        ({"entities": 5}, "entities is 5"),
    ],
)
def test_damaged_map_is_refused(tmp_path, changes, message):
    assert message in refusal(tmp_path, vacuum_map(**changes))


def test_pixels_beyond_the_stated_size_are_noted(tmp_path):
    for box in ((-5, 0, 20, 20), (100, 0, 130, 9), (0, 9, 9, 90)):
        plan = home(tmp_path, layer("floor", runs(*box)))
        assert any("reach beyond its size of 600 x 400 cm" in note for note in plan.notes)


def test_noise_is_refused_quickly(tmp_path):
    chequered = [n for y in range(300) for x in range(y % 2, 300, 2) for n in (x, y, 1)]

    assert "noise" in refusal(tmp_path, vacuum_map(layer("floor", chequered)))


def test_odd_layers_are_noted(tmp_path):
    short = {**KITCHEN, "dimensions": {"pixelCount": 1300}}
    empty = layer("segment", [], segmentId="9", name="  ")

    plan = home(tmp_path, short, empty, layer("carpet", [1, 2, 3]), size=None)

    assert (
        "the segment Kitchen has 1200 pixels, though its pixelCount says 1300",
        "the segment segment_9 has no pixels: ignored",
        'layers[2] is of the unknown type "carpet": ignored',
    ) == plan.notes


# --- Cleaning -----------------------------------------------------------------------------------

# Two rooms of 2 m x 1.5 m with 1.5 m between them, and a scrap.
LEFT = layer("segment", runs(0, 0, 40, 30), segmentId="1", name="Kitchen")
RIGHT = layer("segment", runs(42, 0, 82, 30), segmentId="2", name="Office")


def cleaned(folder, *layers, **settings):
    changes = {"entities": settings.pop("entities", [])}
    source = Valetudo(path=write(folder, vacuum_map(*layers, **changes)), **settings)
    return source.load()


def wall_with_gap(low, high):
    """The wall between the rooms, without the pixels from row `low` to `high`."""
    return layer("wall", [*runs(40, 0, 42, low), *runs(40, high, 42, 30)])


def test_wall_between_rooms_stays_unless_the_vacuum_drove_through(tmp_path):
    wall = wall_with_gap(0, 0)
    path = entity("path", 100, 75, 300, 75)

    shut = cleaned(tmp_path, LEFT, RIGHT, wall)
    driven = cleaned(tmp_path, LEFT, RIGHT, wall, entities=[path])

    assert 2 == len(shut.polygons)
    assert 1 == len(driven.polygons)


def test_segment_without_a_name_that_is_a_scrap_belongs_to_its_neighbor(tmp_path):
    tiny = layer("segment", runs(40, 0, 50, 10), segmentId="9")
    named = layer("segment", runs(40, 0, 50, 10), segmentId="9", name="Pantry")

    assert ["Kitchen"] == [room.name for room in cleaned(tmp_path, LEFT, tiny).rooms]
    assert 2 == len(cleaned(tmp_path, LEFT, named).rooms)
    assert 1 == len(cleaned(tmp_path, tiny).rooms)  # the only one


def test_narrow_border_of_segments_is_a_doorway(tmp_path):
    rooms = [
        layer("segment", runs(0, 0, 40, 60), segmentId="1", name="Kitchen"),
        layer("segment", [*runs(40, 20, 90, 40)], segmentId="2", name="Hall"),
        layer("segment", runs(90, 20, 120, 40), segmentId="3", name="Office"),
    ]

    plan = cleaned(tmp_path, *rooms)
    plain = cleaned(tmp_path, *rooms, borders="exact")

    assert {("Kitchen", "Hall"), ("Hall", "Office")} == {
        tuple(plan.rooms[room].name for room in sorted(door.rooms)) for door in plan.doorways
    }
    assert all(door.width_m == pytest.approx(1.0) for door in plan.doorways)
    assert len(plain.doorways) < 2


@pytest.mark.parametrize(
    ("name", "doorways"),
    [("S8_FW1286_with_obstacles", 5), ("converted_3790", 6), ("l10su_1121_carpet", 5)],
)
def test_captured_map_is_one_home_with_doorways_between_its_rooms(shared_data, name, doorways):
    """Two of these maps had a doorway twice: on both sides of one wall."""
    path = shared_data / "captured" / "vacuum" / f"{name}.json"
    if not path.exists():
        pytest.skip(f"there is no {path}")

    plan, before = Valetudo(path=path).load(), read_valetudo(path)

    assert 1 == len(plan.polygons) < len(before.polygons)
    assert doorways == len(plan.doorways)
    for one, other in combinations(plan.doorways, 2):
        middles = [np.mean([door.start, door.end], axis=0) for door in (one, other)]
        assert set(one.rooms) != set(other.rooms) or math.dist(*middles) > 0.5
    assert all(room.area_m2 >= 1 for room in plan.rooms)


def test_format_version_1_is_read(tmp_path):
    pixels = [n for y in range(30) for x in range(40) for n in (x, y)]
    segment = {"type": "segment", "metaData": {"segmentId": 1, "name": "Kitchen"}, "pixels": pixels}
    old = vacuum_map(segment, metaData={"version": 1})

    assert Valetudo(path=write(tmp_path, old)).load() == cleaned(tmp_path, LEFT)
