import math
from pathlib import Path

import numpy as np
import pytest
import shapely
import yaml
from pydantic import ValidationError

import fleet2d
from fleet2d.configuration.components import lookup
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan, save_floorplan
from fleet2d.floorplan.space import Space
from fleet2d.homes.formats.ros import Ros

FREE, UNKNOWN, OCCUPIED = 254, 205, 0

ROOM = np.full((34, 44), UNKNOWN, np.uint8)
ROOM[1:-1, 1:-1] = OCCUPIED
ROOM[2:-2, 2:-2] = FREE  # 30 x 40 pixels of 5 cm: 3 m2
ROOM[2:12, 2:22] = OCCUPIED  # the upper left quarter or so: 0.5 m2 less

# A file with all that the format has; `test_damaged_files.py` damages it.
SAMPLE = (
    "map.yaml",
    {
        "image": "map.pgm",
        "resolution": 0.1,
        "origin": [-1.0, 2.0, 0.3],
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
        "negate": 0,
        "mode": "trinary",
    },
)


def read_ros(path, cell=None, **settings):
    return Ros.model_construct(path=path, cell=cell, **settings).load()


def pgm(pixels):
    rows, columns = pixels.shape
    return f"P5\n# a comment\n{columns} {rows}\n255\n".encode() + pixels.tobytes()


def write(folder, pixels=ROOM, **changes):
    """Write a map; a change to None leaves the key out."""
    keys = {
        "image": "map.pgm",
        "resolution": 0.05,
        "origin": [0.0, 0.0, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
        **changes,
    }
    (folder / "map.pgm").write_bytes(pgm(pixels))
    path = folder / "map.yaml"
    lines = [f"{key}: {value}\n" for key, value in keys.items() if value is not None]
    path.write_text("".join(lines), encoding="utf-8")
    return path


def slanted(end, size=(60, 60)):
    """Return a room with a slanted wall of many steps."""
    y, x = np.indices(size)
    return np.where((x > 1) & (y > 1) & (x + 2 * y < end), FREE, OCCUPIED).astype(np.uint8)


def refusal(path, **options):
    with pytest.raises(FloorPlanError) as caught:
        read_ros(path, **options)
    assert str(path) in str(caught.value)
    return str(caught.value)


# --- The real maps ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("folder", "area", "specks", "left_out"),
    [("aws_small_house", 155.5, 29, 0.56 + 1.76), ("turtlebot3_house", 19.8, 0, 0.01)],
)
def test_real_maps_load_with_every_pixel_accounted_for(shared_data, folder, area, specks, left_out):
    path = shared_data / "ros_maps" / folder / "map.yaml"
    content = (path.parent / "map.pgm").read_bytes()
    free_m2 = content.partition(b"\n255\n")[2].count(FREE) * 0.05**2

    plan = read_ros(path)

    notes = " ".join(plan.notes)
    assert area == pytest.approx(plan.area_m2, abs=0.05)
    assert (specks == 0) == ("specks removed" not in notes)
    assert f"specks removed: {specks} groups" in notes or specks == 0
    added = 0.28 if specks else 0.0
    assert free_m2 == pytest.approx(plan.area_m2 - added + left_out, abs=0.015)
    assert np.array_equal(plan.free, plan.room_of_cell >= 0)
    assert 1 == len(plan.polygons)
    assert not (shapely.get_coordinates(plan.polygons) % 64).any()  # walls on the sides of pixels
    space = Space(plan, 0.2)
    reached = np.count_nonzero(space.part_of_cell == 0)
    assert reached > 0.97 * np.count_nonzero(space.part_of_cell >= 0)
    assert reached > 0.6 * np.count_nonzero(plan.free)


@pytest.mark.slow
def test_real_map_has_the_same_area_turned_and_mirrored(shared_data, tmp_path):
    content = (shared_data / "ros_maps" / "turtlebot3_house" / "map.pgm").read_bytes()
    body = content.partition(b"\n255\n")[2]
    side = math.isqrt(len(body))
    pixels = np.frombuffer(body, np.uint8).reshape(side, side)

    areas = {
        read_ros(write(tmp_path, np.ascontiguousarray(image))).area_m2
        for turns in range(4)
        for image in (np.rot90(pixels, turns), np.rot90(pixels, turns)[:, ::-1])
    }

    assert 1 == len(areas)


