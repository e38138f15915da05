"""Runs as the history of a smart home, in the database of Home Assistant's recorder."""

import sqlite3
from contextlib import closing
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path

import pytest
from tests.engine.test_sensors import household, plan  # noqa: F401  (a fixture)
from tests.scenes import run

import fleet2d
from fleet2d.errors import RunDirectoryError
from fleet2d.live.exporters import export
from fleet2d.logs.layouts.states import read_states

STATES = """
SELECT m.entity_id, s.state, s.last_updated_ts FROM states s JOIN states_meta m USING (metadata_id)
ORDER BY s.state_id
"""


def states_of(path: Path, entity) -> list[tuple[str, datetime]]:
    with closing(sqlite3.connect(path)) as database:
        rows = database.execute(STATES).fetchall()
    return [(state, datetime.fromtimestamp(at, UTC)) for name, state, at in rows if name == entity]


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    """A day in Berlin."""
    path = tmp_path_factory.mktemp("history") / "home-assistant_v2.db"
    export(berlin(), path)
    return path


@cache
def berlin() -> fleet2d.Run:
    changes = ("simulation.duration=1 d", "simulation.time_zone=Europe/Berlin")
    return fleet2d.run("bundled:paper", *changes, seed=4)


def test_rooms_and_presence_equal_the_poses_at_each_step(database):
    path = berlin().path("ana", timedelta(seconds=60))
    begin = datetime(2026, 1, 4, 23, 0, tzinfo=UTC)  # midnight in Berlin
    rooms = states_of(database, "sensor.ana_room")
    presence = states_of(database, "person.ana")

    for step, away, room in zip(path.step.tolist(), path.away, path.room, strict=True):
        if not away and room < 0:
            continue
        at = begin + timedelta(seconds=step)
        name = "not_home" if away else berlin_rooms()[room]
        assert name == [state for state, since in rooms if since <= at][-1]
        now = [state for state, since in presence if since <= at][-1]
        assert now == ("not_home" if away else "home")


@cache
def berlin_rooms():
    return [room.name for room in fleet2d.load_floorplan("family_home").rooms]


def test_our_reader_of_recorders_reads_the_readings_of_sensors(
    plan,  # noqa: F811
    tmp_path,
):
    stored = run(household(plan))
    path = tmp_path / "home.db"
    export(stored, path)

    log = read_states(path, time_zone="UTC")

    shown = [reading.room for reading in log.readings]
    table = stored.tables["sensors"].to_pylist()
    on = [f"binary_sensor.{row['sensor']}" for row in table if row["state"] in ("ON", "OPEN")]
    assert [name for name in shown if name.startswith("binary_sensor")] == on


def test_names_that_would_be_one_entity_are_refused(tmp_path):
    home = {
        "extends": "bundled:paper",
        "simulation": {"duration": "1 min"},
        "users": {"Ana": {"type": "routine", "persona": "retired"}},
    }

    with pytest.raises(RunDirectoryError, match="rename one in the scenario"):
        export(fleet2d.run(home), tmp_path / "home.db")
