import contextlib
import re

import numpy as np
import pytest
import shapely
from PIL import Image as Picture
from pydantic import ValidationError

from fleet2d.configuration.components import lookup
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan, load_or_mark
from fleet2d.homes.formats.drawing import Image

WALL, PAPER = 20, 250

HOME = np.full((80, 120), PAPER, np.uint8)
HOME[10:70, 10:110] = WALL
HOME[14:66, 14:58] = PAPER  # 52 x 44 pixels
HOME[14:66, 62:106] = PAPER  # as large
HOME[34:46, 58:62] = PAPER  # a door between them


def read_image(path, resolution, cell=None, **settings):
    return Image.model_construct(path=path, resolution=resolution, cell=cell, **settings).load()


def draw(folder, pixels=HOME):
    path = folder / "flat.pgm"
    rows, columns = pixels.shape
    path.write_bytes(f"P5\n{columns} {rows}\n255\n".encode() + pixels.tobytes())
    return path


def read(folder, pixels=HOME, **options):
    return read_image(draw(folder, pixels), 0.05, **options)


def test_what_dark_walls_enclose_is_free_and_the_paper_around_is_not(tmp_path):
    plan = read(tmp_path)

    assert (2 * 52 * 44 + 12 * 4) * 0.05**2 == pytest.approx(plan.area_m2)
    assert (0.7, 0.7, 5.3, 3.3) == pytest.approx(plan.bounds)  # from the lower left corner
    assert plan.room_at(0.2, 0.2) is None
    assert ["room_1", "room_2"] == [room.name for room in plan.rooms]
    assert 0.6 == pytest.approx(plan.doorways[0].width_m)


def test_picture_is_not_mirrored(tmp_path):
    pixels = HOME.copy()
    pixels[14:20, 14:30] = WALL  # the upper left corner

    plan = read(tmp_path, pixels)

    assert plan.room_at(0.8, 3.2) is None
    assert plan.room_at(0.8, 0.8) is not None


@pytest.mark.parametrize(("threshold", "dark"), [(0.3, False), (0.5, False), (0.7, True)])
def test_what_is_darker_than_the_threshold_is_wall(tmp_path, threshold, dark):
    pixels = HOME.copy()
    pixels[20:40, 20:40] = 153  # 0.6 of white

    plan = read(tmp_path, pixels, threshold=threshold)

    assert dark == (plan.room_at(1.5, 2.5) is None)


def test_rooms_without_a_way_to_the_rest_are_left_out_with_a_note(tmp_path):
    pixels = HOME.copy()
    pixels[34:46, 58:62] = WALL

    plan = read(tmp_path, pixels)

    assert 52 * 44 * 0.05**2 == pytest.approx(plan.area_m2)
    assert "left out: 5.72 m2 of free space" in plan.notes[0]


def test_transparent_paper_is_paper(tmp_path):
    images = pytest.importorskip("PIL.Image")
    black = np.zeros_like(HOME)
    pixels = np.dstack([black, black, black, np.where(HOME == WALL, 255, 0).astype(np.uint8)])
    images.fromarray(pixels).save(tmp_path / "flat.png")

    plan = read_image(tmp_path / "flat.png", 0.05)

    assert shapely.equals_exact(read(tmp_path).polygons, plan.polygons).all()


@pytest.mark.parametrize(
    ("pixels", "message"),
    [
        (np.full((50, 50), PAPER, np.uint8), "no space is enclosed by walls"),
        (np.full((50, 50), WALL, np.uint8), "all of the picture is darker than threshold"),
        (np.where(np.arange(120) == 60, PAPER, HOME).astype(np.uint8), "outer walls without gaps"),
    ],
)
def test_drawing_that_encloses_nothing_is_refused(tmp_path, pixels, message):
    if pixels.shape == HOME.shape:
        pixels[:, 56:66] = PAPER
    with pytest.raises(FloorPlanError, match=message) as caught:
        read(tmp_path, pixels, close_gaps=0)

    assert "flat.pgm" in str(caught.value)


