"""The check-up finds each fault in a home that has it, and none in a home without faults."""

import json

import pytest
import shapely
from tests.meshed_homes import plan_files
from typer.testing import CliRunner

from fleet2d.cli.__main__ import app
from fleet2d.floorplan.checkup import Finding, checkup
from fleet2d.floorplan.furniture import stand_furniture
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.native import native_document
from fleet2d.floorplan.placed_objects import PlacedObject
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.rooms.doorways import DoorLine

LEFT, RIGHT = shapely.box(0, 0, 5, 4), shapely.box(5.2, 0, 10, 4)
DOOR = shapely.box(5, 1.5, 5.2, 2.4)
FREE = shapely.union_all([LEFT, RIGHT, DOOR])
REGIONS = (
    LabelledRegion(("Living_room",), shapely.box(0, 0, 5.1, 4)),
    LabelledRegion(("Bedroom",), shapely.box(5.1, 0, 10, 4)),
)


def home(free: shapely.Geometry = FREE, regions=REGIONS, **parts) -> FloorPlan:  # type: ignore[no-untyped-def]
    return FloorPlan.build("home", free, regions, **parts)


def only(findings: list[Finding]) -> Finding:
    assert 1 == len(findings), [finding.text for finding in findings]
    return findings[0]


def test_sound_home_has_no_findings():
    assert [] == checkup(home(doorways=[DoorLine((5.1, 1.5), (5.1, 2.4))], entrance=(1, 1)))
    assert [] == checkup(load_floorplan())


def test_part_that_nothing_joins_is_found():
    shed = shapely.box(12, 0, 15, 4)
    plan = home(shapely.union_all([FREE, shed]), [*REGIONS, LabelledRegion(("Storage",), shed)])
    part, room = checkup(plan)

    assert ("parts", "wrong") == (part.kind, part.severity)
    assert "12.00 m2" in part.text
    assert part.at is not None
    assert shed.contains(shapely.Point(part.at))
    assert ("room", "a body of radius 0.15 m can't get to storage_1 (12.0 m2)") == (
        room.kind,
        room.text,
    )


def test_doorway_that_ends_before_the_wall_does_is_told_with_the_gap():
    short = shapely.box(5, 1.5, 5.19, 2.4)

    part = checkup(home(shapely.union_all([LEFT, RIGHT, short])))[0]

    assert "though they are only 0.009 m apart at (5.20, " in part.text  # 0.01 m on the lattice


def test_a_no_go_area_without_floor_is_noted():
    areas = [shapely.box(1, 1, 2, 2), shapely.box(100, 100, 101, 101)]

    assert home(no_go=areas).notes == (
        "no_go.1, from (100, 100) to (101, 101) m, has no part of the floor: robots keep out of"
        " nothing there",
    )


def test_no_go_areas_over_most_of_the_floor_are_found():
    finding = only(checkup(home(no_go=[shapely.box(0, 0, 10, 3)])))

    assert ("no_go", "wrong") == (finding.kind, finding.severity)
    assert "robots keep out of 75 % of the floor" in finding.text
    assert [] == checkup(home(no_go=[shapely.box(0, 0, 4, 4)]))


def test_misspelled_type_of_a_room_is_found_with_the_nearest_one():
    kichen = LabelledRegion(("Kichen",), shapely.box(0, 0, 5.1, 4))
    studio = LabelledRegion(("Yoga studio",), shapely.box(5.1, 0, 10, 4))

    finding = only(checkup(home(regions=[kichen, studio])))

    assert "kichen_1 has the unusual type 'kichen': did you mean 'kitchen'?" == finding.text


def test_small_parts_are_one_odd_finding():
    bits = [shapely.box(11 + i, 0, 11.3 + i, 0.5) for i in range(3)]
    findings = checkup(home(shapely.union_all([FREE, *bits])))
    parts = only([finding for finding in findings if finding.kind == "parts"])

    assert "odd" == parts.severity
    assert "joins 3 parts smaller than 0.5 m2" in parts.text


def test_room_with_too_narrow_a_door_is_found():
    narrow = shapely.union_all([LEFT, RIGHT, shapely.box(5, 1.5, 5.2, 1.9)])

    assert [] == checkup(home(narrow), radius=0.15)
    room = only(checkup(home(narrow), radius=0.22))
    assert ("room", "wrong") == (room.kind, room.severity)
    assert "a body of radius 0.22 m can't get to bedroom_1 (19.2 m2)" == room.text


