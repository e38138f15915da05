"""Populations: lives drawn together and nested, weighted, with conditions that say what they leave
out."""

import json
from collections import Counter
from pathlib import Path

import pytest
from tests.scenes import flat_document
from tests.studies.scenes import CountingExecutor, run
from tests.studies.test_driver import CollectingObserver

from fleet2d.configuration.documents import Document
from fleet2d.errors import Fleet2DError, NoLayoutError, ScenarioError
from fleet2d.learning.datasets.specification import plan_dataset
from fleet2d.studies import population
from fleet2d.studies.design import Design, build_design
from fleet2d.studies.households import bedrooms_needed
from fleet2d.studies.lives import Draw, DrawSettings, HomeFeatures
from fleet2d.studies.population import PopulationAxis, find_lives
from fleet2d.studies.specification import read_specification

BASE = {"extends": "bundled:paper", "simulation": {"duration": "2 min"}}
SYNTHETIC = [{"synthetic": 100}]
COUPLE = {"members": {"ana": "retired", "ben": "retired"}, "couples": [["ana", "ben"]]}


def fleet(count=3, **keys):
    """A study of a fleet in small synthetic homes."""
    keys = {"homes": SYNTHETIC, "households": [["retired"], ["student", "student"]], **keys}
    return {"base": BASE, "axes": {"robot": {"population": count, **keys}}}


def design(**keys) -> Design:
    return build_design(read_specification(fleet(**keys)))


def draw(**keys) -> Draw:
    return Draw(DrawSettings(**{"homes": SYNTHETIC, **keys}), {}, 0, "population")


def table(folder: Path, text):
    path = folder / "census.csv"
    path.write_text(text)
    return str(path)


def test_a_life_is_drawn_once_for_its_scenario(monkeypatch):
    lives = design()
    drawn = []
    draw_life = Draw.life
    monkeypatch.setattr(Draw, "life", lambda self, n: drawn.append(n) or draw_life(self, n))

    lives.scenario(1)

    # Its labels and its changes are two sequences.
    assert len(drawn) <= 2


def test_each_life_has_its_home_its_people_and_its_seed_in_all_settings(tmp_path):
    study = fleet()
    study["axes"]["robots.astro.speed"] = [0.3, 0.6]
    _, found = run(study, tmp_path / "fleet")

    variants = found.variants
    assert [0, 0, 1, 1, 2, 2] == variants["robot"].to_list() == variants["seed"].to_list()
    assert 3 == variants["home"].n_unique()
    for row in variants.to_dicts():
        scenario = found.scenario(row["variant"])
        assert row["people"] == len(scenario["users"]) == len(row["household"].split(" + "))
        assert row["seed"] == scenario["simulation"]["seed"]
        assert row["bedrooms"] == scenario["floorplan"]["bedrooms"] >= row["people"]
    paired = found.paired("distance.astro", {"robots.astro.speed": 0.3})
    assert (3, 3) == paired.select("pairs", "n_robot").row(0)


def test_a_larger_population_begins_with_the_same_lives_and_runs_only_the_others(tmp_path):
    run(fleet(2), tmp_path / "fleet")
    executor = CountingExecutor()
    counts, _ = run(fleet(3), tmp_path / "fleet", executor)

    assert 3 == counts.complete
    assert 2 in executor.ran
    assert 0 not in executor.ran[-1:]


def test_replicates_of_lives_have_seeds_that_no_other_life_has():
    study = {**fleet(10), "replicates": 3}
    lives = build_design(read_specification(study))
    assert 30 == len({lives.parameters(i)["seed"] for i in range(len(lives))})


def test_rows_of_a_table_are_drawn_by_their_weights_with_all_their_columns(tmp_path):
    text = (
        "household,bedrooms,area_m2,region,robots.astro.speed,share\n"
        "retired,1,40..60,north,0.3,3\n"
        "student + child,3..4,,south,0.6,1\n"
    )
    weighted = draw(table=table(tmp_path, text), weight="share")

    lives = [weighted.life(k) for k in range(400)]
    counts = Counter(life.labels["region"] for life in lives)
    assert abs(counts["north"] - 300) < 4 * (400 * 0.75 * 0.25) ** 0.5
    for life in lives:
        changes = dict(life.changes)
        speed = changes["robots", "astro", "speed"]
        assert {"north": 0.3, "south": 0.6}[str(life.labels["region"])] == speed
        assert (speed == 0.3) == ("ben" not in changes[("users",)])
        plan = changes[("floorplan",)]
        assert plan["bedrooms"] in ((1,) if speed == 0.3 else (3, 4))
        assert (speed == 0.6) == ("area_m2" not in plan)
        assert 40 <= plan.get("area_m2", 50) <= 60


