"""Designs: which variants there are, what their scenarios are, and what errors name."""

import time

import pytest
from tests.studies.scenes import SPEED, base, small

from fleet2d.errors import ScenarioError
from fleet2d.studies.design import Design, build_design
from fleet2d.studies.specification import read_specification

RADIUS = "robots.astro.radius"


def design(**keys) -> Design:
    return build_design(read_specification(small(**keys)))


def labels(study_design: Design, *columns):
    return [tuple(study_design.parameters(i)[c] for c in columns) for i in range(len(study_design))]


def test_every_value_meets_every_other_and_every_seed():
    study_design = design(axes={SPEED: [0.3, 0.6], RADIUS: [0.1, 0.2]}, replicates=2)
    assert (8, (SPEED, RADIUS, "seed")) == (len(study_design), study_design.columns)
    assert [(0.3, 0.1, 0), (0.3, 0.1, 1), (0.3, 0.2, 0)] == labels(
        study_design, SPEED, RADIUS, "seed"
    )[:3]


def test_without_replicates_the_seed_is_that_of_the_base():
    study_design = build_design(read_specification({"base": base()}))
    assert ([(4,)], 1) == (labels(study_design, "seed"), len(study_design))


def test_tables_that_are_not_kept_are_not_made():
    artifacts = design().scenario(0).artifacts
    assert ("off", False, False) == (
        artifacts.trajectories, artifacts.observations, artifacts.key_frames,
    )  # fmt: skip
    kept_artifacts = design(keep={"tables": ["observations", "trajectories"]}).scenario(0).artifacts
    assert (60.0, True) == (
        kept_artifacts.trajectories.total_seconds(),
        kept_artifacts.observations,
    )


def test_an_axis_with_a_condition_applies_there_only():
    axes = {
        "robot": {"key": "robots.astro.order", "values": ["fixed", "random"]},
        "dwell": {"key": "robots.astro.dwell", "values": [60, 90], "when": {"robot": "random"}},
    }
    study_design = design(axes=axes, replicates=1)
    expected = [("fixed", None), ("random", 60), ("random", 90)]
    assert expected == labels(study_design, "robot", "dwell")


def test_rules_change_the_variants_that_they_name():
    rules = [{"when": {SPEED: [0.6]}, "set": {RADIUS: 0.11}}]
    study_design = design(rules=rules, replicates=1)
    assert [0.15, 0.11] == [study_design.scenario(i).robots["astro"].radius for i in range(2)]


def test_excluded_combinations_are_left_out():
    axes = {SPEED: [0.3, 0.6], RADIUS: [0.1, 0.2]}
    exclude = [{SPEED: 0.3, RADIUS: 0.2}, {RADIUS: 0.2, SPEED: [0.3]}]  # the same one twice
    study_design = design(axes=axes, replicates=1, exclude=exclude)
    assert [(0.3, 0.1), (0.6, 0.1), (0.6, 0.2)] == labels(study_design, SPEED, RADIUS)


def test_a_design_without_variants_is_refused():
    with pytest.raises(ScenarioError, match="has no variants"):
        design(exclude=[{SPEED: [0.3, 0.6]}])


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"exclude": [{SPEED: 0.5}]}, r"exclude.0.robots.astro.speed: no variant has 0.5"),
        ({"rules": [{"when": {"seed": 7}, "set": {RADIUS: 1}}]}, r"no variant has 7.*0, 1, 2"),
        ({"compare": [{"metric": "x", "against": {SPEED: 1}}]}, r"compare.0.against"),
    ],
)
def test_conditions_that_never_hold_are_refused(keys, message):
    with pytest.raises(ScenarioError, match=message):
        design(**keys)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"rules": [{"when": {"home": "b", "room": 0.1}, "set": {SPEED: 1}}]}, "rules.0.when"),
        ({"exclude": [{"home": "b", "room": [0.1, 0.2]}]}, r"exclude.0.*no variant has home = b"),
        (
            {
                "exclude": [{"home": "a", "room": 0.1}],
                "rules": [{"when": {"room": 0.1}, "set": {SPEED: 1}}],
            },
            r"rules.0.when: no variant has room = 0.1: change a value, or leave this out",
        ),
    ],
)
def test_conditions_on_values_that_never_occur_at_once_are_refused(keys, message):
    """A rule for a combination that `exclude` or `when` takes away set nothing, without a word."""
    axes = {
        "home": {"options": {"a": {SPEED: 0.3}, "b": {SPEED: 0.6}}},
        "room": {"key": RADIUS, "values": [0.1, 0.2], "when": {"home": "a"}},
    }
    with pytest.raises(ScenarioError, match=message):
        design(axes=axes, **keys)


def test_an_error_in_a_scenario_names_axis_and_value():
    study_design = design(axes={"pace": {"key": SPEED, "values": [0.3, "quick"]}})
    with pytest.raises(ScenarioError, match=r"variant 3 \(pace = quick, seed = 0\).*axis 'pace'"):
        study_design.scenario(3)


def test_an_error_in_a_study_file_names_its_line(tmp_path):
    file = tmp_path / "study.yaml"
    file.write_text("axes:\n  pace: {key: robots.astro.sped, values: [0.3]}\n")
    with pytest.raises(ScenarioError, match=r"axis 'pace', pace = 0.3, .*study.yaml:2.*'speed'"):
        build_design(read_specification(file)).scenario(0)


def test_a_study_that_is_too_large_is_refused_at_once_with_its_size():
    speeds = [round(0.1 + i / 10_000, 4) for i in range(2000)]
    radii = [round(0.1 + i / 100_000, 5) for i in range(2000)]
    start_s = time.process_time()
    with pytest.raises(
        ScenarioError, match=r"2,000 of .*speed × 2,000 of .*radius × 1,000 of seed = 4,000,000,000"
    ):
        design(axes={SPEED: speeds, RADIUS: radii}, replicates=1000)
    assert time.process_time() - start_s < 5
    # What applies nowhere, or is excluded, doesn't count.
    narrow = {SPEED: speeds, "radius": {"key": RADIUS, "values": radii, "when": {SPEED: 0.1}}}
    assert 100 * (2000 + 1999) == len(design(axes=narrow, replicates=100))
