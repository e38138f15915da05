"""What Home Assistant keeps: the database of its recorder, and the history that its APIs answer.

Its REST API answers JSON with a list of states for each entity, of which only the first needs to
name it (`minimal_response`); its WebSocket API an object, with short keys, and `lc` where a change
wasn't an update, too::

    [[{"entity_id": "person.ana", "state": "home", "last_changed": "2026-03-29T07:02:11+00:00"},
      {"state": "not_home", "last_changed": "2026-03-29T08:10:00+00:00"}]]

    {"person.ana": [{"s": "home", "lu": 1774767731.0}, {"s": "not_home", "lu": 1774771800.0}]}
"""

import json
import re
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from fleet2d.bounds import JSON_VALUES, LOG_BYTES, LOG_ROWS, check_file, one_line, read_bytes
from fleet2d.errors import os_errors_as
from fleet2d.logs.log import LogError, encoding_of

StateRow = tuple[str, str, datetime, int, str]
"""An entity, its state, the time from which it has it, the number of the row, and the area."""
DATABASE = b"SQLite format 3\0"
"""How a database begins."""
_QUERIES = {
    "metadata_id": "SELECT m.entity_id, s.state, coalesce(s.last_changed_ts, s.last_updated_ts)"
    " FROM states s JOIN states_meta m ON s.metadata_id = m.metadata_id"
    " ORDER BY coalesce(s.last_changed_ts, s.last_updated_ts), s.state_id",
    "entity_id": "SELECT entity_id, state, coalesce(last_changed, last_updated) FROM states"
    " ORDER BY coalesce(last_changed, last_updated), state_id",
}
"""The query of each edition of the database, by a column that only it has."""
# A database that takes longer is damaged, or isn't Home Assistant's [s].
_MAX_SECONDS = 60.0
_STEPS_BETWEEN = 1_000_000
# JSON: a list of lists or objects, or an object; of other layouts no line begins so.
_HISTORY = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:\[\s*[\[{\]]|\{\s*[\"}])")
_BEGIN_BYTES = 1000
# Keys of the messages that carry a history.
_ENVELOPES = ("result", "event", "states")
_TIMES = ("last_changed", "last_updated", "lc", "lu")
_EXPECTED = "expected a history of Home Assistant, [[{entity_id, state, last_changed}, …], …]"


def reader_of(path: Path) -> Callable[[Path], Iterator[StateRow]] | None:
    """Return what reads a database or a history; None: the file is neither, or no regular file.

    A file of JSON Lines isn't a history.
    """
    if not path.is_file() or path.suffix.lower() in (".jsonl", ".ndjson"):
        return None
    with path.open("rb") as file:
        begin = file.read(_BEGIN_BYTES)
    if begin.startswith(DATABASE):
        return read_database
    return read_history if _HISTORY.match(begin) else None


def read_database(path: Path) -> Iterator[StateRow]:
    """Yield the states in the database of a recorder, in order of time.

    Raises:
        LogError: It can't be read, or holds no states.
    """
    check_file(path, LOG_BYTES, LogError)
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as database:
            begun = time.monotonic()
            database.set_progress_handler(
                lambda: time.monotonic() - begun > _MAX_SECONDS, _STEPS_BETWEEN
            )
            kinds = dict(database.execute("SELECT name, type FROM sqlite_master").fetchall())
            names = {row[1] for row in database.execute("PRAGMA table_info(states)")}
            query = next((text for column, text in _QUERIES.items() if column in names), None)
            # A view could be any query, and never end.
            if query is None or "view" in (kinds["states"], kinds.get("states_meta")):
                raise LogError(f"{path} has no table of states, as Home Assistant's recorder has")
            for number, (entity, state, at) in enumerate(database.execute(query), 1):
                if number > LOG_ROWS.limit:
                    LOG_ROWS.check(number, path, LogError, prefix="more than ")
                if entity is not None and at is not None:
                    moment = _moment(at, f"{path}, row {number}")
                    yield str(entity), "" if state is None else str(state), moment, number, ""
    except sqlite3.Error as error:
        raise LogError(f"{path} can't be read: {error}") from None


def read_history(path: Path) -> Iterator[StateRow]:
    """Yield the states in a history, one entity after the other; they are numbered from 1.

    Raises:
        LogError: It can't be read, is no history, or a state is damaged.
    """
    number = 0
    for entity, states in _by_entity(path, _content(path)):
        for state in states:
            number += 1
            where = f"{path}, state {number}"
            if not isinstance(state, dict):
                raise LogError(f"{where}: {_EXPECTED}, got {one_line(json.dumps(state))}")
            entity = str(state.get("entity_id", entity))
            word = state.get("state", state.get("s"))
            at = next((state[key] for key in _TIMES if key in state), None)
            if not entity or word is None or at is None:
                raise LogError(f"{where}: {_EXPECTED}, got {one_line(json.dumps(state))}")
            yield entity, str(word), _moment(at, where), number, ""


def _content(path: Path) -> Any:
    with os_errors_as(LogError, f"{path} can't be read"):
        text = read_bytes(path, LOG_BYTES, LogError).decode(encoding_of(path), "replace")
    values = text.count(",") + text.count("[") + text.count("{")
    JSON_VALUES.check(values, path, LogError, prefix="about ")
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise LogError(
            f"{path} is not JSON: {error.msg} in line {error.lineno}, column {error.colno}"
        ) from None
    except (RecursionError, ValueError) as error:  # the latter of too long a number
        raise LogError(f"{path} can't be read: {one_line(error)}") from None


def _by_entity(path: Path, content: Any) -> Iterable[tuple[str, list[Any]]]:
    """Return the name of each entity and its states; "" where the states name it.

    Raises:
        LogError: It is no history.
    """
    for envelope in _ENVELOPES:
        if isinstance(content, dict) and isinstance(content.get(envelope), dict | list):
            content = content[envelope]
    pairs = list(content.items()) if isinstance(content, dict) else [("", part) for part in content]
    if all(isinstance(part, dict) for _, part in pairs) and isinstance(content, list):
        return [("", content)]
    if all(isinstance(part, list) for _, part in pairs):
        return pairs
    raise LogError(f"{path}: {_EXPECTED}, got {one_line(json.dumps(content))}")


def _moment(at: object, where: str) -> datetime:
    """Return a time: seconds since 1970, or text, without an offset in UTC."""
    try:
        if isinstance(at, int | float):
            return datetime.fromtimestamp(at, UTC)
        moment = datetime.fromisoformat(str(at))
    except (ValueError, OverflowError, OSError):
        raise LogError(f"{where}: {one_line(repr(at))} is not a time") from None
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)
