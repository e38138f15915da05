"""Tests of the public names of interventions: they can be imported, and are documented and typed."""

import ast
from pathlib import Path

import pytest

import fleet2d
from fleet2d import interventions
from fleet2d.entities.plan import data_of
from fleet2d.errors import ScenarioError
from fleet2d.interventions import Decide, Put, Send, SwitchOff
from fleet2d.interventions.intervention import dump_intervention, verbs

PACKAGE = Path(fleet2d.__file__).parent
ROOT = Path(__file__).parents[2]
BUILT_IN = {cls.__name__: cls for cls in verbs().values() if cls.__module__.startswith("fleet2d.")}
STUB = ast.parse((PACKAGE / "interventions" / "__init__.pyi").read_text(encoding="utf-8"))


def test_stub_has_all_interventions():
    assert set(BUILT_IN) == {node.name for node in STUB.body if isinstance(node, ast.ClassDef)}


@pytest.mark.parametrize("name", BUILT_IN)
def test_stub_has_the_signature_of_each_constructor(name):
    assert getattr(interventions, name) is BUILT_IN[name]
    stub = next(n for n in STUB.body if isinstance(n, ast.ClassDef) and n.name == name)
    constructor = stub.body[0]
    assert isinstance(constructor, ast.FunctionDef)
    fields = BUILT_IN[name].model_fields

    assert ["self", *BUILT_IN[name].needed()] == [arg.arg for arg in constructor.args.args]
    assert constructor.args.defaults == []
    keywords = [key for key, field in fields.items() if not field.is_required()]
    assert keywords == [arg.arg for arg in constructor.args.kwonlyargs]


@pytest.mark.parametrize("name", BUILT_IN)
def test_each_intervention_is_documented_with_an_example(name):
    page = (ROOT / "docs/how-to/interventions.md").read_text(encoding="utf-8")

    assert f"`{name}`" in page
    assert f">>> {name}(" in (BUILT_IN[name].__doc__ or "")


def test_required_fields_are_positional_and_values_as_in_a_script():
    act = Send("ana", "kitchen", duration="20 min")

    assert dump_intervention(act) == {
        "do": "send",
        "entity": "ana",
        "to": "kitchen",
        "duration": "20 min",
    }


def test_object_and_mapping_are_recorded_alike():
    records = []
    for act in (Put("ana", "kitchen"), {"put": "ana", "to": "kitchen"}):
        simulation = fleet2d.Simulation("bundled:paper", "simulation.duration=1 h", seed=4)
        simulation.do(act)
        records.append(simulation.run().manifest["interventions"])

    assert records[0] == records[1]


def test_plan_for_a_body_that_decides_itself_is_left_out_with_a_note():
    simulation = fleet2d.Simulation("bundled:paper", "simulation.duration=1 h", seed=4)
    simulation.do(Decide("astro", data_of(simulation.plan("astro").go_to("kitchen"))))
    run = simulation.run()

    assert any("astro isn't driven" in note for note in run.manifest["notes"])


def test_simulation_has_few_public_names():
    assert len([name for name in dir(fleet2d.Simulation) if not name.startswith("_")]) <= 25


@pytest.mark.parametrize(
    ("values", "keys", "message"),
    [
        (("ana",), {}, r"Put\(\): to: "),
        (
            ("ana", "kitchen", 90),
            {},
            r"Put\(\): give entity and to once, and all others by keyword",
        ),
        (("ana", "kitchen"), {"to": "sofa"}, r"Put\(\): give entity and to once"),
        (("ana", "kitchen"), {"heading": 90}, r"Put\(\): .*heading.*heading_deg"),
        (("ana", 5), {}, r"Put\(\): to: expected a place, got 5"),
    ],
)
def test_wrong_arguments_are_one_clear_error(values, keys, message):
    with pytest.raises(ScenarioError, match=message):
        Put(*values, **keys)


def test_contradiction_between_fields_is_an_error_that_names_the_constructor():
    with pytest.raises(ScenarioError, match=r"SwitchOff\(\): .*'camera'.*'behavior'"):
        SwitchOff("astro")


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Teleport'"):
        interventions.Teleport  # type: ignore[attr-defined]  # noqa: B018
