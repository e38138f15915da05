"""The paper's results in their smallest versions: studies, tables, files, pictures, the command."""

import json
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import polars as pl
import pytest
from examples.paper import reproduce as paper
from examples.paper.reproduce import (
    ESTIMATORS,
    NAIVE_ESTIMATOR,
    NAIVE_GUESS,
    SIZES,
    PaperOptions,
    Result,
    differences,
    draw,
    feedback,
    ltp_gap,
    rtp_gap,
    run_months,
    study_content,
)

from fleet2d.configuration.documents import read_document
from fleet2d.errors import ComponentError
from fleet2d.scenario.load import load_scenario
from fleet2d.studies.design import build_design
from fleet2d.studies.specification import read_specification


def test_the_study_files_hold_the_sizes_of_the_paper():
    for name in ("rtp-gap", "feedback"):
        file = Path(paper.__file__).with_name(f"{name}.yaml")
        assert read_document(file).data == study_content(name, *SIZES[name])


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

    def failing(name, seeds, days):
        own = {"type": f"{tmp_path.as_posix()}/mine:Fails"}
        return {**study_content(name, seeds, days), "rules": [{"set": {"metrics.own": own}}]}

    monkeypatch.setattr(paper, "study_content", failing)
    with pytest.raises(ComponentError, match="thirteen"):
        run_months(
            "ltp-gap", PaperOptions(quick=True, seeds=1, days=1, folder=tmp_path / "studies")
        )


PNG = b"\x89PNG\r\n\x1a\n"
TINY = PaperOptions(quick=True, seeds=1, days=2)


HANGOUTS = ("hangout, 10 % of moves at random", "hangout, 10 % rounds by the clock")


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The result of a name, of two days or one: a function that measures each once."""
    tiny = replace(TINY, folder=tmp_path_factory.mktemp("studies"))
    measures = {
        "ltp-gap": lambda: ltp_gap(replace(tiny, seeds=2)),
        "rtp-gap": lambda: rtp_gap(tiny),
        "feedback": lambda: feedback(replace(tiny, days=1)),
    }
    return cache(lambda name: measures[name]())


def numbers_of(result: Result):
    return {name: value for name, value in result.numbers.items() if name != "seconds"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ltp-gap", "rtp-gap", "feedback"])
def test_a_result_is_kept_and_drawn(measured, name, tmp_path):
    content = json.loads(measured(name).save(tmp_path).read_text(encoding="utf-8"))
    assert measured(name).title == content["result"]
    draw(measured(name), tmp_path / "picture.png")
    assert (tmp_path / "picture.png").read_bytes().startswith(PNG)
    assert all(table.row_count for table in measured(name).tables)


@pytest.mark.slow
def test_a_result_is_the_same_again(measured, tmp_path):
    again = ltp_gap(replace(TINY, seeds=2, folder=tmp_path))
    assert numbers_of(measured("ltp-gap")) == numbers_of(again)


def test_right_after_a_sighting_the_naive_guess_is_right_and_after_hours_is_not(measured):
    rows = measured("rtp-gap").numbers["means"]["simulated"]["top_1"]
    top_1 = {(row["model"], row["gap"]): row["mean"] for row in rows}
    assert top_1[NAIVE_GUESS, "0-1 min"] > 0.9
    assert top_1[NAIVE_GUESS, "over 4 h"] < 0.2
    assert top_1["hmm", "over 4 h"] > 0.5


def test_differences_are_paired_by_seed(measured):
    errors = pl.DataFrame(measured("feedback").numbers["tv"])
    values = {(r["robot"], r["seed"], r["estimator"]): r["value"] for r in errors.to_dicts()}
    robots = [*design_of(1).labels["robot"]]
    assert robots == errors["robot"].unique(maintain_order=True).to_list()
    less = differences(errors).to_dicts()
    assert len(robots) * (len(ESTIMATORS) - 1) == len(less)
    for row in less:
        robot, seed, estimator = row["robot"], row["seed"], row["estimator"]
        expected = values[robot, seed, estimator] - values[robot, seed, NAIVE_ESTIMATOR]
        assert expected == row["value"]


def design_of(seeds):
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


# --- Names and files ------------------------------------------------------------------------------


# --- The command ----------------------------------------------------------------------------------

SMALLEST = ("--quick", "--seeds", "1", "--days", "2", "--workers", "1")


@pytest.fixture
def reproduce(monkeypatch, capsys, tmp_path):
    """The command in this process, in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments) -> Result:
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