# --- Where the map is ---------------------------------------------------------------------------


def test_first_row_of_the_image_is_the_top_and_origin_the_lower_left(tmp_path):
    plan = read_ros(write(tmp_path, origin=[-3.0, 7.0, 0.0]))

    assert (-2.9, 7.1, -0.9, 8.6) == pytest.approx(plan.bounds)
    assert 2.5 == pytest.approx(plan.area_m2)
    assert plan.room_at(-2.0, 7.2) is not None
    assert plan.room_at(-2.7, 8.4) is None  # upper left


@pytest.mark.parametrize("yaw", ["-nan", ".nan", "nan", "-.NaN"])
def test_yaw_that_is_no_number_is_none_with_a_note(tmp_path, yaw):
    """`map_saver` wrote `-nan` for none: ros-planning/navigation#993."""
    plan = load_floorplan(write(tmp_path, origin=f"[-15.4, -30.9, {yaw}]"))

    straight = read_ros(write(tmp_path, origin="[-15.4, -30.9, 0]"))
    assert plan == straight
    assert "origin has no yaw, as older map_savers write it: 0 is taken" in plan.notes


@pytest.mark.parametrize("yaw", [0.3, math.pi / 2, math.pi, -2.0])
def test_yaw_turns_the_map_about_its_origin(tmp_path, yaw):
    origin, at = np.array([2.0, -1.0]), np.array([2.0, 0.2])  # lower right; (2, 1.4) is upper right

    plan = read_ros(write(tmp_path, origin=[*origin.tolist(), yaw]))

    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    assert 2.5 == pytest.approx(plan.area_m2, abs=0.01)
    is_exact = not (shapely.get_coordinates(plan.polygons) % 64).any()
    assert is_exact == (yaw in (math.pi / 2, math.pi))
    for inside, place in ((True, at), (True, (2.0, 1.4)), (False, (0.3, 1.4)), (True, (0.3, 0.3))):
        x, y = (turn @ np.array(place) + origin).tolist()
        assert inside == (plan.room_at(x, y) is not None), place


# --- Cells --------------------------------------------------------------------------------------


def test_resolution_below_the_smallest_cell_takes_that(tmp_path):
    plan = read_ros(write(tmp_path, resolution=0.005), ray_width=0.03)

    assert 0.01 == plan.lattice.cell
    assert 0.025 == pytest.approx(plan.area_m2)


# --- Free, occupied, unknown --------------------------------------------------------------------


def test_negate_makes_white_occupied_and_mode_scale_what_is_between_unknown(tmp_path):
    plain = read_ros(write(tmp_path))

    assert plain == read_ros(write(tmp_path, 255 - ROOM, negate=1))
    assert plain == read_ros(write(tmp_path, 255 - ROOM, negate="true"))
    assert plain == read_ros(write(tmp_path, mode="scale"))


@pytest.mark.parametrize(("free_thresh", "free"), [(0.1, False), (100 / 255, False), (0.393, True)])
def test_pixels_are_free_below_free_thresh_only(tmp_path, free_thresh, free):
    pixels = ROOM.copy()
    pixels[20:30, 20:30] = 155  # a chance of 100/255 = 0.392 of being occupied

    plan = read_ros(write(tmp_path, pixels, free_thresh=free_thresh), unknown_grey="none")

    assert free == (plan.area_m2 > 2.4)


def test_occupied_thresh_tells_obstacles_from_unknown(tmp_path):
    pixels = ROOM.copy()
    pixels[20:30, 20:30] = 155

    loose = read_ros(write(tmp_path, pixels, occupied_thresh=0.392))
    strict = read_ros(write(tmp_path, pixels, occupied_thresh=0.393))

    assert loose == strict  # both are walls
    assert () == loose.notes
    assert "2.00 m of the walls are where free space meets unknown" in strict.notes[0]


@pytest.mark.parametrize(
    ("unknown", "free_thresh"), [(UNKNOWN, 0.25), (UNKNOWN, 0.3), (220, 0.196), (150, 0.45)]
)
def test_grey_of_unknown_is_not_floor_though_the_threshold_says_so(tmp_path, unknown, free_thresh):
    pixels = np.where(ROOM == UNKNOWN, unknown, ROOM).astype(np.uint8)
    expected = read_ros(write(tmp_path))

    plan = read_ros(write(tmp_path, pixels, free_thresh=free_thresh))

    assert expected == plan
    assert f"grey {unknown} is taken for unknown" in plan.notes[0]


