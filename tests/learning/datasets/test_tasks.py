"""Scores of tasks: differences by home, in which each home counts alike."""

from pathlib import Path

import numpy as np
import pytest

import fleet2d
from fleet2d.learning.datasets.command import _print_scores
from fleet2d.learning.datasets.reader import Dataset
from fleet2d.learning.datasets.tasks import (
    LOWER_END,
    UPPER_END,
    LeaderboardEntry,
    SplitForecasts,
    _difference,
    leaderboard,
)

ENDS = ("", LOWER_END, UPPER_END)


def test_the_difference_to_routine_is_a_mean_over_homes():
    """Two homes with one and three windows, and a model that is better by a factor of 2 or 4."""
    prior = np.array([[0.2, 0.8], [0.4, 0.6], [0.4, 0.6], [0.4, 0.6]])
    model = np.array([[0.8, 0.2], [0.8, 0.2], [0.8, 0.2], [0.8, 0.2]])
    truth = np.zeros(4, np.int64)
    home = np.array(["a", "b", "b", "b"])
    parts = {"uci": np.array([False, True, True, True]), "robot=patrol": np.ones(4, np.bool_)}
    made = SplitForecasts(
        {"routine": prior, "mine": model}, truth, np.array([3, 3, 3, 500.0]), home, parts
    )

    scores = _difference(made, "mine")

    assert -np.log([2, 4]).mean() == pytest.approx(scores["log_loss - routine"])
    assert scores["log_loss - routine lower end"] < -np.log(4)
    assert 0 < scores["log_loss - routine upper end"]
    assert -np.log([2, 4]).mean() == pytest.approx(scores["log_loss - routine 1-5 min"])
    assert -np.log(2) == pytest.approx(scores["log_loss - routine over 4 h"])
    assert "log_loss - routine over 4 h lower end" not in scores, "there is one home"
    assert -np.log(0.8) == pytest.approx(scores["log_loss of uci"])
    assert all(_difference(made, "routine")[f"log_loss - routine{end}"] == 0 for end in ENDS)
    assert "log_loss of robot=patrol" not in scores, "that is all of it"
    one = made._replace(home=np.array(["a"] * 4), parts={})
    assert {"log_loss - routine"} == {name[:18] for name in _difference(one, "mine")}


def test_the_table_has_a_column_for_each_model_and_intervals_in_its_cells(capsys):
    scores = {"log_loss": 0.5, "gain": -1.0, "gain lower end": -2.0, "gain upper end": 0.0}
    entries = [LeaderboardEntry("rtp", "routine", scores, 7)]
    entries.append(LeaderboardEntry("rtp", "learned", {"log_loss": 0.25, "gain": -3.0}, 7))

    _print_scores(entries, "test")

    rows = [line.split("  ") for line in capsys.readouterr().out.splitlines()]
    assert [[cell.strip() for cell in row if cell] for row in rows] == [
        ["rtp (7 cases of test)"],
        ["routine", "learned"],
        ["log_loss", "0.500", "0.250"],
        ["gain", "-1.000 (-2.000 to 0.000)", "-3.000"],
    ]


def made(folder: Path, duration, *users, **keys) -> Dataset:
    """Make a data set of a run for each of some households, each in a home of its own."""
    splits = {
        f"part{k}": {"runs": 1, "homes": [{"synthetic": 1, "first": k}], "households": [household]}
        for k, household in enumerate(users)
    }
    base = {"extends": "bundled:paper", "simulation": {"duration": duration}}
    return fleet2d.dataset({"base": base, "splits": splits, **keys}, folder / "made", workers=1)


def models(entries: list[LeaderboardEntry]) -> list[tuple[str, int]]:
    return [(entry.model, entry.cases) for entry in entries]


@pytest.mark.slow
def test_moments_at_which_nobody_knows_where_a_person_is_have_no_label(tmp_path):
    """The log is silent between two rooms for an hour, which a stay in one room isn't."""
    log = tmp_path / "home_Sensors.txt"
    lines = (
        f"2026-01-05 {begin}:00\t2026-01-05 {end}:00\tMat\tPressure\t{room}"
        for begin, end, room in [("00:00", "00:20", "Kitchen"), ("01:20", "03:00", "Bedroom")]
    )
    log.write_text("\n".join(lines))
    data = made(tmp_path, "2 h", {"ana": {"type": "replay", "path": str(log), "format": "uci_adl"}})

    minutes = data.arrow("labels", "part0")["step"].to_numpy() // 60
    assert np.isin(np.arange(20), minutes).all()
    assert not np.isin(np.arange(25, 75), minutes).any()
    assert np.isin(np.arange(81, 119), minutes).all()


@pytest.mark.slow
def test_stored_beliefs_of_learned_and_homes_without_people_are_scored(tmp_path):
    data = made(tmp_path, "1 h", ["student"], [], beliefs=["routine", "learned"])

    assert models(leaderboard(data, ["rtp"], split="part0")) == [("routine", 8), ("learned", 8)]
    assert leaderboard(data, split="part1") == []


@pytest.mark.slow
def test_beliefs_without_a_label_of_their_time_are_not_scored(tmp_path):
    data = made(tmp_path, "1 h", ["retired"], labels="1 h", beliefs=["routine"])

    assert leaderboard(data, split="part0") == []
