"""The JSON Schema for editors and the list of components."""

import json

import pytest

from fleet2d.scenario.schema import describe_components, schema

pytestmark = pytest.mark.usefixtures("stand_ins")


@pytest.fixture
def written():
    return schema()


def test_schema_is_json_that_refuses_unknown_keys_and_lets_files_be_extended(written):
    assert written == json.loads(json.dumps(written))
    assert written["additionalProperties"] is False
    assert "extends" in written["properties"]
    assert "required" not in written
    assert "required" not in written["$defs"]["SimulationSettings"]


def test_schema_completes_the_short_form(written):
    user = written["properties"]["users"]["additionalProperties"]["anyOf"]
    tour = next(form for form in user[0]["anyOf"] if form.get("title") == "tour")

    assert {"type", "stops", "dwell", "radius", "speed"} <= set(tour["properties"])
    assert ["type"] == tour["required"]
    assert {"type": "string", "enum": ["drift", "tour"]} in user[0]["anyOf"]
    assert "null" == user[1]["type"]


def test_schema_offers_every_type_and_its_bare_name(written):
    plans = written["$defs"]["floorplan"]["anyOf"]

    assert {"const": "houseexpo"} == written["$defs"]["File"]["properties"]["type"]
    assert {"$ref": "#/$defs/File", "required": ["type"]} in plans
    assert {"type": "string", "enum": ["empty", "houseexpo"]} in plans


def test_component_that_holds_its_own_kind_refers_to_it(written):
    assert "#/$defs/algorithm" == written["$defs"]["Smooth"]["properties"]["inner"]["$ref"]


def test_every_reference_of_the_schema_resolves(written):
    references = json.dumps(written).split('"#/$defs/')[1:]

    for reference in {text.partition('"')[0] for text in references}:
        place = written["$defs"]
        for key in reference.split("/"):
            place = place[key]


def test_keys_that_types_inherit_are_described_once(written):
    properties = written["$defs"]["Tour"]["properties"]
    assert {"$ref": "#/$defs/Behavior/properties/when"} == properties["when"]
    assert "The hours" in written["$defs"]["Behavior"]["properties"]["when"]["description"]
    described = {(d.kind, d.type): d for d in describe_components()}

    for name in ("drift", "tour"):
        assert ("Behavior",) == described["behavior", name].shares
    assert {"when": "hours", "cooldown": "duration [s]", "preempts": "true | false"} == {
        f.name: f.type for f in described["shared", "Behavior"].fields
    }
    assert ("BodySettings", "Entity") == described["scenario", "Robot"].shares


def test_components_are_described_with_units_and_defaults():
    described = {(d.kind, d.type): d for d in describe_components()}
    plan = described["floorplan", "houseexpo"]
    tour = described["behavior", "tour"]

    def fields(of):
        return [f"{f.name}: {f.type} = {f.default}" for f in of.fields]

    assert "A plan in a file." == plan.summary
    assert ["path: path = None", "border: whole number = 4"] == fields(plan)
    assert ["cell: length [m] = 0.05"] == fields(described["shared", "Plan"])
    assert ["stops: list of text = []", "dwell: duration [s] = 1 min"] == fields(tour)
