"""Each result in its smallest version: its tables, files and pictures, and that it is repeatable."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fleet2d.errors import FloorPlanError, InputError
from fleet2d.paper import months, speed
from fleet2d.paper.command import RESULTS, check_names, reproduce
from fleet2d.paper.months import PaperOptions, Result, Table, ignore_progress, make_directory
from fleet2d.paper.pictures import draw
from fleet2d.paper.speed import FrameSeries
from fleet2d.scenario.model import load_scenario
from fleet2d.studies.design import Design, build_design
from fleet2d.studies.specification import read_specification

PNG = b"\x89PNG\r\n\x1a\n"
TINY = PaperOptions(quick=True, seeds=1, days=2)
TWO = PaperOptions(quick=True, seeds=2, days=2)


@pytest.fixture(scope="module")
def results(serial: None) -> dict[str, Result]:
    """The results that are months, of two days; that of most robots of one."""
    day = replace(TINY, days=1)
    sizes = {"ltp-gap": TWO, "rtp-gap": TINY, "feedback": day}
    return {name: reproduce(name, size, ignore_progress) for name, size in sizes.items()}


def numbers_of(result: Result) -> dict[str, Any]:
    return {name: value for name, value in result.numbers.items() if name != "seconds"}


@pytest.mark.parametrize("name", ["ltp-gap", "rtp-gap", "feedback"])
def test_a_result_is_kept_and_drawn(results: dict[str, Result], name: str, tmp_path: Path) -> None:
    content = json.loads(results[name].save(tmp_path).read_text(encoding="utf-8"))
    assert results[name].title == content["result"]
    draw(results[name], tmp_path / "picture.png")
    assert (tmp_path / "picture.png").read_bytes().startswith(PNG)
    for table in results[name].tables:
        assert all(len(table.columns) == len(row) for row in table.rows)


def test_a_result_is_the_same_again(results: dict[str, Result], serial: None) -> None:
    assert numbers_of(results["ltp-gap"]) == numbers_of(reproduce("ltp-gap", TWO, ignore_progress))


def test_gaps_are_of_every_room_and_day(results: dict[str, Result]) -> None:
    numbers = results["ltp-gap"].numbers
    assert 2 == len(numbers["gaps"])
    assert {2} == {len(line) for robot in numbers["gaps"] for line in robot.values()}
    mean = np.mean([robot["kitchen_0"] for robot in numbers["gaps"]], axis=0)
    assert mean.tolist() == pytest.approx(numbers["mean"]["kitchen_0"])
    overall = numbers["all_rooms"]
    assert all(
        low <= mean <= high
        for low, mean, high in zip(*(overall[k] for k in ("low", "mean", "high")), strict=True)
    )


def test_right_after_a_sighting_the_naive_guess_is_right_and_after_hours_is_not(
    results: dict[str, Result],
) -> None:
    top_1 = results["rtp-gap"].numbers["means"]["top_1"]
    assert top_1[months.NAIVE_GUESS]["0-1 min"][0] > 0.9
    assert top_1[months.NAIVE_GUESS]["over 4 h"][0] < 0.2
    assert top_1["hmm"]["over 4 h"][0] > 0.5


def test_differences_are_paired_by_seed(results: dict[str, Result]) -> None:
    tv = results["feedback"].numbers["tv"]
    assert set(months.POLICIES) == set(tv)
    less = months.differences(tv)
    for policy, by in tv.items():
        assert months.NAIVE_ESTIMATOR not in less[policy]
        for name, values in less[policy].items():
            expected = [a - b for a, b in zip(by[name], by[months.NAIVE_ESTIMATOR], strict=True)]
            assert expected == values


def design_of(seeds: int) -> Design:
    return build_design(read_specification(months.feedback_study(seeds, 1)))


def test_a_robot_goes_by_the_estimator_of_its_column_only() -> None:
    design = design_of(1)
    for index in range(len(design)):
        labels, scenario = design.parameters(index), design.scenario(index).resolved()
        behaviors = scenario["robots"]["astro"]["behaviors"]
        sources = [b["source"] for b in behaviors if b["type"] == "hangout"]
        uses_estimator = months.POLICIES[str(labels["robot"])].uses_estimator
        assert ([labels["estimator"]] if uses_estimator else []) == sources
        expected = {labels["estimator"]} if uses_estimator else set(months.ESTIMATORS)
        assert expected == set(scenario["algorithms"])
        assert len(expected) == len(scenario["metrics"])


def test_estimators_share_a_month_unless_the_robot_acts_on_them() -> None:
    dependent = sum(policy.uses_estimator for policy in months.POLICIES.values())
    runs = dependent * len(months.ESTIMATORS) + len(months.POLICIES) - dependent
    assert 3 * runs == len(design_of(3))


# --- Speed --------------------------------------------------------------------------------------


def test_every_row_of_the_paper_is_there(shared_data: Path) -> None:
    cases = {row.case: row for row in speed.rows(PaperOptions(), 30)}
    for case in (
        "base: routine, presence, hangout", "60 days", "without robot algorithms", "Flashlight",
        "2 users", "5 users", "10 users", "20 users", "50 users",
        "watched: a frame each second", "watched: a frame each minute",
    ):  # fmt: skip
        assert case in cases
    assert "real-world map" not in cases
    real = shared_data / "ros_maps" / "aws_small_house" / "map.yaml"
    mapped = {row.case: row for row in speed.rows(PaperOptions(map=real), 30)}
    for row in mapped.values():
        assert load_scenario(None, *row.overrides) is not None
    assert "ros" == load_scenario(None, *mapped["real-world map"].overrides).floorplan.type_name


def test_a_map_that_cannot_be_read_says_so() -> None:
    with pytest.raises(FloorPlanError, match="nowhere"):
        speed.rows(PaperOptions(map=Path("nowhere.yaml")), 30)


def test_rows_are_measured_in_processes_of_their_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    day = "simulation.duration.days=1"
    cases = [
        speed.SpeedRow("base", (day,), speed.PAPER_BASE),
        speed.SpeedRow("impossible", (day, "robots.astro.radius=40 m")),
        speed.SpeedRow("watched", (), speed.PAPER_WATCHED, FrameSeries("second", 1, 5)),
    ]
    monkeypatch.setattr(speed, "rows", lambda options, days: cases)
    result = speed.reproduce(PaperOptions(quick=True, seeds=1), ignore_progress)
    base, impossible, watched = result.numbers["rows"]
    assert base["speedup"] == pytest.approx(86_400 / base["seconds"][0])
    assert base["process_s"] > base["seconds"][0]
    assert "radius" in impossible["failed"] or "room" in impossible["failed"]
    assert 5 == watched["frames"]
    assert any("--map" in note for note in result.tables[0].notes)
    draw(result, tmp_path / "speed.png")


# --- Names and files ------------------------------------------------------------------------------


def test_results_come_in_the_order_of_the_paper() -> None:
    assert ["speed", "ltp-gap", "rtp-gap", "feedback"] == check_names([]) == list(RESULTS)
    assert ["speed", "feedback"] == check_names(["feedback", "speed", "speed"])
    with pytest.raises(InputError, match="did you mean 'feedback'"):
        check_names(["feedbak"])
    assert (months.LTP_GAP, months.RTP_GAP) == tuple(check_names(["rtp-gap", "ltp-gap"]))


def test_a_directory_that_cannot_be_made_is_said_before_anything_is_run(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="--out"):
        make_directory(tmp_path / "file" / "paper")
    with pytest.raises(InputError, match="can't be written"):
        Result("speed", "", (Table("", (), ()),)).save(tmp_path / "absent")
