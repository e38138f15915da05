"""All real maps against the numbers of their own files."""

import re
from pathlib import Path

import pytest

from fleet2d.configuration.built_in import COMPONENTS
from fleet2d.configuration.units import Text
from fleet2d.errors import FloorPlanError
from fleet2d.floorplan.load import advise_type, format_of_file, is_floorplan, load_floorplan
from fleet2d.floorplan.source import FloorPlanSource
from fleet2d.homes.synthetic.source import Synthetic


def test_synthetic_home_is_named_by_its_seed():
    assert Synthetic(seed=7).load() == load_floorplan("synthetic:7")
    with pytest.raises(FloorPlanError, match=r"synthetic:0, synthetic:1"):
        load_floorplan("synthetic7")


@pytest.mark.parametrize(
    ("name", "content", "advice"),
    [
        ("he.json", '{"verts": []}', "{type: houseexpo, path: he.json}"),
        ("vacuum.json", '{"__class": "ValetudoMap"}', "{type: valetudo, path: vacuum.json}"),
        ("own.yaml", "format: fleet2d-floorplan", "{type: native, path: own.yaml}"),
        ("map.yaml", "image: map.pgm", "{type: ros, path: map.yaml}"),
        ("odd.json", '{"walls": []}', "it has none of"),
        ("absent.json", None, r"{type: TYPE, path: absent.json} with one of .*geojson, .*valetudo"),
        ("absent.yml", None, r"{type: TYPE, path: absent.yml} with one of .*native, .*ros, .*"),
        ("absent.png", None, "{type: image, path: absent.png}"),
    ],
)
def test_advice_about_a_file_named_as_a_type_follows_its_content(name, content, advice, tmp_path):
    if content is not None:
        (tmp_path / name).write_text(content)

    assert re.search(advice, advise_type(Text(name, tmp_path)))


@pytest.mark.parametrize("name", ["synthetic", "acme.home", "mine.json:Home"])
def test_no_advice_about_what_names_no_file(name):
    assert advise_type(name) == ""


def test_format_is_recognized_by_the_ending_that_it_declares(tmp_path, monkeypatch):
    class Drawn(FloorPlanSource):
        """A home, named in a file that is neither JSON nor YAML."""

        suffixes = (".home",)
        path: Path

        def load(self):
            return load_floorplan(self.path.read_text(), self.cell)

    monkeypatch.setitem(COMPONENTS["floorplan"], "drawn", "tests.homes:Drawn")
    monkeypatch.setattr("tests.homes.Drawn", Drawn, raising=False)
    monkeypatch.setattr(Drawn, "type_name", "drawn")
    file = tmp_path / "mine.HOME"
    file.write_text("synthetic:7")

    assert is_floorplan(file)
    assert format_of_file(file) == "drawn"
    assert load_floorplan(file, 0.1).name == load_floorplan("synthetic:7", 0.1).name
    assert not is_floorplan(tmp_path / "mine.xyz")
