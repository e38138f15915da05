"""The bundled scenarios, with the real components."""

import json
from pathlib import Path

import jsonschema
import pytest

from fleet2d.configuration.documents import read_document
from fleet2d.scenario.compose import BUNDLED, ENTRIES
from fleet2d.scenario.load import load_scenario
from fleet2d.scenario.schema import schema

EXAMPLES = sorted(
    path
    for path in (Path(__file__).parents[2] / "examples").rglob("*.yaml")
    if path.parent.name
    not in (
        "studies",
        "datasets",
        "agents",
        "paper",
        "release_gate",
        "transfer",
    )  # other kinds of files
)


@pytest.fixture(scope="module")
def validator():
    """Whether the schema itself is valid is asked once, by the tests of the command line."""
    return jsonschema.validators.validator_for(schema())(schema())


@pytest.mark.parametrize("file", [*sorted(BUNDLED.glob("*.yaml")), *EXAMPLES], ids=lambda f: f.stem)
def test_file_that_we_ship_conforms_to_the_schema(file, validator):
    written = json.dumps(read_document(file).data, default=str)  # an editor sees dates as text
    validator.validate(json.loads(written))


@pytest.mark.parametrize("file", sorted(BUNDLED.glob("*.yaml")), ids=lambda file: file.stem)
def test_bundled_scenario_loads(file):
    scenario = load_scenario(f"bundled:{file.stem}")

    again = load_scenario(scenario.resolved())
    assert scenario.resolved() == again.resolved()
    without = {"expect": {}}  # equal expectations are equal by their texts only
    assert scenario.model_copy(update=without) == again.model_copy(update=without)


def test_resolved_scenario_conforms_to_the_schema(validator):
    resolved = load_scenario("bundled:paper").resolved()

    assert set(ENTRIES) < set(resolved)
    validator.validate(resolved)


@pytest.mark.parametrize(
    "wrong",
    [
        {"simulatoin": {}},
        {"users": {"ana": {"type": "meander", "stops": []}}},
        {"robots": {"astro": {"behaviors": [{"type": "nowhere"}]}}},
        {"robots": {"astro": "meandr"}},
    ],
)
def test_schema_refuses_what_loading_refuses(wrong, validator):
    with pytest.raises(jsonschema.ValidationError):
        validator.validate(wrong)
