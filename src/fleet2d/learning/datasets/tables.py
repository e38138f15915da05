"""The tables of a data set, made from one run: evidence, labels, beliefs, rooms, and the run."""

from collections.abc import Mapping, Sequence
from datetime import timedelta
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from fleet2d.algorithms.evidence import steps_of_bin
from fleet2d.algorithms.presence.belief import ANYONE
from fleet2d.artifacts.arrow import number_array, string_array, values_of
from fleet2d.kernels import I64
from fleet2d.learning.datasets.specification import BELIEF, EVIDENCE, STAYS, PlannedRun
from fleet2d.runtime.clock import DAY_S
from fleet2d.runtime.events import EventKind

if TYPE_CHECKING:
    from fleet2d.floorplan.rooms.room import Room
    from fleet2d.runs.run import Run

OFFSET = "utc_offset_min"
"""The minutes by which local time is ahead of UTC: in the hour that a change of clocks doubles,
`time` alone is ambiguous."""
MINUTE = np.timedelta64(1, "m")
_KINDS: Mapping[str, pa.DataType] = {
    **dict.fromkeys(("run", "step", "next_step"), pa.int32()),
    **dict.fromkeys(("time", "start"), pa.timestamp("us")),
    **dict.fromkeys(("area_m2", "x", "y", "days"), pa.float64()),
    **dict.fromkeys(("watched", "probability"), pa.float32()),
    **dict.fromkeys(("seen", OFFSET), pa.int16()),
    "seed": pa.int64(),
    "users": pa.list_(pa.string()),
}
"""The types of columns; all others are texts."""
_COLUMNS = {
    "runs": "run split home household varied users seed start days digest",
    "rooms": "run room kind area_m2 x y",
    "evidence": f"run time {OFFSET} step room kind user watched seen",
    "labels": f"run time {OFFSET} step user place next_place next_step activity",
    "beliefs": f"run time {OFFSET} step model user place probability",
}


def _schema_of(names: str) -> pa.Schema:
    return pa.schema([(name, _KINDS.get(name, pa.string())) for name in names.split()])


SCHEMAS: Mapping[str, pa.Schema] = {name: _schema_of(each) for name, each in _COLUMNS.items()}
"""The columns of each table.

`step` and `time` are those of the last step that a row may know of: of a bin of evidence its last,
of a belief the one at which it was held, of a label the one whose truth it tells. So evidence up to
a step, joined with the labels of that step, has no knowledge of the future. `time` is local; its
offset from UTC is null if the home has no time zone.
"""


def text_array(names: Sequence[str], index: I64) -> pa.DictionaryArray:
    """Return names by their index, null where that is negative, without a copy of each.

    Example:
        >>> text_array(["office", "away", "office"], np.array([2, 1, 0, -1])).to_pylist()
        ['office', 'away', 'office', None]
    """
    codes = {name: code for code, name in enumerate(dict.fromkeys(names))}
    code_of = np.array([codes[name] for name in names] or [0], np.int32)
    indices = number_array(code_of[index], pa.int32(), index < 0)
    return pa.DictionaryArray.from_arrays(indices, string_array([*codes]))


