"""Pictures of fields of view, and how poses are parsed."""

import pytest
from tests.scenes import flat_path
from tests.viewing.pictures.test_floorplan import painted

import fleet2d
from fleet2d.errors import InputError, PlacementError
from fleet2d.sight.cached_fov import Flashlight
from fleet2d.viewing.pictures.layers import (
    CameraPose,
    cells_panel,
    draw_fov,
    parse_pose,
    region_panel,
)


@pytest.fixture(scope="module")
def plan():
    return fleet2d.load_floorplan(flat_path())


def test_pose_is_three_to_five_numbers():
    assert CameraPose(1.0, 2.0, 90.0, 4.5, 108.0) == parse_pose("1,2,90")
    assert CameraPose(1.0, -2.5, 0.0, 3.0, 360.0) == parse_pose(" 1, -2.5, 0, 3, 360")


@pytest.mark.parametrize(
    "text",
    ["", "1,2", "1,2,3,4,5,6", "a,b,c", "1,2,nan", "1,2,3,0", "1,2,3,4,361", "inf,2,3", "1;2;3"],
)
def test_other_pose_is_an_error_that_says_how_it_is_written(text):
    with pytest.raises(InputError, match="write x,y,heading"):
        parse_pose(text)


def test_both_panels_show_what_is_in_view_and_only_that(plan):
    pose, inside, behind = CameraPose(2.5, 2.5, 0.0, 6.0, 90.0), (4.5, 3.0), (1.0, 2.5)
    hidden = (7.0, 0.5)  # the wall with the door is in the way
    places = (inside, behind, hidden)
    empty, region, cells = (
        painted(
            lambda axes: cells_panel(plan, pose._replace(far=0.01), axes, Flashlight(), ""), *places
        ),
        painted(lambda axes: region_panel(plan, pose, axes, ""), *places),
        painted(lambda axes: cells_panel(plan, pose, axes, Flashlight(), ""), *places),
    )
    for panel_colors in (region, cells):
        assert empty[0] != panel_colors[0]
        assert empty[1:] == panel_colors[1:]


@pytest.mark.slow
def test_pictures_are_written_the_same_twice(plan, tmp_path):
    for ending in (".png", ".svg"):
        files = [tmp_path / f"{n}{ending}" for n in "ab"]
        for file in files:
            draw_fov(plan, CameraPose(2.5, 2.5, 30.0), file)
        assert files[0].read_bytes() == files[1].read_bytes()


def test_pose_in_a_wall_or_a_wrong_ending_writes_nothing(plan, tmp_path):
    with pytest.raises(PlacementError, match=r"\(-5, 0\) m is in a wall"):
        draw_fov(plan, CameraPose(-5, 0, 0), tmp_path / "a.png")
    with pytest.raises(InputError, match=r"not as '\.jpg'"):
        draw_fov(plan, CameraPose(1, 2.5, 0), tmp_path / "a.jpg")
    assert [] == list(tmp_path.iterdir())
