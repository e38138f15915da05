import importlib
import sys

import matplotlib as mpl
import numpy as np
import pytest
import shapely
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from fleet2d.errors import InputError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.plan import FloorPlan, LabelledRegion
from fleet2d.palette import ROOM_COLORS
from fleet2d.viewing.look import WALL_TOP, floor_of, room_labels
from fleet2d.viewing.pictures.floorplan import draw_floorplan, floorplan_axes


@pytest.fixture(scope="module")
def home():
    return load_floorplan()


def painted(draw, *places):
    """Draw on axes, and return the colours (r, g, b) at places [m]."""
    figure = Figure(figsize=(8, 8), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    draw(axes)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())[::-1, :, :3] / 255
    at = axes.transData.transform(np.array(places)).astype(int)
    return [image[y, x].tolist() for x, y in at]


def pixels(plan, *places, **options):
    """Draw a plan and return the colours (r, g, b) at places [m]."""
    return painted(lambda axes: floorplan_axes(plan, axes, **options), *places)


@pytest.mark.slow
def test_png_and_svg_are_written_the_same_twice(home, tmp_path):
    for ending, start in ((".png", b"\x89PNG"), (".svg", b"<?xml"), (".PNG", b"\x89PNG")):
        first, second = tmp_path / f"a{ending}", tmp_path / f"b{ending}"
        draw_floorplan(home, first)
        draw_floorplan(home, second)

        assert first.read_bytes().startswith(start)
        assert first.read_bytes() == second.read_bytes()
    assert {"a.png", "a.svg", "a.PNG", "b.png", "b.svg", "b.PNG"} == {
        path.name for path in tmp_path.iterdir()
    }


def test_a_users_own_style_changes_nothing(home, tmp_path):
    draw_floorplan(home, tmp_path / "plain.svg")
    with mpl.rc_context({"font.size": 30, "axes.facecolor": "red", "savefig.facecolor": "red"}):
        draw_floorplan(home, tmp_path / "styled.svg")
        assert 30 == mpl.rcParams["font.size"]

    assert (tmp_path / "plain.svg").read_bytes() == (tmp_path / "styled.svg").read_bytes()


def test_colours_show_rooms_walls_and_outside(home):
    kitchen, wall, outside = pixels(home, (16.5, 8.0), (4.075, 3.0), (19.5, 1.0), names=False)

    _, tiles, _ = floor_of("kitchen")  # each tile is a little paler, or not
    assert all(np.array(to_rgb(tiles)) - 0.01 <= kitchen)
    assert np.allclose(to_rgb(WALL_TOP), wall, atol=0.01)
    assert [1.0, 1.0, 1.0] == outside


def test_holes_are_walls_only_near_their_edges():
    ring = shapely.difference(shapely.box(0, 0, 10, 10), shapely.box(3, 3, 7, 7))

    inside, edge, free = pixels(
        FloorPlan.build("ring", ring), (5, 5), (3.07, 5), (1, 1), names=False
    )

    assert [1.0, 1.0, 1.0] == inside
    assert np.allclose(to_rgb(WALL_TOP), edge, atol=0.01)
    assert np.allclose(to_rgb(ROOM_COLORS["unknown"]), free, atol=0.01)


def words(plan, **options):
    figure = Figure(figsize=(8, 8))
    axes = figure.add_axes((0, 0, 1, 1))
    floorplan_axes(plan, axes, **options)
    return [text.get_text() for text in axes.texts]


def test_words_name_the_plan_its_rooms_the_scale_and_the_entrance(home):
    texts = words(home)

    assert "family_home\n186.1 m² · 14 rooms" in texts
    labels = zip(room_labels(home.rooms), home.rooms, strict=True)
    # The smallest one, in which a door swings, has only its name.
    texts_of_rooms = {f"{label}\n{room.area_m2:.1f} m²" for label, room in labels}
    assert {"Storage 2\n2.3 m²"} == texts_of_rooms - set(texts)
    assert "Storage\n2" in texts
    assert {"0", "2.5", "5 m", "entrance"} <= set(texts)
    assert {"0", "2.5", "5 m", "entrance"} == set(words(home, names=False, title=False))


def test_rooms_too_small_for_their_name_show_their_number():
    closets = [
        LabelledRegion(("storage",), shapely.box(0.8 * k, 0, 0.8 * k + 0.8, 0.8)) for k in range(60)
    ]

    texts = words(FloorPlan.build("row", shapely.box(0, 0, 48, 0.8), closets))

    assert "59" in texts
    assert not any("storage" in text for text in texts)


@pytest.mark.slow
@pytest.mark.parametrize("start", ["1bb5", "69c2", "f1ac"])
def test_odd_and_large_plans_are_drawn(shared_data, tmp_path, start):
    (path,) = (shared_data / "houseexpo").glob(f"{start}*.json")

    draw_floorplan(load_floorplan(path, 0.2), tmp_path / "plan.png")

    assert (tmp_path / "plan.png").stat().st_size > 5_000


@pytest.mark.parametrize("name", ["plan.bmp", "plan", "plan.png.txt"])
def test_another_ending_is_refused(home, tmp_path, name):
    with pytest.raises(InputError, match=r"a picture is written as \.png, \.svg or \.pdf"):
        draw_floorplan(home, tmp_path / name)

    assert [] == list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_refused(home, tmp_path):
    (tmp_path / "taken.png").mkdir()
    for path in (tmp_path / "nowhere" / "plan.png", tmp_path / "taken.png"):
        with pytest.raises(InputError, match=r"can't write the picture .*(plan|taken)\.png"):
            draw_floorplan(home, path)

    assert ["taken.png"] == [path.name for path in tmp_path.iterdir()]


def test_without_matplotlib_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for module in [name for name in sys.modules if name.startswith("fleet2d.viewing.pictures")]:
        monkeypatch.delitem(sys.modules, module)

    with pytest.raises(InputError, match=r'pip install "fleet2d\[viz\]"'):
        importlib.import_module("fleet2d.viewing.pictures.floorplan")
