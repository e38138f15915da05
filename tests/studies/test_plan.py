"""Plans: all variants built and checked, with identities that change with what matters only."""

import tomllib
from pathlib import Path

import pytest
from tests.studies.scenes import SPEED, base, run, small

import fleet2d.studies.plan as plans
from fleet2d.errors import ScenarioError
from fleet2d.scenario.load import load_scenario
from fleet2d.studies.design import _LEAVES, build_design, input_hash
from fleet2d.studies.driver import Observer, check_study
from fleet2d.studies.executors import Crew, SerialExecutor
from fleet2d.studies.plan import (
    StudyPlan,
    check_setups,
    make_plan,
    setups_to_check,
)
from fleet2d.studies.specification import read_specification

ROOT = Path(__file__).parents[2]
ATTIC = {"key": "users.ana.start", "values": ["kitchen", "attic", "kitchn"]}


def plan(**keys) -> StudyPlan:
    specification = read_specification(small(**keys))
    return make_plan(build_design(specification))


def identities(**keys):
    return plan(**keys).variants["identity"].to_list()


def test_identities_are_the_same_at_each_call_and_differ_among_variants():
    assert identities() == identities()
    assert 6 == len(set(identities()))


def test_identities_stay_when_other_values_come():
    assert set(identities()) < set(identities(axes={SPEED: [0.1, 0.3, 0.6]}, replicates=5))


@pytest.mark.parametrize("change", [{"max_span": 60}, {"speedup": 1000}])
def test_what_changes_no_result_changes_no_identity(change):
    assert identities() == identities(base=base(simulation=change))


def test_what_changes_results_changes_identities():
    assert not set(identities()) & set(identities(base=base("3 min")))


def test_another_order_of_robots_is_another_scenario():
    robots = {name: {"type": "patrol", "camera": {"range": [0, 4]}} for name in ("astro", "bolt")}
    other = dict(reversed(robots.items()))

    assert not set(identities(base=base(robots=robots))) & set(identities(base=base(robots=other)))


def test_a_module_of_ones_own_is_part_of_the_identity(tmp_path):
    module = tmp_path / "mine.py"
    text = "from fleet2d import Algorithm\nclass Nothing(Algorithm):\n    pass\n"
    module.write_text(text)
    scenario = load_scenario(
        base(algorithms={"own": {"type": f"{tmp_path.as_posix()}/mine:Nothing"}})
    )
    first_hash = input_hash(scenario)
    module.write_text(text + "# another\n")
    assert first_hash != input_hash(scenario)


def test_only_packages_that_run_or_show_simulations_are_no_part_of_that_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = project["tool"]["importlinter"]["contracts"][0]["layers"]
    above_the_engine = " | ".join(layers[: layers.index("engine")]).split(" | ")
    # The limb `homes` reads and makes the homes in which runs take place.
    assert sorted({*above_the_engine} - {"homes"}) == sorted(_LEAVES)


def test_all_wrong_variants_are_told_at_once_without_repetition():
    axes = {"pace": {"key": SPEED, "values": [0.3, "quick", -1]}}
    with pytest.raises(ScenarioError) as caught:
        plan(axes=axes)
    lines = str(caught.value).splitlines()
    assert 2 == len(lines)
    assert "pace = quick" in lines[0]
    assert "pace = -1" in lines[1]


def test_who_can_not_stand_in_a_home_is_found_before_the_first_run():
    with pytest.raises(ScenarioError, match=r"variant 3 \(start = attic"):
        check_setups(plan(axes={"start": ATTIC}), Crew(SerialExecutor()))


def test_each_home_meets_each_choice_in_as_few_set_ups_as_that_takes():
    axes = {
        "home": {"synthetic": 2},
        SPEED: [0.1, 0.2, 0.3, 0.4],
        "robots.astro.radius": [0.1, 0.12, 0.14, 0.16],
    }
    study_plan = plan(axes=axes, replicates=2)
    indices = study_plan.variants[setups_to_check(study_plan)]["index"]
    setups = [study_plan.design.parameters(index) for index in indices]
    assert 8 == len(setups)  # of 32 combinations
    for column in (SPEED, "robots.astro.radius"):
        assert 8 == len({(row["home"], row[column]) for row in setups})


def test_of_a_fleet_the_first_homes_are_set_up_before_its_first_run(monkeypatch):
    monkeypatch.setattr(plans, "FLEET_HOMES", 2)
    lives = {"population": 4, "homes": [{"synthetic": 40}]}
    study_plan = plan(axes={"robot": lives, SPEED: [0.1, 0.2]}, replicates=1)
    assert 4 == study_plan.variants["home_key"].n_unique()

    checked = study_plan.variants[setups_to_check(study_plan)]

    assert 4 == len(checked)  # each of two homes with each speed
    assert 2 == checked["home_key"].n_unique()


