"""Habits: answers about hours of the week from beliefs that are right, wrong, or always the same."""

import numpy as np
import pytest

import fleet2d
from fleet2d.metrics.habits import answer_scores

AT_HOME, AWAY = [0.6, 0.3, 0.1], [0.1, 0.1, 0.8]
WEEK = np.array([AT_HOME, AWAY, AT_HOME, AWAY])


def test_the_truth_itself_answers_all_questions_rightly():
    right = {"home": 1, "always_home": 0.5, "away_f1": 1, "place": 1, "probability": 0}
    assert answer_scores(WEEK, WEEK) == right


def test_a_belief_that_is_the_same_at_all_hours_finds_no_hour_away():
    scores = answer_scores(WEEK, np.array([AT_HOME] * 4))

    assert scores["home"] == scores["always_home"] == scores["place"] == 0.5
    assert scores["away_f1"] == 0
    assert scores["probability"] == pytest.approx(0.35)


def test_a_place_as_frequent_as_the_most_frequent_one_is_right():
    truth = np.array([[0.5, 0.5, 0.0]])
    assert answer_scores(truth, np.array([[0.1, 0.9, 0.0]]))["place"] == 1


def test_a_person_with_hours_is_told_by_the_hour_and_not_overall():
    """Away from nine to five on each of eight days, seen by rounds in a home of two rooms."""
    items = [
        {"at": "00:00", "place": "bedroom"},
        {"at": "09:00", "away": True},
        {"at": "17:00", "place": "kitchen"},
    ]
    users = {"ana": {"type": "schedule", "days": [{"items": items}]}}
    ltp = {"type": "long_term_presence", "estimator": "likelihood", "period": "1 d"}
    run = fleet2d.run(
        "bundled:paper",
        "simulation.duration=8 d",
        seed=3,
        users=users,
        robots={"astro": {"behaviors": [{"type": "patrol", "dwell": "10 min"}]}},
        algorithms={"ltp": None, "hourly": {**ltp, "by": "hour_of_week"}, "overall": ltp},
        metrics={
            "ltp_error": None,
            "hourly": {"type": "habits", "of": "hourly"},
            "overall": {"type": "habits", "of": "overall"},
        },
    )
    hourly, overall = (run.metrics[name]["ana"] for name in ("hourly", "overall"))

    assert hourly["home"] > 0.9 > hourly["always_home"]
    assert hourly["place"] > 0.8
    assert overall["home"] == pytest.approx(overall["always_home"])
    assert 0 == overall["away_f1"]
