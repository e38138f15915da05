import json
from pathlib import Path

import jsonschema
import pytest
import shapely
import yaml

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import is_floorplan, load_floorplan, save_floorplan
from fleet2d.floorplan.native import HOMES, native_document, native_schema
from fleet2d.floorplan.placed_objects import PlacedObject, Portal, UsePlace
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.floorplan.rooms.doorways import DoorLine


def full_plan(name="no: 1 – Küche"):
    """A plan that has everything, and a name that YAML must quote."""
    free = shapely.difference(shapely.box(0, 0, 9, 7), shapely.box(4, 0, 4.1, 5))
    sofa = PlacedObject(
        "sofa", "sofa", shapely.box(5, 1, 7, 2), "path",
        (UsePlace(6.0, 1.3, 1.5, "sit", (6.0, 2.3)), UsePlace(6.5, 1.3, 1.5)), 1.25,
    )  # fmt: skip
    ring = shapely.difference(shapely.box(1, 1, 2, 2), shapely.box(1.2, 1.2, 1.8, 1.8))
    return FloorPlan.build(
        name,
        free,
        [
            LabelledRegion(
                ("office", "bedroom"), shapely.box(0, 0, 4.05, 7), "Ben's den", "office"
            ),
            LabelledRegion(("hall",), shapely.box(4.05, 0, 9, 7)),
        ],
        entrance=(0.1 + 0.2, 1 / 3),
        doorways=[
            DoorLine((4.05, 5), (4.05, 7), "gate"),
            DoorLine((0, 6.5), (9, 6.5), None, False),
        ],
        objects=[sofa, PlacedObject("", "rug", ring, "nothing")],
        no_go=[shapely.box(7, 5, 8, 6.1), ring],
    )


@pytest.mark.parametrize("suffix", ["json", "yaml", "yml", "geojson"])
def test_plan_with_everything_comes_back_equal(tmp_path, suffix):
    plan = full_plan()
    assert plan.doorways
    assert plan.objects
    path = tmp_path / f"plan.{suffix}"

    save_floorplan(plan, path)
    again = load_floorplan(path)

    if suffix == "geojson":  # it doesn't tell where one walks to before
        sofa = again.objects[0]
        assert ["sit", "stand"] == [use.posture for use in sofa.uses]
        assert plan.doorways == again.doorways
        assert plan.rooms == again.rooms
        return
    assert plan == again
    assert plan.objects == again.objects
    assert plan.doorways == again.doorways
    assert native_document(plan) == native_document(again)


@pytest.mark.parametrize("suffix", ["json", "yaml", "geojson"])
def test_storeys_stairs_and_panes_come_back(tmp_path, suffix):
    ground = shapely.difference(shapely.box(0, 0, 6, 5), shapely.box(3, 0, 3.1, 3))
    storeys = shapely.MultiPolygon([ground, shapely.box(8, 0, 12, 5)])
    pane = shapely.box(2.95, 0.5, 3.15, 1.5)
    regions = [
        LabelledRegion(("kitchen",), shapely.box(0, 0, 6, 5)),
        LabelledRegion(("bedroom",), shapely.box(8, 0, 12, 5)),
    ]
    stairs = [
        Portal("stairs", (5.0, 4.0), (11.0, 4.0), 7_500_000),
        Portal("lift", (1.0, 4.0), (9.0, 4.0), 20_000_000),
    ]
    plan = FloorPlan.build("house", storeys, regions, glass=[pane]).with_portals(stairs)
    path = tmp_path / f"house.{suffix}"

    save_floorplan(plan, path)
    again = load_floorplan(path)

    assert tuple(stairs) == again.portals
    assert (plan.rooms, plan.notes) == (again.rooms, again.notes)
    # Of a pane the part within the wall counts; GeoJSON's panes have no more.
    in_wall = [shapely.difference(p.glass[0], shapely.union_all(p.polygons)) for p in (plan, again)]
    assert in_wall[0].area > 0
    assert in_wall[0].equals(in_wall[1])
    assert suffix == "geojson" or plan.digest == again.digest


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["json", "yaml", "geojson"])
@pytest.mark.parametrize(
    "file",
    [
        "valetudo/dreame_x40_named_rooms.json",
        "valetudo/roborock_s6_segments.json",
        "ros_maps/turtlebot3_house/map.yaml",
    ],
)
def test_real_plan_comes_back_equal(shared_data, tmp_path, file, suffix):
    plan = load_floorplan(shared_data / file)

    save_floorplan(plan, tmp_path / f"plan.{suffix}")

    assert plan == load_floorplan(tmp_path / f"plan.{suffix}")


# --- Files ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("trick", ["file", "file that appears while a plan is written", "link"])
def test_what_exists_is_left_alone(tmp_path, monkeypatch, trick):
    path = tmp_path / "plan.json"
    if trick == "link":
        path.symlink_to(tmp_path / "disk" / "plan.json")
    else:
        path.write_text("mine")
    if "appears" in trick:
        monkeypatch.setattr(Path, "exists", lambda _: False)  # as it was before

    with pytest.raises(FloorPlanError, match="exists already: remove it, or name another file"):
        save_floorplan(full_plan(), path)

    assert path.is_symlink() if trick == "link" else "mine" == path.read_text()


