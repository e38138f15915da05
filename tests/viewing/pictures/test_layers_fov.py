"""Pictures of fields of view, and how poses are parsed."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from tests.scenes import flat_path

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
    colors = []
    for panel in ("none", "region", "cells"):
        figure = Figure(figsize=(8, 8), dpi=100)
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, 1, 1))
        if panel == "region":
            region_panel(plan, pose, axes, "")
        else:
            panel_pose = pose if panel == "cells" else pose._replace(far=0.01)
            cells_panel(plan, panel_pose, axes, Flashlight(), "")
        canvas.draw()
        image = np.asarray(canvas.buffer_rgba())[::-1, :, :3]
        pixels = axes.transData.transform(np.array([inside, behind, hidden])).astype(int)
        colors.append([image[y, x].tolist() for x, y in pixels])
    for panel_colors in colors[1:]:
        assert colors[0][0] != panel_colors[0]
        assert colors[0][1:] == panel_colors[1:]


def test_pose_in_a_wall_or_a_wrong_ending_writes_nothing(plan, tmp_path):
    with pytest.raises(PlacementError, match=r"\(-5, 0\) m is in a wall"):
        draw_fov(plan, CameraPose(-5, 0, 0), tmp_path / "a.png")
    with pytest.raises(InputError, match=r"not as '\.jpg'"):
        draw_fov(plan, CameraPose(1, 2.5, 0), tmp_path / "a.jpg")
    assert [] == list(tmp_path.iterdir())
