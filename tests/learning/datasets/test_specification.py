"""What a data set is drawn from: fresh people, a seed for each run, and splits that share nothing."""

from pathlib import Path

import pytest

import fleet2d
from fleet2d.errors import InputError
from fleet2d.learning.datasets.specification import plan_dataset

BASE = {"extends": "bundled:paper", "simulation": {"duration": "2 h"}}


def split(runs, first, *households):
    homes = [{"synthetic": 2, "first": first}]
    return {"runs": runs, "homes": homes, "households": [list(h) for h in households]}


def file(**splits):
    return {"base": BASE, "splits": splits}


def test_every_run_has_its_own_seed_and_home_in_turn():
    source = file(train=split(5, 0, ["retired"]), test=split(3, 50, ["student", "child"]))
    plan = plan_dataset(source)

    runs = [*plan.runs("train"), *plan.runs("test")]
    assert [*range(8)] == [run.number for run in runs]
    assert 8 == len({run.seed for run in runs})
    assert ["0", "1", "0", "1", "0", "50", "51", "50"] == [run.labels["home"] for run in runs]
    assert ["ana", "ben"] == list(runs[-1].scenario["users"])
    assert plan.digest == plan_dataset(source).digest
    assert not {run.seed for run in plan_dataset({**source, "seed": 1}).runs("train")} & {
        run.seed for run in runs
    }


def test_a_file_that_changes_makes_another_data_set(tmp_path):
    """The runs of a table, a persona or a floor plan that changed since were mixed with earlier ones."""
    persona = tmp_path / "mine.yaml"
    persona.write_text(
        retired := (Path(fleet2d.__file__).parent / "routines/personas/retired.yaml").read_text()
    )
    table = tmp_path / "census.csv"
    table.write_text(f"household,robots.astro.speed\n{persona},0.3\nretired,0.6\n")
    source = file(train={"runs": 2, "homes": [{"synthetic": 2}], "table": str(table)})

    digests = [plan_dataset(source).digest]
    assert digests == [plan_dataset(source).digest]
    persona.write_text(retired.replace("pace: 0.75", "pace: 0.7"))
    digests.append(plan_dataset(source).digest)
    table.write_text(table.read_text().replace("0.6", "0.5"))
    digests.append(plan_dataset(source).digest)
    assert 3 == len({*digests})


@pytest.mark.parametrize(
    ("test", "words"),
    [
        (split(1, 1, ["child"]), r"train and test share 1 home\(s\): home = 1"),
        (split(1, 9, ["student", "retired"]), r"share 1 persona\(s\): retired"),
        (split(1, 9, [{"extends": "retired", "pace": 0.8}]), r"share 1 persona\(s\): retired"),
        (split(1, 9, ["mine.yaml"]), r"share 1 persona\(s\): retired"),
    ],
)
def test_splits_that_overlap_name_what_they_share(test, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text("extends: [retired]\n")
    with pytest.raises(InputError, match=words):
        plan_dataset(file(train=split(1, 0, ["retired"]), test=test))


@pytest.mark.parametrize("name", ["../train", "", "a b", "unfinished", "pictures"])
def test_a_split_is_named_as_its_folder_may_be(name):
    with pytest.raises(InputError, match="can't be the name of a split"):
        plan_dataset(file(**{name: split(1, 0, ["retired"])}))


def test_axes_vary_each_run():
    robot = {"options": {"slow": {"robots.astro.speed": 0.3}, "fast": {"robots.astro.speed": 0.8}}}

    plan = plan_dataset({**file(train=split(20, 0, ["retired"])), "vary": {"robot": robot}})

    drawn = {
        run.labels["robot"]: run.scenario["robots"]["astro"]["speed"] for run in plan.runs("train")
    }
    assert {"slow": 0.3, "fast": 0.8} == drawn


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"splitz": {}}, "splits"),
        ({"splits": {}}, "splits"),
        ({"base": "bundled:papr"}, "base"),
        ({"splits": {"train": split(1, 0, ["retird"])}}, "retired"),
        ({"splits": {"train": split(1, 0, ["retired"] * 9)}}, "household of 9"),
        ({"beliefs": ["routin"]}, "routine"),
        (
            {"splits": {"train": split(1, 0, ["retired"], ["child", "retird"])}},
            r"train, households: child \+ retird: .*did you mean 'retired'|no persona 'retird'",
        ),
        (
            {
                "vary": {
                    "robot": {
                        "options": {
                            "one": {"robots.astro.speed": 1},
                            "two": {"robots.astro.sped": 1},
                        }
                    }
                }
            },
            "vary.robot: robot = two: .*unknown key 'sped'",
        ),
        ({"vary": {"robot": {"options": {"none": {"robots.astra.speed": 1}}}}}, "astra"),
    ],
)
def test_mistakes_are_named_before_the_first_run(change, words):
    with pytest.raises(InputError, match=words):
        plan_dataset({**file(train=split(1, 0, ["retired"])), **change})


def test_a_million_runs_are_planned_without_being_drawn():
    plan = plan_dataset(file(train=split(1_000_000, 0, ["retired"])))

    assert 62_500 == sum(1 for _ in plan.shards())
    assert 999_999 == plan.run("train", 999_999).number
