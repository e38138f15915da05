"""The tables of a data set, made from one run: evidence, labels, beliefs, rooms, and the run."""

from collections.abc import Mapping, Sequence
from datetime import timedelta
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa

from fleet2d.algorithms.presence.belief import ANYONE
from fleet2d.artifacts.arrow import number_array, string_array, values_of
from fleet2d.datasets.specification import BELIEF, EVIDENCE, STAYS, PlannedRun
from fleet2d.kernels import I64
from fleet2d.runtime.clock import DAY_S

if TYPE_CHECKING:
    from fleet2d.runs.run import Run

TIME = pa.timestamp("us")
SCHEMAS: Mapping[str, pa.Schema] = {
    "runs": pa.schema(
        [
            ("run", pa.int32()),
            ("split", pa.string()),
            ("home", pa.string()),
            ("household", pa.string()),
            ("varied", pa.string()),
            ("users", pa.list_(pa.string())),
            ("seed", pa.int64()),
            ("start", TIME),
            ("days", pa.float64()),
            ("digest", pa.string()),
        ]
    ),
    "rooms": pa.schema(
        [
            ("run", pa.int32()),
            ("room", pa.string()),
            ("kind", pa.string()),
            ("area_m2", pa.float64()),
            ("x", pa.float64()),
            ("y", pa.float64()),
        ]
    ),
    "evidence": pa.schema(
        [
            ("run", pa.int32()),
            ("time", TIME),
            ("step", pa.int32()),
            ("room", pa.string()),
            ("kind", pa.string()),
            ("user", pa.string()),
            ("watched", pa.float32()),
            ("seen", pa.int16()),
        ]
    ),
    "labels": pa.schema(
        [
            ("run", pa.int32()),
            ("time", TIME),
            ("step", pa.int32()),
            ("user", pa.string()),
            ("place", pa.string()),
            ("next_place", pa.string()),
            ("next_step", pa.int32()),
            ("activity", pa.string()),
        ]
    ),
    "beliefs": pa.schema(
        [
            ("run", pa.int32()),
            ("time", TIME),
            ("step", pa.int32()),
            ("model", pa.string()),
            ("user", pa.string()),
            ("place", pa.string()),
            ("probability", pa.float32()),
        ]
    ),
}
"""The columns of each table.

`step` and `time` are those of the last step that a row may know of: of a bin of evidence its last,
of a belief the one at which it was held, of a label the one whose truth it tells. So evidence up to
a step, joined with the labels of that step, has no knowledge of the future.
"""


