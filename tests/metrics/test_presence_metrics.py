"""Errors of long-term and scores of real-time presence, against the stored rows of a run."""

import math
from collections import Counter
from datetime import datetime

import numpy as np
import pytest
from tests.reference import presence as slow
from tests.scenes import digests, run, scenario, table

import fleet2d
from fleet2d.algorithms.presence.belief import Presence
from fleet2d.errors import Fleet2DError
from fleet2d.floorplan.home import Home
from fleet2d.metrics.ltp_error import LtpError, walking_distances

ROOMS = [
    f"{name}_1" for name in ("living_room", "kitchen", "bedroom", "bathroom", "storage", "unknown")
]
PLACES = [*ROOMS, "away"]
USERS = {
    "ana": {"type": "room_sampling", "shares": {"kitchen": 3, "bedroom": 5, "away": 2}},
    "ben": {"type": "meander"},
    "gone": {"type": "schedule", "days": [{"items": [{"at": "00:00", "away": True}]}]},
}


def content(duration="3 h", **changes):
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


def places(stored, user):
    rows = table(stored, "trajectories", entity=user)
    return ["away" if away else room for away, room in zip(rows["away"], rows["room"], strict=True)]


def shares(stored, algorithm, user, step):
    """The shares of rooms at home, and that of away, of the update at a step."""
    rows = table(stored, algorithm, user=user)
    at = rows["step"] == step
    by_room = dict(zip(rows["room"][at], rows["share"][at], strict=True))
    return np.array([by_room[place] for place in PLACES])


def with_away(parts):
    """The distribution over all places, from shares at home and that of away."""
    return np.append(parts[:-1] * (1 - parts[-1]), parts[-1])


@pytest.mark.slow
@pytest.mark.parametrize("user", ["ana", "ben"])
def test_ltp_error_is_the_distance_to_the_truth(stored, user):
    rows, gap = table(stored, "error", user=user), table(stored, "gap", user=user)
    lived = places(stored, user)
    best = []
    for k, step in enumerate((3599, 7199, 10799)):
        time = np.array([lived[: step + 1].count(place) for place in PLACES])
        truth = time[:-1] / time[:-1].sum()
        estimated = shares(stored, "ltp", user, step)
        gaps = np.abs(truth - estimated[:-1])
        assert {
            "tv": gaps.sum() / 2,
            "max_gap": gaps.max(),
            "mean_gap": gaps.mean(),
            "tau": slow.kendall(truth, estimated[:-1]),
        } == pytest.approx({name: rows[name][k] for name in ("tv", "max_gap", "mean_gap", "tau")})
        assert gaps == pytest.approx(gap["gap"][gap["step"] == step])
        whole = np.abs(time / (step + 1) - with_away(estimated)).sum() / 2
        assert whole == pytest.approx(table(stored, "with_away", user=user)["tv"][k])
        best.append(estimated[:-1].argmax())
    result = stored.metrics["error"][user]
    assert (np.count_nonzero(np.diff(best)), rows["tv"][-1]) == (result["flips"], result["tv"])
    assert stored.metrics["gap"][user]["mean"] == pytest.approx(rows["mean_gap"][-1])


def test_anyone_is_in_every_occupied_room(stored):
    together = np.array([places(stored, user) for user in USERS])
    time = np.array([(together == room).any(axis=0).sum() for room in ROOMS])
    estimated = shares(stored, "ltp", "anyone", 10799)[:-1]
    tv = np.abs(time / time.sum() - estimated).sum() / 2
    assert tv == pytest.approx(stored.metrics["error"]["anyone"]["tv"])


def test_users_who_were_never_at_home_are_skipped(stored):
    for metric in ("error", "gap"):
        assert {"ana", "ben", "anyone"} == set(stored.metrics[metric])
    assert {"ana", "ben"} == set(stored.metrics["at_home"])