def with_gap(width):
    """Return the home with a gap in its outer wall [pixels]."""
    pixels = HOME.copy()
    pixels[10:14, 30 : 30 + width] = PAPER
    return pixels


@pytest.mark.parametrize(("pixels", "closed"), [(1, "0.2"), (4, "0.3"), (11, "0.9"), (20, "1.2")])
def test_gap_in_an_outer_wall_is_closed_if_the_home_would_be_lost(tmp_path, pixels, closed):
    whole = read(tmp_path)

    plan = read(tmp_path, with_gap(pixels))

    assert whole.area_m2 == pytest.approx(plan.area_m2, abs=0.3)
    assert f"gaps in the outer walls are closed up to a width of {closed} m" in plan.notes[0]
    assert len(whole.rooms) == len(plan.rooms)


def test_gap_that_loses_less_than_half_of_the_home_stays_open(tmp_path):
    pixels = with_gap(8)
    pixels[34:46, 58:62] = WALL  # the door between the rooms is shut

    plan = read(tmp_path, pixels)

    assert 52 * 44 * 0.05**2 == pytest.approx(plan.area_m2)  # the other room
    assert not any("gaps in the outer walls" in note for note in plan.notes)


def test_inside_of_an_object_is_no_home(tmp_path):
    pixels = with_gap(30)
    pixels[20:30, 80:90] = WALL
    pixels[21:29, 81:89] = PAPER  # an armchair

    with pytest.raises(FloorPlanError, match="inside of an object at") as caught:
        read(tmp_path, pixels)

    assert "floorplan.close_gaps" in str(caught.value)
    assert read(tmp_path, pixels, close_gaps=1.6).area_m2 > 10


def test_grey_ground_around_white_floor_is_outside(tmp_path):
    pixels = HOME.copy()
    outside = np.ones_like(HOME, np.bool_)
    outside[10:70, 10:110] = False
    pixels[outside] = 200
    pixels[30:40, 10:14] = PAPER  # a window: nothing but the shade tells what is outside

    plan = read(tmp_path, pixels)

    assert read(tmp_path).area_m2 + 4 * 10 * 0.05**2 == pytest.approx(plan.area_m2)
    assert "grey 200 is taken for unknown" in plan.notes[0]


@pytest.mark.parametrize("name", ["house13_floor_2", "house17_floor_0", "house35_floor_2"])
def test_scanned_floor_with_gaps_is_whole(shared_data, name):
    folder = shared_data / "captured" / "floors"
    if not folder.exists():
        pytest.skip(f"there is no {folder}")
    scale = float((folder / f"{name}.yaml").read_text().split("scale:")[1])

    plan = read_image(folder / f"{name}.png", scale)

    assert plan.area_m2 > 40
    with pytest.raises(FloorPlanError, match="inside of an object"):
        read_image(folder / f"{name}.png", scale, close_gaps=0)


@pytest.mark.slow
def test_building_whose_ground_has_several_shades_of_grey_is_whole(shared_data):
    path = shared_data / "captured" / "clutter" / "photo_2020-01-08_09-53-31.png"
    if not path.exists():
        pytest.skip(f"there is no {path}")

    plan = read_image(path, 0.05)

    assert "grey 212 is taken for unknown, and so are shades up to 220" in plan.notes[0]
    assert plan.area_m2 > 700  # 332 m2 if the grey ground is floor that gaps lead to


def test_compressed_picture_whose_ground_is_as_light_as_the_floor_is_read(tmp_path):
    path = tmp_path / "flat.jpg"
    shades = np.where(HOME == WALL, 0, 254).astype(np.uint8)
    Picture.fromarray(shades).save(path, quality=40)  # with lighter pixels beside the walls

    plan = read_image(path, 0.05)

    assert read(tmp_path).area_m2 == pytest.approx(plan.area_m2, rel=0.02)
    assert not any("unknown_grey" in note for note in plan.notes)