def test_grey_that_fills_furniture_is_no_floor_but_all_shades_of_a_map_of_chances_are(tmp_path):
    pixels = np.full((60, 80), UNKNOWN, np.uint8)
    pixels[5:-5, 5:-5] = FREE
    pixels[20:30, 20:40] = 211  # a sofa of 0.5 m x 1 m
    chances = pixels.copy()
    chances[20:30, 20:40] = np.arange(220, 240, dtype=np.uint8)

    filled = read_ros(write(tmp_path, pixels))
    (tmp_path / "chances").mkdir()
    shaded = read_ros(write(tmp_path / "chances", chances))

    assert 50 * 70 * 0.05**2 - 0.5 == pytest.approx(filled.area_m2)
    assert 50 * 70 * 0.05**2 == pytest.approx(shaded.area_m2)
    assert "grey 211 is taken for unknown" in filled.notes[0]


@pytest.mark.parametrize("ground", [255, 240, 215])
@pytest.mark.parametrize("settings", [{}, {"unknown_grey": "none"}, {"unknown_grey": "ground"}])
def test_ground_as_light_as_the_floor_is_refused_without_a_key_that_would_not_help(
    tmp_path, ground, settings
):
    pixels = np.full((60, 80), ground, np.uint8)
    pixels[20:40, 20:40] = OCCUPIED
    if settings.get("unknown_grey") == "ground":
        settings = {"unknown_grey": ground}

    message = refusal(write(tmp_path, pixels), **settings)

    assert "it is the ground around the home" in message
    assert "Fill what is outside with grey 205" in message
    assert "set floorplan.unknown_grey" not in message


def test_ground_that_is_darker_than_the_floor_is_refused_with_what_to_type(tmp_path):
    pixels = np.full((60, 80), 230, np.uint8)
    pixels[20:58, 10:70] = OCCUPIED
    pixels[22:56, 12:68] = FREE
    path = write(tmp_path, pixels)

    message = refusal(path, unknown_grey="none")
    plan = read_ros(path, unknown_grey=230)

    assert "set floorplan.unknown_grey=230" in message
    assert 34 * 56 * 0.05**2 == pytest.approx(plan.area_m2)


@pytest.mark.parametrize("name", ["aws_small_house", "turtlebot3_house"])
def test_real_maps_are_the_same_at_the_threshold_of_other_map_savers(shared_data, tmp_path, name):
    folder = shared_data / "ros_maps" / name
    keys = yaml.safe_load((folder / "map.yaml").read_text(encoding="utf-8"))
    keys |= {"free_thresh": 0.25, "image": str((folder / keys["image"]).resolve())}
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(keys), encoding="utf-8")

    assert read_ros(tmp_path / "map.yaml") == read_ros(folder / "map.yaml")


def test_raw_mode_takes_values_for_percent_and_those_above_100_for_unknown(tmp_path):
    percent = np.select([ROOM == FREE, ROOM == OCCUPIED], [0, 100], 255).astype(np.uint8)
    percent[20:30, 20:30] = 19  # just below free_thresh
    percent[15, 25:29] = 20

    plan = read_ros(write(tmp_path, percent, mode="raw"), speck_area_m2=0)

    assert 2.5 - 4 * 0.05**2 == pytest.approx(plan.area_m2)
    assert read_ros(write(tmp_path)) == read_ros(write(tmp_path, percent, mode="raw"))


def test_transparent_pixels_of_a_png_are_unknown(tmp_path):
    images = pytest.importorskip("PIL.Image")
    pixels = np.dstack([ROOM, ROOM, ROOM, np.full_like(ROOM, 255)])
    pixels[20:30, 20:30, 3] = 0
    images.fromarray(pixels).save(tmp_path / "map.png")

    plan = read_ros(write(tmp_path, image="map.png"))

    assert 2.5 - 0.25 == pytest.approx(plan.area_m2)


