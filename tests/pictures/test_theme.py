"""Pictures of the dark theme."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Rectangle
from tests.thorough import some

import fleet2d
from fleet2d.palette import ROBOT_COLORS, ROOM_COLORS, TEXT_COLOR, USER_COLORS, room_color
from fleet2d.pictures.floorplan import draw_floorplan
from fleet2d.pictures.theme import SCALE, dark_colors, darken, themed


def luminance(colors: object) -> np.ndarray:
    """Return the relative luminance of colours in the dark, after WCAG 2."""
    rgb = dark_colors(colors)[:, :3]  # type: ignore[arg-type]
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return linear @ np.array([0.2126, 0.7152, 0.0722])


def test_words_and_bodies_stand_out_from_rooms_in_the_dark() -> None:
    rooms = luminance(list(ROOM_COLORS.values()))
    words = luminance(TEXT_COLOR)[0]
    bodies = luminance([*USER_COLORS, *ROBOT_COLORS])
    assert ((words + 0.05) / (rooms + 0.05)).min() > 7
    assert ((bodies[:, None] + 0.05) / (rooms + 0.05)).min() > 3


def test_bodies_are_told_apart_in_the_dark() -> None:
    colors = dark_colors([*USER_COLORS])[:, :3]
    for color_a, color_b in itertools.combinations(colors, 2):
        assert np.abs(color_a - color_b).max() > 0.15


def test_colors_that_stand_for_numbers_stay() -> None:
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    shades = np.array([[[1.0, 1.0, 1.0], [0.2, 0.5, 0.9]]])
    scale = axes.imshow(shades, label=SCALE)
    picture = axes.imshow(shades)
    bars = axes.pcolormesh(np.arange(4.0).reshape(2, 2))
    bar_colors = bars.to_rgba(bars.get_array())
    darken(figure)
    assert np.array_equal(shades, scale.get_array())
    assert picture.get_array()[0, 0].max() < 0.15
    assert np.array_equal(bar_colors, bars.to_rgba(bars.get_array()))


def test_what_is_not_drawn_stays_so() -> None:
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    (line,) = axes.plot([0, 1], [0, 1], marker="o", mfc="none")
    box = axes.add_patch(Rectangle((0, 0), 1, 1, fc="none"))
    darken(figure)
    assert "none" == line.get_markerfacecolor()
    assert 0 == box.get_facecolor()[3]


@pytest.mark.slow
@pytest.mark.parametrize("ending", some([".png", ".svg", ".pdf"], 3))
def test_dark_picture_is_written_the_same_each_time(tmp_path: Path, ending: str) -> None:
    plan = fleet2d.load_floorplan()
    pictures = []
    for number in range(2):
        path = tmp_path / f"{number}{ending}"
        with themed("dark"):
            draw_floorplan(plan, path)
        pictures.append(path.read_bytes())
    assert pictures[0] == pictures[1]
    light = tmp_path / f"light{ending}"
    draw_floorplan(plan, light)
    assert pictures[0] != light.read_bytes()
    if ending == ".png":
        assert imread(tmp_path / "0.png")[0, 0, :3].max() < 0.15
        assert imread(light)[0, 0, :3].min() > 0.95


def test_room_keeps_its_hue() -> None:
    red, _, blue = dark_colors(room_color("bedroom"))[0, :3]
    assert blue > red
    red, _, blue = dark_colors(room_color("kitchen"))[0, :3]
    assert red > blue