def test_rooms_are_counted_from_the_entrance():
    narrow = shapely.union_all([LEFT, RIGHT, shapely.box(5, 1.5, 5.2, 1.9)])
    room = only(checkup(home(narrow, entrance=(7, 2)), radius=0.22))

    assert "can't get to living_room_1" in room.text


def test_entrance_where_nobody_can_stand_is_found():
    entrance = only(checkup(home(entrance=(0.05, 0.05))))

    assert ("entrance", (0.05, 0.05)) == (entrance.kind, entrance.at)


def test_furniture_that_shuts_a_room_is_named_as_the_cause():
    shelf = stand_furniture("shelf", (5.5, 2.0), 0, (1.6, 0.4))
    findings = checkup(home(objects=[shelf]))

    assert "furniture keeps a body of radius 0.15 m out of 15.7 m2 of bedroom_1" in findings[0].text


def test_furniture_in_the_doorway_is_named_as_the_cause():
    table = stand_furniture("table", (5.3, 1.95), 0, (0.85, 0.5))
    closet = shapely.box(5, 1.5, 5.7, 2.4)
    plan = home(LEFT.union(closet), [REGIONS[0], LabelledRegion(("Storage",), closet)])
    assert [] == checkup(plan)
    plan = home(LEFT.union(closet), plan.regions, objects=[table])

    assert "furniture keeps a body of radius 0.15 m out of storage_1" in checkup(plan)[0].text


def test_bed_that_nobody_can_get_to_is_found():
    bed = stand_furniture("single_bed", (9.5, 3.0), 1024, (0.9, 2.0), name="cot")
    fence = [
        PlacedObject("", "fence", shapely.box(8.6, 1.7, 10, 1.8)),
        PlacedObject("", "fence", shapely.box(8.6, 1.8, 8.8, 4)),
    ]
    finding = only(checkup(home(objects=[bed, *fence])))

    assert ("object", "wrong") == (finding.kind, finding.severity)
    assert "nobody can get to cot" in finding.text
    assert bed.footprint == finding.shape


def test_object_in_a_wall_and_objects_in_each_other_are_found():
    things = [
        stand_furniture("sofa", (5.2, 3.0), name="sofa"),
        stand_furniture("table", (1.0, 1.0), name="one"),
        stand_furniture("table", (1.5, 1.0), name="two"),
    ]
    texts = [finding.text for finding in checkup(home(objects=things))]

    assert any("of sofa is in a wall" in text for text in texts)
    assert any("two and one stand in each other" in text for text in texts)


def test_charger_in_its_niche_is_no_fault():
    niche = PlacedObject("dock", "charger", shapely.box(-0.2, 1, 0, 1.3), "nothing")

    assert [] == checkup(home(objects=[niche]))


def test_door_in_no_wall_is_found():
    lost = DoorLine((2.0, 20.0), (3.0, 20.0), "trapdoor")
    finding = only(checkup(home(doorways=[lost])))

    assert ("door", "wrong", (2.5, 20.0)) == (finding.kind, finding.severity, finding.at)
    assert "trapdoor" in finding.text


def test_door_as_wide_as_a_room_is_found():
    assert "4.00 m wide" in only(checkup(home(doorways=[DoorLine((2, 0), (2, 4))]))).text
    assert [] == checkup(home(doorways=[DoorLine((2, 0), (2, 4), leaf=False)]))


def test_label_outside_the_home_is_found():
    far = LabelledRegion(("Garage",), shapely.box(4, -10, 6, -6))
    finding = only(checkup(home(regions=[*REGIONS, far])))

    assert ("outside", "odd") == (finding.kind, finding.severity)
    assert "100 % of what is labelled garage lies outside the home" in finding.text


def test_labels_that_overlap_are_found_once():
    office = LabelledRegion(("Office",), shapely.box(6, 0, 10, 4))
    finding = only(checkup(home(regions=[*REGIONS, office])))

    assert "the labels bedroom and office overlap by 16.0 m2" in finding.text
    assert (6, 0, 10, 4) == finding.shape.bounds


def test_two_labels_of_one_box_do_not_overlap():
    both = LabelledRegion(("Office",), REGIONS[1].shape)

    assert [] == checkup(home(regions=[*REGIONS, both]))


