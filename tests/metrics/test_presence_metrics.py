"""Errors of long-term and scores of real-time presence, against the stored rows of a run."""

import math
from datetime import datetime
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from tests.reference import presence as slow
from tests.scenes import digests, run, scenario, table

import fleet2d
from fleet2d.algorithms.presence.belief import Presence
from fleet2d.errors import Fleet2DError
from fleet2d.floorplan.home import Home
from fleet2d.metrics.ltp_error import walking_distances

ROOMS = [
    f"{name}_1" for name in ("living_room", "kitchen", "bedroom", "bathroom", "storage", "unknown")
]
USERS = {
    "ana": {"type": "room_sampling", "shares": {"kitchen": 3, "bedroom": 5, "away": 2}},
    "ben": {"type": "meander"},
    "gone": {"type": "schedule", "days": [{"items": [{"at": "00:00", "away": True}]}]},
}


def content(duration: str = "3 h", **changes: Any) -> dict[str, Any]:
    return scenario(
        duration,
        **{
            "users": USERS,
            "robots": {"astro": {"type": "patrol", "dwell": "20 s"}},
            "algorithms": {
                "ltp": {"type": "long_term_presence", "estimator": "likelihood"},
                "rtp": {"type": "real_time_presence"},
                "minutely": {"type": "real_time_presence", "period": "1 min"},
                "last": {"type": "real_time_presence", "model": "last_seen"},
                "share": {"type": "long_term_presence", "estimator": "sighting_share"},
            },
            "metrics": {
                "error": {"type": "ltp_error", "of": "ltp", "period": "1 h"},
                "gap": {"type": "ltp_gap", "of": "ltp", "period": "1 h"},
                "with_away": {"type": "ltp_error", "of": "ltp", "given": "away", "period": "1 h"},
                "score": {"type": "rtp_score", "of": "rtp"},
                "naive": {"type": "rtp_score", "of": "last"},
                "each": {"type": "rtp_score", "of": "minutely", "period": "1 min"},
                "at_home": {"type": "rtp_score", "of": "rtp", "given_home": True},
                "beside": {"type": "rtp_score", "of": "rtp", "reference": "last"},
            },
            "artifacts": {"trajectories": "every step"},
            **changes,
        },
    )


@pytest.fixture(scope="module")
def stored():
    return run(content())


def places(stored: Any, user: str) -> list[str]:
    rows = table(stored, "trajectories", entity=user)
    return ["away" if away else room for away, room in zip(rows["away"], rows["room"], strict=True)]


