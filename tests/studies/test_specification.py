"""Study files: what is read from them, and how wrong ones are refused, with file and line."""

from pathlib import Path

import pytest
from tests.studies.scenes import SPEED, base

from fleet2d.errors import ScenarioError
from fleet2d.scenario.load import load_scenario
from fleet2d.studies.specification import Specification, read_specification


def read_text(text, folder: Path) -> Specification:
    file = folder / "study.yaml"
    file.write_text(text)
    return read_specification(file)


def test_a_file_is_called_by_its_name(tmp_path):
    assert "study" == read_text("replicates: 2\n", tmp_path).name
    assert "speeds" == read_text("name: speeds\n", tmp_path).name


def test_a_base_is_found_beside_the_study(tmp_path, monkeypatch):
    (tmp_path / "home.yaml").write_text("extends: bundled:paper\nsimulation: {duration: 3 h}\n")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert "3 h" == read_text("base: home.yaml\n", tmp_path).base.data["simulation"]["duration"]
    inline = "base: {extends: home.yaml, simulation: {step: 2 s}}\n"
    simulation = read_text(inline, tmp_path).base.data["simulation"]
    assert ("3 h", "2 s") == (simulation["duration"], simulation["step"])


def test_a_base_can_be_a_scenario_in_python():
    scenario = load_scenario(base())
    specification = load_scenario(read_specification({"base": scenario}).base.data)
    assert scenario.resolved() == specification.resolved()


def test_a_bare_list_is_an_axis_called_by_its_key(tmp_path):
    specification = read_text(f"axes: {{{SPEED}: [0.3, 0.6]}}\n", tmp_path)
    assert [SPEED] == list(specification.file.axes)


def test_populations_are_homes_people_and_seeds(tmp_path):
    text = "axes:\n  home: {synthetic: 3}\n  speed: {key: robots.astro.speed, values: [1]}\n"
    assert ("home", "seed") == read_text(text, tmp_path).file.populations


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("axis: {}\n", r"study.yaml:1: axis: unknown key 'axis': did you mean 'axes'"),
        ("\naxes:\n  speed: [1, 2]\n", r"study.yaml:3: axes.speed: a bare list is for an axis"),
        ("axes:\n  speed: {key: a.b, valeus: [1]}\n", r"axes.speed: .*did you mean 'values'"),
        ("axes:\n  seed: {key: a.b, values: [1]}\n", r"an axis can't be called 'seed'"),
        ("replicates: 0\n", r"study.yaml:1: replicates: expected 1 or more replicates, got 0"),
        ("base: hme.yaml\n", r"study.yaml:1: base: there is no file"),
        ("base: 3\n", r"base: expected the file of a scenario"),
        (
            "axes: {a: {key: a.b, values: [1]}}\nexclude: [{b: 1}]\n",
            r"exclude.0.b: there is no axis 'b'",
        ),
        ("rules: [{when: {b: 1}, set: {a.b: 1}}]\n", r"rules.0.when.b: there is no axis 'b'"),
        (
            "tune:\n  search: {s: {key: a.b, low: 0, high: 1}}\n  objective: {m: minimize}\n"
            "  held_out: {hme: [1]}\n",
            r"study.yaml:4: tune.held_out.hme: there is no axis 'hme'",
        ),
        (
            "axes: {a: {key: b.c, values: [1]}}\ncompare: [{metric: x, against: {a: 1}, by: [a]}]\n",
            r"study.yaml:2: compare.0: a is what is compared: leave it out of by",
        ),
        ("compare: [{metric: x, against: {a: 1}}]\n", r"compare.0.against.a: there is no axis"),
        ("axes: {a: {key: a.b, values: [1], when: {b: 1}}}\n", r"no axis 'b'. The axes before it"),
    ],
)
def test_wrong_files_are_refused_with_their_line(tmp_path, text, message):
    with pytest.raises(ScenarioError, match=message):
        read_text(text, tmp_path)


@pytest.mark.parametrize(
    ("study", "message"),
    [
        ({"replicates": 10**400}, "replicates: more than 1,000,000 values"),
        ({"axes": {"home": {"synthetic": 10**9}}}, "FLEET2D_MAX_VARIANTS"),
    ],
)  # fmt: skip
def test_axes_of_more_values_than_fit_into_memory_are_refused(study, message):
    with pytest.raises(ScenarioError, match=message):
        read_specification(study)
