"""States of entities over time: a table of any smart home, or what Home Assistant keeps.

::

    entity_id,state,last_changed
    binary_sensor.kitchen_motion,on,2026-03-28T23:30:00.123Z
    person.ana,not_home,2026-03-29T07:02:11.000Z
    sensor.ana_room,kitchen,2026-03-29T16:20:45.000Z

Home Assistant's recorder is a database, `home-assistant_v2.db`, which is read as it is, and so is
the history that its APIs answer.
"""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from datetime import datetime
from datetime import time as clock
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from fleet2d.bounds import one_line
from fleet2d.configuration.problems import counted, suggest
from fleet2d.configuration.units import micros
from fleet2d.errors import errors_as
from fleet2d.logs.layouts import home_assistant
from fleet2d.logs.layouts.home_assistant import StateRow
from fleet2d.logs.log import (
    AWAY,
    ActivityLog,
    LogError,
    Reading,
    in_order,
    log_lines,
    parse_time,
)
from fleet2d.runtime.clock import DAY_US
from fleet2d.runtime.local_time import Zone, rules_of, wall_us

_ENTITIES = ("entity_id", "entity", "device", "sensor", "name", "item")
_VALUES = ("state", "value", "status")
_AREAS = ("area", "area_name", "area_id", "room", "location")
_TIMES = ("last_changed", "last_updated", "time", "timestamp", "datetime", "date")
HEAD = re.compile(
    rf"(?=.*\b(?:{'|'.join(_ENTITIES)})\b)(?=.*\b(?:{'|'.join(_VALUES)})\b)"
    rf"(?=.*\b(?:{'|'.join(_TIMES)})\b)(?!.*\b[xy]\b).*",
    re.IGNORECASE,
)
"""The first line of a table."""
_ON = frozenset({"on", "open", "opened", "detected", "occupied", "motion", "present", "true", "1"})
_OFF = frozenset({"off", "closed", "close", "clear", "false", "0", "idle", "absent", "no_motion"})
_PEOPLE = ("person.", "device_tracker.")
_UNKNOWN = frozenset({"unavailable", "unknown", "none", ""})
_OUT = frozenset({"not_home", "away", "absent"})
# States of a person who isn't away; others are not_home and names of places, such as Work.
_NOT_OUT = _ON | _UNKNOWN | {"home"}


class _StateLine(NamedTuple):
    """A state of an entity, from a time on."""

    entity: str
    state: str
    time: datetime
    line: int
    area: str


def read_states(
    path: Path,
    *,
    id: str | None = None,  # noqa: A002 - the name of the key
    time_zone: str | None = None,
    zone: Zone | None = None,
    sort: bool = False,
) -> ActivityLog:
    """Read the states of a home: what switches on shows that somebody is there at that instant.

    Labels are the areas that a table has, else the entities. While a person is not at home, by a
    `person` or `device_tracker`, it is away. A sensor that tells a person's room, as ESPresense
    and Bermuda make them of phones, is named by `id`: then its states are the labels.

    Args:
        path: The table, or the database.
        id: The person's entity, if there are several, or the sensor that tells its room.
        time_zone: The time zone of the home, if times have an offset or are of a database.
        zone: The clock of a home whose days have 23 or 25 hours, too.
        sort: Put rows in order of time.

    Raises:
        LogError: A row is damaged, there are several people, or a time zone is missing or unknown.
    """
    read = home_assistant.reader_of(path) or _table
    rows = list(read(path))
    zone = None if zone is None else _of_years(path, rows, zone)
    states = list(_local(path, rows, zone or time_zone))
    if not states:
        raise LogError(f"{path} holds no reading: is it the right file?")
    entities = {state.entity for state in states}
    tells_room = id in entities and not id.startswith(_PEOPLE)
    person = None if tells_room else _person(path, entities, id)
    states = _in_order(path, states, "line" if read is _table else "state", sort=sort)
    first_midnight = datetime.combine(min(state.time for state in states).date(), clock.min)
    begin = first_midnight if zone is None else zone.at(first_midnight)
    first_day = min(state.time for state in states).date()
    if tells_room:
        readings = _stays(states, str(id), begin)
        words = [state.state.strip().lower() for state in states if state.entity == id]
        others = Counter("unavailable" for word in words if word in _UNKNOWN)
    else:
        readings, others = _shown(states, person, begin)
    gone = others.pop("unavailable", 0)
    names = one_line(", ".join(sorted(others)[:5]), 200)
    advice = "if one tells the room of a person, name it by id"
    if others and not readings:
        raise LogError(f"{path}: nothing switches on; it has {names}: {advice}")
    readings, notes = in_order(readings, path, sort=sort)
    if gone:
        notes.append(f"left out as unavailable or unknown: {counted(gone, 'state')}")
    if others:
        left = counted(others.total(), "state")
        notes.append(f"left out as neither on nor off: {left} of {names}; {advice}")
    return ActivityLog(path, "states", first_day, tuple(readings), tuple(notes))


