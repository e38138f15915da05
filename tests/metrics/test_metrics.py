"""The metrics that come with Fleet2D, against what an every-step record of a run says."""

from itertools import pairwise
from typing import Any

import pytest
from tests.scenes import AGENDA, path, run, scenario, table

import fleet2d
from fleet2d.runs.run import Run


def content(period: str = "17 min") -> dict[str, Any]:
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


def rows(stored: Run, entity: str) -> list[dict[str, Any]]:
    """The poses of a body at every step, as plain rows."""
    columns = table(stored, "trajectories", entity=entity)
    return [
        dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)
    ]


@pytest.mark.parametrize("user", ["ana", "ben", "gone"])
def test_room_share_is_the_share_of_steps_in_each_room(stored, user):
    counts: dict[str, int] = {}
    for row in rows(stored, user):
        room = "away" if row["away"] else row["room"]
        counts[room] = counts.get(room, 0) + 1
    assert stored.metrics["room_share"][user] == {
        room: pytest.approx(count / 6000, rel=1e-12) for room, count in counts.items()
    }


def test_room_share_per_period_is_stored(stored):
    shares = table(stored, "room_share")
    ends = [*range(1020, 6000, 1020), 6000]
    assert sorted({end - 1 for end in ends}) == sorted(set(shares["step"].tolist()))
    everybody = {user: rows(stored, user) for user in ("ana", "ben", "gone")}
    for first, end in pairwise([0, *ends]):
        for user, lived in everybody.items():
            part = [("away" if row["away"] else row["room"]) for row in lived[first:end]]
            mine = (shares["step"] == end - 1) & (shares["user"] == user)
            share_by_room = dict(zip(shares["room"][mine], shares["share"][mine], strict=True))
            assert 7 == len(share_by_room)
            assert share_by_room == {
                room: pytest.approx(part.count(room) / len(part)) for room in share_by_room
            }


@pytest.mark.parametrize("user", ["ana", "ben"])
def test_sightings_are_the_share_of_steps_at_home_with_a_detection(stored, user):
    seen = set(table(stored, "observations", user=user)["step"].tolist())
    at_home = {row["step"] for row in rows(stored, user) if not row["away"]}
    assert 0 < len(seen) < len(at_home)
    assert stored.metrics["sightings"][user] == pytest.approx(len(seen) / len(at_home), rel=1e-12)


def test_users_who_were_never_at_home_have_no_share_of_sightings(stored):
    assert "gone" not in stored.metrics["sightings"]
    assert {"away": 1.0} == stored.metrics["room_share"]["gone"]


@pytest.mark.parametrize("name", ["ana", "ben", "astro", "bolt", "gone"])
def test_distance_is_the_sum_of_all_moves_per_day(stored, name):
    poses = path(stored, name)
    metres = 0.0
    for k in range(1, len(poses.x)):
        dx, dy = poses.x[k] - poses.x[k - 1], poses.y[k] - poses.y[k - 1]
        metres += (dx * dx + dy * dy) ** 0.5
    assert stored.metrics["distance"][name] == pytest.approx(metres / (6000 / 86400), rel=1e-9)


@pytest.mark.parametrize("period", ["11 s", "1 min", "1 d"])
def test_results_do_not_depend_on_the_period(stored, period):
    other = run(content(period)).metrics
    for metric, results in stored.metrics.items():
        for name, result in results.items():
            assert other[metric][name] == pytest.approx(result, rel=1e-9), (metric, name)


def test_metrics_of_a_run_without_users_are_empty():
    metrics = {"room_share": {}, "sightings": {}}
    empty = run(scenario(robots={"astro": "patrol"}, metrics=metrics))
    assert {"room_share": {}, "sightings": {}} == empty.metrics


def test_metrics_of_an_interrupted_run_are_of_the_simulated_steps():
    simulation = fleet2d.Simulation(content())
    simulation.advance(90)
    metrics = simulation.finish().metrics
    shares = metrics["room_share"]["ben"].values()
    assert sum(shares) == pytest.approx(1)


def test_metrics_of_a_run_without_a_step_say_nothing():
    metrics = fleet2d.Simulation(content()).finish().metrics
    assert {"room_share": {}, "sightings": {}, "distance": {}} == metrics
