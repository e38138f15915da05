import json

import pytest
import yaml
from tests.meshed_homes import plan_files

from fleet2d.configuration.components import lookup
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.native import (
    Bundled,
    Native,
    native_document,
    read_native,
)
from fleet2d.floorplan.space import Space

OUTLINE = [[0, 0], [5, 0], [5, 3], [0, 3]]
PLAN = {"format": "fleet2d-floorplan", "version": 1, "name": "flat", "free": [{"outline": OUTLINE}]}

BED = {"type": "bed", "footprint": [[1, 1], [3, 1], [3, 2], [1, 2]]}
USE = {"x": 2, "y": 1.5, "heading": 0.5}

# A file with all that the format has; `test_damaged_files.py` damages it.
SAMPLE = ("plan.json", {
    "format": "fleet2d-floorplan",
    "version": 1,
    "name": "flat",
    "free": [{"outline": [[0, 0], [4, 0], [4, 3], [0, 3]], "holes": [[[1, 1], [1, 2], [2, 2], [2, 1]]]}],
    "rooms": [
        {"name": "den", "type": "office", "labels": ["office"], "polygon": [[0, 0], [4, 0], [4, 3], [0, 3]]},
        {"type": "kitchen", "region": [{"outline": [[0, 0], [1, 0], [1, 3], [0, 3]]}]},
    ],
    "doorways": [{"name": "gate", "start": [0, 1.5], "end": [1, 1.5], "leaf": False}],
    "objects": [
        {
            "name": "bed", "type": "bed", "footprint": [[2.5, 1], [3.5, 1], [3.5, 2], [2.5, 2]],
            "blocks": "path", "heading": 0.5,
            "uses": [{"x": 3, "y": 2.4, "heading": 1, "posture": "lie", "approach": [3, 2.5]}],
        },
    ],
    "no_go": [[[0, 0], [1, 0], [1, 1]]],
    "entrance": [0.5, 0.5],
})  # fmt: skip


def write(folder, content):
    path = folder / "plan.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def read(folder, **content):
    return read_native(write(folder, {**PLAN, **content}))


def test_plan_written_by_hand_is_read(tmp_path):
    hole = [[3, 1], [4, 1], [4, 2], [3, 2]]
    kitchen = {"type": "Kitchen", "polygon": [[0, 0], [2, 0], [2, 3], [0, 3]]}

    plan = read(
        tmp_path,
        free=[{"outline": OUTLINE, "holes": [hole]}],
        rooms=[kitchen, {"type": "unknown", "name": "den", "region": [{"outline": OUTLINE}]}],
        entrance=[4.5, 0.5],
    )

    assert 14.0 == pytest.approx(plan.area_m2)
    assert [("kitchen_1", "kitchen", ("kitchen",)), ("den", "unknown", ())] == [
        (room.name, room.type, room.labels) for room in plan.rooms
    ]
    assert (4.5, 0.5) == plan.entrance
    assert plan.room_at(3.5, 1.5) is None