def estimate(stored: Any, algorithm: str, user: str, step: int) -> dict[str, float]:
    rows = table(stored, algorithm, user=user)
    at = rows["step"] == step
    return dict(zip(rows["room"][at], rows["share"][at], strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("user", ["ana", "ben"])
def test_ltp_error_is_the_distance_to_the_truth(stored, user):
    rows = table(stored, "error", user=user)
    for k, step in enumerate((3599, 7199, 10799)):
        lived = places(stored, user)[: step + 1]
        home = [place for place in lived if place != "away"]
        truth = {room: home.count(room) / len(home) for room in ROOMS}
        estimated = estimate(stored, "ltp", user, step)
        gaps = [abs(truth[room] - estimated[room]) for room in ROOMS]
        assert sum(gaps) / 2 == pytest.approx(rows["tv"][k])
        assert max(gaps) == pytest.approx(rows["max_gap"][k])
        assert sum(gaps) / 6 == pytest.approx(rows["mean_gap"][k])
        order = slow.kendall([truth[room] for room in ROOMS], [estimated[room] for room in ROOMS])
        assert order == pytest.approx(rows["tau"][k])
        per_room = table(stored, "gap", user=user)
        assert gaps == pytest.approx(per_room["gap"][per_room["step"] == step].tolist())
        away = lived.count("away") / len(lived)
        spread = [
            abs(truth[room] * (1 - away) - estimated[room] * (1 - estimated["away"]))
            for room in ROOMS
        ]
        whole = (sum(spread) + abs(away - estimated["away"])) / 2
        assert whole == pytest.approx(table(stored, "with_away", user=user)["tv"][k])
    assert stored.metrics["error"][user]["tv"] == rows["tv"][-1]
    shares = [estimate(stored, "ltp", user, step) for step in (3599, 7199, 10799)]
    best = [max(ROOMS, key=estimated.__getitem__) for estimated in shares]
    assert sum(a != b for a, b in pairwise(best)) == stored.metrics["error"][user]["flips"]
    assert stored.metrics["gap"][user]["mean"] == pytest.approx(rows["mean_gap"][-1])


def test_anyone_is_in_every_occupied_room(stored):
    both = [places(stored, user) for user in USERS]
    occupied = {room: sum(room in now for now in zip(*both, strict=True)) for room in ROOMS}
    truth = {room: count / sum(occupied.values()) for room, count in occupied.items()}
    estimated = estimate(stored, "ltp", "anyone", 10799)
    tv = sum(abs(truth[room] - estimated[room]) for room in ROOMS) / 2
    assert tv == pytest.approx(stored.metrics["error"]["anyone"]["tv"])


def test_users_who_were_never_at_home_are_skipped(stored):
    for metric in ("error", "gap"):
        assert {"ana", "ben", "anyone"} == set(stored.metrics[metric])
    assert {"ana", "ben"} == set(stored.metrics["at_home"])


@pytest.mark.slow
@pytest.mark.parametrize("user", ["ana", "ben", "gone"])
def test_rtp_score_is_of_each_minute_and_by_the_gap(stored, user):
    lived, observed = places(stored, user), table(stored, "observations")
    steps = observed["step"][observed["user"] == user]  # nobody is mistaken here
    rows = table(stored, "score", user=user)
    counts: dict[str, int] = {}
    for end in range(59, 10800, 60):
        before = steps[steps <= end]
        gap = (end - before.max()) / 60 if len(before) else math.inf
        ends = {1: "0-1 min", 5: "1-5 min", 15: "5-15 min", 60: "15-60 min", 240: "1-4 h"}
        usual = "never seen" if math.isinf(gap) else "over 4 h"
        name = next((name for limit, name in ends.items() if gap <= limit), usual)
        counts[name] = counts.get(name, 0) + 1
    result = stored.metrics["score"][user]
    assert counts == {name: scores["bins"] for name, scores in result.items() if name != "all"}
    assert 180 == result["all"]["bins"] == rows["bins"].sum()
    for name in ("log_loss", "brier", "top_1"):
        assert rows[name].sum() / 180 == pytest.approx(result["all"][name])
    # At the end of a period the track is what was put out.
    total, right = 0.0, 0.0
    for end in range(59, 10800, 60):
        estimated = estimate(stored, "minutely", user, end)
        p = {room: estimated[room] * (1 - estimated["away"]) for room in ROOMS} | {
            "away": estimated["away"]
        }
        total -= math.log(max(p[lived[end]], 1e-6))
        right += p[lived[end]] == max(p.values())
    estimated = stored.metrics["each"][user]["all"]
    assert total / 180 == pytest.approx(estimated["log_loss"])
    assert right / 180 == pytest.approx(estimated["top_1"])


def test_last_seen_is_about_the_naive_guess(stored):
    """It knows of a minute where somebody was seen most, not last."""
    scores = {user: stored.metrics["naive"][user]["all"] for user in ("ana", "ben")}
    for user in ("ana", "ben"):
        assert scores[user]["top_1"] == pytest.approx(scores[user]["naive_top_1"], abs=0.1)
        better = stored.metrics["score"][user]["all"]
        assert better["naive_log_loss"] == scores[user]["naive_log_loss"]
        assert better["log_loss"] < scores[user]["log_loss"]


@pytest.mark.parametrize(
    ("user", "metric", "log_loss", "brier", "top_1"),
    [
        # Of six rooms each is as likely, and the person is in one of them.
        ("ben", "score", math.log(6), 1 - 1 / 6, 1 / 6),
        ("ben", "at_home", math.log(6), 1 - 1 / 6, 1 / 6),
        # Nobody guesses that a person who was never seen is away.
        ("gone", "score", -math.log(1e-6), 1 + 1 / 6, 0),
    ],
)
def test_naive_guess_of_somebody_who_was_never_seen_is_every_room_alike(
    user, metric, log_loss, brier, top_1
):
    blind = {"type": "patrol", "dwell": "20 s", "camera": None}
    unseen = run(
        content(
            "30 min",
            robots={"astro": blind},
            algorithms={"rtp": {"type": "real_time_presence"}},
            metrics={
                "score": {"type": "rtp_score", "of": "rtp"},
                "at_home": {"type": "rtp_score", "of": "rtp", "given_home": True},
            },
        )
    )
    assert 0 == len(table(unseen, "observations")["step"])
    scores = unseen.metrics[metric][user]
    assert {"never seen", "all"} == set(scores)
    for each in scores.values():
        assert 30 == each["bins"]
        assert log_loss == pytest.approx(each["naive_log_loss"], rel=1e-12)
        assert brier == pytest.approx(each["naive_brier"], rel=1e-12)
        assert top_1 == pytest.approx(each["naive_top_1"], rel=1e-12, abs=0)


@pytest.mark.parametrize("user", ["ana", "ben", "gone"])
def test_scores_of_each_gap_are_consistent(stored, user):
    for scores in stored.metrics["score"][user].values():
        parts = scores["reliability"] - scores["resolution"] + scores["uncertainty"]
        assert scores["brier"] == pytest.approx(parts)
        assert scores["top_1"] <= scores["top_2"] <= 1
        assert 0 <= scores["ece"] <= 1
        assert 0 <= scores["ece_classwise"] <= 1
        assert 0 <= scores["sharpness"] <= math.log(7)
        assert scores["skill"] == pytest.approx(1 - scores["log_loss"] / scores["naive_log_loss"])
        assert "reference_skill" not in scores


def test_a_reference_is_scored_on_the_same_bins(stored):
    for user, by_gap in stored.metrics["beside"].items():
        for gap, scores in by_gap.items():
            other = stored.metrics["naive"][user][gap]
            assert scores["bins"] == other["bins"]
            for name in ("log_loss", "brier", "top_1"):
                assert scores[f"reference_{name}"] == pytest.approx(other[name])
            expected = 1 - scores["log_loss"] / other["log_loss"] if other["log_loss"] else 0
            assert scores["reference_skill"] == pytest.approx(expected)
            plain = stored.metrics["score"][user][gap]
            assert {k: v for k, v in scores.items() if not k.startswith("reference")} == plain


def test_a_reference_that_is_missing_is_refused():
    metrics = {"score": {"type": "rtp_score", "of": "rtp", "reference": "lats"}}
    with pytest.raises(Fleet2DError, match="did you mean 'last'"):
        fleet2d.Simulation(content(metrics=metrics))


def test_bins_without_a_reference_forecast_are_skipped():
    """Long-term presence without a track knows nothing of the first period."""
    stored = run(
        content(
            "1 h",
            algorithms={
                "rtp": {"type": "real_time_presence"},
                "ltp": {"type": "long_term_presence", "period": "5 min"},
            },
            metrics={"score": {"type": "rtp_score", "of": "rtp", "reference": "ltp"}},
        )
    )
    scores = stored.metrics["score"]["ben"]["all"]
    assert 60 == scores["bins"]
    assert 0 < scores["reference_log_loss"] < 10
    assert scores["reference_skill"] != scores["skill"]


def test_bins_away_do_not_count_given_home(stored):
    lived = places(stored, "ana")
    at_home = sum(lived[end] != "away" for end in range(59, 10800, 60))
    assert at_home == stored.metrics["at_home"]["ana"]["all"]["bins"]


def test_metrics_change_nothing(stored):
    without = digests(run(content(metrics={})))
    with_ = digests(stored)
    for name in ("trajectories", "observations", "ltp", "rtp"):
        assert without[name] == with_[name]


def test_forecasts_are_used_if_an_algorithm_has_no_track():
    stored = run(
        content(
            metrics={"score": {"type": "rtp_score", "of": "ltp", "period": "30 min"}},
            algorithms={"ltp": {"type": "long_term_presence", "period": "30 min"}},
        )
    )
    # Of the first period nothing was known.
    assert 150 == stored.metrics["score"]["ben"]["all"]["bins"]


def test_another_period_than_that_of_the_track_is_refused():
    with pytest.raises(Fleet2DError, match="same period"):
        run(content(metrics={"score": {"type": "rtp_score", "of": "rtp", "period": "1 h"}}))


def test_an_output_that_is_no_presence_is_refused():
    from tests.scenes import OWN

    algorithms = {
        "tick": {"type": f"{OWN}:Smooth", "reads": ["share"]},
        "share": {"type": f"{OWN}:Share"},
    }
    with pytest.raises(Fleet2DError, match="this metric measures presence"):
        run(
            content(
                algorithms=algorithms,
                metrics={"error": {"type": "ltp_error", "of": "tick", "period": "1 h"}},
            )
        )


def test_burn_in_ends_where_the_error_stays_small():
    from fleet2d.metrics.ltp_error import LtpError

    metric = LtpError(of="ltp")
    metric.last, metric.within, metric.best, metric.days = {}, {}, {}, 0.0
    home = np.array([[0.6, 0.4], [0.6, 0.4]])
    presence = Presence(("ana",), home, np.zeros(2), datetime(2026, 1, 5))
    for tv in (0.3, 0.05, 0.2, 0.1, 0.09):
        metric.days += 1
        metric._note(["ana"], {"tv": np.array([tv])}, presence)
    assert 4 == metric.result()["ana"]["burn_in_day"]
    metric._note(["ana"], {"tv": np.array([0.11])}, presence)
    assert "burn_in_day" not in metric.result()["ana"]


def test_a_window_ignores_earlier_steps():
    """A person who changed rooms: the truth of the last hour is the new room alone."""
    agenda = [{"items": [{"at": "00:00", "place": "bedroom"}, {"at": "09:00", "place": "kitchen"}]}]
    settings = {"type": "ltp_gap", "of": "ltp", "period": "30 min"}
    stored = run(
        content(
            users={"ana": {"type": "schedule", "days": agenda}},
            metrics={"new": {**settings, "window": "1 h"}, "all": settings},
        )
    )
    rows = {name: table(stored, name, user="ana", room="kitchen_1") for name in ("new", "all")}
    assert rows["new"]["true_share"][-1] > 0.95
    assert rows["all"]["true_share"][-1] == pytest.approx(1 / 3, abs=0.02)


def test_hours_of_the_week_are_compared_one_by_one():
    week = {"type": "long_term_presence", "estimator": "sighting_share", "by": "hour_of_week"}
    stored = run(
        content(
            algorithms={"week": week},
            metrics={"e": {"type": "ltp_error", "of": "week", "given": "hour_of_week"}},
        )
    )
    assert 0 < stored.metrics["e"]["ben"]["tv"] < 1
    assert "earth_mover_m" not in stored.metrics["e"]["ben"]


def test_walking_distances_are_symmetric_and_far_for_unreachable_rooms():
    plan = fleet2d.Simulation(content()).home.plan
    home = Home(plan)
    metres = walking_distances(home, home.space(0.2))
    assert np.array_equal(metres, metres.T)
    assert (np.diagonal(metres) == 0).all()
    reached = metres[:4, :4]
    assert 2 * reached.max() == metres[4, 0]
    assert 2.5 < metres[0, 1] < 8
