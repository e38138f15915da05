"""The paper's results in their smallest versions: studies, tables, files, pictures, the command."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from examples.paper import reproduce as paper
from examples.paper.reproduce import (
    DRAWERS,
    ESTIMATORS,
    NAIVE_ESTIMATOR,
    NAIVE_GUESS,
    PAPER_COLUMN,
    SIZES,
    PaperOptions,
    Result,
    differences,
    draw,
    estimates,
    feedback,
    ltp_gap,
    rtp_gap,
    run_months,
    study_content,
    table_of,
    table_of_means,
)
from matplotlib.container import BarContainer

from fleet2d.configuration.documents import read_document
from fleet2d.errors import ComponentError, FloorPlanError, InputError
from fleet2d.scenario.load import load_scenario
from fleet2d.studies.design import Design, build_design
from fleet2d.studies.specification import read_specification


def test_estimates_keep_the_order_of_rows_and_hold_their_mean():
    rows = pl.DataFrame(
        {"robot": ["b"] * 4 + ["a"], "model": ["x"] * 5, "value": [0.1, 0.4, 0.2, 0.9, 0.5]}
    )
    first, single = estimates(rows, "robot", "model").to_dicts()
    assert ("b", "x", "a") == (first["robot"], first["model"], single["robot"])
    assert first["mean"] == pytest.approx(0.4)
    assert first["low"] < first["mean"] < first["high"]
    assert 0.5 == single["mean"]
    assert np.isnan(single["low"])


def test_a_table_leaves_cells_without_a_mean_empty():
    means = pl.DataFrame(
        [("semi_markov", "all", 0.5, 0.4, 0.6)],
        ["model", "gap", "mean", "low", "high"],
        orient="row",
    )
    table = table_of_means("title", means, ("0-1 min", "all"))
    assert ["model", "0-1 min", "all"] == [column.header for column in table.columns]
    assert [["semi markov"], [""], ["0.500"]] == [list(column.cells) for column in table.columns]


def test_words_of_a_table_are_at_the_left_and_numbers_at_the_right():
    columns = table_of(
        "feedback", ("policy", "gap", PAPER_COLUMN), [("hangout", "3", "4 ± 1")]
    ).columns
    assert ["left", "right", "left"] == [column.justify for column in columns]


def test_the_study_files_hold_the_sizes_of_the_paper():
    for name in ("rtp-gap", "feedback"):
        file = Path(paper.__file__).with_name(f"{name}.yaml")
        assert read_document(file).data == study_content(name, *SIZES[name])


def test_robots_are_repeated_under_names_of_their_own():
    robots = study_content("ltp-gap", 8, 2)["axes"]["robot"]["options"]
    assert [f"robot_{number}" for number in range(8)] == list(robots)
    assert robots["robot_7"]["robots.robot_7"] == robots["robot_1"]["robots.robot_1"]
    assert ["robots.robot_7"] == list(robots["robot_7"])


def test_months_that_are_there_are_not_run_again(tmp_path):
    options = PaperOptions(quick=True, seeds=2, days=1, folder=tmp_path)
    first = run_months("ltp-gap", options)
    results = tmp_path / "ltp-gap" / "results"
    written = {path: path.stat().st_mtime_ns for path in results.iterdir()}
    again = run_months("ltp-gap", options)
    assert written
    assert written == {path: path.stat().st_mtime_ns for path in results.iterdir()}
    assert first.variants["digest"].to_list() == again.variants["digest"].to_list()


def test_a_month_that_fails_is_an_error(tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(
        "from fleet2d import Metric\n"
        "class Fails(Metric):\n"
        "    def update(self, history, state):\n        raise ValueError('thirteen')\n"
    )

    def failing(name: str, seeds: int, days: int) -> dict[str, Any]:
        own = {"type": f"{tmp_path.as_posix()}/mine:Fails"}
        return {**study_content(name, seeds, days), "rules": [{"set": {"metrics.own": own}}]}

    monkeypatch.setattr(paper, "study_content", failing)
    with pytest.raises(ComponentError, match="thirteen"):
        run_months(
            "ltp-gap", PaperOptions(quick=True, seeds=1, days=1, folder=tmp_path / "studies")
        )


def test_a_request_says_how_large_or_leaves_it():
    assert (30, 30) == PaperOptions().size("feedback")
    assert (2, 3) == PaperOptions(quick=True).size("feedback")
    assert (7, 3) == PaperOptions(quick=True, seeds=7).size("feedback")


PNG = b"\x89PNG\r\n\x1a\n"
TINY = PaperOptions(quick=True, seeds=1, days=2)


HANGOUTS = ("hangout, 10 % of moves at random", "hangout, 10 % rounds by the clock")


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The results that are months, of two days; that of most robots of one."""
    tiny = replace(TINY, folder=tmp_path_factory.mktemp("studies"))
    two = replace(tiny, seeds=2)
    all_results = (ltp_gap(two), rtp_gap(tiny), feedback(replace(tiny, days=1)))
    return {result.name: result for result in all_results}


