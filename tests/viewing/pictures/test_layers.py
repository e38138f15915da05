"""Pictures of layers: colours where there is something, the same bytes twice, clear errors."""

import numpy as np
import pytest
from tests.scenes import flat_path, run, scenario
from tests.thorough import some
from tests.viewing.pictures.test_floorplan import painted

import fleet2d
from fleet2d.errors import ArtifactError, InputError
from fleet2d.viewing.pictures.floorplan import floorplan_axes
from fleet2d.viewing.pictures.layers import draw_layer, layer_on_axes


@pytest.fixture(scope="module")
def layer_run():
    content = scenario("3 min", robots={"astro": {"type": "patrol"}})
    content["floorplan"]["layers"] = {
        "explored": {"every": "1 min"},
        "last_seen": {},
        "dust": {"unit": "g"},
    }
    return run(content)


def colors(plan, values, *places):
    """Draw a layer, or none, and return the colours at places [m]."""

    def draw(axes):
        floorplan_axes(plan, axes, names=False, title=False)
        if values is not None:
            layer_on_axes(plan, values, axes)

    return painted(draw, *places)


@pytest.mark.parametrize("nothing", [False, -1, np.nan])
def test_only_cells_with_a_value_are_coloured(nothing):
    plan = fleet2d.load_floorplan(flat_path())
    values = np.full(plan.free.shape, nothing)
    kitchen = plan.room_of_cell == plan.room("kitchen_1").index
    values[kitchen] = 1
    places = ((7.0, 1.0), (1.0, 2.5), (-0.05, 2.0))

    empty, drawn = colors(plan, None, *places), colors(plan, values, *places)

    assert empty[0] != drawn[0]
    assert empty[1:] == drawn[1:]


def test_larger_values_have_another_colour():
    plan = fleet2d.load_floorplan(flat_path())
    values = np.zeros(plan.free.shape)
    values[:, : values.shape[1] // 2] = 4.5

    left, right = colors(plan, values, (1.0, 2.5), (7.0, 1.0))

    assert left != right


@pytest.mark.slow
def test_png_and_svg_are_written_the_same_twice(layer_run, tmp_path):
    cases = [
        (name, ending)
        for name in ("dust", "explored.astro", "last_seen.astro")
        for ending in STARTS
    ]
    for name, ending in some(cases, 3):
        first, second = tmp_path / f"a{ending}", tmp_path / f"b{ending}"
        draw_layer(layer_run, name, first)
        draw_layer(layer_run, name, second)
        assert first.read_bytes().startswith(STARTS[ending])
        assert first.read_bytes() == second.read_bytes()


def test_what_cannot_be_drawn_is_an_error_that_says_why(layer_run, tmp_path):
    with pytest.raises(ArtifactError, match="stored no layer 'mud'"):
        draw_layer(layer_run, "mud", tmp_path / "a.png")
    with pytest.raises(ArtifactError, match="not stored at step 60"):
        draw_layer(layer_run, "explored.astro", tmp_path / "a.png", 60)
    with pytest.raises(InputError, match=r"not as '\.gif'"):
        draw_layer(layer_run, "dust", tmp_path / "a.gif")
    assert [] == list(tmp_path.iterdir())


STARTS = {".png": b"\x89PNG", ".svg": b"<?xml"}
