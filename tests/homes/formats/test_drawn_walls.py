from functools import cache

import numpy as np
import pytest
from tests.drawings import STYLES, Drawing

from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.homes.formats.drawing import Image
from fleet2d.homes.formats.drawn_walls import find_gaps

images = pytest.importorskip("PIL.Image")

PIXEL = 0.025


@cache
def drawn(style):
    return Drawing(load_floorplan("synthetic:33"), style, PIXEL)


def read(folder, style, suffix=".png", **settings):
    path = folder / f"flat{suffix}"
    drawn(style).picture.save(path)
    return Image.model_construct(path=path, resolution=PIXEL, cell=None, **settings).load()


def agreement(plan, style):
    truth = drawn(style).truth
    return float(plan.free_space.intersection(truth).area / plan.free_space.union(truth).area)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
@pytest.mark.parametrize("style", STYLES)
def test_home_is_told_from_lines_text_doors_and_furniture(tmp_path, style, suffix):
    plan = read(tmp_path, style, suffix)

    assert agreement(plan, style) > 0.96
    assert len(plan.rooms) == 4
    assert plan.notes[0].startswith("walls are ")
    assert "line_width: 0 takes all" in plan.notes[0]


def test_with_a_line_width_of_zero_lines_are_walls(tmp_path):
    plan = read(tmp_path, "outlined", line_width=0)

    assert agreement(plan, "outlined") < 0.9
    assert not any(note.startswith("walls are ") for note in plan.notes)


def test_thick_frame_around_a_drawing_is_no_wall(tmp_path):
    pixels = np.array(drawn("solid").picture)
    framed = np.pad(pixels[8:-8, 8:-8], 8, constant_values=20)
    path = tmp_path / "framed.png"
    images.fromarray(framed).save(path)

    plan = Image.model_construct(path=path, resolution=PIXEL, cell=None).load()

    assert agreement(plan, "solid") > 0.96
    assert plan.notes[0].startswith("walls are drawn thick, in a frame")


def test_pixels_as_large_as_lines_leave_all_that_is_dark_wall(tmp_path):
    path = tmp_path / "flat.png"
    Drawing(load_floorplan("synthetic:33"), "outlined", 0.05).picture.save(path)

    plain, told = (
        Image.model_construct(path=path, resolution=0.05, cell=None, line_width=width)
        for width in (0, 0.06)
    )

    assert plain.load() == told.load()


def test_gap_with_a_line_through_it_is_a_window_and_others_are_doors():
    walls = np.zeros((60, 200), np.bool_)
    walls[20:28, 10:40] = walls[20:28, 60:90] = walls[20:28, 150:190] = True
    dark = walls.copy()
    dark[24, 90:150] = True  # 3 m of window, farther than a door is wide

    gaps = find_gaps(walls, dark, 0.05)

    assert [((20, 40, 28, 60), False), ((20, 90, 28, 150), True)] == [
        (gap.box, gap.is_window) for gap in gaps
    ]
    assert gaps[0].window == find_gaps(walls.T.copy(), dark.T.copy(), 0.05)[0].window[::-1]


@pytest.mark.slow
@pytest.mark.parametrize("style", ["solid", "outlined"])
def test_picture_without_a_scale_is_answered_with_that_of_its_doors(tmp_path, style):
    path = tmp_path / "house.png"
    Drawing(load_floorplan("synthetic:3"), style, 0.0125).picture.save(path)

    with pytest.raises(FloorPlanError, match=r"as resolution: 0\.01[23], if its \d+ doors"):
        load_floorplan(path)