def test_photograph_is_turned_as_its_camera_was_held(tmp_path):
    turned = Picture.Exif()
    turned[0x0112] = 6  # orientation: a quarter turn clockwise
    path = tmp_path / "flat.jpg"
    Picture.fromarray(HOME).save(path, quality=95, exif=turned)

    x0, y0, x1, y1 = read_image(path, 0.05).bounds

    assert y1 - y0 == pytest.approx(92 * 0.05)
    assert x1 - x0 == pytest.approx(52 * 0.05)


def test_room_that_is_open_to_the_outside_is_told_with_the_line_that_closes_it(tmp_path):
    pixels = HOME.copy()
    pixels[10:14, 27:45] = PAPER  # 1.44 m; the door is narrower, so the other room is a home alone
    path = draw(tmp_path, pixels)

    plan = read_image(path, 0.08)

    (note,) = [note for note in plan.notes if "taken for outside" in note]
    assert "a gap of at most 1.6 m in their outer wall" in note
    assert "close_gaps: 1.6" in note
    assert read_image(path, 0.08, close_gaps=1.6).area_m2 > plan.area_m2 + 10


def test_drawing_with_too_many_corners_is_straightened_by_a_pixel(tmp_path, monkeypatch):
    pixels = HOME.copy()
    y, x = np.indices(pixels.shape)
    pixels[(x - 14) + 2 * (y - 14) < 60] = WALL  # a slanted wall of 30 steps
    monkeypatch.setenv("FLEET2D_MAX_CORNERS", "40")

    plan = read(tmp_path, pixels)

    assert any("straightened by up to a pixel" in note for note in plan.notes)
    assert shapely.count_coordinates(plan.polygons) < 40


def test_component_is_found_and_its_settings_have_an_effect(tmp_path):
    path = draw(tmp_path)

    source = Image.model_validate({"path": str(path), "resolution": "4 cm"})

    assert Image is lookup("floorplan", "image")
    assert 0.04 == source.cell
    assert source.load() == read_image(path, 0.04)
    assert Image(path=path, resolution=0.05, threshold=0.01).threshold == 0.01
    for wrong in ({}, {"resolution": 0}, {"resolution": 5}, {"resolution": 0.05, "threshold": 2}):
        with pytest.raises(ValidationError):
            Image.model_validate({"path": str(path), **wrong})


def test_load_floorplan_of_a_picture_asks_for_its_scale(tmp_path):
    path = draw(tmp_path)

    assert read_image(path, 0.05) == load_floorplan(path, resolution=0.05)
    with pytest.raises(FloorPlanError, match="give the metres per pixel as resolution"):
        load_floorplan(path)
    with pytest.raises(FloorPlanError, match="family_home is not a picture"):
        load_floorplan("family_home", resolution=0.05)


def test_drawing_of_light_walls_is_told_and_read_by_negate(tmp_path):
    with pytest.raises(FloorPlanError, match=r"light on dark ground: set floorplan\.negate=true"):
        read(tmp_path, 255 - HOME)

    assert read(tmp_path) == read(tmp_path, 255 - HOME, negate=True)


def test_place_of_a_wide_gap_is_marked_and_closed_by_the_line_to_type(tmp_path):
    pixels = HOME.copy()
    for wall in (slice(10, 14), slice(66, 70)):  # in each room 1.5 m of an outer wall
        pixels[wall, 20:50] = pixels[wall, 70:100] = PAPER
    path = draw(tmp_path, pixels)

    with contextlib.chdir(tmp_path), pytest.raises(FloorPlanError) as caught:
        load_or_mark(path, resolution=0.05)

    assert "floorplan.close_gaps=1.6; flat-question.png marks it" in str(caught.value)
    with Picture.open(tmp_path / "flat-question.png") as marked:
        red = (np.asarray(marked).astype(int) @ (1, -1, -1)) > 200
    column, row = (int(n) for n in re.search(r"\((\d+), (\d+)\)", str(caught.value)).groups())
    assert red.any()
    assert np.abs(np.argwhere(red).mean(axis=0) - (row, column)).max() < 8
    assert read(tmp_path, pixels, close_gaps=1.6).area_m2 > 10