@pytest.mark.parametrize("table", ["observations", "explored.astro"])
def test_tables_that_variants_have_can_be_kept(table):
    assert check_study(small(keep={"tables": [table]}))


# --- Names ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"keep": {"metrics": ["sigthings.*"]}}, r"keep.metrics.*'sigthings': did you mean 'sight"),
        ({"keep": {"metrics": ["sightings"]}}, r"is not a number: write sightings\.\*"),
        ({"keep": {"metrics": ["sightings.anna"]}}, "'anna', which no variant has.*'ana'"),
        ({"keep": {"metrics": ["sigthin*"]}}, "no variant has a metric 'sigthin'"),
        (
            {"compare": [{"metric": "sightigns.ana", "against": {SPEED: 0.3}}]},
            "compare.0.metric: no variant has a metric 'sightigns': did you mean 'sightings'",
        ),
        (
            {
                "compare": [{"metric": "sightings.ana", "against": {SPEED: 0.3}}],
                "keep": {"metrics": ["distance.*"]},
            },
            "'sightings.ana' isn't kept",
        ),
        ({"keep": {"tables": ["rooms_share"]}}, "keep.tables.*did you mean 'room_share'"),
    ],
)
def test_what_no_variant_has_is_refused_before_the_first_run(keys, message):
    """`keep: {metrics: [sigthings.*]}` kept nothing, and the study ended without a word."""
    with pytest.raises(ScenarioError, match=message):
        check_study(small(**keys))


@pytest.mark.parametrize(
    ("keys", "place"),
    [
        ("keep:\n  metrics:\n    - distance.*\n    - sigthings.*\n", r"4: keep\.metrics\.1: no"),
        ("keep:\n  tables: [lpt]\n", r"2: keep\.tables\.0: no"),
        ("compare:\n- metric: sigthings.ana\n  against: {seed: 4}\n", r"2: compare\.0\.metric: no"),
    ],
)
def test_a_name_that_no_variant_has_is_told_with_its_line(tmp_path, keys, place):
    (tmp_path / "study.yaml").write_text(keys)
    with pytest.raises(ScenarioError, match=rf"study\.yaml:{place} variant has"):
        check_study(tmp_path / "study.yaml")


@pytest.mark.parametrize("pattern", ["*", "*.ana", "[sd]*.ana"])
def test_patterns_that_fit_are_kept(pattern):
    assert check_study(small(keep={"metrics": [pattern]})) is not None


@pytest.mark.parametrize(
    "axis",
    [
        {"key": "simulation.seed", "values": [1, 2]},
        {"options": {"one": {"simulation.seed": 1}, "two": {}}},
        {"key": "simulation", "values": [{"seed": 1}, {}]},
    ],
)
def test_a_seed_of_an_axis_is_refused_as_replicates_would_replace_it(axis):
    with pytest.raises(ScenarioError, match=r"simulation.seed.*replicates: \[1\]"):
        check_study(small(axes={"life": axis}))


def test_a_seed_of_a_rule_is_refused():
    with pytest.raises(ScenarioError, match=r"rules\.0: sets simulation\.seed"):
        check_study(small(rules=[{"set": {"simulation.seed": 3}}]))


def test_variants_without_a_metric_are_noted(tmp_path):
    notes = []

    class Notes(Observer):
        def on_note(self, text):
            notes.append(text)

    rules = [{"when": {SPEED: 0.6}, "set": {"metrics.sightings": None}}]
    keep = {"metrics": ["sightings.*", "distance.*", "room_share.ana.kitchen_1"]}
    compare = [{"metric": "distance.astroo", "against": {SPEED: 0.3}}]
    with pytest.raises(ScenarioError, match="'astroo', which no variant has"):
        check_study(small(rules=rules, keep=keep, compare=compare))
    run(small(rules=rules, keep=keep), tmp_path, observer=Notes())
    assert "3 of 6 complete variants have no metric sightings.*" in notes
    assert not any("distance" in note for note in notes)


def test_equal_seeds_and_variants_with_the_same_scenario_are_refused():
    with pytest.raises(ScenarioError, match=r"variant 0 .* and variant 2 .* are the same scenario"):
        plan(replicates=[7, 8, 7])
    axes = {SPEED: [0.3], "again": {"key": SPEED, "values": [0.4, 0.5], "when": {}}}
    with pytest.raises(ScenarioError, match="are the same scenario"):
        plan(axes=axes, rules=[{"set": {SPEED: 0.2}}])
