"""Postures of people over time, from the key frames of a stored run and its furniture.

Runs store where people are, and not whether they stand, sit or lie: that follows from the place.
Somebody who stays at the place where furniture is sat or lain on sits or lies there. Who sits where
there is no furniture for it counts as standing: over six days of the family, 99.1 % of the postures
that a camera saw are the same.
"""

from bisect import bisect_right
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from fleet2d.artifacts.table import categories
from fleet2d.floorplan.plan import FloorPlan
from fleet2d.kernels import F64, I64, Bool
from fleet2d.runs.run import Run
from fleet2d.viewing.contract import PostureFacts, UseFacts

USED_WITHIN_M = 0.16
"""Somebody who is farther from a place to use furniture than this doesn't use it."""

KEY_FRAMES = "key_frames"


SCHEMA = {
    "step": "int64",
    "time_us": "int64",
    "end_us": "int64",
    "user": "string",
    "posture": "string",
    "object": "string",
    "x": "float64",
    "y": "float64",
    "heading": "float64",
}


class PostureStay(NamedTuple):
    """A stretch of time [us since the start] that a user spends at one place [m] at home."""

    user: str
    begin_us: int
    end_us: int
    x: float
    y: float


def postures_of(run: Run, plan: FloorPlan) -> Any:
    """Return a table of the stretches of time in which people sit or lie, by user and time.

    Its columns are `step`, the first one; `time_us` and `end_us`, microseconds since the start;
    `user`; `posture`, sit or lie; `object`, the piece of furniture; `x` and `y` [m] and `heading`
    [rad], where and how the user is on it. At all other times people stand, walk or are away.
    Furniture counts as it is when the run starts.

    Raises:
        ArtifactError: The key frames are damaged.

    Example:
        >>> import fleet2d
        >>> run = fleet2d.run("bundled:paper", "simulation.duration=1 h")
        >>> postures_of(run, run.plan)["posture"].to_pylist()
        ['lie']
    """
    import pyarrow as pa

    step_us = run.manifest["step_us"]
    rests = [
        (item.name, use) for item in plan.objects for use in item.uses if use.posture != "stand"
    ]
    rows: list[tuple[Any, ...]] = []
    places = np.array([(use.x, use.y) for _, use in rests]).reshape(-1, 2)
    for stay in _stays(run) if rests else ():
        far = np.hypot(*(places - (stay.x, stay.y)).T)
        nearest = int(np.argmin(far))
        if far[nearest] >= USED_WITHIN_M:
            continue
        name, use = rests[nearest]
        step = -(-stay.begin_us // step_us)
        at = (use.x, use.y, use.heading)
        # Who turns around on furniture stays on it.
        if rows and rows[-1][2:4] == (stay.begin_us, stay.user) and rows[-1][5:] == (name, *at):
            step, begin_us, *_ = rows.pop()
            stay = stay._replace(begin_us=begin_us)
        rows.append((step, stay.begin_us, stay.end_us, stay.user, use.posture, name, *at))
    columns = zip(*rows, strict=True) if rows else ([] for _ in SCHEMA)
    arrays = [
        pa.array(list(column), getattr(pa, kind)())
        for column, kind in zip(columns, SCHEMA.values(), strict=True)
    ]
    return pa.table(arrays, names=list(SCHEMA))


class Postures:
    """The postures of people of a run, by user and time."""

    def __init__(self, run: Run, plan: FloorPlan) -> None:
        """Derive the postures of a run.

        Raises:
            ArtifactError: The key frames are damaged.
        """
        self._begins: dict[str, list[int]] = {}
        self._rows: dict[str, list[dict[str, Any]]] = {}
        for row in postures_of(run, plan).to_pylist():
            self._begins.setdefault(row["user"], []).append(row["time_us"])
            self._rows.setdefault(row["user"], []).append(row)

    def at(self, user: str, time_us: int) -> dict[str, Any] | None:
        """Return the row of a user at a time [us since the start]; None: the user stands."""
        number = bisect_right(self._begins.get(user, []), time_us) - 1
        row = self._rows[user][number] if number >= 0 else None
        return row if row is not None and time_us < row["end_us"] else None


def posture_facts(run: Run, plan: FloorPlan) -> PostureFacts:
    """Return the postures of people as the page receives them.

    Raises:
        ArtifactError: The key frames are damaged.
    """
    table = postures_of(run, plan)
    uses: dict[tuple[float, ...], int] = {}
    facts = PostureFacts(uses=[], user=[], use=[], from_us=[], to_us=[])
    for row in table.to_pylist():
        key = (row["x"], row["y"], row["heading"])
        if key not in uses:
            uses[key] = len(uses)
            x, y, heading = key
            facts["uses"].append(UseFacts(x=x, y=y, heading=heading, posture=row["posture"]))
        facts["user"].append(row["user"])
        facts["use"].append(uses[key])
        facts["from_us"].append(row["time_us"])
        facts["to_us"].append(row["end_us"])
    return facts


def _stays(run: Run) -> Iterator[PostureStay]:
    """Yield the stays of each user at home, in order."""
    if KEY_FRAMES not in run.tables:
        return
    table = run.tables[KEY_FRAMES]
    entity, names = categories(table["entity"])
    kind, kinds = categories(table["kind"])
    start = np.datetime64(run.manifest["start"], "us")
    step_us = run.manifest["step_us"]
    keys = _Keys(
        time_us=(table["time"].to_numpy().astype("M8[us]") - start).astype(np.int64),
        holds_us=table["step"].to_numpy() * step_us,
        begins=kind == (kinds.index("planned") if "planned" in kinds else len(kinds)),
        x=table["x"].to_numpy(),
        y=table["y"].to_numpy(),
        away=table["away"].to_numpy(),
        end_us=run.manifest["steps"] * step_us,
    )
    for user in run.manifest["entities"]["users"]:
        if user in names:
            yield from _stays_of(user, np.flatnonzero(entity == names.index(user)), keys)


class _Keys(NamedTuple):
    """Key frames: when each is reached, and from when its piece holds [us since the start].

    `begins` says which begin a piece that was planned.
    """

    time_us: I64
    holds_us: I64
    begins: Bool
    x: F64
    y: F64
    away: Bool
    end_us: int


def _stays_of(user: str, rows: I64, keys: _Keys) -> Iterator[PostureStay]:
    """Yield the stays of a user; a piece of key frames holds until the next one begins."""
    firsts = np.flatnonzero(keys.begins[rows] | (np.arange(len(rows)) == 0)).tolist()
    for first, end in zip(firsts, [*firsts[1:], len(rows)], strict=True):
        piece = rows[first:end].tolist()
        since = int(keys.holds_us[piece[0]])
        until = int(keys.holds_us[rows[end]]) if end < len(rows) else keys.end_us
        for row, following in zip(piece, [*piece[1:], None], strict=True):
            x, y = float(keys.x[row]), float(keys.y[row])
            stay_ends = until
            if following is not None:
                if (x, y) != (keys.x[following], keys.y[following]):
                    continue
                stay_ends = min(int(keys.time_us[following]), until)
            begin = max(int(keys.time_us[row]), since)
            if stay_ends > begin and not keys.away[row]:
                yield PostureStay(user, begin, stay_ends, x, y)