@pytest.mark.slow
@pytest.mark.parametrize("user", ["ana", "ben", "gone"])
def test_rtp_score_is_of_each_minute_and_by_the_gap(stored, user):
    lived, rows = places(stored, user), table(stored, "score", user=user)
    steps = table(stored, "observations", user=user)["step"]  # nobody is mistaken here
    names = ["0-1 min", "1-5 min", "5-15 min", "15-60 min", "1-4 h", "over 4 h", "never seen"]
    counts = Counter()
    for end in range(59, 10800, 60):
        last = max(steps[steps <= end], default=-math.inf)
        counts[names[np.searchsorted([1, 5, 15, 60, 240, 1e9], (end - last) / 60)]] += 1
    result = stored.metrics["score"][user]
    assert counts == {name: scores["bins"] for name, scores in result.items() if name != "all"}
    assert 180 == result["all"]["bins"] == rows["bins"].sum()
    for name in ("log_loss", "brier", "top_1"):
        assert rows[name].sum() / 180 == pytest.approx(result["all"][name])
    # At the end of a period the track is what was put out.
    beliefs = [with_away(shares(stored, "minutely", user, end)) for end in range(59, 10800, 60)]
    said = [
        b[PLACES.index(lived[end])] for b, end in zip(beliefs, range(59, 10800, 60), strict=True)
    ]
    each = stored.metrics["each"][user]["all"]
    assert -np.log(np.maximum(said, 1e-6)).mean() == pytest.approx(each["log_loss"])
    assert np.mean(said == np.max(beliefs, axis=1)) == pytest.approx(each["top_1"])


@pytest.mark.parametrize(
    ("user", "metric", "chance", "top_1"),
    [
        # Of six rooms each is as likely, and the person is in one of them.
        ("ben", "score", 1 / 6, 1 / 6),
        ("ben", "at_home", 1 / 6, 1 / 6),
        # Nobody guesses that a person who was never seen is away.
        ("gone", "score", 1e-6, 0),
    ],
)
def test_naive_guess_of_somebody_who_was_never_seen_is_every_room_alike(
    user, metric, chance, top_1
):
    blind = {"astro": {"type": "patrol", "dwell": "20 s", "camera": None}}
    score = {"type": "rtp_score", "of": "rtp"}
    metrics = {"score": score, "at_home": {**score, "given_home": True}}
    algorithms = {"rtp": {"type": "real_time_presence"}}
    unseen = run(content("30 min", robots=blind, algorithms=algorithms, metrics=metrics))
    scores = unseen.metrics[metric][user]
    assert {"never seen", "all"} == set(scores)
    brier = 1 - 1 / 6 if top_1 else 1 + 1 / 6
    for each in scores.values():
        found = [each[n] for n in ("bins", "naive_log_loss", "naive_brier", "naive_top_1")]
        assert [30, -math.log(chance), brier, top_1] == pytest.approx(found)


@pytest.mark.parametrize("user", ["ana", "ben", "gone"])
def test_scores_of_each_gap_are_consistent(stored, user):
    for gap, scores in stored.metrics["score"][user].items():
        parts = scores["reliability"] - scores["resolution"] + scores["uncertainty"]
        assert scores["brier"] == pytest.approx(parts)
        assert scores["top_1"] <= scores["top_2"] <= 1
        assert scores["skill"] == pytest.approx(1 - scores["log_loss"] / scores["naive_log_loss"])
        # A reference is scored on the same bins, and changes nothing else.
        other = stored.metrics["naive"][user][gap]
        skill = 1 - scores["log_loss"] / other["log_loss"] if other["log_loss"] else 0
        reference = {f"reference_{n}": other[n] for n in ("log_loss", "brier", "top_1")}
        beside = scores | reference | {"reference_skill": skill}
        assert beside == pytest.approx(stored.metrics["beside"][user][gap])


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
    metric = LtpError(of="ltp")
    metric.last, metric.within, metric.best, metric.days = {}, {}, {}, 0.0
    home = np.array([[0.6, 0.4], [0.6, 0.4]])
    presence = Presence(("ana",), home, np.zeros(2), datetime(2026, 1, 5))
    burn_in = []
    for tv in (0.3, 0.05, 0.2, 0.1, 0.09, 0.11):
        metric.days += 1
        metric._note(["ana"], {"tv": np.array([tv])}, presence)
        burn_in.append(metric.result()["ana"].get("burn_in_day"))
    assert [None, 2, None, 4, 4, None] == burn_in


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