def test_lives_whose_homes_are_not_as_their_rows_say_are_left_out_and_counted(tmp_path):
    text = "household,region,rooms\nretired,town,..6\nstudent,country,7..\n"
    axis = PopulationAxis(population=4, homes=SYNTHETIC, table=table(tmp_path, text))

    lives = find_lives(axis, "robot", Document(BASE))
    for life in lives:
        assert (life.labels["region"] == "town") == (int(str(life.labels["rooms"])) <= 6)
    assert "as their rows say" in lives.words


@pytest.mark.parametrize(
    ("text", "keys", "words"),
    [
        ("home,weigt\n0,1\n", {"weight": "weight"}, "no column 'weight': did you mean 'weigt'"),
        ("home,weight\n0,1\n1,NaN\n", {}, "row 2: the weight is nan"),
        ("home,weight\n0,1\n1,\n", {}, "row 2: the weight is None"),
        ("home,weight\n0,-1\n", {}, "row 1: the weight is -1"),
        ("home,weight\n0,0\n1,0\n", {}, "weight of all rows is 0"),
        ("home,weight\n", {}, "has no rows"),
        ("home\n0\n777\n", {}, "row 2: there is no home '777'"),
    ],
)
def test_a_table_that_can_not_be_drawn_from_is_refused(tmp_path, text, keys, words):
    with pytest.raises(ScenarioError, match=words):
        draw(table=table(tmp_path, text), **keys)


def test_conditions_count_what_they_leave_out():
    lives = design(count=4, where={"people": 2, "rooms": "..9", "has": ["bathroom"]})

    assert {2} == {*lives.labels["people"]}
    assert {*lives.labels["rooms"]} <= {*range(10)}
    assert "people is not 2" in "".join(lives.notes)
    assert "rooms is not ..9" in "".join(lives.notes)


@pytest.mark.parametrize(
    ("where", "words"),
    [
        (
            {"rooms": "90..99"},
            "robot: of 20 lives that were drawn 0 meet the conditions.*20 .rooms is not 90..99",
        ),
        ({"has": "ballroom"}, "20 .no ballroom"),
        ({"rooms": "9..3"}, "range 9..3 is empty"),
        ({"rooms": "a..3"}, "expected a range like 3..15"),
        ({"romms": 3}, "no 'romms': did you mean 'rooms'"),
    ],
)
def test_conditions_that_leave_nothing_or_make_no_sense_are_told(where, words):
    with pytest.raises(Fleet2DError, match=words):
        design(count=1, where=where)


def test_all_homes_that_can_not_be_are_told_at_once_before_the_first_run():
    homes = [{"synthetic": 9, "settings": {"area_m2": 20, "bedrooms": 8}}]
    with pytest.raises(ScenarioError, match=r"life 0 .home = 0.: .* 4 more likewise: life 1"):
        design(count=5, homes=homes)


def test_a_mistake_beside_the_population_is_told_before_any_home_is_built():
    study = fleet(homes=[{"synthetic": 9, "settings": {"area_m2": 20, "bedrooms": 8}}])
    study["axes"]["robots.astro.sped"] = [1]
    with pytest.raises(ScenarioError, match="unknown key 'sped'"):
        build_design(read_specification(study))


@pytest.mark.parametrize(
    ("household", "needed"),
    [
        (["retired"], 1),
        (["student", "student"], 2),
        (["works_outside", "child", "child", "child"], 3),
        ({name: {"type": "routine", "household": COUPLE} for name in ("ana", "ben")}, 1),
    ],
)
def test_couples_and_pairs_of_children_share_bedrooms(household, needed):
    assert needed == bedrooms_needed(household)