@pytest.mark.parametrize("cell", [0.05, 0.2, 1.0])
def test_every_plan_comes_back_equal(shared_data, tmp_path, cell):
    for path in plan_files(shared_data):
        if path.name.startswith("f1ac") and cell < 0.1:
            continue  # the largest takes seconds
        plan = load_floorplan(path, cell)

        again = read_native(write(tmp_path, native_document(plan)), cell)

        assert plan.digest == again.digest, path.name
        assert plan.rooms == again.rooms
        assert plan.mesh.triangles.tolist() == again.mesh.triangles.tolist()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "x"}, 'no Fleet2D floor plan: "format" is not "fleet2d-floorplan"$'),
        ({"format": None, "verts": []}, "it looks like HouseExpo: use type houseexpo"),
        ({"version": 2}, "version 2 of the format is not known: this Fleet2D reads 1"),
        ({"roms": []}, "the plan has an unknown key 'roms': did you mean 'rooms'"),
        ({"name": 3}, "name is 3: a text is expected"),
        ({"free": {}}, "free is {}: a list is expected"),
        ({"free": 3}, "free is 3: a list is expected"),
        ({"free": []}, "the outline of flat encloses no area"),
        ({"free": [{"outline": OUTLINE[:2]}]}, r"free\[0\]\.outline has 2 different points"),
        ({"free": [{"holes": []}]}, r"free\[0\] has no key 'outline'"),
        ({"free": [[3, 4]]}, r"free\[0\] has 1 different points"),
        (
            {"free": [{"outline": [[0, 0], [4, 4], [4, 0], [0, 4]]}]},
            r"free\[0\] is not a valid outline: self-intersection at \(2, 2\) m",
        ),
        ({"rooms": [{"type": "hall"}]}, r"rooms\[0\] needs either polygon .* or region"),
        ({"rooms": [{"polygon": OUTLINE}]}, r"rooms\[0\] has no key 'type'"),
        ({"rooms": [{"type": 3, "polygon": OUTLINE}]}, r"rooms\[0\]\.type is 3: a text"),
        ({"rooms": [{"type": "hall", "name": "", "polygon": OUTLINE}]}, r'\.name is "": a text'),
        ({"rooms": [{"type": "hall", "labels": "x", "polygon": OUTLINE}]}, 'labels is "x": a list'),
        ({"rooms": [{"type": "hall", "poligon": OUTLINE}]}, "did you mean 'polygon'"),
        ({"doorways": {}}, "doorways is {}: a list"),
        ({"doorways": [{"start": [0, 0]}]}, r"doorways\[0\] has no key 'end'"),
        ({"doorways": [{"start": [0, 0], "end": 3}]}, r"doorways\[0\]\.end is 3: a list of 2"),
        ({"doorways": [{"start": [0, 0], "end": [1, 1], "leaf": 1}]}, "leaf is 1: true or false"),
        ({"doorways": [{"start": [0, 0], "end": [1, 1], "name": ""}]}, 'name is "": a text'),
        ({"doorways": [{"start": [0, 0], "end": [1, 1], "lef": True}]}, "did you mean 'leaf'"),
        ({"objects": [{"footprint": OUTLINE}]}, r"objects\[0\] has no key 'type'"),
        ({"objects": [{"type": "", "footprint": OUTLINE}]}, r'objects\[0\]\.type is "": a text'),
        ({"objects": [{"type": "bed", "footprint": [[0, 0]]}]}, "footprint has 1 different points"),
        ({"objects": [{**BED, "blocks": "air"}]}, 'blocks is "air": one of nothing, path, sight'),
        ({"objects": [{**BED, "heading": "north"}]}, "heading .* is not a number"),
        ({"objects": [{**BED, "heading": 90}]}, r"heading is 90, .* 1\.5708 if it is in degrees"),
        ({"objects": [{**BED, "uses": [{**USE, "heading": -90}]}]}, r"\.heading is -90, more than"),
        ({"objects": [{**BED, "uses": [{"x": 1, "y": 1}]}]}, r"uses\[0\] has no key 'heading'"),
        ({"objects": [{**BED, "uses": [{**USE, "posture": "hang"}]}]}, "one of stand, sit, lie"),
        ({"objects": [{**BED, "uses": [{**USE, "approach": 1}]}]}, "approach is 1: a list of 2"),
        ({"no_go": [[0, 0], [1, 1]]}, r"no_go\[0\]\[0\] is 0: a list of 2 numbers"),
        ({"no_go": [[[0, 0], [2, 2], [2, 0], [0, 2]]]}, r"no_go\[0\] is not a valid outline"),
        ({"entrance": [9, 9]}, r"the entrance of flat at \(9, 9\) m is not in free space"),
        ({"entrance": "door"}, 'entrance is "door": a list of 2 numbers'),
    ],
)
def test_what_is_no_plan_is_refused_with_the_place(tmp_path, change, message):
    with pytest.raises(FloorPlanError, match=message) as caught:
        read(tmp_path, **change)

    assert str(tmp_path / "plan.json") in str(caught.value)


def test_a_key_that_is_there_twice_is_refused(tmp_path):
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(PLAN)[:-1] + ', "version": 1}')

    with pytest.raises(FloorPlanError, match="the key 'version' is given twice"):
        load_floorplan(path)


def test_yaml_and_json_are_the_same(tmp_path):
    content = {
        **PLAN,
        "objects": [{**BED, "uses": [{**USE, "posture": "lie"}]}],
        "no_go": [OUTLINE],
    }
    path = tmp_path / "plan.yaml"
    path.write_text(yaml.safe_dump(content))  # with aliases, as the outline is in it twice

    plan = read_native(path)

    assert plan == read_native(write(tmp_path, content))
    assert plan == load_floorplan(path)
    assert [("bed_1", "lie")] == [(thing.name, thing.uses[0].posture) for thing in plan.objects]


def test_doorways_that_a_file_leaves_out_are_searched(tmp_path):
    """An empty list means that there are none."""
    pinched = [[0, 0], [3, 0], [3, 1], [3.1, 1], [3.1, 0], [6, 0], [6, 3], [3.1, 3], [3.1, 1.9]]
    pinched += [[3, 1.9], [3, 3], [0, 3]]
    rooms = [
        {"type": "kitchen", "polygon": [[0, 0], [3.05, 0], [3.05, 3], [0, 3]]},
        {"type": "hall", "polygon": [[3.05, 0], [6, 0], [6, 3], [3.05, 3]]},
    ]

    searched = read(tmp_path, free=[{"outline": pinched}], rooms=rooms)
    none = read(tmp_path, free=[{"outline": pinched}], rooms=rooms, doorways=[])

    assert [0.9] == [pytest.approx(door.width_m) for door in searched.doorways]
    assert () == none.doorways
    assert searched == read_native(write(tmp_path, native_document(searched)))
    assert none == read_native(write(tmp_path, native_document(none)))


