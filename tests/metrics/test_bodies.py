"""Stays: where users truly were, without gaps."""

import numpy as np

import fleet2d


def test_stays_cover_the_run_and_agree_with_the_trajectory():
    run = fleet2d.run(
        "bundled:paper", "simulation.duration=30 h", metrics={"stays": {"period": "7 h"}}, seed=3
    )
    rows = {name: np.array(v, object) for name, v in run.arrow("stays").to_pydict().items()}

    begin, end = rows["begin"].astype(int), rows["end"].astype(int)
    assert [0, *end[:-1]] == begin.tolist()
    assert end[-1] == 30 * 3600
    path, rooms = run.path("ana"), [room.name for room in run.plan.rooms]  # every minute
    places = [
        "away" if away else rooms[room] for room, away in zip(path.room, path.away, strict=True)
    ]
    stay = np.searchsorted(begin, path.step, side="right") - 1
    assert places == rows["place"][stay].tolist()
    assert {"away", "bedroom_1"} <= set(places)


def test_without_users_there_is_no_table():
    run = fleet2d.run(
        "bundled:paper",
        "simulation.duration=1 h",
        users={"ana": None},
        metrics={"stays": {}},
        seed=3,
    )
    assert "stays" not in run.tables or not run.arrow("stays").num_rows