def test_nothing_is_left_where_the_disk_is_full(tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("fleet2d.storage.files.write_all", fail)
    with pytest.raises(FloorPlanError, match="can't be written: No space left on device"):
        save_floorplan(full_plan(), tmp_path / "plan.json")

    assert [] == list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["plan.txt", "plan", "no/folder/plan.json"])
def test_file_that_can_not_be_is_refused_and_nothing_is_left(tmp_path, name):
    with pytest.raises(FloorPlanError, match=r"can't be written|a floor plan is written as"):
        save_floorplan(full_plan(), tmp_path / name)

    assert [] == list(tmp_path.iterdir())


def test_name_that_no_file_can_hold_is_refused_and_nothing_is_left(tmp_path):
    plan = full_plan("\ud800")

    save_floorplan(plan, tmp_path / "plan.json")
    assert plan == load_floorplan(tmp_path / "plan.json")
    with pytest.raises(FloorPlanError, match="can't be written"):
        save_floorplan(plan, tmp_path / "plan.yaml")
    assert not (tmp_path / "plan.yaml").exists()


# --- The schema -------------------------------------------------------------------------------------


def fits(content):
    validator = jsonschema.validators.validator_for(native_schema())
    return bool(validator(native_schema()).is_valid(content))


def test_schema_is_one_and_what_is_written_fits():
    jsonschema.validators.validator_for(native_schema()).check_schema(native_schema())
    assert fits(native_document(full_plan()))
    for path in HOMES.glob("*.json"):
        assert fits(json.loads(path.read_text())), path.name


def test_example_in_the_docs_fits_the_schema():
    page = (Path(__file__).parents[2] / "docs/how-to/floorplans.md").read_text(encoding="utf-8")
    example = page.partition("```yaml title=own.yaml\n")[2].partition("```")[0]

    assert set(native_schema()["properties"]) == set(yaml.safe_load(example))
    assert fits(yaml.safe_load(example))


@pytest.mark.parametrize(
    "change",
    [
        {"version": 2},
        {"free": []},
        {"free": None},
        {"roms": []},
        {"rooms": [{"type": "hall"}]},
        {"rooms": [{"type": "hall", "polygon": [[0, 0]]}]},
        {"doorways": [{"start": [0, 0]}]},
        {"doorways": [{"start": [0, 0], "end": [0, 1], "leaf": "yes"}]},
        {"objects": [{"type": "bed"}]},
        {"objects": [{"type": "bed", "footprint": [[0, 0], [1, 0], [1, 1]], "blocks": "air"}]},
        {"no_go": [[0, 0]]},
        {"entrance": [1]},
    ],
)
def test_what_the_reader_refuses_does_not_fit_the_schema(tmp_path, change):
    content = {**native_document(full_plan("flat")), **change}
    path = tmp_path / "plan.yaml"
    path.write_text(yaml.safe_dump(content))

    assert not fits(content)
    with pytest.raises(FloorPlanError):
        load_floorplan(path)


# --- fleet2d convert --------------------------------------------------------------------------------


@pytest.mark.slow
def test_convert_writes_a_plan_of_any_format_and_says_its_notes(fleet2d, shared_data):
    path = shared_data / "valetudo" / "roborock_s6_segments.json"

    code, out, err = fleet2d("convert", path, "home.yaml")

    assert (0, "") == (code, err)
    assert "note: no-go areas in the map: 1, robots keep out of them" in out.splitlines()
    assert "home.yaml" == out.splitlines()[-1]
    assert load_floorplan(path) == load_floorplan("home.yaml")
    assert 0 == fleet2d("convert", "home.yaml", "home.json")[0]
    assert 0 == fleet2d("convert", "home.json", "home.geojson")[0]
    assert load_floorplan(path) == load_floorplan("home.geojson")


def test_convert_of_a_picture_takes_its_resolution(fleet2d):
    rows = b"\x00" * 60 + (b"\x00" * 10 + b"\xff" * 40 + b"\x00" * 10) * 40 + b"\x00" * 60
    Path("flat.pgm").write_bytes(b"P5\n60 42\n255\n" + rows)

    assert 2 == fleet2d("convert", "flat.pgm", "flat.json")[0]
    assert 0 == fleet2d("convert", "flat.pgm", "flat.json", "--resolution", "0.1")[0]
    assert 16 == pytest.approx(load_floorplan("flat.json").area_m2)


def test_picture_of_a_plan_stays_in_the_folder_whatever_its_name(fleet2d):
    pytest.importorskip("matplotlib")
    save_floorplan(full_plan("../a/b"), "plan.json")

    assert (0, "a-b.png\n", "") == fleet2d("show", "plan.json")
    assert Path("a-b.png").exists()


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.json", "", True),
        ("a.geojson", "", True),
        ("a.png", "", True),
        ("a.yaml", "format: fleet2d-floorplan", True),
        ("a.yaml", "image: map.pgm\nresolution: 0.05", True),
        ("a.yaml", "simulation: {}\nfloorplan: {}", False),
        ("a.yaml", "[", False),
        ("a.txt", "", False),
    ],
)
def test_plans_are_told_from_scenarios(tmp_path, name, content, expected):
    (tmp_path / name).write_text(content)

    assert expected == is_floorplan(tmp_path / name)
