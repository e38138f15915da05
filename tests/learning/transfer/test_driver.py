"""A whole experiment: resumable cell by cell, the same for any number of workers, and told in the end."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from tests.learning.transfer.homes import write_home

from fleet2d.errors import RunDirectoryError, ScenarioError
from fleet2d.learning.datasets import generate
from fleet2d.learning.transfer import driver, learners, sources
from fleet2d.learning.transfer.driver import COLUMNS, run_transfer
from fleet2d.learning.transfer.report import compared
from fleet2d.learning.transfer.specification import read_plan
from fleet2d.studies import results
from fleet2d.studies.api import open_crew
from fleet2d.studies.reader import Study, open_study

pytestmark = pytest.mark.slow
SETTINGS = {
    "days": [0, 3],
    "tasks": ["room in 60 min", "activity"],
    "arms": ["real", "own", "both", "fitted", "markov"],
    "learners": ["usual"],
    "personas": ["retired"],
    "plans": [{"synthetic": 1, "settings": {"furnish": True}}],
    "lived_days": 2,
    "rows": 300,
}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    pytest.importorskip("sklearn", reason="needs the extra transfer")
    folder = tmp_path_factory.mktemp("transfer")
    homes = {
        name: {"path": str(write_home(folder / f"{name}.txt", 8, shift_min=shift))}
        for name, shift in (("one", 0), ("two", 5))
    }
    (folder / "homes.yaml").write_text(yaml.safe_dump({**SETTINGS, "homes": homes}))
    return folder / "homes.yaml"


@pytest.fixture(scope="module")
def made(file):
    with open_crew("serial") as crew:
        counts = run_transfer(read_plan(file), file.parent / "made", crew)
    assert (counts.total, counts.complete) == (28, 28)
    return open_study(file.parent / "made")


def scores(study: Study):
    frame = study.variants.filter(task="activity").sort(COLUMNS)
    return frame.select(*COLUMNS, "log_loss", "accuracy", "cases").rows()


class Killed(BaseException):
    """As a signal would end the process."""


def test_a_kill_loses_only_the_cell_under_way_and_results_are_the_same(
    file, made, tmp_path, monkeypatch
):
    one = file.with_name("one.yaml")
    one.write_text(file.read_text().replace("- room in 60 min\n", ""))
    trained = []
    score = learners.forecast

    def dies_at_the_fourth(*arguments):
        trained.append(arguments)
        if len(trained) == 4:
            raise Killed
        return score(*arguments)

    monkeypatch.setattr(driver, "forecast", dies_at_the_fourth)
    monkeypatch.setattr(results, "FLUSH_EVERY_S", 0.0)  # else a kill loses the last second
    with open_crew("serial") as several:
        crew = replace(several, batch_s=0.0)  # else it may lose what a worker did within seconds
        with pytest.raises(Killed):
            run_transfer(read_plan(one), tmp_path / "out", crew)
        counts = run_transfer(read_plan(one), tmp_path / "out", crew)
    assert 14 == counts.complete
    assert len(trained) == 4 + 14 - 3
    assert scores(made) == scores(open_study(tmp_path / "out"))


def test_results_of_other_settings_are_refused_until_they_may_go(file, made, monkeypatch):
    other = file.with_name("other.yaml")
    other.write_text(file.read_text().replace("rows: 300", "rows: 301"))
    with open_crew("serial") as crew, pytest.raises(RunDirectoryError, match="--changed redo"):
        run_transfer(read_plan(other), Path(made.location), crew)


def test_differences_are_paired_by_home_and_by_day(made):
    rows = compared(made, "room in 60 min", "real").filter(arm="both", days=3).to_dicts()
    (row,) = rows
    assert 2 == row["pairs"]
    own = made.variants.filter(task="room in 60 min", days=3)
    means = {arm: own.filter(arm=arm)["log_loss"].mean() for arm in ("both", "real")}
    assert row["difference"] == pytest.approx(means["both"] - means["real"])
    days = made.polars("days").filter().collect()
    assert {3, 4, 5, 6, 7} == {*days.filter(home="one")["day"].to_list()}


def test_the_command_prints_sentences_and_writes_a_table_and_a_figure_for_each_task(
    file, made, fleet2d
):
    code, out, err = fleet2d("transfer", file, "--out", made.location)
    assert (0, "") == (code, err)
    *sentences, last = out.splitlines()
    assert 2 <= len(sentences) <= 4
    assert last.startswith("28 of 28 cells, 0 left out")
    page = (Path(made.location) / "report.md").read_text()
    for picture in ("room_in_60_min.png", "activity.png"):
        assert f"]({picture})" in page
        assert (Path(made.location) / picture).stat().st_size > 10_000
    assert page.count("| usual | 3 | fitted | 2 |") == 2


@pytest.fixture
def examples(tmp_path, shared_data):
    """The examples beside the logs that they name."""
    folder = shutil.copytree(
        Path(__file__).parents[3] / "examples" / "transfer", tmp_path / "examples"
    )
    shutil.copytree(shared_data / "activity", folder / "logs")
    return folder


@pytest.mark.parametrize("name", ["real_homes", "presence"])
def test_an_example_can_be_trained_and_scored(examples, fleet2d, name):
    code, out, err = fleet2d("transfer", examples / f"{name}.yaml", "--dry-run")
    assert 0 == code, err
    assert int(out.split()[0]) > 50


def test_people_who_fit_into_no_home_are_left_out_with_their_cells(
    file, tmp_path, monkeypatch, fleet2d
):
    check = generate.check_dataset

    def finds_no_room(content, *arguments, **keys):
        if content["name"] == "simulated":
            raise ScenarioError("no home has a room for them")
        check(content, *arguments, **keys)

    monkeypatch.setattr(sources, "check_dataset", finds_no_room)
    settings = {**yaml.safe_load(file.read_text()), "tasks": ["room in 60 min"], "days": [0]}
    settings["arms"] = ["real", "both"]
    odd = tmp_path / "odd.yaml"
    odd.write_text(yaml.safe_dump(settings))
    code, _, err = fleet2d("transfer", odd, "--out", tmp_path / "out")
    assert (2, True) == (code, "simulated: no home has a room for them" in err)

    odd.write_text(yaml.safe_dump({**settings, "skip": "unfit"}))
    for _ in range(2):
        code, out, err = fleet2d("transfer", odd, "--out", tmp_path / "out")
        assert 0 == code, err
        assert "left out: simulated: no home has a room for them (2 cells)" in err
        assert out.splitlines()[-1].startswith("2 of 2 cells, 2 left out")

    odd.write_text(yaml.safe_dump({**settings, "arms": ["both"], "skip": "unfit"}))
    code, _, err = fleet2d("transfer", odd, "--out", tmp_path / "none")
    assert (2, True) == (code, "no model can be trained and scored" in err)


def test_a_cell_is_no_run_that_can_be_repeated(made, fleet2d):
    code, _, err = fleet2d("study", "rerun", made.location, "0")
    assert 2 == code
    assert "are no runs of scenarios" in err
