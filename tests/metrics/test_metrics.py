"""The metrics that come with Fleet2D, against what an every-step record of a run says."""

from itertools import pairwise

import numpy as np
import polars as pl
import pytest
from tests.scenes import AGENDA, path, run, scenario

import fleet2d


def content(period="17 min"):
    return scenario(
        "1 h 40 min",
        users={
            "ana": {"type": "schedule", "days": AGENDA},
            "ben": {"type": "meander"},
            "gone": {"type": "schedule", "days": [{"items": [{"at": "00:00", "away": True}]}]},
        },
        robots={
            "astro": {"type": "patrol", "dwell": "20 s", "camera": {"detection": 0.8}},
            "bolt": {"type": "meander"},
        },
        metrics={name: {"period": period} for name in ("room_share", "sightings", "distance")},
        artifacts={"trajectories": "every step"},
    )


@pytest.fixture(scope="module")
def stored():
    """A run with metrics whose period does not divide it."""
    return run(content())


@pytest.fixture(scope="module")
def lives(stored):
    """The poses of all bodies at every step, with "away" as the room of who is out."""
    rows = stored.polars("trajectories")
    away = pl.when("away").then(pl.lit("away")).otherwise("room")
    return rows.with_columns(place=away)


@pytest.mark.parametrize("user", ["ana", "ben", "gone"])
def test_room_share_is_the_share_of_steps_in_each_room(stored, lives, user):
    places = [*(room.name for room in stored.plan.rooms), "away"]
    lived = lives.filter(entity=user)["place"]
    expected = {place: pytest.approx((lived == place).mean()) for place in places}
    assert stored.metrics["room_share"][user] == expected


def test_room_share_per_period_is_stored(stored, lives):
    ends = [*range(1020, 6000, 1020), 6000]
    shares = stored.polars("room_share")
    assert [end - 1 for end in ends] == shares["step"].unique().sort().to_list()
    for first, end in pairwise([0, *ends]):
        period = lives.filter(pl.col("step").is_between(first, end - 1))
        for user, room, share in shares.filter(step=end - 1)["user", "room", "share"].iter_rows():
            lived = period.filter(entity=user)["place"]
            assert share == pytest.approx((lived == room).mean())


@pytest.mark.parametrize("user", ["ana", "ben"])
def test_sightings_are_the_share_of_steps_at_home_with_a_detection(stored, lives, user):
    seen = stored.polars("observations").filter(user=user)["step"].n_unique()
    at_home = lives.filter(entity=user, away=False).height
    assert 0 < seen < at_home
    assert stored.metrics["sightings"][user] == pytest.approx(seen / at_home)


def test_users_who_were_never_at_home_have_no_share_of_sightings(stored):
    assert "gone" not in stored.metrics["sightings"]
    places = stored.metrics["room_share"]["gone"].items()
    assert {"away": 1.0} == {place: share for place, share in places if share}


@pytest.mark.parametrize("name", ["ana", "ben", "astro", "bolt", "gone"])
def test_distance_is_the_sum_of_all_moves_per_day(stored, name):
    poses = path(stored, name)
    metres = np.hypot(np.diff(poses.x), np.diff(poses.y)).sum()
    assert stored.metrics["distance"][name] == pytest.approx(metres / (6000 / 86400))


@pytest.mark.parametrize("period", ["11 s", "1 d"])
def test_results_do_not_depend_on_the_period(stored, period):
    other = run(content(period)).metrics
    for metric, results in stored.metrics.items():
        for name, result in results.items():
            assert other[metric][name] == pytest.approx(result, rel=1e-9), (metric, name)


def test_metrics_of_a_run_without_users_are_empty():
    metrics = {"room_share": {}, "sightings": {}}
    empty = run(scenario(robots={"astro": "patrol"}, metrics=metrics))
    assert {"room_share": {}, "sightings": {}} == empty.metrics


@pytest.mark.parametrize("steps", [0, 90])
def test_metrics_of_an_interrupted_run_are_of_the_simulated_steps(steps):
    simulation = fleet2d.Simulation(content())
    simulation.advance(steps)
    metrics = simulation.finish().metrics
    if steps:
        assert sum(metrics["room_share"]["ben"].values()) == pytest.approx(1)
    else:
        assert {"room_share": {}, "sightings": {}, "distance": {}} == metrics
