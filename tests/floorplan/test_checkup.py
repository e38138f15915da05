"""The check-up finds each fault in a home that has it, and none in a home without faults."""

import json

import pytest
import shapely
from tests.meshed_homes import plan_files
from typer.testing import CliRunner

from fleet2d.cli.__main__ import app
from fleet2d.floorplan.checkup import checkup
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


def home(free=FREE, regions=REGIONS, **parts):  # type: ignore[no-untyped-def]
    return FloorPlan.build("home", free, regions, **parts)


def only(findings):
    assert 1 == len(findings), [finding.text for finding in findings]
    return findings[0]


NARROW = shapely.union_all([LEFT, RIGHT, shapely.box(5, 1.5, 5.2, 1.9)])
BED = stand_furniture("single_bed", (9.5, 3.0), 1024, (0.9, 2.0), name="cot")
FENCES = [
    PlacedObject("", "fence", shapely.box(8.6, 1.7, 10, 1.8)),
    PlacedObject("", "fence", shapely.box(8.6, 1.8, 8.8, 4)),
]
WHOLE_DOOR = DoorLine((2, 0), (2, 4))


def labelled(label, *box):
    return LabelledRegion((label,), shapely.box(*box))


@pytest.mark.parametrize(
    ("parts", "radius"),
    [
        ({"doorways": [DoorLine((5.1, 1.5), (5.1, 2.4))], "entrance": (1, 1)}, 0.15),
        ({"free": NARROW}, 0.15),
        ({"no_go": [shapely.box(0, 0, 4, 4)]}, 0.15),
        (
            {"objects": [PlacedObject("dock", "charger", shapely.box(-0.2, 1, 0, 1.3), "nothing")]},
            0.15,
        ),
        ({"doorways": [DoorLine((2, 0), (2, 4), leaf=False)]}, 0.15),
        ({"regions": [*REGIONS, LabelledRegion(("Office",), REGIONS[1].shape)]}, 0.15),
    ],
    ids=[
        "sound",
        "narrow",
        "small no-go area",
        "charger in a niche",
        "opening",
        "two labels of a box",
    ],
)
def test_home_without_faults_has_no_findings(parts, radius):
    assert [] == checkup(home(**parts), radius=radius)


@pytest.mark.parametrize(
    ("parts", "radius", "kind", "severity", "text"),
    [
        ({"no_go": [shapely.box(0, 0, 10, 3)]}, 0.15, "no_go", "wrong",
         "robots keep out of 75 % of the floor"),
        ({"regions": [labelled("Kichen", 0, 0, 5.1, 4), labelled("Yoga studio", 5.1, 0, 10, 4)]},
         0.15, "labels", "odd", "kichen_1 has the unusual type 'kichen': did you mean 'kitchen'?"),
        ({"free": NARROW}, 0.22, "room", "wrong",
         "a body of radius 0.22 m can't get to bedroom_1 (19.2 m2)"),
        ({"free": NARROW, "entrance": (7, 2)}, 0.22, "room", "wrong", "can't get to living_room_1"),
        ({"entrance": (0.05, 0.05)}, 0.15, "entrance", "wrong", ""),
        ({"objects": [stand_furniture("shelf", (5.5, 2.0), 0, (1.6, 0.4))]}, 0.15, "room", "wrong",
         "furniture keeps a body of radius 0.15 m out of 15.7 m2 of bedroom_1"),
        ({"objects": [BED, *FENCES]}, 0.15, "object", "wrong", "nobody can get to cot"),
        ({"doorways": [DoorLine((2.0, 20.0), (3.0, 20.0), "trapdoor")]}, 0.15, "door", "wrong",
         "trapdoor"),
        ({"doorways": [WHOLE_DOOR]}, 0.15, "door", "odd", "4.00 m wide"),
        ({"regions": [*REGIONS, labelled("Garage", 4, -10, 6, -6)]}, 0.15, "outside", "odd",
         "100 % of what is labelled garage lies outside the home"),
        ({"regions": [*REGIONS, labelled("Office", 6, 0, 10, 4)]}, 0.15, "overlap", "odd",
         "the labels bedroom and office overlap by 16.0 m2"),
        ({}, 3.0, "space", "unlivable", ""),
    ],
)  # fmt: skip
def test_fault_is_found(parts, radius, kind, severity, text):
    finding = checkup(home(**parts), radius=radius)[0]

    assert (kind, severity) == (finding.kind, finding.severity)
    assert text in finding.text