def numbers_of(result: Result) -> dict[str, Any]:
    return {name: value for name, value in result.numbers.items() if name != "seconds"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ltp-gap", "rtp-gap", "feedback"])
def test_a_result_is_kept_and_drawn(measured, name, tmp_path):
    content = json.loads(measured[name].save(tmp_path).read_text(encoding="utf-8"))
    assert measured[name].title == content["result"]
    draw(measured[name], tmp_path / "picture.png")
    assert (tmp_path / "picture.png").read_bytes().startswith(PNG)
    assert all(table.row_count for table in measured[name].tables)


def test_errors_under_each_policy_are_bars_as_policies_have_no_order():
    means = [
        {"robot": robot, "estimator": estimator, "mean": 0.2, "low": 0.1, "high": 0.3}
        for robot in HANGOUTS
        for estimator in ("sighting_share", "likelihood")
    ]
    (axes,) = DRAWERS["feedback"]({"means": means}).axes
    assert [2, 2] == [len(bars) for bars in axes.containers if isinstance(bars, BarContainer)]
    assert ["sighting share", "likelihood"] == axes.get_legend_handles_labels()[1]
    assert "hangout, 10 % of\nmoves at random" == axes.get_xticklabels()[0].get_text()
    assert axes.get_ylim()[1] < 0.5  # as large as they allow


@pytest.mark.slow
def test_a_result_is_the_same_again(measured, tmp_path):
    again = ltp_gap(replace(TINY, seeds=2, folder=tmp_path))
    assert numbers_of(measured["ltp-gap"]) == numbers_of(again)


def test_gaps_are_of_every_room_and_day(measured):
    numbers = measured["ltp-gap"].numbers
    assert 2 == len(numbers["gaps"])
    assert {2} == {len(line) for robot in numbers["gaps"] for line in robot.values()}
    mean = np.mean([robot["kitchen_1"] for robot in numbers["gaps"]], axis=0)
    assert mean.tolist() == pytest.approx(numbers["mean"]["kitchen_1"])
    overall = numbers["all_rooms"]
    assert all(
        low <= mean <= high
        for low, mean, high in zip(*(overall[k] for k in ("low", "mean", "high")), strict=True)
    )


def test_right_after_a_sighting_the_naive_guess_is_right_and_after_hours_is_not(measured):
    rows = measured["rtp-gap"].numbers["means"]["simulated"]["top_1"]
    top_1 = {(row["model"], row["gap"]): row["mean"] for row in rows}
    assert top_1[NAIVE_GUESS, "0-1 min"] > 0.9
    assert top_1[NAIVE_GUESS, "over 4 h"] < 0.2
    assert top_1["hmm", "over 4 h"] > 0.5


def test_differences_are_paired_by_seed(measured):
    errors = pl.DataFrame(measured["feedback"].numbers["tv"])
    values = {(r["robot"], r["seed"], r["estimator"]): r["value"] for r in errors.to_dicts()}
    robots = [*design_of(1).labels["robot"]]
    assert robots == errors["robot"].unique(maintain_order=True).to_list()
    less = differences(errors).to_dicts()
    assert len(robots) * (len(ESTIMATORS) - 1) == len(less)
    for row in less:
        robot, seed, estimator = row["robot"], row["seed"], row["estimator"]
        expected = values[robot, seed, estimator] - values[robot, seed, NAIVE_ESTIMATOR]
        assert expected == row["value"]


def design_of(seeds: int) -> Design:
    return build_design(read_specification(study_content("feedback", seeds, 1)))


def test_a_robot_goes_by_the_estimator_of_its_column_only():
    design = design_of(1)
    for index in range(len(design)):
        labels, scenario = design.parameters(index), design.scenario(index).resolved()
        behaviors = scenario["robots"]["astro"]["behaviors"]
        sources = [b["source"] for b in behaviors if b["type"] == "hangout"]
        uses_estimator = labels["robot"] in HANGOUTS
        assert ([labels["estimator"]] if uses_estimator else []) == sources
        expected = {labels["estimator"]} if uses_estimator else set(ESTIMATORS)
        assert expected == set(scenario["algorithms"])
        assert len(expected) == len(scenario["metrics"])


def test_estimators_share_a_month_unless_the_robot_acts_on_them():
    design = design_of(3)
    others = len(design.labels["robot"]) - len(HANGOUTS)
    assert 3 * (len(HANGOUTS) * len(ESTIMATORS) + others) == len(design)


# --- Speed --------------------------------------------------------------------------------------


def test_every_row_of_the_paper_is_there(shared_data):
    cases = {row["case"]: row for row in paper.rows(PaperOptions(), 30)}
    for case in (
        "base: routine, presence, hangout", "60 days", "without robot algorithms", "Flashlight",
        "2 users", "5 users", "10 users", "20 users", "50 users",
        "watched: a frame each second", "watched: a frame each minute",
    ):  # fmt: skip
        assert case in cases
    assert "real-world map" not in cases
    real = shared_data / "ros_maps" / "aws_small_house" / "map.yaml"
    mapped = {row["case"]: row for row in paper.rows(PaperOptions(map=real), 30)}
    for row in mapped.values():
        assert load_scenario("bundled:paper", *row["overrides"]) is not None
    assert (
        "ros"
        == load_scenario(
            "bundled:paper", *mapped["real-world map"]["overrides"]
        ).floorplan.type_name
    )


def test_a_map_that_cannot_be_read_says_so():
    with pytest.raises(FloorPlanError, match="nowhere"):
        paper.rows(PaperOptions(map=Path("nowhere.yaml")), 30)


@pytest.mark.slow
def test_rows_are_measured_in_processes_of_their_own(monkeypatch, tmp_path):
    day = "simulation.duration.days=1"
    cases = [
        {"case": "base", "overrides": [day], "paper": "13,000 x", "paper_speedup": 13_000},
        {"case": "impossible", "overrides": [day, "robots.astro.radius=40 m"], "paper": ""},
        {"case": "watched", "frames": {"period_s": 1, "count": 5}, "paper": ""},
    ]
    monkeypatch.setattr(paper, "rows", lambda options, days: cases)
    result = paper.measure_rows(PaperOptions(quick=True, seeds=1))
    base, impossible, watched = result.numbers["rows"]
    assert base["speedup"] == pytest.approx(86_400 / base["seconds"][0])
    assert base["process_s"] > base["seconds"][0]
    assert "radius" in impossible["failed"] or "room" in impossible["failed"]
    assert 5 == round(watched["speedup"] * watched["seconds"][0])
    assert any("--map" in note for note in result.notes)
    draw(result, tmp_path / "speed.png")


def test_watching_counts_the_time_between_frames():
    timing = paper.time_frames(60, 10, from_hour=1)
    assert 600 == timing["simulated_s"]


# --- Names and files ------------------------------------------------------------------------------


def test_numbers_that_cannot_be_written_are_an_error(tmp_path):
    with pytest.raises(InputError, match="can't be written"):
        Result("speed", "", ()).save(tmp_path / "absent")


# --- The command ----------------------------------------------------------------------------------

Output = tuple[int, str, str]
SMALLEST = ("--quick", "--seeds", "1", "--days", "2", "--workers", "1")


@pytest.fixture
def reproduce(monkeypatch, capsys, tmp_path):
    """The command in this process, in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> Result:
        monkeypatch.setattr(sys, "argv", ["reproduce.py", *arguments])
        with pytest.raises(SystemExit) as caught:
            paper.main()
        out, err = capsys.readouterr()
        return int(caught.value.code or 0), out, err

    return call


def test_a_result_is_printed_kept_and_drawn(reproduce):
    code, out, _ = reproduce("ltp-gap", *SMALLEST)
    assert 0 == code
    assert "Fig. 7 left" in out
    assert "the paper's figure" in out
    assert "living_room_1" in out
    names = sorted(path.name for path in Path("paper").iterdir())
    assert ["ltp-gap.json", "ltp-gap.png", "studies"] == names
    assert 2 == json.loads(Path("paper/ltp-gap.json").read_text(encoding="utf-8"))["days"]


@pytest.mark.slow
def test_units_in_brackets_are_printed(reproduce):
    code, out, _ = reproduce("rtp-gap", *SMALLEST, "--out", "here/there")
    assert 0 == code
    assert "log loss [nats]" in out
    assert Path("here/there/rtp-gap.json").exists()


def test_results_come_in_the_order_of_the_paper(reproduce, monkeypatch):
    measured = []
    for name in ("ltp-gap", "feedback"):
        monkeypatch.setitem(
            paper.MEASURES,
            name,
            lambda _, name=name: measured.append(name) or Result(name, "", ()),
        )
    monkeypatch.setattr(paper, "draw", lambda result, path: None)
    code, _, _ = reproduce("feedback", "ltp-gap", "feedback", *SMALLEST)
    assert 0 == code
    assert ["ltp-gap", "feedback"] == measured


def test_what_does_not_exist_is_refused(reproduce):
    code, _, err = reproduce("ltpgap")
    assert 2 == code
    assert "did you mean 'ltp-gap'?" in err
    assert not Path("paper").exists()


@pytest.mark.parametrize("option", ["--seeds", "--days", "--workers"])
def test_sizes_below_one_are_refused(reproduce, option):
    code, _, err = reproduce("ltp-gap", option, "0")
    assert 2 == code
    assert option in err


def test_a_directory_that_is_a_file_is_refused_first(reproduce):
    Path("file").write_text("")
    code, _, err = reproduce("ltp-gap", "--out", "file")
    assert 2 == code
    assert "--out" in err