def test_native_and_bundled_are_found_by_name(tmp_path):
    source = Native.model_validate({"path": str(write(tmp_path, PLAN)), "cell": 0.1})

    assert 0.1 == source.load().lattice.cell
    assert Native is lookup("floorplan", "native")
    assert Bundled is lookup("floorplan", "bundled")


# --- The bundled home ---------------------------------------------------------------------------


def test_family_home_has_the_size_of_the_papers_and_every_room():
    plan = Bundled().load()

    assert 184 <= plan.area_m2 <= 188
    assert {"bedroom": 3, "bathroom": 2, "kitchen": 1, "living_room": 1, "dining_room": 1} == {
        kind: len(plan.rooms_of_type(kind))
        for kind in ("bedroom", "bathroom", "kitchen", "living_room", "dining_room")
    }
    for kind in ("entryway", "hallway", "office", "laundry", "storage"):
        assert plan.rooms_of_type(kind), kind
    assert () == plan.rooms_of_type("unknown")
    assert () == plan.notes
    assert plan.entrance is not None
    assert plan.room("entryway_1") == plan.room_at(*plan.entrance)


@pytest.mark.parametrize("cell", [0.05, 0.1])
def test_family_home_lets_a_body_of_25_cm_into_every_room(cell):
    plan = Bundled(cell=cell).load()
    space = Space(plan, radius=0.25)

    assert 1 == space.parts
    assert all(len(space.cells(room.index)) > 0 for room in plan.rooms)
    assert plan.entrance is not None
    assert 0 == space.part_at(*plan.lattice.to_lattice(plan.entrance).tolist())


def test_load_floorplan_refuses_what_it_does_not_know(tmp_path):
    with pytest.raises(FloorPlanError, match="not a floor plan that Fleet2D can read"):
        load_floorplan(write(tmp_path, {"walls": 3}))
    with pytest.raises(FloorPlanError, match="did you mean 'family_home'"):
        load_floorplan("family-home")
    with pytest.raises(FloorPlanError, match="there is no file"):
        load_floorplan(tmp_path / "nowhere.json")


# --- Written by hand ------------------------------------------------------------------------------


def rectangle(x0, y0, x1, y1):
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]


KITCHEN, OFFICE, PASSAGE = rectangle(0, 0, 4, 3), rectangle(4.2, 0, 8, 3), rectangle(4, 1, 4.2, 1.9)


def by_hand(folder, free, **keys):
    document = {"format": "fleet2d-floorplan", "version": 1, "free": free, **keys}
    return read_native(write(folder, document))


def test_rectangles_for_rooms_and_doorways_are_one_free_space(tmp_path):
    rooms = [{"type": "kitchen", "polygon": KITCHEN}, {"type": "office", "polygon": OFFICE}]

    plan = by_hand(tmp_path, [KITCHEN, OFFICE, PASSAGE], rooms=rooms)
    overlapping = by_hand(tmp_path, [KITCHEN, OFFICE, rectangle(3.9, 1, 4.5, 1.9)], rooms=rooms)

    assert 1 == len(plan.polygons)
    assert 12 + 11.4 + 0.18 == pytest.approx(plan.area_m2)
    assert ["kitchen_1", "office_1"] == [room.name for room in plan.rooms]
    assert [(0, 1)] == [tuple(sorted(door.rooms)) for door in plan.doorways]
    assert 0.9 == pytest.approx(plan.doorways[0].width_m)
    assert plan == overlapping
    assert () == plan.notes


def test_free_space_may_be_one_outline_or_one_area(tmp_path):
    plan = by_hand(tmp_path, KITCHEN)

    assert plan == by_hand(tmp_path, [KITCHEN]) == by_hand(tmp_path, [{"outline": KITCHEN}])
    assert plan.area_m2 == pytest.approx(12)


def test_door_in_no_wall_says_which_corner_may_be_missing(tmp_path):
    door = {"start": [4.1, 1], "end": [4.1, 1.9], "name": "office_door"}
    open_door = {"start": [2, 1], "end": [2, 1.9]}

    solid = by_hand(tmp_path, [KITCHEN, OFFICE], doorways=[door]).notes
    loose = by_hand(tmp_path, [KITCHEN], doorways=[open_door]).notes

    assert any("corners of the passage may be missing from (4.00, " in note for note in solid)
    assert any("(2.00, 1.90) is 1.10 m from the wall from (4.00, 3.00)" in n for n in loose)