def test_findings_are_marked_at_their_place():
    lost = DoorLine((2.0, 20.0), (3.0, 20.0), "trapdoor")
    regions = [*REGIONS, labelled("Office", 6, 0, 10, 4)]

    assert (0.05, 0.05) == only(checkup(home(entrance=(0.05, 0.05)))).at
    assert (2.5, 20.0) == only(checkup(home(doorways=[lost]))).at
    assert BED.footprint == only(checkup(home(objects=[BED, *FENCES]))).shape
    assert (6, 0, 10, 4) == only(checkup(home(regions=regions))).shape.bounds


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


@pytest.mark.parametrize(
    ("bits", "severity", "text"),
    [
        # 0.01 m on the lattice
        ([shapely.box(5, 1.5, 5.19, 2.4)], "wrong", "though they are only 0.009 m apart at (5.20, "),
        (
            [DOOR, *(shapely.box(11 + i, 0, 11.3 + i, 0.5) for i in range(3))],
            "odd", "joins 3 parts smaller than 0.5 m2",
        ),
    ],
    ids=["a doorway ends before the wall does", "small parts are one finding"],
)  # fmt: skip
def test_parts_are_told_with_what_may_be_wrong(bits, severity, text):
    findings = checkup(home(shapely.union_all([LEFT, RIGHT, *bits])))
    part = only([finding for finding in findings if finding.kind == "parts"])

    assert severity == part.severity
    assert text in part.text


def test_a_no_go_area_without_floor_is_noted():
    areas = [shapely.box(1, 1, 2, 2), shapely.box(100, 100, 101, 101)]

    assert home(no_go=areas).notes == (
        "no_go.1, from (100, 100) to (101, 101) m, has no part of the floor: robots keep out of"
        " nothing there",
    )


def test_furniture_in_the_doorway_is_named_as_the_cause():
    table = stand_furniture("table", (5.3, 1.95), 0, (0.85, 0.5))
    closet = shapely.box(5, 1.5, 5.7, 2.4)
    plan = home(LEFT.union(closet), [REGIONS[0], LabelledRegion(("Storage",), closet)])
    assert [] == checkup(plan)
    plan = home(LEFT.union(closet), plan.regions, objects=[table])

    assert "furniture keeps a body of radius 0.15 m out of storage_1" in checkup(plan)[0].text


def test_object_in_a_wall_and_objects_in_each_other_are_found():
    things = [
        stand_furniture("sofa", (5.2, 3.0), name="sofa"),
        stand_furniture("table", (1.0, 1.0), name="one"),
        stand_furniture("table", (1.5, 1.0), name="two"),
    ]
    texts = [finding.text for finding in checkup(home(objects=things))]

    assert any("of sofa is in a wall" in text for text in texts)
    assert any("two and one stand in each other" in text for text in texts)


@pytest.mark.parametrize(
    ("factor", "unit"), [(100, "centimetres"), (20, "pixels of 5 cm"), (0.1, "very small")]
)
def test_wrong_scale_is_found_with_a_guess(factor, unit):
    def scale_shape(shape):
        return shapely.transform(shape, lambda xy: xy * factor)

    regions = [LabelledRegion(region.labels, scale_shape(region.shape)) for region in REGIONS]
    plan = home(scale_shape(FREE), regions, cell=max(0.02, 0.02 * factor) if factor < 50 else 1.0)
    scale = only([f for f in checkup(plan) if f.kind == "scale"])

    assert "wrong" == scale.severity
    assert unit in scale.text


def test_doors_of_a_dolls_house_are_found():
    walls = [shapely.box(x, 0, x + 0.1, 5) for x in (2, 4, 6)]
    gaps = [shapely.box(x, 2, x + 0.1, 2.35) for x in (2, 4, 6)]
    free = (
        shapely.box(0, 0, 8, 5).difference(shapely.union_all(walls)).union(shapely.union_all(gaps))
    )
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