def test_homes_of_files_are_chosen_among_those_that_fit_the_household(tmp_path):
    document = flat_document()
    for bedrooms in (1, 3):
        kinds = iter(["bedroom"] * bedrooms + ["kitchen"] * 9)
        rooms = [{**room, "type": next(kinds)} for room in document["rooms"]]
        path = tmp_path / f"flat{bedrooms}.json"
        path.write_text(json.dumps({**document, "rooms": rooms}))
    axis = PopulationAxis(
        population=12,
        homes=[{"floorplans": str(tmp_path)}],
        households=[["retired"], ["student", "student", "retired"]],
    )

    lives = find_lives(axis, "robot", Document({"floorplan": {"type": "bundled"}}))
    homes = {(choice.labels["people"], choice.labels["home"]) for choice in lives}
    assert {(1, "flat1"), (1, "flat3"), (3, "flat3")} == homes


def test_what_is_left_out_is_noted_and_stored(tmp_path):
    observer = CollectingObserver()
    _, study = run(fleet(1, where={"people": 2}), tmp_path / "fleet", observer=observer)
    assert "people is not 2" in study.meta.notes


def test_a_cell_longer_than_a_name_of_a_file_is_no_file(tmp_path):
    """Data sets looked whether cells of key paths name files, and ended in a traceback."""
    log = tmp_path / "log.csv"
    log.write_text("")
    census = table(tmp_path, f"users.ana.path,robots.astro.note\n{log},{'x' * 300}\n")

    assert [Path(census), log] == draw(table=census).files


def test_a_column_that_is_almost_another_one_is_noted(tmp_path):
    """A column `wieght` labelled lives, which all were drawn with equal chances."""
    census = table(tmp_path, "household,wieght,age,robots.astro.speed\nretired,1,70,0.3\n")
    _, study = run(fleet(1, households=[], table=census), tmp_path / "fleet")
    note = "census.csv: the column 'wieght' only labels lives: did you mean 'weight'?"
    assert note in study.meta.notes
    assert "age" not in study.meta.notes

    split = {"runs": 1, "homes": SYNTHETIC, "table": census}
    assert note in "\n".join(plan_dataset({"base": BASE, "splits": {"train": split}}).left_out)


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_a_table_may_have_the_separators_and_commas_of_a_spreadsheet(tmp_path, mark):
    lines = [("household", "robots.astro.speed", "weight"), ("retired", "0.3", "2")]
    text = "\r\n".join(mark.join(line) for line in lines)
    census = table(tmp_path, text if mark == "," else text.replace(".3", ",3"))
    drawn = draw(table=census)
    assert ("household", "robots.astro.speed") == drawn.table_columns
    assert (0.3,) == tuple(drawn.life(0).labels[name] for name in drawn.columns)


def test_lives_without_a_layout_are_left_out_and_counted_where_others_have_one(monkeypatch):
    """A fleet of 2,000 was refused, as for two of its homes no layout was found."""
    built = iter(range(100))

    def facts_of(*_) -> HomeFeatures:
        if next(built) in {0, 2}:
            raise NoLayoutError("no synthetic home was found")
        return HomeFeatures(7, 3, 120.0, frozenset({"bedroom"}))

    monkeypatch.setattr(population, "facts_of", facts_of)
    lives = find_lives(PopulationAxis(population=3, homes=SYNTHETIC), "robot", Document(BASE))
    assert [1, 3, 4] == lives.numbers.tolist()
    assert f"robot: 2 left out: 2 ({population.NO_LAYOUT})" == lives.words


def test_a_fleet_of_which_no_home_has_a_layout_is_refused_with_the_reason(monkeypatch):
    def facts_of(*_) -> HomeFeatures:
        raise NoLayoutError("no synthetic home was found: ask for more or less area")

    monkeypatch.setattr(population, "facts_of", facts_of)
    with pytest.raises(ScenarioError, match=r"ask for more or less area; 2 more likewise"):
        find_lives(PopulationAxis(population=3, homes=SYNTHETIC), "robot", Document(BASE))


def test_data_sets_draw_and_leave_out_as_studies_do(tmp_path):
    text = "household,weight\nretired,1\nstudent + student,1\n"
    split = {
        "runs": 4,
        "homes": SYNTHETIC,
        "table": table(tmp_path, text),
        "where": {"household": "student + student", "bedrooms": "2..", "area_m2": "..150"},
    }
    plan = plan_dataset({"base": BASE, "splits": {"train": split}})

    runs = list(plan.runs("train"))
    assert [4, 4] == [len(runs), len({run.seed for run in runs})]
    assert {"student + student"} == {run.labels["household"] for run in runs}
    assert {"ana", "ben"} == {*runs[0].scenario["users"]}
    (words,) = plan.left_out
    assert words.startswith("train: ")
    assert "household is not" in words
