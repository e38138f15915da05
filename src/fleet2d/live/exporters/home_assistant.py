"""A run as the history of a smart home: the database of Home Assistant's recorder."""

import json
import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fleet2d.configuration.components import components
from fleet2d.entities.sensor import Sensor
from fleet2d.errors import RunDirectoryError
from fleet2d.live.exporters import Records, Selection, new_file
from fleet2d.live.peers import DEVICE_CLASSES
from fleet2d.runs.run import Run
from fleet2d.runs.trajectory import Trajectory
from fleet2d.runtime.clock import Clock
from fleet2d.runtime.local_time import stamp_us

# The version of the database, of Home Assistant 2024.3. Later versions migrate it at their start
# and make the missing tables; a start looks for the first four.
SCHEMA = 42
TABLES = """
CREATE TABLE states (state_id INTEGER PRIMARY KEY, entity_id CHAR(0), state VARCHAR(255),
 attributes CHAR(0), event_id SMALLINT, last_changed CHAR(0), last_changed_ts FLOAT,
 last_updated CHAR(0), last_updated_ts FLOAT, old_state_id INTEGER, attributes_id INTEGER,
 context_id CHAR(0), context_user_id CHAR(0), context_parent_id CHAR(0), origin_idx SMALLINT,
 context_id_bin BLOB, context_user_id_bin BLOB, context_parent_id_bin BLOB, metadata_id INTEGER);
CREATE TABLE events (event_id INTEGER PRIMARY KEY, event_type CHAR(0), event_data CHAR(0),
 origin CHAR(0), origin_idx SMALLINT, time_fired CHAR(0), time_fired_ts FLOAT, context_id CHAR(0),
 context_user_id CHAR(0), context_parent_id CHAR(0), data_id INTEGER, context_id_bin BLOB,
 context_user_id_bin BLOB, context_parent_id_bin BLOB, event_type_id INTEGER);
CREATE TABLE recorder_runs (run_id INTEGER PRIMARY KEY, start DATETIME NOT NULL, "end" DATETIME,
 closed_incorrect BOOLEAN NOT NULL, created DATETIME NOT NULL);
CREATE TABLE schema_changes (change_id INTEGER PRIMARY KEY, schema_version INTEGER,
 changed DATETIME NOT NULL);
CREATE TABLE states_meta (metadata_id INTEGER PRIMARY KEY, entity_id VARCHAR(255));
CREATE TABLE state_attributes (attributes_id INTEGER PRIMARY KEY, hash BIGINT, shared_attrs TEXT);
CREATE INDEX ix_states_metadata_id_last_updated_ts ON states (metadata_id, last_updated_ts);
CREATE INDEX ix_states_context_id_bin ON states (context_id_bin);
CREATE INDEX ix_states_last_updated_ts ON states (last_updated_ts);
CREATE INDEX ix_states_old_state_id ON states (old_state_id);
CREATE INDEX ix_states_attributes_id ON states (attributes_id);
CREATE INDEX ix_events_event_type_id_time_fired_ts ON events (event_type_id, time_fired_ts);
CREATE INDEX ix_events_context_id_bin ON events (context_id_bin);
CREATE INDEX ix_events_time_fired_ts ON events (time_fired_ts);
CREATE INDEX ix_events_data_id ON events (data_id);
CREATE INDEX ix_recorder_runs_start_end ON recorder_runs (start, "end");
CREATE UNIQUE INDEX ix_states_meta_entity_id ON states_meta (entity_id);
CREATE INDEX ix_state_attributes_hash ON state_attributes (hash);
"""
AWAY = "not_home"


class _EntityState(NamedTuple):
    """A state of an entity, from a step on."""

    step: int
    entity: str
    state: str


def export_home_assistant(run: Run, path: Path, part: Selection) -> str:
    """Write the database of a recorder, with the states of people, robots and sensors.

    `person.NAME` is `home` or `not_home`; `sensor.NAME_room` is the room of a user or robot;
    `binary_sensor.NAME` is a sensor of the scenario.

    Args:
        run: A run with key frames.
        path: The file to write, such as `home-assistant_v2.db`.
        part: The part of the run; states that begin and end within its `every` are left out.

    Returns:
        A line with the number of states.

    Raises:
        RunDirectoryError: The file can't be written, or two names would be one entity.
    """
    clock = run.clock
    entities = _entities(run)
    records = Records(run, part)
    bodies = len(records.users) + len(records.robots)
    if len(entities) < len(records.users) + bodies + len(_sensors(run)):
        raise RunDirectoryError(
            f"{path}: two names of people, robots or sensors differ in capitals, spaces or _ only,"
            " and would be one entity of Home Assistant: rename one in the scenario"
        )
    number = {entity: row for row, entity in enumerate(entities, 1)}
    last: dict[str, int] = {}
    rows = []
    for count, state in enumerate(_states(run, part), 1):
        at = _utc_us(clock, state.step) / 1e6
        entity = number[state.entity]
        rows.append((count, state.state, at, last.get(state.entity), entity, entity))
        last[state.entity] = count
    first = _utc(clock, part.first)
    end = _utc(clock, part.end)
    names = [(row, name) for name, row in number.items()]
    attributes = [(number[name], json.dumps(each)) for name, each in entities.items()]
    with closing(sqlite3.connect(":memory:")) as database:
        database.executescript(TABLES)
        database.execute("INSERT INTO schema_changes VALUES (1, ?, ?)", (SCHEMA, first))
        database.execute("INSERT INTO recorder_runs VALUES (1, ?, ?, 0, ?)", (first, end, first))
        database.executemany("INSERT INTO states_meta VALUES (?, ?)", names)
        database.executemany(
            "INSERT INTO state_attributes (attributes_id, shared_attrs) VALUES (?, ?)", attributes
        )
        database.executemany(
            "INSERT INTO states (state_id, state, last_updated_ts, old_state_id, attributes_id,"
            " metadata_id, origin_idx) VALUES (?, ?, ?, ?, ?, ?, 0)",
            rows,
        )
        database.commit()
        content = database.serialize()
    with new_file(path) as file:
        file.write(content)
    return f"{len(rows):,} states of {len(entities)} entities in {path}"