@pytest.mark.parametrize(
    ("factor", "unit"), [(100, "centimetres"), (20, "pixels of 5 cm"), (0.1, "very small")]
)
def test_wrong_scale_is_found_with_a_guess(factor, unit):
    def scale_shape(shape: shapely.Geometry) -> shapely.Geometry:
        return shapely.transform(shape, lambda xy: xy * factor)

    regions = [LabelledRegion(region.labels, scale_shape(region.shape)) for region in REGIONS]
    plan = home(scale_shape(FREE), regions, cell=max(0.02, 0.02 * factor) if factor < 50 else 1.0)
    scale = only([f for f in checkup(plan) if f.kind == "scale"])

    assert "wrong" == scale.severity
    assert unit in scale.text


def test_doors_of_a_dolls_house_are_found():
    walls = [shapely.box(x, 0, x + 0.1, 5) for x in (2, 4, 6)]
    gaps = [shapely.box(x, 2, x + 0.1, 2.35) for x in (2, 4, 6)]
    free = shapely.box(0, 0, 8, 5).difference(shapely.union_all(walls))
    free = free.union(shapely.union_all(gaps))
    lines = [DoorLine((x + 0.05, 2), (x + 0.05, 2.35)) for x in (2, 4, 6)]
    plan = home(free, [LabelledRegion(("Office",), free.envelope)], doorways=lines)

    assert any("half of the doors are about 0.35 m wide or less" in f.text for f in checkup(plan))


def test_specks_tiny_rooms_and_missing_labels_are_found():
    speck = shapely.box(2, 2, 2.1, 2.1)
    closet = LabelledRegion(("Storage",), shapely.box(0, 0, 0.5, 0.5))
    kinds = {f.kind: f for f in checkup(home(FREE.difference(speck), [closet]))}

    assert {"specks", "room", "labels"} == set(kinds)
    assert "1 piece of wall smaller than 0.02 m2" in kinds["specks"].text
    assert "storage_1 has only 0.25 m2" == kinds["room"].text
    assert "99 % of the floor belongs to no room" in kinds["labels"].text


def test_home_that_no_body_fits_into_is_unlivable():
    findings = checkup(home(), radius=3.0)

    assert ("unlivable", "space") == (findings[0].severity, findings[0].kind)


@pytest.mark.slow
def test_every_plan_has_a_check_up(shared_data):
    paths = plan_files(shared_data)
    paths += [*shared_data.glob("ros_maps/*/map.yaml"), *shared_data.glob("valetudo/*.json")]
    for path in paths:
        for finding in checkup(load_floorplan(path)):
            assert finding.severity != "unlivable"
            assert finding.text


# --- The command ---------------------------------------------------------------------------------


def test_command_prints_findings():
    result = CliRunner().invoke(app, ["validate", "family_home"])

    assert 0 == result.exit_code
    assert result.output == "family_home: 186.1 m2, 14 rooms\nok: nothing wrong or odd was found\n"


def test_command_does_not_deny_what_its_notes_say(tmp_path):
    rooms = [shapely.box(0, 0, 4, 3), shapely.box(4.1, 0, 8, 3)]
    free = shapely.union_all([*rooms, shapely.box(4, 1, 4.1, 1.9)])
    regions = [LabelledRegion((name,), room) for name, room in zip("ab", rooms, strict=True)]
    file = tmp_path / "flat.json"
    document = native_document(FloorPlan.build("flat", free, regions))
    document["rooms"] = [room for room in document["rooms"] if room["type"] != "unknown"]
    file.write_text(json.dumps(document))

    result = CliRunner().invoke(app, ["validate", str(file)])

    assert "ok: nothing wrong; the notes tell what is odd in the file\nnote: small" in result.output


@pytest.mark.slow
def test_command_says_what_a_large_robot_cannot_do():
    words = ["validate", "family_home", "--radius"]

    result = CliRunner().invoke(app, [*words, "0.44"])
    assert 2 == result.exit_code
    assert "1 wrong: a body of radius 0.44 m" in result.output
    result = CliRunner().invoke(app, [*words, "3"])
    assert 2 == result.exit_code
    assert "1 unlivable: a body of radius 3 m fits nowhere in family_home" in result.output
