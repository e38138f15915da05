"""Maps drawn as text: `.` free, `#` occupied, a blank unknown; a pixel is 0.1 m."""

import numpy as np
import pytest

from fleet2d.homes.formats.cleaning import OccupancyMap, bridge_gaps, drop_rays, drop_scraps
from fleet2d.kernels import label_parts


def two_rooms(gap, rows=slice(0, 20), thickness=1):
    """Two rooms of 2 m x 1.5 m, with pixels between them of which some rows are `gap`."""
    pixels = np.full((20, 30 + thickness), ".")
    pixels[:, 15 : 15 + thickness] = "#"
    pixels[rows, 15 : 15 + thickness] = gap
    return OccupancyMap(pixels == ".", pixels == "#", 0.1)


@pytest.mark.parametrize("thickness", [1, 2])
def test_unknown_row_between_rooms_opens_and_wall_beside_it_stays(thickness):
    raw = two_rooms(" ", slice(5, 18), thickness)

    opened, note = bridge_gaps(raw, 2)

    assert 13 * thickness == np.count_nonzero(opened)
    assert not (opened & raw.occupied).any()
    assert "are open: 1" in note


def test_shut_door_opens_and_a_wall_along_the_whole_room_stays():
    walls = np.full((20, 33), "#")
    walls[:, :15] = walls[:, 18:] = "."
    walls[5:14, 15] = walls[5:14, 17] = "."  # a door of 0.9 m in a wall of 0.3 m, one pixel thick
    door = OccupancyMap(walls == ".", walls == "#", 0.1)

    assert 9 == np.count_nonzero(bridge_gaps(door, 2)[0])
    assert not bridge_gaps(two_rooms("#"), 2)[0].any()


def test_shut_door_that_is_thinner_than_its_wall_opens():
    pixels = np.full((30, 32), ".")
    pixels[:, 15:17] = "#"
    pixels[5:14, 15] = "."  # a door of 0.9 m, one pixel thick, in a wall of two
    raw = OccupancyMap(pixels == ".", pixels == "#", 0.1)

    opened, _ = bridge_gaps(raw, 2)

    assert np.array_equal(np.argwhere(opened), [[row, 16] for row in range(5, 14)])


def test_wall_opens_where_a_robot_drove():
    raw = two_rooms("#")
    driven = np.zeros(raw.free.shape, np.bool_)
    driven[10] = True

    opened, _ = bridge_gaps(raw, 2, driven)

    assert opened[10, 15]


def test_scraps_are_parts_below_the_area_but_never_the_largest():
    raw = two_rooms("#")
    raw.free[:, 22:] = False  # 1.2 m2 are left

    assert not drop_scraps(raw, 1.0)[0].any()
    assert 20 * 6 == np.count_nonzero(drop_scraps(raw, 1.3)[0])
    assert 20 * 6 == np.count_nonzero(drop_scraps(raw, 100)[0])
    assert not drop_scraps(raw, 0)[0].any()


def turned_rooms(degrees, door):
    """Two rooms of 4 m x 3 m beside each other, turned; the wall between is 3 pixels thick, and the
    shut door in it one to two."""
    y, x = np.mgrid[0:130, 0:170] - np.array([65, 85])[:, None, None]
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    u, v = x * cosine + y * sine, y * cosine - x * sine
    home, wall = (abs(u) < 41.5) & (abs(v) < 30), abs(u) < 1.5
    in_door = (abs(u) < 0.8) & (v > door.start) & (v < door.stop)
    free = home & ~(wall & ~((v > door.start) & (v < door.stop))) & ~in_door
    return OccupancyMap(free, ~free, 0.1)


@pytest.mark.parametrize("degrees", [0, 17, 33, 45])
def test_shut_door_opens_however_the_map_is_turned(degrees):
    raw = turned_rooms(degrees, slice(-5, 4))

    opened, _ = bridge_gaps(raw, 2)

    assert label_parts(raw.free, False).max() == 1
    assert label_parts(raw.free | opened, False).max() == 0
    assert np.count_nonzero(opened) < 30


def test_shut_door_opens_though_a_ray_joins_the_rooms():
    raw = turned_rooms(0, slice(-5, 4))
    raw.free[90] |= abs(np.arange(170) - 85) < 5

    assert not bridge_gaps(raw, 2)[0].any()
    assert np.count_nonzero(bridge_gaps(raw, 2, ray_width=0.3)[0]) == 8


def test_room_behind_a_wide_shut_door_gets_a_door_in_its_middle():
    raw = turned_rooms(0, slice(-20, 20))

    opened, _ = bridge_gaps(raw, 2)

    rows = np.flatnonzero(opened.any(axis=1))
    assert 0.7 <= (rows[-1] - rows[0] + 1) * raw.pixel <= 0.9
    assert abs(rows.mean() - 65) < 1.5


def seen_through_a_window(walls="#"):
    """A room of 2 m x 4 m with a window of two pixels, and the rays that widen beyond it."""
    pixels = np.full((60, 62), " ")
    pixels[8:52, 0:24] = walls
    pixels[10:50, 2:22] = "."
    pixels[29:31, 22:24] = "."
    for column in range(24, 60):
        half = 1 + (column - 24) // 3
        pixels[30 - half : 30 + half, column] = "."
    pixels[30 - 12 : 30 + 12, 60] = "#"  # the neighbor's wall, where the rays end
    return OccupancyMap(pixels == ".", pixels == "#", 0.1)


def test_what_was_seen_through_a_window_is_left_out_and_the_room_stays():
    """In two homes of shared data bundles of rays were rooms, in which people could not be."""
    raw = seen_through_a_window()
    nobody = np.zeros(raw.free.shape, np.bool_)

    rays, note = drop_rays(raw, 0.3, nobody)

    assert not rays[10:50, 2:22].any()
    assert rays[:, 26:60].sum() == raw.free[:, 26:60].sum()
    assert "rays left out" in note
    assert not drop_rays(raw, 0.0, nobody)[0].any()


def test_a_place_that_a_robot_reached_is_no_ray():
    raw = seen_through_a_window()
    driven = np.zeros(raw.free.shape, np.bool_)
    driven[30, 50] = True

    assert not drop_rays(raw, 0.3, driven)[0].any()


def test_a_second_room_that_its_walls_enclose_is_no_ray():
    pixels = np.full((24, 44), "#")
    pixels[2:22, 2:20] = pixels[2:22, 24:42] = "."
    pixels[11, 20:24] = "."
    raw = OccupancyMap(pixels == ".", pixels == "#", 0.1)

    assert not drop_rays(raw, 0.3, np.zeros(raw.free.shape, np.bool_))[0].any()