def _utc_us(clock: Clock, step: int) -> int:
    """Return the time of a step [us since 1970]; local times of a run without zone count as UTC."""
    return stamp_us(clock.start) + step * clock.step_us


def _utc(clock: Clock, step: int) -> str:
    moment = datetime.fromtimestamp(_utc_us(clock, step) / 1e6, UTC)
    return moment.replace(tzinfo=None).isoformat(" ", "microseconds")


def entity_name(kind: str, name: str) -> str:
    """Return the name of an entity in the letters that Home Assistant accepts.

    Example:
        >>> entity_name("sensor", "Küche 2"), entity_name("person", "مريم")
        ('sensor.k_fcche_2', 'person._645_631_64a_645')
    """
    plain = re.sub(r"[^a-z0-9_ ]", lambda letter: f"_{ord(letter[0]):x}", name.lower())
    return f"{kind}.{plain.replace(' ', '_')}"


def _entities(run: Run) -> dict[str, dict[str, str]]:
    """Return the attributes of each entity, by its name."""
    records = Records(run, Selection.of(run))
    entities = {}
    for name in records.users:
        entities[entity_name("person", name)] = {"friendly_name": name}
    for name in (*records.users, *records.robots):
        entities[entity_name("sensor", f"{name} room")] = {"friendly_name": f"{name}: room"}
    for name, kind in _sensors(run).items():
        attributes = {"friendly_name": name}
        if kind.type_name in DEVICE_CLASSES:
            attributes["device_class"] = DEVICE_CLASSES[kind.type_name]
        entities[entity_name("binary_sensor", name)] = attributes
    return entities


def _sensors(run: Run) -> dict[str, type[Sensor]]:
    """Return the class of each sensor by its name; for a scenario's own classes the base class."""
    known = components("object")
    objects = run.manifest["scenario"].get("objects", {})
    classes = {name: known.get(item["type"], Sensor) for name, item in objects.items()}
    return {name: kind for name, kind in classes.items() if issubclass(kind, Sensor)}


def _states(run: Run, part: Selection) -> Iterator[_EntityState]:
    """Yield the states of the entities, in order of time."""
    records = Records(run, part)
    rooms = [room.name for room in run.plan.rooms]
    sensors = _sensors(run)
    for name in sensors:
        yield _EntityState(part.first, entity_name("binary_sensor", name), "off")
    now: dict[str, str] = {}
    tables = ["sensors"] if "sensors" in run.tables else []
    for chunk in records.chunks(tables=tables):
        states: list[_EntityState] = []
        for name, way in chunk.poses.items():
            inside = entity_name("sensor", f"{name} room")
            person = entity_name("person", name)
            for step, room in _rooms(way, rooms):
                states.append(_EntityState(step, inside, room))
                if name in records.users:
                    states.append(_EntityState(step, person, AWAY if room == AWAY else "home"))
        for row in chunk.rows.get("sensors", ()):
            on, _ = sensors[row["sensor"]].words
            entity = entity_name("binary_sensor", row["sensor"])
            state = "on" if row["state"] == on else "off"
            states.append(_EntityState(row["step"], entity, state))
        for each in sorted(states, key=attrgetter("step")):
            if now.get(each.entity) != each.state:
                now[each.entity] = each.state
                yield each


def _rooms(way: Trajectory, rooms: list[str]) -> Iterator[tuple[int, str]]:
    """Yield the steps at which a body's room changes, and the room; `AWAY` while it is away."""
    known = np.flatnonzero(way.away | (way.room >= 0))
    index = np.where(way.away, -1, way.room)[known]
    changes = np.flatnonzero(np.diff(index, prepend=-2))
    words = [*rooms, AWAY]  # -1 is the index of the last
    for step, room in zip(way.step[known][changes].tolist(), index[changes].tolist(), strict=True):
        yield step, words[room]