def tables_of(run: "Run", planned: PlannedRun, labels: timedelta) -> dict[str, pa.Table]:
    """Return the tables of a run of a data set, with texts as dictionaries.

    Args:
        run: The run, in memory or stored.
        planned: The plan of the run.
        labels: Time between labels.
    """
    manifest = run.manifest
    clock = run.clock
    start = clock.times(np.zeros(1, np.int64))[0]
    step_us = int(manifest["step_us"])
    users = list(manifest["scenario"]["users"])
    every = max(1, labels // timedelta(microseconds=step_us))
    steps = np.arange(every - 1, int(manifest["steps"]), every)
    parts: dict[str, list[dict[str, Any]]] = {
        "runs": [_run_row(planned, users, start, run)],
        "rooms": [_rooms(run.plan.rooms)],
        "evidence": [_evidence(run, step_us)] if EVIDENCE in run.tables else [],
        "labels": [_labels(run, user, steps) for user in users],
        "beliefs": [_belief(run, name) for name in run.tables if name.startswith(BELIEF)],
    }
    for columns in chain.from_iterable(parts.values()):
        rows = len(next(iter(columns.values())))
        columns["run"] = np.full(rows, planned.number, np.int32)
        if "step" in columns:
            at = np.asarray(columns["step"], np.int64)
            local = clock.times(at)
            columns["time"] = local
            offset = (local - clock.stamps(at)) // MINUTE
            columns[OFFSET] = np.full(rows, np.nan) if clock.zone is None else offset
    return {name: _table(name, of_table) for name, of_table in parts.items()}


def _table(name: str, parts: Sequence[Mapping[str, Any]]) -> pa.Table:
    """Return a table of some parts, each with all columns; without parts, it has no rows."""
    schema = SCHEMAS[name]
    nothing = dict.fromkeys(schema.names, np.zeros(0, np.int64))
    tables = []
    for columns in parts or [nothing]:
        arrays = [_array(columns[field.name], field.type) for field in schema]
        tables.append(pa.table(arrays, names=schema.names))
    return pa.concat_tables(tables).unify_dictionaries()


def _rooms(rooms: Sequence["Room"]) -> dict[str, Any]:
    anchors = np.array([room.anchor_xy for room in rooms])
    return {
        "room": [room.name for room in rooms],
        "kind": [room.type for room in rooms],
        "area_m2": [room.area_m2 for room in rooms],
        "x": anchors[:, 0],
        "y": anchors[:, 1],
    }


def _run_row(planned: PlannedRun, users: Sequence[str], start: Any, run: "Run") -> dict[str, Any]:
    fixed = {"home", "household"}
    varied = [f"{name}={value}" for name, value in planned.labels.items() if name not in fixed]
    ends = number_array(np.array([0, len(users)], np.int32), pa.int32())
    return {
        "split": [planned.split],
        "home": [str(planned.labels["home"])],
        "household": [str(planned.labels["household"])],
        "varied": ["; ".join(varied)],
        "users": pa.ListArray.from_arrays(ends, string_array(users)),
        "seed": [planned.seed],
        "start": np.array([start]),
        "days": [float(run.manifest["simulated_s"]) / DAY_S],
        "digest": [run.digest],
    }


def columns_of(run: "Run", name: str, columns: Sequence[str]) -> dict[str, Any]:
    """Return columns of a table of a run as arrays; texts as objects."""
    table = run.arrow(name)
    return {column: values_of(table[column]) for column in columns}


def _labels(run: "Run", user: str, steps: I64) -> dict[str, Any]:
    """Return the true place and activity of a user at some steps, and the next place and its step.

    Steps at which nobody knows, as in the gaps of a log, are left out.
    """
    stays = columns_of(run, STAYS, ["user", "place", "begin"])
    own = stays["user"] == user
    place = stays["place"][own]
    begin = stays["begin"][own]
    is_new = np.append(True, place[1:] != place[:-1])[: len(place)]
    place = place[is_new]
    begin = begin[is_new]
    since: I64 = np.zeros(0, np.int64)
    activity: Any = np.zeros(0, object)
    if "events" in run.tables:
        every = columns_of(run, "events", ["event", "entity", "step", "detail"])
        is_own = every["entity"] == user
        event, step, detail = (every[name][is_own] for name in ("event", "step", "detail"))
        is_activity = event == EventKind.ACTIVITY
        since = step[is_activity]
        activity = detail[is_activity]
        is_change = np.isin(event, [EventKind.KNOWN, EventKind.UNKNOWN])
        is_unknown = np.append(False, event[is_change] == EventKind.UNKNOWN)
        last_change = np.searchsorted(step[is_change], steps, side="right")
        steps = steps[~is_unknown[last_change]]
    stay = np.searchsorted(begin, steps, side="right") - 1
    is_last = stay + 1 == len(begin)
    following = np.where(is_last, -1, stay + 1)
    last_activity = np.searchsorted(since, steps, side="right") - 1
    return {
        "step": steps,
        "user": text_array([user], np.zeros(len(steps), np.int64)),
        "place": text_array(place, stay),
        "next_place": text_array(place, following),
        "next_step": np.where(is_last, np.nan, begin[following]),
        "activity": text_array(activity, last_activity),
    }


def _evidence(run: "Run", step_us: int) -> dict[str, Any]:
    looks = run.arrow(EVIDENCE)
    columns = {name: looks[name] for name in ("room", "kind", "user", "watched", "seen")}
    return {**columns, "step": values_of(looks["bin"]) + steps_of_bin(step_us) - 1}


def _belief(run: "Run", name: str) -> dict[str, Any]:
    """Return the rows of the belief of a model about each user."""
    rows = run.arrow(name)
    rows = rows.filter(number_array(values_of(rows["user"]) != ANYONE, pa.bool_()))
    places = len(run.plan.rooms) + 1  # the last place is away
    share = values_of(rows["share"]).reshape(-1, places).copy()
    share[:, :-1] *= 1 - share[:, -1:]  # shares of all time rather than of time at home
    at = "at" if "at" in rows.column_names else "step"  # only `belief_table` has `at`
    return {
        "step": values_of(rows[at]),
        "model": text_array([name.removeprefix(BELIEF)], np.zeros(len(rows), np.int64)),
        "user": rows["user"],
        "place": rows["room"],
        "probability": share.ravel(),
    }


def _array(values: Any, kind: pa.DataType) -> Any:
    """Return values as an array of a type, a dictionary for text; NaN as null in whole numbers."""
    if isinstance(values, pa.Array | pa.ChunkedArray):
        if kind != pa.string():
            return values.cast(kind)
        return values if pa.types.is_dictionary(values.type) else values.dictionary_encode()
    if kind == pa.string():
        return text_array(values, np.arange(len(values)))
    numbers = np.asarray(values)
    missing = None
    if pa.types.is_integer(kind):
        missing = np.isnan(numbers)
        numbers = np.where(missing, 0, numbers)
    return number_array(numbers.astype(kind.to_pandas_dtype()), kind, missing)