def test_cleaning_is_tuned_by_the_component(tmp_path):
    pixels = ROOM.copy()
    pixels[25, 25:29] = OCCUPIED  # 0.01 m2
    pixels[20:22, 42:44] = FREE  # a gap in the wall, to the edge of the image
    path = write(tmp_path, pixels)

    cleaned = Ros(path=path).load()
    plan = Ros(path=path, speck_area_m2=0, ray_width="1 cm").load()

    assert 2.5 + 0.01 == pytest.approx(cleaned.area_m2)
    assert 2.5 - 0.01 + 0.01 == pytest.approx(plan.area_m2)
    assert 0 == len(cleaned.polygons[0].interiors)
    assert 1 == len(plan.polygons[0].interiors)


# --- Cleaning and straightening -----------------------------------------------------------------


def test_simplify_straightens_jagged_walls_within_the_tolerance(tmp_path):
    path = write(tmp_path, slanted(100))

    exact = read_ros(path)
    straight = read_ros(path, simplify=0.05)

    def corners(plan):
        return int(shapely.count_coordinates(plan.polygons))

    units = exact.lattice.units_per_m
    away = shapely.hausdorff_distance(exact.polygons[0].exterior, straight.polygons[0].exterior)
    assert corners(straight) < corners(exact) / 5
    assert away / units <= 0.05 + 2 / units
    change = straight.area_m2 - exact.area_m2
    assert (
        f"walls were straightened within 0.05 m: {corners(straight)} corners" in straight.notes[-1]
    )
    assert f"and {change:+.2f} m2" in straight.notes[-1]


# --- Finding the image --------------------------------------------------------------------------


def test_image_may_be_absolute(tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    write(tmp_path)
    path = write(home, image=tmp_path / "map.pgm")
    (home / "map.pgm").unlink()

    assert 2.5 == pytest.approx(read_ros(path).area_m2)


@pytest.mark.parametrize("image", ["/home/robot/maps/map.pgm", "C:\\maps\\map.pgm"])
def test_image_path_of_another_computer_is_replaced_by_the_file_beside_the_map_with_a_note(
    tmp_path, image
):
    plan = read_ros(write(tmp_path, image=image))

    assert f"there is no image {image}: map.pgm beside map.yaml is used instead" == plan.notes[0]


def test_image_of_another_size_than_its_header_is_refused(tmp_path):
    path = write(tmp_path)
    (tmp_path / "map.pgm").write_bytes(pgm(ROOM)[:-100])

    assert "holds 1396 pixels, but its header says 44 x 34 = 1496" in refusal(path)


REQUIRED = ("resolution", "origin", "negate", "occupied_thresh", "free_thresh")

# --- Wrong files --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"image": None}, "the key 'image' is missing; write it like `image: map.pgm`"),
        *(({key: None}, f"the key '{key}' is missing") for key in REQUIRED),
        ({"image": 7}, "image is 7"),
        ({"resolution": 0}, "resolution is 0 m per pixel"),
        ({"resolution": 50}, "resolution is 50 m per pixel"),
        ({"resolution": ".nan"}, "resolution is nan: a finite number"),
        ({"resolution": "fine"}, 'resolution is "fine": a number'),
        ({"resolution": "true"}, "resolution is true: a number"),
        ({"free_thresh": 0.7}, "free_thresh, 0.7, is above occupied_thresh, 0.65"),
        ({"occupied_thresh": 65}, "a probability from 0 to 1"),
        ({"origin": [0, 0]}, "a list [x, y, yaw]"),
        ({"origin": "[0, .nan, 0]"}, "origin[1] is nan"),
        ({"origin": [1e9, 0, 0]}, "too far out"),
        ({"origin": [0, 0, 90]}, "more than a whole turn: 1.5708 if it is in degrees"),
        ({"negate": "maybe"}, 'negate is "maybe"'),
        ({"mode": "raw", "negate": 1}, "negate is 1 in mode raw"),
        ({"mode": "best"}, 'mode is "best": trinary, scale or raw'),
        ({"free_thresh": 0}, "no pixel is free"),
        ({"resolution": 0.005}, "the free space is nowhere 0.3 m wide"),
    ],
)
def test_wrong_settings_are_refused_with_the_reason(tmp_path, changes, message):
    assert message in refusal(write(tmp_path, **changes))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "holds nothing: a floor plan is a YAML mapping"),
        (b"[1, 2]", "holds a list: a floor plan is a YAML mapping"),
        (b"image: [", "not YAML"),
        (b"P5\n4 3\n255\n\xff\xfe\x00", "not a YAML text file"),
        (b"image: map.pgm\n# Gr\xf6\xdfe", "line 2: byte 0xf6 is not UTF-8: save the file"),
        ("image: map.pgm".encode("utf-16"), "line 1: byte 0xff is not UTF-8"),
        (b"mode: inorder\nposes: []\n", "not a ROS map: the key 'image' is missing"),
    ],
)
def test_other_files_are_refused(tmp_path, content, message):
    path = tmp_path / "map.yaml"
    path.write_bytes(content)

    assert message in refusal(path)


