"""Axes: what they offer, how it is labelled, and how they refuse."""

import json

import pytest
from pydantic import TypeAdapter, ValidationError
from tests.scenes import flat_document

from fleet2d.errors import ScenarioError
from fleet2d.studies.axes import KINDS, AnyAxis, Axis, Parameter

SPEED = "robots.astro.speed"


def axis(**keys) -> Axis:
    return TypeAdapter(AnyAxis).validate_python(keys)


def labels(x_axis: Axis, name="x"):
    return [tuple(choice.labels.values()) for choice in x_axis.choices(name)]


def values(x_axis: Axis, name="x"):
    return [choice.changes[0][1] for choice in x_axis.choices(name)]


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ([0.3, "fast"], [(0.3,), ("fast",)]),
        ([{"type": "patrol"}, {"type": "find", "user": "ana"}], [("patrol",), ("find",)]),
        ([[{"type": "patrol"}], [{"type": "find"}]], [("1",), ("2",)]),  # all the same otherwise
    ],
)
def test_values_are_called_by_themselves_their_type_or_their_number(written, shown):
    assert shown == labels(axis(key=SPEED, values=written))


def test_a_value_can_be_set_for_several_keys():
    (choice,) = axis(key=[SPEED, "robots.bolt.speed"], values=[0.3]).choices("speed")
    assert [("robots", "astro", "speed"), ("robots", "bolt", "speed")] == [
        keys for keys, _ in choice.changes
    ]


def test_two_values_of_one_label_are_refused():
    with pytest.raises(ValidationError, match="two values have the label 'slow'"):
        axis(key=SPEED, values=[0.2, 0.3, 0.4], labels=["fast", "slow", "slow"])


def test_options_change_several_keys_each():
    x_axis = axis(options={"slow": {SPEED: 0.2}, "fast": {SPEED: 0.9, "robots.astro.radius": 0.1}})
    assert [("slow",), ("fast",)] == labels(x_axis)
    assert [1, 2] == [len(choice.changes) for choice in x_axis.choices("x")]


def test_floor_plans_of_a_folder_are_called_by_their_files(tmp_path):
    for name in ("b", "a"):
        (tmp_path / f"{name}.json").write_text(json.dumps(flat_document()))
    for hidden in ("notes.txt", "._a.json"):
        (tmp_path / hidden).write_text("not a plan")
    x_axis = axis(floorplans=str(tmp_path), settings={"furnish": True})
    assert [("a",), ("b",)] == labels(x_axis)
    section = values(x_axis)[0]
    assert ("native", str(tmp_path / "a.json"), True) == tuple(
        section[k] for k in ("type", "path", "furnish")
    )
    assert [("b",)] == labels(axis(floorplans=str(tmp_path / "b*.json")))


def test_a_folder_without_floor_plans_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match="no floor plan matches"):
        axis(floorplans=str(tmp_path)).choices("home")


def test_all_personas_are_those_that_come_with_fleet2d():
    axis_labels = labels(axis(personas="all", user="ana"))
    assert ("retired",) in axis_labels
    assert 7 == len(axis_labels)


@pytest.mark.parametrize("method", ["latin_hypercube", "sobol"])
def test_samples_are_the_same_at_each_call_and_within_range(method):
    parameters = {
        "speed": {"key": SPEED, "low": 0.2, "high": 1.0},
        "dwell": {"key": "robots.astro.dwell", "low": 1, "high": 60, "log": True, "unit": "min"},
        "order": {"key": "robots.astro.order", "choices": ["fixed", "random"]},
    }
    x_axis = axis(sample=parameters, count=8, method=method, seed=3)
    assert ("speed", "dwell", "order") == x_axis.columns("x")
    axis_labels = labels(x_axis)
    assert axis_labels == labels(x_axis)
    assert all(0.2 <= speed <= 1.0 and 1 <= dwell <= 60 for speed, dwell, _ in axis_labels)
    assert {"fixed", "random"} == {order for *_, order in axis_labels}
    assert x_axis.choices("x")[0].changes[1][1].endswith(" min")


def points(method, count, dimensions=2) -> list[tuple[int, ...]]:
    """Return samples of parameters from 0 to 1000, as whole numbers."""
    parameters = {
        f"p{i}": {"key": f"robots.astro.p{i}", "low": 0, "high": 1000} for i in range(dimensions)
    }
    return [
        tuple(map(int, sample))
        for sample in labels(axis(sample=parameters, count=count, method=method))
    ]


def test_sobol_points_have_one_in_each_cell_of_a_grid():
    cells = {(x // 125, y // 125) for x, y in points("sobol", 64)}
    assert 64 == len(cells)


def test_sobol_points_of_another_number_than_a_power_of_two_are_refused():
    with pytest.raises(ScenarioError, match="count 64, not 50"):
        points("sobol", 50)


def test_whole_numbers_reach_both_ends():
    parameter = Parameter(key="a.b", low=1, high=3, integer=True)
    assert [1, 2, 3, 3] == [parameter.at(share) for share in (0.0, 0.5, 0.9, 1.0)]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"key": SPEED}, "exactly one of values"),
        ({"key": SPEED, "vals": [1]}, "did you mean 'values'"),
        ({"key": SPEED, "values": [1], "synthetic": 2}, "got values and synthetic"),
        ({"key": SPEED, "values": []}, "at least 1"),
        ({"key": SPEED, "values": [1], "labels": ["a", "b"]}, "2 labels for 1 values"),
        ({"sample": {"a": {"key": SPEED, "low": 2, "high": 1}}, "count": 3}, "low below high"),
        ({"sample": {"a": {"key": SPEED, "low": 2, "choices": [3]}}, "count": 3}, "not both"),
        ({"sample": {"a": {"key": SPEED, "high": 2, "choices": [3]}}, "count": 3}, "not both"),
        (
            {"sample": {"a": {"key": SPEED, "low": 0, "high": 1, "log": True}}, "count": 3},
            "above 0",
        ),
    ],
)
def test_wrong_axes_are_refused(keys, message):
    with pytest.raises(ValidationError, match=message):
        axis(**keys)


def test_every_kind_is_known_by_a_key_of_its_own():
    assert all(kind in cls.model_fields for kind, cls in KINDS.items())