class Whereabouts(NamedTuple):
    """Where a user truly was, and what the user did.

    Attributes:
        begin: int64 (stays,), the first step of each stay, ascending.
        place: str (stays,), the name of the room, or away; consecutive ones differ.
        end: One past the last step.
        since: int64 (activities,), the first step of each activity.
        activity: str (activities,).
    """

    begin: I64
    place: Any
    end: int
    since: I64
    activity: Any

    def at(self, steps: I64) -> dict[str, Any]:
        """Return the labels of some steps: place, next place and the step at which it begins."""
        k = np.searchsorted(self.begin, steps, side="right") - 1
        is_last = k + 1 == len(self.begin)
        following = np.where(is_last, -1, k + 1)
        return {
            "place": text_array(self.place, k),
            "next_place": text_array(self.place, following),
            "next_step": np.where(is_last, np.nan, self.begin[following]),
            "activity": text_array(
                self.activity, np.searchsorted(self.since, steps, side="right") - 1
            ),
        }


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
        planned: What was planned for it.
        labels: Time between labels.
    """
    manifest = run.manifest
    start, step_us = np.datetime64(manifest["start"], "us"), int(manifest["step_us"])
    users = list(manifest["scenario"]["users"])
    number = planned.number

    def table(name: str, columns: Mapping[str, Any], rows: int) -> pa.Table:
        values = {"run": np.full(rows, number, np.int32), **columns}
        if "step" in columns:
            values["time"] = start + np.asarray(columns["step"], np.int64) * step_us
        arrays = [_array(values[field.name], field.type) for field in SCHEMAS[name]]
        return pa.table(arrays, names=SCHEMAS[name].names)

    rooms = run.plan.rooms
    made = {
        "runs": table("runs", _run_row(planned, users, start, run), 1),
        "rooms": table(
            "rooms",
            {
                "room": [room.name for room in rooms],
                "kind": [room.type for room in rooms],
                "area_m2": [room.area_m2 for room in rooms],
                "x": [room.anchor_xy[0] for room in rooms],
                "y": [room.anchor_xy[1] for room in rooms],
            },
            len(rooms),
        ),
    }
    bin_steps = max(1, 60_000_000 // step_us)
    made["evidence"] = empty_table("evidence")
    if EVIDENCE in run.tables:
        looks = run.arrow(EVIDENCE)
        columns = {name: looks[name] for name in ("room", "kind", "user", "watched", "seen")}
        columns["step"] = values_of(looks["bin"]) + bin_steps - 1
        made["evidence"] = table("evidence", columns, len(looks))
    every = max(1, labels // timedelta(microseconds=step_us))
    steps = np.arange(every - 1, int(manifest["steps"]), every)
    of_users = [
        {"step": steps, "user": text_array([user], np.zeros(len(steps), np.int64))}
        | whereabouts(run, user).at(steps)
        for user in users
    ]
    made["labels"] = _joined("labels", [table("labels", own, len(steps)) for own in of_users])
    of_models = [_belief(run, name) for name in run.tables if name.startswith(BELIEF)]
    made["beliefs"] = _joined(
        "beliefs",
        [
            table("beliefs", own, len(own["step"])).filter(
                number_array(values_of(own["user"]) != ANYONE, pa.bool_())
            )
            for own in of_models
        ],
    )
    return made


def _joined(name: str, parts: Sequence[pa.Table]) -> pa.Table:
    return pa.concat_tables(parts).unify_dictionaries() if parts else empty_table(name)


def empty_table(name: str) -> pa.Table:
    """Return a table of a run that has no rows."""
    return pa.table(
        [_array(np.zeros(0, np.int64), field.type) for field in SCHEMAS[name]],
        names=SCHEMAS[name].names,
    )


def _run_row(planned: PlannedRun, users: Sequence[str], start: Any, run: "Run") -> dict[str, Any]:
    fixed = {"home", "household"}
    varied = [f"{name}={value}" for name, value in planned.labels.items() if name not in fixed]
    return {
        "split": [planned.split],
        "home": [str(planned.labels["home"])],
        "household": [str(planned.labels["household"])],
        "varied": ["; ".join(varied)],
        "users": pa.ListArray.from_arrays(
            number_array(np.array([0, len(users)], np.int32), pa.int32()), string_array(users)
        ),
        "seed": [planned.seed],
        "start": np.array([start]),
        "days": [float(run.manifest["simulated_s"]) / DAY_S],
        "digest": [run.digest],
    }


def columns_of(run: "Run", name: str, columns: Sequence[str]) -> dict[str, Any]:
    """Return columns of a table of a run as arrays; texts as objects."""
    table = run.arrow(name)
    return {column: values_of(table[column]) for column in columns}


def whereabouts(run: "Run", user: str) -> Whereabouts:
    """Return where a user truly was, from the tables `stays` and `events` of a run."""
    stays = columns_of(run, STAYS, ["user", "place", "begin", "end"])
    own = stays["user"] == user
    place, begin, end = stays["place"][own], stays["begin"][own], stays["end"][own]
    is_new = np.append(True, place[1:] != place[:-1])[: len(place)]
    since, activity = np.zeros(0, np.int64), np.zeros(0, object)
    if "events" in run.tables:
        events = columns_of(run, "events", ["event", "entity", "step", "detail"])
        is_own = (events["event"] == "activity") & (events["entity"] == user)
        since, activity = events["step"][is_own], events["detail"][is_own]
    return Whereabouts(begin[is_new], place[is_new], int(end[-1]), since, activity)


def _belief(run: "Run", name: str) -> dict[str, Any]:
    """Return the rows of the belief of a model, also those about anyone."""
    rows = run.arrow(name)
    share = values_of(rows["share"]).reshape(-1, len(run.plan.rooms) + 1).copy()  # away last
    share[:, :-1] *= 1 - share[:, -1:]  # of all time, not given at home
    at = "at" if "at" in rows.column_names else "step"  # of `belief_table`, of `rtp`
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
    missing = np.isnan(numbers) if kind in (pa.int32(), pa.int64()) else None
    if missing is not None and missing.any():
        numbers = np.where(missing, 0, numbers)
    return number_array(numbers.astype(kind.to_pandas_dtype()), kind, missing)
