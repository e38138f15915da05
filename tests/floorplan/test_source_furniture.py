"""Furniture in a scenario: placed piece by piece, and by rule."""

import pytest
from pydantic import ValidationError

from fleet2d.errors import FloorPlanError, ScenarioError
from fleet2d.floorplan.load import load_floorplan
from fleet2d.floorplan.native import Bundled
from fleet2d.floorplan.source import Furnishing
from fleet2d.scenario.load import load_scenario

RUG = {"type": "rug", "at": [12.0, 2.0], "size": [1.2, 1.2]}


def test_pieces_are_added_to_the_plan_with_ways_to_use_them():
    chair = {"type": "chair", "at": [13.0, 3.0], "heading_deg": 180, "name": "throne"}
    plan = Bundled(furniture=[RUG, chair]).plan()
    known = load_floorplan().objects
    rug, throne = plan.objects[len(known) :]

    assert ("throne", "chair", "path") == (throne.name, throne.type, throne.blocks)
    assert (12.0, 2.0) == pytest.approx(rug.footprint.centroid.coords[0])
    (seat,) = throne.uses
    assert (13.0, 3.0, "sit") == (seat.x, seat.y, seat.posture)
    assert seat.approach is not None


def test_piece_blocks_what_the_scenario_says():
    plan = Bundled(furniture=[{**RUG, "blocks": "sight", "name": "screen"}]).plan()

    assert "sight" == plan.object("screen").blocks


@pytest.mark.parametrize(
    ("piece", "message"),
    [
        ({"at": [-3, 1]}, r"floorplan.furniture\[0\]: the rug at \(-3, 1\) m is not inside"),
        ({"at": [10.5, 2]}, "overlaps a wall of family_home: its box is 1.20 m x 1.20 m"),
    ],
)
def test_piece_that_stands_in_no_free_space_is_refused(piece, message):
    with pytest.raises(FloorPlanError, match=message):
        Bundled(furniture=[{**RUG, **piece}]).plan()


@pytest.mark.parametrize("piece", [{"size": [0, 1]}, {"size": [1]}, {"blocks": "light"}, {"x": 1}])
def test_wrong_settings_of_a_piece_are_refused(piece):
    with pytest.raises(ValidationError):
        Bundled(furniture=[{**RUG, **piece}])


def test_furnish_takes_true_or_settings():
    scenario = load_scenario("bundled:paper", "floorplan.furnish={seed: 3, density: 0.5}")

    assert Furnishing(seed=3, density=0.5) == scenario.floorplan.furnish
    assert load_scenario("bundled:paper", "floorplan.furnish=true").floorplan.furnish is True
    with pytest.raises(ScenarioError, match="furnish"):
        load_scenario("bundled:paper", "floorplan.furnish=maybe")