def _shown(
    states: list[_StateLine], person: str | None, begin: datetime
) -> tuple[list[Reading], Counter[str]]:
    """Return what switching on and being away show, and how many states of an entity do neither."""
    readings: list[Reading] = []
    others: Counter[str] = Counter()
    absence: int | None = None  # the reading of being away that isn't over
    for state in states:
        at = micros(state.time - begin)
        word = state.state.strip().lower()
        if state.entity.startswith(_PEOPLE):
            is_out = word not in _NOT_OUT and state.entity == person
            if absence is not None and state.entity == person:
                readings[absence] = readings[absence]._replace(end_us=at)
                absence = None
            if is_out:
                absence = len(readings)
                readings.append(Reading(at, at, AWAY, "", state.line))
        elif word in _ON:
            readings.append(Reading(at, at, state.area or state.entity, "", state.line))
        elif word not in _OFF:
            others["unavailable" if word in _UNKNOWN else state.entity] += 1
    return readings, others


def _stays(states: list[_StateLine], sensor: str, begin: datetime) -> list[Reading]:
    """Return the stays of a person whose room a sensor tells; the last one ends with the log."""
    told = [state for state in states if state.entity == sensor]
    readings = []
    for state, following in pairwise([*told, states[-1]]):
        room = state.state.strip()
        label = AWAY if room.lower() in _OUT else room
        at = micros(state.time - begin)
        end = micros(following.time - begin)
        if room.lower() not in _UNKNOWN:
            # A reading lasts a day at most.
            parts = range(at, max(end, at + 1), DAY_US)
            readings += [Reading(t, min(end, t + DAY_US), label, "", state.line) for t in parts]
    return readings


def _in_order(path: Path, states: list[_StateLine], noun: str, *, sort: bool) -> list[_StateLine]:
    """Return states in order of time; a file may have one entity after the other.

    A place in the file is a number of the noun.

    Raises:
        LogError: The times of an entity run backwards, and `sort` is off.
    """
    last: dict[str, datetime] = {}
    for state in () if sort else states:
        if state.time < last.get(state.entity, state.time):
            raise LogError(
                f"{path}, {noun} {state.line}: the time of {state.entity} runs backwards there;"
                f" check the clock of the log, or put its {noun}s in order of time by 'sort: true'"
                " (as an option, --sort)"
            )
        last[state.entity] = state.time
    return sorted(states, key=lambda state: state.time)


def _person(path: Path, entities: set[str], name: str | None) -> str | None:
    """Return the entity of the person.

    Raises:
        LogError: There are several people, or not the one that is named.
    """
    people = sorted(entity for entity in entities if entity.startswith("person."))
    people = people or sorted(entity for entity in entities if entity.startswith(_PEOPLE))
    if name is not None and name not in people:
        raise LogError(f"{path} has no person {name!r}{suggest(name, people, 'It has')}")
    if name is None and len(people) > 1:
        raise LogError(f"{path} has several people: choose one by id: {', '.join(people)}")
    return name or next(iter(people), None)


def _table(path: Path) -> Iterator[StateRow]:
    lines = [text for _, text in log_lines(path)]
    mark = max(",;\t", key=lines[0].count) if lines else ","
    rows = csv.reader(lines, delimiter=mark)
    head = [name.strip().lower() for name in next(rows, [])]
    columns = [_column(head, names) for names in (_ENTITIES, _VALUES, _TIMES)]
    area = _column(head, _AREAS)
    if min(columns) < 0:
        raise LogError(f"{path}: expected columns like entity_id, state and last_changed in line 1")
    for line, row in enumerate(rows, 2):
        if len(row) <= max(*columns, area):
            raise LogError(f"{path}, line {line}: expected {len(head)} values, got {len(row)}")
        entity, state, text = (row[column].strip() for column in columns)
        place = row[area].strip() if area >= 0 else ""
        yield entity, state, parse_time(text, path, line), line, place


def _column(head: list[str], names: tuple[str, ...]) -> int:
    """Return the place of the first of some names in a head; -1: none is there."""
    return next((head.index(name) for name in names if name in head), -1)


def _of_years(path: Path, rows: list[StateRow], zone: Zone) -> Zone:
    """Return the clock of a home for the years of a log.

    Raises:
        LogError: This machine has no rules of its time zone.
    """
    times_us = [wall_us(moment.replace(tzinfo=None)) for _, _, moment, *_ in rows] or [0]
    with errors_as(LogError, f"{path}: there are no rules of the time zone", of=KeyError):
        return zone.over(min(times_us), max(times_us))


def _local(path: Path, rows: Iterable[StateRow], zone: Zone | str | None) -> Iterator[_StateLine]:
    """Yield states with local times: of a clock that changes, if it is given.

    Raises:
        LogError: Times have an offset and there is no time zone, or it is unknown.
    """
    rules = None
    if isinstance(zone, str):
        with errors_as(LogError, f"{path}: time_zone", of=KeyError):
            rules = rules_of(zone)
    for entity, state, moment, line, area in rows:
        local = moment
        if isinstance(zone, Zone):
            local = zone.at(moment)
        elif moment.tzinfo is not None and rules is None:
            raise LogError(
                f"{path}, line {line}: times have an offset: name the home's time_zone, such as"
                " Europe/Berlin"
            )
        elif moment.tzinfo is not None:
            local = moment.astimezone(rules).replace(tzinfo=None)
        yield _StateLine(entity, state, local, line, area)
