"""What a robot can know as a table: complete, at its own time, and nothing that isn't perceived."""

import numpy as np
import pytest

import fleet2d


def simulated(*overrides, **settings):
    return fleet2d.run(
        "bundled:paper",
        "simulation.duration=6 h",
        "simulation.start=2026-01-05 06:00",
        "robots.astro.behaviors=[{type: patrol, dwell: 10 min}]",
        *overrides,
        algorithms={"evidence": {"type": "evidence_table"}},
        **{"metrics": {"stays": {}}, "seed": 3, **settings},
    )


@pytest.fixture(scope="module")
def run():
    return simulated()


def columns(run, name="evidence"):
    return {k: np.array(v, object) for k, v in run.arrow(name).to_pydict().items()}


def test_rows_are_of_the_bins_own_time(run):
    rows = columns(run)

    minutes = rows["bin"].astype(int) // 60 + 6 * 60
    assert np.array_equal(minutes % 1440, rows["minute"].astype(int))
    assert set(rows["day"]) == {np.datetime64("2026-01-05").astype(object).toordinal()}
    assert (np.diff(rows["bin"].astype(int)) >= 0).all()


def test_sightings_are_those_of_the_observations(run):
    rows, seen = columns(run), columns(run, "observations")
    of_ana = rows["user"] == "ana"

    steps = np.unique(seen["step"][seen["user"] == "ana"].astype(int))
    assert len(steps) == rows["seen"][of_ana].sum()
    assert set(steps // 60 * 60) == set(rows["bin"][of_ana])


def test_rooms_that_were_looked_at_and_empty_have_rows(run):
    rows = columns(run)
    kinds = {room.name: room.type for room in run.plan.rooms}

    is_empty = (rows["user"] == "anyone") & (rows["seen"] == 0)
    assert is_empty.sum() > 100
    assert (rows["watched"][is_empty] > 0).all()
    assert all(kinds[room] == kind for room, kind in zip(rows["room"], rows["kind"], strict=True))


def test_a_person_who_is_never_in_view_changes_nothing():
    """Ben lives in a room that the robot never looks into: whatever he does, the rows are equal."""
    stays = "[{type: patrol, rooms: [kitchen], dwell: 1 h}]"
    rows = []
    for persona in ("retired", "student"):
        ben = {"type": "routine", "persona": persona}
        run = simulated(
            f"robots.astro.behaviors={stays}",
            "robots.astro.camera.range=[0.3, 0.31]",
            users={"ana": None, "ben": ben},
        )
        rows.append(columns(run))

    assert all(np.array_equal(rows[0][name], rows[1][name]) for name in rows[0])
    assert set(rows[0]["user"]) <= {"anyone"}


def test_the_future_changes_nothing(run):
    shorter = columns(simulated("simulation.duration=3 h"))

    longer = columns(run)
    early = longer["bin"].astype(int) < 3 * 3600
    assert all(np.array_equal(shorter[name], longer[name][early]) for name in shorter)


def test_without_users_there_are_looks_only():
    rows = columns(simulated(users={"ana": None}))

    assert set(rows["user"]) == {"anyone"}
    assert not rows["seen"].any()
