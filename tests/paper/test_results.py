"""Each result in its smallest version: what it prints, keeps and draws, and that it is the same again."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fleet2d.errors import FloorPlanError, InputError
from fleet2d.paper import feedback, ltp_gap, rtp_gap, speed
from fleet2d.paper.months import Request, silent
from fleet2d.paper.pictures import draw
from fleet2d.paper.result import Result, Table, make_directory
from fleet2d.paper.results import RESULTS, chosen, reproduce
from fleet2d.paper.watched import Watching
from fleet2d.scenario.model import load_scenario
from fleet2d.studies.design import Design, build_design
from fleet2d.studies.specification import read_specification

PNG = b"\x89PNG\r\n\x1a\n"
TINY = Request(quick=True, seeds=1, days=2)
TWO = Request(quick=True, seeds=2, days=2)


@pytest.fixture(scope="module")
def found() -> dict[str, Result]:
    """The results that are months, of two days."""
    sizes = {"ltp-gap": TWO, "rtp-gap": TINY, "feedback": TINY}
    return {name: reproduce(name, size, silent) for name, size in sizes.items()}


def numbers_of(result: Result) -> dict[str, Any]:
    return {name: value for name, value in result.numbers.items() if name != "seconds"}


@pytest.mark.parametrize("name", ["ltp-gap", "rtp-gap", "feedback"])
def test_a_result_is_kept_and_drawn(found: dict[str, Result], name: str, tmp_path: Path) -> None:
    kept = json.loads(found[name].save(tmp_path).read_text(encoding="utf-8"))
    assert found[name].title == kept["result"]
    draw(found[name], tmp_path / "picture.png")
    assert (tmp_path / "picture.png").read_bytes().startswith(PNG)
    for table in found[name].tables:
        assert all(len(table.columns) == len(row) for row in table.rows)


def test_a_result_is_the_same_again(found: dict[str, Result]) -> None:
    assert numbers_of(found["ltp-gap"]) == numbers_of(reproduce("ltp-gap", TWO, silent))


def test_gaps_are_of_every_room_and_day(found: dict[str, Result]) -> None:
    numbers = found["ltp-gap"].numbers
    assert 2 == len(numbers["gaps"])
    assert {2} == {len(line) for one in numbers["gaps"] for line in one.values()}
    first = np.mean([one["kitchen_0"] for one in numbers["gaps"]], axis=0)
    assert first.tolist() == pytest.approx(numbers["mean"]["kitchen_0"])
    every = numbers["all_rooms"]
    assert all(
        low <= mean <= high
        for low, mean, high in zip(*(every[k] for k in ("low", "mean", "high")), strict=True)
    )


def test_right_after_a_sighting_the_naive_guess_is_right_and_after_hours_is_not(
    found: dict[str, Result],
) -> None:
    told = found["rtp-gap"].numbers["means"]["top_1"]
    assert told[rtp_gap.NAIVE]["0-1 min"][0] > 0.9
    assert told[rtp_gap.NAIVE]["over 4 h"][0] < 0.2
    assert told["hmm"]["over 4 h"][0] > 0.5


def test_differences_are_paired_by_seed(found: dict[str, Result]) -> None:
    tv = found["feedback"].numbers["tv"]
    assert set(feedback.POLICIES) == set(tv)
    less = feedback.differences(tv)
    for policy, by in tv.items():
        assert feedback.NAIVE not in less[policy]
        for name, values in less[policy].items():
            expected = [a - b for a, b in zip(by[name], by[feedback.NAIVE], strict=True)]
            assert expected == values


def design_of(seeds: int) -> Design:
    return build_design(read_specification(feedback.study_of(seeds, 1)))


def test_a_robot_goes_by_the_estimator_of_its_column_only() -> None:
    design = design_of(1)
    for index in range(len(design)):
        labels, scenario = design.parameters(index), design.scenario(index).resolved()
        behaviors = scenario["robots"]["astro"]["behaviors"]
        sources = [b["source"] for b in behaviors if b["type"] == "hangout"]
        acts = feedback.POLICIES[str(labels["robot"])].acts
        assert ([labels["estimator"]] if acts else []) == sources
        expected = {labels["estimator"]} if acts else set(feedback.ESTIMATORS)
        assert expected == set(scenario["algorithms"])
        assert len(expected) == len(scenario["metrics"])


def test_estimators_share_a_month_unless_the_robot_acts_on_them() -> None:
    acting = sum(policy.acts for policy in feedback.POLICIES.values())
    months = acting * len(feedback.ESTIMATORS) + len(feedback.POLICIES) - acting
    assert 3 * months == len(design_of(3))


# --- Speed --------------------------------------------------------------------------------------


def test_every_row_of_the_paper_is_there(shared_data: Path) -> None:
    cases = {row.case: row for row in speed.rows(Request(), 30)}
    for case in (
        "base: routine, presence, hangout", "60 days", "without robot algorithms", "Flashlight",
        "2 users", "5 users", "10 users", "20 users", "50 users",
        "watched: a frame each second", "watched: a frame each minute",
    ):  # fmt: skip
        assert case in cases
    assert "real-world map" not in cases
    real = shared_data / "ros_maps" / "aws_small_house" / "map.yaml"
    mapped = {row.case: row for row in speed.rows(Request(map=real), 30)}
    for row in mapped.values():
        assert load_scenario(None, *row.overrides) is not None
    assert "ros" == load_scenario(None, *mapped["real-world map"].overrides).floorplan.type_name


def test_a_map_that_cannot_be_read_says_so() -> None:
    with pytest.raises(FloorPlanError, match="nowhere"):
        speed.rows(Request(map=Path("nowhere.yaml")), 30)


def test_rows_are_measured_in_processes_of_their_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    day = "simulation.duration.days=1"
    cases = [
        speed.Row("base", (day,), speed.PAPER_BASE),
        speed.Row("impossible", (day, "robots.astro.radius=40 m")),
        speed.Row("watched", (), speed.PAPER_WATCHED, Watching("second", 1, 5)),
    ]
    monkeypatch.setattr(speed, "rows", lambda request, days: cases)
    found = speed.reproduce(Request(quick=True, seeds=1), silent)
    base, impossible, watched = found.numbers["rows"]
    assert base["speedup"] == pytest.approx(86_400 / base["seconds"][0])
    assert base["process_s"] > base["seconds"][0]
    assert "radius" in impossible["failed"] or "room" in impossible["failed"]
    assert 5 == watched["frames"]
    assert any("--map" in note for note in found.tables[0].notes)
    draw(found, tmp_path / "speed.png")


# --- Names and files ------------------------------------------------------------------------------


def test_results_come_in_the_order_of_the_paper() -> None:
    assert ["speed", "ltp-gap", "rtp-gap", "feedback"] == chosen([]) == list(RESULTS)
    assert ["speed", "feedback"] == chosen(["feedback", "speed", "speed"])
    with pytest.raises(InputError, match="did you mean 'feedback'"):
        chosen(["feedbak"])
    assert (ltp_gap.NAME, rtp_gap.NAME) == tuple(chosen(["rtp-gap", "ltp-gap"]))


def test_a_directory_that_cannot_be_made_is_said_before_anything_is_run(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="--out"):
        make_directory(tmp_path / "file" / "paper")
    with pytest.raises(InputError, match="can't be written"):
        Result("speed", "", (Table("", (), ()),)).save(tmp_path / "absent")
