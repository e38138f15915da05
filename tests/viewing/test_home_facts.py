"""The walls of a stored run, from its scenario and its events."""

import pytest
from tests.scenes import run, scenario

from fleet2d.errors import ScenarioError
from fleet2d.viewing.home_facts import WallsHistory


def test_an_edited_door_of_a_manifest_is_refused() -> None:
    """`fleet2d view` ended in a traceback."""
    stored = run(scenario("1 min"))
    stored.manifest["scenario"]["objects"] = {"d": {"type": "door", "hinge": "left"}}
    with pytest.raises(ScenarioError, match=r"scenario\.objects\.d: "):
        WallsHistory(stored)
