"""Layers: their cells, their names, and what is refused."""

import numpy as np
import pytest
from tests.scenes import flat_path, scenario

import fleet2d
from fleet2d.errors import ComponentError, InputError
from fleet2d.floorplan.home import Home
from fleet2d.floorplan.layers import Layers


@pytest.fixture
def home():
    return Home(fleet2d.load_floorplan(flat_path()))


def test_layer_holds_its_fill_and_written_values(home):
    layer = home.layers.add("dust", "float32", fill=1.5, unit="g", description="on the floor")
    layer.values[home.plan.free] += 1
    layer.set_at(1.0, 3.0, 7)

    assert (np.float32, "g") == (layer.values.dtype, layer.unit)
    assert (7.0, 2.5) == (layer.at(1.0, 3.0), layer.at(4.0, 3.0))
    assert layer.values[0, 0] == 1.5
    assert layer.values is home.layers["dust"].values
    assert np.asarray(layer).max() == 7
    layer.values = np.zeros(layer.values.shape)
    assert not layer.values.any()


def test_same_layer_may_be_added_twice_and_another_of_its_name_not(home):
    first = home.layers.add("dust", "int", unit="g")

    assert first is home.layers.add("dust", "int", unit="g")
    with pytest.raises(ComponentError, match=r"there is a layer 'dust' of int64 \[g\] already"):
        home.layers.add("dust", "int", unit="kg")
    with pytest.raises(ComponentError, match="name yours otherwise"):
        home.layers.add("dust", "bool", unit="g")


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("1st",), "can't be named '1st'"),
        (("a b",), "can't be named"),
        (("",), "can't be named"),
        (("a", "complex"), "there is no dtype 'complex'"),
        (("a", "bool", 2), "fill value, 2, doesn't fit bool"),
        (("a", "uint8", 300), "fill value, 300, doesn't fit uint8"),
        (("a", "int", 0.5), "fill value, 0.5, doesn't fit int"),
        (("a", "int", float("nan")), "fill value, nan, doesn't fit int"),
        (("a", "float32", 1e300), "fill value, .*, doesn't fit float32"),
        (("explored",), "the run maintains itself"),
        (("explored.astro",), "the run maintains itself"),
        (("costmap",), "the run maintains itself"),
    ],
)
def test_wrong_layer_is_refused(home, arguments, why):
    with pytest.raises(ComponentError, match=why):
        home.layers.add(*arguments)
    assert 0 == len(home.layers)


def test_unknown_layer_names_the_known_ones_and_how_to_add_it(home):
    home.layers.add("dust")

    with pytest.raises(ComponentError, match=r"did you mean 'dust'.*There are: dust; add it by"):
        home.layers["dusk"]
    with pytest.raises(ComponentError, match=r"write floorplan.layers.explored: {}"):
        home.layers["explored.astro"]
    with pytest.raises(ComponentError, match="outside the grid"):
        home.layers["dust"].at(100, 3)
    assert "dusk" not in home.layers


def test_layers_of_the_run_are_read_only(home):
    from fleet2d.floorplan.layers import LayerSettings

    layers = Layers(home.plan)
    layer = layers.add_layer("x", LayerSettings(), lambda: np.ones((2, 2)))

    assert layer.values.sum() == 4
    for change in (lambda: layer.set_at(1, 1, 2), lambda: setattr(layer, "values", 3)):
        with pytest.raises(ComponentError, match="is read-only"):
            change()


@pytest.mark.parametrize(
    ("layers", "why"),
    [
        ({"dust": {"dtype": "text"}}, "floorplan.layers.dust.dtype"),
        ({"dust": {"dtype": "bool", "fill": 3}}, "is not a value of bool"),
        ({"dust": {"dtype": "int", "fill": 0.25}}, "is not a value of int"),
        ({"dust": {"fill": "full"}}, "floorplan.layers.dust.fill"),
        ({"dust": {"every": "0 s"}}, "floorplan.layers.dust.every"),
        ({"dust": {"every": "1 h", "store": False}}, "isn't stored"),
        ({"dust": {"color": "red"}}, "unknown key 'color'"),
        ({"2": {}}, "must be letters"),
        ({"explored.astro": {}}, "must be letters"),
        ({"explored": {"dtype": "int"}}, "leave out 'dtype'"),
        ({"costmap": {"unit": "m"}}, "leave out 'unit'"),
    ],
)
def test_wrong_layer_of_a_scenario_is_an_error_that_says_where(layers, why):
    content = scenario()
    content["floorplan"]["layers"] = layers
    with pytest.raises(InputError, match=why) as caught:
        fleet2d.load_scenario(content)
    assert "floorplan.layers" in str(caught.value)
