"""Maps drawn as text: `.` free, `#` occupied, a blank unknown; a pixel is 0.1 m."""

import numpy as np
import pytest
import shapely

from fleet2d.errors import FloorPlanError
from fleet2d.homes.formats.cleaning import OccupancyMap
from fleet2d.homes.formats.occupancy import free_space

KEEP = {"speck_area_m2": 0.0, "ray_width": 0.0}


def draw(*lines, pixel=0.1):
    width = max(map(len, lines))
    pixels = np.array([list(line.ljust(width)) for line in lines])[::-1]
    return OccupancyMap(pixels == ".", pixels == "#", pixel)


def room(rows, columns):
    """A walled room with one pixel of unknown around the walls."""
    pixels = np.full((rows + 4, columns + 4), " ")
    pixels[1:-1, 1:-1] = "#"
    pixels[2:-2, 2:-2] = "."
    return pixels


def as_map(pixels, pixel=0.1):
    return OccupancyMap(pixels == ".", pixels == "#", pixel)


def pixels_of(shape, pixel=0.1):
    return round(shape.area / pixel**2)


# --- Walls --------------------------------------------------------------------------------------


def test_unknown_inside_is_a_hole_with_a_note_of_its_length():
    free, notes = free_space(draw("#####", "#...#", "#. .#", "#...#", "#####"), **KEEP)

    assert 1 == len(free.interiors)
    assert 8 == pixels_of(free)
    assert ["0.40 m of the walls are where free space meets unknown, without an obstacle"] == notes


def test_space_to_the_edge_of_the_image_ends_there_with_a_note():
    free, notes = free_space(draw("...", "..."), **KEEP)

    assert 6 == pixels_of(free)
    assert [
        "the free space reaches the edge of the image along 1.00 m, which is taken for a wall"
    ] == notes


def test_a_map_with_nothing_free_is_refused():
    with pytest.raises(FloorPlanError, match="no pixel is free: check negate"):
        free_space(draw("###", "# #"), **KEEP)


# --- Specks -------------------------------------------------------------------------------------


def test_specks_smaller_than_the_area_become_free_and_are_counted():
    pixels = room(20, 20)
    pixels[5, 5:7] = "#"  # 0.02 m2
    pixels[10, 5:8] = "#"  # 0.03 m2
    pixels[15, 5] = " "  # unknown, 0.01 m2

    free, notes = free_space(as_map(pixels), speck_area_m2=0.03, ray_width=0.0)

    assert 400 - 3 == pixels_of(free)
    assert "2 groups of pixels" in notes[0]
    assert "(0.03 m2 in all)" in notes[0]


def test_specks_that_touch_something_stay():
    pixels = room(20, 20)
    pixels[2, 5] = "#"  # at the wall
    pixels[3, 10] = "#"
    pixels[4:8, 11] = "#"  # touches it at a corner

    free, notes = free_space(as_map(pixels), speck_area_m2=0.03, ray_width=0.0)

    assert 400 - 6 == pixels_of(free)
    assert [] == notes


# --- Rays ---------------------------------------------------------------------------------------


def test_rays_through_a_window_are_cut_off_just_behind_it():
    pixels = np.full((44, 60), " ")
    pixels[:24, :24] = room(20, 20)
    for k in range(22, 58):  # two rays through a gap of two pixels
        pixels[10, k] = "."
        pixels[11 + (k - 22) // 2, k] = "."

    free, notes = free_space(as_map(pixels), speck_area_m2=0.0, ray_width=0.3)

    # The disc is three pixels across: a pixel of each ray is within half of that.
    assert 400 + 2 == pixels_of(free)
    assert "that only passages narrower than 0.3 m join to the rest" in notes[0]


def test_room_behind_a_gap_narrower_than_rays_is_left_out_and_behind_a_wider_one_kept():
    both = np.concatenate([room(20, 20), room(20, 10)], axis=1)
    wide, narrow = both.copy(), both.copy()
    wide[10:13, 22:26] = "."
    narrow[10:12, 22:26] = "."

    wide_space, _ = free_space(as_map(wide), speck_area_m2=0.0, ray_width=0.3)
    cut, notes = free_space(as_map(narrow), speck_area_m2=0.0, ray_width=0.3)

    assert 400 + 12 + 200 == pixels_of(wide_space)
    assert 400 + 2 == pixels_of(cut)
    assert "2.06 m2 of free space, in pieces: 1, that only passages" in notes[0]


def test_niches_and_corners_within_the_width_are_kept_whole():
    pixels = room(20, 20)
    pixels[10, 22:25] = "."  # an opening two pixels deep into what is unknown
    pixels = np.pad(pixels, 2, constant_values=" ")
    pixels[12, 26] = "."  # and a third: 0.3 m in all
    deeper = pixels.copy()
    deeper[12, 27] = "."

    whole, notes = free_space(as_map(pixels), speck_area_m2=0.0, ray_width=0.3)
    cut, _ = free_space(as_map(deeper), speck_area_m2=0.0, ray_width=0.3)

    assert 400 + 3 == pixels_of(whole)
    assert not any("left out" in note for note in notes)
    assert 400 + 1 == pixels_of(cut)


def test_slanted_corners_keep_every_pixel():
    """An opening alone would round them off."""
    side = 40
    y, x = np.indices((side, side))
    pixels = np.where((y > 0) & (x > 0) & (x + y < side), ".", "#")

    free, notes = free_space(as_map(pixels), speck_area_m2=0.0, ray_width=0.5)

    assert np.count_nonzero(pixels == ".") == pixels_of(free)
    assert [] == notes


def test_space_narrower_than_rays_everywhere_is_refused():
    with pytest.raises(FloorPlanError, match=r"nowhere 0.3 m wide.*floorplan.ray_width"):
        free_space(draw("....", "    "), speck_area_m2=0.0, ray_width=0.3)


# --- All sides alike ----------------------------------------------------------------------------


@pytest.mark.parametrize("ray_width", [0.0, 0.2, 0.3, 0.4, 0.55])
def test_cleaning_is_the_same_on_every_side(ray_width):
    """Known failure 15: erosion with even kernels gives a different clearance on each side."""
    rng = np.random.default_rng(5)
    pixels = np.pad(rng.choice([".", "#", " "], (60, 45), p=[0.9, 0.07, 0.03]), 1)
    pixels[20:50, 10:30] = "."
    areas, holes, notes = set(), set(), set()
    for turns in range(4):
        for image in (np.rot90(pixels, turns), np.rot90(pixels, turns)[:, ::-1]):
            free, image_notes = free_space(as_map(image), speck_area_m2=0.03, ray_width=ray_width)
            areas.add(pixels_of(free))
            holes.add(len(free.interiors))
            notes.add(tuple(note.partition("round (")[0] for note in image_notes))

    assert 1 == len(areas) == len(holes) == len(notes)


def test_random_maps_give_sound_polygons_of_whole_pixels():
    rng = np.random.default_rng(9)
    for _ in range(50):
        pixels = rng.choice([".", "#"], (25, 30), p=[0.7, 0.3])

        free, _ = free_space(as_map(pixels), **KEEP)

        assert free.is_valid, shapely.is_valid_reason(free)
        assert abs(free.area / 0.01 - pixels_of(free)) < 1e-9


# --- Where it is --------------------------------------------------------------------------------
