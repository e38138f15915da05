"""Scores of tasks: differences by home, in which each home counts alike."""

from pathlib import Path

import numpy as np
import pytest

import fleet2d
from fleet2d.learning.datasets.tasks import SplitForecasts, _difference, leaderboard


def test_the_difference_to_routine_is_a_mean_over_homes() -> None:
    """Two homes with one and three windows, and a model that is better by a factor of 2 or 4."""
    prior = np.array([[0.2, 0.8], [0.4, 0.6], [0.4, 0.6], [0.4, 0.6]])
    model = np.array([[0.8, 0.2], [0.8, 0.2], [0.8, 0.2], [0.8, 0.2]])
    home = np.array(["a", "b", "b", "b"])
    made = SplitForecasts(
        {"routine": prior, "mine": model}, np.zeros(4, np.int64), np.zeros(4), home
    )

    scores = _difference(made, "mine")

    assert -np.log([2, 4]).mean() == pytest.approx(scores["log_loss - routine"])
    assert scores["log_loss - routine lower end"] < -np.log(4)
    assert 0 < scores["log_loss - routine upper end"]
    assert [0, 0, 0] == list(_difference(made, "routine").values())
    one = made._replace(home=np.array(["a"] * 4))
    assert ["log_loss - routine"] == list(_difference(one, "mine"))


@pytest.mark.slow
def test_stored_beliefs_of_learned_and_homes_without_people_are_scored(tmp_path: Path) -> None:
    people = {"train": ["retired"], "test": ["student"], "nobody": []}
    splits = {
        name: {"runs": 1, "homes": [{"synthetic": 1, "first": k}], "households": [household]}
        for k, (name, household) in enumerate(people.items())
    }
    base = {"extends": "bundled:paper", "simulation": {"duration": "1 h"}}
    source = {"base": base, "splits": splits, "beliefs": ["routine", "learned"]}

    data = fleet2d.dataset(source, tmp_path / "made", workers=1)

    assert [(e.model, e.cases) for e in leaderboard(data, ["rtp"])] == [
        ("routine", 8),
        ("learned", 8),
    ]
    assert leaderboard(data, split="nobody") == []


@pytest.mark.slow
def test_beliefs_without_a_label_of_their_time_are_not_scored(tmp_path: Path) -> None:
    people = {"runs": 1, "homes": [{"synthetic": 1}], "households": [["retired"]]}
    base = {"extends": "bundled:paper", "simulation": {"duration": "1 h"}}
    source = {"base": base, "labels": "1 h", "splits": {"test": people}, "beliefs": ["routine"]}

    data = fleet2d.dataset(source, tmp_path / "made", workers=1)

    assert leaderboard(data) == []