def test_resolution_with_an_exponent_is_a_number(tmp_path):
    """YAML 1.1 takes 5e-2 for text."""
    assert 0.05 == read_ros(write(tmp_path, resolution="5e-2")).lattice.cell


# --- As a component, and by its file ------------------------------------------------------------


def test_component_is_found_and_holds_the_cell_for_the_manifest(tmp_path):
    path = write(tmp_path, resolution=0.04)

    source = Ros(path=path)

    assert Ros is lookup("floorplan", "ros")
    assert 0.04 == source.cell
    assert 0.04 == source.model_dump(mode="json")["cell"]
    assert source == Ros.model_validate(source.model_dump(mode="json"))
    assert 0.1 == Ros(path=path, cell="10 cm").cell
    assert 0.04 == source.load().lattice.cell
    assert read_ros(path) == source.load() == load_floorplan(path)
    coarse = load_floorplan(path, 0.1)
    assert 0.1 == coarse.lattice.cell
    assert coarse.area_m2 == pytest.approx(read_ros(path).area_m2)


def test_home_found_in_a_map_that_is_just_not_too_large_is_read_after_it_is_saved(
    tmp_path, monkeypatch
):
    """Its rooms have twice the corners of its walls: runs in such homes could not be opened."""
    pixels = slanted(260, (120, 60))
    pixels[60:62, :24] = pixels[60:62, 36:] = OCCUPIED
    plan = read_ros(write(tmp_path, pixels))
    walls = int(shapely.get_num_coordinates(plan.polygons).sum())
    monkeypatch.setenv("FLEET2D_MAX_CORNERS", str(walls))

    save_floorplan(plan, tmp_path / "home.json")

    assert len(plan.rooms) == 2
    assert plan == load_floorplan(tmp_path / "home.json")


def test_map_with_too_many_corners_is_straightened_by_a_pixel(tmp_path, monkeypatch):
    """A scanned building that wasn't turned to its walls was refused: each pixel is a corner."""
    path = write(tmp_path, slanted(100))
    exact = read_ros(path)
    monkeypatch.setenv("FLEET2D_MAX_CORNERS", "50")

    straight = read_ros(path)

    assert shapely.count_coordinates(straight.polygons) < 50
    assert 0.01 > abs(straight.area_m2 / exact.area_m2 - 1)
    (note,) = [note for note in straight.notes if "by up to a pixel" in note]
    keys = dict([note.split("; ")[1].split()[0].split("=")])
    monkeypatch.setenv("FLEET2D_MAX_CORNERS", keys["FLEET2D_MAX_CORNERS"])
    assert exact == read_ros(path)


@pytest.mark.parametrize("key", ["speck_area_m2", "ray_width", "simplify"])
def test_negative_cleaning_is_refused(tmp_path, key):
    with pytest.raises(ValidationError, match=key):
        Ros(path=write(tmp_path), **{key: -1})


def test_load_floorplan_of_the_image_names_the_yaml_file(tmp_path):
    write(tmp_path)

    with pytest.raises(FloorPlanError, match=r"name the YAML file.*map\.yaml"):
        load_floorplan(tmp_path / "map.pgm")


def test_a_run_notes_the_image_as_well_as_the_yaml(shared_data):
    path = shared_data / "ros_maps" / "turtlebot3_house" / "map.yaml"
    overrides = ("floorplan.type=ros", f"floorplan.path={path}", "simulation.duration=1 min")
    inputs = fleet2d.run("bundled:paper", *overrides).manifest["inputs"]
    assert ["map.pgm", "map.yaml"] == [Path(record["path"]).name for record in inputs]
