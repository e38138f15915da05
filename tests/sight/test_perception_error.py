"""Errors of perception in a scenario: their names, types and keys, and whose they may be."""

from importlib.metadata import EntryPoint, EntryPoints

import jsonschema
import pytest
from tests.own_errors import Missed
from tests.scenes import OWN, scenario

import fleet2d
from fleet2d.configuration import components
from fleet2d.scenario.schema import schema
from fleet2d.sight.built_in_errors import Outliers

ERRORS = OWN.replace("own_components", "own_errors")


def content(errors, **robot):
    """Return a scenario with a robot that has these errors."""
    return scenario(robots={"astro": {"perception": {"errors": errors}, **robot}})


def errors_of(*arguments):
    """Return the errors of the robot in a loaded scenario."""
    perception = fleet2d.load_scenario(*arguments).robots["astro"].perception
    assert perception is not None
    return dict(perception.errors)


def test_an_error_is_of_the_type_of_its_name_unless_it_says_so():
    given = {"outliers": {"share": "5 %"}, "far": {"type": "outliers"}, "bare": "outliers"}
    errors = errors_of(content(given))
    assert {"outliers": Outliers(share=0.05), "far": Outliers(), "bare": Outliers()} == errors


def test_an_override_changes_a_key_adds_an_error_and_changes_a_type():
    given = content({"outliers": {"share": 0.05, "spread": 2.0}})
    path = "robots.astro.perception.errors"
    assert {"outliers": Outliers(share=0.5, spread=2.0)} == errors_of(
        given, f"{path}.outliers.share=0.5"
    )
    assert {"outliers", "miscalibration"} == errors_of(
        given, f"{path}.miscalibration.scale=2"
    ).keys()
    changed = errors_of(given, f"{path}.outliers.type=miscalibration")
    assert "miscalibration" == changed["outliers"].type_name


def test_a_scenario_is_read_back_as_it_was():
    missed = {"type": f"{ERRORS}:Missed", "person": "ana"}
    loaded = fleet2d.load_scenario(content({"outliers": {"lasts": "5 s"}, "missed": missed}))
    again = fleet2d.load_scenario(loaded.resolved())
    assert loaded.robots == again.robots
    assert "ana" == errors_of(again)["missed"].person


@pytest.mark.parametrize(
    ("errors", "message"),
    [
        ({"outlier": {}}, "errors.outlier: there is no perception error 'outlier': did you mean"),
        ({"outliers": {"shrae": 1}}, "outliers.shrae: unknown key 'shrae': did you mean 'share'"),
        ({"outliers": {"share": 2}}, "errors.outliers.share: "),
        ({"9": "outliers"}, "the name '9' must be letters, digits"),
        ({"a": {"type": f"{OWN}:Greet"}}, "is not a perception_error"),
        ({"a": 3}, "expected a mapping with 'type', or the name of a type, got 3"),
    ],
)
def test_what_is_wrong_is_named(errors, message):
    with pytest.raises(fleet2d.InputError, match=message.replace("(", r"\(")):
        fleet2d.load_scenario(content(errors))


def test_a_plugin_is_found_by_the_name_of_its_entry_point(monkeypatch):
    entry = EntryPoint("missing", "tests.own_errors:Missed", "fleet2d.perception_error")
    kinds = {"perception_error": [entry]}
    monkeypatch.setattr(components, "_plugins", lambda kind: EntryPoints(kinds.get(kind, [])))
    monkeypatch.setattr(Missed, "type_name", Missed.type_name)
    assert {"missing": Missed(person="ana")} == errors_of(content({"missing": {"person": "ana"}}))
    assert "missing" in components.components("perception_error")


def test_the_schema_knows_errors_with_and_without_a_type():
    whole = schema()
    validator = jsonschema.validators.validator_for(whole)(whole)
    good = {"outliers": {"share": 0.1}, "a": {"type": "miscalibration", "yaw_deg": 2}}
    assert [] == list(validator.iter_errors(content(good)))
    assert list(validator.iter_errors(content({"a": {"type": "miscalibration", "yawn": 2}})))
    assert list(validator.iter_errors(content({"a": 3})))
